//! The main job: reverberant speech and a rough room in, sound that belongs in the room out.
//!
//! Without arguments it runs on the built-in demo.

pub mod report;

use crate::bar::Bar;
use crate::channel::channel;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::modelled::ModelArguments;
use crate::output::OutputFolder;
use crate::room::{PlaceArguments, RoomArguments};
use clap::Args;
use sabine::acoustics::{Channel, SampleFormat, Signal, encode_wav};
use sabine::{
    FileMatch, MatchConfig, MatchFiles, MatchInput, MatchSummary, Recording, match_room_files, materials_toml,
};
use std::path::{Path, PathBuf};

/// Name of the rendered sound in the folder of results.
const MATCHED: &str = "matched.wav";

/// Match a simulated room to a recording of speech, and render dry sound in it.
#[derive(Args)]
pub struct Arguments {
    /// Reverberant recording of speech (WAV), at least one second [default: the built-in demo]
    #[arg(long, value_name = "F.wav")]
    speech: Option<PathBuf>,
    #[command(flatten)]
    room: RoomArguments,
    #[command(flatten)]
    model: ModelArguments,
    #[command(flatten)]
    place: PlaceArguments,
    /// Sound to place in the room (WAV) [default: the built-in demo]
    #[arg(long, value_name = "F.wav")]
    dry: Option<PathBuf>,
    /// Channel of files that have several, from 0, or `mean`; without it they must be mono
    #[arg(long, value_name = "N|mean", value_parser = channel)]
    channel: Option<Channel>,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of rays to trace [default: 40000]
    #[arg(long)]
    rays: Option<usize>,
    /// Below this frequency the room is a solution of the wave equation, from an omnidirectional source. Its time grows with the
    /// fourth power of the frequency
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    wave_below: Option<f64>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/match")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut demo = Demo::default();
    let speech_path = demo.or(arguments.speech.as_deref(), "speech/recording.wav")?;
    let dry_path = demo.or(arguments.dry.as_deref(), "speech/dry_guest.wav")?;
    let (speech_name, dry_name) = (demo.name(&speech_path), demo.name(&dry_path));

    // A folder that cannot be written to should not cost the user a computation first.
    let mut out = OutputFolder::create(&arguments.out)?;
    let channel = arguments.channel.unwrap_or_default();
    let (room, room_name) = arguments.room.read(&mut demo)?;
    let (room, model) = arguments.model.apply(room)?;
    let (source, receiver) = arguments.place.of(&room)?;
    let matched = out.path_of(MATCHED);
    let files = MatchFiles {
        speech: &speech_path,
        dry: &dry_path,
        channel,
        room: &room,
        source: &source.id,
        receiver: &receiver.id,
        matched: &matched,
    };
    let wave_below_hz = arguments.wave_below.or(model.wave_below_hz);
    let mut config = MatchConfig { seed: arguments.seed, wave_below_hz, ..MatchConfig::default() };
    config.tracer = model.tracer(config.tracer);
    config.laws = model.laws;
    config.locally_reacting_share = model.locally_reacting_share;
    if let Some(rays) = arguments.rays {
        config.tracer.rays = rays;
    }
    let bar = Bar::new();
    let found = match_room_files(&files, &config, &bar)?;
    bar.finish();

    let input = MatchInput {
        speech: Recording { name: &speech_name, signal: &found.speech.sound },
        dry: Recording { name: &dry_name, signal: &found.dry.sound },
        room: &room,
        source: &source.id,
        receiver: &receiver.id,
    };
    let summary = MatchSummary::new(&found.matched);
    write_results(&mut out, &input, &room_name, &found, &summary)?;
    out.finish()?;
    let known: Vec<String> = room.notes().iter().map(ToString::to_string).collect();
    print_summary(&summary, &known, &arguments.out);
    Ok(())
}

fn write_results(
    out: &mut OutputFolder,
    input: &MatchInput<'_>,
    room_name: &str,
    found: &FileMatch,
    summary: &MatchSummary,
) -> Result<(), Failure> {
    let matched = &found.matched;
    let response = Signal::from(matched.response.clone());
    let filter = Signal::new(matched.eq_filter.taps().to_vec(), matched.eq_filter.sample_rate_hz())?;
    out.write("impulse_response.wav", &encode_wav(&response, SampleFormat::Float32)?)?;
    out.write("eq_filter.wav", &encode_wav(&filter, SampleFormat::Float32)?)?;
    out.write("materials.toml", materials_toml(matched)?.as_bytes())?;
    out.write("match.json", summary.to_json()?.as_bytes())?;
    let excerpts = report::Excerpts { speech: &found.speech, dry: &found.dry, matched: MATCHED };
    let page = report::html_of_files(input, room_name, matched, summary, &excerpts)?;
    out.write("report.html", page.as_bytes())?;
    Ok(())
}

fn print_summary(summary: &MatchSummary, known: &[String], out: &Path) {
    println!("octave        {}", row(&summary.bands_hz, |hz| format!("{hz}")));
    println!("T60 heard     {} s", row(&summary.t60_target_s, |t| format!("{t:.2}")));
    println!(
        "T60 reached   {} s",
        row(&summary.t60_reached_s, |t| t.map_or("-".to_owned(), |t| format!("{t:.2}")))
    );
    if let Some(waves) = &summary.waves {
        println!(
            "waves below {} Hz: {} voxels; {:+.1} dB against the paths about there, joined with {:+.1} dB",
            waves.below_hz, waves.voxels, waves.level_difference_db, waves.gain_db
        );
    }
    println!("{}", report::level(summary));
    // What concerns the room was printed when it was read.
    for warning in summary.warnings.iter().filter(|warning| !known.contains(warning)) {
        println!("note: {warning}");
    }
    let seconds: f64 = summary.seconds.values().sum();
    println!("{seconds:.1} s; listen to and look at {}", out.join("report.html").display());
}

fn row<T>(values: &[T], format: impl Fn(&T) -> String) -> String {
    values.iter().map(|v| format!("{:>6}", format(v))).collect()
}
