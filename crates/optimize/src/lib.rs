//! Under construction.

mod bounded;
mod config;
mod decay;
mod decay_slope;
mod error;
mod expansion;
mod fit;
mod fitter;
mod group;
mod history;
mod objective;
mod single_paths;
mod uncertainty;

pub use bounded::{Minimum, minimise};
pub use config::{AbsorptionPrior, FitConfig, SlopeObjective};
pub use error::Error;
pub use fit::{
    AtBound, MaterialFit, Undetermined, UndeterminedKind, Unreachable, UnreachableReason, Warning,
};
pub use fitter::MaterialFitter;
pub use objective::SlopeEvaluation;
