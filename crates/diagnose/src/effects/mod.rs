//! The catalogue: one file an effect.

mod air_absorption;
mod angle_dependent_absorption;
mod background_noise;
mod channel_fault;
mod coupled_volume;
mod edge_diffraction;
mod extra_reflector;
mod nonlinear_distortion;
mod open_patch;
mod position_error;
mod room_dimensions;
mod room_modes;
mod sampling_clock;
mod scattering;
mod sound_speed;
mod source_directivity;
mod surface_absorption;
mod time_zero;
mod transducer_response;
mod truncation;

pub use air_absorption::AirAbsorption;
pub use angle_dependent_absorption::AngleDependentAbsorption;
pub use background_noise::BackgroundNoise;
pub use channel_fault::ChannelFault;
pub use coupled_volume::CoupledVolume;
pub use edge_diffraction::MissingDiffraction;
pub use extra_reflector::ExtraReflector;
pub use nonlinear_distortion::NonlinearDistortion;
pub use open_patch::OpenPatch;
pub use position_error::PositionError;
pub use room_dimensions::RoomDimensions;
pub use room_modes::RoomModes;
pub use sampling_clock::SamplingClock;
pub use scattering::Scattering;
pub use sound_speed::SoundSpeed;
pub use source_directivity::SourceDirectivity;
pub use surface_absorption::SurfaceAbsorption;
pub use time_zero::TimeZeroOffset;
pub use transducer_response::TransducerResponse;
pub use truncation::Truncation;

use crate::effect::Effect;

/// All effects that come with this crate.
pub fn catalogue() -> Vec<Box<dyn Effect>> {
    vec![
        Box::new(TransducerResponse),
        Box::new(AirAbsorption),
        Box::new(SourceDirectivity),
        Box::new(Scattering),
        Box::new(SurfaceAbsorption),
        Box::new(BackgroundNoise),
        Box::new(CoupledVolume),
        Box::new(Truncation),
        Box::new(SoundSpeed),
        Box::new(SamplingClock),
        Box::new(RoomDimensions),
        Box::new(PositionError),
        Box::new(TimeZeroOffset),
        Box::new(ChannelFault),
        Box::new(ExtraReflector),
        Box::new(OpenPatch),
        Box::new(AngleDependentAbsorption),
        Box::new(NonlinearDistortion),
        Box::new(MissingDiffraction),
        Box::new(RoomModes),
    ]
}

/// Logarithm of a sum of energies, one of them given as its logarithm.
fn add_energy(ln_energy: f64, more: f64) -> f64 {
    let ln_more = more.max(1e-300).ln();
    let (high, low) = if ln_energy > ln_more { (ln_energy, ln_more) } else { (ln_more, ln_energy) };
    high + (low - high).exp().ln_1p()
}
