//! `nonlinear_distortion`: the loudspeaker was driven too hard.

mod harmonics;

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{AuxiliaryEvidence, Case, Effect, PreArrivalTerm};
use crate::observe::pre_arrival::PreArrival;
use crate::survey::Survey;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// The second and third harmonic of an exponential sweep, each a copy of the response before its direct sound: the k-th comes earlier
/// by L ln(k), where the sweep's frequency grows as exp(t / L).
///
/// Parameters: the lead of the second harmonic (L ln 2), and of both harmonics the level at 1 kHz of the response, relative to
/// the response itself, with a slope over its octaves.
///
/// Mark: packets before the direct sound at the same times in all responses, spaced as logarithms, each decaying like the room. Only
/// recordings that begin some tenths of a second before the direct sound can hold them. Mimicked by: noise, which has no such
/// order. A quieter measurement tells: harmonics fall faster than the sound. The rendered response is that of the room,
/// without them.
///
/// Source: A. Farina, AES 108th convention, 2000; S. Müller and P. Massarani, J. Audio Eng. Soc. 49, 2001.
#[derive(Clone, Copy, Debug, Default)]
pub struct NonlinearDistortion;

impl Effect for NonlinearDistortion {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "nonlinear_distortion",
            "Loudspeaker overdriven",
            "The loudspeaker or an amplifier was overdriven: harmonics of the sweep come before the direct sound.",
        )
        .decided_by(9, NextMeasurement::Quieter)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        if !PreArrival::any(survey) {
            return Vec::new();
        }
        vec![Case::pre_arrival(harmonics::parameters(), Harmonics::default())]
    }
}

/// The harmonics, with what was found so far by the responses that count: fits ask for the same ones again and again.
#[derive(Default)]
struct Harmonics {
    found: Mutex<BTreeMap<Vec<bool>, Option<AuxiliaryEvidence>>>,
}

impl PreArrivalTerm for Harmonics {
    fn weigh(&self, responses: &PreArrival, used: &[bool]) -> Option<AuxiliaryEvidence> {
        let known = self.found.lock().unwrap_or_else(PoisonError::into_inner).get(used).cloned();
        known.unwrap_or_else(|| {
            // A fit that does not converge says nothing.
            let found = harmonics::fit(responses, used).ok().flatten();
            let mut all = self.found.lock().unwrap_or_else(PoisonError::into_inner);
            all.insert(used.to_vec(), found.clone());
            found
        })
    }
}
