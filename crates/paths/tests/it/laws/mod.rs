//! Laws: their grammar, their errors, and what they do to paths.

mod cost;
mod effect_on_paths;
mod errors;
mod formulas;
mod local_reaction;
#[cfg(feature = "serde")]
mod tables;
