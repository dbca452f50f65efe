//! Many matches in one process: is the memory that it holds flat?
//!
//! Matches the room in `fixtures/` again and again, each time with another seed, and reads the resident memory after each call
//! (Linux: `/proc/self/statm`). Fails if the median over the last quarter of the calls exceeds that over the second by more than
//! the limit; the first quarter is left for caches to fill.

use clap::Parser;
use sabine::acoustics::{Channel, Signal, read_audio};
use sabine::propagate::TracerConfig;
use sabine::scene::MeasuredRoom;
use sabine::{MatchConfig, MatchInput, Recording, match_room};
use sabine_validation::AnyError;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

/// Match a room many times and watch the memory.
#[derive(Parser)]
struct Arguments {
    /// Calls
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(8..))]
    calls: u32,
    /// Rays of each call
    #[arg(long, default_value_t = 500)]
    rays: usize,
    /// Growth that is allowed, in MiB
    #[arg(long, default_value_t = 2.0)]
    limit_mib: f64,
    /// KiB kept back on purpose by each call, to see that a leak is found
    #[arg(long, default_value_t = 0, hide = true)]
    leak_kib: usize,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether memory is flat.
fn run(arguments: &Arguments) -> Result<bool, AnyError> {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let speech = seconds(&read_audio(fixtures.join("speech/recording.wav"), Channel::Mono)?, 4.0)?;
    let dry = seconds(&read_audio(fixtures.join("speech/dry_guest.wav"), Channel::Mono)?, 1.0)?;
    let room = MeasuredRoom::read(fixtures.join("room"))?;
    let mut memory_mib = Vec::new();
    let mut kept = Vec::new();
    let started = Instant::now();
    let every = (arguments.calls / 10).max(1);
    for call in 1..=arguments.calls {
        let input = MatchInput {
            speech: Recording { name: "recording.wav", signal: &speech },
            dry: Recording { name: "dry_guest.wav", signal: &dry },
            room: &room,
            source: "talker",
            receiver: if call % 2 == 0 { "microphone" } else { "corner" },
        };
        let tracer = TracerConfig { rays: arguments.rays, ..TracerConfig::default() };
        let config = MatchConfig { seed: u64::from(call), tracer, ..MatchConfig::default() };
        let matched = match_room(&input, &config, &())?;
        if !matched.matched.samples().iter().any(|s| s.abs() > 1e-3) {
            return Err("a match without sound".into());
        }
        drop(matched);
        kept.push(vec![1u8; 1024 * arguments.leak_kib]);
        memory_mib.push(resident_mib()?);
        if call % every == 0 {
            let latest = memory_mib[memory_mib.len() - 1];
            println!("{call:>6} calls, {:>7.1} s, {latest:.1} MiB", started.elapsed().as_secs_f64());
        }
    }
    let quarter = memory_mib.len() / 4;
    let before = median(&memory_mib[quarter..2 * quarter]);
    let after = median(&memory_mib[memory_mib.len() - quarter..]);
    let flat = after - before <= arguments.limit_mib;
    println!(
        "second quarter {before:.2} MiB, last quarter {after:.2} MiB: {}",
        if flat { "flat" } else { "it grows" }
    );
    Ok(flat)
}

/// The first seconds of a sound.
fn seconds(sound: &Signal, length_s: f64) -> Result<Signal, AnyError> {
    let count = (length_s * f64::from(sound.sample_rate_hz())) as usize;
    Ok(Signal::new(sound.samples()[..count.min(sound.samples().len())].to_vec(), sound.sample_rate_hz())?)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn resident_mib() -> Result<f64, AnyError> {
    let text = std::fs::read_to_string("/proc/self/statm")
        .map_err(|error| format!("/proc/self/statm: {error} (memory is read on Linux only)"))?;
    let pages: f64 = text.split(' ').nth(1).ok_or("/proc/self/statm: no second field")?.parse()?;
    // Pages of 4 KiB: on machines with larger ones only the unit is off, not the verdict's sign.
    Ok(pages * 4096.0 / 1_048_576.0)
}
