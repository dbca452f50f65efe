//! Distributions, tails and order statistics.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wide::f64x4;

/// Above this logarithm of the ratio of measured to predicted energy the negative log-likelihood grows linearly (Huber), so that
/// outliers do not dominate.
pub(crate) const HUBER_LOG_RATIO: f64 = 2.5;
/// Draws of the bootstrap.
const BOOTSTRAP: usize = 2000;

/// The median, the upper one of two; 0 without any value.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Log-density of the logarithm of a ratio whose energy is Gamma distributed with unit shape, relative to its maximum; linear above
/// [`HUBER_LOG_RATIO`].
pub(crate) fn log_density(ln_ratio: f64) -> f64 {
    let z = ln_ratio.min(HUBER_LOG_RATIO);
    z - z.exp() + 1.0 + (1.0 - HUBER_LOG_RATIO.exp()) * (ln_ratio - z)
}

/// Log-density of the logarithm of an energy that is Gamma distributed, by its mean and relative variance.
pub(crate) fn ln_gamma_density(energy: f64, (mean, variance): (f64, f64)) -> f64 {
    let shape = 1.0 / variance;
    let z = (energy.max(1e-12) / mean).ln();
    shape * (z - z.exp()) + shape * shape.ln() - ln_gamma(shape)
}

/// Logarithm of the Gamma function (Stirling's series after recurrence; Abramowitz and Stegun 1964, 6.1.41).
pub(crate) fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut below) = (x, 0.0);
    while x < 8.0 {
        below += x.ln();
        x += 1.0;
    }
    let series = 1.0 / (12.0 * x) - 1.0 / (360.0 * x.powi(3)) + 1.0 / (1260.0 * x.powi(5));
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - below
}

/// Logarithm of the sum of two exponentials.
pub(crate) fn add(a: f64, b: f64) -> f64 {
    let (high, low) = if a > b { (a, b) } else { (b, a) };
    high + (low - high).exp().ln_1p()
}

/// Probability that a variable with the mean and variance of the samples exceeds a value, as a scaled chi-squared variable
/// (Wilson and Hilferty 1931).
pub(crate) fn upper_tail(value: f64, samples: &[f64]) -> f64 {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if mean <= 0.0 || variance <= 0.0 {
        return if value > mean { 0.0 } else { 1.0 };
    }
    let ninth = variance / (9.0 * mean * mean);
    let z = ((value / mean).max(0.0).cbrt() - 1.0 + ninth) / ninth.sqrt();
    // What so few samples cannot tell from chance does not count: Student's t with n - 1 degrees, by its normal approximation.
    let z = z / (1.0 + z * z / (2.0 * (n - 1.0))).sqrt();
    normal_tail(z)
}

/// Probability that a chi-squared variable of so many degrees exceeds a value (Wilson and Hilferty 1931).
pub(crate) fn chi_squared_tail(value: f64, degrees: f64) -> f64 {
    if degrees <= 0.0 {
        return 1.0;
    }
    let ninth = 2.0 / (9.0 * degrees);
    normal_tail(((value / degrees).cbrt() - 1.0 + ninth) / ninth.sqrt())
}

/// Probability of a normal deviate above z (Abramowitz and Stegun 1964, 26.2.17: to 7.5e-8).
pub(crate) fn normal_tail(z: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let series = t
        * (0.319_381_530
            + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt() * series;
    if z >= 0.0 { tail } else { 1.0 - tail }
}

/// Probability of at least so many events where `mean` are expected.
pub(crate) fn poisson_tail(count: usize, mean: f64) -> f64 {
    let mut term = (-mean).exp();
    let mut below = 0.0;
    for k in 0..count {
        below += term;
        term *= mean / (k + 1) as f64;
    }
    (1.0 - below).max(1e-12)
}

/// 90 % interval of the ratio of two sums over independent groups, `(numerator, denominator)` of each, if other groups had been drawn
/// (percentile bootstrap, Efron 1979).
pub(crate) fn bootstrap(groups: &[(f64, f64)], seed: u64) -> [f64; 2] {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0xB007);
    let mut ratios: Vec<f64> = (0..BOOTSTRAP)
        .map(|_| {
            let (mut sum, mut weight) = (0.0, 0.0);
            for _ in 0..groups.len() {
                let group = groups[random.random_range(0..groups.len())];
                sum += group.0;
                weight += group.1;
            }
            sum / weight
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    [ratios[BOOTSTRAP / 20], ratios[BOOTSTRAP - 1 - BOOTSTRAP / 20]]
}

/// Each value's exponential, four at a time: fits spend their time on these.
pub(crate) fn exp_all(values: &mut [f64]) {
    let mut fours = values.chunks_exact_mut(4);
    for four in &mut fours {
        four.copy_from_slice(&f64x4::new([four[0], four[1], four[2], four[3]]).exp().to_array());
    }
    fours.into_remainder().iter_mut().for_each(|x| *x = x.exp());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ln_gamma_is_that_of_the_tables() {
        assert!((ln_gamma(0.5) - 0.5 * std::f64::consts::PI.ln()).abs() < 1e-9);
        assert!((ln_gamma(5.0) - 24f64.ln()).abs() < 1e-9);
    }

    #[test]
    fn the_density_of_the_logarithm_integrates_to_one() {
        for variance in [0.1, 0.5, 1.5] {
            let step = 1e-3;
            let sum: f64 = (-20_000..4000)
                .map(|i| ln_gamma_density((f64::from(i) * step).exp(), (1.0, variance)).exp() * step)
                .sum();
            assert!((sum - 1.0).abs() < 1e-3, "{variance}: {sum}");
        }
    }

    #[test]
    fn exponentials_of_all_are_those_of_each() {
        let values: Vec<f64> =
            (-350..=353).map(|i| 2.0 * f64::from(i) + 0.123).chain([0.0, -800.0, -1e6]).collect();
        let mut found = values.clone();
        exp_all(&mut found);
        for (x, e) in values.iter().zip(found) {
            assert!((e - x.exp()).abs() <= 1e-14 * x.exp(), "{x}: {e}");
        }
        let mut infinite = [f64::NEG_INFINITY; 5];
        exp_all(&mut infinite);
        assert_eq!(infinite, [0.0; 5]);
    }

    #[test]
    fn tails_are_those_of_the_tables() {
        assert!((normal_tail(1.644_854) - 0.05).abs() < 1e-6);
        assert!((normal_tail(-1.0) - 0.841_345).abs() < 1e-6);
        // Chi-squared: 5 % beyond 18.307 with ten degrees, 1 % beyond 135.807 with a hundred.
        assert!((chi_squared_tail(18.307, 10.0) - 0.05).abs() < 1e-3);
        assert!((chi_squared_tail(135.807, 100.0) - 0.01).abs() < 2e-4);
        // Poisson with mean 1.5: P(N >= 4) = 0.0656.
        assert!((poisson_tail(4, 1.5) - 0.0656).abs() < 1e-3);
    }

    #[test]
    fn a_value_among_the_samples_is_no_surprise_and_one_far_off_is() {
        let samples: Vec<f64> = (0..30).map(|i| 20.0 + f64::from(i % 7)).collect();
        assert!(upper_tail(23.0, &samples) > 0.2);
        assert!(upper_tail(60.0, &samples) < 1e-3);
    }

    #[test]
    fn the_robust_density_is_continuous_with_its_slope() {
        let step = 1e-6;
        let at = |offset: f64| log_density(HUBER_LOG_RATIO + offset);
        let (below, above) = ((at(0.0) - at(-step)) / step, (at(step) - at(0.0)) / step);
        assert!((below - above).abs() < 1e-4, "{below} {above}");
        // Far out it falls in proportion: ten times as far, ten times as improbable in nats.
        assert!((at(20.0) - at(10.0) - 10.0 * above).abs() < 1e-6);
    }

    #[test]
    fn the_bootstrap_of_equal_groups_has_no_width_and_one_group_more_of_the_other_kind_does() {
        let equal = bootstrap(&[(2.0, 4.0); 5], 1);
        assert_eq!(equal, [0.5, 0.5]);
        let [low, high] = bootstrap(&[(2.0, 4.0), (2.0, 4.0), (6.0, 4.0), (2.0, 4.0)], 1);
        assert!(low < 0.75 && high > 0.75, "{low} {high}");
    }
}
