//! The model with the named causes in it, and its rendering.

pub(crate) mod applied_changes;
pub(crate) mod box_object;
pub(crate) mod displaced_surface;
pub(crate) mod extended_model;
pub(crate) mod extended_room;
pub(crate) mod extension;
pub(crate) mod law_file;
pub(crate) mod laws_of_pairs;
pub(crate) mod model_change;
mod model_checks;
pub(crate) mod moved_mesh;
mod number_slopes;
pub(crate) mod recording_chain;
pub(crate) mod rigid_motion;
pub(crate) mod uncertainty;
