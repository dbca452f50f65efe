//! Whether the values of tables lie from the model as far as chance and their own errors put them.

use crate::infer::baseline::Baseline;
use crate::likelihood::decay::BinResidual;
use crate::statistics::chi_squared_tail;
use nalgebra::{DMatrix, DVector};

/// Probability that the values of each octave, and those of each pair, lie as far from the prediction by chance: squared distances by their
/// common covariance, of the measurement, the interference of arrivals and the rays. Fitted parameters take some of it away, which makes the
/// test a careful one. Octaves below the Schroeder frequency, where few modes decide, have no say unless there are no others.
pub(super) fn misfits(baseline: &Baseline, residuals: &[BinResidual]) -> (Vec<f64>, Vec<f64>) {
    let survey = baseline.survey();
    let bands = survey.bands.len();
    let from_band = if survey.bands_of_modes < bands { survey.bands_of_modes } else { 0 };
    let mut by_octave = vec![(0.0, 0.0); bands];
    let mut by_pair = vec![(0.0, 0.0); baseline.pairs()];
    for own in residuals.chunk_by(|a, b| (a.pair, a.band) == (b.pair, b.band)) {
        let (pair, band, count) = (own[0].pair, own[0].band, own.len());
        let Some(chance) = baseline.simulation.states[pair][band].table.as_ref() else { continue };
        if band < from_band {
            continue;
        }
        let measurement = DVector::from_iterator(count, own.iter().map(|r| r.variance));
        let covariance = chance.covariance(count) + DMatrix::from_diagonal(&measurement);
        let Some(distance) = squared_distance(own, covariance) else { continue };
        for (sum, values) in [&mut by_octave[band], &mut by_pair[pair]] {
            *sum += distance;
            *values += count as f64;
        }
    }
    let probability =
        |(sum, values): &(f64, f64)| if *values > 0.0 { chi_squared_tail(*sum, *values) } else { 1.0 };
    (by_octave.iter().map(probability).collect(), by_pair.iter().map(probability).collect())
}

fn squared_distance(own: &[BinResidual], covariance: DMatrix<f64>) -> Option<f64> {
    let off = DVector::from_iterator(own.len(), own.iter().map(|r| r.ln_ratio));
    Some(off.dot(&covariance.cholesky()?.solve(&off)))
}
