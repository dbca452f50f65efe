//! The response between two places of a room.

use crate::bands::centres_hz;
use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::place::Place;
use crate::readings::Columns;
use crate::room::Room;
use crate::samples::rate_hz;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use sabine::acoustics::{Material, Observer};
use sabine::paths::{Conditions, PathParameters, PathSet, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::{DiffuseRoom, Receiver, Source};

/// Longest time that is traced unless another is asked for, in seconds.
const LONGEST_S: f64 = 20.0;
/// Step of the decay curves in seconds.
const DECAY_STEP_S: f64 = 0.005;

/// How to trace, as `sabine.Room.trace` says it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Settings {
    rays: usize,
    seed: u64,
    duration_s: Option<f64>,
    image_order: usize,
    sample_rate: f64,
    diffraction: bool,
    allow_leaks: bool,
}

/// What is read from paths; in Python a dictionary, which `sabine.Parameters` takes.
#[derive(IntoPyObject)]
struct Parameters<'py> {
    bands_hz: Vec<f64>,
    edt_s: Columns<'py>,
    t20_s: Columns<'py>,
    t30_s: Columns<'py>,
    c50_db: Columns<'py>,
    c80_db: Columns<'py>,
    d50: Columns<'py>,
    centre_time_s: Columns<'py>,
    drr_db: Columns<'py>,
}

/// A response; in Python a dictionary.
#[derive(IntoPyObject)]
pub struct Traced<'py> {
    samples: Bound<'py, PyArray1<f32>>,
    sample_rate: u32,
    parameters: Parameters<'py>,
    decay_db: Bound<'py, PyArray2<f64>>,
    decay_step_s: f64,
    paths: usize,
}

/// Traces the paths between two places, reads their parameters and renders the response.
///
/// # Errors
/// Places or settings are refused, or the mesh leaks.
#[pyfunction]
pub fn trace<'py>(
    py: Python<'py>,
    room: &Room,
    source: Place,
    receiver: Place,
    settings: Settings,
) -> Result<Traced<'py>, Failure> {
    let (source, receiver) = (source.source(&room.sources)?, receiver.receiver(&room.receivers)?);
    let sample_rate_hz = rate_hz(settings.sample_rate)?;
    let config = RenderConfig { sample_rate_hz, seed: settings.seed, ..RenderConfig::default() };
    let renderer = PressureRenderer::new(config)?;
    let materials = room.materials(room.bands());
    let (response, parameters, levels_db, paths) = interruptible(py, |observer| {
        let (paths, parameters) = long_enough(room, &materials, &source, &receiver, &settings, observer)?;
        let conditions = Conditions::new(&materials, &room.air);
        let energy = paths.energy_response(&conditions, DECAY_STEP_S)?;
        let levels_db: Vec<_> =
            (0..energy.bands().len()).map(|band| energy.decay_curve(band).level_db()).collect();
        Ok((renderer.render(&paths, &conditions)?, parameters, levels_db, paths.len()))
    })?;
    let columns = |readings| Columns::of(py, readings);
    Ok(Traced {
        sample_rate: response.sample_rate_hz(),
        samples: PyArray1::from_vec(py, response.into_samples()),
        parameters: Parameters {
            bands_hz: centres_hz(parameters.bands()),
            edt_s: columns(&parameters.edt_s),
            t20_s: columns(&parameters.t20_s),
            t30_s: columns(&parameters.t30_s),
            c50_db: columns(&parameters.c50_db),
            c80_db: columns(&parameters.c80_db),
            d50: columns(&parameters.d50),
            centre_time_s: columns(&parameters.centre_time_s),
            drr_db: columns(&parameters.drr_db),
        },
        decay_db: PyArray2::from_vec2(py, &levels_db)?,
        decay_step_s: DECAY_STEP_S,
        paths,
    })
}

/// Traces for as long as asked, or until T30 can be read in every band.
fn long_enough(
    room: &Room,
    materials: &[Material],
    source: &Source,
    receiver: &Receiver,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<(PathSet, PathParameters), Failure> {
    let tracer = PathTracer::new(TracerConfig {
        rays: settings.rays,
        seed: settings.seed,
        duration_s: settings.duration_s.unwrap_or(LONGEST_S),
        image_order: settings.image_order,
        diffraction: settings.diffraction,
        allow_leaks: settings.allow_leaks,
        ..TracerConfig::default()
    })?;
    let conditions = Conditions::new(materials, &room.air);
    if settings.duration_s.is_none() {
        return Ok(tracer.trace_until_t30(&room.scene, source, receiver, &conditions, observer)?);
    }
    // Refuses volumes that no room has, as a mesh in another unit.
    DiffuseRoom::of_scene(&room.scene, &room.air, room.bands())?;
    let paths = tracer.trace(&room.scene, source, receiver, &room.air, observer)?;
    let parameters = PathParameters::read(&paths, &conditions)?;
    Ok((paths, parameters))
}
