//! What is read from the measured responses.

pub(crate) mod band_pulse;
pub(crate) mod early_energy;
pub(crate) mod observations;
pub(crate) mod observed_response;
pub(crate) mod parameter_table;
pub(crate) mod pre_arrival;
pub(crate) mod stated_parameter;
pub(crate) mod time_bins;
