//! Under construction.

mod brute_force_scene;
mod error;
mod event_mixture;
mod image_sources;
mod mesh_report;
mod mesh_scene;
mod path_tracer;
mod placement;
mod random;
mod surfaces;
mod vector;
mod walk;

pub use brute_force_scene::BruteForceScene;
pub use error::Error;
pub use mesh_report::MeshReport;
pub use mesh_scene::MeshScene;
pub use path_tracer::{PathTracer, TracerConfig};
