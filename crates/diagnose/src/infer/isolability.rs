//! Which effects the positions of a survey can tell apart, from the Jacobians alone.

use crate::effect::info::discriminating_measurement;
use crate::effect::{Case, Effect, Nuisance, Observable};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::Candidate;
use crate::likelihood::arrivals;
use crate::likelihood::decay::EnergyModel;
use crate::likelihood::laplace::{Model, Slopes};
use crate::report::diagnosis::Isolability;
use nalgebra::{DMatrix, DVector};

/// Signatures closer than this cannot be told apart.
const INDISTINGUISHABLE_COSINE: f64 = 0.95;

/// The angle between each two effects that bear on the same data.
pub(crate) fn isolability(
    baseline: &Baseline,
    candidates: &[Candidate<'_>],
    effects: &[Box<dyn Effect>],
) -> Result<Vec<Isolability>, Error> {
    let mut found = Vec::new();
    for evidence in [Observable::Decay, Observable::Arrivals] {
        // One case stands for its effect.
        let mut own: Vec<&Candidate<'_>> = Vec::new();
        for c in candidates.iter().filter(|c| c.case.observable() == evidence) {
            if own.iter().all(|o| o.effect != c.effect) {
                own.push(c);
            }
        }
        for (i, a) in own.iter().enumerate() {
            for b in &own[i + 1..] {
                let Some(cosine) = cosine(baseline, evidence, a.case, b.case) else { continue };
                found.push(Isolability {
                    effects: [a.id.to_owned(), b.id.to_owned()],
                    cosine,
                    separable: cosine < INDISTINGUISHABLE_COSINE,
                    would_decide: discriminating_measurement(
                        &effects[a.effect].info(),
                        &effects[b.effect].info(),
                    )
                    .to_string(),
                });
            }
        }
    }
    found.sort_by(|a, b| b.cosine.total_cmp(&a.cosine));
    Ok(found)
}

/// A direction in parameter space along which an effect grows.
struct Direction {
    along: DVector<f64>,
    /// Parameters that are the effect's own.
    own: Vec<usize>,
}

fn cosine(baseline: &Baseline, evidence: Observable, a: &Case, b: &Case) -> Option<f64> {
    let used = vec![true; baseline.pairs()];
    let cases = [a, b];
    let (slopes, priors, directions) = if evidence == Observable::Decay {
        let data = baseline.energy_data();
        let model = EnergyModel::new(&data, &cases, &used);
        let mut values = model.start(None);
        for (m, material) in baseline.simulation.absorption.iter().enumerate() {
            for (band, a) in material.iter().enumerate() {
                values[model.layout.absorption(m, band)] = *a;
            }
        }
        let place = |nuisance: Nuisance| model.layout.nuisance(nuisance);
        let firsts: Vec<(usize, usize)> =
            (0..2).map(|order| first_of(&model.terms, order)).collect::<Option<_>>()?;
        let directions = directions(&cases, &firsts, &mut values, place);
        (expected(&model, &values), model.priors().to_vec(), directions)
    } else {
        let data = baseline.arrival_data();
        let model = arrivals::at_fit(&data, &cases, &used);
        let mut values: Vec<f64> = model.priors().iter().map(|p| p.mean).collect();
        let place = |nuisance: Nuisance| model.layout.nuisance(nuisance);
        let firsts: Vec<(usize, usize)> =
            (0..2).map(|order| first_of(&model.terms, order)).collect::<Option<_>>()?;
        // Arrivals belong where they are: the information is taken without the effects.
        let neutral = values.clone();
        let directions = directions(&cases, &firsts, &mut values, place);
        (expected(&model, &neutral), model.priors().to_vec(), directions)
    };
    let [first, second] = &directions[..] else { return None };
    let n = priors.len();
    let rest: Vec<usize> = (0..n).filter(|i| !first.own.contains(i) && !second.own.contains(i)).collect();
    let information = slopes.information;
    let among = DMatrix::from_fn(rest.len(), rest.len(), |i, j| {
        information[(rest[i], rest[j])] + if i == j { priors[rest[i]].sd.powi(-2) } else { 0.0 }
    });
    let inverse = among.cholesky()?;
    let onto = |d: &Direction| {
        let whole = &information * &d.along;
        let part = DVector::from_iterator(rest.len(), rest.iter().map(|&i| whole[i]));
        (whole, part)
    };
    let ((whole_a, part_a), (whole_b, part_b)) = (onto(first), onto(second));
    let product = |x: &Direction, whole: &DVector<f64>, px: &DVector<f64>, py: &DVector<f64>| {
        x.along.dot(whole) - px.dot(&inverse.solve(py))
    };
    let aa = product(first, &whole_a, &part_a, &part_a);
    let bb = product(second, &whole_b, &part_b, &part_b);
    let ab = product(first, &whole_b, &part_a, &part_b);
    (aa > 1e-9 && bb > 1e-9).then(|| (ab.abs() / (aa * bb).sqrt()).min(1.0))
}

fn first_of(
    effects: &[crate::likelihood::parameters::ModelTerm<'_>],
    order: usize,
) -> Option<(usize, usize)> {
    effects.iter().find(|p| p.order == order).map(|p| (p.first, p.case.parameters.len()))
}

fn directions(
    cases: &[&Case],
    firsts: &[(usize, usize)],
    values: &mut [f64],
    place: impl Fn(Nuisance) -> Option<std::ops::Range<usize>>,
) -> Vec<Direction> {
    cases
        .iter()
        .zip(firsts)
        .map(|(case, &(first, count))| {
            let mut along = DVector::zeros(values.len());
            let mut own: Vec<usize> = (first..first + count).collect();
            for (i, p) in case.parameters.iter().enumerate() {
                along[first + i] = p.typical - p.neutral;
                values[first + i] = p.typical;
            }
            for &(nuisance, sd) in &case.relaxes {
                for i in place(nuisance).into_iter().flatten() {
                    along[i] = sd;
                    own.push(i);
                }
            }
            Direction { along, own }
        })
        .collect()
}

fn expected(model: &dyn Model, values: &[f64]) -> Slopes {
    let n = model.priors().len();
    let mut slopes = Slopes::zero(n);
    model.log_likelihood(values, Some(&mut slopes));
    slopes
}
