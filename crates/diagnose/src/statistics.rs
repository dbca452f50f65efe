//! Distributions, tails and order statistics.

use pulp::Arch;

/// Above this logarithm of the ratio of measured to predicted energy the negative log-likelihood grows linearly (Huber), so that
/// outliers do not dominate.
pub(crate) const HUBER_LOG_RATIO: f64 = 2.5;

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

/// What a bin pulls at the logarithm of its prediction, for a shape of one: minus the slope of [`log_density`].
pub(crate) fn pull(ln_ratio: f64) -> f64 {
    ln_ratio.min(HUBER_LOG_RATIO).exp() - 1.0
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

/// 90 % interval of the ratio of two sums over independent groups, `(numerator, denominator)` of each, if other groups had been drawn:
/// Student's t with one degree fewer than there are groups, about the linearised ratio (Cochran 1977, *Sampling Techniques*, 6.3).
/// One group says nothing of others: its interval is infinite.
pub(crate) fn ratio_interval(groups: &[(f64, f64)]) -> [f64; 2] {
    let n = groups.len() as f64;
    if groups.len() < 2 {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let (sum, weight) = groups.iter().fold((0.0, 0.0), |(s, w), g| (s + g.0, w + g.1));
    let ratio = sum / weight;
    let squares: f64 = groups.iter().map(|(s, w)| (s - ratio * w).powi(2)).sum();
    let error = (squares * n / (n - 1.0)).sqrt() / weight;
    let half = student_quantile(groups.len() - 1, 0.05) * error;
    [ratio - half, ratio + half]
}

/// Value that Student's t of so many degrees exceeds with this probability, up to ten thousand, by bisection.
pub(crate) fn student_quantile(degrees: usize, tail: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1e4);
    for _ in 0..70 {
        let middle = 0.5 * (low + high);
        if student_tail(middle, degrees) > tail { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Probability that Student's t of so many degrees exceeds a value that is not negative (Abramowitz and Stegun 1964, 26.7.3 and 26.7.4:
/// finite series).
pub(crate) fn student_tail(t: f64, degrees: usize) -> f64 {
    let nu = degrees as f64;
    let angle = (t / nu.sqrt()).atan();
    let (sine, cosine) = angle.sin_cos();
    let odd = degrees % 2 == 1;
    // Terms of cos(angle) and every second power of it above: odd powers with odd degrees, even powers with even ones.
    let (mut term, mut power) = if odd { (cosine, 1) } else { (1.0, 0) };
    let mut series = 0.0;
    while power + 2 <= degrees {
        series += term;
        power += 2;
        term *= cosine * cosine * (power - 1) as f64 / power as f64;
    }
    let within = if odd { 2.0 / std::f64::consts::PI * (angle + sine * series) } else { sine * series };
    0.5 * (1.0 - within)
}

/// Each value's exponential, as many at a time as the machine computes: fits spend their time on these. No sum or product is contracted, so
/// that machines of different width agree to the last bit. Below -708, where numbers lose digits, it is zero.
pub(crate) fn exp_all(values: &mut [f64]) {
    Arch::new().dispatch(
        #[inline(always)]
        || values.iter_mut().for_each(|x| *x = exponential(*x)),
    );
}

/// exp(x) = 2^k exp(r) with k the integer next to x / ln 2: r, at most ln 2 / 2, goes through Taylor's polynomial, whose remainder is below
/// the last bit.
#[inline(always)]
fn exponential(x: f64) -> f64 {
    const LOWEST: f64 = -708.0;
    const HIGHEST: f64 = 709.0;
    /// Added to a number it leaves the next integer in the last bits.
    const ROUNDING: f64 = 1.5 * (1u64 << 52) as f64;
    /// ln 2 in two parts, the first so short that its products with k are exact.
    const LN_2_PARTS: [f64; 2] = [f64::from_bits(0x3fe6_2e42_fee0_0000), 1.908_214_929_270_587_7e-10];
    /// 1 / n! from n = 13 down.
    const TAYLOR: [f64; 14] = {
        let mut found = [1.0; 14];
        let mut n = 1;
        while n < 14 {
            found[13 - n] = found[14 - n] / n as f64;
            n += 1;
        }
        found
    };
    let within = x.clamp(LOWEST, HIGHEST);
    let rounded = within * std::f64::consts::LOG2_E + ROUNDING;
    let k = rounded - ROUNDING;
    let r = within - k * LN_2_PARTS[0] - k * LN_2_PARTS[1];
    let mut sum = TAYLOR[0];
    let mut n = 1;
    while n < TAYLOR.len() {
        sum = sum * r + TAYLOR[n];
        n += 1;
    }
    let power = f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52);
    let kept = if x < LOWEST { 0.0 } else { sum * power };
    if x > HIGHEST { f64::INFINITY } else { kept }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

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
    fn the_interval_of_equal_groups_has_no_width_and_one_group_more_of_the_other_kind_does() {
        let equal = ratio_interval(&[(2.0, 4.0); 5]);
        assert_eq!(equal, [0.5, 0.5]);
        let [low, high] = ratio_interval(&[(2.0, 4.0), (2.0, 4.0), (6.0, 4.0), (2.0, 4.0)]);
        assert!(low < 0.75 && high > 0.75, "{low} {high}");
        // Groups of one size: the t interval of the mean of 0.5, 0.5, 1.5, 0.5, which is 0.75 with a standard error of 0.25.
        assert!((0.5 * (high - low) - 2.353_363 * 0.25).abs() < 1e-5, "{low} {high}");
        assert_eq!(ratio_interval(&[(2.0, 4.0)]), [f64::NEG_INFINITY, f64::INFINITY]);
    }

    #[test]
    fn quantiles_of_student_are_those_of_the_tables() {
        let at_5_percent = [(1, 6.313_752), (2, 2.919_986), (3, 2.353_363), (4, 2.131_847), (7, 1.894_579)];
        let of_many = [(11, 1.795_885), (30, 1.697_261), (100, 1.660_234)];
        let at_1_percent = [(1, 31.820_516), (2, 6.964_557), (7, 2.997_952)];
        for (tail, table) in [(0.05, &at_5_percent[..]), (0.05, &of_many), (0.01, &at_1_percent)] {
            for &(degrees, quantile) in table {
                let found = student_quantile(degrees, tail);
                assert!((found - quantile).abs() < 1e-6, "{degrees}: {found}");
            }
        }
    }

    /// Receivers left out in turn in a model whose evidence has a closed form: one parameter with a standard normal prior, and in each
    /// receiver a normal measurement of it, with so much information on the average that the parameter, which is 1, gains so many nats
    /// at positions not seen; 0: the parameter is 0. Gains and bins of the groups.
    fn left_out_in_turn(
        random: &mut Pcg64Mcg,
        receivers: usize,
        groups: usize,
        nats: f64,
    ) -> Vec<(f64, f64)> {
        let absent = nats == 0.0;
        let each = if absent { 5.0 } else { 2.0 * nats / receivers as f64 };
        let truth = f64::from(u8::from(!absent));
        let bins: Vec<f64> = (0..receivers).map(|_| random.random_range(0.5..1.5)).collect();
        let measured: Vec<[f64; 2]> = bins
            .iter()
            .map(|b| {
                let information = each * b;
                let noise: f64 = random.sample(StandardNormal);
                [information, truth * information + information.sqrt() * noise]
            })
            .collect();
        let total = |of: &dyn Fn(usize) -> bool| {
            let kept = measured.iter().enumerate().filter(|(r, _)| of(*r));
            kept.fold([0.0, 0.0], |[i, c], (_, m)| [i + m[0], c + m[1]])
        };
        let ln_evidence = |[information, score]: [f64; 2]| {
            0.5 * score * score / (information + 1.0) - 0.5 * information.ln_1p()
        };
        let whole = ln_evidence(total(&|_| true));
        (0..groups)
            .map(|g| {
                let gain = whole - ln_evidence(total(&|r| r % groups != g));
                (gain, bins.iter().skip(g).step_by(groups).sum())
            })
            .collect()
    }

    #[test]
    fn nine_in_ten_intervals_of_left_out_gains_hold_the_gain_and_one_in_twenty_lies_above() {
        const DRAWS: usize = 20_000;
        let mut random = Pcg64Mcg::seed_from_u64(21);
        for (receivers, groups) in [(4, 4), (8, 8), (12, 8)] {
            for nats in [0.0, 5.0, 20.0, 80.0, 300.0] {
                let drawn: Vec<Vec<(f64, f64)>> =
                    (0..DRAWS).map(|_| left_out_in_turn(&mut random, receivers, groups, nats)).collect();
                let sum = |part: fn(&(f64, f64)) -> f64| drawn.iter().flatten().map(part).sum::<f64>();
                let truth = sum(|g| g.0) / sum(|g| g.1);
                let (mut held, mut above) = (0, 0);
                for [low, high] in drawn.iter().map(|groups| ratio_interval(groups)) {
                    held += usize::from((low..=high).contains(&truth));
                    above += usize::from(truth < low);
                }
                let [held, above] = [held, above].map(|n| n as f64 / DRAWS as f64);
                let case = format!("{receivers} receivers, {nats} nats: {held} {above}");
                // A name asks for a gain whose lower end is above zero: that end must keep its word at any gain.
                assert!(above < 0.055, "{case}");
                // A gain of a few nats is skewed, and its intervals are too low: they hold it in 82 % of draws.
                if nats >= 20.0 {
                    assert!((0.86..0.94).contains(&held), "{case}");
                }
            }
        }
    }
}
