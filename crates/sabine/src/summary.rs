//! Every number of a match, in a form for files and other programs.

use crate::{Error, JoinedWaves, RoomMatch};
use sabine_acoustics::{Estimate, PerBand};
use serde::Serialize;
use std::collections::BTreeMap;

/// Quantile of a normal distribution that leaves 5 % on either side.
const NORMAL_90: f64 = 1.645;

/// The numbers of a [`RoomMatch`]; its JSON is what the example `match_room` writes as `match.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MatchSummary {
    /// Nominal octave centres of everything that is given per band, in Hz.
    pub bands_hz: Vec<f64>,
    /// Reverberation times heard in the recording, in seconds.
    pub t60_target_s: Vec<f64>,
    /// Their standard errors, in seconds.
    pub t60_target_sd_s: Vec<f64>,
    /// Lower ends of their 90 % intervals, in seconds: log-normal, for a reverberation time is known to a factor.
    pub t60_target_low_s: Vec<f64>,
    /// Upper ends of their 90 % intervals, in seconds.
    pub t60_target_high_s: Vec<f64>,
    /// T30 of the rendered response, in seconds; `None` where it cannot be read (a warning says why).
    pub t60_reached_s: Vec<Option<f64>>,
    /// Targets that no absorption reaches.
    pub unreachable: Vec<UnreachableBand>,
    /// Nominal octave centres of the equalisation, in Hz; 1 kHz is the reference and left out.
    pub eq_bands_hz: Vec<f64>,
    /// Equalisation heard in the recording, in dB relative to 1 kHz.
    pub eq_db: Vec<f64>,
    /// Its standard errors, in dB.
    pub eq_sd_db: Vec<f64>,
    /// Equalisation of the simulation before the filter, in dB relative to 1 kHz.
    pub eq_simulated_db: Vec<Option<f64>>,
    /// Equalisation behind the filter, in dB relative to 1 kHz; `None` where it cannot be read.
    pub eq_reached_db: Vec<Option<f64>>,
    /// Absorption of each material at `bands_hz`, as the room file has it and as fitted.
    pub materials: BTreeMap<String, MaterialChange>,
    /// Combinations of materials that the targets do not determine, in words.
    pub not_determined: Vec<String>,
    /// Delay of the equalisation filter, in seconds; it is taken out of the matched sound.
    pub eq_filter_delay_s: f64,
    /// By how much the matched sound was scaled to fit full scale, in dB, 0 or below: 0 for a source of the level of the dry sound
    /// at 1 m.
    pub matched_gain_db: f64,
    /// Sample rate of the sounds, in Hz.
    pub sample_rate_hz: u32,
    /// What joining waves to paths found, where that was asked for.
    pub waves: Option<JoinedWaves>,
    /// Seconds that each stage took.
    pub seconds: BTreeMap<String, f64>,
    /// What to know before trusting the result, in words.
    pub warnings: Vec<String>,
}

/// A reverberation time that cannot be reached.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnreachableBand {
    /// Nominal octave centre in Hz.
    pub band_hz: f64,
    /// Why, in words.
    pub reason: String,
}

/// Absorption of a material before and after the fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialChange {
    /// As the room file has it.
    pub before: Vec<f64>,
    /// As fitted.
    pub after: Vec<f64>,
}

impl MatchSummary {
    /// The numbers of a match.
    pub fn new(matched: &RoomMatch) -> Self {
        let t60 = matched.targets.t60_s();
        let eq: Vec<(f64, &Estimate)> = without_reference(matched.targets.eq_db());
        let before_after = matched.materials_before.iter().zip(&matched.fit.materials);
        let materials = matched
            .material_names
            .iter()
            .zip(before_after)
            .map(|(name, (before, after))| {
                let at_bands =
                    |absorption: &PerBand<f64>| absorption.resampled(t60.bands()).values().to_vec();
                let change = MaterialChange {
                    before: at_bands(before.absorption()),
                    after: at_bands(after.absorption()),
                };
                (name.clone(), change)
            })
            .collect();
        let names: Vec<&str> = matched.material_names.iter().map(String::as_str).collect();
        Self {
            bands_hz: t60.bands().iter_hz().collect(),
            t60_target_s: t60.values().iter().map(|t| t.value).collect(),
            t60_target_sd_s: t60.values().iter().map(|t| t.standard_error).collect(),
            t60_target_low_s: t60.values().iter().map(|t| t.log_normal_interval(NORMAL_90).0).collect(),
            t60_target_high_s: t60.values().iter().map(|t| t.log_normal_interval(NORMAL_90).1).collect(),
            t60_reached_s: matched
                .t60_reached_s
                .values()
                .iter()
                .map(|r| r.as_ref().ok().map(|t| t.value))
                .collect(),
            unreachable: matched
                .fit
                .unreachable
                .iter()
                .map(|u| UnreachableBand { band_hz: u.band_hz, reason: u.to_string() })
                .collect(),
            eq_bands_hz: eq.iter().map(|(hz, _)| *hz).collect(),
            eq_db: eq.iter().map(|(_, e)| e.value).collect(),
            eq_sd_db: eq.iter().map(|(_, e)| e.standard_error).collect(),
            eq_simulated_db: finite(&matched.eq_simulated_db),
            eq_reached_db: finite(&matched.eq_reached_db),
            materials,
            not_determined: matched.fit.not_determined.iter().map(|u| u.describe(&names)).collect(),
            eq_filter_delay_s: matched.eq_filter.delay_s(),
            matched_gain_db: matched.matched_gain_db,
            sample_rate_hz: matched.matched.sample_rate_hz(),
            waves: matched.waves,
            seconds: matched.seconds.iter().map(|(stage, s)| ((*stage).to_owned(), *s)).collect(),
            warnings: matched.warnings.iter().map(ToString::to_string).collect(),
        }
    }

    /// The numbers as indented JSON.
    ///
    /// # Errors
    /// [`Error::Json`] if a number is not finite.
    pub fn to_json(&self) -> Result<String, Error> {
        Ok(serde_json::to_string_pretty(self)?)
    }
}

/// Levels but the reference's, without those that could not be read.
fn finite(levels_db: &PerBand<f64>) -> Vec<Option<f64>> {
    without_reference(levels_db)
        .into_iter()
        .map(|(_, level)| Some(*level).filter(|l| l.is_finite()))
        .collect()
}

fn without_reference<T>(levels: &PerBand<T>) -> Vec<(f64, &T)> {
    levels.iter().filter(|(hz, _)| *hz != 1000.0).collect()
}

/// The materials of a match as tables of a room file (`[bands]` and `[materials.NAME]`), which
/// [`MeasuredRoom::with_materials_file`](sabine_scene::MeasuredRoom::with_materials_file) reads.
///
/// # Errors
/// [`Error::Acoustics`], which a fit's numbers and names do not cause.
pub fn materials_toml(matched: &RoomMatch) -> Result<String, Error> {
    let names: Vec<&str> = matched.material_names.iter().map(String::as_str).collect();
    Ok(matched.fit.tables(&names)?.to_toml()?)
}
