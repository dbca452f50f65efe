//! From a few seconds of speech and a rough model of the room to sound that belongs in the room.
//!
//! One call does the whole job ([`match_room`]); the crates that it is composed of are re-exported, each usable alone.
//!
//! ```text
//!  speech ─► features ─► estimator ─► RoomTargets (T60, EQ per octave) ─┐
//!                                                                       ▼
//!  mesh + materials ─► propagate ─► PathSet ───────────────────────► optimize ─► materials
//!                                      │                                 │
//!                                      ▼                                 ▼ what the slope cannot give
//!                               pressure response ◄──────────────── eqfilter (linear-phase FIR)
//! ```
//!
//! # I have a phone recording
//! ```no_run
//! use sabine::acoustics::{Channel, MeasuredRoom, read_audio};
//! use sabine::{MatchConfig, MatchInput, MatchSummary, Recording, match_room};
//! let speech = read_audio("recording.wav", Channel::Mono)?;
//! let dry = read_audio("voice.wav", Channel::Mono)?;
//! let room = MeasuredRoom::read("my_room")?;
//! let input = MatchInput {
//!     speech: Recording { name: "recording.wav", signal: &speech },
//!     dry: Recording { name: "voice.wav", signal: &dry },
//!     room: &room,
//!     source: "s1",
//!     receiver: "r1",
//! };
//! let matched = match_room(&input, &MatchConfig::default(), &())?;
//! for warning in &matched.warnings {
//!     eprintln!("{warning}");
//! }
//! println!("{}", MatchSummary::new(&matched).to_json()?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! The example program `match_room` is this call with a command line, progress bars and a report.
//!
//! # I have an estimator or a tracer of my own
//! [`match_room_with`] takes any [`acoustics::RoomEstimator`] and any [`acoustics::Propagator`].
//!
//! # Does not
//! - place sound from directional sources, or above 8 kHz as the room would: the estimator hears 16 kHz speech, and the
//!   paper's -50 dB from 8 kHz on is the default ([`MatchConfig::above_8_khz_db`]).
//! - find the room's geometry.
//!
//! # Units
//! Seconds, metres, Hz, dB; absorption and scattering are shares of energy at random incidence.
//!
//! # Reference
//! Z. Tang, N. J. Bryan, D. Li, T. R. Langlois, D. Manocha: Scene-aware audio rendering via deep acoustic analysis.
//! IEEE Transactions on Visualization and Computer Graphics 26 (5), 2020.

pub use sabine_acoustics as acoustics;
pub use sabine_augment as augment;
pub use sabine_diagnose as diagnose;
pub use sabine_eqfilter as eqfilter;
pub use sabine_estimator as estimator;
pub use sabine_features as features;
pub use sabine_optimize as optimize;
pub use sabine_propagate as propagate;

mod error;
mod matching;
mod recording;
mod summary;
mod warning;

pub use error::Error;
pub use matching::{DECAY_STEP_S, MatchConfig, MatchInput, RoomMatch, match_room, match_room_with};
pub use recording::Recording;
pub use summary::{MatchSummary, MaterialChange, UnreachableBand, materials_toml};
pub use warning::Warning;
