//! Paths once, responses as often as the walls change.

use sabine_acoustics::{Air, Bands, ImpulseResponse, Material, Orientation};
use sabine_paths::{Conditions, PathSet, Propagator};
use sabine_propagate::{AmbisonicRenderer, PathTracer, RenderConfig, TracerConfig};
use sabine_scene::{Receiver, Scene, Source};
use std::fmt::Display;

/// Octaves in which materials are stated here, 125 Hz to 8 kHz.
pub(crate) const BANDS: Bands = Bands::T60;

/// The room as it is at first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shoebox {
    /// Length, width and height in metres.
    pub size_m: [f64; 3],
    /// Names that `sabine materials` lists: x = 0, x = length, y = 0, y = width, floor, ceiling.
    pub materials: [&'static str; 6],
    /// Where the voice is, in metres.
    pub source_m: [f64; 3],
    /// Where one listens, looking at the voice, in metres.
    pub listener_m: [f64; 3],
    /// Rays that look for paths.
    pub rays: usize,
    /// Length of the responses in seconds.
    pub duration_s: f64,
    /// Sample rate of the engine in Hz.
    pub sample_rate_hz: u32,
}

/// Why there is no room.
#[derive(Debug, thiserror::Error)]
pub enum RoomError {
    /// An unknown material, a place outside of the numbers.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
    /// A box that is none, a place outside of it.
    #[error(transparent)]
    Scene(#[from] sabine_scene::Error),
    /// What the tracer or the renderer refuses.
    #[error(transparent)]
    Propagation(#[from] sabine_propagate::Error),
    /// What the reverb refuses.
    #[error(transparent)]
    Reverb(#[from] sabine_eqfilter::Error),
    /// What firewheel refuses.
    #[error("{0}")]
    Engine(String),
}

impl RoomError {
    pub(crate) fn engine(error: impl Display) -> Self {
        Self::Engine(error.to_string())
    }
}

/// The paths of sound in a box.
pub struct Acoustics {
    shoebox: Shoebox,
    paths: PathSet,
    /// As the paths were traced: scattering stays so.
    traced: [Material; 6],
    air: Air,
    facing: Orientation,
    renderer: AmbisonicRenderer,
}

impl Acoustics {
    pub(crate) fn new(shoebox: Shoebox) -> Result<Self, RoomError> {
        let Shoebox { size_m, materials, source_m, listener_m, rays, duration_s, sample_rate_hz } = shoebox;
        let traced = crate::materials(materials)?;
        let scene = Scene::shoebox(size_m, traced.clone())?;
        let (source, listener) = (Source::omni("voice", source_m)?, Receiver::omni("listener", listener_m)?);
        let facing = Orientation::towards([0, 1, 2].map(|axis| source_m[axis] - listener_m[axis]))?;
        let air = Air::default();
        let config = TracerConfig { rays, duration_s, ..TracerConfig::default() };
        let paths = PathTracer::new(config)?.trace(&scene, &source, &listener, &air, &())?;
        let config = RenderConfig { sample_rate_hz, duration_s: Some(duration_s), ..RenderConfig::default() };
        let renderer = AmbisonicRenderer::new(1, config)?;
        Ok(Self { shoebox, paths, traced, air, facing, renderer })
    }

    /// The room as it was at first.
    pub fn shoebox(&self) -> &Shoebox {
        &self.shoebox
    }

    /// Sample rate of the responses in Hz.
    pub fn sample_rate_hz(&self) -> u32 {
        self.shoebox.sample_rate_hz
    }

    /// Length of the responses in seconds, rounded up by a sample.
    pub fn duration_s(&self) -> f64 {
        self.shoebox.duration_s + 1.0 / f64::from(self.shoebox.sample_rate_hz)
    }

    /// What two cardioids hear, to the left and to the right, with walls of these materials. Their absorption counts; which way a
    /// path was scattered was drawn when it was traced.
    ///
    /// # Errors
    /// [`RoomError`] for materials in other octaves.
    pub fn responses(&self, materials: &[Material; 6]) -> Result<[ImpulseResponse; 2], RoomError> {
        let mut walls = Vec::with_capacity(6);
        for (traced, material) in self.traced.iter().zip(materials) {
            walls.push(traced.with_absorption(material.absorption().clone())?);
        }
        let response = self.renderer.render(&self.paths, &Conditions::new(&walls, &self.air), self.facing)?;
        let (w, y) = (response.channel(0), response.channel(1));
        let cardioid = |side: f32| {
            let samples = w.iter().zip(y).map(|(w, y)| 0.5 * (w + side * y)).collect();
            ImpulseResponse::new(samples, response.sample_rate_hz())
        };
        Ok([cardioid(1.0)?, cardioid(-1.0)?])
    }
}
