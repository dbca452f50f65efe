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
    let mut first_start = model.start(before.map(|b| b.values));
    if before.is_none() {
        model.start_gains(&mut first_start);
    }
    let mut starts: Vec<Vec<f64>> = vec![first_start];
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
