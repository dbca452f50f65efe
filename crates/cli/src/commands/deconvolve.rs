//! Makes an impulse response of the recording of a sweep.

use crate::commands::sweep::read_settings;
use crate::failure::Failure;
use clap::Args;
use sabine::acoustics::{
    Channel, DeconvolutionConfig, SampleFormat, Signal, SweepMeasurement, deconvolve, probe_audio,
    read_audio, write_wav_channels,
};
use std::path::PathBuf;

/// What a recording may be longer than the playback, in seconds: memory holds all of it several times.
const LONGEST_EXTRA_S: f64 = 120.0;

/// Make impulse responses of a recorded sweep, one for each channel.
///
/// A recording that is clipped, too short, of another sweep or of another clock, and repetitions that differ, are refused with the
/// reason.
#[derive(Args)]
pub struct Arguments {
    /// The recording; each of its channels becomes a response
    #[arg(value_name = "FILE")]
    recording: PathBuf,
    /// Settings of the sweep that was played, as `sabine sweep` wrote them
    #[arg(long, value_name = "F.json")]
    sweep: PathBuf,
    /// Begin 50 ms before the direct sound, in place of where the recording begins
    #[arg(long)]
    trim: bool,
    /// Leave out repetitions that differ from the others
    #[arg(long)]
    leave_out: bool,
    /// Take the response as it is where the clocks of playback and recording differ
    #[arg(long)]
    allow_clock_drift: bool,
    /// The response, 32-bit float
    #[arg(long, value_name = "F.wav")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let sweep = read_settings(&arguments.sweep)?;
    let file = &arguments.recording;
    let named = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let info = probe_audio(file)?;
    let seconds = info.frames as f64 / f64::from(info.sample_rate_hz);
    let config = sweep.config();
    let longest_s = (config.duration_s + config.silence_s) * config.repetitions as f64 + LONGEST_EXTRA_S;
    if seconds > longest_s {
        return Err(named(&format!(
            "lasts {seconds:.0} s; the sweeps with {LONGEST_EXTRA_S:.0} s around them last {longest_s:.0} s. Cut it"
        ))
        .into());
    }
    if info.channels > 64 {
        return Err(named(&format!("{} channels; at most 64 are read", info.channels)).into());
    }
    let channels: Vec<Signal> =
        (0..info.channels).map(|i| read_audio(file, Channel::Index(i))).collect::<Result<_, _>>()?;
    let settings = DeconvolutionConfig {
        leave_out_differing: arguments.leave_out,
        allow_clock_drift: arguments.allow_clock_drift,
    };
    let found = deconvolve(&channels, &sweep, &settings).map_err(|error| named(&error))?;
    // Silence in the place of what lies before, so that times count from the beginning of the recording.
    let before =
        if arguments.trim { 0 } else { (found.start_s * f64::from(config.sample_rate_hz)).round() as usize };
    let responses: Vec<Vec<f32>> = found
        .responses
        .iter()
        .map(|response| [&vec![0.0; before][..], response.samples()].concat())
        .collect();
    let slices: Vec<&[f32]> = responses.iter().map(Vec::as_slice).collect();
    write_wav_channels(&arguments.out, &slices, config.sample_rate_hz, SampleFormat::Float32)?;
    print!("{}", summary(&found, arguments));
    Ok(())
}

fn summary(found: &SweepMeasurement, arguments: &Arguments) -> String {
    let length_s = found.responses[0].duration_s();
    let mut text = format!(
        "wrote {}: {} channels, {length_s:.2} s; the direct sound arrives {:.4} s after the beginning of the recording\n",
        arguments.out.display(),
        found.responses.len(),
        found.start_s + 0.05
    );
    if let Some(ppm) = found.clock_drift_ppm {
        text += &format!("clocks of playback and recording: {ppm:+.1} parts per million\n");
    }
    for (k, difference_db) in found.differences_db.iter().enumerate() {
        let left_out = if found.left_out.contains(&k) { ", left out" } else { "" };
        text += &format!("repetition {}: differs by {difference_db:.1} dB{left_out}\n", k + 1);
    }
    text
}
