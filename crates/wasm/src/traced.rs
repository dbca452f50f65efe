//! The response between two places of a room.

use crate::error::Error;
use crate::measured::STEP_S;
use crate::readings::Row;
use crate::room::RoomSpec;
use sabine_acoustics::{Air, ImpulseResponse, NoReading, Observer, OutOfRange};
use sabine_paths::{Conditions, PathParameters, Propagator};
use sabine_propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine_scene::{DiffuseRoom, Receiver, Source};
use serde::{Deserialize, Serialize};

/// The first try lasts this many times the longest reverberation time that Eyring's formula expects, within these bounds (s). Rooms that are
/// not diffuse ring longer: where T30 cannot be read, twice as long is tried.
const DURATION_FACTOR: f64 = 1.2;
const DURATION_S: (f64, f64) = (0.3, 10.0);
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
        let expected = DiffuseRoom::of_scene(&scene, &air, materials[0].bands())?;
        let longest_s = expected.values().iter().map(DiffuseRoom::eyring_t60_s).fold(0.0, f64::max);
        let mut duration_s = (DURATION_FACTOR * longest_s).clamp(DURATION_S.0, DURATION_S.1);
        let (paths, parameters) = loop {
            let config =
                TracerConfig { rays: spec.rays, seed: spec.seed, duration_s, ..TracerConfig::default() };
            let paths = PathTracer::new(config)?.trace(&scene, &source, &receiver, &air, observer)?;
            let parameters = PathParameters::read(&paths, &conditions)?;
            let is_cut = |t30: &sabine_acoustics::Reading| matches!(t30, Err(NoReading::DynamicRange { .. }));
            if !parameters.t30_s.values().iter().any(is_cut) || duration_s >= DURATION_S.1 {
                break (paths, parameters);
            }
            duration_s = (2.0 * duration_s).min(DURATION_S.1);
        };
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
