//! What is heard in the rooms: talkers, noise, music, and what becomes of it on the way.

use crate::error::Error;
use crate::rooms::RATE_HZ;
use rand::Rng;
use rand::rngs::SmallRng;
use sabine::acoustics::{Channel, Signal, read_audio, resample};
use sabine::augment::{DatasetBuilder, DatasetConfig, DatasetSources, NoiseCorpus, Partition, SpeechCorpus};
use std::collections::BTreeMap;
use std::f32::consts::TAU;
use std::path::Path;

/// Seed of the data set that the released weights were trained on (`docs/model_card.md`): it divides speakers and noise.
const TRAINING_SEED: u64 = 20_261_121;

/// Speech by speaker, and noise, of some parts of the training data set.
pub struct Sounds {
    pub talkers: Vec<(String, Vec<Vec<f32>>)>,
    pub noise: Vec<Vec<f32>>,
}

impl Sounds {
    /// Speakers of one part and noise of some.
    ///
    /// # Errors
    /// [`Error::Missing`]; what cannot be read.
    pub fn read(data: &Path, speakers: Partition, noises: &[Partition]) -> Result<Self, Error> {
        let (speech, noise) = (data.join("speech"), data.join("noise"));
        for path in [&speech, &noise] {
            if !path.exists() {
                return Err(Error::Missing { path: path.clone() });
            }
        }
        let config =
            DatasetConfig { seed: TRAINING_SEED, measured_fraction: [0.0; 3], ..DatasetConfig::default() };
        let corpus = SpeechCorpus::read(&speech, RATE_HZ, config.clip.duration_s, &())?;
        let spoken: Vec<(String, Vec<f32>)> =
            corpus.utterances().map(|(speaker, samples)| (speaker.to_owned(), samples.to_vec())).collect();
        let noise_corpus = NoiseCorpus::read(&noise, RATE_HZ, &())?;
        let sources = DatasetSources { speech: corpus, noise: noise_corpus, ..DatasetSources::default() };
        let dealt = DatasetBuilder::new(config, sources)?;
        let mut talkers: BTreeMap<String, Vec<Vec<f32>>> = BTreeMap::new();
        for (speaker, samples) in spoken {
            if dealt.speaker_partitions().get(&speaker) == Some(&speakers) {
                let peak = samples.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
                talkers.entry(speaker).or_default().push(samples.iter().map(|s| s / peak).collect());
            }
        }
        let noise = dealt
            .noise_partitions()
            .iter()
            .filter(|(_, part)| noises.contains(part))
            .map(|(track, _)| {
                Ok(resample(&read_audio(noise.join(track), Channel::Index(0))?, RATE_HZ)?.into_samples())
            })
            .collect::<Result<_, Error>>()?;
        Ok(Self { talkers: talkers.into_iter().collect(), noise })
    }

    /// A speaker's words for so many samples, from a random moment on.
    pub fn speech(&self, talker: usize, samples: usize, rng: &mut SmallRng) -> Vec<f32> {
        let utterances = &self.talkers[talker % self.talkers.len()].1;
        let all: Vec<f32> = utterances.iter().flatten().copied().collect();
        let start = rng.random_range(0..all.len().saturating_sub(samples).max(1));
        all.iter().cycle().skip(start).take(samples).copied().collect()
    }

    /// Recorded noise, or in four of ten cases computed noise whose spectrum falls by 0 to 9 dB per octave.
    pub fn noise(&self, samples: usize, rng: &mut SmallRng) -> Vec<f32> {
        if rng.random::<f32>() < 0.4 {
            return coloured(samples, rng);
        }
        let track = &self.noise[rng.random_range(0..self.noise.len())];
        let start = rng.random_range(0..track.len());
        track.iter().cycle().skip(start).take(samples).copied().collect()
    }
}

/// White noise through two one-pole low-passes in a random mixture.
fn coloured(samples: usize, rng: &mut SmallRng) -> Vec<f32> {
    let (share, pole) = (rng.random::<f32>(), rng.random_range(0.7f32..0.99));
    let (mut one, mut two) = (0.0f32, 0.0f32);
    (0..samples)
        .map(|_| {
            let white = rng.random_range(-1.0f32..1.0);
            one = pole * one + (1.0 - pole) * white;
            two = pole * two + (1.0 - pole) * one;
            share * 0.05 * white + (1.0 - share) * (one + 2.0 * two)
        })
        .collect()
}

/// Music made of harmonic notes in chords, with drums in half of it. `plucked` strings (Karplus and Strong 1983) are a kind of
/// their own, so that a warning can be tested on music other than that it was fitted to.
pub fn music(samples: usize, plucked: bool, rng: &mut SmallRng) -> Vec<f32> {
    let mut sound = vec![0.0f32; samples + 4 * RATE_HZ as usize];
    let beat = (RATE_HZ as f32 * rng.random_range(0.15f32..0.8)) as usize;
    let voices = rng.random_range(1..5);
    let root = rng.random_range(80.0f32..300.0);
    let (attack_s, decay_s) = (rng.random_range(0.003f32..0.1), rng.random_range(0.1f32..2.0));
    let (slope, vibrato) = (rng.random_range(0.6f32..2.0), rng.random_range(0.0f32..0.006));
    let drums = rng.random::<f32>() < 0.5;
    let scale = [0, 2, 4, 5, 7, 9, 11, 12, 14, 16, 19, 24];
    let mut at = 0;
    while at < samples {
        for _ in 0..voices {
            let step = scale[rng.random_range(0..scale.len())];
            let hz = root * 2f32.powf(step as f32 / 12.0);
            let loud = rng.random_range(0.3f32..1.0);
            if plucked {
                pluck(&mut sound[at..], hz, decay_s, loud, rng);
            } else {
                note(&mut sound[at..], hz, loud, [attack_s, decay_s, slope, vibrato]);
            }
        }
        if drums {
            let fall_s = rng.random_range(0.02f32..0.15);
            for (n, s) in sound[at..].iter_mut().take(RATE_HZ as usize / 2).enumerate() {
                *s += rng.random_range(-1.0f32..1.0) * (-(n as f32) / (fall_s * RATE_HZ as f32)).exp();
            }
        }
        at += beat * rng.random_range(1..4);
    }
    sound.truncate(samples);
    sound
}

fn note(sound: &mut [f32], hz: f32, loud: f32, [attack_s, decay_s, slope, vibrato]: [f32; 4]) {
    let rate = RATE_HZ as f32;
    for (n, s) in sound.iter_mut().take((3.0 * decay_s * rate) as usize).enumerate() {
        let t = n as f32 / rate;
        let envelope = (t / attack_s).min(1.0) * (-t / decay_s).exp();
        let phase = TAU * hz * (t + vibrato * (TAU * 5.5 * t).sin() / (TAU * 5.5));
        let harmonics = (1..12).take_while(|k| *k as f32 * hz < 7500.0);
        *s += loud
            * envelope
            * harmonics.map(|k| (k as f32 * phase).sin() / (k as f32).powf(slope)).sum::<f32>();
    }
}

fn pluck(sound: &mut [f32], hz: f32, decay_s: f32, loud: f32, rng: &mut SmallRng) {
    let period = (RATE_HZ as f32 / hz) as usize;
    let mut line: Vec<f32> = (0..period).map(|_| loud * rng.random_range(-1.0f32..1.0)).collect();
    let keep = 10f32.powf(-3.0 / (3.0 * decay_s * hz));
    for (n, s) in sound.iter_mut().take((3.0 * decay_s * RATE_HZ as f32) as usize).enumerate() {
        let k = n % period;
        *s += line[k];
        line[k] = 0.5 * keep * (line[k] + line[(k + 1) % period]);
    }
}

/// Adds noise so far below, in dB of power over the whole.
pub fn add_noise(sound: &mut [f32], noise: &[f32], snr_db: f64) {
    let power = |x: &[f32]| x.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>();
    let gain = (power(sound) / power(noise).max(1e-30) / 10f64.powf(snr_db / 10.0)).sqrt() as f32;
    sound.iter_mut().zip(noise).for_each(|(s, n)| *s += gain * n);
}

/// As a file of 16 bits with this peak.
pub fn quantised(mut sound: Vec<f32>, peak: f32) -> Vec<f32> {
    let found = sound.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    sound.iter_mut().for_each(|s| *s = (*s * peak / found * 32767.0).round() / 32768.0);
    sound
}

/// Cut off at a share of the peak.
pub fn clipped(mut sound: Vec<f32>, share: f32) -> Vec<f32> {
    let limit = share * sound.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    sound.iter_mut().for_each(|s| *s = s.clamp(-limit, limit));
    sound
}

/// At another sample rate and back.
///
/// # Errors
/// What resampling refuses.
pub fn through_rate(
    sound: &[f32],
    rate_hz: u32,
    change: impl FnOnce(Vec<f32>) -> Vec<f32>,
) -> Result<Vec<f32>, Error> {
    let there = resample(&Signal::new(sound.to_vec(), RATE_HZ)?, rate_hz)?.into_samples();
    let mut back = resample(&Signal::new(change(there), rate_hz)?, RATE_HZ)?.into_samples();
    back.resize(sound.len(), 0.0);
    Ok(back)
}

/// A telephone: 8 kHz, no bass, eight bits of mu-law (ITU-T G.711).
///
/// # Errors
/// What resampling refuses.
pub fn telephone(sound: &[f32]) -> Result<Vec<f32>, Error> {
    through_rate(sound, 8_000, |mut sound| {
        // Two one-pole high-passes at 250 Hz.
        for _ in 0..2 {
            let pole = (-TAU * 250.0 / 8000.0).exp();
            let (mut before, mut out) = (0.0f32, 0.0f32);
            for s in &mut sound {
                out = pole * (out + *s - before);
                before = *s;
                *s = out;
            }
        }
        let peak = sound.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
        let law = |s: f32| (s.abs() / peak * 255.0).ln_1p() / 256f32.ln();
        sound
            .iter()
            .map(|s| s.signum() * peak * (((law(*s) * 127.0).round() / 127.0 * 256f32.ln()).exp_m1() / 255.0))
            .collect()
    })
}
