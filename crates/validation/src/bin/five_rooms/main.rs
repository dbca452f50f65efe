//! The paper's table on our rooms: speech in real rooms -> `match` -> T60 and EQ of the response that is rendered, against the measured one.
//!
//! 30 s of speech by speakers on whom the estimator was not trained, through each measured response, with noise of a cafe 20 dB below. What
//! is rendered is read behind its filter, as the measured response is. Beside it the same with the measured response given, with its T30 and
//! EQ in place of what the estimator hears, and with the objectives that were published. Writes the tables of
//! `docs/validation/five_rooms.md`, every octave as CSV, and a page to listen to.

mod error;
mod judge;
mod methods;
mod report;
mod rooms;
mod speech;
mod tables;

use clap::Parser;
use error::Error;
use judge::{Quantity, Truth};
use methods::{Case, Settings};
use report::Example;
use sabine_cli::output::OutputFolder;
use sabine_cli::page::Page;
use speech::{SNR_DB, Speech};
use std::path::PathBuf;
use std::process::ExitCode;
use tables::{PairResult, RoomResult};

/// Compare what is rendered from speech with what was measured, in every real room there is.
#[derive(Parser)]
struct Arguments {
    /// Folder of measured rooms, speech and noise
    #[arg(long, value_name = "DIR", default_value = "../shared/data")]
    data: PathBuf,
    /// Only the rooms whose name contains this
    #[arg(long, default_value = "")]
    room: String,
    /// Responses of each room, at most
    #[arg(long, default_value_t = 4)]
    pairs: usize,
    /// Rays of every trace
    #[arg(long, default_value_t = 40_000)]
    rays: usize,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/five_rooms")]
    out: PathBuf,
}

fn main() -> ExitCode {
    sabine_validation::exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Error> {
    let mut out = OutputFolder::create(&arguments.out)?;
    let (results, page) = compare(arguments)?;
    let tables = tables::markdown(&results);
    println!("\n{tables}");
    out.write("tables.md", tables.as_bytes())?;
    out.write("five_rooms.csv", &tables::csv(&results)?)?;
    out.write("report.html", page.html().as_bytes())?;
    out.finish()?;
    println!("listen: {}", arguments.out.join("report.html").display());
    Ok(())
}

/// All rooms, one after another.
fn compare(arguments: &Arguments) -> Result<(Vec<RoomResult>, Page), Error> {
    let rooms = rooms::rooms(&arguments.data, &arguments.room, arguments.pairs)?;
    let speech = Speech::read(&arguments.data)?;
    let (all, test) = speech.speakers;
    println!(
        "{all} speakers, {test} of them in the test; {} utterances make the recordings, another one is the dry voice; noise at {SNR_DB} dB, its partition: {}",
        speech.utterance_count, speech.noise_partition
    );
    let mut page = Page::new("Real rooms, heard and rendered");
    page.paragraph("Of each room the first response. All sounds have the same peak.");
    let settings = Settings { rays: arguments.rays, seed: arguments.seed };
    let mut results = Vec::new();
    for room in &rooms {
        println!("{}: {}", room.name, room.model.size_line());
        let mut pairs = Vec::new();
        for (index, pair) in room.pairs.iter().enumerate() {
            let start = std::time::Instant::now();
            let truth = Truth::read(&pair.response)?;
            let recording = speech.recording(room.first_recording + index, &pair.response)?;
            let case = Case { room, pair, truth: &truth, speech: &recording, dry: &speech.dry, settings };
            let rendered = case.render()?;
            println!("  {}: {:.0} s", pair.name(), start.elapsed().as_secs_f64());
            if pairs.is_empty() {
                let title = format!("{}, {}", room.name, pair.name());
                let (dry, measured) = (&speech.dry, &pair.response);
                let example = Example { title, recording: &recording, dry, measured, rendered: &rendered };
                example.write(&mut page)?;
            }
            let missing = |quantity: Quantity| {
                let values = truth.values(quantity).into_iter();
                values.filter(|(_, value)| value.is_none()).map(move |(hz, _)| (quantity, hz))
            };
            pairs.push(PairResult {
                name: pair.name(),
                left_out: missing(Quantity::T60).chain(missing(Quantity::Eq)).collect(),
                rendered: rendered.into_iter().map(|found| (found.method, found.octaves)).collect(),
            });
        }
        results.push(RoomResult { name: room.name, history: room.history, pairs });
    }
    Ok((results, page))
}
