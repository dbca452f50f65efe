//! A listening test of a matched room: its stimuli as a webMUSHRA experiment, and the analysis of what assessors said.
//!
//! Without arguments it makes the stimuli of the built-in demo. See docs/how-to/listening-test.md.

mod analysis;
mod ratings;
mod screening;
mod statistics;
mod stimuli;
mod web_mushra;

use crate::bar::Bar;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::output::OutputFolder;
use crate::room::{PlaceArguments, RoomArguments};
use analysis::{Analysis, Unit};
use clap::{Args, Subcommand};
use ratings::Ratings;
use sabine::acoustics::{Channel, SampleFormat, encode_wav, read_audio, write_atomically};
use sabine::scene::MeasuredRoom;
use sabine::{MatchConfig, MatchInput, Recording, match_room};
use screening::Roles;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;
use stimuli::{CONDITIONS, Item, Responses};

/// Make a MUSHRA listening test of a matched room, or analyse its ratings.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    task: Option<Task>,
    #[command(flatten)]
    make: MakeArguments,
}

#[derive(Subcommand)]
enum Task {
    /// Make stimuli and a webMUSHRA configuration (the default)
    Make(MakeArguments),
    /// Analyse the ratings that webMUSHRA wrote
    Analyse(AnalyseArguments),
}

#[derive(Args)]
struct MakeArguments {
    /// Reverberant recording of speech that the room is matched to [default: the built-in demo]
    #[arg(long, value_name = "F.wav")]
    speech: Option<PathBuf>,
    #[command(flatten)]
    room: RoomArguments,
    #[command(flatten)]
    place: PlaceArguments,
    /// Dry speech, one file for each item of the test [default: two of the built-in demo]
    #[arg(long, value_name = "F.wav", num_args = 1..)]
    dry: Vec<PathBuf>,
    /// Where the stimuli will lie, seen from webMUSHRA's own folder
    #[arg(long, default_value = "configs/resources/sabine")]
    prefix: String,
    /// Rays to trace [default: 40000]
    #[arg(long)]
    rays: Option<usize>,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/listen")]
    out: PathBuf,
}

#[derive(Args)]
struct AnalyseArguments {
    /// The file of ratings, mushra.csv in the results of webMUSHRA
    #[arg(long, value_name = "F.csv")]
    ratings: PathBuf,
    /// Column that names the assessor [default: session_uuid, assessor or email, the first that is there]
    #[arg(long)]
    assessor: Option<String>,
    /// What is compared: the mean of each assessor, or each trial of each assessor as in the paper
    #[arg(long, value_enum, default_value_t = Unit::Assessor)]
    unit: Unit,
    /// Name of the hidden reference
    #[arg(long, default_value = "reference")]
    reference: String,
    /// Name of the low anchor
    #[arg(long, default_value = "low_anchor")]
    low_anchor: String,
    /// Name of the mid-range anchor
    #[arg(long, default_value = "mid_anchor")]
    mid_anchor: String,
    /// Also write everything as JSON
    #[arg(long, value_name = "F")]
    json: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.task {
        Some(Task::Analyse(analyse)) => run_analysis(analyse),
        Some(Task::Make(make)) => make_test(make),
        None => make_test(&arguments.make),
    }
}

fn make_test(arguments: &MakeArguments) -> Result<(), Failure> {
    let mut demo = Demo::default();
    let speech_path = demo.or(arguments.speech.as_deref(), "speech/recording.wav")?;
    let mut dry_paths = arguments.dry.clone();
    if dry_paths.is_empty() {
        dry_paths = vec![demo.or(None, "speech/dry_guest.wav")?, demo.or(None, "speech/dry_reader.wav")?];
    }
    let mut out = OutputFolder::create(&arguments.out)?;
    let (room, _) = arguments.room.read(&mut demo)?;
    let measured = measured_response(&room, arguments)?;
    let (source, receiver) = (
        &room.sources()[room.responses()[measured].source],
        &room.receivers()[room.responses()[measured].receiver],
    );
    let speech = read_audio(&speech_path, Channel::Mono)?;
    let mut dry = Vec::new();
    let mut names = BTreeSet::new();
    for path in &dry_paths {
        let name = web_mushra::identifier(path);
        if !names.insert(name.clone()) {
            return Err(format!("--dry {}: another item is called {name} too", path.display()).into());
        }
        dry.push((name, demo.name(path), read_audio(path, Channel::Mono)?));
    }

    let input = MatchInput {
        speech: Recording { name: &demo.name(&speech_path), signal: &speech },
        dry: Recording { name: &dry[0].1, signal: &dry[0].2 },
        room: &room,
        source: &source.id,
        receiver: &receiver.id,
    };
    let mut config = MatchConfig { seed: arguments.seed, ..MatchConfig::default() };
    if let Some(rays) = arguments.rays {
        config.tracer.rays = rays;
    }
    let bar = Bar::new();
    let matched = match_room(&input, &config, &bar)?;
    bar.finish();

    let responses = Responses::new(room.load_response(measured)?, &matched, arguments.seed)?;
    let mut items = Vec::new();
    for (name, path, signal) in &dry {
        let item = Item::new(name, &Recording { name: path, signal }, &responses)?;
        for (condition, stimulus) in CONDITIONS.iter().zip(&item.stimuli) {
            out.write(&web_mushra::file_name(name, condition), &encode_wav(stimulus, SampleFormat::Int16)?)?;
        }
        items.push(item);
    }
    out.write("sabine.yaml", web_mushra::configuration(&items, &arguments.prefix).as_bytes())?;
    let summary = responses.summary(&items)?;
    out.write("stimuli.json", serde_json::to_string_pretty(&summary)?.as_bytes())?;
    out.finish()?;
    summary.print();
    for warning in &matched.warnings {
        println!("note: {warning}");
    }
    let out = arguments.out.display();
    println!("copy {out}/sabine.yaml to configs/ of webMUSHRA and {out}/*.wav to {}/", arguments.prefix);
    Ok(())
}

/// The response that is the truth of this test.
fn measured_response(room: &MeasuredRoom, arguments: &MakeArguments) -> Result<usize, Failure> {
    let found = arguments.place.response(room)?;
    found.ok_or_else(|| {
        "room.toml: responses: none between this source and this receiver: without a measured response there is no reference"
            .into()
    })
}

fn run_analysis(arguments: &AnalyseArguments) -> Result<(), Failure> {
    let roles = Roles {
        reference: arguments.reference.clone(),
        low_anchor: arguments.low_anchor.clone(),
        mid_anchor: arguments.mid_anchor.clone(),
    };
    let ratings = Ratings::read(&arguments.ratings, arguments.assessor.as_deref())?;
    let analysis = Analysis::new(&ratings, &roles, arguments.unit)?;
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&analysis)?;
        write_atomically(path, |file| writeln!(file, "{text}"))?;
    }
    analysis.print();
    Ok(())
}
