//! Short-time Fourier transform and log-mel spectrograms, planned once and run many times.
//!
//! The first stage of the line from speech to a room: samples go in, the features that an estimator listens to come out.
//! [`LogMel`] implements [`crate::FeatureExtractor`]; so does [`NaiveLogMel`], the definition written out, which is
//! there to be compared with.
//!
//! It does **not** read files, resample, pad, or remove mean and standard deviation: those belong to the estimator, which
//! knows the training set.
//!
//! ```toml
//! [dependencies]
//! sabine-features = "0.1"
//! ```
//!
//! # Example
//!
//! ```
//! use sabine_features::FeatureExtractor;
//! use sabine_features::{LogMel, LogMelConfig};
//!
//! let log_mel = LogMel::new(LogMelConfig::default())?;
//! // Four seconds of a 1 kHz tone of amplitude 1.
//! let tone: Vec<f32> = (0..64_000).map(|n| (std::f32::consts::TAU * n as f32 / 16.0).sin()).collect();
//! let levels_db = log_mel.extract(&tone);
//! assert_eq!(levels_db.dim(), (32, 499));
//! // The power |X|^2 of the Hann window's main lobe is 64^2 at bin 16 and a quarter of it in either neighbour: the band with
//! // the highest level is the one around 1 kHz.
//! let loudest = (0..32).max_by(|&a, &b| levels_db[[a, 250]].total_cmp(&levels_db[[b, 250]]));
//! assert_eq!(loudest, Some(10));
//! # Ok::<(), sabine_features::Error>(())
//! ```
//!
//! # Which type for what
//!
//! | for | use |
//! |---|---|
//! | features of a recording | [`LogMel::extract`](crate::FeatureExtractor::extract), or [`LogMel::extract_into`] without allocation |
//! | features of live input, hop by hop | [`LogMelStream`] |
//! | spectra and back again | [`Stft::forward`], [`Stft::inverse`] |
//!
//! # Units and conventions
//!
//! Samples have full scale 1. Frame `t` covers the samples `t * hop .. t * hop + n_fft`; there is no centre padding. The window
//! is the periodic Hann window. The transform is unnormalised. Mel bands are Slaney's, normalised to unit area over Hz.
//! Levels are `10 log10(max(power, floor_power))` in dB; there is no `top_db`, so that a level never depends on another
//! frame.
//!
//! # Accuracy
//!
//! Within 1e-4 dB of librosa 0.11 (`melspectrogram(center=False, htk=False, norm="slaney")`, `power_to_db(top_db=None)`),
//! computed in double precision, on noise, tones, clicks, a sweep 100 dB deep and speech-like pulses: test
//! `tests/it/librosa.rs`, generator beside its golden files. Within 1e-4 dB of the definition on arbitrary input: test
//! `tests/it/definition.rs`.
//!
//! # References
//!
//! - Z. Tang, N. J. Bryan, D. Li, T. R. Langlois, D. Manocha, "Scene-aware audio rendering via deep acoustic analysis", IEEE
//!   TVCG 26(5), 2020, section 3.4: the default settings.
//! - M. Slaney, "Auditory Toolbox, version 2", Interval Research Corporation TR 1998-010: the mel scale and the triangles.
//! - D. W. Griffin, J. S. Lim, "Signal estimation from modified short-time Fourier transform", IEEE TASSP 32(2), 1984: the
//!   inverse.

mod error;
mod feature_extractor;
mod log_mel;
mod mel;
mod naive;
mod stft;
mod stream;

pub use error::Error;
pub use feature_extractor::FeatureExtractor;
pub use log_mel::{LogMel, LogMelConfig, LogMelScratch};
pub use mel::{MelBands, hz_to_mel, mel_to_hz};
pub use naive::NaiveLogMel;
pub use realfft::num_complex::Complex;
pub use stft::{Stft, StftScratch};
pub use stream::LogMelStream;
