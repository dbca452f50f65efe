//! Late energy smoothed over time, as far as the tracer's chance explains how it scatters.
//!
//! A few thousand rays find the energy of a late bin to a third of it. What adds smooth energy to such a prediction, another scattering or a
//! second decay, would come nearer to the measurement for that reason alone, and be named. Sampled energies are therefore
//! averaged with their neighbours along the decay wherever these differ by no more than chance, as Lepski's rule has it (1991): with
//! many rays nothing is left to average.

/// Bins on either side over which energy is averaged, at most.
const MOST_BINS: usize = 20;
/// Standard deviations by which the scatter in a window may exceed what chance makes.
const EXCESS_SD: f64 = 2.0;

/// Energies of the batches of rays, `[bin * batches + batch]`, averaged along the decay. The same weights serve all batches: their scatter
/// remains that of what is averaged.
pub(crate) fn smoothed(sampled: &[f64], batches: usize) -> Vec<f64> {
    let bins = sampled.len() / batches;
    let of = |bin: usize| &sampled[bin * batches..(bin + 1) * batches];
    let sums: Vec<f64> = (0..bins).map(|bin| of(bin).iter().sum()).collect();
    let Some(rate) = decay_rate(&sums) else { return sampled.to_vec() };
    // Variance of the sum of the batches.
    let variances: Vec<f64> = (0..bins)
        .map(|bin| {
            let count = batches as f64;
            let scatter: f64 = of(bin).iter().map(|b| (b - sums[bin] / count).powi(2)).sum();
            scatter * count / (count - 1.0)
        })
        .collect();
    let lift = |at: usize, bin: usize| ((bin as f64 - at as f64) * rate).exp();
    let mut found = vec![0.0; sampled.len()];
    for at in 0..bins {
        let level = |bin: usize| lift(at, bin) * sums[bin];
        let chance = |bin: usize| lift(at, bin).powi(2) * variances[bin];
        let reach = reach(MOST_BINS.min(at).min(bins - 1 - at), at, level, chance);
        let weight = 1.0 / (2 * reach + 1) as f64;
        for bin in at - reach..=at + reach {
            let weight = weight * lift(at, bin);
            let target = &mut found[at * batches..(at + 1) * batches];
            target.iter_mut().zip(of(bin)).for_each(|(t, b)| *t += weight * b);
        }
    }
    found
}

/// Nepers by which energy falls from bin to bin: the slope of its logarithm, bins weighed by the root of their energy so that the fall counts and
/// not the noise at its end. None where nothing falls.
fn decay_rate(sums: &[f64]) -> Option<f64> {
    let (mut w, mut wx, mut wy, mut wxx, mut wxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (bin, &sum) in sums.iter().enumerate().filter(|(_, sum)| **sum > 0.0) {
        let (weight, x, y) = (sum.sqrt(), bin as f64, sum.ln());
        w += weight;
        wx += weight * x;
        wy += weight * y;
        wxx += weight * x * x;
        wxy += weight * x * y;
    }
    let spread = w * wxx - wx * wx;
    (spread > 0.0).then(|| (-(w * wxy - wx * wy) / spread).max(0.0))
}

/// Bins on either side of one, `most` at most, whose levels scatter no more than their variances by chance let them.
fn reach(most: usize, at: usize, level: impl Fn(usize) -> f64, chance: impl Fn(usize) -> f64) -> usize {
    let mut reach = 0;
    for wider in 1..=most {
        let window = at - wider..=at + wider;
        let freedom = 2.0 * wider as f64;
        let mean = window.clone().map(&level).sum::<f64>() / (freedom + 1.0);
        let by_chance = window.clone().map(&chance).sum::<f64>() / (freedom + 1.0);
        let scatter: f64 = window.map(|bin| (level(bin) - mean).powi(2)).sum();
        if scatter > by_chance * (freedom + EXCESS_SD * (2.0 * freedom).sqrt()) {
            break;
        }
        reach = wider;
    }
    reach
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use sabine_paths::PathSet;

    const BATCHES: usize = PathSet::BATCHES as usize;

    /// Batches of an exponential decay, each bin of each with a relative error of this size.
    fn decay(sd: f64, shape: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        (0..60 * BATCHES)
            .map(|i| {
                let uniform: f64 = random.random::<f64>() - 0.5;
                shape(i / BATCHES) * (1.0 + sd * 12f64.sqrt() * uniform) / BATCHES as f64
            })
            .collect()
    }

    fn error(found: &[f64], shape: impl Fn(usize) -> f64) -> f64 {
        let off =
            |bin: usize| found[bin * BATCHES..(bin + 1) * BATCHES].iter().sum::<f64>() / shape(bin) - 1.0;
        ((5..55).map(|bin| off(bin).powi(2)).sum::<f64>() / 50.0).sqrt()
    }

    #[test]
    fn chance_is_averaged_away_and_what_is_real_stays() {
        let plain = |bin: usize| (-0.15 * bin as f64).exp();
        let noisy = decay(1.0, plain);
        let (before, after) = (error(&noisy, plain), error(&smoothed(&noisy, BATCHES), plain));
        assert!(after < 0.5 * before, "{before} {after}");
        // A flutter of every sixth bin that far exceeds chance.
        let flutter = |bin: usize| plain(bin) * if bin.is_multiple_of(6) { 2.0 } else { 1.0 };
        let clear = decay(0.1, flutter);
        let (before, after) = (error(&clear, flutter), error(&smoothed(&clear, BATCHES), flutter));
        assert!(after < 1.1 * before && after < 0.03, "{before} {after}");
    }
}
