//! Fits the absorption of a room's materials to reverberation times, to measured responses or to tables of measured parameters, and
//! says what that leaves open.
//!
//! Without arguments it fits the built-in demo to its two responses.

mod measured;
mod summary;
mod tables;
mod verdict;

use crate::bar::Bar;
use crate::chart::{Chart, Look, Scale, Series};
use crate::demo::Demo;
use crate::failure::Failure;
use crate::modelled::{ModelArguments, PairModel, PathModel};
use crate::output::OutputFolder;
use crate::page::Page;
use crate::room::{PlaceArguments, RoomArguments};
use clap::{Args, ValueEnum};
use rayon::prelude::*;
use sabine::acoustics::{
    Air, Bands, EnergyResponse, Error as AcousticsError, Estimate, Material, NoReading, PerBand, Reading,
    RoomParameters, SampleFormat, Signal, encode_wav,
};
use sabine::optimize::{
    AbsorptionPrior, DecayMisfit, FitConfig, FitProblem, MaterialFit, MaterialFitter, Retrace, RetraceConfig,
    SlopeObjective,
};
use sabine::paths::{PathSet, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::{MeasuredRoom, Receiver, Scene, Source};
use std::path::PathBuf;
use summary::{Compared, Seconds, Summary};
use tables::TableReport;
use verdict::Aim;

/// Octaves of targets and materials: 125 Hz to 8 kHz.
const OCTAVES: Bands = Bands::T60;
/// T30 is read from so many renderings that differ in the phases of their late sound. One alone scatters: its standard deviation is some
/// 0.55 / sqrt(B T) of it, with B the width of the octave (ISO 3382-2, 7.1), a tenth at 125 Hz and 0.25 s, and materials would follow it.
const RENDERINGS: u64 = 8;
/// Rate of what is rendered, in Hz.
const RATE_HZ: u32 = 48_000;
/// Paths are looked for as long as this many times the longest reverberation time, within these limits in seconds.
const DURATION_FACTOR: f64 = 1.25;
const DURATION_S: (f64, f64) = (0.3, 6.0);
/// Step of the decay curves that are drawn, in seconds.
const DECAY_STEP_S: f64 = 5e-3;

/// Find the absorption with which a simulated room decays like the real one.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    room: RoomArguments,
    /// Reverberation times at 125 Hz to 8 kHz, in seconds, between --source and --receiver
    #[arg(long, value_delimiter = ',', value_name = "S,...", conflicts_with_all = ["responses", "tables"])]
    t60: Option<Vec<f64>>,
    /// Fit to the room's measured responses only [default without --t60: to responses and tables of parameters, as far as there are any]
    #[arg(long)]
    responses: bool,
    /// Fit to the room's tables of measured parameters only
    #[arg(long, conflicts_with = "responses")]
    tables: bool,
    /// Receivers, or SOURCE/RECEIVER, whose responses and parameters are not fitted but predicted
    #[arg(long, value_delimiter = ',', value_name = "ID", conflicts_with = "t60")]
    hold_out: Vec<String>,
    /// What is made to meet --t60
    #[arg(long, value_enum, default_value_t = Slope::Edc)]
    objective: Slope,
    #[command(flatten)]
    place: PlaceArguments,
    #[command(flatten)]
    model: ModelArguments,
    /// Standard deviation of the length of a reflected path by errors of positions and mesh, in metres; for --responses
    #[arg(long, default_value_t = 0.1, value_name = "M")]
    path_error_m: f64,
    /// How strongly neighbouring octaves of a material are held together, 0 to 10000
    #[arg(long, default_value_t = 0.0)]
    smoothness: f64,
    /// Rays of the first trace
    #[arg(long, default_value_t = 20_000)]
    rays: usize,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/fit")]
    out: PathBuf,
    /// File for the numbers [default: fit.json in the folder]
    #[arg(long, value_name = "F")]
    json: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Slope {
    /// The decay curve's, as ISO 3382 reads it
    Edc,
    /// Tang et al. 2020
    Paper,
    /// Li et al. 2018
    Li2018,
}

/// Everything that the two ways of fitting have in common.
struct Outcome<'a> {
    aim: Aim,
    fit: MaterialFit,
    target_s: Vec<Option<f64>>,
    reached_s: Vec<Option<f64>>,
    /// What the response is rendered from.
    independent: PathSet,
    /// Where it comes from, and where it is heard.
    place: (&'a Source, &'a Receiver),
    compared: Vec<Compared>,
    /// Tables of parameters against the simulation, where there are any.
    tables: Option<TableReport>,
    /// Besides those of the fit.
    warnings: Vec<String>,
    seconds: Seconds,
    /// For each octave, what a chart shows: name, look, and points.
    curves: Vec<Vec<Curve>>,
}

/// A line of a plot: its name, how it is drawn, its points.
type Curve = (&'static str, Look, Vec<(f64, f64)>);

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut out = OutputFolder::create(&arguments.out)?;
    // The responses of the demo are read while it is there.
    let mut demo = Demo::default();
    let (file, _) = arguments.room.read(&mut demo)?;
    let (file, model) = arguments.model.apply(file)?;
    let room = Room::new(&file, &model, arguments)?;
    // Settings are checked before anything is traced.
    let config = RenderConfig { sample_rate_hz: RATE_HZ, seed: arguments.seed, ..RenderConfig::default() };
    let renderer = PressureRenderer::new(config)?;
    let bar = Bar::new();
    let outcome = match &arguments.t60 {
        Some(t60_s) => room.fit_t60(t60_s, &bar)?,
        None => room.fit_measured(&bar)?,
    };
    bar.finish();

    let names: Vec<&str> = file.scene().materials().iter().map(|m| m.name.as_str()).collect();
    let summary = Summary::new(&names, &outcome);
    let between = room.model_between(outcome.place)?;
    let response =
        renderer.render(&outcome.independent, &between.conditions(&outcome.fit.materials, &room.air))?;
    let json = serde_json::to_string_pretty(&summary)?;
    out.write("impulse_response.wav", &encode_wav(&Signal::from(response), SampleFormat::Float32)?)?;
    out.write("fit.json", json.as_bytes())?;
    out.write("materials.toml", outcome.fit.tables(&names)?.to_toml()?.as_bytes())?;
    if !outcome.compared.is_empty() {
        out.write("responses.json", serde_json::to_string_pretty(&outcome.compared)?.as_bytes())?;
    }
    if let Some(tables) = &outcome.tables {
        out.write("parameters.json", serde_json::to_string_pretty(tables)?.as_bytes())?;
    }
    let mut page = Page::new("Materials fitted");
    page.paragraph(&summary.verdict);
    page.warnings(&summary.notes).heading("Decay before and after");
    page.markup("<div class=\"small\">");
    for (b, curves) in outcome.curves.iter().enumerate() {
        let chart = decay_chart(curves);
        out.write(&format!("decay_{:.0}_hz.svg", OCTAVES.nominal_hz(b)), chart.plain_svg()?.as_bytes())?;
        page.markup(&format!(
            "<figure>{}<figcaption>{} Hz</figcaption></figure>",
            chart.svg()?,
            OCTAVES.nominal_hz(b)
        ));
    }
    page.markup("</div>").heading("Absorption");
    page.table(&summary.table());
    if let Some(tables) = &outcome.tables {
        tables.add_to(&mut page);
    }
    out.write("report.html", page.html().as_bytes())?;
    out.finish()?;
    if let Some(path) = &arguments.json {
        sabine::acoustics::write_atomically(path, |file| std::io::Write::write_all(file, json.as_bytes()))?;
    }
    summary.print(&outcome, &arguments.out);
    Ok(())
}

/// The room with everything on the octaves of the fit.
struct Room<'a> {
    file: &'a MeasuredRoom,
    scene: Scene,
    materials: Vec<Material>,
    priors: Vec<AbsorptionPrior>,
    air: Air,
    model: &'a PathModel,
    arguments: &'a Arguments,
}

impl<'a> Room<'a> {
    fn new(file: &'a MeasuredRoom, model: &'a PathModel, arguments: &'a Arguments) -> Result<Self, Failure> {
        let materials: Vec<Material> =
            file.scene().materials().iter().map(|m| m.material.resampled(OCTAVES)).collect();
        let priors = AbsorptionPrior::of_room(file, OCTAVES);
        let scene = file.scene().with_materials(materials.clone())?;
        Ok(Self { file, scene, materials, priors, air: file.air(), model, arguments })
    }

    /// What the model says of paths between a source and a receiver.
    fn model_between(&self, place: (&Source, &Receiver)) -> Result<PairModel, AcousticsError> {
        self.model.between(&self.scene, place, &self.air)
    }

    fn fitter(&self) -> Result<MaterialFitter, Failure> {
        let objective = match self.arguments.objective {
            Slope::Edc => SlopeObjective::DecayCurve,
            Slope::Paper => SlopeObjective::Paper,
            Slope::Li2018 => SlopeObjective::Li2018,
        };
        let arrival_error_s = self.arguments.path_error_m / self.air.speed_of_sound_m_s();
        let smoothness = self.arguments.smoothness;
        let config = FitConfig { objective, arrival_error_s, smoothness, ..FitConfig::default() };
        Ok(MaterialFitter::new(config)?)
    }

    fn trace(
        &self,
        (source, receiver): (&Source, &Receiver),
        duration_s: f64,
        seed: u64,
        effort: f64,
    ) -> Result<PathSet, AcousticsError> {
        let rays = (effort * self.arguments.rays as f64).ceil() as usize;
        let config = TracerConfig { rays, duration_s, seed, ..TracerConfig::default() };
        let config = self.model.tracer(config);
        let tracer = PathTracer::new(config).map_err(|e| AcousticsError::implementation("tracing", e))?;
        tracer.trace(&self.scene, source, receiver, &self.air, &())
    }

    /// Energy over time of paths with given materials.
    fn decay(
        &self,
        paths: &PathSet,
        materials: &[Material],
        model: &PairModel,
    ) -> Result<EnergyResponse, AcousticsError> {
        paths.energy_response(&model.conditions(materials, &self.air), DECAY_STEP_S)
    }

    fn fit_t60(&self, t60_s: &[f64], bar: &Bar) -> Result<Outcome<'a>, Failure> {
        let targets = PerBand::new(OCTAVES, t60_s.iter().map(|&t| Estimate::exact(t)).collect())?;
        let longest_s = t60_s.iter().copied().fold(0.0, f64::max);
        let duration_s = (DURATION_FACTOR * longest_s).clamp(DURATION_S.0, DURATION_S.1);
        let fitter = self.fitter()?;
        fitter.check_t60(&targets, OCTAVES, &self.air, duration_s)?;
        let place = self.arguments.place.of(self.file)?;
        let model = self.model_between(place)?;
        let under =
            if model.is_plain() { Vec::new() } else { vec![model.conditions(&self.materials, &self.air)] };
        let retraced = Retraced { room: self, places: place, model: &model, duration_s };
        let config = RetraceConfig { seed: self.arguments.seed, ..RetraceConfig::default() };
        let done = fitter.fit_t60_retracing(
            &retraced,
            &FitProblem::new(&self.materials, &self.priors, &self.air).under(&under),
            &targets,
            &config,
            bar,
        )?;
        let independent = done.independent_paths.into_iter().next().ok_or("no paths")?;
        let before = self.decay(&independent, &self.materials, &model)?;
        let after = self.decay(&independent, &done.fit.materials, &model)?;
        let curves = (0..OCTAVES.len()).map(|b| wanted_curves(&before, &after, b, Some(t60_s[b])));
        let warnings = done.not_verified.iter().map(ToString::to_string).collect();
        let (trace, fit) = done.seconds;
        Ok(Outcome {
            aim: Aim { quantity: "T60", of: "what is wanted" },
            target_s: t60_s.iter().map(|&t| Some(t)).collect(),
            reached_s: values(&done.read_t60_s),
            curves: curves.collect(),
            independent,
            place,
            compared: Vec::new(),
            tables: None,
            warnings,
            seconds: Seconds { trace, fit },
            fit: done.fit,
        })
    }
}

/// A room that is traced again and heard.
struct Retraced<'a> {
    room: &'a Room<'a>,
    places: (&'a Source, &'a Receiver),
    model: &'a PairModel,
    duration_s: f64,
}

impl Retrace for Retraced<'_> {
    fn trace(&self, seed: u64, effort: f64) -> Result<Vec<PathSet>, AcousticsError> {
        Ok(vec![self.room.trace(self.places, self.duration_s, seed, effort)?])
    }

    fn read_t60_s(
        &self,
        paths: &[PathSet],
        materials: &[Material],
    ) -> Result<Option<PerBand<Reading>>, AcousticsError> {
        let failed = |e| AcousticsError::implementation("rendering", e);
        let between = self.model.conditions(materials, &self.room.air);
        let read = |rendering: u64| -> Result<PerBand<Reading>, AcousticsError> {
            let seed = self.room.arguments.seed.wrapping_add(rendering);
            let config = RenderConfig { sample_rate_hz: RATE_HZ, seed, ..RenderConfig::default() };
            let response = PressureRenderer::new(config)
                .and_then(|own| own.render(&paths[0], &between))
                .map_err(failed)?;
            Ok(RoomParameters::measure(&response, OCTAVES)?.t30_s)
        };
        let all = (0..RENDERINGS).into_par_iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Some(PerBand::from_fn(OCTAVES, |band| mean_reading(all.iter().map(|one| &one.values()[band])))))
    }
}

/// Decay curves of an octave before and after a fit, and the straight decay that was wanted.
fn wanted_curves(
    before: &EnergyResponse,
    after: &EnergyResponse,
    b: usize,
    t60_s: Option<f64>,
) -> Vec<Curve> {
    let points = |energy: &EnergyResponse| {
        let level = energy.decay_curve(b).level_db().into_iter().enumerate();
        level.map(|(i, l)| (i as f64 * DECAY_STEP_S, l)).filter(|p| p.1 > -65.0).collect::<Vec<_>>()
    };
    let wanted = t60_s.map_or_else(Vec::new, |t60_s| vec![(0.0, 0.0), (t60_s, -60.0)]);
    vec![
        ("before", Look::Line, points(before)),
        ("after", Look::Line, points(after)),
        ("wanted", Look::Dashed, wanted),
    ]
}

/// Mean of readings of the same quantity, with the standard error of their scatter; the reason of the first that could not be read.
fn mean_reading<'r>(readings: impl Iterator<Item = &'r Reading>) -> Reading {
    let values = readings.map(|r| r.as_ref().map(|t| t.value).map_err(NoReading::clone));
    let values = values.collect::<Result<Vec<f64>, _>>()?;
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Ok(Estimate::new(mean, (variance / count).sqrt()))
}

fn values(readings: &PerBand<Reading>) -> Vec<Option<f64>> {
    readings.values().iter().map(|r| r.as_ref().ok().map(|t| t.value)).collect()
}

fn response_curves(before: &DecayMisfit, after: &DecayMisfit, b: usize) -> Vec<Curve> {
    let of = |m: &DecayMisfit, pick: fn(&(f64, f64, f64)) -> f64| -> Vec<(f64, f64)> {
        m.curves.values()[b].iter().map(|p| (p.0, pick(p))).collect()
    };
    vec![
        ("before", Look::Line, of(before, |p| p.2)),
        ("after", Look::Line, of(after, |p| p.2)),
        ("measured", Look::Dashed, of(before, |p| p.1)),
    ]
}

fn decay_chart(curves: &[Curve]) -> Chart {
    let longest_s = curves.iter().flat_map(|c| &c.2).map(|p| p.0).fold(0.1, f64::max);
    let colours = [4, 0, 1];
    let series = curves.iter().zip(colours);
    Chart {
        x_label: "Time (s)".to_owned(),
        y_label: "Level (dB)".to_owned(),
        x: Scale::Linear(0.0, longest_s),
        y: Some((-65.0, 0.0)),
        series: series
            .map(|((name, look, points), colour)| Series::new(*name, *look, colour, points.clone()))
            .collect(),
        small: true,
    }
}
