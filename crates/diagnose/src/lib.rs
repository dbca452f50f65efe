//! draft
mod arrival_model;
mod bins;
mod config;
mod diagnosis;
mod discrepancy;
mod effect;
mod effects;
mod energy_model;
mod error;
mod extended_model;
mod gauss_newton;
mod kernel;
mod measured;
mod recording_chain;
mod rendering;
mod search;
mod survey;
mod traced_pair;
mod views;
mod workbench;

pub use config::DiagnoseConfig;
pub use diagnosis::{
    CandidateScore, Cause, DecayCurves, Diagnosis, FittedMaterial, FoundParameter, HeldOut, HeldOutGain,
    Isolability, LackOfFit, ResidualCell, Verdict,
};
pub use effect::{Case, Effect, Evidence, Nuisance, Parameter, Stage};
pub use effects::*;
pub use error::Error;
pub use extended_model::{CoupledDecay, Dimensions, ExtendedModel};
pub use rendering::ExtendedRoom;
pub use survey::{Place, Survey, SurveyedResponse};
pub use views::{ArrivalView, BandView};

/// Draft: everything printed.
pub fn draft(room: &sabine_acoustics::MeasuredRoom, config: &DiagnoseConfig) -> Result<(), Error> {
    use std::time::Instant;
    let t = Instant::now();
    let mut bench = workbench::Workbench::new(room, config, &())?;
    eprintln!("{:?} total {:?}", bench.seconds, t.elapsed());
    let used = vec![true; bench.pairs.len()];
    let all: Vec<usize> = (0..bench.pairs.len()).collect();
    let (b, _) = bench.fit_energy(&[], &used, None)?;
    let r = bench.residuals(&[], &b.values, &all);
    eprintln!("bins {} dispersion raw {:.2?}", r.len(), workbench::dispersion(&r, bench.survey.bands.len()));
    bench.calibrate_dispersion(&[], &used)?;
    eprintln!("dispersion {:.2?}", bench.dispersion);
    let effects = catalogue();
    let cases = search::cases(&effects, &bench.survey);
    let t = Instant::now();
    let search = search::Search::new(&bench, &cases, effects.len(), used.clone());
    let mut state = search.state(&[], None)?;
    let free = bench.free_discrepancy();
    for round in 0..3 {
        let mut e = search.cases_of(&state.chosen, Evidence::Energy);
        e.push(&free);
        let z = bench.fit_energy(&e, &used, Some(&state.energy.values))?.0;
        eprintln!(
            "state Z {:.1} (E {:.1} A {:.1} P {:.1}) free {:+.1}",
            state.log_evidence(),
            state.energy.log_evidence,
            state.arrivals.log_evidence,
            state.polarity,
            z.log_evidence - state.energy.log_evidence
        );
        let scores = search.by_effect(&search.scores(&state, &())?);
        for s in scores.iter().take(8) {
            eprintln!("  {:22} {:8.1} {:?}", s.id, s.nats, search.candidates[s.best].case.subject());
        }
        if scores[0].nats < search.threshold() || round == 2 {
            break;
        }
        for s in search.rivals(&state, &scores)? {
            eprintln!("  rival {}", s.id);
        }
        state = search.with(&state, scores[0].best)?;
        let n = search.candidates[scores[0].best].case.parameters(&bench.survey).len();
        let m = if search.candidates[scores[0].best].case.evidence() == Evidence::Arrivals {
            &state.arrivals
        } else {
            &state.energy
        };
        for (i, p) in search.candidates[scores[0].best].case.parameters(&bench.survey).iter().enumerate() {
            let k = m.values.len() - n + i;
            eprintln!("     {} {:.3} +- {:.3} {}", p.name, m.values[k], m.sd(k), p.unit);
        }
    }
    eprintln!("search {:?}", t.elapsed());
    Ok(())
}
