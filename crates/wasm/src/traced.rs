//! The response between two places of a room.

use crate::error::Error;
use crate::measured::STEP_S;
use crate::readings::Row;
use crate::room::RoomSpec;
use sabine_acoustics::{Air, ImpulseResponse, Observer, OutOfRange};
use sabine_paths::Conditions;
use sabine_propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine_scene::{Receiver, Source};
use serde::{Deserialize, Serialize};

/// Longest time that is traced, in seconds: half of what the command traces, for the memory of a page.
const LONGEST_S: f64 = 10.0;
/// Most rays that a page may ask for: ten times the usual number, some seconds on one core.
const MAX_RAYS: f64 = 2e5;

/// A request for a response.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct TraceSpec {
    /// The room.
    pub room: RoomSpec,
    /// Place of the source in metres.
    pub source_m: [f64; 3],
    /// Place of the receiver in metres.
    pub receiver_m: [f64; 3],
    /// Rays, 100 to 200,000.
    pub rays: usize,
    /// Seed of rays and noise.
    #[serde(default)]
    pub seed: u64,
}

/// A response and what is read from its paths.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Traced {
    /// Nominal centres of the octaves.
    pub bands_hz: Vec<f64>,
    /// The quantities; their intervals are those of the rays.
    pub rows: Vec<Row>,
    /// For each octave the level of the energy still to come, in dB, from the emission on.
    pub decay_db: Vec<Vec<f64>>,
    /// Step of the curves in seconds.
    pub decay_step_s: f64,
    /// Number of paths.
    pub paths: usize,
    /// The response, at 48 kHz.
    #[serde(skip)]
    pub response: ImpulseResponse,
}

impl Traced {
    /// Traces paths, reads their parameters and renders the response.
    ///
    /// # Errors
    /// [`Error::OutOfRange`]; what [`RoomSpec::model`] says of the room and [`PathTracer`] of places and mesh;
    /// [`sabine_acoustics::Error::Cancelled`] if the observer asks to stop.
    pub fn new(spec: &TraceSpec, observer: &dyn Observer) -> Result<Self, Error> {
        OutOfRange::check("rays", spec.rays as f64, 100.0, MAX_RAYS, "between 100 and 200,000")?;
        let (scene, air) = (spec.room.model()?.scene, Air::default());
        let source = Source::omni("source", spec.source_m)?;
        let receiver = Receiver::omni("receiver", spec.receiver_m)?;
        let materials: Vec<_> = scene.materials().iter().map(|named| named.material.clone()).collect();
        let conditions = Conditions::new(&materials, &air);
        let config = TracerConfig {
            rays: spec.rays,
            seed: spec.seed,
            duration_s: LONGEST_S,
            ..TracerConfig::default()
        };
        let tracer = PathTracer::new(config)?;
        let (paths, parameters) =
            tracer.trace_until_t30(&scene, &source, &receiver, &conditions, observer)?;
        let energy = paths.energy_response(&conditions, STEP_S)?;
        let finite = |levels: Vec<f64>| levels.into_iter().take_while(|level| level.is_finite()).collect();
        let renderer = PressureRenderer::new(RenderConfig { seed: spec.seed, ..RenderConfig::default() })?;
        Ok(Self {
            bands_hz: parameters.bands().iter_hz().collect(),
            rows: vec![
                Row::new("T30", "s", &parameters.t30_s),
                Row::new("T20", "s", &parameters.t20_s),
                Row::new("EDT", "s", &parameters.edt_s),
                Row::new("C50", "dB", &parameters.c50_db),
                Row::new("C80", "dB", &parameters.c80_db),
                Row::new("D50", "", &parameters.d50),
                Row::new("Ts", "s", &parameters.centre_time_s),
                Row::new("DRR", "dB", &parameters.drr_db),
            ],
            decay_db: (0..energy.bands().len())
                .map(|band| finite(energy.decay_curve(band).level_db()))
                .collect(),
            decay_step_s: STEP_S,
            paths: paths.len(),
            response: renderer.render(&paths, &conditions)?,
        })
    }
}
