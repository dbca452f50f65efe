//! Compares a simulated room with measured room means, octave by octave, in just-noticeable differences.
//!
//! `sabine validate --room DIR [--fit]` traces every pair of source and receiver and prints a table in Markdown.

use crate::bar::Bar;
use crate::failure::Failure;
use crate::room::read_room;
use clap::Args;
use sabine::acoustics::{Bands, Estimate, Material, PerBand, Reading, library_material};
use sabine::optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFitter};
use sabine::paths::{Conditions, PathParameters, PathSet, Propagator};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::{MaterialTable, Materials, MeasuredRoom, Scene};
use std::path::{Path, PathBuf};

/// Compare simulated with measured room means, in just-noticeable differences (ISO 3382-1, table A.1).
#[derive(Args)]
pub struct Arguments {
    /// Folder with room.toml and its mesh
    #[arg(long, value_name = "DIR")]
    room: PathBuf,
    /// Read a mesh or responses outside the room's folder, too: only for rooms that you trust
    #[arg(long)]
    allow_outside: bool,
    /// Tables of materials instead of the room's: a materials.toml as `fit` and `match` write it
    #[arg(long, value_name = "F")]
    materials: Option<PathBuf>,
    /// Measured room means by third octave: columns frequency_hz, T20, EDT, C80, D50 (percent) [default: measured_parameters.csv of the room]
    #[arg(long, value_name = "F.csv")]
    measured: Option<PathBuf>,
    /// Fit the materials to the measured T20 first; all comparisons are then made on rays of another seed
    #[arg(long)]
    fit: bool,
    /// What a surface is thought to be: a name of the material library instead of the room file's table
    #[arg(long, value_name = "SURFACE=LIBRARY_NAME")]
    material: Vec<String>,
    /// Scattering coefficient of all surfaces without one in the library, instead of the room file's
    #[arg(long, value_name = "0..1")]
    scattering: Option<f64>,
    /// Rays for each pair
    #[arg(long, default_value_t = 10_000)]
    rays: usize,
    /// Length of the responses in seconds
    #[arg(long, default_value_t = 2.5)]
    duration: f64,
    /// Seed of the rays
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Go on although more than one ray in a thousand escapes through holes of the mesh
    #[arg(long)]
    allow_leaks: bool,
}

/// What is compared: its just-noticeable difference, and how it is read.
struct Quantity {
    name: &'static str,
    column: usize,
    /// JND, as a share of the measured value or in the quantity's unit.
    jnd: f64,
    relative: bool,
    read: fn(&PathParameters) -> &PerBand<Reading>,
}

const QUANTITIES: [Quantity; 4] = [
    Quantity { name: "T20 (s)", column: 1, jnd: 0.05, relative: true, read: |p| &p.t20_s },
    Quantity { name: "EDT (s)", column: 2, jnd: 0.05, relative: true, read: |p| &p.edt_s },
    Quantity { name: "C80 (dB)", column: 3, jnd: 1.0, relative: false, read: |p| &p.c80_db },
    Quantity { name: "D50", column: 4, jnd: 0.05, relative: false, read: |p| &p.d50 },
];

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let room = read_room(&arguments.room, arguments.allow_outside, arguments.materials.as_deref())?;
    let file = arguments.measured.clone().unwrap_or_else(|| arguments.room.join("measured_parameters.csv"));
    let measured = third_octaves(&file)?;
    let bands = room.bands();
    let bar = Bar::new();
    let mut materials = room_materials(&room, &arguments.material, arguments.scattering)?;
    let scene = room.scene().with_materials(materials.clone())?;
    if arguments.fit {
        let paths = trace_all(&room, &scene, arguments, arguments.seed + 1000, &bar)?;
        materials = fitted(&room, &materials, &measured, &paths, &bar)?;
    }
    let air = room.air();
    let traced = trace_all(&room, &scene, arguments, arguments.seed, &bar)?;
    bar.finish();
    let parameters: Vec<PathParameters> = traced
        .iter()
        .map(|paths| PathParameters::read(paths, &Conditions::new(&materials, &air)))
        .collect::<Result<_, _>>()?;

    println!(
        "{} pairs, {} rays each; simulated / measured (difference in JND)\n",
        parameters.len(),
        arguments.rays
    );
    let heads: Vec<String> = QUANTITIES.iter().map(|q| q.name.to_owned()).collect();
    println!("| octave (Hz) | {} |\n|---|{}", heads.join(" | "), "---|".repeat(heads.len()));
    for (band, hz) in bands.iter_hz().enumerate() {
        let cells = QUANTITIES.iter().map(|quantity| {
            let simulated = mean(parameters.iter().map(|p| &(quantity.read)(p).values()[band]));
            let (Some(simulated), Some(target)) =
                (simulated, octave(&measured, quantity.column, bands, band))
            else {
                return "-".to_owned();
            };
            let jnd = if quantity.relative { quantity.jnd * target } else { quantity.jnd };
            format!("{simulated:.2} / {target:.2} ({:+.1})", (simulated - target) / jnd)
        });
        println!("| {hz} | {} |", cells.collect::<Vec<_>>().join(" | "));
    }
    if arguments.fit {
        println!("\nfitted absorption:\n");
        for (named, material) in room.scene().materials().iter().zip(&materials) {
            let values: Vec<String> =
                material.absorption().values().iter().map(|a| format!("{a:.2}")).collect();
            println!("- {}: {}", named.name, values.join(" "));
        }
    }
    Ok(())
}

/// The room file's materials, or those of the library where the user knows better.
fn room_materials(
    room: &MeasuredRoom,
    choices: &[String],
    scattering: Option<f64>,
) -> Result<Vec<Material>, Failure> {
    let named = room.scene().materials();
    let mut materials: Vec<Material> = named.iter().map(|m| m.material.clone()).collect();
    if let Some(scattering) = scattering {
        for material in &mut materials {
            let scattering = PerBand::uniform(room.bands(), scattering);
            *material = Material::new(material.absorption().clone(), scattering)?;
        }
    }
    for choice in choices {
        let (surface, library) = choice
            .split_once('=')
            .ok_or_else(|| format!("--material {choice}: SURFACE=LIBRARY_NAME is expected"))?;
        let at = named
            .iter()
            .position(|m| m.name == surface)
            .ok_or_else(|| format!("--material {choice}: the room has no surface of that name"))?;
        materials[at] = library_material(library)?.material(room.bands())?;
    }
    Ok(materials)
}

/// Paths of every pair, each with a seed of its own.
fn trace_all(
    room: &MeasuredRoom,
    scene: &Scene,
    arguments: &Arguments,
    seed: u64,
    bar: &Bar,
) -> Result<Vec<PathSet>, Failure> {
    let mut traced = Vec::new();
    for source in room.sources() {
        for receiver in room.receivers() {
            let config = TracerConfig {
                rays: arguments.rays,
                duration_s: arguments.duration,
                seed: seed + traced.len() as u64,
                allow_leaks: arguments.allow_leaks,
                ..TracerConfig::default()
            };
            traced.push(PathTracer::new(config)?.trace(scene, source, receiver, &room.air(), bar)?);
        }
    }
    Ok(traced)
}

/// Materials that give the measured T20, starting from the room file's.
fn fitted(
    room: &MeasuredRoom,
    materials: &[Material],
    measured: &[[f64; 5]],
    paths: &[PathSet],
    bar: &Bar,
) -> Result<Vec<Material>, Failure> {
    let bands = room.bands();
    // The tables as the options have them, trusted as far as the file says.
    let known = room.scene().materials().iter().zip(room.priors()).zip(materials);
    let tables = known.map(|((named, prior), material)| {
        MaterialTable::new(named.name.clone(), material, &prior.absorption_sd)
    });
    let stated = room.with_materials(&Materials::new(tables.collect::<Result<_, _>>()?)?)?;
    let priors = AbsorptionPrior::of_room(&stated, bands);
    let targets: Vec<Estimate> = (0..bands.len())
        .map(|band| {
            octave(measured, 1, bands, band)
                .map(|value| Estimate { value, standard_error: 0.05 * value })
                .ok_or_else(|| format!("no measured T20 at {} Hz", bands.nominal_hz(band)))
        })
        .collect::<Result<_, _>>()?;
    let fitter = MaterialFitter::new(FitConfig { range_db: (-5.0, -25.0), ..FitConfig::default() })?;
    let references: Vec<&PathSet> = paths.iter().collect();
    let targets = PerBand::new(bands, targets)?;
    let fit =
        fitter.fit_t60(&references, &FitProblem::new(materials, &priors, &room.air()), &targets, bar)?;
    let names: Vec<&str> = room.scene().materials().iter().map(|named| named.name.as_str()).collect();
    let unreachable = fit.unreachable.iter().map(ToString::to_string);
    for note in unreachable.chain(fit.warnings.iter().map(|warning| warning.describe(&names))) {
        println!("note: {note}");
    }
    Ok(fit.materials)
}

fn mean<'r>(readings: impl Iterator<Item = &'r Reading>) -> Option<f64> {
    let values: Vec<f64> = readings.map(|r| r.as_ref().ok().map(|e| e.value)).collect::<Option<_>>()?;
    Some(values.iter().sum::<f64>() / values.len() as f64)
}

/// Mean of the third octaves of an octave; D50 as a share.
fn octave(measured: &[[f64; 5]], column: usize, bands: Bands, band: usize) -> Option<f64> {
    let (low, high) = bands.edges_hz(band);
    let inside = measured.iter().filter(|row| row[0] > low && row[0] < high).map(|row| row[column]);
    let values: Vec<f64> = inside.filter(|v| v.is_finite()).collect();
    let scale = if column == 4 { 0.01 } else { 1.0 };
    (values.len() == 3).then(|| scale * values.iter().sum::<f64>() / 3.0)
}

/// Rows of the table: frequency, T20, EDT, C80, D50.
fn third_octaves(file: &Path) -> Result<Vec<[f64; 5]>, Failure> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let lines = text.lines().enumerate().filter(|(_, line)| line.starts_with(|c: char| c.is_ascii_digit()));
    lines
        .map(|(number, line)| {
            let values: Vec<f64> =
                line.split(',').map(|cell| cell.trim().parse().unwrap_or(f64::NAN)).collect();
            values.try_into().map_err(|_| {
                format!("{}, line {}: five columns are expected", file.display(), number + 1).into()
            })
        })
        .collect()
}
