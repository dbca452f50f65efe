//! Pairs of which a table states parameters of ISO 3382-1 in place of a response.

use crate::observe::early_energy::EarlySamples;
use crate::observe::observed_response::Measured;
use crate::observe::stated_parameter::{StatedParameter, quantity};
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
    /// Leaves out values of a table, those that are not to be kept by octave; says how many.
    pub fn keep(&mut self, kept: &[Vec<bool>]) -> usize {
        let mut left_out = 0;
        for ((stated, quantities), kept) in self.table.iter_mut().flatten().zip(&mut self.energies).zip(kept)
        {
            let Some(own) = quantities else { continue };
            left_out += kept.iter().filter(|kept| !**kept).count();
            let (mut of_stated, mut of_own) = (kept.iter(), kept.iter());
            stated.retain(|_| of_stated.next().copied().unwrap_or(false));
            own.retain(|_| of_own.next().copied().unwrap_or(false));
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
