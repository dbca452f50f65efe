//! The fit of arrival times: from many starts, with ever less tolerance.

use super::{ArrivalData, ArrivalModel, WIDTHS_S, places, unassigned_peaks};
use crate::effect::Case;
use crate::error::Error;
use crate::likelihood::laplace::{LaplaceFit, Model, maximise};

/// Of the starts that an effect offers, those that are followed from the widest of these on, and from the next one on.
const MAX_STARTS: [usize; 2] = [3, 2];
/// Tops whose evidence differs by less than this, in nats, ...
const SAME_NATS: f64 = 0.02;
/// ... and whose values differ by less than so many posterior standard deviations, are one.
const SAME_SD: f64 = 0.1;

/// Fits from the direct sounds on, reflections joining with ever less tolerance.
pub(crate) fn fit(
    data: &ArrivalData<'_>,
    cases: &[&Case],
    used: &[bool],
) -> Result<(LaplaceFit, Vec<usize>), Error> {
    if let Some(place) = cases.iter().rposition(|c| c.reflection_term().is_some()) {
        return unassigned_peaks::fit(data, cases, used, place);
    }
    let mut model = ArrivalModel::new(data, cases, used);
    let start: Vec<f64> = model.priors.iter().map(|p| p.mean).collect();
    // From where the direct sounds point, and from where everything should be: a single response far off must not carry the
    // others away.
    let direct = maximise(&model, &start, "arrival times")?.values;
    let mut firsts = offered(&mut model, &start);
    firsts.extend(places::starts(&mut model, &direct));
    firsts.extend([(direct, 0), (start, 0)]);
    let mut tops: Vec<LaplaceFit> = Vec::new();
    for (number, width_s) in WIDTHS_S.into_iter().enumerate() {
        model.width_s = Some(width_s);
        let joining = firsts.iter().filter(|(_, widest)| *widest == number).map(|(x, _)| x.clone());
        let starts: Vec<Vec<f64>> = tops.drain(..).map(|top| top.values).chain(joining).collect();
        for x in starts {
            let top = maximise(&model, &x, "arrival times")?;
            // What has come to a top that another has reached goes on as the other does.
            if tops.iter().all(|other| !is_same_top(other, &top)) {
                tops.push(top);
            }
        }
    }
    let best = tops.into_iter().rev().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence));
    let places = model.terms.iter().map(|p| p.first).collect();
    best.map(|b| (b, places)).ok_or(Error::Singular { what: "arrival times" })
}

/// Whether two searches have come to rest at one place, as far as the data tell places apart.
fn is_same_top(one: &LaplaceFit, other: &LaplaceFit) -> bool {
    let mut apart = one.values.iter().zip(&other.values).enumerate();
    (one.log_evidence - other.log_evidence).abs() < SAME_NATS
        && apart.all(|(i, (a, b))| (a - b).abs() < SAME_SD * one.sd(i))
}

/// The most promising of the values that the effects offer to start from, and the width ([`WIDTHS_S`]) with which each is followed:
/// reflections that lie several of their distances off find no partners from the neutral values. Where reflections are dense, the widest
/// hardly tells one start from another; the next one does, where starts are so close that one is near the truth.
fn offered(model: &mut ArrivalModel<'_>, neutral: &[f64]) -> Vec<(Vec<f64>, usize)> {
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for placed in &model.terms {
        let options = &placed.case.starts;
        let at = placed.range();
        starts.extend(options.iter().filter(|o| o[..] != neutral[at.clone()]).map(|option| {
            let mut x = neutral.to_vec();
            x[at.clone()].copy_from_slice(option);
            x
        }));
    }
    let mut found: Vec<(Vec<f64>, usize)> = Vec::new();
    for (width, count) in MAX_STARTS.into_iter().enumerate() {
        model.width_s = Some(WIDTHS_S[width]);
        let mut ranked: Vec<(f64, &Vec<f64>)> =
            starts.iter().map(|x| (model.log_likelihood(x, None), x)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        // From what is less probable than the neutral values nothing is reached that these would not reach.
        let least = model.log_likelihood(neutral, None);
        let better = ranked.into_iter().take(count).filter(|(likelihood, _)| *likelihood > least);
        found.extend(better.map(|(_, x)| (x.clone(), width)));
    }
    model.width_s = None;
    found
}
