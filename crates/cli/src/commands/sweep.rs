//! Writes an exponential sweep to be played in a room, and the settings that `sabine deconvolve` needs.

use crate::failure::Failure;
use crate::output::OutputFolder;
use clap::Args;
use sabine::acoustics::{Error, ExponentialSweep, SampleFormat, SweepConfig, encode_wav, read_at_most};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Largest file of settings, in bytes.
const LARGEST_SETTINGS: u64 = 65_536;

/// Write an exponential sine sweep, and beside it its settings for `sabine deconvolve`.
#[derive(Args)]
pub struct Arguments {
    /// First frequency in Hz
    #[arg(long, default_value_t = 20.0, value_name = "HZ")]
    from: f64,
    /// Last frequency in Hz
    #[arg(long, default_value_t = 20_000.0, value_name = "HZ")]
    to: f64,
    /// Length of a sweep in seconds
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    duration: f64,
    /// Silence after each sweep in seconds: longer than the reverberation time
    #[arg(long, default_value_t = 3.0, value_name = "S")]
    silence: f64,
    /// How often the sweep is played; three or more tell a repetition that differs
    #[arg(long, default_value_t = 1, value_name = "N")]
    repetitions: usize,
    /// Largest amplitude; 1 is full scale
    #[arg(long, default_value_t = 0.5)]
    peak: f64,
    /// Sample rate in Hz
    #[arg(long, default_value_t = 48_000, value_name = "HZ")]
    rate: u32,
    /// The sweep's WAV file; the settings take its name with .json
    #[arg(long, value_name = "F.wav")]
    out: PathBuf,
}

/// The settings as they stand in the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    sample_rate_hz: u32,
    from_hz: f64,
    to_hz: f64,
    duration_s: f64,
    fade_in_s: f64,
    fade_out_s: f64,
    silence_s: f64,
    repetitions: usize,
    peak: f64,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let config = SweepConfig {
        sample_rate_hz: arguments.rate,
        from_hz: arguments.from,
        to_hz: arguments.to,
        duration_s: arguments.duration,
        // A hundredth of the sweep, as long as the default's at most.
        fade_in_s: (0.01 * arguments.duration).min(0.1),
        fade_out_s: (0.002 * arguments.duration).min(0.02),
        silence_s: arguments.silence,
        repetitions: arguments.repetitions,
        peak: arguments.peak,
    };
    let sweep = ExponentialSweep::new(config)?;
    let playback = sweep.playback()?;
    let name = arguments.out.file_name().ok_or("--out: not a file name")?.to_string_lossy().into_owned();
    let settings = arguments.out.with_extension("json");
    let settings_name = settings.file_name().ok_or("--out: not a file name")?.to_string_lossy().into_owned();
    if settings_name == name {
        return Err("--out: the sweep is a WAV file; its settings take the name that ends in .json".into());
    }
    let folder = arguments.out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut out = OutputFolder::create(folder)?;
    out.write(&name, &encode_wav(&playback, SampleFormat::Int24)?)?;
    let text = serde_json::to_string_pretty(&Settings::from(config))? + "\n";
    out.write(&settings_name, text.as_bytes())?;
    out.finish()?;
    println!(
        "wrote {} ({:.1} s) and {}: play the one, keep the other for `sabine deconvolve`",
        arguments.out.display(),
        playback.duration_s(),
        settings.display()
    );
    Ok(())
}

impl From<SweepConfig> for Settings {
    fn from(config: SweepConfig) -> Self {
        let SweepConfig { sample_rate_hz, from_hz, to_hz, duration_s, fade_in_s, .. } = config;
        let SweepConfig { fade_out_s, silence_s, repetitions, peak, .. } = config;
        Self {
            sample_rate_hz,
            from_hz,
            to_hz,
            duration_s,
            fade_in_s,
            fade_out_s,
            silence_s,
            repetitions,
            peak,
        }
    }
}

/// The sweep of a file of settings.
///
/// # Errors
/// Names the file: what cannot be read, is no such file, or is out of range.
pub fn read_settings(path: &Path) -> Result<ExponentialSweep, Failure> {
    let bytes = read_at_most(path, LARGEST_SETTINGS)?;
    let settings: Settings = serde_json::from_slice(&bytes)
        .map_err(|error| format!("{}: no settings of a sweep: {error}", path.display()))?;
    let config = SweepConfig {
        sample_rate_hz: settings.sample_rate_hz,
        from_hz: settings.from_hz,
        to_hz: settings.to_hz,
        duration_s: settings.duration_s,
        fade_in_s: settings.fade_in_s,
        fade_out_s: settings.fade_out_s,
        silence_s: settings.silence_s,
        repetitions: settings.repetitions,
        peak: settings.peak,
    };
    ExponentialSweep::new(config).map_err(|error: Error| error.in_file(path, "settings").into())
}
