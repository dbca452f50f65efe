//! `unknown_law`: a cause that no catalogue lists, by what it goes with.

mod band_law;
mod covariate;
mod formula;
mod release;
mod wave;

pub(crate) use band_law::BandLaw;
pub(crate) use covariate::Covariate;
pub(crate) use formula::{Formula, Grammar};
pub(crate) use wave::Wave;

use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, Effect, EffectInfo};
use crate::survey::Survey;

/// Greatest amplitude that is sought, in dB.
const MOST_DB: f64 = 20.0;
/// The same of what is added to sound, in place of taken.
const MOST_ADDED_DB: f64 = 10.0;
/// The same of its change from octave to octave.
const MOST_PER_OCTAVE_DB: f64 = 4.0;

/// A law that the data choose among the formulas of a grammar: an amplitude in dB, how it goes with the octave (the same in all, evenly up or
/// down, both, above or below an edge, with the square of the frequency, about a resonance), and a covariate: the angle at each surface, length
/// and share of scattering of paths, where they leave the source and reach the receiver, distance, time, the order of the recordings where it is
/// stated, products of two, and two courses of the recorder's gain: waves, whose period and phase are fitted too, and releases after a loud first
/// sound, whose time constant is. Where its covariate is 1 a law takes up to
/// 20 dB, or adds up to 10. A second term of another covariate is a second law, which is searched for beside the first.
///
/// Mark: none of the catalogue explains what is left, and it goes with one of these. Mimicked by: every cause of the catalogue that goes with
/// the same; a formula pays for being one of many, so that a listed cause wins where both explain as much. What is found says what the misfit
/// goes with, not why: other forms that rise and fall with the covariate would do as well, and those that do here are listed.
///
/// Not part of [`catalogue`](crate::catalogue): [`Diagnoser::discovering`](crate::Diagnoser::discovering) adds it and searches for its cases;
/// by itself it has none.
///
/// Source: short forms enumerated in place of a random search, D. J. Bartlett, H. Desmond, P. G. Ferreira: Exhaustive symbolic regression,
/// 2022; the score is that of all effects.
#[derive(Clone, Copy, Debug, Default)]
pub struct UnknownLaw;

impl Effect for UnknownLaw {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "unknown_law",
            "A law that no catalogue lists",
            "What the simulation gets wrong goes with the quantity that is named; the amplitude says how much is taken where that quantity is 1.",
        )
        .decided_by(20, NextMeasurement::MorePositionsAndSource)
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        Vec::new()
    }
}
