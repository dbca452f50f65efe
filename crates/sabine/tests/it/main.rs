//! The whole job.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod own_estimator;
mod two_fits;
