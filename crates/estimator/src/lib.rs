//! A small CNN that hears reverberation time and equalisation per octave in speech.
mod block;
mod config;
mod constant;
mod correlate;
mod error;
mod estimator;
mod graph;
mod labels;
mod layout;
mod model;
mod network;
mod norm;
mod parameters;
mod pool;
mod shape;
mod warning;
mod windows;

pub use config::{Block, NetworkConfig, Summary};
pub use constant::ConstantEstimator;
pub use error::{DatasetFault, Error, WeightsFault};
pub use estimator::{DetailedEstimate, Estimator, LEAST_DURATION_S, WindowEstimate};
pub use labels::{EQ_COUNT, LABEL_COUNT, LabelScale, T60_COUNT, T60Scale, label_hz, label_name};
pub use layout::{FeatureLayout, Normalisation};
pub use model::{Calibration, Model};
pub use network::{Network, Scratch};
pub use parameters::Parameters;
pub use warning::Warning;
