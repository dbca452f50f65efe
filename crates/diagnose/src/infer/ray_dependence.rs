//! What the evidence for a cause owes to the number of rays.
//!
//! A predicted decay is noisy by the rays that were drawn, and a cause that makes it smoother comes nearer to the measurement for that
//! alone. This gain falls as one over the number of rays: what half of the rays say more for a cause, all of them still say too much, and
//! evidence extrapolated to any number of rays is less by the difference (Richardson's extrapolation). A name that could be chance at all
//! ([`could_be_chance`]) is looked for again with several times as many rays before that.

use crate::effect::{Case, Observable};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::infer::search::{Search, State};
use crate::simulate::scene_tracer::SceneTracer;
use sabine_acoustics::Observer;
use web_time::Instant;

/// A cause of decays with more evidence than this is not asked for with more rays, in nats. A choice, to save time: chance was seen to lend 24
/// nats in a room that scatters (docs/validation/diagnose.md, rooms that are no box), and more where nothing does.
const BEYOND_CHANCE_NATS: f64 = 100.0;

/// Whether one of the chosen causes bears on decays and could owe its evidence to the rays that were drawn.
pub(crate) fn could_be_chance(search: &Search<'_>, chosen: &[usize]) -> Result<bool, Error> {
    let bears = |&c: &usize| search.candidates[c].case.observable().concerns(Observable::Decay);
    if !chosen.iter().any(bears) {
        return Ok(false);
    }
    let all = search.state(chosen, None)?;
    for &candidate in chosen.iter().filter(|c| bears(c)) {
        let rest: Vec<usize> = chosen.iter().copied().filter(|&c| c != candidate).collect();
        if all.energy.log_evidence - search.state(&rest, Some(&all))?.energy.log_evidence < BEYOND_CHANCE_NATS
        {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Evidence of decays that half of the rays give a chosen cause beyond what all of them give, in nats.
pub(crate) type MoreWithHalf = (usize, f64);

/// Compares the evidence of chosen causes that bear on decays under all rays with that under half as many others. Nothing where no cause
/// bears on decays, or where the tracer draws no rays.
pub(crate) fn more_with_half(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    chosen: &[usize],
    used: &[bool],
    (tracer, observer): (&dyn SceneTracer, &dyn Observer),
) -> Result<Vec<MoreWithHalf>, Error> {
    let bear: Vec<usize> =
        chosen.iter().copied().filter(|&c| cases[c].case.observable().concerns(Observable::Decay)).collect();
    let Some(tracer) = tracer.with_half_the_rays().filter(|_| !bear.is_empty()) else {
        return Ok(Vec::new());
    };
    let started = Instant::now();
    let evidence = |baseline: &Baseline| -> Result<Vec<f64>, Error> {
        let of = |without: Option<usize>| -> Result<f64, Error> {
            let own: Vec<&Case> =
                bear.iter().filter(|&&c| Some(c) != without).map(|&c| &cases[c].case).collect();
            Ok(baseline.fit_energy(&own, used, None)?.0.log_evidence)
        };
        let all = of(None)?;
        bear.iter().map(|&c| Ok(all - of(Some(c))?)).collect()
    };
    let with_all = evidence(baseline)?;
    let half = baseline.simulation.traced_by(&tracer, &baseline.observations.survey, observer)?;
    let whole = std::mem::replace(&mut baseline.simulation, half);
    let with_half = baseline.expand(cases, &bear).and_then(|()| evidence(baseline));
    baseline.simulation = whole;
    baseline.stale.clear();
    baseline.seconds.insert("half the rays", started.elapsed().as_secs_f64());
    Ok(bear
        .into_iter()
        .zip(with_half?.into_iter().zip(with_all))
        .map(|(c, (half, all))| (c, half - all))
        .collect())
}

/// The chosen cause that stands least, if what speaks for it would not do with any number of rays.
pub(crate) fn unsettled(
    search: &Search<'_>,
    state: &State,
    more_with_half: &[MoreWithHalf],
) -> Result<Option<usize>, Error> {
    let mut weakest: Option<(f64, usize)> = None;
    for &(candidate, more) in
        more_with_half.iter().filter(|(c, more)| *more > 0.0 && state.chosen.contains(c))
    {
        let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
        let without = search.state(&rest, Some(state))?;
        let nats = state.log_evidence() - without.log_evidence() - search.price(candidate) - more;
        if nats < search.threshold() && weakest.is_none_or(|(least, _)| nats < least) {
            weakest = Some((nats, candidate));
        }
    }
    Ok(weakest.map(|(_, candidate)| candidate))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::{TimeZeroOffset, TransducerResponse};
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use crate::simulate::scene_tracer::{EachScene, Rays};
    use sabine_propagate::PathTracer;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_cause_falls_if_the_chance_of_the_rays_is_as_large_as_its_evidence() {
        let mut tables = Tables::new(Levels::Absolute, TimeZero::Emission);
        for (measured, states) in tables.measured.iter_mut().zip(&tables.states) {
            for (band, (energies, state)) in measured.energies.iter_mut().zip(states).enumerate() {
                let gain = if band == 1 { 4.0 } else { 1.0 };
                *energies = Some(state.ln_energy.iter().map(|l| gain * l.exp()).collect());
            }
        }
        let baseline = tables.baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TransducerResponse)];
        let cases = cases(&effects, baseline.survey());
        let search = Search::new(&baseline, &cases, 1, vec![true; 3]);
        let state = search.state(&[0], None).expect("a fit");
        let nats = state.log_evidence() - search.state(&[], None).expect("a fit").log_evidence();
        assert!(nats > search.threshold() + 2.0, "{nats}");
        let falls = |more: f64| unsettled(&search, &state, &[(0, more)]).expect("fits");
        assert_eq!(falls(nats - search.threshold() + 1.0), Some(0));
        assert_eq!(falls(nats - search.threshold() - 1.0), None);
        assert!(could_be_chance(&search, &[0]).expect("fits") == (nats < BEYOND_CHANCE_NATS));
        assert!(!could_be_chance(&search, &[]).expect("fits"));
        // What more rays make surer stands as it is, and what is not chosen is not asked.
        assert_eq!(falls(-nats), None);
        assert_eq!(unsettled(&search, &state, &[]).expect("fits"), None);
    }

    #[test]
    fn causes_of_arrivals_and_tracers_without_rays_ask_for_none() {
        let mut baseline =
            Tables::new(Levels::Common, TimeZero::Emission).baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TimeZeroOffset), Box::new(TransducerResponse)];
        let cases = cases(&effects, baseline.survey());
        let config = DiagnoseConfig::default().tracer();
        let rays = Rays { config: config.clone() };
        let other = EachScene(PathTracer::new(config).expect("settings"));
        let used = [true; 3];
        let mut of = |chosen: &[usize], tracer: &dyn SceneTracer| {
            more_with_half(&mut baseline, &cases, chosen, &used, (tracer, &())).expect("fits")
        };
        assert!(of(&[0], &rays).is_empty() && of(&[], &rays).is_empty() && of(&[1], &other).is_empty());
    }
}
