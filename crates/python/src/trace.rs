//! The response between two places of a room.

use crate::bands::centres_hz;
use crate::directivity::{Directivity, turned};
use crate::failure::{Failure, refused};
use crate::interrupt::interruptible;
use crate::laws::Laws;
use crate::model::{ExtendedModel, Modelled};
use crate::place::Place;
use crate::readings::Columns;
use crate::room::Room;
use crate::samples::rate_hz;
use crate::single_numbers::{SingleNumbers, of_decay};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use sabine::acoustics::{Directivity as Pattern, Observer, Orientation};
use sabine::paths::laws::{BoundLaws, Law, LawSite};
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

/// A source or a receiver: where it is, what it favours, and where it faces.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct End<'py> {
    place: Place,
    directivity: Option<PyRef<'py, Directivity>>,
    axis: Option<[f64; 3]>,
}

impl End<'_> {
    fn check_as_the_model_has_it(&self, what: &str) -> Result<(), Failure> {
        match (&self.directivity, self.axis) {
            (None, None) => Ok(()),
            (Some(_), _) => Err(refused(format!("{what}_directivity: the model says it; give one of both"))),
            (None, Some(_)) => Err(refused(format!("{what}_axis: the model says it; give one of both"))),
        }
    }
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
    single_numbers: SingleNumbers,
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

/// What changes the room: laws, and an extended model.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Beside<'py> {
    laws: Option<PyRef<'py, Laws>>,
    model: Option<PyRef<'py, ExtendedModel>>,
}

impl Beside<'_> {
    fn laws(&self) -> &[Law] {
        self.laws.as_ref().map_or(&[], |laws| laws.laws())
    }
}

/// Traces the paths between two places, reads their parameters and renders the response, under laws and a model if there are any.
///
/// # Errors
/// Places, axes, laws, model or settings are refused, or the mesh leaks.
#[pyfunction]
pub fn trace<'py>(
    py: Python<'py>,
    room: &Room,
    source: End<'py>,
    receiver: End<'py>,
    beside: Beside<'py>,
    settings: Settings,
) -> Result<Traced<'py>, Failure> {
    let sample_rate_hz = rate_hz(settings.sample_rate)?;
    let config = RenderConfig { sample_rate_hz, seed: settings.seed, ..RenderConfig::default() };
    let renderer = PressureRenderer::new(config)?;
    let modelled =
        beside.model.as_ref().map(|model| Modelled::new(model, room, beside.laws())).transpose()?;
    let room = modelled.as_ref().map_or(room, |modelled| &modelled.room);
    if modelled.is_some() {
        source.check_as_the_model_has_it("source")?;
        receiver.check_as_the_model_has_it("receiver")?;
    }
    let ends = Ends::new(room, &source, &receiver)?;
    let materials = room.materials(room.bands());
    // The model has the laws.
    let own = if modelled.is_some() { &[] } else { beside.laws() };
    let laws = BoundLaws::new(own, &LawSite::new(&room.scene, &ends.source, &ends.receiver, &room.air));
    let laws = laws.map_err(|error| refused(format!("laws: {error}")))?;
    let conditions = match &modelled {
        Some(modelled) => modelled.conditions(&materials, &ends.source, &ends.receiver)?,
        None if laws.is_empty() => Conditions::new(&materials, &room.air),
        None => Conditions::new(&materials, &room.air).with_laws(&laws),
    };
    let conditions = ends.conditions(conditions);
    let (response, parameters, levels_db, paths) = interruptible(py, |observer| {
        let tracer = PathTracer::new(settings.tracer(modelled.as_ref()))?;
        let (paths, parameters) =
            long_enough(&tracer, room, &ends, &conditions, settings.duration_s, observer)?;
        let energy = paths.energy_response(&conditions, DECAY_STEP_S)?;
        let levels_db: Vec<_> =
            (0..energy.bands().len()).map(|band| energy.decay_curve(band).level_db()).collect();
        let mut response = renderer.render(&paths, &conditions)?;
        if let Some(modelled) = &modelled {
            response = modelled.finish(&ends.source, &ends.receiver, response, settings.seed)?;
        }
        Ok((response, parameters, levels_db, paths.len()))
    })?;
    Ok(Traced {
        sample_rate: response.sample_rate_hz(),
        samples: PyArray1::from_vec(py, response.into_samples()),
        parameters: Parameters::of(py, &parameters),
        decay_db: PyArray2::from_vec2(py, &levels_db)?,
        decay_step_s: DECAY_STEP_S,
        paths,
    })
}

impl Settings {
    fn tracer(&self, modelled: Option<&Modelled>) -> TracerConfig {
        TracerConfig {
            rays: self.rays,
            seed: self.seed,
            duration_s: self.duration_s.unwrap_or(LONGEST_S),
            image_order: self.image_order,
            diffraction: self.diffraction || modelled.is_some_and(Modelled::diffraction),
            cuboid_paths: modelled.map_or(0, Modelled::cuboid_paths),
            allow_leaks: self.allow_leaks,
            ..TracerConfig::default()
        }
    }
}

impl<'py> Parameters<'py> {
    fn of(py: Python<'py>, read: &PathParameters) -> Self {
        let columns = |readings| Columns::of(py, readings);
        Self {
            bands_hz: centres_hz(read.bands()),
            edt_s: columns(&read.edt_s),
            t20_s: columns(&read.t20_s),
            t30_s: columns(&read.t30_s),
            c50_db: columns(&read.c50_db),
            c80_db: columns(&read.c80_db),
            d50: columns(&read.d50),
            centre_time_s: columns(&read.centre_time_s),
            drr_db: columns(&read.drr_db),
            single_numbers: of_decay(&read.edt_s, &read.t30_s, &read.c80_db, &read.d50, &read.centre_time_s),
        }
    }
}

/// Both ends of the paths, with the patterns that are not omnidirectional.
struct Ends {
    source: Source,
    receiver: Receiver,
    source_pattern: Option<(Pattern, Orientation)>,
    receiver_pattern: Option<(Pattern, Orientation)>,
}

impl Ends {
    /// An axis that is given counts before the one that the place has in the room; a pattern without either faces the other end.
    fn new(room: &Room, from: &End<'_>, to: &End<'_>) -> Result<Self, Failure> {
        let (mut source, mut receiver) =
            (from.place.source(&room.sources)?, to.place.receiver(&room.receivers)?);
        source.axis = facing("source_axis", from.axis)?.or(source.axis);
        receiver.axis = facing("receiver_axis", to.axis)?.or(receiver.axis);
        let away = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| b[k] - a[k]);
        let pattern = |end: &End<'_>, axis: [f64; 3]| {
            end.directivity.as_ref().map(|pattern| turned(pattern, axis, room.bands())).transpose()
        };
        let source_axis = source.axis.unwrap_or(away(source.position_m, receiver.position_m));
        let receiver_axis = receiver.axis.unwrap_or(away(receiver.position_m, source.position_m));
        let (source_pattern, receiver_pattern) = (pattern(from, source_axis)?, pattern(to, receiver_axis)?);
        Ok(Self { source, receiver, source_pattern, receiver_pattern })
    }

    fn conditions<'a>(&'a self, mut conditions: Conditions<'a>) -> Conditions<'a> {
        if let Some((pattern, orientation)) = &self.source_pattern {
            conditions = conditions.with_source(pattern, *orientation);
        }
        if let Some((pattern, orientation)) = &self.receiver_pattern {
            conditions = conditions.with_receiver(pattern, *orientation);
        }
        conditions
    }
}

/// An axis as a unit vector.
fn facing(what: &str, axis: Option<[f64; 3]>) -> Result<Option<[f64; 3]>, Failure> {
    let forward = axis.map(|axis| Orientation::towards(axis).map(|orientation| orientation.forward()));
    forward.transpose().map_err(|error| refused(format!("{what}: {error}")))
}

/// Traces for as long as asked, or until T30 can be read in every band.
fn long_enough(
    tracer: &PathTracer,
    room: &Room,
    ends: &Ends,
    conditions: &Conditions<'_>,
    duration_s: Option<f64>,
    observer: &dyn Observer,
) -> Result<(PathSet, PathParameters), Failure> {
    let Ends { source, receiver, .. } = ends;
    if duration_s.is_none() {
        return Ok(tracer.trace_until_t30(&room.scene, source, receiver, conditions, observer)?);
    }
    // Refuses volumes that no room has, as a mesh in another unit.
    DiffuseRoom::of_scene(&room.scene, &room.air, room.bands())?;
    let paths = tracer.trace(&room.scene, source, receiver, &room.air, observer)?;
    let parameters = PathParameters::read(&paths, conditions)?;
    Ok((paths, parameters))
}
