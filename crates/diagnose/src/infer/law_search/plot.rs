//! What is left without a law, against its covariate.

use super::features::Features;
use crate::effect::Observable;
use crate::effects::{Formula, Grammar};
use crate::error::Error;
use crate::infer::search::{Search, State};
use crate::likelihood::decay::EnergyModel;
use crate::report::diagnosis::LawPoint;
use std::f64::consts::LN_10;

/// Points that the fitted bins are gathered in, and those of the vault: as many bins in each.
const POINTS: [usize; 2] = [12, 6];
/// Bands count in which the law is at least so strong, as a share of where it is strongest.
const LEAST_SHARE: f64 = 0.5;
/// Half the width of a 90 % interval in standard deviations.
const HALF_90: f64 = 1.645;

/// One bin: covariate, what is left without the law, what the law says, and its weight.
type Bin = [f64; 4];

/// Means over bins of like covariates: of the responses that were fitted, and of those of the vault (receivers).
pub(crate) fn points(
    search: &Search<'_>,
    state: &State,
    (candidate, formula): (usize, &Formula),
    vault: &[usize],
) -> Result<Vec<LawPoint>, Error> {
    let baseline = search.baseline;
    let survey = baseline.survey();
    let grammar = Grammar::of(survey);
    let features = Features::gather(baseline, &grammar)?;
    let cases = search.cases_of(&state.chosen, Observable::Decay);
    let (data, used) = (baseline.energy_data(), vec![true; baseline.pairs()]);
    let model = EnergyModel::new(&data, &cases, &used);
    let of_decays = |c: &&usize| search.candidates[**c].case.observable().concerns(Observable::Decay);
    let order = state.chosen.iter().filter(of_decays).position(|&c| c == candidate).unwrap_or(0);
    let own = state.energy_firsts[order]
        ..state.energy_firsts[order] + search.candidates[candidate].case.parameters.len();
    let mut without = state.energy.values.clone();
    without[own.clone()].fill(0.0);
    // In which bands it acts.
    let terms = formula.bands.terms(survey);
    let strength = |band: usize| {
        let fitted = &state.energy.values[own.clone()];
        terms.iter().zip(fitted).map(|(term, x)| term.shares[band] * x).sum::<f64>().abs()
    };
    let most = (0..survey.bands().len()).map(strength).fold(0.0, f64::max);
    let bins_of = |pair: usize| -> Vec<Bin> {
        let residuals = model.residuals(&state.energy.values, std::iter::once(pair));
        let mut bins = Vec::new();
        for (band, count) in model.rows_of(pair) {
            if strength(band) < LEAST_SHARE * most {
                continue;
            }
            let x = if grammar.covariates[formula.covariate].is_fitted_course() {
                // The course of a gain is drawn over time.
                data.states[pair][band].time_s[..count].iter().map(|t| data.direct_s[pair] + t).collect()
            } else {
                features.of(pair, band, formula.covariate, count)
            };
            let [with, without] =
                [&state.energy.values, &without].map(|values| model.predicted(values, pair, band, count));
            for r in residuals.iter().filter(|r| r.band == band && r.bin < count) {
                let law = with[r.bin] - without[r.bin];
                let left = (r.ln_ratio - r.offset).min(5.0).exp() - 1.0 + law;
                bins.push([x[r.bin], left, law, 1.0 / (r.variance * baseline.dispersion[band])]);
            }
        }
        bins
    };
    let mut all = Vec::new();
    for (of_vault, most) in [(false, POINTS[0]), (true, POINTS[1])] {
        let is_of = |pair: &usize| {
            if of_vault { vault.contains(&survey.responses()[*pair].receiver) } else { search.used[*pair] }
        };
        let mut bins: Vec<Bin> = (0..baseline.pairs()).filter(is_of).flat_map(bins_of).collect();
        bins.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let each = bins.len().div_ceil(most).max(1);
        all.extend(bins.chunks(each).map(|chunk| mean(chunk, of_vault)));
    }
    Ok(all)
}

/// The weighted mean of some bins, in dB.
fn mean(bins: &[Bin], vault: bool) -> LawPoint {
    let db = 10.0 / LN_10;
    let weight: f64 = bins.iter().map(|b| b[3]).sum();
    let of = |k: usize| bins.iter().map(|b| b[3] * b[k]).sum::<f64>() / weight;
    LawPoint {
        covariate: of(0),
        left_db: db * of(1),
        half_width_db: db * HALF_90 / weight.sqrt(),
        law_db: db * of(2),
        vault,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_weighs_bins_by_how_sure_they_are() {
        let found = mean(&[[1.0, 0.2, 0.1, 3.0], [2.0, 0.6, 0.3, 1.0]], true);
        assert!((found.covariate - 1.25).abs() < 1e-12 && found.vault);
        assert!((found.left_db - 0.3 * 10.0 / LN_10).abs() < 1e-12);
        assert!((found.law_db - 0.15 * 10.0 / LN_10).abs() < 1e-12);
        assert!((found.half_width_db - HALF_90 / 2.0 * 10.0 / LN_10).abs() < 1e-12);
    }
}
