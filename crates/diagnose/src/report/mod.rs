//! What a diagnosis returns.

pub(crate) mod compared_values;
pub(crate) mod composition;
pub(crate) mod diagnosis;
mod document;
pub(crate) mod found_laws;
pub(crate) mod found_parameters;
mod moved_reflections;
pub(crate) mod notes;
mod recording_order;
pub(crate) mod residual_map;
