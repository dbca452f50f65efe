//! Tables of the estimator's errors on a data set, as Markdown.
//!
//! `evaluate_estimator --data DIR [--weights F] [--partition test]`

use clap::{Parser, ValueEnum};
use sabine::estimator::{
    Dataset, Errors, Estimator, Evaluation, LABEL_COUNT, Partition, RoomMean, Selection, T60_COUNT,
    label_name,
};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

/// Which part of the data set.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Part {
    /// Rooms that decided when to stop.
    Validation,
    /// Rooms that nothing was decided by.
    Test,
}

/// Prints tables of the estimator's errors.
#[derive(Parser, Debug)]
struct Arguments {
    /// Folder of the data set.
    #[arg(long)]
    data: PathBuf,
    /// Weights; those of the crate by default.
    #[arg(long)]
    weights: Option<PathBuf>,
    /// Which part of the data set.
    #[arg(long, value_enum, default_value = "test")]
    partition: Part,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let estimator = match &arguments.weights {
        Some(path) => Estimator::from_file(path)?,
        None => Estimator::pretrained()?,
    };
    let dataset = Dataset::open(&arguments.data)?;
    let partition = match arguments.partition {
        Part::Validation => Partition::Validation,
        Part::Test => Partition::Test,
    };
    let evaluation = Evaluation::new(estimator.model(), &dataset, partition)?;
    for (title, measured) in [("measured rooms", true), ("all rooms", false)] {
        let selection = Selection { measured, ..Selection::all(partition) };
        let rooms = evaluation.rooms(&selection);
        if rooms.is_empty() {
            continue;
        }
        println!("\n## {title}: {} rooms, {} clips\n", rooms.len(), rooms.values().sum::<usize>());
        if measured {
            for (room, clips) in &rooms {
                println!("- {room}: {clips} clips");
            }
            println!();
        }
        println!("| | model | constant | best constant | model - constant | bias | 90 % coverage | clips |");
        println!("|---|---|---|---|---|---|---|---|");
        for label in 0..LABEL_COUNT {
            let unit = if label < T60_COUNT { "s" } else { "dB" };
            row(&format!("{} ({unit})", label_name(label)), evaluation.label(label, &selection));
        }
        row("**T60, all octaves (s)**", evaluation.t60(&selection));
        row("**EQ, all octaves (dB)**", evaluation.eq(&selection));
        println!(
            "\n| selection | | model | constant | best constant | model - constant | bias | coverage | clips |"
        );
        println!("|---|---|---|---|---|---|---|---|---|");
        let levels = [[-30.0, 5.0], [5.0, 10.0], [10.0, 20.0], [20.0, 30.0], [30.0, f64::INFINITY]];
        for snr_db in levels {
            let name = format!("SNR {} to {} dB", snr_db[0], snr_db[1]);
            let part = Selection { snr_db, ..selection };
            row(&format!("{name} | T60 (s)"), evaluation.t60(&part));
            row(&format!("{name} | EQ (dB)"), evaluation.eq(&part));
        }
        for t60_s in [[0.0, 0.3], [0.3, 0.6], [0.6, 1.0], [1.0, 1.5], [0.0, 1.5], [1.5, 10.0]] {
            let part = Selection { t60_s, ..selection };
            row(&format!("T60 at 1 kHz {} to {} s | T60 (s)", t60_s[0], t60_s[1]), evaluation.t60(&part));
        }
    }
    Ok(())
}

fn row(name: &str, errors: Option<Errors>) {
    let Some(e) = errors else { return };
    let interval = |m: RoomMean| format!("{:.3} [{:.3}, {:.3}]", m.value, m.low, m.high);
    println!(
        "| {name} | {} | {} | {:.3} | {} | {:+.3} | {:.0} % | {} |",
        interval(e.model),
        interval(e.constant),
        e.best_constant.value,
        interval(e.gain),
        e.bias.value,
        100.0 * e.coverage_90,
        e.clips
    );
}
