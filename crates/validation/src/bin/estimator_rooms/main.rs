//! The estimator in rooms, voices and sounds that it was not trained on: learns how recordings of a room are joined and what warnings rest
//! on, and judges both in rooms reserved for the test. Prints the tables of `docs/validation/estimator.md`.
//!
//! ```text
//! estimator_rooms --learn WEIGHTS      prior, likelihood and detectors of the released network, written with it
//! estimator_rooms --check              tables in simulated rooms and with voices that took part in learning
//! estimator_rooms                      tables in the test rooms, with test voices
//! ```

mod error;
mod learn;
mod record;
mod rooms;
mod sounds;
mod tables;

use clap::Parser;
use error::Error;
use rooms::Use;
use sabine::acoustics::write_atomically;
use sabine::augment::Partition;
use sabine::estimator::Estimator;
use sounds::Sounds;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Simulated rooms have seeds from here on in learning, check and test.
const SEEDS: [u64; 3] = [0, 100_000, 200_000];

/// Learn and judge how recordings of a room are joined, and warnings.
#[derive(Parser)]
struct Arguments {
    /// Folder of measured rooms, speech and noise
    #[arg(long, value_name = "DIR", default_value = "../shared/data")]
    data: PathBuf,
    /// Weights; those of the crate by default
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Learn, and write the weights here
    #[arg(long, value_name = "FILE", conflicts_with = "check")]
    learn: Option<PathBuf>,
    /// Judge in rooms that are not reserved for the test
    #[arg(long)]
    check: bool,
    /// Simulated rooms
    #[arg(long, default_value_t = 400)]
    simulated: usize,
}

fn main() -> ExitCode {
    sabine_validation::exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Error> {
    let estimator = match &arguments.weights {
        Some(path) => Estimator::from_file(path)?,
        None => Estimator::pretrained()?,
    };
    let data = &arguments.data;
    let learning = [Partition::Train, Partition::Validation];
    if let Some(path) = &arguments.learn {
        let sounds = Sounds::read(data, Partition::Validation, &learning)?;
        let mut rooms = rooms::measured(data, &[Use::Fit, Use::Prior])?;
        rooms.extend(rooms::simulated(SEEDS[0], arguments.simulated, Use::Simulated)?);
        let records = record::hear(&estimator, &rooms, &sounds, false)?;
        let model = learn::learn(estimator.model().clone(), &records)?;
        let bytes = model.to_safetensors(true)?;
        return Ok(write_atomically(path, |file| file.write_all(&bytes))?);
    }
    let (voices, noises, seeds) = if arguments.check {
        (Partition::Validation, learning.to_vec(), SEEDS[1])
    } else {
        (Partition::Test, vec![Partition::Test], SEEDS[2])
    };
    let sounds = Sounds::read(data, voices, &noises)?;
    let mut rooms = rooms::measured(data, if arguments.check { &[Use::Prior] } else { &[Use::Test] })?;
    rooms.extend(rooms::simulated(seeds, arguments.simulated, Use::SimulatedTest)?);
    println!(
        "{} rooms, {} talkers, {} tracks of noise",
        rooms.len(),
        sounds.talkers.len(),
        sounds.noise.len()
    );
    let records = record::hear(&estimator, &rooms, &sounds, !arguments.check)?;
    let of_kind =
        |simulated: bool| rooms.iter().filter(move |r| (r.used == Use::SimulatedTest) == simulated).count();
    let (mut measured, mut simulated) = (Vec::new(), Vec::new());
    let table = tables::warnings(&records);
    for record in records {
        if record.used == Use::SimulatedTest { simulated.push(record) } else { measured.push(record) }
    }
    println!("\n## {} measured rooms\n\n{}", of_kind(false), tables::errors(&estimator, &measured)?);
    println!("{}", tables::t60_by_room(&estimator, &measured)?);
    println!("## {} simulated rooms\n\n{}", of_kind(true), tables::errors(&estimator, &simulated)?);
    println!("## Warnings\n\n{table}");
    Ok(())
}
