//! How well hidden effects are found: laboratory rooms, each with effects of some strength or none, diagnosed blind.
//!
//! Prints answers by effect and strength, detection by d', false alarms, coverage and controls with 95 % intervals. With `--record`
//! every room is written to a CSV file as soon as it is done, and rooms that the file holds are not done again. With `--out` several
//! processes, on one machine or on many, make one atlas in a folder (`docs/how-to/dataset-on-a-cluster.md`).

mod decide;
mod sham;
mod shards;
mod tables;
mod task;
mod trial;

use clap::Parser;
use sabine::diagnose::DiagnoseConfig;
use sabine_testkit::Hidden;
use sabine_validation::{AnyError, hiding, record};
use shards::{Built, Shards};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use task::Task;
use trial::Trial;

/// Hide effects in laboratory rooms and count what is found of them.
#[derive(Parser)]
struct Arguments {
    /// Effects; `a+b` hides two at once [default: the whole catalogue, what is outside it, and none]
    #[arg(long, value_delimiter = ',', value_name = "ID")]
    effects: Vec<String>,
    /// Strengths: 1 is plain, 0.3 slight
    #[arg(long, value_delimiter = ',', value_name = "X", default_value = "1")]
    strengths: Vec<f64>,
    /// Rooms for each effect and strength; 0 prints the tables of the record alone
    #[arg(long, default_value_t = 3)]
    rooms: u64,
    /// Seed of the first room; each effect, strength and repetition has a room of its own. For figures that are published: the first
    /// eight hexadecimal digits of the commit, as a number
    #[arg(long, default_value_t = 6000)]
    seed: u64,
    /// Do each N-th room alone, from the K-th on: several processes side by side, each with a record of its own
    #[arg(long, value_name = "K/N", value_parser = sabine_validation::part, default_value = "1/1")]
    part: (usize, usize),
    /// Reflections keep their sign, as image sources of other programs do
    #[arg(long)]
    positive_reflections: bool,
    /// Receivers in each room
    #[arg(long, default_value_t = 12)]
    receivers: usize,
    /// Sources in each room
    #[arg(long, default_value_t = 1)]
    sources: usize,
    /// Sample rate; bands that it does not hold are left out
    #[arg(long, value_name = "HZ", default_value_t = 48_000)]
    rate: u32,
    /// Sessions, each in air of its own, which is stated
    #[arg(long, default_value_t = 1)]
    sessions: usize,
    /// Third octaves in place of octaves
    #[arg(long)]
    third_octaves: bool,
    /// Look for a law that no catalogue lists, too; to be kept in a record of its own
    #[arg(long)]
    discover: bool,
    /// Follow every set of causes up by the measurement that it asks for, and by another
    #[arg(long)]
    decide: bool,
    /// Rays for each pair
    #[arg(long, default_value_t = DiagnoseConfig::default().rays)]
    rays: usize,
    /// Decay that is compared, in dB
    #[arg(long, default_value_t = DiagnoseConfig::default().range_db)]
    range_db: f64,
    /// How well places are said to be known, in metres along each axis; they are off by 5 mm
    #[arg(long, value_name = "M", default_value_t = DiagnoseConfig::default().position_sd_m)]
    position_sd: f64,
    /// Effects without meaning beside the catalogue, 0 to 14: a control
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=14))]
    shams: u64,
    /// CSV file that trials are added to, and whose trials count in the tables
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Folder of an atlas: a file for each room, and `record.csv` once all of them are there. The bytes depend on the other arguments
    /// and on this program alone
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["record", "part"])]
    out: Option<PathBuf>,
    /// Do every N-th room of the folder alone, from the I-th on (I from 1)
    #[arg(long, value_name = "I/N", value_parser = sabine_validation::part, default_value = "1/1", requires = "out")]
    worker: (usize, usize),
    /// Keep the rooms that the folder holds, if they are whole
    #[arg(long, requires = "out")]
    resume: bool,
}

fn main() -> ExitCode {
    sabine_validation::exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let scratch = std::env::temp_dir().join(format!("sabine_effect_atlas_{}", std::process::id()));
    if let Some(out) = &arguments.out {
        return share(arguments, out, &scratch);
    }
    let mut trials = match &arguments.record {
        Some(path) if path.exists() => record::read(path)?,
        _ => Vec::new(),
    };
    for task in tasks(arguments) {
        if task.is_done(&trials) {
            continue;
        }
        trials.push(diagnose(&task, &scratch)?);
        if let Some(path) = &arguments.record {
            record::write(path, &trials)?;
        }
    }
    tables::print(&trials);
    Ok(())
}

/// A worker's share of an atlas in a folder; the last one to end prints the tables.
fn share(arguments: &Arguments, out: &Path, scratch: &Path) -> Result<(), AnyError> {
    let started = std::time::Instant::now();
    let tasks = tasks(arguments);
    let shards = Shards::begin(out, &tasks, arguments.worker, arguments.resume)?;
    let Built { made, kept, mended } = shards.run(arguments.worker, |task| diagnose(task, scratch))?;
    let seconds = started.elapsed().as_secs_f64();
    eprintln!("{made} rooms made, {kept} kept, {mended} mended in {seconds:.0} s");
    match shards.finish()? {
        Ok(trials) => tables::print(&trials),
        Err(there) => {
            eprintln!("{there} of {} rooms are there; the others are left to other workers", tasks.len())
        }
    }
    Ok(())
}

/// Does a room and says what came of it.
fn diagnose(task: &Task, scratch: &Path) -> Result<Trial, AnyError> {
    let trial = task.run(scratch).inspect_err(|_| {
        // The error that counts is the first.
        let _ = std::fs::remove_dir_all(scratch);
    })?;
    eprintln!(
        "{:22} {:4.2} seed {}: {:?}, {}, d' {:.1}, {:.0} s",
        trial.hidden,
        trial.strength,
        trial.seed,
        trial.outcome,
        trial.answer,
        trial.d_prime.unwrap_or(f64::NAN),
        trial.seconds.unwrap_or(f64::NAN)
    );
    Ok(trial)
}

fn tasks(arguments: &Arguments) -> Vec<Task> {
    let all = Hidden::CATALOGUE.iter().chain(Hidden::OUTSIDE.iter()).map(ToString::to_string);
    let effects: Vec<String> = if arguments.effects.is_empty() {
        all.chain(["none".to_owned()]).collect()
    } else {
        arguments.effects.clone()
    };
    let mut tasks = Vec::new();
    let mut seeds = arguments.seed..;
    for _ in 0..arguments.rooms {
        for &strength in &arguments.strengths {
            for effect in &effects {
                tasks.push(Task {
                    hidden: hiding::effects(effect),
                    strength,
                    seed: seeds.next().unwrap_or(u64::MAX),
                    receivers: arguments.receivers,
                    sources: arguments.sources,
                    sample_rate_hz: arguments.rate,
                    sessions: arguments.sessions,
                    positive_reflections: arguments.positive_reflections,
                    bands_per_octave: if arguments.third_octaves { 3 } else { 1 },
                    discover: arguments.discover,
                    decide: arguments.decide,
                    rays: arguments.rays,
                    range_db: arguments.range_db,
                    position_sd_m: arguments.position_sd,
                    shams: arguments.shams as usize,
                });
            }
        }
    }
    let (first, each) = arguments.part;
    tasks.into_iter().skip(first - 1).step_by(each).collect()
}
