//! Where measured and predicted energies differ.

use crate::effect::Case;
use crate::infer::baseline::{Baseline, dispersion};
use crate::infer::search::State;
use crate::report::diagnosis::ResidualCell;

/// Residuals of the fitted responses by octave and bin, their mean over responses, and the dispersion under the causes. Tables have no bins.
pub(crate) fn residual_map(
    baseline: &Baseline,
    base: &State,
    cases: &[&Case],
    state: &State,
) -> (Vec<ResidualCell>, Vec<f64>) {
    let all: Vec<usize> = (0..baseline.pairs()).filter(|&p| baseline.observations.fitted[p]).collect();
    let before = baseline.residuals(&[], &base.energy.values, &all);
    let after = baseline.residuals(cases, &state.energy.values, &all);
    let dispersion = dispersion(&after, baseline.survey().bands.len());
    if baseline.observations.are_tables() {
        return (Vec::new(), dispersion);
    }
    let db = |ln: f64| ln * 10.0 / std::f64::consts::LN_10;
    let mut cells = Vec::new();
    let mut means: std::collections::BTreeMap<(usize, usize), (f64, f64, f64, f64)> =
        std::collections::BTreeMap::new();
    for (b, a) in before.iter().zip(&after) {
        let bins = baseline.simulation.states[b.pair][b.band].bins;
        cells.push(ResidualCell {
            response: Some(baseline.survey().responses[b.pair].name.clone()),
            band_hz: baseline.survey().bands.nominal_hz(b.band),
            time_s: bins.centre_s(b.bin),
            before_db: db(b.ln_ratio),
            after_db: db(a.ln_ratio),
            expected_sd_db: db(b.variance.sqrt()),
        });
        let mean = means.entry((b.band, b.bin)).or_default();
        mean.0 += b.ln_ratio.min(20.0).exp();
        mean.1 += a.ln_ratio.min(20.0).exp();
        mean.2 += b.variance;
        mean.3 += 1.0;
    }
    for ((band, bin), (b, a, variance, n)) in means {
        let Some(pair) = all.iter().copied().find(|&p| baseline.simulation.ends[p][band] > bin) else {
            continue;
        };
        cells.push(ResidualCell {
            response: None,
            band_hz: baseline.survey().bands.nominal_hz(band),
            time_s: baseline.simulation.states[pair][band].bins.centre_s(bin),
            before_db: db((b / n).max(1e-9).ln()),
            after_db: db((a / n).max(1e-9).ln()),
            expected_sd_db: db((variance / n / n).sqrt()),
        });
    }
    (cells, dispersion)
}
