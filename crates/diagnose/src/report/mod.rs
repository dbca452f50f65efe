//! What a diagnosis returns.

pub(crate) mod composition;
pub(crate) mod diagnosis;
pub(crate) mod found_parameters;
pub(crate) mod next_measurement;
pub(crate) mod notes;
pub(crate) mod residual_map;
