//! The slope of a decay curve between two levels, and how it depends on the energy of every time bin.

/// How far below the range the decay curve levels out, in dB: so that it has a level everywhere.
const FLOOR_DB: f64 = 40.0;
/// Points in each time bin at which the curve is read.
const POINTS: usize = 8;
/// Half the width over which the ends of the range fade, in dB.
const FADE_DB: f64 = 1.0;
/// Decibels per neper of energy.
pub(crate) const DB_PER_NEPER: f64 = 10.0 / std::f64::consts::LN_10;

/// Slope in dB/s of the least-squares line through the backward-integrated energy between two levels (dB re the total), the
/// curve running straight in dB from bin edge to bin edge. `sensitivity` receives its derivative by the energy of each
/// bin, the motion of both ends of the range included. `None` where there is no energy.
///
/// ISO 3382 counts a sample of the curve fully or not at all. Here its weight fades from 0 to 1 over 2 dB about either end of
/// the range, so that the slope does not jump where a sample enters or leaves, and has a derivative.
pub(crate) fn slope_with_sensitivity(
    energy: &[f64],
    bin_s: f64,
    range_db: (f64, f64),
    sensitivity: &mut [f64],
) -> Option<f64> {
    sensitivity.fill(0.0);
    let total: f64 = energy.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    // Remaining energy and level at the start of each bin, and at the end of the last one, where only the floor is left.
    let edges = energy.len() + 1;
    let floor_share = 10f64.powf((range_db.1 - FLOOR_DB) / 10.0);
    let floor = floor_share * total;
    let mut remaining = vec![floor; edges];
    let mut sum = 0.0;
    for (edge, value) in energy.iter().enumerate().rev() {
        sum += value;
        remaining[edge] = sum + floor;
    }
    let reference = remaining[0].ln();
    let level: Vec<f64> = remaining.iter().map(|r| DB_PER_NEPER * (r.ln() - reference)).collect();

    // The curve never rises: only these bins have points within the range.
    let first = level.partition_point(|&l| l > range_db.0 + FADE_DB).saturating_sub(1);
    let last = level.partition_point(|&l| l > range_db.1 - FADE_DB).min(energy.len());
    let points = || {
        (first..last).flat_map(|bin| {
            let (l0, l1) = (level[bin], level[bin + 1]);
            (0..POINTS).map(move |p| {
                let fraction = (p as f64 + 0.5) / POINTS as f64;
                (bin, fraction, l0 + fraction * (l1 - l0))
            })
        })
    };

    // Weighted least squares, times in bins from the first.
    let (mut sum_w, mut sum_t, mut sum_l) = (0.0, 0.0, 0.0);
    for (bin, fraction, l) in points() {
        let (w, _) = weight(l, range_db);
        sum_w += w;
        sum_t += w * ((bin - first) as f64 + fraction);
        sum_l += w * l;
    }
    if sum_w <= 0.0 {
        return None;
    }
    let (mean_t, mean_l) = (sum_t / sum_w, sum_l / sum_w);
    let (mut sum_tt, mut sum_tl) = (0.0, 0.0);
    for (bin, fraction, l) in points() {
        let (w, _) = weight(l, range_db);
        let t = (bin - first) as f64 + fraction - mean_t;
        sum_tt += w * t * t;
        sum_tl += w * t * l;
    }
    if sum_tt <= 0.0 {
        return None;
    }
    let slope = sum_tl / sum_tt;
    let by_level = &mut vec![0.0; edges];
    for (bin, fraction, l) in points() {
        let (w, by_l) = weight(l, range_db);
        let t = (bin - first) as f64 + fraction - mean_t;
        // A point pulls by its level, and by what its weight gains as the level moves, times its distance from the line.
        let by = (w * t + by_l * t * (l - mean_l - slope * t)) / sum_tt;
        by_level[bin] += by * (1.0 - fraction);
        by_level[bin + 1] += by * fraction;
    }

    // From levels to remaining energies, from these to the energies of bins; the floor moves with the total.
    let by_reference: f64 = by_level.iter().sum();
    let mut by_total = 0.0;
    let mut by_remaining = vec![0.0; edges];
    for edge in 0..edges {
        by_remaining[edge] = DB_PER_NEPER * by_level[edge] / remaining[edge];
        by_total += by_remaining[edge] * floor_share;
    }
    let of_reference = DB_PER_NEPER * by_reference / remaining[0];
    by_remaining[0] -= of_reference;
    by_total -= of_reference * floor_share;
    let mut sum = 0.0;
    for (bin, out) in sensitivity.iter_mut().enumerate() {
        sum += by_remaining[bin];
        *out = (sum + by_total) / bin_s;
    }
    Some(slope / bin_s)
}

/// Weight of a point at a level, and its derivative: 1 within the range, fading at either end.
fn weight(level: f64, range_db: (f64, f64)) -> (f64, f64) {
    let (upper, by_upper) = step((range_db.0 + FADE_DB - level) / (2.0 * FADE_DB));
    let (lower, by_lower) = step((level - range_db.1 + FADE_DB) / (2.0 * FADE_DB));
    (upper * lower, (upper * by_lower - by_upper * lower) / (2.0 * FADE_DB))
}

/// A step from 0 to 1 over 0..1 with two continuous derivatives, and the first of them.
fn step(x: f64) -> (f64, f64) {
    if x <= 0.0 {
        (0.0, 0.0)
    } else if x >= 1.0 {
        (1.0, 0.0)
    } else {
        let y = 1.0 - x;
        (x * x * x * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * y * y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::EnergyDecayCurve;

    fn exponential(t60_s: f64, bins: usize) -> Vec<f64> {
        (0..bins).map(|i| 10f64.powf(-6.0 * i as f64 * 1e-3 / t60_s)).collect()
    }

    #[test]
    fn an_exponential_has_the_slope_of_its_t60() {
        for t60_s in [0.05, 0.3, 1.0, 2.5] {
            let energy = exponential(t60_s, (2000.0 * t60_s) as usize);
            let slope =
                slope_with_sensitivity(&energy, 1e-3, (-5.0, -35.0), &mut vec![0.0; energy.len()]).unwrap();
            // The floor 40 dB below the range is what is left.
            assert!((slope / (-60.0 / t60_s) - 1.0).abs() < 2e-5, "{t60_s} s: {slope}");
        }
    }

    #[test]
    fn it_is_what_the_sampled_regression_reads() {
        // Two slopes and a strong direct sound: the curve is far from straight.
        let mut energy = exponential(0.4, 1500);
        energy.iter_mut().zip(exponential(1.2, 1500)).for_each(|(a, b)| *a += 0.05 * b);
        energy[0] += 30.0;
        let slope =
            slope_with_sensitivity(&energy, 1e-3, (-5.0, -35.0), &mut vec![0.0; energy.len()]).unwrap();
        let sampled = EnergyDecayCurve::from_energy(&energy, 1e-3).decay_time_s(-5.0, -35.0).unwrap();
        assert!((-60.0 / slope / sampled - 1.0).abs() < 2e-3, "{} {sampled}", -60.0 / slope);
    }

    #[test]
    fn the_sensitivity_is_the_derivative() {
        let mut energy = exponential(0.4, 600);
        for (i, e) in energy.iter_mut().enumerate() {
            *e *= 1.0 + 0.5 * (i as f64 * 1.7).sin(); // uneven, as traced energy is
        }
        energy[0] += 10.0;
        let mut sensitivity = vec![0.0; energy.len()];
        let scratch = &mut vec![0.0; energy.len()];
        slope_with_sensitivity(&energy, 1e-3, (-5.0, -35.0), &mut sensitivity).unwrap();
        let total: f64 = energy.iter().sum();
        for bin in [0, 1, 7, 50, 199, 240, 300, 500] {
            // Small against what remains from this bin or from the end of the range on, large against rounding.
            let step = 1e-4 * energy[bin..].iter().sum::<f64>().max(3e-4 * total);
            let mut at = |delta: f64| {
                let mut moved = energy.clone();
                moved[bin] += delta;
                slope_with_sensitivity(&moved, 1e-3, (-5.0, -35.0), scratch).unwrap()
            };
            let mut central = |step: f64| (at(step) - at(-step)) / (2.0 * step);
            let difference = (4.0 * central(step) - central(2.0 * step)) / 3.0;
            // The terms of a sensitivity are of the size of the slope over what remains; they may cancel.
            let scale = 150.0 / energy[bin..].iter().sum::<f64>();
            assert!(
                (difference - sensitivity[bin]).abs() < 1e-6 * scale,
                "bin {bin}: {difference} {}",
                sensitivity[bin]
            );
        }
    }

    #[test]
    fn silence_has_no_slope() {
        assert!(slope_with_sensitivity(&[0.0; 8], 1e-3, (-5.0, -35.0), &mut [0.0; 8]).is_none());
        assert!(slope_with_sensitivity(&[], 1e-3, (-5.0, -35.0), &mut []).is_none());
    }
}
