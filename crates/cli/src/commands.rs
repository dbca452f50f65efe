//! One module for each command: its arguments, and `run`.

pub mod augment;
pub mod deconvolve;
pub mod diagnose;
pub mod eq;
pub mod estimate;
pub mod evaluate;
pub mod export;
pub mod fit;
pub mod import;
pub mod listen;
pub mod live;
pub mod match_room;
pub mod materials;
pub mod measure;
pub mod mix;
pub mod model;
pub mod new_room;
pub mod plan;
pub mod replace;
pub mod sweep;
pub mod trace;
pub mod train;
pub mod validate;
pub mod walk;
