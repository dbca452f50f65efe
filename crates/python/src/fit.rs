//! Absorption fitted to reverberation times or to measured responses.

use crate::bands::{bands, centres_hz};
use crate::failure::{Failure, refused};
use crate::interrupt::interruptible;
use crate::place::Place;
use crate::readings::Columns;
use crate::room::Room;
use crate::samples::{Samples, response};
use pyo3::prelude::*;
use sabine::acoustics::{
    Bands, Error as AcousticsError, Estimate, ImpulseResponse, Material, Observer, PerBand, Reading,
};
use sabine::optimize::{
    AbsorptionPrior, FitConfig, FitProblem, MaterialFit, MaterialFitter, MeasuredDecay, MeasuredPair,
    RetraceConfig,
};
use sabine::paths::{PathSet, Propagator};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::{Levels, MeasuredRoom, Measurement, Receiver, ResponseEntry, Scene, Source, TimeZero};

/// Paths are looked for as long as this many times the longest reverberation time, within these limits in seconds.
const DURATION_FACTOR: f64 = 1.25;
const DURATION_S: (f64, f64) = (0.3, 6.0);

/// What a fit found; in Python a dictionary.
#[derive(IntoPyObject)]
pub struct Fitted<'py> {
    room: Room,
    bands_hz: Vec<f64>,
    /// Of decay curves with the fitted absorption: for a fit to T60 those of rays that the fit has not seen.
    t60_s: Columns<'py>,
    unconverged_hz: Vec<f64>,
    unreachable: Vec<(f64, String)>,
    not_determined: Vec<String>,
    notes: Vec<String>,
}

impl<'py> Fitted<'py> {
    fn new(
        py: Python<'py>,
        room: &Room,
        fit: &MaterialFit,
        t60_s: &PerBand<Reading>,
        more_notes: Vec<String>,
    ) -> Result<Self, Failure> {
        let names = room.material_names();
        let mut notes: Vec<String> = fit.at_bounds.iter().map(|bound| bound.describe(&names)).collect();
        notes.extend(fit.warnings.iter().map(|warning| warning.describe(&names)));
        notes.extend(more_notes);
        Ok(Self {
            room: room.with_fit(fit)?,
            bands_hz: centres_hz(t60_s.bands()),
            t60_s: Columns::of(py, t60_s),
            unconverged_hz: fit.unconverged_hz(),
            unreachable: fit.unreachable.iter().map(|u| (u.band_hz, u.reason.to_string())).collect(),
            not_determined: fit.not_determined.iter().map(|open| open.describe(&names)).collect(),
            notes,
        })
    }
}

/// How to trace.
#[derive(Clone, Copy, FromPyObject)]
#[pyo3(from_item_all)]
pub struct Settings {
    rays: usize,
    seed: u64,
    allow_leaks: bool,
}

/// A room on the bands of a fit.
struct Prepared<'a> {
    room: &'a Room,
    scene: Scene,
    materials: Vec<Material>,
    priors: Vec<AbsorptionPrior>,
    settings: Settings,
    duration_s: f64,
    observer: &'a dyn Observer,
}

impl<'a> Prepared<'a> {
    fn new(
        room: &'a Room,
        bands: Bands,
        settings: Settings,
        longest_t60_s: f64,
        observer: &'a dyn Observer,
    ) -> Result<Self, Failure> {
        let materials = room.materials(bands);
        let scene = room.scene.with_materials(materials.clone())?;
        let duration_s = (DURATION_FACTOR * longest_t60_s).clamp(DURATION_S.0, DURATION_S.1);
        let priors = room.priors(bands);
        Ok(Self { room, scene, materials, priors, settings, duration_s, observer })
    }

    fn problem(&self) -> FitProblem<'_> {
        FitProblem::new(&self.materials, &self.priors, &self.room.air)
    }

    fn trace(
        &self,
        source: &Source,
        receiver: &Receiver,
        seed: u64,
        effort: f64,
    ) -> Result<PathSet, AcousticsError> {
        let tracer = PathTracer::new(TracerConfig {
            rays: (effort * self.settings.rays as f64).ceil() as usize,
            duration_s: self.duration_s,
            seed,
            allow_leaks: self.settings.allow_leaks,
            ..TracerConfig::default()
        });
        let tracer = tracer.map_err(|error| AcousticsError::implementation("tracing", error))?;
        tracer.trace(&self.scene, source, receiver, &self.room.air, self.observer)
    }
}

/// Fits to reverberation times between two places; of each band its nominal centre in Hz, the time and its standard error in seconds.
///
/// # Errors
/// Places, targets or settings are refused, or the mesh leaks.
#[pyfunction]
pub fn fit_t60<'py>(
    py: Python<'py>,
    room: &Room,
    targets: Vec<(f64, f64, f64)>,
    places: (Place, Place),
    settings: Settings,
) -> Result<Fitted<'py>, Failure> {
    let (source, receiver) = (places.0.source(&room.sources)?, places.1.receiver(&room.receivers)?);
    let bands = bands(&targets.iter().map(|target| target.0).collect::<Vec<_>>())?;
    let longest_s = targets.iter().map(|target| target.1).fold(0.0, f64::max);
    let targets = targets.iter().map(|&(_, t60_s, error_s)| Estimate::new(t60_s, error_s));
    let targets = PerBand::new(bands, targets.collect())?;
    let fitter = MaterialFitter::new(FitConfig::default())?;
    let found = interruptible(py, |observer| {
        let prepared = Prepared::new(room, bands, settings, longest_s, observer)?;
        fitter.check_t60(&targets, bands, &room.air, prepared.duration_s)?;
        // T60 of the paths themselves: that of one response would bring the chance of its interference into the absorption.
        let trace = |seed, effort| Ok(vec![prepared.trace(&source, &receiver, seed, effort)?]);
        let config = RetraceConfig { seed: settings.seed, ..RetraceConfig::default() };
        Ok(fitter.fit_t60_retracing(&trace, &prepared.problem(), &targets, &config, observer)?)
    })?;
    let notes = found.not_verified.iter().map(ToString::to_string).collect();
    Fitted::new(py, room, &found.fit, &found.verified_t60_s, notes)
}

/// A measured response: source, receiver, samples, sample rate in Hz.
type Recorded<'py> = (Place, Place, Samples<'py>, f64);

/// A measured response and the places between which it was measured.
type Placed = (Source, Receiver, ImpulseResponse);

/// Fits to measured responses: those given, with the words of a room file for their time zero and levels, or those of the room's folder.
///
/// # Errors
/// Places, responses or settings are refused, there are none, or the mesh leaks.
#[pyfunction]
pub fn fit_responses<'py>(
    py: Python<'py>,
    room: &Room,
    bands_hz: Vec<f64>,
    responses: Option<Vec<Recorded<'py>>>,
    meaning: (String, String),
    settings: Settings,
) -> Result<Fitted<'py>, Failure> {
    let bands = bands(&bands_hz)?;
    let (responses, measurement) = match (&responses, &room.measured) {
        (Some(recorded), _) => (placed(room, recorded)?, measurement(&meaning)?),
        (None, Some(measured)) => (py.detach(|| of_folder(measured))?, measured.measurement()),
        (None, None) => (Vec::new(), measurement(&meaning)?),
    };
    if responses.is_empty() {
        return Err(refused("responses: there are none, neither given nor in the room; or give t60_s"));
    }
    let fitter = MaterialFitter::new(FitConfig::default())?;
    let found = interruptible(py, |observer| {
        let decay = |(index, (_, _, response)): (usize, &Placed)| {
            MeasuredDecay::new(response, bands)
                .map_err(|error| refused(format!("responses[{index}]: {error}")))
        };
        let decays: Vec<MeasuredDecay> = responses.iter().enumerate().map(decay).collect::<Result<_, _>>()?;
        let times = decays.iter().flat_map(|decay| decay.t30_s().values()).flatten();
        let longest_s = times.map(|t30| t30.value).fold(0.0, f64::max);
        let prepared = Prepared::new(room, bands, settings, longest_s, observer)?;
        let paths: Vec<PathSet> = responses
            .iter()
            .map(|(source, receiver, _)| Ok(prepared.trace(source, receiver, settings.seed, 1.0)?))
            .collect::<Result<_, Failure>>()?;
        let pairs: Vec<MeasuredPair<'_>> =
            decays.iter().zip(&paths).map(|(measured, paths)| MeasuredPair { measured, paths }).collect();
        Ok(fitter.fit_responses(&pairs, measurement, &prepared.problem(), observer)?)
    })?;
    let left_out = found.left_out.iter();
    let notes = left_out.map(|(i, hz, why)| format!("response {i} at {hz} Hz is left out: {why}")).collect();
    Fitted::new(py, room, &found.fit, &found.fit.predicted_t60_s, notes)
}

fn of_folder(room: &MeasuredRoom) -> Result<Vec<Placed>, Failure> {
    let one = |(index, entry): (usize, &ResponseEntry)| -> Result<Placed, Failure> {
        let (source, receiver) = (&room.sources()[entry.source], &room.receivers()[entry.receiver]);
        Ok((source.clone(), receiver.clone(), room.load_response(index)?))
    };
    room.responses().iter().enumerate().map(one).collect()
}

fn placed(room: &Room, recorded: &[Recorded]) -> Result<Vec<Placed>, Failure> {
    let one = |(source, receiver, samples, sample_rate): &Recorded| -> Result<Placed, Failure> {
        let (source, receiver) = (source.source(&room.sources)?, receiver.receiver(&room.receivers)?);
        Ok((source, receiver, response(samples, *sample_rate)?))
    };
    recorded.iter().map(one).collect()
}

fn measurement((time_zero, levels): &(String, String)) -> Result<Measurement, Failure> {
    let unknown =
        |field: &str, word: &str, words: &str| refused(format!("{field}: {word:?} is none of {words}"));
    Ok(Measurement {
        time_zero: TimeZero::from_word(time_zero)
            .ok_or_else(|| unknown("time_zero", time_zero, "emission, common, per_response"))?,
        levels: Levels::from_word(levels)
            .ok_or_else(|| unknown("levels", levels, "absolute, common, per_response"))?,
    })
}
