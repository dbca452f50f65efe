//! Filters and convolution.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod convolution;
mod cross_fade;
mod design;
mod filter_bank;
mod room_reverb;
