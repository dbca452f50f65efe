//! What the evidence for a cause owes to the rays that were drawn.
//!
//! A predicted decay is noisy by the rays that were drawn. A cause that makes it smoother comes nearer to the measurement for that alone, and
//! one that makes up for what these rays missed does so by as much as they missed. Parts of the rays tell: four quarters, each of them by
//! itself. A name that they do not confirm is looked for again with several times as many rays.

use crate::effect::{Case, Observable};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::infer::search::{Search, State};
use crate::report::diagnosis::RayDependence;
use crate::statistics::student_quantile;
use sabine_acoustics::{Observer, report};
use web_time::Instant;

/// Parts of the rays, each of which is asked by itself.
const PARTS: u8 = 4;

/// A chosen cause (a candidate), and what its evidence owes to rays.
pub(crate) type OwedToRays = (usize, RayDependence);

impl RayDependence {
    /// From the evidence of decays under all rays and under each of several equal parts of them, which make up the whole.
    ///
    /// What all rays say beyond what any number would say is the greater of two estimates. One is of the mean: gains by smoothness fall as one
    /// over the number of rays, and more slowly where a few rare ones carry much: as one over its root, it is assumed, so that of what n parts
    /// say more, all of them still say one part in the root of n less 1 too much (Richardson's extrapolation). The other is of the scatter: the
    /// distance of a prediction without the cause from the measurement, along what the cause changes, is the root of twice the evidence in
    /// units of its standard deviation. All rays predict the mean of what the parts predict: the parts tell the standard error of this
    /// distance, and evidence counts as far as the limit that it falls below with the probability `significance` (Student's t). The standard
    /// deviation of a part is at most the root of n times that of all rays: of the distance, no more than so many times the parts' mean counts.
    pub(crate) fn new(decay_nats: f64, decay_nats_of_quarters: Vec<f64>, significance: f64) -> Self {
        let parts = decay_nats_of_quarters.len() as f64;
        let distance = |nats: f64| (2.0 * nats.max(0.0)).sqrt();
        let distances = || decay_nats_of_quarters.iter().map(|&nats| distance(nats));
        let mean = distances().sum::<f64>() / parts;
        let squares: f64 = distances().map(|d| (d - mean).powi(2)).sum();
        let error = (squares / (parts - 1.0) / parts).sqrt();
        let freedom = decay_nats_of_quarters.len() - 1;
        let borne_out = distance(decay_nats).min(parts.sqrt() * mean);
        let least = (borne_out - student_quantile(freedom, significance) * error).max(0.0);
        let by_scatter = decay_nats - 0.5 * least * least;
        let mean_nats = decay_nats_of_quarters.iter().sum::<f64>() / parts;
        let by_mean = (mean_nats - decay_nats) / (parts.sqrt() - 1.0);
        Self { decay_nats, decay_nats_of_quarters, owed_nats: by_scatter.max(by_mean).max(0.0) }
    }
}

/// The chosen causes that bear on decays.
pub(crate) fn bearing_on_decays(cases: &[CatalogueCase], chosen: &[usize]) -> Vec<usize> {
    chosen.iter().copied().filter(|&c| cases[c].case.observable().concerns(Observable::Decay)).collect()
}

/// What the evidence of chosen causes that bear on decays owes to the rays. Nothing where no cause bears on decays, or where the tracer draws
/// no rays.
pub(crate) fn owed_to_rays(
    baseline: &mut Baseline,
    cases: &[CatalogueCase],
    chosen: &[usize],
    used: &[bool],
    observer: &dyn Observer,
) -> Result<Vec<OwedToRays>, Error> {
    let bear = bearing_on_decays(cases, chosen);
    if bear.is_empty() || !baseline.simulation.can_be_parted(PARTS) {
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
    let mut of_parts = vec![Vec::new(); bear.len()];
    for part in 0..PARTS {
        report(observer, "weighing parts of the rays", u64::from(part), u64::from(PARTS))?;
        let alone = baseline.simulation.part_of_rays(part, PARTS)?;
        let whole = std::mem::replace(&mut baseline.simulation, alone);
        let drawn = baseline.expand(cases, &bear).and_then(|()| evidence(baseline));
        baseline.simulation = whole;
        baseline.stale.clear();
        of_parts.iter_mut().zip(drawn?).for_each(|(all, nats)| all.push(nats));
    }
    baseline.seconds.insert("parts of the rays", started.elapsed().as_secs_f64());
    let significance = baseline.config.significance;
    let owed = with_all.into_iter().zip(of_parts);
    let owed = owed.map(|(all, parts)| RayDependence::new(all, parts, significance));
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
) -> Result<Option<OwedToRays>, Error> {
    let mut weakest: Option<(f64, &OwedToRays)> = None;
    for owed in owed_to_rays.iter().filter(|(c, rays)| rays.owed_nats > 0.0 && state.chosen.contains(c)) {
        let (candidate, rays) = owed;
        let rest: Vec<usize> = state.chosen.iter().copied().filter(|c| c != candidate).collect();
        let without = search.state(&rest, Some(state))?;
        let nats = state.log_evidence() - without.log_evidence() - search.price(*candidate) - rays.owed_nats;
        if nats < search.threshold() && weakest.is_none_or(|(least, _)| nats < least) {
            weakest = Some((nats, owed));
        }
    }
    Ok(weakest.map(|(_, owed)| owed.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::{TimeZeroOffset, TransducerResponse};
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;
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
            |owed_nats: f64| RayDependence { owed_nats, ..RayDependence::new(nats, vec![nats; 4], 0.01) };
        let falls = |nats: f64| {
            unsettled(&search, &state, &[(0, owed(nats))]).expect("fits").map(|(candidate, _)| candidate)
        };
        assert_eq!(falls(nats - search.threshold() + 1.0), Some(0));
        assert_eq!(falls(nats - search.threshold() - 1.0), None);
        // What owes nothing stands as it is, and what is not chosen is not asked.
        assert_eq!(falls(0.0), None);
        assert_eq!(unsettled(&search, &state, &[]).expect("fits"), None);
    }

    #[test]
    fn evidence_that_all_parts_confirm_owes_nothing_and_the_luck_of_one_part_owes_most() {
        let owed = |all: f64, parts: [f64; 4]| RayDependence::new(all, parts.to_vec(), 0.01).owed_nats;
        assert!(owed(40.0, [40.0; 4]) < 1e-9);
        // What a quarter of the rays says more, all of them still say too much.
        assert!((owed(20.0, [32.0; 4]) - 12.0).abs() < 1e-9, "{}", owed(20.0, [32.0; 4]));
        // One quarter found what the others did not.
        assert!(owed(40.0, [200.0, 2.0, 5.0, 1.0]) > 39.0, "{}", owed(40.0, [200.0, 2.0, 5.0, 1.0]));
        // Large by no quarter: a quarter of the rays halves the distance at most, and makes a quarter of the evidence.
        assert!((owed(100.0, [4.0; 4]) - 84.0).abs() < 1e-9 && owed(100.0, [25.0; 4]) < 1e-9);
        // Of a hundred nats that scatter by two, most stand.
        let little = owed(100.0, [98.0, 102.0, 97.0, 103.0]);
        assert!((1.0..10.0).contains(&little), "{little}");
        // Evidence against a cause is none for it.
        assert!(owed(5.0, [-3.0, -8.0, 0.0, 1.0]) > 4.9);
    }

    /// An error of the rays alone, normal as no tracer's need be: how often it is named without any rule, with what parts of the rays say more
    /// taken off alone, and with both estimates.
    #[test]
    fn an_error_of_the_rays_alone_is_named_in_few_rooms() {
        let mut random = Pcg64Mcg::new(5);
        let mut normal = |sd: f64| {
            let z: f64 = StandardNormal.sample(&mut random);
            z * sd
        };
        // Distances in standard deviations of the measurement, which all parts share; all rays err by five of them, a quarter by ten.
        let (mut named, mut by_mean, mut stand) = (0, 0, 0);
        for _ in 0..4000 {
            let measured = normal(1.0);
            let parts: [f64; 4] = std::array::from_fn(|_| measured + normal(10.0));
            let nats = |distance: f64| 0.5 * distance * distance;
            let all = nats(parts.iter().sum::<f64>() / 4.0);
            let rays = RayDependence::new(all, parts.map(nats).to_vec(), 0.01);
            let mean = parts.map(nats).iter().sum::<f64>() / 4.0;
            named += usize::from(all > 6.0);
            by_mean += usize::from(all > 6.0 && all - (mean - all) > 6.0);
            stand += usize::from(all - rays.owed_nats > 6.0);
        }
        println!("of 4000: {named} named, {by_mean} with the estimate of the mean alone, {stand} with both");
        assert!(named > 1800 && stand < by_mean / 10 && stand < named / 20, "{named} {by_mean} {stand}");
    }

    #[test]
    fn causes_of_arrivals_and_rooms_without_rays_ask_for_none() {
        let mut baseline =
            Tables::new(Levels::Common, TimeZero::Emission).baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TimeZeroOffset), Box::new(TransducerResponse)];
        let cases = cases(&effects, baseline.survey());
        let mut of = |chosen: &[usize]| {
            owed_to_rays(&mut baseline, &cases, chosen, &[true; 3], &()).expect("fits").len()
        };
        assert_eq!((of(&[]), of(&[0]), of(&[1])), (0, 0, 0));
    }

    /// Four quarters of the rays make up the whole, in a traced room.
    #[test]
    fn quarters_of_the_rays_predict_the_whole_on_the_mean() {
        let mut baseline = Baseline::of_laboratory(3);
        let energies = |baseline: &Baseline| -> Vec<f64> {
            baseline.simulation.states[0][0].ln_energy.iter().map(|l| l.exp()).collect()
        };
        let whole = energies(&baseline);
        assert!(baseline.simulation.can_be_parted(PARTS) && !baseline.simulation.can_be_parted(33));
        let mut mean = vec![0.0; whole.len()];
        for part in 0..PARTS {
            let alone = baseline.simulation.part_of_rays(part, PARTS).expect("a part");
            let all = std::mem::replace(&mut baseline.simulation, alone);
            baseline.expand(&[], &[]).expect("expands");
            mean.iter_mut().zip(energies(&baseline)).for_each(|(m, e)| *m += 0.25 * e);
            assert_eq!(baseline.simulation.states[0][0].batches, 8);
            baseline.simulation = all;
        }
        for (bin, (mean, whole)) in mean.iter().zip(&whole).enumerate() {
            assert!((mean / whole - 1.0).abs() < 1e-4, "{bin}: {mean} {whole}");
        }
    }
}
