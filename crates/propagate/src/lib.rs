//! Under construction.

mod band_masks;
mod brute_force_scene;
mod energy_envelope;
mod error;
mod event_mixture;
mod image_sources;
mod mesh_report;
mod mesh_scene;
mod path_tracer;
mod placement;
mod pressure_renderer;
mod random;
mod spectrum;
mod surfaces;
mod vector;
mod walk;

pub use brute_force_scene::BruteForceScene;
pub use error::Error;
pub use mesh_report::MeshReport;
pub use mesh_scene::MeshScene;
pub use path_tracer::{PathTracer, TracerConfig};
pub use pressure_renderer::{PressureRenderer, RenderConfig, Statistics};
