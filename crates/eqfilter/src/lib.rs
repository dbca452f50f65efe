//! FIR filters from gains in octave bands, and fast convolution.
//!
//! What geometry cannot give a simulated response, the level of each octave as it is heard in the room, is put there by a filter
//! at the end of the line. This crate designs that filter and convolves with it, and with room responses, offline and in
//! real time.
//!
//! It does **not** design recursive filters, equalise loudspeakers by inversion, or decide which gains a room needs: those
//! come from the estimator, or from a measurement. Nor does it resample.
//!
//! ```toml
//! [dependencies]
//! sabine-eqfilter = "0.1"
//! ```
//!
//! # Example
//!
//! ```
//! use sabine_acoustics::{Bands, PerBand};
//! use sabine_eqfilter::{EqFilter, EqFilterConfig};
//!
//! // 15 dB up and down from octave to octave, through 64 ms of taps.
//! let gains = PerBand::from_fn(Bands::EQ, |band| if band % 2 == 0 { 15.0 } else { -15.0 });
//! let filter = EqFilter::design(&gains, 48_000, EqFilterConfig::default())?;
//! assert_eq!((filter.taps().len(), filter.delay_samples()), (3073, 1536));
//! assert_eq!(filter.delay_s(), 0.032);
//! let at_125_hz = filter.realised_db().at_hz(125.0).unwrap().unwrap();
//! assert!((at_125_hz - -15.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Which function for what
//!
//! | for | use |
//! |---|---|
//! | an EQ whose octave gains are right | [`EqFilter::design`]; many of one kind: [`EqDesigner`] |
//! | the same without delay, for live use | [`EqFilter::minimum_phase`] |
//! | random colouration, no gain guaranteed | [`EqFilter::window_method`] |
//! | filtering a signal | [`EqFilter::apply`] (aligned), [`EqFilter::apply_with_delay`] (whole) |
//! | convolving two signals | [`convolve`] |
//! | convolving a file of any length in little memory | [`BlockConvolver`] |
//! | convolving a live stream with a room, block by block | [`PartitionedConvolver`] |
//! | a reverb in an audio callback: any number of frames, several channels | [`RoomReverb`] |
//!
//! # Units and conventions
//!
//! Gains are in dB, of the power in an octave: the filter's power response averaged over the frequencies of the band, weighed as
//! the filter bank of [`sabine_acoustics`] weighs them, so 0 dB in every band is a filter that changes nothing. Bands are IEC 61260-1
//! octaves. A band whose centre lies above half the sample rate has no gain and no effect; one that half the sample rate
//! cuts (8 kHz at 16 kHz sampling) counts as far as it goes. Delays are in seconds or samples, as the name says.
//!
//! # Accuracy
//!
//! With the default delay of 32 ms, any gains within 15 dB, alternating ones included, are met within 0.1 dB in every octave from
//! 62.5 Hz to 8 kHz at 16, 44.1, 48 and 96 kHz (`tests/it/design.rs`, by a Fourier sum that shares no code with the design), and
//! so the filter bank measures them (`tests/it/filter_bank.rs`).
//! The price is in the shape: 64 ms of taps resolve about 25 Hz, half the octave at 62.5 Hz, so there the curve between the
//! bands is steep or shallow as the taps permit, and where neighbours differ by 30 dB it passes through zeros at the
//! edges. A shorter delay resolves less: what it cannot meet, [`EqFilter::realised_db`] reports. Minimum phase keeps
//! these gains within 0.1 dB. Convolution agrees with the plain sum to the rounding of single precision
//! (`tests/it/convolution.rs`, `tests/it/room_reverb.rs`).
//!
//! # References
//!
//! - Z. Tang, N. J. Bryan, D. Li, T. R. Langlois, D. Manocha, "Scene-aware audio rendering via deep acoustic analysis", IEEE
//!   TVCG 26(5), 2020: the setting [`EqFilterConfig::PAPER`].
//! - J. O. Smith, "Spectral audio signal processing", W3K, 2011: the window method.
//! - A. V. Oppenheim, R. W. Schafer, "Discrete-time signal processing", 3rd ed., 2010: minimum phase by the cepstrum.
//! - W. G. Gardner, "Efficient convolution without input-output delay", J. Audio Eng. Soc. 43(3), 1995: partitions of growing size.

mod block_convolver;
mod config;
mod convolve;
mod designer;
mod error;
mod filter;
mod grid;
mod handover;
mod layout;
mod matrix;
mod octave;
mod partitioned;
mod plans;
mod ramp;
mod room_reverb;
mod solve;
mod uniform;
mod variants;

pub use block_convolver::BlockConvolver;
pub use config::{AboveBand, EqFilterConfig};
pub use convolve::convolve;
pub use designer::EqDesigner;
pub use error::Error;
pub use filter::{EqFilter, Phase};
pub use handover::RoomReverbControl;
pub use layout::{PartitionedConfig, PreparedResponse};
pub use partitioned::{PartitionedConvolver, ResponsePreparer};
pub use room_reverb::{RoomReverb, RoomReverbConfig};
