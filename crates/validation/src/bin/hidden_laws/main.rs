//! Hidden laws: the laboratory hides one of ten laws that no catalogue lists, or none, and a diagnosis that looks for laws is judged by what it
//! says. The page is `docs/validation/hidden_laws.md`.
//!
//! With `--record` every room is written to a CSV file as soon as it is done, and rooms that the file holds are not done again. The table of
//! several records, of several processes or machines: `--merge`.

mod agreement;
mod as_law;
mod change;
mod judge;
mod kinds;
mod outside;
mod tables;
mod task;
mod trial;
mod truth;
mod worlds;

use clap::{Parser, ValueEnum};
use sabine::diagnose::DiagnoseConfig;
use sabine_validation::room_tasks::do_all;
use sabine_validation::{AnyError, record};
use std::path::PathBuf;
use std::process::ExitCode;
use task::Task;
use trial::{Discover, Trial};
use worlds::{Null, World};

/// Hide laws that no catalogue lists, and judge what a diagnosis says of them.
#[derive(Parser)]
struct Arguments {
    /// Rooms for each kind, size and kind of room without a law; 0 prints the tables of the record alone
    #[arg(long, default_value_t = 1)]
    rooms: u64,
    /// What the seeds of all rooms begin at: a room has the same seed whatever else is asked for. For figures that are published: the first
    /// eight hexadecimal digits of the commit, as a number
    #[arg(long, default_value_t = 24_000)]
    seed: u64,
    /// Kinds of laws [default: all ten]
    #[arg(long, value_delimiter = ',', value_name = "KIND")]
    kinds: Vec<String>,
    /// Sizes of laws, 0.1 to 5 in tenths: 1 is plain; `none` for rooms without a law alone
    #[arg(long, default_value = "0.5,1,2", value_name = "X,...")]
    sizes: String,
    /// Rooms without a law: nothing, cause, nuisances, both; `none` for rooms with a law alone
    #[arg(long, default_value = "nothing,cause,nuisances", value_name = "NULL,...")]
    nulls: String,
    /// Nuisances in every room: places off by 5 mm more, levels of octaves by 0.4 dB, stationary noise at -50 dB
    #[arg(long)]
    nuisances: bool,
    /// Look for a law in each room, or where the catalogue leaves it unexplained or one formula would do as well, as the command does by itself
    #[arg(long, value_enum, default_value = "if-needed")]
    discover: Discover,
    /// Rays for each pair
    #[arg(long, default_value_t = DiagnoseConfig::default().rays)]
    rays: usize,
    /// Receivers that are fitted, 1 to 32; below six no law is looked for. Eight more, nearer to the source and farther from it, are left out
    #[arg(long, default_value_t = 12)]
    receivers: usize,
    /// Print by how much the laws change levels, and diagnose nothing: seconds for each room
    #[arg(long, conflicts_with_all = ["record", "merge"])]
    changes: bool,
    /// Do each N-th room alone, from the K-th on: several processes side by side, each with a record of its own
    #[arg(long, value_name = "K/N", value_parser = sabine_validation::part, default_value = "1/1")]
    part: (usize, usize),
    /// CSV file that rooms are added to, and whose rooms count in the tables
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Print the tables of these records, and do nothing else
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
        let mut trials: Vec<Trial> = Vec::new();
        for trial in records.into_iter().flatten() {
            // A room that two records hold counts once.
            if !trials.iter().any(|other| other.is_of_same_room(&trial)) {
                trials.push(trial);
            }
        }
        tables::print(&trials);
        return Ok(());
    }
    let tasks = tasks(arguments)?;
    if arguments.changes {
        let mut changes = Vec::new();
        for task in &tasks {
            if let (World::Law(size), Some(db)) = (task.world, task.change_db()?) {
                changes.push((task.kind, size, db));
            }
        }
        tables::print_changes(&changes);
        return Ok(());
    }
    do_all("hidden_laws", arguments.record.as_deref(), tasks, tables::print)
}

/// The parts of a list, none of `none`.
fn listed<T>(text: &str, parse: impl Fn(&str) -> Result<T, String>) -> Result<Vec<T>, AnyError> {
    let parts = text.split(',').filter(|part| *part != "none");
    Ok(parts.map(parse).collect::<Result<_, _>>()?)
}

fn tasks(arguments: &Arguments) -> Result<Vec<Task>, AnyError> {
    let kinds: Vec<usize> = if arguments.kinds.is_empty() {
        (0..kinds::KINDS.len()).collect()
    } else {
        arguments.kinds.iter().map(|id| kinds::number(id)).collect::<Result<_, _>>()?
    };
    let nulls = listed(&arguments.nulls, |text| Null::from_str(text, false))?;
    let sizes = listed(&arguments.sizes, World::sized)?;
    let mut worlds: Vec<World> = nulls.into_iter().map(World::Null).collect();
    worlds.extend(sizes.into_iter().map(World::Law));
    let mut tasks = Vec::new();
    for round in 0..arguments.rooms {
        for &kind in &kinds {
            for &world in &worlds {
                tasks.push(Task {
                    kind,
                    world,
                    seed: world.seed(arguments.seed, round, kind),
                    rays: arguments.rays,
                    receivers: arguments.receivers,
                    nuisances: arguments.nuisances,
                    discover: arguments.discover,
                });
            }
        }
    }
    let (first, each) = arguments.part;
    Ok(tasks.into_iter().skip(first - 1).step_by(each).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    fn arguments(more: &[&str]) -> Arguments {
        Arguments::try_parse_from(["hidden_laws"].iter().chain(more)).unwrap()
    }

    #[test]
    fn a_room_has_the_same_seed_whatever_else_is_asked_for() {
        let all = tasks(&arguments(&["--rooms", "2"])).unwrap();
        assert_eq!(all.len(), 120);
        let fog = tasks(&arguments(&["--rooms", "2", "--kinds", "fog", "--sizes", "2", "--nulls", "none"]))
            .unwrap();
        assert_eq!(fog.len(), 2);
        assert!(fog.iter().all(|task| all.iter().any(|other| other.seed == task.seed && other.kind == 2)));
        let parts = [1, 2, 3].map(|k| tasks(&arguments(&["--part", &format!("{k}/3")])).unwrap().len());
        assert_eq!(parts, [20; 3]);
    }

    #[test]
    fn what_is_no_kind_size_or_room_is_an_error() {
        for more in [["--kinds", "gravity"], ["--sizes", "0.55"], ["--nulls", "void"]] {
            assert!(tasks(&arguments(&more)).is_err(), "{more:?}");
        }
        assert!(tasks(&arguments(&["--rooms", "0"])).unwrap().is_empty());
    }
}
