//! Diagnoses of whole rooms, through the public interface. Minutes: `cargo test -p sabine-diagnose --test it MODULE` runs one topic.

mod any_tracer;
mod channel_gains;
mod coordinate_shift;
mod extended_laws;
mod extended_model;
mod hidden_distortion;
mod hidden_edges;
mod hidden_effects;
mod hidden_law;
mod hidden_laws_in_rooms;
mod hidden_local_reaction;
mod hidden_surfaces;
mod hidden_waves;
mod invariances;
mod law_parameters;
mod look_alikes;
mod no_box;
mod odd_input;
mod places;
mod plan;
mod rendering;
mod rivals;
mod round_trip;
mod shipped_laws;
mod starting_from;
mod wrong_tables;
