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
//! Measured responses go the other way: [`diagnose`] says what the simulation gets wrong against them, and why.
//!
//! # Where to start
//! | I have ... | go to |
//! |---|---|
//! | a phone recording and a rough model of the room | below; step by step in the [`guide`] |
//! | recordings of any length | [`match_room_files`], which reads and writes in blocks |
//! | impulse responses | [`acoustics::RoomParameters`] |
//! | impulse responses and a model | [`optimize::MaterialFitter`], [`diagnose::Diagnoser`] |
//! | a mesh with materials | [`propagate::PathTracer`] |
//! | dry speech and responses, and a network to train | [`augment`], [`estimator::Trainer`] |
//! | an audio callback, and a room that is to be heard in it | [`eqfilter::RoomReverb`]; kira, rodio, firewheel, cpal: `docs/how-to/audio-engines.md` |
//! | an estimator or a tracer of my own | [`match_room_with`] |
//! | a wish to read code first | the worked examples in `examples/` of the repository, one idea each |
//! | no wish to program | the command `sabine` of the crate `sabine-cli` |
//!
//! ```toml
//! [dependencies]
//! sabine = "0.1"
//! ```
//!
//! # Example
//! ```
//! use sabine::acoustics::{Channel, read_audio};
//! use sabine::scene::MeasuredRoom;
//! use sabine::propagate::TracerConfig;
//! use sabine::{MatchConfig, MatchInput, Recording, match_room};
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! let speech = read_audio("fixtures/speech/recording.wav", Channel::Mono)?;
//! let dry = read_audio("fixtures/speech/dry_guest.wav", Channel::Mono)?;
//! let room = MeasuredRoom::read("fixtures/room")?;
//! let input = MatchInput {
//!     speech: Recording { name: "recording.wav", signal: &speech },
//!     dry: Recording { name: "dry_guest.wav", signal: &dry },
//!     room: &room,
//!     source: "talker",
//!     receiver: "microphone",
//! };
//! // An eighth of the default's rays, for a quick look.
//! let tracer = TracerConfig { rays: 5_000, ..TracerConfig::default() };
//! let matched = match_room(&input, &MatchConfig { tracer, ..MatchConfig::default() }, &())?;
//! for warning in &matched.warnings {
//!     eprintln!("{warning}");
//! }
//! let wanted_s = matched.targets.t60_s().at_hz(1000.0).ok_or("no such octave")?.value;
//! let reached_s = matched.t60_reached_s.at_hz(1000.0).ok_or("no such octave")?.clone()?.value;
//! assert!((reached_s / wanted_s - 1.0).abs() < 0.05); // one just-noticeable difference
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! The example `match_room` is this call with a progress bar and a report; `sabine match` is it with a command line.
//!
//! # Does not
//! - place sound from directional sources, or above 8 kHz as the room would: the estimator hears 16 kHz speech, and the
//!   paper's -50 dB from 8 kHz on is the default ([`MatchConfig::above_8_khz_db`]).
//! - find the room's geometry.
//! - simulate waves: no standing waves, diffraction over one edge at a time and only if asked for ([`propagate`]).
//!
//! # Units
//! Seconds, metres, Hz, dB; absorption and scattering are shares of energy at random incidence.
//!
//! # Accuracy
//! | claim | shown by |
//! |---|---|
//! | the fixture, whose room is known: estimates within 9 % of the truth (8 kHz: 15 %), the rendered response within 1.5 % of them | `docs/validation/match_room.md` |
//! | the same seed gives the same sound on any number of threads | `crates/cli/tests/it/match_room.rs` |
//! | everything else | the front pages of the crates |
//!
//! # Features
//! - `symphonia`: FLAC, Ogg Vorbis and AIFF wherever sound is read.
//! - `rew-http`: responses from the Room EQ Wizard while it runs.
//! - `sofa`: head-related responses from AES69 (SOFA) files.
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
pub use sabine_paths as paths;
pub use sabine_propagate as propagate;
pub use sabine_scene as scene;

pub mod guide;

mod clock;
mod error;
mod low_end;
mod match_files;
mod matching;
mod recording;
mod room_renderer;
mod summary;
mod warning;

pub use error::Error;
pub use low_end::JoinedWaves;
pub use match_files::{EXCERPT_S, Excerpt, FileMatch, MatchFiles, match_room_files};
pub use matching::{DECAY_STEP_S, MatchConfig, MatchInput, RoomMatch, match_room, match_room_with};
pub use recording::Recording;
pub use room_renderer::{RenderedFile, RoomRenderer};
pub use summary::{MatchSummary, MaterialChange, UnreachableBand, materials_toml};
pub use warning::Warning;
