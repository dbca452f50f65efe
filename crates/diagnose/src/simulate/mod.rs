//! What the simulated room predicts.

pub(crate) mod band_state;
pub(crate) mod edges;
pub(crate) mod hit_groups;
pub(crate) mod met_surfaces;
pub(crate) mod modes;
pub(crate) mod monte_carlo_modes;
pub(crate) mod path_chances;
pub(crate) mod reflection_reweighting;
pub(crate) mod scattering_share;
pub(crate) mod scene_tracer;
pub(crate) mod schroeder;
pub(crate) mod simulation;
pub(crate) mod smoothing;
pub(crate) mod table_chance;
pub(crate) mod table_readings;
pub(crate) mod tables;
pub(crate) mod traced_pair;
pub(crate) mod traced_room;
pub(crate) mod traced_views;
pub(crate) mod views;
