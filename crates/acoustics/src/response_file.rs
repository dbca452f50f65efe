//! An impulse response from a file: found in it, and told apart from speech and music.

use crate::audio::{AudioReader, Channel};
use crate::error::Error;
use crate::signal::ImpulseResponse;
use std::path::Path;

/// Longest part of a file that is taken for the response, in seconds: twice the reverberation of the largest cathedrals and
/// time to see the noise after it.
const LONGEST_S: f64 = 60.0;
/// What is kept before the first sound of a longer file, in seconds.
const BEFORE_S: f64 = 1.0;
/// Blocks in which the level is judged, in seconds; it is averaged over three of them.
const BLOCK_S: f64 = 0.02;
/// A burst of sound comes within this of the loudest, in dB (ISO 3382-1 finds the onset so).
const WITHIN_DB: f32 = 20.0;
/// A burst rises by this over what was before it since the last one, in dB. The level of a syllable varies so; that of a
/// decay smoothed over 60 ms does not, apart from echoes.
const RISE_DB: f32 = 10.0;
/// Bursts from which a file is no response: the loudest sound of a response comes once, a distinct echo or two may follow.
const TOO_MANY: usize = 4;

/// A response and where it was in its file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LocatedResponse {
    /// The whole file if it lasts up to a minute, else the minute from one second before the first sound on.
    pub response: ImpulseResponse,
    /// Time in the file of the first sample of the response, in seconds.
    pub start_s: f64,
    /// Length of the file, in seconds.
    pub file_duration_s: f64,
    /// Times in the file at which a burst of sound begins, in seconds: one, or none where the level never falls. Two or three
    /// are echoes, or several responses in one file, which are measured as one.
    pub bursts_s: Vec<f64>,
}

/// Reads an impulse response from an audio file of any length, the formats being those of [`read_audio`](crate::read_audio).
///
/// A response has one onset and a decay (ISO 3382-1, 5.3); the level of speech rises and falls some four times a second
/// (Houtgast and Steeneken 1985), that of music from note to note. Counted are bursts of sound: times at which the
/// level over 60 ms comes within 20 dB of the loudest, at least 10 dB above the lowest level since the burst before. A file with
/// four or more of them is no response. Speech in a very reverberant room, a few seconds of it, may show fewer.
///
/// The file is read twice, block by block: memory is bounded by the minute that is kept.
///
/// ```
/// use sabine_acoustics::{Channel, SampleFormat, read_response, write_wav};
/// let path = std::env::temp_dir().join(format!("sabine_response_{}.wav", std::process::id()));
/// // Silence of 100 s, then a decay: what is kept begins a second before the 60 ms in which it begins.
/// let samples: Vec<f32> =
///     (0..101_000).map(|i: i32| if i < 100_000 { 0.0 } else { (-0.01 * (i - 100_000) as f32).exp() }).collect();
/// write_wav(&path, &samples, 1000, SampleFormat::Float32)?;
/// let found = read_response(&path, Channel::Mono)?;
/// assert_eq!((found.start_s, found.response.duration_s(), found.file_duration_s), (98.96, 2.04, 101.0));
/// # std::fs::remove_file(&path).ok();
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
///
/// # Errors
/// [`Error::InFile`] with the cause [`Error::NotAResponse`], and as [`read_audio`](crate::read_audio).
pub fn read_response(path: impl AsRef<Path>, channel: Channel) -> Result<LocatedResponse, Error> {
    let path = path.as_ref();
    let mut reader = AudioReader::open(path, channel)?;
    let rate_hz = reader.sample_rate_hz();
    let rate = f64::from(rate_hz);
    let block = ((BLOCK_S * rate) as usize).max(1);
    let mut power = Vec::new();
    let mut samples = Vec::new();
    while reader.read_block(&mut samples, block)? > 0 {
        power.push(block_power(&samples, block));
    }
    let file_duration_s = reader.position() as f64 / rate;
    let starts = bursts(&levels_db(&power));
    check_bursts(starts.len(), file_duration_s).map_err(|error| error.in_file(path, "samples"))?;
    let seconds = |index: usize| index as f64 * block as f64 / rate;
    let bursts_s: Vec<f64> = starts.iter().map(|&start| seconds(start)).collect();
    let (mut start, mut most) = (0, u64::MAX);
    if file_duration_s > LONGEST_S {
        let before = ((BEFORE_S / BLOCK_S) as usize).saturating_add(1);
        start = (starts.first().map_or(0, |first| first.saturating_sub(before)) * block) as u64;
        most = (LONGEST_S * rate) as u64;
    }
    let mut reader = AudioReader::open(path, channel)?;
    reader.skip(start)?;
    let (mut samples, mut piece) = (Vec::new(), Vec::new());
    while (samples.len() as u64) < most {
        let wanted = (most - samples.len() as u64).min(1 << 16) as usize;
        if reader.read_block(&mut piece, wanted)? == 0 {
            break;
        }
        samples.extend_from_slice(&piece);
    }
    let response = ImpulseResponse::new(samples, rate_hz).map_err(|error| error.in_file(path, "samples"))?;
    Ok(LocatedResponse { response, start_s: start as f64 / rate, file_duration_s, bursts_s })
}

/// That a sound may be an impulse response by the number of its bursts: the rule of [`read_response`].
///
/// # Errors
/// [`Error::NotAResponse`].
pub fn check_one_onset(samples: &[f32], sample_rate_hz: u32) -> Result<(), Error> {
    let rate = f64::from(sample_rate_hz);
    let block = ((BLOCK_S * rate) as usize).max(1);
    let power: Vec<f64> = samples.chunks(block).map(|chunk| block_power(chunk, block)).collect();
    check_bursts(bursts(&levels_db(&power)).len(), samples.len() as f64 / rate)
}

fn check_bursts(bursts: usize, duration_s: f64) -> Result<(), Error> {
    if bursts < TOO_MANY { Ok(()) } else { Err(Error::NotAResponse { bursts, duration_s }) }
}

fn block_power(samples: &[f32], block: usize) -> f64 {
    samples.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>() / block as f64
}

/// Level of each block in dB, averaged over itself and its neighbours.
fn levels_db(power: &[f64]) -> Vec<f32> {
    let around = |i: usize| &power[i.saturating_sub(1)..(i + 2).min(power.len())];
    let level = |i: usize| 10.0 * (around(i).iter().sum::<f64>() / 3.0 + f64::MIN_POSITIVE).log10();
    (0..power.len()).map(|i| level(i) as f32).collect()
}

/// First blocks of the bursts of sound.
fn bursts(levels_db: &[f32]) -> Vec<usize> {
    let loudest = levels_db.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut starts = Vec::new();
    // The level before the file begins is none.
    let (mut lowest, mut highest, mut in_burst) = (f32::NEG_INFINITY, f32::NEG_INFINITY, false);
    for (i, &level) in levels_db.iter().enumerate() {
        if in_burst {
            highest = highest.max(level);
            in_burst = level >= highest - RISE_DB;
            lowest = level;
        } else {
            lowest = lowest.min(level);
            if level > loudest - WITHIN_DB && level > lowest + RISE_DB {
                (in_burst, highest) = (true, level);
                starts.push(i);
            }
        }
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decays_are_one_burst_and_syllables_many() {
        let decay = |i: usize, from: usize| if i < from { -90.0 } else { -0.6 * (i - from) as f32 };
        let levels = |level: &dyn Fn(usize) -> f32| (0..500).map(level).collect::<Vec<f32>>();
        assert_eq!(bursts(&levels(&|i| decay(i, 50))), [50]);
        assert_eq!(bursts(&levels(&|i| decay(i, 0).max(-25.0))), [0]);
        assert_eq!(bursts(&levels(&|_| -20.0)), [0]);
        let echo = levels(&|i| decay(i, 50).max(decay(i, 120) - 12.0));
        assert_eq!(bursts(&echo), [50, 120]);
        let syllables = levels(&|i| -0.8 * (i % 25) as f32 - (i / 25 % 3) as f32);
        assert!(bursts(&syllables).len() > 10);
    }
}
