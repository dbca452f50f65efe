//! Parameters of ISO 3382-1 of energy bins, with their derivatives by every bin.

use crate::decay::{DB_PER_NEPER, slope_with_sensitivity};
use sabine_acoustics::ParameterKind;

/// The early decay is read from the very beginning: its range begins so far above 0 dB that no point fades out of it.
const EDT_RANGE_DB: (f64, f64) = (1.0, -10.0);
const T20_RANGE_DB: (f64, f64) = (-5.0, -25.0);
const T30_RANGE_DB: (f64, f64) = (-5.0, -35.0);
/// Early sound ends so long after the direct sound, in seconds (ISO 3382-1, A.2.3).
const C50_S: f64 = 0.050;
const C80_S: f64 = 0.080;
/// Below this share of the energy, early or late sound is none.
const LEAST_SHARE: f64 = 1e-13;

/// A parameter on the scale of the fit and its derivative by the energy of each bin, the first of which begins with the direct
/// sound. `None` where it cannot be read: no energy, or none on one side of 50 or 80 ms.
///
/// Decay times are taken by their logarithm, whose errors do not depend on their size, everything else as it is ([`scaled`]).
pub(crate) fn reading(kind: ParameterKind, energy: &[f64], bin_s: f64) -> Option<(f64, Vec<f64>)> {
    match kind {
        ParameterKind::Edt => decay_time(energy, bin_s, EDT_RANGE_DB),
        ParameterKind::T20 => decay_time(energy, bin_s, T20_RANGE_DB),
        ParameterKind::T30 => decay_time(energy, bin_s, T30_RANGE_DB),
        ParameterKind::C50 => clarity(energy, bin_s, C50_S),
        ParameterKind::C80 => clarity(energy, bin_s, C80_S),
        ParameterKind::D50 => definition(energy, bin_s),
        ParameterKind::CentreTime => centre_time(energy, bin_s),
        // A parameter that a later version may add cannot be predicted here.
        _ => None,
    }
}

/// A value, or an error beside it, on the scale of the fit.
pub(crate) fn scaled(kind: ParameterKind, value: f64) -> f64 {
    if kind.is_decay_time() { value.ln() } else { value }
}

/// A standard deviation about a value, on the scale of the fit.
pub(crate) fn scaled_sd(kind: ParameterKind, value: f64, sd: f64) -> f64 {
    if kind.is_decay_time() { sd / value } else { sd }
}

/// The value that stands so on the scale of the fit.
pub(crate) fn unscaled(kind: ParameterKind, on_scale: f64) -> f64 {
    if kind.is_decay_time() { on_scale.exp() } else { on_scale }
}

/// The standard deviation about a value that stands so on the scale of the fit.
pub(crate) fn unscaled_sd(kind: ParameterKind, value: f64, on_scale: f64) -> f64 {
    if kind.is_decay_time() { on_scale * value } else { on_scale }
}

fn decay_time(energy: &[f64], bin_s: f64, range_db: (f64, f64)) -> Option<(f64, Vec<f64>)> {
    let mut by = vec![0.0; energy.len()];
    let slope = slope_with_sensitivity(energy, bin_s, range_db, &mut by).filter(|slope| *slope < 0.0)?;
    // ln(-60 / slope)
    by.iter_mut().for_each(|b| *b /= -slope);
    Some(((-60.0 / slope).ln(), by))
}

/// Early and late energy, the bin in which early sound ends counting in part: the share of each bin that is early, and both sums.
fn parted(energy: &[f64], bin_s: f64, limit_s: f64) -> Option<(impl Fn(usize) -> f64, f64, f64)> {
    let share = move |j: usize| (limit_s / bin_s - j as f64).clamp(0.0, 1.0);
    let early: f64 = energy.iter().enumerate().map(|(j, e)| share(j) * e).sum();
    let late: f64 = energy.iter().enumerate().map(|(j, e)| (1.0 - share(j)) * e).sum();
    let least = LEAST_SHARE * (early + late);
    (early > least && late > least && least.is_finite()).then_some((share, early, late))
}

fn clarity(energy: &[f64], bin_s: f64, limit_s: f64) -> Option<(f64, Vec<f64>)> {
    let (share, early, late) = parted(energy, bin_s, limit_s)?;
    let by = |j: usize| DB_PER_NEPER * (share(j) / early - (1.0 - share(j)) / late);
    Some((DB_PER_NEPER * (early / late).ln(), (0..energy.len()).map(by).collect()))
}

fn definition(energy: &[f64], bin_s: f64) -> Option<(f64, Vec<f64>)> {
    let (share, early, late) = parted(energy, bin_s, C50_S)?;
    let total = early + late;
    let by = |j: usize| (share(j) - early / total) / total;
    Some((early / total, (0..energy.len()).map(by).collect()))
}

fn centre_time(energy: &[f64], bin_s: f64) -> Option<(f64, Vec<f64>)> {
    let total: f64 = energy.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let time_s = |j: usize| (j as f64 + 0.5) * bin_s;
    let moment: f64 = energy.iter().enumerate().map(|(j, e)| time_s(j) * e).sum();
    let centre_s = moment / total;
    Some((centre_s, (0..energy.len()).map(|j| (time_s(j) - centre_s) / total).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two slopes and a few peaks: no parameter has a special value.
    fn energy() -> Vec<f64> {
        let of = |j: usize| {
            let t = (j as f64 + 0.5) * 1e-3;
            let peaks = if j.is_multiple_of(17) && j < 120 { 0.02 } else { 0.0 };
            (-13.8 * t / 0.9).exp() + 0.3 * (-13.8 * t / 0.3).exp() + peaks
        };
        (0..1500).map(of).collect()
    }

    #[test]
    fn derivatives_are_central_differences() {
        let energy = energy();
        for kind in ParameterKind::ALL {
            let (_, by) = reading(kind, &energy, 1e-3).unwrap();
            for bin in [0, 3, 17, 49, 50, 79, 80, 200, 700] {
                let step = 1e-5 * energy[bin];
                let at = |step: f64| {
                    let mut moved = energy.clone();
                    moved[bin] += step;
                    reading(kind, &moved, 1e-3).unwrap().0
                };
                let difference = (at(step) - at(-step)) / (2.0 * step);
                let near = 1e-4 * by[bin].abs() + 1e-7;
                assert!((by[bin] - difference).abs() < near, "{kind} bin {bin}: {} {difference}", by[bin]);
            }
        }
    }

    #[test]
    fn an_exponential_decay_has_the_closed_forms() {
        // E ~ exp(-t/tau), 13.816 tau = T: C80 = 10 lg(exp(80 ms / tau) - 1), Ts = tau.
        let (t60_s, bin_s) = (1.2, 1e-3);
        let tau = t60_s / (6.0 * std::f64::consts::LN_10);
        let energy: Vec<f64> = (0..3000).map(|j| (-f64::from(j) * bin_s / tau).exp()).collect();
        let read = |kind| unscaled(kind, reading(kind, &energy, bin_s).unwrap().0);
        for kind in [ParameterKind::Edt, ParameterKind::T20, ParameterKind::T30] {
            assert!((read(kind) / t60_s - 1.0).abs() < 1e-3, "{kind}: {}", read(kind));
        }
        let clarity_db = |limit_s: f64| 10.0 * ((limit_s / tau).exp() - 1.0).log10();
        assert!((read(ParameterKind::C80) - clarity_db(0.08)).abs() < 1e-6);
        assert!((read(ParameterKind::C50) - clarity_db(0.05)).abs() < 1e-6);
        assert!((read(ParameterKind::D50) - (1.0 - (-0.05 / tau).exp())).abs() < 1e-9);
        assert!((read(ParameterKind::CentreTime) - tau).abs() < 1e-5);
    }

    #[test]
    fn what_cannot_be_read_is_none() {
        for kind in ParameterKind::ALL {
            assert!(reading(kind, &[0.0; 200], 1e-3).is_none(), "{kind}");
        }
        // Nothing comes late.
        let mut early = vec![0.0; 200];
        early[3] = 1.0;
        assert!(reading(ParameterKind::C80, &early, 1e-3).is_none());
    }
}
