//! The vocabulary and the measures of room acoustics.
//!
//! Under construction: the front page follows.

mod air;
mod bands;
mod energy;
mod error;
mod estimate;
mod material;
mod paths;
mod progress;
mod scene;
mod signal;
mod targets;
mod traits;

pub use air::Air;
pub use bands::{OctaveBands, PerBand};
pub use energy::{EnergyDecayCurve, EnergyResponse};
pub use error::Error;
pub use estimate::{Estimate, NoReading, Reading};
pub use material::Material;
pub use paths::{Contribution, PathSet, Reflection};
pub use progress::{Observer, report};
pub use scene::{NamedMaterial, Receiver, Scene, Source, Triangle};
pub use signal::{ImpulseResponse, Signal};
pub use targets::RoomTargets;
pub use traits::{Augment, FeatureExtractor, Objective, Propagator, RayHit, RayScene, RoomEstimator};
