//! The slope of a decay curve between two levels, and how it depends on the energy of every time bin.

/// Share of the total energy that is added to every point of the decay curve, so that its level exists everywhere: -100 dB.
const FLOOR: f64 = 1e-10;
/// Decibels per neper of energy.
pub(crate) const DB_PER_NEPER: f64 = 10.0 / std::f64::consts::LN_10;

/// Slope in dB/s of the least-squares line through the backward-integrated energy between two levels (dB re the total), the
/// curve running straight in dB from bin edge to bin edge. `sensitivity` receives its derivative by the energy of each
/// bin, the motion of both ends of the range included. `None` where there is no energy.
///
/// The line is fitted to the continuous curve, not to its samples: the slope does not jump where an end of the range
/// passes a sample, and its derivative exists.
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
    let floor = FLOOR * total;
    let mut remaining = vec![floor; edges];
    let mut sum = 0.0;
    for (edge, value) in energy.iter().enumerate().rev() {
        sum += value;
        remaining[edge] = sum + floor;
    }
    let reference = remaining[0].ln();
    let level: Vec<f64> = remaining.iter().map(|r| DB_PER_NEPER * (r.ln() - reference)).collect();

    let start = crossing(&level, range_db.0)?;
    let end = crossing(&level, range_db.1)?;
    let (t1, t2) = (start.bin as f64 + start.fraction, end.bin as f64 + end.fraction);
    let (width, centre) = (t2 - t1, 0.5 * (t1 + t2));
    if width <= 1e-9 {
        return None;
    }

    // Everything below is in bins; 12/D^3 times the integral of (t - centre) L(t) is the slope of the least-squares line.
    let scale = 12.0 / (width * width * width);
    let (mut slope, mut area) = (0.0, 0.0);
    let by_level = &mut vec![0.0; edges];
    for bin in start.bin..=end.bin {
        let from = if bin == start.bin { start.fraction } else { 0.0 };
        let to = if bin == end.bin { end.fraction } else { 1.0 };
        // Moments of the two hat functions over the part of the bin inside the range; f runs from 0 to 1 across the bin.
        let offset = bin as f64 - centre;
        let f1 = to - from;
        let f2 = 0.5 * (to * to - from * from);
        let f3 = (to * to * to - from * from * from) / 3.0;
        let whole = offset * f1 + f2;
        let rising = offset * f2 + f3;
        by_level[bin] += scale * (whole - rising);
        by_level[bin + 1] += scale * rising;
        slope += scale * ((whole - rising) * level[bin] + rising * level[bin + 1]);
        area += (f1 - f2) * level[bin] + f2 * level[bin + 1];
    }
    let mean = area / width;

    // The ends move: dt = -(change of level at the end) / (local slope of the curve).
    let by_start = 6.0 / (width * width) * (range_db.0 - mean) + 3.0 * slope / width;
    let by_end = 6.0 / (width * width) * (range_db.1 - mean) - 3.0 * slope / width;
    for (end, by_time) in [(&start, by_start), (&end, by_end)] {
        let local = level[end.bin + 1] - level[end.bin];
        by_level[end.bin] -= by_time * (1.0 - end.fraction) / local;
        by_level[end.bin + 1] -= by_time * end.fraction / local;
    }

    // From levels to remaining energies, from these to the energies of bins; the floor moves with the total.
    let by_reference: f64 = by_level.iter().sum();
    let mut by_total = 0.0;
    let mut by_remaining = vec![0.0; edges];
    for edge in 0..edges {
        by_remaining[edge] = DB_PER_NEPER * by_level[edge] / remaining[edge];
        by_total += by_remaining[edge] * FLOOR;
    }
    let of_reference = DB_PER_NEPER * by_reference / remaining[0];
    by_remaining[0] -= of_reference;
    by_total -= of_reference * FLOOR;
    let mut sum = 0.0;
    for (bin, out) in sensitivity.iter_mut().enumerate() {
        sum += by_remaining[bin];
        *out = (sum + by_total) / bin_s;
    }
    Some(slope / bin_s)
}

/// Where a falling curve passes a level.
struct Crossing {
    bin: usize,
    fraction: f64,
}

fn crossing(level: &[f64], value: f64) -> Option<Crossing> {
    // The first edge below the value: the curve never rises.
    let below = level.partition_point(|&l| l >= value);
    if below == 0 || below == level.len() {
        return None;
    }
    let bin = below - 1;
    Some(Crossing { bin, fraction: (level[bin] - value) / (level[bin] - level[below]) })
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
            assert!((slope / (-60.0 / t60_s) - 1.0).abs() < 1e-6, "{t60_s} s: {slope}");
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
            let step = 1e-5 * energy[bin..].iter().sum::<f64>().max(3e-4 * total);
            let mut at = |delta: f64| {
                let mut moved = energy.clone();
                moved[bin] += delta;
                slope_with_sensitivity(&moved, 1e-3, (-5.0, -35.0), scratch).unwrap()
            };
            let difference = (at(step) - at(-step)) / (2.0 * step);
            let scale = sensitivity[bin].abs().max(1e-9);
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
