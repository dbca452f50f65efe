//! A small CNN that hears reverberation time and equalisation per octave in speech.
mod block;
mod config;
mod correlate;
mod error;
mod graph;
mod network;
mod norm;
mod parameters;
mod pool;
mod shape;

pub use config::{Block, NetworkConfig, Summary};
pub use error::{DatasetFault, Error, WeightsFault};
pub use network::{Network, Scratch};
pub use parameters::Parameters;
