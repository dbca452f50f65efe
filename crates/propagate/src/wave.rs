//! Sound as a wave at low frequencies: finite differences on a voxel grid of the mesh.

mod axes;
mod band_runs;
mod crossings;
mod crossover;
mod error;
mod leapfrog;
mod point_weights;
mod response;
mod room;
mod solver;
mod source_pulse;

pub use sabine_acoustics::{absorption_of_admittance, admittance_of_absorption};

pub use crossover::{Crossover, JoinedResponse};
pub use error::WaveError;
pub use response::WaveResponse;
pub use room::WaveRoom;
pub use solver::{WaveConfig, WaveSolver};
