//! Speech and noise for the recordings: talkers that the estimator was not trained on.

use crate::error::Error;
use sabine::acoustics::{Channel, ImpulseResponse, Signal, read_audio, resample, resample_response};
use sabine::augment::{DatasetBuilder, DatasetConfig, DatasetSources, NoiseCorpus, Partition, SpeechCorpus};
use sabine::eqfilter::convolve;
use std::path::Path;

/// Seed of the data set that the released weights were trained on (`docs/model_card.md`): it divides speakers and noise.
const TRAINING_SEED: u64 = 20_261_121;
/// Rate of the recordings, in Hz: what the estimator hears.
const RATE_HZ: u32 = 16_000;
/// Length of a recording, in seconds.
const RECORDING_S: f64 = 30.0;
/// Shortest utterance that is used, in samples: 4 s.
const SHORTEST: usize = 4 * RATE_HZ as usize;
/// Length of the dry voice in the sound examples, in seconds.
const DRY_S: f64 = 6.0;
/// Power of the speech over that of the noise, in dB.
pub const SNR_DB: f64 = 20.0;
/// The track of noise, below the folder of noise.
const NOISE: &str = "blanket/coffee-shop.ogg";
/// Recordings begin this far from each other in the noise, in seconds: no divisor of its length.
const NOISE_STEP_S: f64 = 7.3;

/// What recordings are made of.
pub struct Speech {
    utterances: Vec<Signal>,
    noise: Signal,
    /// How many speakers there are in all, and in the test.
    pub speakers: (usize, usize),
    /// How many utterances the recordings are made of.
    pub utterance_count: usize,
    /// Part of the training data set that the noise was dealt to.
    pub noise_partition: Partition,
    /// A voice without reverberation, for the examples.
    pub dry: Signal,
}

impl Speech {
    /// Reads the speech of all speakers that were dealt to the test when the released weights were trained.
    ///
    /// # Errors
    /// [`Error::Missing`]; what cannot be read.
    pub fn read(data: &Path) -> Result<Self, Error> {
        let (speech, noise) = (data.join("speech"), data.join("noise"));
        for path in [speech.clone(), noise.join(NOISE)] {
            if !path.exists() {
                return Err(Error::Missing { path });
            }
        }
        let config =
            DatasetConfig { seed: TRAINING_SEED, measured_fraction: [0.0; 3], ..DatasetConfig::default() };
        let speech = SpeechCorpus::read(&speech, RATE_HZ, config.clip.duration_s, &())?;
        let long_enough = speech.utterances().filter(|(_, samples)| samples.len() >= SHORTEST);
        let spoken: Vec<(String, Vec<f32>)> =
            long_enough.map(|(speaker, samples)| (speaker.to_owned(), samples.to_vec())).collect();
        let noise_corpus = NoiseCorpus::read(&noise, RATE_HZ, &())?;
        let sources = DatasetSources { speech, noise: noise_corpus, ..DatasetSources::default() };
        let dealt = DatasetBuilder::new(config, sources)?;
        let is_test = |name: &str| dealt.speaker_partitions().get(name) == Some(&Partition::Test);
        let mut utterances: Vec<Signal> = spoken
            .into_iter()
            .filter(|(speaker, _)| is_test(speaker))
            .map(|(_, samples)| Signal::new(samples, RATE_HZ))
            .collect::<Result<_, _>>()?;
        let test = dealt.speaker_partitions().values().filter(|part| **part == Partition::Test).count();
        let dry = utterances.pop().ok_or(Error::Nothing { what: "speech for the test".into() })?;
        let kept = dry.samples().len().min((DRY_S * f64::from(RATE_HZ)) as usize);
        let dry = resample(&Signal::new(dry.samples()[..kept].to_vec(), RATE_HZ)?, 48_000)?;
        let noise_partition =
            *dealt.noise_partitions().get(NOISE).ok_or(Error::Nothing { what: NOISE.into() })?;
        Ok(Self {
            speakers: (dealt.speaker_partitions().len(), test),
            utterance_count: utterances.len(),
            utterances,
            noise: resample(&read_audio(noise.join(NOISE), Channel::Index(0))?, RATE_HZ)?,
            noise_partition,
            dry,
        })
    }

    /// The `number`-th recording: 30 s of speech, one speaker after another, through the response, in noise.
    ///
    /// # Errors
    /// [`Error::Nothing`] without speech; what resampling refuses.
    pub fn recording(&self, number: usize, response: &ImpulseResponse) -> Result<Signal, Error> {
        let response = resample_response(response, RATE_HZ)?;
        let length = (RECORDING_S * f64::from(RATE_HZ)) as usize;
        let mut dry: Vec<f32> = Vec::with_capacity(length);
        // Three utterances fill a recording: the next one begins with the speaker after them.
        let mut next = 3 * number;
        while dry.len() < length {
            let count = self.utterances.len().max(1);
            let utterance = self
                .utterances
                .get(next % count)
                .ok_or(Error::Nothing { what: "speech for the test".into() })?;
            dry.extend_from_slice(utterance.samples());
            next += 1;
        }
        dry.truncate(length);
        let mut wet = convolve(&dry, response.samples());
        wet.truncate(length);
        let start = (number as f64 * NOISE_STEP_S * f64::from(RATE_HZ)) as usize;
        let noise: Vec<f32> = self
            .noise
            .samples()
            .iter()
            .cycle()
            .skip(start % self.noise.samples().len())
            .copied()
            .take(length)
            .collect();
        let power = |x: &[f32]| x.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>();
        let gain = (power(&wet) / power(&noise) / 10f64.powf(SNR_DB / 10.0)).sqrt() as f32;
        wet.iter_mut().zip(&noise).for_each(|(s, n)| *s += gain * n);
        let peak = wet.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
        wet.iter_mut().for_each(|s| *s *= 0.5 / peak);
        Ok(Signal::new(wet, RATE_HZ)?)
    }
}
