//! The features that the estimator hears, as they come in: log-mel levels of a stream in blocks of 20 ms, drawn as text.
//!
//! ```text
//! cargo run --example log_mel [-- RECORDING.wav]
//! ```
//!
//! One line for each half second, low frequencies on the left, 5 dB for each step of grey. It prints
//! ```text
//!   0.0 s |:                               |
//!   0.5 s |-#%%*-::.        -*++++=- .     |
//!   1.0 s |**@@%*--:. .----=-.== -::       |
//!   1.5 s |=**#%%#####==-.   -=:.-::.      |
//! ...
//! 1004 frames of 32 bands, 8 ms apart
//! the stream and the whole file give the same numbers: true
//! ```
//!
//! What is made of them: `sabine estimate RECORDING.wav`. The definition and how exact it is: the front page of `sabine::features`.

use sabine::acoustics::{Channel, read_audio, resample};
use sabine::features::FeatureExtractor;
use sabine::features::{LogMel, LogMelConfig};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Greys, the darkest for what is 45 dB or more below the loudest.
const GREYS: &[u8; 10] = b" .:-=+*#%@";

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let file = std::env::args_os().nth(1).map(PathBuf::from);
    let file = file.unwrap_or_else(|| fixtures.join("speech/recording.wav"));
    let config = LogMelConfig::default();
    let speech = resample(&read_audio(&file, Channel::Mono)?, config.sample_rate_hz)?;

    // Nothing is allocated in here: this may run where sound is recorded.
    let log_mel = LogMel::new(config.clone())?;
    let mut stream = log_mel.stream();
    let mut frames: Vec<Vec<f32>> = Vec::new();
    for block in speech.samples().chunks(320) {
        stream.push(block, |levels_db| frames.push(levels_db.to_vec()));
    }

    let hop_s = config.hop as f64 / f64::from(config.sample_rate_hz);
    let step = (0.5 / hop_s).round() as usize;
    let loudest_db = frames.iter().flatten().copied().fold(f32::NEG_INFINITY, f32::max);
    for (i, frame) in frames.iter().enumerate().step_by(step).take(16) {
        let grey = |db: &f32| char::from(GREYS[9 - ((loudest_db - db) / 5.0).clamp(0.0, 9.0) as usize]);
        println!("{:>5.1} s |{}|", i as f64 * hop_s, frame.iter().map(grey).collect::<String>());
    }

    let whole = log_mel.extract(speech.samples());
    let same = frames.iter().enumerate().all(|(t, frame)| frame.iter().eq(whole.column(t)));
    println!("{} frames of {} bands, {:.0} ms apart", frames.len(), config.mels, 1e3 * hop_s);
    println!("the stream and the whole file give the same numbers: {same}");
    Ok(())
}
