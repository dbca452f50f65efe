//! Rooms that are no box, made by the second laboratory, diagnosed blind: how often something is named that is not there, and how often
//! what is hidden is named.
//!
//! With `--record` every room is written to a CSV file as soon as it is done, and rooms that the file holds are not done again.

mod tables;
mod trial;

use clap::Parser;
use sabine::diagnose::DiagnoseConfig;
use sabine_testkit::{Planted, PolyhedralConfig, Polyhedron};
use sabine_validation::AnyError;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use trial::{Task, Trial};

/// Diagnose rooms of the second laboratory and count what is named.
#[derive(Parser)]
struct Arguments {
    /// What is hidden: nothing, position, surface, temperature, latency, gain, wall, scattering, response, object [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    planted: Vec<Planted>,
    /// Rooms for each shape, each thing that is hidden, and each world; 0 prints the tables of the record alone
    #[arg(long, default_value_t = 1)]
    rooms: u64,
    /// Seed of the first room, the next number for the next. For figures that are published: the first eight hexadecimal digits of the
    /// commit, as a number
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rooms without nuisances alone, or with them alone [default: both]
    #[arg(long)]
    nuisances: Option<bool>,
    /// Rooms of one shape alone: l, sloped_ceiling, wedge, furnished [default: all]
    #[arg(long, value_parser = shape)]
    shape: Option<Polyhedron>,
    /// Do each N-th room alone, from the K-th on
    #[arg(long, value_name = "K/N", value_parser = sabine_validation::part, default_value = "1/1")]
    part: (usize, usize),
    /// Rays for each pair
    #[arg(long, default_value_t = DiagnoseConfig::default().rays)]
    rays: usize,
    /// CSV file that trials are added to, and whose trials count in the tables
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Folder in which the rooms are kept
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

fn main() -> ExitCode {
    sabine_validation::exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let mut trials = match &arguments.record {
        Some(path) if path.exists() => read(path)?,
        _ => Vec::new(),
    };
    let temporary = std::env::temp_dir().join(format!("sabine_polyhedral_rooms_{}", std::process::id()));
    let folder = arguments.keep.as_ref().unwrap_or(&temporary);
    for task in tasks(arguments) {
        if trials.iter().any(|t| t.task == task) {
            continue;
        }
        let own = folder.join(task.name());
        let trial = task.run(&own);
        if arguments.keep.is_none() {
            // The error that counts is the first.
            let _ = std::fs::remove_dir_all(folder);
        }
        let trial = trial?;
        eprintln!("{}: {} ({}), {:.0} s", task.name(), trial.outcome, trial.answer, trial.seconds);
        trials.push(trial);
        if let Some(path) = &arguments.record {
            write(path, &trials)?;
        }
    }
    tables::print(&trials);
    Ok(())
}

fn tasks(arguments: &Arguments) -> Vec<Task> {
    let planted = if arguments.planted.is_empty() { &Planted::ALL[..] } else { &arguments.planted };
    let mut seeds = arguments.seed..;
    let mut all = Vec::new();
    for _ in 0..arguments.rooms {
        for &planted in planted {
            for nuisances in [false, true] {
                for shape in Polyhedron::ALL {
                    let seed = seeds.next().unwrap_or(u64::MAX);
                    let room =
                        PolyhedralConfig { seed, shape, planted, nuisances, ..PolyhedralConfig::default() };
                    all.push(Task {
                        seed,
                        shape,
                        planted,
                        nuisances,
                        receivers: room.receivers,
                        rays: arguments.rays,
                    });
                }
            }
        }
    }
    let wanted = |task: &Task| {
        arguments.nuisances.is_none_or(|n| n == task.nuisances)
            && arguments.shape.is_none_or(|s| s == task.shape)
    };
    let (first, each) = arguments.part;
    all.into_iter().filter(wanted).skip(first - 1).step_by(each).collect()
}

fn shape(text: &str) -> Result<Polyhedron, String> {
    let named = |s: &Polyhedron| trial::shape_name(*s) == text;
    Polyhedron::ALL.into_iter().find(named).ok_or_else(|| "one of l, sloped_ceiling, wedge, furnished".into())
}

fn read(path: &Path) -> Result<Vec<Trial>, AnyError> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    trial::from_csv(&text).map_err(|error| format!("{}: {error}", path.display()).into())
}

fn write(path: &Path, trials: &[Trial]) -> Result<(), AnyError> {
    let bytes = trial::to_csv(trials)?;
    Ok(sabine::acoustics::write_atomically(path, |file| std::io::Write::write_all(file, &bytes))?)
}
