//! The vocabulary and the measures of room acoustics.
//!
//! Under construction: the front page follows.

mod air;
mod atomic_file;
mod audio;
#[cfg(feature = "symphonia")]
mod audio_symphonia;
mod band_energy;
mod bands;
mod decay_fit;
mod energy;
mod equalisation;
mod error;
mod estimate;
mod filter_bank;
mod material;
mod material_library;
mod measured_room;
mod onset;
mod parameters;
mod paths;
mod progress;
mod resample;
mod scene;
mod signal;
mod spectrum;
mod targets;
mod theory;
mod third_octaves;
mod traits;

pub use air::Air;
pub use atomic_file::write_atomically;
pub use audio::{AudioInfo, Channel, SampleFormat, encode_wav, probe_wav, read_audio, write_wav};
pub use bands::{OctaveBands, PerBand};
pub use decay_fit::{DecayFit, Slope};
pub use energy::{EnergyDecayCurve, EnergyResponse};
pub use equalisation::equalisation;
pub use error::Error;
pub use estimate::{Estimate, NoReading, Reading};
pub use filter_bank::{FilterBank, ThirdOctaveFilterBank};
pub use material::Material;
pub use material_library::{LibraryMaterial, library_material, material_library};
pub use measured_room::{
    Levels, MaterialPrior, MeasuredRoom, Measurement, NewResponse, NewRoom, ResponseEntry, TimeZero,
};
pub use onset::Onset;
pub use parameters::{BandParameters, RoomParameters};
pub use paths::{Contribution, PathSet, Reflection};
pub use progress::{Observer, report};
pub use resample::{resample, resample_response};
pub use scene::{NamedMaterial, Receiver, Scene, Source, Triangle};
pub use signal::{ImpulseResponse, Signal};
pub use targets::RoomTargets;
pub use theory::{DiffuseRoom, schroeder_frequency_hz};
pub use third_octaves::ThirdOctaveBands;
pub use traits::{Augment, FeatureExtractor, Objective, Propagator, RayHit, RayScene, RoomEstimator};
