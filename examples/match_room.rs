//! The main job in one call: speech recorded in a room and a rough model of the room in; sound that belongs there out.
//!
//! ```text
//! cargo run --example match_room [-- OUT_FOLDER]
//! ```
//!
//! It writes `matched.wav`, `report.html` and what led to them into the folder (`out/match_room`), and prints
//! ```text
//! octave (Hz)    T60 heard    T60 reached
//!         125       0.84 s         0.82 s
//! ...
//!        1000       0.74 s         0.75 s
//! ...
//!        8000       0.56 s         0.56 s
//! listen to and look at out/match_room/report.html
//! ```
//!
//! On your own recording and room: `sabine match --speech F.wav --room DIR --dry F.wav --out DIR`. Step by step: the guide of the crate
//! `sabine`; how close it comes: `docs/validation/match_room.md`.

use sabine::acoustics::{Channel, SampleFormat, Signal, encode_wav, read_audio};
use sabine::propagate::TracerConfig;
use sabine::scene::MeasuredRoom;
use sabine::{MatchConfig, MatchInput, MatchSummary, Recording, match_room, materials_toml};
use sabine_cli::bar::Bar;
use sabine_cli::output::OutputFolder;
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("out/match_room"), PathBuf::from);
    let mut out = OutputFolder::create(&folder)?;

    let speech = read_audio(fixtures.join("speech/recording.wav"), Channel::Mono)?;
    let dry = read_audio(fixtures.join("speech/dry_guest.wav"), Channel::Mono)?;
    let room = MeasuredRoom::read(fixtures.join("room"))?;
    let input = MatchInput {
        speech: Recording { name: "recording.wav", signal: &speech },
        dry: Recording { name: "dry_guest.wav", signal: &dry },
        room: &room,
        source: "talker",
        receiver: "microphone",
    };
    let bar = Bar::new();
    // A quarter of the default's rays, for a quick look.
    let tracer = TracerConfig { rays: 10_000, ..TracerConfig::default() };
    let matched = match_room(&input, &MatchConfig { tracer, ..MatchConfig::default() }, &bar)?;
    bar.finish();

    let summary = MatchSummary::new(&matched);
    println!("octave (Hz)    T60 heard    T60 reached");
    for ((hz, heard), reached) in
        summary.bands_hz.iter().zip(&summary.t60_target_s).zip(&summary.t60_reached_s)
    {
        println!("{hz:>11}{heard:>11.2} s{:>13.2} s", reached.unwrap_or(f64::NAN));
    }
    let filter = Signal::new(matched.eq_filter.taps().to_vec(), matched.eq_filter.sample_rate_hz())?;
    out.write("matched.wav", &encode_wav(&matched.matched, SampleFormat::Int24)?)?;
    out.write(
        "impulse_response.wav",
        &encode_wav(&Signal::from(matched.response.clone()), SampleFormat::Float32)?,
    )?;
    out.write("eq_filter.wav", &encode_wav(&filter, SampleFormat::Float32)?)?;
    out.write("materials.toml", materials_toml(&matched)?.as_bytes())?;
    out.write("match.json", summary.to_json()?.as_bytes())?;
    out.write(
        "report.html",
        sabine_cli::reports::match_room(&input, "fixtures/room", &matched, &summary)?.as_bytes(),
    )?;
    out.finish()?;
    println!("listen to and look at {}", folder.join("report.html").display());
    Ok(())
}
