//! What a finished match warns of: targets that were missed, gains that are uncertain, a fit that is far from its tables.

use crate::Warning;
use sabine_acoustics::{Estimate, PerBand, Reading};
use sabine_eqfilter::EqFilter;
use sabine_optimize::MaterialFit;
use sabine_scene::MeasuredRoom;
use std::collections::BTreeMap;

/// A reachable target missed by more than this is worth a warning: one just-noticeable difference (ISO 3382-1, Annex A).
const MISSED: f64 = 0.05;
/// Equalisation with a larger standard error says little: rooms differ by about 4 dB in an octave.
const UNCERTAIN_EQ_DB: f64 = 4.0;
/// Deviation of an octave's gain from the one wanted that is said, in dB: half of what is heard.
const EQ_MISSED_DB: f64 = 0.5;

/// Octaves in which little more than the average of the training rooms is known.
pub(super) fn warn_of_uncertain_eq(eq_db: &PerBand<Estimate>, warnings: &mut Vec<Warning>) {
    let uncertain = || eq_db.iter().filter(|(_, e)| e.standard_error > UNCERTAIN_EQ_DB);
    let bands_hz: Vec<f64> = uncertain().map(|(hz, _)| hz).collect();
    if !bands_hz.is_empty() {
        let least_db = uncertain().map(|(_, e)| e.standard_error).fold(f64::INFINITY, f64::min);
        warnings.push(Warning::EqUncertain { bands_hz, least_db });
    }
}

/// Octaves whose rendered decay is not the one asked for although nothing stands in its way, or cannot be read.
pub(super) fn warn_of_misses(
    target: &PerBand<Estimate>,
    reached: &PerBand<Reading>,
    fit: &MaterialFit,
    warnings: &mut Vec<Warning>,
) {
    for ((band_hz, target), reached) in target.iter().zip(reached.values()) {
        let stuck = fit.unreachable.iter().any(|u| u.band_hz == band_hz);
        match reached {
            Err(reason) => warnings.push(Warning::NotRead { band_hz, reason: reason.clone() }),
            Ok(reached) if !stuck && (reached.value / target.value - 1.0).abs() > MISSED => {
                warnings.push(Warning::Missed { band_hz, target_s: target.value, reached_s: reached.value });
            }
            Ok(_) => {}
        }
    }
}

/// What the fit finds worth knowing, one line for each material.
pub(super) fn warn_of_fit(fit: &MaterialFit, room: &MeasuredRoom, warnings: &mut Vec<Warning>) {
    let mut far: BTreeMap<usize, (Vec<f64>, f64)> = BTreeMap::new();
    for warning in &fit.warnings {
        match warning {
            sabine_optimize::Warning::FarFromPrior { material, band_hz, deviations } => {
                let (bands_hz, largest) = far.entry(*material).or_default();
                bands_hz.push(*band_hz);
                *largest = largest.max(deviations.abs());
            }
            other => warnings.push(Warning::Fit(other.clone())),
        }
    }
    for (material, (bands_hz, deviations)) in far {
        let material = room.scene().materials()[material].name.clone();
        warnings.push(Warning::FarFromTable { material, bands_hz, deviations });
    }
}

/// Gains that the filter misses, because its solver has not met them or its impulse response is too short.
pub(super) fn warn_of_eq(filter: &EqFilter, warnings: &mut Vec<Warning>) {
    for ((band_hz, &wanted_db), realised_db) in filter.wanted_db().iter().zip(filter.realised_db().values()) {
        let Some(realised_db) = *realised_db else { continue };
        let off_db = (realised_db - wanted_db).abs();
        if off_db.is_nan() || off_db > EQ_MISSED_DB {
            warnings.push(Warning::EqMissed { band_hz, wanted_db, realised_db });
        }
    }
}
