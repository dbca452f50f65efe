//! Fits the absorption of a room's materials to reverberation times or to measured responses, and says what that leaves open.
//!
//! Without arguments it fits the built-in demo to its two responses.

mod summary;
mod verdict;

use crate::bar::Bar;
use crate::chart::{Chart, Look, Scale, Series};
use crate::demo::Demo;
use crate::failure::Failure;
use crate::modelled::{ModelArguments, PathModel, conditions};
use crate::output::OutputFolder;
use crate::page::Page;
use crate::room::{PlaceArguments, RoomArguments};
use clap::{Args, ValueEnum};
use rayon::prelude::*;
use sabine::acoustics::{
    Air, Bands, Error as AcousticsError, Estimate, Material, NoReading, PerBand, Reading, RoomParameters,
    SampleFormat, Signal, encode_wav,
};
use sabine::optimize::{
    AbsorptionPrior, DecayMisfit, FitConfig, FitProblem, MaterialFit, MaterialFitter, MeasuredDecay,
    MeasuredPair, Retrace, RetraceConfig, SlopeObjective,
};
use sabine::paths::laws::BoundLaws;
use sabine::paths::{Conditions, PathSet, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::{MeasuredRoom, Receiver, Scene, Source};
use std::path::PathBuf;
use std::time::Instant;
use summary::{Compared, Seconds, Summary, mean_of};
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

/// Find the absorption with which a simulated room decays like the real one.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    room: RoomArguments,
    /// Reverberation times at 125 Hz to 8 kHz, in seconds, between --source and --receiver
    #[arg(long, value_delimiter = ',', value_name = "S,...", conflicts_with = "responses")]
    t60: Option<Vec<f64>>,
    /// Fit to the room's measured responses (the default without --t60)
    #[arg(long)]
    responses: bool,
    /// Receivers, or SOURCE/RECEIVER, whose responses are not fitted but predicted
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
        None => room.fit_responses(&bar)?,
    };
    bar.finish();

    let names: Vec<&str> = file.scene().materials().iter().map(|m| m.name.as_str()).collect();
    let summary = Summary::new(&names, &outcome);
    let rendered = room.laws(outcome.place)?;
    let response =
        renderer.render(&outcome.independent, &conditions(&outcome.fit.materials, &room.air, &rendered))?;
    let json = serde_json::to_string_pretty(&summary)?;
    out.write("impulse_response.wav", &encode_wav(&Signal::from(response), SampleFormat::Float32)?)?;
    out.write("fit.json", json.as_bytes())?;
    out.write("materials.toml", outcome.fit.tables(&names)?.to_toml()?.as_bytes())?;
    if !outcome.compared.is_empty() {
        out.write("responses.json", serde_json::to_string_pretty(&outcome.compared)?.as_bytes())?;
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

    /// The model's laws between a source and a receiver.
    fn laws(&self, place: (&Source, &Receiver)) -> Result<BoundLaws, AcousticsError> {
        self.model.laws_between(&self.scene, place, &self.air)
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

    fn fit_t60(&self, t60_s: &[f64], bar: &Bar) -> Result<Outcome<'a>, Failure> {
        let targets = PerBand::new(OCTAVES, t60_s.iter().map(|&t| Estimate::exact(t)).collect())?;
        let longest_s = t60_s.iter().copied().fold(0.0, f64::max);
        let duration_s = (DURATION_FACTOR * longest_s).clamp(DURATION_S.0, DURATION_S.1);
        let fitter = self.fitter()?;
        fitter.check_t60(&targets, OCTAVES, &self.air, duration_s)?;
        let place = self.arguments.place.of(self.file)?;
        let laws = self.laws(place)?;
        let under =
            if laws.is_empty() { Vec::new() } else { vec![conditions(&self.materials, &self.air, &laws)] };
        let retraced = Retraced { room: self, places: place, laws: &laws, duration_s };
        let config = RetraceConfig { seed: self.arguments.seed, ..RetraceConfig::default() };
        let done = fitter.fit_t60_retracing(
            &retraced,
            &FitProblem::new(&self.materials, &self.priors, &self.air).under(&under),
            &targets,
            &config,
            bar,
        )?;
        let independent = done.independent_paths.into_iter().next().ok_or("no paths")?;
        let curve = |materials: &[Material]| {
            independent.energy_response(&conditions(materials, &self.air, &laws), 5e-3)
        };
        let (before, after) = (curve(&self.materials)?, curve(&done.fit.materials)?);
        let points = |energy: &sabine::acoustics::EnergyResponse, b: usize| {
            let level = energy.decay_curve(b).level_db().into_iter().enumerate();
            level.map(|(i, l)| (i as f64 * 5e-3, l)).filter(|p| p.1 > -65.0).collect::<Vec<_>>()
        };
        let curves = (0..OCTAVES.len()).map(|b| {
            vec![
                ("before", Look::Line, points(&before, b)),
                ("after", Look::Line, points(&after, b)),
                ("wanted", Look::Dashed, vec![(0.0, 0.0), (t60_s[b], -60.0)]),
            ]
        });
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
            warnings,
            seconds: Seconds { trace, fit },
            fit: done.fit,
        })
    }

    fn is_held_out(&self, source: &Source, receiver: &Receiver) -> bool {
        let pair = format!("{}/{}", source.id, receiver.id);
        self.arguments.hold_out.iter().any(|id| *id == receiver.id || *id == pair)
    }

    fn fit_responses(&self, bar: &Bar) -> Result<Outcome<'a>, Failure> {
        let entries = self.file.responses();
        let places: Vec<(&Source, &Receiver)> = entries
            .iter()
            .map(|e| (&self.file.sources()[e.source], &self.file.receivers()[e.receiver]))
            .collect();
        let unknown =
            |id: &&String| !places.iter().any(|(s, r)| **id == r.id || **id == format!("{}/{}", s.id, r.id));
        if let Some(id) = self.arguments.hold_out.iter().find(unknown) {
            return Err(format!("--hold-out {id}: the room has no response of this receiver").into());
        }
        let held_out: Vec<bool> = places.iter().map(|(s, r)| self.is_held_out(s, r)).collect();
        if held_out.iter().all(|h| *h) {
            return Err("room.toml: responses: none is left to fit to".into());
        }
        let fitter = self.fitter()?;
        let measured = (0..entries.len())
            .map(|i| Ok(MeasuredDecay::new(&self.file.load_response(i)?, OCTAVES)?))
            .collect::<Result<Vec<_>, Failure>>()?;
        let t30 =
            |m: &MeasuredDecay| m.t30_s().values().iter().flatten().map(|t| t.value).fold(0.0, f64::max);
        let longest_s = measured.iter().map(t30).fold(0.0, f64::max);
        let duration_s = (DURATION_FACTOR * longest_s).clamp(DURATION_S.0, DURATION_S.1);
        let seed = self.arguments.seed;
        let start = Instant::now();
        let trace = |seed| -> Result<Vec<PathSet>, AcousticsError> {
            places.iter().map(|p| self.trace(*p, duration_s, seed, 1.0)).collect()
        };
        let paths = trace(seed)?;
        let traced_s = start.elapsed().as_secs_f64();
        let pairs: Vec<MeasuredPair<'_>> =
            measured.iter().zip(&paths).map(|(measured, paths)| MeasuredPair { measured, paths }).collect();
        let fitted: Vec<MeasuredPair<'_>> =
            pairs.iter().zip(&held_out).filter(|(_, held)| !**held).map(|(pair, _)| *pair).collect();
        let laws = places.iter().map(|place| self.laws(*place)).collect::<Result<Vec<_>, _>>()?;
        let under: Vec<Conditions<'_>> =
            laws.iter().map(|laws| conditions(&self.materials, &self.air, laws)).collect();
        let of_fitted: Vec<Conditions<'_>> =
            under.iter().zip(&held_out).filter(|(_, held)| !**held).map(|(own, _)| *own).collect();
        let start = Instant::now();
        let measurement = self.file.measurement();
        let done =
            fitter.fit_responses(
                &fitted,
                measurement,
                &FitProblem::new(&self.materials, &self.priors, &self.air)
                    .under(if self.model.laws.is_empty() { &[] } else { &of_fitted }),
                bar,
            )?;
        let fit_s = start.elapsed().as_secs_f64();

        // Held against rays that the fit has not seen.
        let other = trace(seed.wrapping_add(1))?;
        let (mut compared, mut curves) = (Vec::new(), Vec::new());
        for (i, (measured, paths)) in measured.iter().zip(&other).enumerate() {
            let pair = MeasuredPair { measured, paths };
            let misfit = |materials: &[Material]| {
                DecayMisfit::under(pair, measurement.time_zero, &under[i].with_materials(materials))
            };
            let (before, after) = (misfit(&self.materials)?, misfit(&done.fit.materials)?);
            if curves.is_empty() && (held_out[i] || !held_out.contains(&true)) {
                curves = (0..OCTAVES.len()).map(|b| response_curves(&before, &after, b)).collect();
            }
            let levels = |m: &DecayMisfit| m.rmse_db.values().iter().map(|r| r.clone().ok()).collect();
            compared.push(Compared {
                source: places[i].0.id.clone(),
                receiver: places[i].1.id.clone(),
                held_out: held_out[i],
                measured_t30_s: values(&before.measured_t30_s),
                t30_before_s: values(&before.simulated_t30_s),
                t30_after_s: values(&after.simulated_t30_s),
                decay_rmse_before_db: levels(&before),
                decay_rmse_after_db: levels(&after),
            });
        }
        let left_out = done.left_out.iter();
        let warnings =
            left_out.map(|(i, hz, why)| format!("response {i} at {hz} Hz is left out: {why}")).collect();
        let mean = |of: &dyn Fn(&Compared) -> &Vec<Option<f64>>| -> Vec<Option<f64>> {
            let used = || compared.iter().filter(|c| !c.held_out);
            (0..OCTAVES.len()).map(|b| mean_of(used().filter_map(|c| of(c)[b]))).collect()
        };
        let one = held_out.iter().filter(|held| !**held).count() == 1;
        Ok(Outcome {
            aim: Aim { quantity: "T30", of: if one { "the response" } else { "the responses" } },
            target_s: mean(&|c| &c.measured_t30_s),
            reached_s: mean(&|c| &c.t30_after_s),
            independent: other.into_iter().next().ok_or("no paths")?,
            place: *places.first().ok_or("no paths")?,
            fit: done.fit,
            compared,
            warnings,
            seconds: Seconds { trace: traced_s, fit: fit_s },
            curves,
        })
    }
}

/// A room that is traced again and heard.
struct Retraced<'a> {
    room: &'a Room<'a>,
    places: (&'a Source, &'a Receiver),
    laws: &'a BoundLaws,
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
        let between = conditions(materials, &self.room.air, self.laws);
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
