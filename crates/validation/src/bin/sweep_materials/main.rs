//! How near fitted rooms come to the reverberation times asked for: five rooms, T60 from 0.2 to 2.5 s, seven octaves.
//!
//! Fits materials of which nothing is known, renders responses from rays and noise that the fit has not seen, and reads T30
//! from them as ISO 3382 does. Writes the tables and plots of `docs/validation/optimize.md`.

mod plots;
mod rooms;

use clap::Parser;
use rooms::{Room, rooms};
use sabine::acoustics::{
    Air, Bands, Error as AcousticsError, Estimate, Material, PerBand, Reading, RoomParameters,
};
use sabine::optimize::{
    AbsorptionPrior, FitConfig, FitProblem, MaterialFit, MaterialFitter, Retrace, RetraceConfig,
    SlopeObjective,
};
use sabine::paths::{Conditions, PathSet, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::MaterialPrior;
use sabine_cli::output::OutputFolder;
use sabine_validation::AnyError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Sweep reverberation times over five rooms and compare the three objectives.
#[derive(Parser)]
struct Arguments {
    /// Reverberation times to ask for, in seconds
    #[arg(long, value_delimiter = ',', default_value = "0.2,0.3,0.45,0.65,0.95,1.4,2.0,2.5")]
    targets: Vec<f64>,
    /// Rays of the first trace of every fit; more follow where they are needed
    #[arg(long, default_value_t = 20_000)]
    rays: usize,
    /// Specular paths taken from the closed form in rooms that are boxes, in every trace
    #[arg(long, default_value_t = 0)]
    cuboid_paths: usize,
    /// Most paths that a fit may rest on
    #[arg(long, default_value_t = 3_000_000)]
    max_paths: usize,
    /// Relative Monte-Carlo error of T60 that is aimed at
    #[arg(long, default_value_t = 0.01)]
    t60_error: f64,
    /// Only the rooms whose name contains this
    #[arg(long, default_value = "")]
    room: String,
    /// Expect of the materials what the library says, with a standard deviation of 0.1, instead of nothing
    #[arg(long)]
    tables: bool,
    /// Draw the tables and plots of these earlier sweeps (their sweep.json) instead
    #[arg(long, value_delimiter = ',', value_name = "FILE,...")]
    drawn_from: Vec<PathBuf>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/sweep_materials")]
    out: PathBuf,
}

fn main() -> ExitCode {
    sabine_validation::exit_code(run(&Arguments::parse()))
}

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Method {
    /// The decay curve, traced until verified, aimed at what is read from the rendered response.
    Edc,
    /// The decay curve on the first trace alone.
    EdcOnce,
    /// The paper's line through the paths that `edc` rests on.
    Paper,
    /// Li's.
    Li2018,
}

/// One octave of one fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Point {
    room: String,
    method: Method,
    target_s: f64,
    band_hz: f64,
    reachable: bool,
    /// T30 of the energy that independent rays give, in seconds.
    energy_s: Option<f64>,
    /// T30 of one response rendered from them, in seconds.
    rendered_s: Option<f64>,
    /// Mean of several that differ by their noise alone.
    mean_rendered_s: Option<f64>,
    /// The fit itself says that it is not verified.
    doubted: bool,
    /// Monte-Carlo error of T60 on the paths of the fit, relative.
    fit_error: Option<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Run {
    room: String,
    target_s: f64,
    rounds: usize,
    paths: usize,
    trace_s: f64,
    fit_s: f64,
    single_fit_s: f64,
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let mut out = OutputFolder::create(&arguments.out)?;
    let (mut points, mut runs) = (Vec::new(), Vec::new());
    for path in &arguments.drawn_from {
        let named = |error: serde_json::Error| format!("{}: {error}", path.display());
        let text = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let (more_points, more_runs): (Vec<Point>, Vec<Run>) =
            serde_json::from_slice(&text).map_err(named)?;
        points.extend(more_points);
        runs.extend(more_runs);
    }
    let traced = arguments.drawn_from.is_empty();
    for room in rooms()?.iter().filter(|room| traced && room.name.contains(&arguments.room)) {
        println!(
            "{}: {:.0} m3, {:.0} m2, {} materials",
            room.name,
            room.scene.volume_m3(),
            room.scene.surface_m2(),
            room.scene.materials().len()
        );
        for &target_s in &arguments.targets {
            let run = fit_room(room, target_s, arguments, &mut points)?;
            let errors = |of: fn(&Point) -> Option<f64>| -> String {
                let mine = points.iter().filter(|p: &&Point| {
                    (p.room.as_str(), p.target_s, p.method) == (room.name, target_s, Method::Edc)
                });
                mine.map(|p| match of(p).filter(|_| p.reachable) {
                    Some(t) => format!("{:>6.1}", 100.0 * (t / target_s - 1.0)),
                    None => "     -".to_owned(),
                })
                .collect()
            };
            println!(
                "{target_s:.2} s, {} rounds, {:.1} M paths, {:.1} s + {:.1} s; energy {}; rendered {} %",
                run.rounds,
                run.paths as f64 / 1e6,
                run.trace_s,
                run.fit_s,
                errors(|p| p.energy_s),
                errors(|p| p.mean_rendered_s)
            );
            runs.push(run);
        }
    }
    let tables = plots::tables(&points);
    println!("\n{tables}");
    out.write("tables.md", tables.as_bytes())?;
    out.write("sweep.json", serde_json::to_string_pretty(&(&points, &runs))?.as_bytes())?;
    out.write("optimize_t60.svg", plots::reached(&points)?.as_bytes())?;
    out.write("optimize_error.svg", plots::errors(&points)?.as_bytes())?;
    out.finish()?;
    Ok(())
}

/// Responses that are rendered together last so long, in seconds: T30 of a single one varies by its noise with the inverse root of
/// bandwidth times duration, by 13 % at 125 Hz and 0.2 s (ISO 3382-2, annex A).
const RENDERED_S: f64 = 6.0;
/// Fewest and most of them: combinations of source and microphone in the precision method (ISO 3382-2, table 1).
const RESPONSES: (f64, f64) = (3.0, 12.0);

/// A room that can be traced again, and in which T30 is read from what is rendered.
struct Traced<'a> {
    room: &'a Room,
    air: Air,
    rays: usize,
    duration_s: f64,
    responses: u64,
    noise_seed: u64,
    cuboid_paths: usize,
}

impl Traced<'_> {
    /// T30 of each rendered response.
    fn read(&self, paths: &PathSet, materials: &[Material]) -> Result<Vec<PerBand<Reading>>, AcousticsError> {
        let failed = |e: sabine::propagate::Error| AcousticsError::implementation("rendering", e);
        let of = |seed: u64| {
            let config = RenderConfig { sample_rate_hz: 32_000, seed, ..RenderConfig::default() };
            let renderer = PressureRenderer::new(config).map_err(failed)?;
            let response = renderer.render(paths, &Conditions::new(materials, &self.air)).map_err(failed)?;
            Ok(RoomParameters::measure(&response, Bands::T60)?.t30_s)
        };
        (0..self.responses).map(|i| of(self.noise_seed + i)).collect()
    }
}

/// Mean over responses, as ISO 3382-1 (8.1) averages positions; what cannot be read of one is not read at all.
fn mean(readings: &[PerBand<Reading>]) -> PerBand<Reading> {
    let count = readings.len() as f64;
    PerBand::from_fn(Bands::T60, |b| {
        let values: Vec<f64> =
            readings.iter().map(|r| r.values()[b].clone().map(|t| t.value)).collect::<Result<_, _>>()?;
        let mean = values.iter().sum::<f64>() / count;
        let square: f64 = values.iter().map(|t| (t - mean) * (t - mean)).sum();
        Ok(Estimate::new(mean, (square / (count - 1.0) / count).sqrt()))
    })
}

impl Retrace for Traced<'_> {
    fn trace(&self, seed: u64, effort: f64) -> Result<Vec<PathSet>, AcousticsError> {
        let rays = (effort * self.rays as f64).ceil() as usize;
        let config = TracerConfig {
            rays,
            duration_s: self.duration_s,
            seed,
            cuboid_paths: self.cuboid_paths,
            ..TracerConfig::default()
        };
        let tracer = PathTracer::new(config).map_err(|e| AcousticsError::implementation("tracing", e))?;
        let Room { scene, source, receiver, .. } = self.room;
        Ok(vec![tracer.trace(scene, source, receiver, &self.air, &())?])
    }

    fn read_t60_s(
        &self,
        paths: &[PathSet],
        materials: &[Material],
    ) -> Result<Option<PerBand<Reading>>, AcousticsError> {
        Ok(Some(mean(&self.read(&paths[0], materials)?)))
    }
}

fn fit_room(
    room: &Room,
    target_s: f64,
    arguments: &Arguments,
    points: &mut Vec<Point>,
) -> Result<Run, AnyError> {
    let octaves = Bands::T60;
    let materials: Vec<Material> = room.scene.materials().iter().map(|m| m.material.clone()).collect();
    let prior = |material: &Material| {
        if arguments.tables {
            let standard_deviation = PerBand::uniform(octaves, MaterialPrior::TABLE_SD);
            return AbsorptionPrior { mean: material.absorption().clone(), standard_deviation };
        }
        let (mean, sd) = (MaterialPrior::UNKNOWN_ABSORPTION, MaterialPrior::UNKNOWN_ABSORPTION_SD);
        AbsorptionPrior::uniform(octaves, mean, sd)
    };
    let priors: Vec<AbsorptionPrior> = materials.iter().map(prior).collect();
    let targets = PerBand::uniform(octaves, Estimate::exact(target_s));
    let air = Air::default();
    let responses = (RENDERED_S / target_s).clamp(RESPONSES.0, RESPONSES.1).ceil() as u64;
    let (rays, duration_s) = (arguments.rays, 1.25 * target_s);
    let cuboid_paths = arguments.cuboid_paths;
    let traced = Traced { room, air, rays, duration_s, responses, noise_seed: 1, cuboid_paths };
    let fitter = |objective| MaterialFitter::new(FitConfig { objective, ..FitConfig::default() });

    let config = RetraceConfig {
        seed: 1,
        t60_error: arguments.t60_error,
        max_paths: arguments.max_paths,
        ..RetraceConfig::default()
    };
    let edc = fitter(SlopeObjective::DecayCurve)?.fit_t60_retracing(
        &traced,
        &FitProblem::new(&materials, &priors, &air),
        &targets,
        &config,
        &(),
    )?;
    // Rays and noise that nothing was chosen by.
    let total: usize = edc.fitted_paths.iter().map(|(_, sets)| sets[0].len()).sum();
    let effort = edc.independent_paths[0].len() as f64 / edc.fitted_paths[0].1[0].len() as f64;
    let other = &traced.trace(1_000, effort)?[0];
    let listener = Traced { noise_seed: 1_000, ..traced };
    let all: Vec<&PathSet> = edc.fitted_paths.iter().map(|(_, sets)| &sets[0]).collect();
    let mut single_fit_s = 0.0;
    let mut single = |objective, paths: &[&PathSet]| -> Result<MaterialFit, AnyError> {
        let start = Instant::now();
        let fit =
            fitter(objective)?.fit_t60(paths, &FitProblem::new(&materials, &priors, &air), &targets, &())?;
        single_fit_s = start.elapsed().as_secs_f64();
        Ok(fit)
    };
    let fits = [
        (Method::Paper, single(SlopeObjective::Paper, &all)?),
        (Method::Li2018, single(SlopeObjective::Li2018, &all)?),
        (Method::EdcOnce, single(SlopeObjective::DecayCurve, &all[..1])?),
        (Method::Edc, edc.fit),
    ];
    for (method, fit) in fits {
        let energy = other.energy_response(&Conditions::new(&fit.materials, &air), 1e-3)?;
        let rendered = listener.read(other, &fit.materials)?;
        let averaged = mean(&rendered);
        for b in 0..octaves.len() {
            let band_hz = octaves.nominal_hz(b);
            points.push(Point {
                room: room.name.to_owned(),
                method,
                target_s,
                band_hz,
                reachable: fit.unreachable.iter().all(|u| u.band_hz != band_hz),
                energy_s: energy.decay_curve(b).decay_time_s(-5.0, -35.0).ok(),
                rendered_s: rendered[0].values()[b].as_ref().ok().map(|t| t.value),
                mean_rendered_s: averaged.values()[b].as_ref().ok().map(|t| t.value),
                doubted: method == Method::Edc && edc.not_verified.iter().any(|n| n.band_hz == band_hz),
                fit_error: fit.predicted_t60_s.values()[b].as_ref().ok().map(|t| t.standard_error / t.value),
            });
        }
    }
    let (trace_s, fit_s) = edc.seconds;
    Ok(Run {
        room: room.name.to_owned(),
        target_s,
        rounds: edc.rounds,
        paths: total,
        trace_s,
        fit_s,
        single_fit_s,
    })
}
