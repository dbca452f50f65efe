//! What the tracer's chance moves together.
//!
//! A ray that happens to be found carries energy into many bins, and into all octaves: the Monte-Carlo errors of one response belong
//! together, and to take each bin's for its own would make evidence of chance. Their covariance is that between batches of
//! rays; its strongest directions are kept.

use crate::simulate::band_state::BandState;
use crate::simulate::modes::Modes;
use nalgebra::{DMatrix, SymmetricEigen};

/// Directions that are kept, at most: one for so many batches. The others are known too badly.
const BATCHES_OF_EACH: usize = 4;
/// A direction that moves the bins of a response by less than this, as a sum of squares in units of their own variance, is left to
/// chance.
const LEAST: f64 = 0.1;
/// Beyond this, rays have found too little to say what they missed.
const MOST_BIAS: f64 = 0.5;
/// Nothing scatters more than the square of one Gaussian sample.
const MOST_VARIANCE: f64 = 2.0;

/// Deviations of the batches from their mean, in units of a bin's whole energy: the sum of their squares is the relative variance of that
/// by chance.
pub(crate) fn deviations(batches: &[f64], energy: f64) -> impl Iterator<Item = f64> + '_ {
    let count = batches.len() as f64;
    let mean = batches.iter().sum::<f64>() / count;
    let unbiased = (count / (count - 1.0)).sqrt();
    batches.iter().map(move |b| (b - mean) * unbiased / energy)
}

/// Energies that rays find are right on average, their logarithms are not: by half their relative variance they lie below, and where
/// the bin's own scatter counts as the measurement's, whose mean is that of energies, by half of it once more. Rays that come to the
/// same late bins by rare ways would make a second decay of it.
///
/// Finds the directions of one response in the bins that are compared (below `ends`, by band), and gives each bin's variance what they
/// leave of the tracer's part.
pub(crate) fn find(bands: &mut [BandState], ends: &[usize]) {
    let batches = bands.first().map_or(1, |state| state.batches);
    let mut together = DMatrix::<f64>::zeros(batches, batches);
    for (state, &end) in bands.iter().zip(ends) {
        for (bin, own) in state.batch_deviations.chunks_exact(batches).take(end).enumerate() {
            let weight = 1.0 / state.variance[bin];
            for (i, a) in own.iter().enumerate() {
                for (j, b) in own[..=i].iter().enumerate() {
                    together[(i, j)] += weight * f64::from(a * b);
                }
            }
        }
    }
    together.fill_upper_triangle_with_lower_triangle();
    let found = SymmetricEigen::new(together);
    let mut order: Vec<usize> = (0..batches).filter(|&i| found.eigenvalues[i] > LEAST).collect();
    order.sort_by(|&a, &b| found.eigenvalues[b].total_cmp(&found.eigenvalues[a]));
    order.truncate(batches / BATCHES_OF_EACH);
    for state in bands {
        let mut moves = Vec::with_capacity(order.len() * state.variance.len());
        for (bin, own) in state.batch_deviations.chunks_exact(batches).enumerate() {
            let along = |mode: &usize| -> f64 {
                own.iter().zip(found.eigenvectors.column(*mode).iter()).map(|(d, v)| f64::from(*d) * v).sum()
            };
            moves.extend(order.iter().map(along));
            let taken: f64 = moves[bin * order.len()..].iter().map(|m| m * m).sum();
            let left = (state.monte_carlo[bin] - taken).max(0.0);
            state.variance[bin] = (state.variance[bin] + left).min(MOST_VARIANCE);
            // A direction that is free to follow the data costs the less the wider it is.
            let costly = |(i, m): (usize, &f64)| m * m / (1.0 + found.eigenvalues[order[i]]);
            state.monte_carlo[bin] =
                left + moves[bin * order.len()..].iter().enumerate().map(costly).sum::<f64>();
            state.correction[bin] += (0.5 * taken + left).min(MOST_BIAS);
        }
        state.modes = Modes::new(order.len(), moves);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::time_bins::Bins;
    use sabine_acoustics::Bands;
    use sabine_paths::PathSet;

    #[test]
    fn chance_that_all_bins_share_is_one_direction() {
        let batches = usize::from(PathSet::BATCHES);
        let bands = Bands::octaves(500.0, 1000.0).unwrap();
        let mut states: Vec<BandState> = (0..2)
            .map(|band| {
                let mut state = BandState::by_hand(Bins::new(bands, band), 40, 2, 0.0);
                state.batch_deviations.clear();
                for bin in 0..40 {
                    // One batch in four has found more than the others, the more the later, and all bins have a little of their own.
                    let energy = |batch: usize| {
                        let common = if batch.is_multiple_of(4) { 1.0 } else { -1.0 / 3.0 };
                        let own = 0.02 * ((batch * 7 + bin * 13 + band * 5) as f64).sin();
                        0.01 * bin as f64 * common + own
                    };
                    let all: Vec<f64> = (0..batches).map(energy).collect();
                    let own: Vec<f32> = deviations(&all, 1.0).map(|d| d as f32).collect();
                    state.monte_carlo[bin] = own.iter().map(|d| f64::from(d * d)).sum();
                    state.variance[bin] = 0.1;
                    state.batch_deviations.extend(own);
                }
                state
            })
            .collect();
        find(&mut states, &[40, 40]);
        for state in &states {
            // 32 batches: the squares of the common part are 8 + 24 / 9.
            let expected = 0.3 * ((8.0 + 24.0 / 9.0) * 32.0f64 / 31.0).sqrt();
            assert!((state.modes.of(30)[0].abs() - expected).abs() < 0.02, "{:?}", state.modes.of(30));
            // What is left to each bin is what it has of its own, and its share of the other directions.
            assert!(state.variance[30] < 0.12 && state.variance[30] >= 0.1, "{}", state.variance[30]);
            // A prediction pays for less than all of it: the direction follows the data.
            let (all, pays) = (expected * expected, state.monte_carlo[30]);
            assert!(pays > 0.0 && pays < 0.5 * all, "{pays} {all}");
        }
        // The same ray is behind both bands.
        assert!(states[0].modes.of(30)[0] * states[1].modes.of(30)[0] > 0.0);
    }
}
