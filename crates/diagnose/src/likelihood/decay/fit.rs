//! The fit of energies from several starts.

use super::{EnergyData, EnergyModel};
use crate::effect::{Case, Nuisance};
use crate::error::Error;
use crate::likelihood::laplace::{LaplaceFit, Model, maximise};

/// Starts that are followed to their top.
const MAX_STARTS: usize = 2;
/// Absorption from which a material that may be anything starts.
const WIDENED_STARTS: [f64; 3] = [0.08, 0.3, 0.7];
/// Least standard deviation of one that may be anything.
const ANYTHING_SD: f64 = 0.2;

/// An earlier fit to start from: its values, and where the parameters of its cases stand; they are the first cases of the new one.
#[derive(Clone, Copy)]
pub(crate) struct WarmStart<'a> {
    pub values: &'a [f64],
    pub firsts: &'a [usize],
}

/// The best of the fits from all starts, and where the parameters of each case stand, in the order of `cases`.
pub(crate) fn fit(
    data: &EnergyData<'_>,
    cases: &[&Case],
    used: &[bool],
    before: Option<WarmStart<'_>>,
) -> Result<(LaplaceFit, Vec<usize>), Error> {
    let model = EnergyModel::new(data, cases, used);
    let mut starts: Vec<Vec<f64>> = vec![model.start(before.map(|b| b.values))];
    if before.is_none() {
        // What is stated, and what an earlier fit found: the predictions are expanded about it.
        let found = model.with_absorption(&starts[0], |m, band| data.absorption[m][band]);
        if found != starts[0] {
            starts.push(found);
        }
        starts.iter_mut().for_each(|start| model.start_gains(start));
    }
    // Where a material may be anything, the others that made up for it so far mislead: from what is stated of them, too.
    let mut unstrained: Option<Vec<f64>> = None;
    let mut more: Vec<Vec<f64>> = Vec::new();
    for (order, case) in cases.iter().enumerate() {
        let first = model.first_of(order);
        let count = case.parameters.len();
        let known = before.and_then(|b| b.values.get(*b.firsts.get(order)?..)?.get(..count));
        let options = known.map_or_else(|| case.starts.clone(), |known| vec![known.to_vec()]);
        starts = options
            .iter()
            .flat_map(|option| {
                starts.iter().map(move |start| {
                    let mut x = start.clone();
                    x[first..first + option.len()].copy_from_slice(option);
                    x
                })
            })
            .collect();
        if known.is_none() {
            for &(nuisance, sd) in &case.relaxes {
                let Nuisance::Absorption(material) = nuisance else { continue };
                if sd < ANYTHING_SD {
                    continue;
                }
                let plain = unstrained.get_or_insert_with(|| {
                    let mut plain = model.start(None);
                    model.start_gains(&mut plain);
                    plain
                });
                more.extend(WIDENED_STARTS.map(|absorption| {
                    let mut x = plain.clone();
                    x[model.layout.material(material)].fill(absorption);
                    x
                }));
            }
        }
    }
    // Only the most promising starts are followed.
    let followed = [starts, more].map(|some| most_promising(&model, some)).concat();
    let mut best: Option<LaplaceFit> = None;
    for start in followed {
        let found = maximise(&model, &start, "decays")?;
        if best.as_ref().is_none_or(|b| found.log_evidence > b.log_evidence) {
            best = Some(found);
        }
    }
    let firsts = (0..cases.len()).map(|order| model.first_of(order)).collect();
    best.map(|b| (b, firsts)).ok_or(Error::Singular { what: "decays" })
}

/// How far each material is taken from its table for a start elsewhere, in standard deviations: one material up or down, all others the other way.
const ELSEWHERE: [f64; 2] = [2.0, -1.0];
/// What another optimum must gain to be taken, in nats.
const LEAST_GAIN_NATS: f64 = 1.0;

/// The fit without causes, looked for elsewhere, too. Between few surfaces, some hard and some soft, which of them absorbs may have several
/// answers in an octave, each the best in its neighbourhood: octave by octave, those that are found from other absorptions than the stated
/// ones are tried in the place of the first.
pub(crate) fn fit_from_elsewhere(data: &EnergyData<'_>, used: &[bool]) -> Result<LaplaceFit, Error> {
    let (mut best, _) = fit(data, &[], used, None)?;
    let model = EnergyModel::new(data, &[], used);
    let (priors, stated) = (model.priors(), model.start(None));
    let materials = data.absorption.len();
    let ways = (0..materials).flat_map(|own| [(own, ELSEWHERE), (own, ELSEWHERE.map(|sds| -sds))]);
    for (own, [this, others]) in ways.take(if materials > 1 { 2 * materials } else { 0 }) {
        let mut start = model.with_absorption(&stated, |m, band| {
            let prior = &priors[model.layout.absorption(m, band)];
            let sds = if m == own { this } else { others };
            (prior.mean + sds * prior.sd).clamp(0.3 * prior.mean, prior.high)
        });
        model.start_gains(&mut start);
        let other = maximise(&model, &start, "decays")?;
        for band in 0..data.survey.bands.len() {
            let of_band: Vec<usize> = (0..materials).map(|m| model.layout.absorption(m, band)).collect();
            let apart = |&i: &usize| (other.values[i] - best.values[i]).abs() > priors[i].sd.min(0.02);
            if !of_band.iter().any(apart) {
                continue;
            }
            let mut start = best.values.clone();
            of_band.iter().for_each(|&i| start[i] = other.values[i]);
            let tried = maximise(&model, &start, "decays")?;
            if tried.log_posterior > best.log_posterior + LEAST_GAIN_NATS {
                best = tried;
            }
        }
    }
    Ok(best)
}

/// Those of the starts from which a search begins highest.
fn most_promising(model: &EnergyModel<'_>, starts: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    if starts.len() <= MAX_STARTS {
        return starts;
    }
    let mut ranked: Vec<(f64, Vec<f64>)> =
        starts.into_iter().map(|x| (model.log_likelihood(&x, None), x)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.into_iter().take(MAX_STARTS).map(|(_, x)| x).collect()
}
