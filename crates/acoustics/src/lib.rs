//! The vocabulary and the measures of room acoustics: what is said about a room, and what can be read from its response.
//!
//! Every other crate of the workspace speaks in the types of this one and none of its numbers leave without a unit. It imports
//! no other crate of the workspace.
//!
//! ```text
//!  WAV ─► Signal ─► ImpulseResponse ─┬─► FilterBank ─► bands that add up to the response
//!                                    ├─► RoomParameters (EDT, T20, T30, T60, C50, C80, D50, centre time, DRR per octave)
//!                                    │        └─► DecayFit: one to three slopes and the noise, with their uncertainty
//!                                    └─► equalisation: level of each octave relative to 1 kHz
//! ```
//!
//! # Example
//! What a room of known decay measures, and how sure the answer is:
//! ```
//! use sabine_acoustics::{Bands, ImpulseResponse, NoReading, RoomParameters};
//!
//! // White noise whose energy falls by 60 dB in 0.8 s, 50 dB above a floor of noise.
//! let mut state = 1u32;
//! let mut white = || {
//!     state = state.wrapping_mul(1664525).wrapping_add(1013904223);
//!     (state >> 8) as f32 / 8388608.0 - 1.0
//! };
//! let samples = (0..24000).map(|i| (-6.9078 * i as f32 / 12800.0).exp() * white() + 0.00316 * white()).collect();
//! let response = ImpulseResponse::new(samples, 16000)?;
//!
//! let room = RoomParameters::measure(&response, Bands::T60)?;
//! let t60 = room.t60_s.at_hz(2000.0).unwrap().clone()?;
//! assert!((t60.value - 0.8).abs() < 0.04);
//! let (low, high) = t60.interval(4.0);
//! assert!(low < 0.8 && 0.8 < high);
//!
//! // What cannot be read says why: the 8 kHz octave ends at 11.2 kHz, and T30 wants 45 dB above the noise.
//! assert!(matches!(room.t60_s.at_hz(8000.0), Some(Err(NoReading::AboveNyquist { .. }))));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Contents
//! - [`Bands`], octaves or third octaves, and [`PerBand`] (IEC 61260-1).
//! - Sound: [`Signal`], [`ImpulseResponse`] (**pressure**), [`read_audio`], [`write_wav`], [`resample()`]; for files of any length
//!   [`AudioReader`], [`WavWriter`] and [`BlockResampler`], which work in blocks; [`read_response`].
//! - Measuring (ISO 18233): [`ExponentialSweep`], and [`deconvolve`], which tells recordings that are no measurement.
//! - Measures: [`RoomParameters`], [`BandParameters`] (full band and third octaves), [`DecayFit`], [`EnergyDecayCurve`],
//!   [`equalisation()`], [`Onset`], [`FilterBank`]; [`SoundStrength`], [`LateralEnergy`], [`InterauralCorrelation`];
//!   single numbers over bands ([`mid_frequency_mean`], [`bass_ratio`]) and over positions ([`SpatialMean`]). A number comes as a [`Reading`]: an [`Estimate`] with its standard error, or
//!   the reason ([`NoReading`]) why there is none.
//! - Speech: [`ModulationTransfer`] and the STI of it ([`SpeechTransmission`]), with noise, masking and threshold.
//! - What rooms are made of: [`Material`], [`material_library`], [`Air`] (ISO 9613-1), [`Directivity`] and [`Orientation`] of a
//!   source or receiver.
//! - [`EnergyResponse`] (energy, **not** to be convolved) and [`RoomTargets`]: what a simulation gives and what a fit wants.
//! - Fourier transforms, compiled once for all crates: [`RealTransforms`].
//! - The trait [`RoomEstimator`]: speech in, [`RoomTargets`] out. [`Observer`]: progress of long work, and a way to stop it.
//!
//! # Does not
//! - know rooms or paths: meshes, sources and measured rooms are in `sabine-scene`, traced paths in `sabine-paths`.
//! - play or record: it makes the sweep and the response of what was recorded ([`deconvolve`]).
//! - fall back: where T30 cannot be had it does not give T20 in its place.
//!
//! # Units
//! Seconds, metres, Hz, degrees Celsius, kPa; levels in dB. Absorption and scattering are shares of energy at random incidence.
//! Public names carry the unit (`_s _hz _m _db`).
//!
//! # Accuracy
//! | what | how good | shown by |
//! |---|---|---|
//! | bands add up to the input | within -100 dB; each within class 1 of IEC 61260-1 | unit tests of the filter bank |
//! | full-band T60, SNR 60 / 45 / 30 dB | mean error 0.2 / 0.3 / 0.6 % at 48 kHz | `tests/it/decay_accuracy.rs` |
//! | 95 % intervals of T60 | cover 95 to 96 % | `tests/it/decay_accuracy.rs` |
//! | two slopes | second slope within 0.2 / 0.3 / 0.5 % at -10 / -20 / -30 dB, full band | `tests/it/decay_accuracy.rs` |
//! | one slope taken for two | 0 of 500 | `tests/it/decay_accuracy.rs` |
//! | sound strength, lateral fractions, IACC | 0.02 dB, 0.01, 0.005 of closed forms | `tests/it/listener_measures.rs` |
//! | STI | 0.004 of closed forms (mean of 8 decays), the worked example of IEC 60268-16 to its digits | `tests/it/speech_transmission.rs` |
//! | air absorption | three digits of ISO 9613-1 | `tests/it/air_reference.rs` |
//! | directivity index of the cardioid family | 0.001 dB | unit tests of the directivity |
//! | real rooms | BRAS CR2: from 500 Hz on T60 within 5 % of the room means in 14 of 14 third octaves, T20 in 12 | `tests/it/real_responses.rs` |
//!
//! A decay shorter than eight over the bandwidth is not read in that band (0.09 s at 125 Hz): the filter would ring as long.
//! `docs/validation/measures.md` has the tables and how to repeat them.
//!
//! # Features
//! - `audio` (default): sound files and resampling. Without it (`default-features = false`) the crate compiles in seconds.
//! - `symphonia`: [`read_audio`] reads FLAC, Ogg Vorbis and AIFF besides WAV.
//!
//! # References
//! - ISO 3382-1:2009 and 3382-2:2008 (parameters), IEC 60268-16:2020 (speech transmission),
//!   ISO 18233:2006 (sweeps), IEC 61260-1:2014 (bands), ISO 9613-1:1993 (air).
//! - M. R. Schroeder: New method of measuring reverberation time. JASA 37, 1965.
//! - M. Karjalainen, P. Antsalo, A. Mäkivirta, T. Peltonen, V. Välimäki: Estimation of modal decay parameters from noisy
//!   response measurements. J. Audio Eng. Soc. 50, 2002.
//! - A. Lundeby, T. E. Vigran, H. Bietz, M. Vorländer: Uncertainties of measurements in room acoustics. Acustica 81, 1995.
//! - H. Kuttruff: Room Acoustics, 6th edition, 2017.

mod admittance;
mod air;
mod atomic_file;
#[cfg(feature = "audio")]
mod audio;
mod band_energy;
mod bands;
mod correlation;
mod decay_fit;
mod deconvolution;
mod directivity;
mod directivity_table;
mod energy;
mod engineering;
mod equalisation;
mod error;
mod estimate;
mod filter_bank;
mod interaural;
mod lateral;
mod local_reaction;
mod material;
mod material_library;
mod onset;
mod orientation;
mod out_of_range;
mod parameter_kind;
mod parameters;
mod per_band;
mod progress;
mod regular_file;
#[cfg(feature = "audio")]
mod resample;
#[cfg(feature = "audio")]
mod response_file;
mod room_estimator;
mod signal;
mod single_number;
mod spectrum;
mod speech_transmission;
mod strength;
mod sweep;
mod sweep_error;
mod targets;
mod transforms;

pub use admittance::{absorption_of_admittance, admittance_of_absorption};
pub use air::Air;
pub use atomic_file::{create_folder_beside, write_atomically};
#[cfg(feature = "audio")]
pub use audio::{
    AudioInfo, AudioReader, Channel, FileKind, SampleFormat, WavWriter, encode_wav, encode_wav_channels,
    probe_audio, read_audio, write_wav, write_wav_channels,
};
pub use bands::Bands;
pub use decay_fit::{DecayFit, Slope};
pub use deconvolution::{DeconvolutionConfig, SweepMeasurement, deconvolve};
pub use directivity::Directivity;
pub use energy::{EnergyDecayCurve, EnergyResponse};
pub use engineering::Engineering;
pub use equalisation::equalisation;
pub use error::Error;
pub use estimate::{Estimate, NoReading, Reading};
pub use filter_bank::FilterBank;
pub use interaural::InterauralCorrelation;
pub use lateral::{LateralEnergy, LateralNormalisation};
pub use local_reaction::LocalReaction;
pub use material::Material;
pub use material_library::{LibraryMaterial, library_material, material_library};
pub use onset::Onset;
pub use orientation::Orientation;
pub use out_of_range::OutOfRange;
pub use parameter_kind::ParameterKind;
pub use parameters::{BandParameters, RoomParameters};
pub use per_band::PerBand;
pub use progress::{Observer, report};
pub use regular_file::{open_file, read_at_most, read_text};
#[cfg(feature = "audio")]
pub use resample::{BlockResampler, resample, resample_response};
#[cfg(feature = "audio")]
pub use response_file::{LocatedResponse, check_one_onset, read_response};
pub use room_estimator::RoomEstimator;
pub use signal::{ImpulseResponse, Signal};
pub use single_number::{
    SpatialMean, bass_ratio, low_frequency_level, low_frequency_mean, mid_frequency_mean,
};
pub use speech_transmission::{
    MODULATION_HZ, ModulationTransfer, QualificationBand, SpeechTransmission, speech_levels,
};
pub use strength::{FreeFieldReference, SoundStrength};
pub use sweep::{ExponentialSweep, SweepConfig};
pub use sweep_error::SweepError;
pub use targets::RoomTargets;
pub use transforms::RealTransforms;
