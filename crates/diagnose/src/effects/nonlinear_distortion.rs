//! `nonlinear_distortion`: the loudspeaker was driven too hard.

use crate::{Case, Effect, Evidence, LeadIns, OwnEvidence, Parameter, Survey};

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
    fn id(&self) -> &'static str {
        "nonlinear_distortion"
    }

    fn explanation(&self) -> &'static str {
        "The loudspeaker (or an amplifier) was overdriven: harmonics of the sweep come before the direct sound."
    }

    fn cases(&self, survey: &Survey) -> Vec<Box<dyn Case>> {
        if LeadIns::any(survey) { vec![Box::new(*self)] } else { Vec::new() }
    }
}

impl Case for NonlinearDistortion {
    fn evidence(&self) -> Evidence {
        Evidence::LeadIn
    }

    fn parameters(&self, _: &Survey) -> Vec<Parameter> {
        LeadIns::harmonic_parameters()
    }

    fn before_direct(&self, lead_ins: &LeadIns, used: &[bool]) -> Option<OwnEvidence> {
        lead_ins.harmonics(used)
    }
}
