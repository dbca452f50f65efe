//! The compiled half of the Python package `sabine`: numpy arrays in, numpy arrays and plain values out.
//!
//! The other half, `python/sabine`, gives names, units, plots and documentation to what is computed here; its users import
//! `sabine`, never `sabine._sabine`. Each file here binds one piece of work: it takes arrays apart, calls the crate
//! [`sabine`], and puts dictionaries of arrays together.
//!
//! # Rules of the border
//! - Whatever computes lets go of Python's lock. What may take long hears Ctrl-C (`interrupt.rs`).
//! - Errors of the library become `ValueError`, or `OSError` where a file is at fault, with the library's words (`failure.rs`).
//! - Samples arrive as one contiguous channel of `float32`. The library checks that they are finite and not empty.
//! - The same seed gives the same result.
//!
//! # Does not
//! - link Python: the module finds it where it is loaded. So the workspace builds on a machine that has none.
//!
//! `test_wheel.sh` builds the wheel, installs it into a new virtual environment and runs the tests.

use pyo3::prelude::*;

mod bands;
mod diagnose;
mod directivity;
mod estimate;
mod failure;
mod fit;
mod interrupt;
mod laws;
mod listener;
mod measure;
mod model;
mod place;
mod plan;
mod readings;
mod room;
mod samples;
mod single_numbers;
mod speech_transmission;
mod sweep;
mod trace;

/// What the Python files call.
#[pymodule]
mod _sabine {
    #[pymodule_export]
    use crate::diagnose::{diagnose, effects};
    #[pymodule_export]
    use crate::directivity::Directivity;
    #[pymodule_export]
    use crate::estimate::estimate;
    #[pymodule_export]
    use crate::fit::{fit_responses, fit_t60};
    #[pymodule_export]
    use crate::laws::Laws;
    #[pymodule_export]
    use crate::listener::{FreeFieldReference, interaural_correlation, lateral_energy, sound_strength};
    #[pymodule_export]
    use crate::measure::measure;
    #[pymodule_export]
    use crate::model::ExtendedModel;
    #[pymodule_export]
    use crate::plan::plan;
    #[pymodule_export]
    use crate::room::{Room, library, library_material};
    #[pymodule_export]
    use crate::single_numbers::spatial_mean;
    #[pymodule_export]
    use crate::speech_transmission::{speech_transmission, speech_transmission_of};
    #[pymodule_export]
    use crate::sweep::Sweep;
    #[pymodule_export]
    use crate::trace::trace;
}
