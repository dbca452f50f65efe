//! What the evidence for a cause owes to the rays that were drawn.
//!
//! A predicted decay is noisy by the rays that were drawn. A cause that makes it smoother comes nearer to the measurement for that alone, and
//! one that makes up for what these rays missed does so by as much as they missed. Rays that are drawn again tell: half as many, twice over.
//! A name that could be chance at all ([`could_be_chance`]) is looked for again with several times as many rays before that.

use crate::effect::{Case, Observable};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::infer::search::{Search, State};
use crate::report::diagnosis::RayDependence;
use crate::simulate::scene_tracer::SceneTracer;
use crate::statistics::student_quantile;
use sabine_acoustics::Observer;
use std::sync::Arc;
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

/// A room is traced so often with half of the rays, each time with others.
const DRAWS: u64 = 2;

/// A chosen cause (a candidate), and what its evidence owes to rays.
pub(crate) type OwedToRays = (usize, RayDependence);

impl RayDependence {
    /// From the evidence of decays under all rays and under several draws of half as many.
    ///
    /// What all rays say beyond what any number would say is the greater of two estimates. One is of the mean: gains by smoothness fall as one
    /// over the number of rays, so that what half of them say more, all of them still say too much (Richardson's extrapolation). The other is of
    /// the scatter: the distance of a prediction without the cause from the measurement, along what the cause changes, is the root of twice the
    /// evidence in units of its standard deviation; the error of the rays adds to it, with a variance that halves where they are doubled. The
    /// draws tell this variance, and evidence counts as far as the limit that this distance falls below with the probability
    /// `significance` (Student's t).
    pub(crate) fn new(decay_nats: f64, decay_nats_with_half: Vec<f64>, significance: f64) -> Self {
        let draws = decay_nats_with_half.len() as f64;
        let distance = |nats: f64| (2.0 * nats.max(0.0)).sqrt();
        let half = || decay_nats_with_half.iter().map(|&nats| distance(nats));
        // In units of one over the variance of half of the rays.
        let weights = 2.0 + draws;
        let whole = distance(decay_nats);
        let mean = (2.0 * whole + half().sum::<f64>()) / weights;
        let squares = 2.0 * (whole - mean).powi(2) + half().map(|d| (d - mean).powi(2)).sum::<f64>();
        let error = (squares / draws / weights).sqrt();
        let least = (mean - student_quantile(decay_nats_with_half.len(), significance) * error).max(0.0);
        let by_scatter = decay_nats - 0.5 * least * least;
        let by_mean = decay_nats_with_half.iter().sum::<f64>() / draws - decay_nats;
        Self { decay_nats, decay_nats_with_half, owed_nats: by_scatter.max(by_mean).max(0.0) }
    }
}

/// What the evidence of chosen causes that bear on decays owes to the rays. Nothing where no cause bears on decays, or where the tracer draws
/// no rays.
pub(crate) fn owed_to_rays(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    chosen: &[usize],
    used: &[bool],
    (tracer, observer): (&dyn SceneTracer, &dyn Observer),
) -> Result<Vec<OwedToRays>, Error> {
    let bear: Vec<usize> =
        chosen.iter().copied().filter(|&c| cases[c].case.observable().concerns(Observable::Decay)).collect();
    let tracers: Vec<Arc<dyn SceneTracer>> =
        (0..DRAWS).filter_map(|draw| tracer.with_half_the_rays(draw)).collect();
    if tracers.is_empty() || bear.is_empty() {
        return Ok(Vec::new());
    }
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
    let mut with_half = vec![Vec::new(); bear.len()];
    for tracer in &tracers {
        let half = baseline.simulation.traced_by(tracer, &baseline.observations.survey, observer)?;
        let whole = std::mem::replace(&mut baseline.simulation, half);
        let drawn = baseline.expand(cases, &bear).and_then(|()| evidence(baseline));
        baseline.simulation = whole;
        baseline.stale.clear();
        with_half.iter_mut().zip(drawn?).for_each(|(all, nats)| all.push(nats));
    }
    baseline.seconds.insert("half the rays", started.elapsed().as_secs_f64());
    let significance = baseline.config.significance;
    let owed = with_all.into_iter().zip(with_half);
    let owed = owed.map(|(all, half)| RayDependence::new(all, half, significance));
    Ok(bear.into_iter().zip(owed).collect())
}

/// Evidence for a cause that other rays would not confirm, in nats.
pub(crate) fn owed_nats(owed_to_rays: &[OwedToRays], candidate: usize) -> f64 {
    owed_to_rays.iter().find(|(c, _)| *c == candidate).map_or(0.0, |(_, rays)| rays.owed_nats)
}

/// The chosen cause that stands least, if what speaks for it would not do with other rays.
pub(crate) fn unsettled(
    search: &Search<'_>,
    state: &State,
    owed_to_rays: &[OwedToRays],
) -> Result<Option<usize>, Error> {
    let mut weakest: Option<(f64, usize)> = None;
    for (candidate, rays) in
        owed_to_rays.iter().filter(|(c, rays)| rays.owed_nats > 0.0 && state.chosen.contains(c))
    {
        let rest: Vec<usize> = state.chosen.iter().copied().filter(|c| c != candidate).collect();
        let without = search.state(&rest, Some(state))?;
        let nats = state.log_evidence() - without.log_evidence() - search.price(*candidate) - rays.owed_nats;
        if nats < search.threshold() && weakest.is_none_or(|(least, _)| nats < least) {
            weakest = Some((nats, *candidate));
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
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;
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
        let owed =
            |owed_nats: f64| RayDependence { owed_nats, ..RayDependence::new(nats, vec![nats; 2], 0.01) };
        let falls = |nats: f64| unsettled(&search, &state, &[(0, owed(nats))]).expect("fits");
        assert_eq!(falls(nats - search.threshold() + 1.0), Some(0));
        assert_eq!(falls(nats - search.threshold() - 1.0), None);
        assert!(could_be_chance(&search, &[0]).expect("fits") == (nats < BEYOND_CHANCE_NATS));
        assert!(!could_be_chance(&search, &[]).expect("fits"));
        // What owes nothing stands as it is, and what is not chosen is not asked.
        assert_eq!(falls(0.0), None);
        assert_eq!(unsettled(&search, &state, &[]).expect("fits"), None);
    }

    #[test]
    fn evidence_that_other_rays_confirm_owes_nothing_and_the_luck_of_one_draw_owes_all() {
        let owed = |all: f64, half: [f64; 2]| RayDependence::new(all, half.to_vec(), 0.01).owed_nats;
        assert!(owed(40.0, [40.0; 2]) < 1e-9);
        // What half of the rays say more, all of them say too much.
        assert!((10.0..20.0).contains(&owed(20.0, [30.0; 2])), "{}", owed(20.0, [30.0; 2]));
        let willing = RayDependence::new(20.0, vec![30.0; 2], 0.5);
        assert!((willing.owed_nats - 10.0).abs() < 1e-9, "{}", willing.owed_nats);
        // Large by the rays that were drawn, as other rays show.
        assert!(owed(100.0, [20.0, 1.0]) > 99.0);
        // Of a hundred nats that scatter by two, most stand.
        assert!((1.0..15.0).contains(&owed(100.0, [98.0, 102.0])), "{}", owed(100.0, [98.0, 102.0]));
        // Evidence against a cause is none for it.
        assert!(owed(5.0, [-3.0, -8.0]) > 4.9);
    }

    /// An error of the rays alone, normal as no tracer's need be: how often it is named without any rule, with what half of the rays say more
    /// alone, and with both estimates.
    #[test]
    fn an_error_of_the_rays_alone_is_named_in_few_rooms() {
        let mut random = Pcg64Mcg::new(5);
        let mut normal = |variance: f64| {
            let z: f64 = StandardNormal.sample(&mut random);
            z * variance.sqrt()
        };
        // Distances in standard deviations of the measurement; rays err by five of them.
        let (mut named, mut by_mean, mut stand) = (0, 0, 0);
        for _ in 0..4000 {
            let [all, first, second] = [25.0, 50.0, 50.0].map(|variance| 0.5 * normal(variance).powi(2));
            let rays = RayDependence::new(all, vec![first, second], 0.01);
            named += usize::from(all > 6.0);
            by_mean += usize::from(all > 6.0 && all - (0.5 * (first + second) - all) > 6.0);
            stand += usize::from(all - rays.owed_nats > 6.0);
        }
        println!("of 4000: {named} named, {by_mean} with the estimate of the mean alone, {stand} with both");
        assert!(named > 1800 && stand < by_mean / 3 && stand < named / 6, "{named} {by_mean} {stand}");
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
            owed_to_rays(&mut baseline, &cases, chosen, &used, (tracer, &())).expect("fits")
        };
        assert!(of(&[0], &rays).is_empty() && of(&[], &rays).is_empty() && of(&[1], &other).is_empty());
    }
}
