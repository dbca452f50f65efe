//! Compares measured with simulated responses: how far they are apart, whether chance explains it, and what a named
//! physical cause gains on positions that it has not seen.
//!
//! Sits at the end of the workspace, after `acoustics`, `propagate` and `optimize`.
//!
//! # Does not
//! - name a cause by itself yet: it fits and scores the [`Effect`] that it is given, one at a time, with the materials
//!   held fixed. The catalogue holds two effects, [`TransducerResponse`] and [`BackgroundNoise`].
//! - read responses or trace rooms: it takes energies per band and time bin.
//!
//! # Example
//! A loudspeaker that is 6 dB too loud in one octave, hidden in the "measurement" and found:
//! ```
//! use sabine_acoustics::{EnergyResponse, OctaveBands};
//! use sabine_diagnose::{Effect, Pair, TransducerResponse, explain};
//! let bands = OctaveBands::new(500.0, 2000.0)?;
//! let decay: Vec<f64> = (0..3 * 60).map(|i| 10f64.powf(-0.1 * (i % 60) as f64)).collect();
//! let predicted = EnergyResponse::new(bands, 0.01, decay, vec![0.0; 180])?;
//! let measured = TransducerResponse.apply(&[0.0, 6.0, 0.0], &predicted)?;
//! let pair = Pair { measured, predicted };
//! let found = explain(&TransducerResponse, &[pair.clone()], &[pair])?;
//! assert!((found.values[1] - 6.0).abs() < 0.05);
//! assert!(found.held_out_after_db < 0.1 * found.held_out_before_db);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Units
//! Energies as in [`sabine_acoustics::EnergyResponse`], residuals in dB, bins in seconds.
//!
//! # Accuracy
//! `tests/hidden.rs`: with exponentially distributed energy the reduced chi-squared of a right prediction is near its
//! expectation, hidden gains and noise levels lie within four standard errors, and an effect that is absent gains nothing.

mod background_noise;
mod effect;
mod error;
mod misfit;
mod transducer_response;

pub use background_noise::BackgroundNoise;
pub use effect::{Effect, Explanation, Pair, Parameter, explain};
pub use error::Error;
pub use misfit::{Misfit, Residual};
pub use transducer_response::TransducerResponse;
