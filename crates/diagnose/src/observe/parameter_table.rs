//! Pairs of which a table states parameters of ISO 3382-1 in place of a response.

use crate::observe::early_energy::EarlySamples;
use crate::observe::observed_response::Measured;
use crate::simulate::band_state::BandState;
use crate::simulate::table_readings::{TimeAxis, readable};
use crate::survey::SurveyedResponse;
use sabine_acoustics::{Bands, ParameterKind};
use sabine_scene::{MeasuredRoom, ParameterEntry};
use std::f64::consts::LN_10;

/// Decay that is traced, as a share of the longest decay time that is stated: 51 dB, so that T30 has all its range.
const TRACED_SHARE: f64 = 0.85;
/// Decay times in a centre time, where no decay time is stated: that of an exponential decay, 6 ln 10.
const DECAY_TIMES: f64 = 6.0 * LN_10;
/// D50 says nothing so near to all or nothing.
const LEAST_SHARE: f64 = 1e-3;

/// A parameter that a table states of a pair in an octave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StatedParameter {
    pub kind: ParameterKind,
    /// Standard deviation of the logarithm of [`quantity`]: as stated, or one just-noticeable difference.
    pub ln_sd: f64,
}

/// What is compared of a parameter, by its logarithm: decay and centre times as they are, ratios of early to late energy as energies.
pub(crate) fn quantity(kind: ParameterKind, value: f64) -> f64 {
    match kind {
        ParameterKind::C50 | ParameterKind::C80 => 10f64.powf(value / 10.0),
        ParameterKind::D50 => value / (1.0 - value),
        _ => value,
    }
}

/// The value of a parameter of which that is compared.
pub(crate) fn value_of(kind: ParameterKind, quantity: f64) -> f64 {
    match kind {
        ParameterKind::C50 | ParameterKind::C80 => 10.0 * quantity.log10(),
        ParameterKind::D50 => quantity / (1.0 + quantity),
        _ => quantity,
    }
}

/// Change of the logarithm of the quantity with the value.
fn ln_slope(kind: ParameterKind, value: f64) -> f64 {
    match kind {
        ParameterKind::C50 | ParameterKind::C80 => LN_10 / 10.0,
        ParameterKind::D50 => 1.0 / (value * (1.0 - value)),
        _ => 1.0 / value,
    }
}

impl StatedParameter {
    fn of(entry: &ParameterEntry) -> Self {
        let sd = entry.standard_deviation.unwrap_or_else(|| entry.kind.jnd(entry.value));
        Self { kind: entry.kind, ln_sd: sd * ln_slope(entry.kind, entry.value) }
    }
}

/// The pairs of a room's tables, in the order of the file, and what is not used of them, in words.
pub(crate) fn pairs(room: &MeasuredRoom) -> (Vec<(SurveyedResponse, Measured)>, Vec<String>) {
    let bands = room.bands();
    let mut ends: Vec<(usize, usize)> = Vec::new();
    for entry in room.parameters() {
        if !ends.contains(&(entry.source, entry.receiver)) {
            ends.push((entry.source, entry.receiver));
        }
    }
    let octaves = bands.per_octave() == 1;
    let place = |entry: &ParameterEntry| bands.index_of(entry.band_hz).filter(|_| octaves);
    let mut notes = Vec::new();
    let mut other_hz: Vec<f64> =
        room.parameters().iter().filter(|e| place(e).is_none()).map(|e| e.band_hz).collect();
    if !other_hz.is_empty() {
        let count = other_hz.len();
        other_hz.sort_by(f64::total_cmp);
        other_hz.dedup();
        let hz: Vec<String> = other_hz.iter().map(|hz| format!("{hz} Hz")).collect();
        notes.push(format!(
            "{count} values of the tables at {} are not used: the room has no such octave.",
            hz.join(", ")
        ));
    }
    let of_pair = |&(source, receiver): &(usize, usize)| {
        let own = room.parameters().iter().filter(|e| (e.source, e.receiver) == (source, receiver));
        let own: Vec<(usize, &ParameterEntry)> = own.filter_map(|e| Some((place(e)?, e))).collect();
        let longest_s = longest_s(own.iter().map(|(_, entry)| *entry));
        let measured = Measured::of_table(bands, &own, longest_s);
        let surveyed = SurveyedResponse {
            source,
            receiver,
            name: format!("{}-{}", room.sources()[source].id, room.receivers()[receiver].id),
            air: room.air(),
            duration_s: longest_s,
            direct_s: 0.0,
            sounds_until_s: longest_s,
            recorded_at: None,
        };
        (surveyed, measured)
    };
    (ends.iter().map(of_pair).collect(), notes)
}

/// How long paths must be followed after the direct sound for the values of a pair, in seconds.
fn longest_s<'a>(entries: impl Iterator<Item = &'a ParameterEntry>) -> f64 {
    let decay_s = |entry: &ParameterEntry| match entry.kind {
        kind if kind.is_decay_time() => entry.value,
        ParameterKind::CentreTime => DECAY_TIMES * entry.value,
        _ => 0.0,
    };
    TRACED_SHARE * entries.map(decay_s).fold(0.0, f64::max)
}

impl Measured {
    /// Leaves out values of a table that the prediction does not have; says how many.
    pub fn leave_unreadable(&mut self, states: &[BandState]) -> usize {
        let mut left_out = 0;
        for ((stated, quantities), state) in
            self.table.iter_mut().flatten().zip(&mut self.energies).zip(states)
        {
            let Some(own) = quantities else { continue };
            let axis = TimeAxis { bins: state.bins, time_s: &state.time_s };
            let keep = readable(stated, axis, &state.ln_energy);
            let before = own.len();
            let (mut of_stated, mut of_own) = (keep.iter(), keep.iter());
            stated.retain(|_| of_stated.next().copied().unwrap_or(false));
            own.retain(|_| of_own.next().copied().unwrap_or(false));
            left_out += before - own.len();
            if own.is_empty() {
                *quantities = None;
            }
        }
        left_out
    }

    /// What a table states of a pair, each value with its octave. D50 is a function of C50: where both are stated, they are one value.
    fn of_table(bands: Bands, entries: &[(usize, &ParameterEntry)], longest_s: f64) -> Self {
        let in_band = |band: usize| -> Vec<&ParameterEntry> {
            let own: Vec<&ParameterEntry> =
                entries.iter().filter(|(at, _)| *at == band).map(|(_, entry)| *entry).collect();
            let has_c50 = own.iter().any(|e| e.kind == ParameterKind::C50);
            let says = |e: &&ParameterEntry| {
                let sure = LEAST_SHARE..=1.0 - LEAST_SHARE;
                e.kind != ParameterKind::D50 || (!has_c50 && sure.contains(&e.value))
            };
            own.into_iter().filter(says).collect()
        };
        let all: Vec<Vec<&ParameterEntry>> = (0..bands.len()).map(in_band).collect();
        let quantities = |own: &Vec<&ParameterEntry>| -> Option<Vec<f64>> {
            (!own.is_empty()).then(|| own.iter().map(|e| quantity(e.kind, e.value)).collect())
        };
        let stated = |own: &Vec<&ParameterEntry>| own.iter().map(|e| StatedParameter::of(e)).collect();
        Self {
            energies: all.iter().map(quantities).collect(),
            table: Some(all.iter().map(stated).collect()),
            direct_s: 0.0,
            peaks_s: Vec::new(),
            peaks_db: Vec::new(),
            early: EarlySamples::new(bands.len(), 0.0, 1.0),
            pulse: Vec::new(),
            lead_in: Vec::new(),
            sample_rate_hz: 0,
            duration_s: longest_s,
            sounds_until_s: longest_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_those_of_values_and_their_errors_go_along() {
        for (kind, value) in [
            (ParameterKind::T30, 1.4),
            (ParameterKind::Edt, 0.3),
            (ParameterKind::C80, -2.5),
            (ParameterKind::C50, 6.0),
            (ParameterKind::D50, 0.7),
            (ParameterKind::CentreTime, 0.08),
        ] {
            assert!((value_of(kind, quantity(kind, value)) - value).abs() < 1e-12, "{kind}");
            let step = 1e-6;
            let slope = (quantity(kind, value + step) / quantity(kind, value - step)).ln() / (2.0 * step);
            assert!((ln_slope(kind, value) / slope - 1.0).abs() < 1e-6, "{kind}");
        }
    }
}
