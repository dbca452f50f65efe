//! Makes a reverberant recording out of dry speech, a measured impulse response and noise, at a stated signal-to-noise ratio.

use crate::failure::Failure;
use crate::output::OutputFolder;
use clap::Args;
use sabine::acoustics::{
    AudioReader, BlockResampler, Channel, SampleFormat, Signal, WavWriter, read_response, resample,
};
use sabine::eqfilter::BlockConvolver;
use std::path::{Path, PathBuf};

/// Samples that are read at a time.
const BLOCK: usize = 1 << 16;
/// Longest part of the noise that is used, in seconds.
const LONGEST_NOISE_S: f64 = 600.0;
/// Largest magnitude of the reverberant speech.
const SPEECH_PEAK: f32 = 0.5;

/// Convolve speech with an impulse response and add noise.
#[derive(Args)]
pub struct Arguments {
    /// Dry speech; several files are played one after another
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    speech: Vec<PathBuf>,
    /// Impulse response; its first channel is used
    #[arg(long, value_name = "FILE")]
    response: PathBuf,
    /// Noise; the first ten minutes of its first channel are used, and repeated if they are too short
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
    let name = arguments.out.file_name().ok_or("--out: not a file name")?.to_string_lossy();
    let folder = arguments.out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let response = response(arguments)?;
    // Once for the peak and the power, once to write: an hour of speech does not fit into memory twice.
    let (mut peak, mut energy, mut samples) = (0.0_f32, 0.0_f64, 0_u64);
    reverberant(arguments, &response, &mut |block| {
        peak = block.iter().fold(peak, |peak, s| peak.max(s.abs()));
        energy += block.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>();
        samples += block.len() as u64;
        Ok(())
    })?;
    if peak <= 0.0 {
        return Err("the speech, heard through the response, is silent".into());
    }
    let scale = SPEECH_PEAK / peak;
    let power = energy / samples as f64 * f64::from(scale).powi(2);
    let noise = noise(arguments, power)?;
    let mut out = OutputFolder::create(folder)?;
    let mut writer = WavWriter::create(out.path_of(&name), 1, arguments.rate, SampleFormat::Int16)?;
    let mut noise = noise.iter().cycle();
    reverberant(arguments, &response, &mut |block| {
        for s in block.iter_mut() {
            *s = *s * scale + noise.next().copied().unwrap_or(0.0);
        }
        Ok(writer.write(block)?)
    })?;
    writer.finish()?;
    out.finish()?;
    Ok(())
}

/// The impulse response at the rate of the result.
fn response(arguments: &Arguments) -> Result<Signal, Failure> {
    let found = read_response(&arguments.response, Channel::Index(0))?.response;
    if found.peak() <= 0.0 {
        return Err(silent(&arguments.response));
    }
    Ok(resample(&found.into(), arguments.rate)?)
}

/// The noise at its level in the result; empty without noise.
fn noise(arguments: &Arguments, speech_power: f64) -> Result<Vec<f32>, Failure> {
    let Some(path) = &arguments.noise else { return Ok(Vec::new()) };
    let mut reader = AudioReader::open(path, Channel::Index(0))?;
    let mut samples = Vec::new();
    reader.read_block(&mut samples, (LONGEST_NOISE_S * f64::from(reader.sample_rate_hz())) as usize)?;
    let noise = resample(&Signal::new(samples, reader.sample_rate_hz())?, arguments.rate)?;
    let mut samples = noise.into_samples();
    let power = samples.iter().map(|s| f64::from(*s).powi(2)).sum::<f64>() / samples.len() as f64;
    if power <= 0.0 {
        return Err(silent(path));
    }
    let gain = (speech_power / power / 10f64.powf(arguments.snr / 10.0)).sqrt() as f32;
    samples.iter_mut().for_each(|s| *s *= gain);
    Ok(samples)
}

/// Hands the speech in the room over in blocks, as long as the dry speech.
fn reverberant(
    arguments: &Arguments,
    response: &Signal,
    take: &mut dyn FnMut(&mut [f32]) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut convolver = BlockConvolver::new(response.samples())?;
    let (mut block, mut dry, mut wet) = (Vec::new(), Vec::new(), Vec::new());
    // What the tail of the response adds after the speech is left out.
    let (mut taken, mut given) = (0, 0);
    for path in &arguments.speech {
        let mut reader = AudioReader::open(path, Channel::Index(0))?;
        let mut resampler = BlockResampler::new(reader.sample_rate_hz(), arguments.rate)?;
        let mut peak = 0.0_f32;
        while reader.read_block(&mut block, BLOCK)? > 0 {
            peak = block.iter().fold(peak, |peak, s| peak.max(s.abs()));
            dry.clear();
            resampler.push(&block, &mut dry)?;
            taken += dry.len();
            convolver.push(&dry, &mut wet);
            given += wet.len();
            take(&mut wet)?;
            wet.clear();
        }
        if peak <= 0.0 {
            return Err(silent(path));
        }
        dry.clear();
        resampler.finish(&mut dry)?;
        taken += dry.len();
        convolver.push(&dry, &mut wet);
    }
    convolver.finish(&mut wet);
    wet.truncate(taken - given);
    take(&mut wet)
}

fn silent(path: &Path) -> Failure {
    sabine::Error::Silent { recording: path.display().to_string(), peak: 0.0 }.into()
}
