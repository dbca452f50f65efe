//! Makes a reverberant recording out of dry speech, a measured impulse response and noise, at a stated signal-to-noise ratio.

use crate::failure::Failure;
use crate::output::OutputFolder;
use clap::Args;
use sabine::acoustics::{Channel, SampleFormat, Signal, encode_wav, read_audio, resample};
use sabine::eqfilter::convolve;
use std::path::{Path, PathBuf};

/// Convolve speech with an impulse response and add noise.
#[derive(Args)]
pub struct Arguments {
    /// Dry speech; several files are played one after another
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    speech: Vec<PathBuf>,
    /// Impulse response; its first channel is used
    #[arg(long, value_name = "FILE")]
    response: PathBuf,
    /// Noise; its first channel is used, and it is repeated if it is too short
    #[arg(long, value_name = "FILE")]
    noise: Option<PathBuf>,
    /// Energy of the reverberant speech over that of the noise, in dB
    #[arg(long, default_value_t = 20.0, allow_negative_numbers = true)]
    snr: f64,
    /// Sample rate of the result in Hz
    #[arg(long, default_value_t = 16_000)]
    rate: u32,
    /// The recording to be written
    #[arg(long, value_name = "F.wav")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let read = |path: &Path| -> Result<Signal, Failure> {
        Ok(resample(&read_audio(path, Channel::Index(0))?, arguments.rate)?)
    };
    let mut speech = Vec::new();
    for path in &arguments.speech {
        speech.extend_from_slice(read(path)?.samples());
    }
    let mut wet = convolve(&speech, read(&arguments.response)?.samples());
    wet.truncate(speech.len());
    let scale = 0.5 / wet.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    wet.iter_mut().for_each(|s| *s *= scale);
    if let Some(path) = &arguments.noise {
        let noise = read(path)?;
        let power = |samples: &[f32]| {
            samples.iter().map(|s| f64::from(*s).powi(2)).sum::<f64>() / samples.len() as f64
        };
        let gain = (power(&wet) / power(noise.samples()) / 10f64.powf(arguments.snr / 10.0)).sqrt() as f32;
        for (s, n) in wet.iter_mut().zip(noise.samples().iter().cycle()) {
            *s += gain * n;
        }
    }
    let folder = arguments.out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = arguments.out.file_name().ok_or("--out: not a file name")?.to_string_lossy();
    let mut out = OutputFolder::create(folder)?;
    out.write(&name, &encode_wav(&Signal::new(wet, arguments.rate)?, SampleFormat::Int16)?)?;
    out.finish()?;
    Ok(())
}
