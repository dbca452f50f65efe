//! FIR filters from gains in octave bands, and fast convolution.

mod config;
mod convolve;
mod designer;
mod error;
mod filter;
mod grid;
mod octave;
mod partitioned;
mod plans;
mod solve;
mod uniform;
mod variants;

pub use config::{AboveBand, EqFilterConfig};
pub use convolve::convolve;
pub use designer::EqDesigner;
pub use error::Error;
pub use filter::{EqFilter, Phase};
pub use partitioned::{PartitionedConfig, PartitionedConvolver, PreparedResponse, ResponsePreparer};
