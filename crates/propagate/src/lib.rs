//! From a triangle mesh with materials to the sound at a receiver: paths once, responses as often as you like.
//!
//! Where it sits: [`PathTracer`] turns a [`Scene`](sabine_scene::Scene), a source and a receiver into a
//! [`PathSet`](sabine_paths::PathSet), in which absorption, air and speed of sound are still free. `sabine-optimize`
//! fits materials to such paths; [`PressureRenderer`] turns them into a pressure response to convolve sound with,
//! [`AmbisonicRenderer`] into one with directions, and [`HeadResponses`] that into what two ears hear. [`MovingTracer`] follows
//! sources and listeners that move. Directivity of source and receiver enters with the [`Conditions`](sabine_paths::Conditions) under which
//! paths are weighed or rendered. Plain arrays go in and out.
//!
//! Below about 2000 sqrt(T60 / V) Hz a room is a wave field, not rays (Schroeder 1962): there [`wave::WaveSolver`] solves the wave
//! equation on voxels, and [`wave::Crossover`] joins what it finds to a response from paths.
//!
//! What paths do **not** have: no diffraction but, if asked for, over a single edge into its shadow ([`DiffractingEdges`]), no
//! room modes, no transmission through walls, no phase at reflections or of directivities, no Doppler shift within a response.
//! Meshes are not read here.
//!
//! ```toml
//! [dependencies]
//! sabine-propagate = "0.1"
//! ```
//!
//! # Example
//!
//! Sabine's formula promises 1.40 s for this box, Eyring's 1.33 s. A box with mirror-like walls rings longer, for its long
//! axis feels few reflections:
//!
//! ```
//! use sabine_acoustics::{Air, Bands, Material};
//! use sabine_paths::{Conditions, Propagator};
//! use sabine_scene::{Receiver, Scene, Source};
//! use sabine_propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
//!
//! let bands = Bands::octaves(250.0, 500.0)?;
//! let wall = Material::uniform(bands, 0.1, 0.0)?; // absorbs a tenth, scatters nothing
//! let room = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| wall.clone()))?;
//! let source = Source::omni("S", [2.0, 3.0, 1.5])?;
//! let receiver = Receiver::omni("R", [7.0, 4.0, 1.6])?;
//! let air = Air::default();
//!
//! let tracer = PathTracer::new(TracerConfig { rays: 8_000, duration_s: 2.0, ..Default::default() })?;
//! let paths = tracer.trace(&room, &source, &receiver, &air, &())?;
//! let energy = paths.energy_response(&Conditions::new(&vec![wall; 6], &air), 1e-3)?;
//! let t30_s = energy.decay_curve(1).decay_time_s(-5.0, -35.0)?;
//! assert!((t30_s / 2.0 - 1.0).abs() < 0.1); // image sources: 2.12 s, less what 2 s of air take
//!
//! // Other walls, same paths: nothing is traced again.
//! let softer = vec![Material::uniform(bands, 0.3, 0.0)?; 6];
//! let config = RenderConfig { sample_rate_hz: 16_000, ..Default::default() };
//! let response = PressureRenderer::new(config)?.render(&paths, &Conditions::new(&softer, &air))?;
//! assert_eq!(response.samples().len(), 32_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Units
//!
//! Metres, seconds, hertz. Energies and amplitudes are relative to the direct sound of an omnidirectional source at 1 m: a
//! path of length d weighs 1 / d2, which is 4 pi times the energy that passes through a square metre of receiver per unit
//! of energy emitted. In a closed room without losses that makes 4 pi c / V per second, wherever one listens.
//!
//! # Accuracy
//!
//! | what | how well | shown by |
//! |---|---|---|
//! | image sources up to third order | equal to the formula for boxes | `tests/it/box_room.rs` |
//! | decay curve of a mirror-like box to -40 dB | 0.2 dB with 40,000 rays | `tests/it/box_room.rs` |
//! | T30 at scattering 0.1, 0.3, 0.5, 1 | within four standard errors of 1.493, 1.373, 1.359, 1.360 s | `tests/it/box_room.rs` |
//! | rays from both ends against rays from one | the same mean, half the variance, also through a doorway | `tests/it/agreement.rs` |
//! | octaves of different scattering in one trace | the same mean as a trace for each | `tests/it/agreement.rs` |
//! | T20, T30 measured on the rendered response | 3 % of the paths' own, 125 Hz to 4 kHz | `tests/it/rendering.rs` |
//! | reverberation of a directional source | 1 / directivity factor, within three standard errors | `tests/it/directivity.rs` |
//! | ambisonics: an exact path | its spherical harmonics in all channels | `tests/it/ambisonics.rs` |
//! | ambisonics: a diffuse field | SN3D energies, 1 / (2l + 1), within 1 % in each channel; T30 of W as in mono | `tests/it/ambisonics.rs` |
//! | a listener who walks | direct sound exact; reverberation within four standard errors of a long trace | `tests/it/moving.rs` |
//! | same seed, other number of threads | the same paths and samples, bit for bit | `tests/it/agreement.rs` |
//! | diffraction by one edge, 63 Hz to 8 kHz | 0.05 dB from Macdonald's half plane, 0.02 dB from the uniform theory at a right angle | `tests/it/diffraction.rs` |
//! | edges and corners | no ray lost | `walk.rs` |
//! | flat walls merged before rays meet them | the same points to 1e-10 m (1e-6 m where coordinates are rounded to single precision), materials and planes; no ray lost | `tests/it/merging.rs` |
//! | waves: frequencies of a rigid box up to 200 Hz | within 0.3 % | `tests/it/waves.rs` |
//! | waves: decay of modes | within 1 % of theory | `tests/it/waves.rs` |
//! | waves: narrow-band spectrum of a box, 20 to 300 Hz | 1.0 to 1.7 dB rms from the exact sum of its modes | `tests/it/waves.rs` |
//!
//! Spheres about source and receiver blur arrivals by their radius over the speed of sound (1.5 ms at 0.5 m) and average over
//! as much space, and so do the patches of wall (0.35 m) on which rays from both ends meet; that concerns paths of several
//! reflections only, some of them mirror-like.
//!
//! # Features
//!
//! `sofa`: [`HeadResponses`] are read from AES69 (SOFA) files, by the crate `sofar` (pure Rust).
//!
//! # References
//!
//! Krokstad, Strom and Sorsdal 1968 (ray tracing of rooms); Allen and Berkley 1979, Borish 1984 (image sources);
//! Vorlaender 2008, Auralization (scattering, spherical receivers); Veach 1997 (connections, balance heuristic); Cao et al. 2016
//! (bidirectional tracing of sound); Georgiev et al. 2012, ACM Transactions on Graphics 31(6) (connections and meetings united);
//! Wilkie et al. 2014 (hero sampling); Nachbar et al. 2011 (AmbiX); Svensson, Fred and Vanderkooy 1999 (edge diffraction);
//! Savioja and Svensson 2015, JASA 138(2) (overview of geometric room acoustics); Botteldooren 1995, JASA 98(6), Kowalczyk and
//! van Walstijn 2011, IEEE TASLP 19(1), and Bilbao et al. 2016, IEEE/ACM TASLP 24(1) (waves on voxels).

mod ambisonic_renderer;
mod ambisonic_response;
mod band_masks;
mod box_tree;
mod brute_force_scene;
mod cuboid;
mod direction_cells;
mod early_memory;
mod edge_diffraction;
mod edge_wedges;
mod energy_envelope;
mod error;
mod event_mixture;
mod guide;
mod head_responses;
mod hierarchy;
mod hierarchy_builder;
mod image_sources;
mod instructions;
mod joining;
mod lanes;
mod merged_faces;
mod mesh_edges;
mod mesh_report;
mod mesh_scene;
mod moving_tracer;
mod patches;
mod path_tracer;
mod placement;
mod prepared_scene;
mod pressure_renderer;
mod pulse;
mod random;
mod ray;
mod reference_tracer;
mod render_config;
mod renderer;
mod rendering;
#[cfg(feature = "sofa")]
mod sofa_file;
mod spectrum;
mod spherical_harmonics;
mod surfaces;
mod techniques;
mod tracing;
mod triangle_pack;
mod vector;
mod walk;
pub mod wave;
mod weight_window;
mod wide_node;

pub use ambisonic_renderer::AmbisonicRenderer;
pub use ambisonic_response::AmbisonicResponse;
pub use brute_force_scene::BruteForceScene;
pub use cuboid::ImageSource;
pub use edge_diffraction::DiffractingEdges;
pub use error::Error;
pub use head_responses::HeadResponses;
pub use mesh_edges::MeshEdge;
pub use mesh_report::MeshReport;
pub use mesh_scene::MeshScene;
pub use moving_tracer::{Frame, MovingConfig, MovingTracer};
pub use path_tracer::{PathTracer, TracerConfig};
pub use placement::check_placement;
pub use prepared_scene::PreparedScene;
pub use pressure_renderer::PressureRenderer;
pub use reference_tracer::ReferenceTracer;
pub use render_config::{RenderConfig, Statistics};
pub use renderer::{Ambisonics, Omnidirectional, Renderer};
pub use spherical_harmonics::ambisonic_gains;
