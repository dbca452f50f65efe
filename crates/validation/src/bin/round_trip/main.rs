//! Round trip of truth: the laboratory hides an effect, the diagnosis of eight positions names it, its extended model is saved, read and
//! rendered at twelve positions that no fit has seen, and held there against the room as stated and against the true model.
//!
//! With `--record` every room is written to a CSV file as soon as it is done, and rooms that the file holds are not done again. The table of
//! several records, of several processes or machines: `--merge`.

mod tables;
mod task;
mod trial;
mod true_model;

use clap::Parser;
use sabine::diagnose::DiagnoseConfig;
use sabine_testkit::Hidden;
use sabine_validation::room_tasks::do_all;
use sabine_validation::{AnyError, hiding, record};
use std::path::PathBuf;
use std::process::ExitCode;
use task::Task;
use trial::Trial;

/// Two at once, unless others are asked for: of the room and of the recording, of two of the room, and of arrivals and decays.
const PAIRS: [&str; 6] = [
    "scattering+transducer_response",
    "sound_speed+position_error",
    "source_directivity+background_noise",
    "surface_displacement+air_absorption",
    "surface_absorption+time_zero",
    "room_dimensions+truncation",
];

/// Find hidden effects at eight positions, and hold the models found against the true ones at twelve others.
#[derive(Parser)]
struct Arguments {
    /// Effects; `a+b` hides two at once [default: the whole catalogue but diffraction, which needs a room with an edge, and six pairs]
    #[arg(long, value_delimiter = ',', value_name = "ID")]
    effects: Vec<String>,
    /// Strength: 1 is plain, 0.3 slight
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    strength: f64,
    /// Rooms for each effect; 0 prints the table of the record alone
    #[arg(long, default_value_t = 1)]
    rooms: u64,
    /// Seed of the first room, the next number for the next. For figures that are published: the first eight hexadecimal digits of the
    /// commit, as a number
    #[arg(long, default_value_t = 23_000)]
    seed: u64,
    /// Rays for each pair, in the diagnosis and in the rendering
    #[arg(long, default_value_t = DiagnoseConfig::default().rays)]
    rays: usize,
    /// Do each N-th room alone, from the K-th on: several processes side by side, each with a record of its own
    #[arg(long, value_name = "K/N", value_parser = sabine_validation::part, default_value = "1/1")]
    part: (usize, usize),
    /// CSV file that rooms are added to, and whose rooms count in the table
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Print the table of these records, and do nothing else
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["record", "part"])]
    merge: Vec<PathBuf>,
}

fn main() -> ExitCode {
    sabine_validation::exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    if !arguments.merge.is_empty() {
        let records: Vec<Vec<Trial>> =
            arguments.merge.iter().map(|path| record::read(path)).collect::<Result<_, _>>()?;
        tables::print(&records.concat());
        return Ok(());
    }
    do_all("round_trip", arguments.record.as_deref(), tasks(arguments), tables::print)
}

fn tasks(arguments: &Arguments) -> Vec<Task> {
    let all = Hidden::CATALOGUE.iter().chain(&[task::COHERENT]).chain(&PAIRS).map(ToString::to_string);
    let effects: Vec<String> =
        if arguments.effects.is_empty() { all.collect() } else { arguments.effects.clone() };
    let mut seeds = arguments.seed..;
    let mut tasks = Vec::new();
    for _ in 0..arguments.rooms {
        for effect in &effects {
            tasks.push(Task {
                hidden: hiding::effects(effect),
                strength: arguments.strength,
                seed: seeds.next().unwrap_or(u64::MAX),
                rays: arguments.rays,
            });
        }
    }
    let (first, each) = arguments.part;
    tasks.into_iter().skip(first - 1).step_by(each).collect()
}
