//! One clip: speech in a room, noise on top, at a level; then features.

use crate::error::{Error, check, check_span};
use crate::noise::coloured_noise;
use rand::Rng;
use rand_pcg::Pcg64;
use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealToComplex};
use sabine_acoustics::RealTransforms;
use sabine_features::FeatureExtractor;
use sabine_features::{LogMel, LogMelConfig, LogMelScratch};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How clips are made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClipConfig {
    /// Length in seconds, 1 to 60. Default 4.
    pub duration_s: f64,
    /// Range of the ratio of reverberant speech to noise in dB, uniform. Default 0 to 40.
    pub snr_db: (f64, f64),
    /// Fraction of clips that are nearly clean. Default 0.1.
    pub clean_fraction: f64,
    /// Range of the ratio for these, in dB. Default 40 to 60.
    pub clean_snr_db: (f64, f64),
    /// Range of the level of the clip, root mean square re full scale, in dB. Default -45 to -10.
    pub level_db: (f64, f64),
    /// Fraction of clips whose noise is computed (a power law of random slope) instead of recorded. Default 0.4.
    pub computed_noise_fraction: f64,
    /// Least fraction of a clip in which somebody speaks, 0 to 1. Default 0.5.
    pub least_activity: f64,
}

impl Default for ClipConfig {
    fn default() -> Self {
        Self {
            duration_s: 4.0,
            snr_db: (0.0, 40.0),
            clean_fraction: 0.1,
            clean_snr_db: (40.0, 60.0),
            level_db: (-45.0, -10.0),
            computed_noise_fraction: 0.4,
            least_activity: 0.5,
        }
    }
}

impl ClipConfig {
    fn check(&self) -> Result<(), Error> {
        check("duration_s", self.duration_s, 1.0, 60.0, "between 1 and 60 s")?;
        check_span("snr_db", self.snr_db, -60.0, 120.0, "a rising range within -60 to 120 dB")?;
        check_span("clean_snr_db", self.clean_snr_db, -60.0, 120.0, "a rising range within -60 to 120 dB")?;
        check_span("level_db", self.level_db, -90.0, 0.0, "a rising range within -90 to 0 dB")?;
        check("clean_fraction", self.clean_fraction, 0.0, 1.0, "between 0 and 1")?;
        check("computed_noise_fraction", self.computed_noise_fraction, 0.0, 1.0, "between 0 and 1")?;
        check("least_activity", self.least_activity, 0.0, 1.0, "between 0 and 1")
    }
}

/// A transform of one length, both ways.
struct Plan {
    length: usize,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
}

/// Makes clips; planned once, used by any number of threads.
pub(crate) struct ClipMaker {
    config: ClipConfig,
    log_mel: LogMel,
    samples: usize,
    plans: Vec<Plan>,
}

/// The spectrum of a response, ready for any number of clips.
pub(crate) struct PreparedResponse {
    plan: usize,
    samples: usize,
    spectrum: Vec<Complex32>,
}

/// Working memory of a thread.
pub(crate) struct ClipScratch {
    log_mel: LogMelScratch,
    input: Vec<f32>,
    output: Vec<f32>,
    spectrum: Vec<Complex32>,
}

/// What is known of a clip besides its features.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClipFacts {
    /// Ratio of reverberant speech to noise, dB.
    pub(crate) snr_db: f64,
}

/// Speech with the moments in which somebody speaks.
#[derive(Clone, Debug)]
pub(crate) struct ActiveSpeech {
    pub(crate) samples: Vec<f32>,
    /// Number of active frames before each frame.
    active: Vec<u32>,
}

/// Frame of the activity, in samples at 16 kHz: 10 ms.
const ACTIVITY_FRAME: usize = 160;
/// Level below the loudest frame at which a frame counts as a pause, dB.
const ACTIVITY_RANGE_DB: f32 = 35.0;

impl ActiveSpeech {
    pub(crate) fn new(samples: Vec<f32>) -> Self {
        let energy: Vec<f32> =
            samples.chunks(ACTIVITY_FRAME).map(|frame| frame.iter().map(|s| s * s).sum()).collect();
        let threshold = energy.iter().copied().fold(0.0, f32::max) * 10f32.powf(-ACTIVITY_RANGE_DB / 10.0);
        let mut active = vec![0];
        let mut count = 0;
        for e in energy {
            count += u32::from(e > threshold);
            active.push(count);
        }
        Self { samples, active }
    }

    /// Fraction of active frames among `length` samples from `start`.
    pub(crate) fn activity(&self, start: usize, length: usize) -> f64 {
        let frames = self.active.len() - 1;
        let first = (start / ACTIVITY_FRAME).min(frames);
        let last = ((start + length) / ACTIVITY_FRAME).min(frames);
        f64::from(self.active[last] - self.active[first]) / (length / ACTIVITY_FRAME).max(1) as f64
    }
}

impl ClipMaker {
    pub(crate) fn new(config: ClipConfig, longest_response_s: f64) -> Result<Self, Error> {
        config.check()?;
        let log_mel = LogMel::new(LogMelConfig::default())
            .map_err(|e| sabine_acoustics::Error::implementation("log-mel features", e))?;
        let rate = f64::from(log_mel.sample_rate_hz());
        let samples = (config.duration_s * rate).round() as usize;
        let longest = samples + (longest_response_s * rate).ceil() as usize + 1;
        let mut plans = Vec::new();
        // Lengths 2^k {4 5 6 7}/4: a quarter of the work saved for short responses.
        let mut base = samples.next_power_of_two() / 2;
        while plans.last().is_none_or(|p: &Plan| p.length < longest) {
            for quarter in 4..8 {
                let length = base / 4 * quarter;
                if length > samples {
                    let RealTransforms { forward, inverse } = RealTransforms::<f32>::new(length);
                    plans.push(Plan { length, forward, inverse });
                }
            }
            base *= 2;
        }
        Ok(Self { config, log_mel, samples, plans })
    }

    pub(crate) fn sample_rate_hz(&self) -> u32 {
        self.log_mel.sample_rate_hz()
    }

    pub(crate) fn mels(&self) -> usize {
        self.log_mel.features()
    }

    pub(crate) fn frames(&self) -> usize {
        self.log_mel.frames(self.samples)
    }

    pub(crate) fn scratch(&self) -> ClipScratch {
        ClipScratch {
            log_mel: self.log_mel.scratch(),
            input: Vec::new(),
            output: Vec::new(),
            spectrum: Vec::new(),
        }
    }

    /// Transforms a response. What exceeds the longest length set up is cut off.
    pub(crate) fn prepare(&self, response: &[f32]) -> Result<PreparedResponse, Error> {
        let last = self.plans.len() - 1;
        let plan = self.plans.iter().position(|p| p.length >= self.samples + response.len()).unwrap_or(last);
        let length = self.plans[plan].length;
        let samples = response.len().min(length - self.samples);
        let mut padded = vec![0.0; length];
        padded[..samples].copy_from_slice(&response[..samples]);
        let mut spectrum = self.plans[plan].forward.make_output_vec();
        self.plans[plan].forward.process(&mut padded, &mut spectrum)?;
        let scale = 1.0 / length as f32;
        spectrum.iter_mut().for_each(|s| *s *= scale);
        Ok(PreparedResponse { plan, samples, spectrum })
    }

    /// Draws a moment of the speech in which enough is said, else the best of twelve.
    fn moment(&self, rng: &mut Pcg64, speech: &ActiveSpeech) -> usize {
        let latest = speech.samples.len().saturating_sub(self.samples);
        let mut best = (f64::NEG_INFINITY, 0);
        for _ in 0..12 {
            let start = rng.random_range(0..=latest);
            let activity = speech.activity(start, self.samples);
            if activity >= self.config.least_activity {
                return start;
            }
            if activity > best.0 {
                best = (activity, start);
            }
        }
        best.1
    }

    /// Makes a clip and writes its features to `features` (`mels * frames`, row by row).
    pub(crate) fn make(
        &self,
        rng: &mut Pcg64,
        speech: &ActiveSpeech,
        response: &PreparedResponse,
        noises: &[&[f32]],
        scratch: &mut ClipScratch,
        features: &mut [f32],
    ) -> Result<ClipFacts, Error> {
        let start = self.moment(rng, speech);
        self.reverberate(speech, start, response, scratch)?;
        // The wrapped-around part lies before the clip.
        let skip = response.samples;
        let clip = &mut scratch.output[skip..skip + self.samples];
        let speech_power = power(clip);

        let clean = rng.random::<f64>() < self.config.clean_fraction;
        let span = if clean { self.config.clean_snr_db } else { self.config.snr_db };
        let snr_db = rng.random_range(span.0..=span.1);
        let noise = self.noise(rng, noises)?;
        let noise_gain = (speech_power / power(&noise).max(1e-30) * 10f64.powf(-snr_db / 10.0)).sqrt() as f32;
        for (c, n) in clip.iter_mut().zip(&noise) {
            *c += noise_gain * n;
        }
        let level_db = rng.random_range(self.config.level_db.0..=self.config.level_db.1);
        let gain = (10f64.powf(level_db / 10.0) / power(clip).max(1e-30)).sqrt() as f32;
        clip.iter_mut().for_each(|c| *c *= gain);
        self.log_mel
            .extract_into(clip, &mut scratch.log_mel, features)
            .map_err(|e| sabine_acoustics::Error::implementation("log-mel features", e))?;
        Ok(ClipFacts { snr_db })
    }

    /// Convolves the moment and what was said before it; the output holds the clip after `response.samples` samples.
    fn reverberate(
        &self,
        speech: &ActiveSpeech,
        start: usize,
        response: &PreparedResponse,
        scratch: &mut ClipScratch,
    ) -> Result<(), Error> {
        let plan = &self.plans[response.plan];
        scratch.input.clear();
        scratch.input.resize(plan.length, 0.0);
        scratch.output.resize(plan.length, 0.0);
        scratch.spectrum.resize(plan.length / 2 + 1, Complex32::new(0.0, 0.0));
        // Input position `response.samples` is the start of the moment.
        let from = start.saturating_sub(response.samples);
        let to = (start + self.samples).min(speech.samples.len());
        let at = response.samples - (start - from);
        scratch.input[at..at + (to - from)].copy_from_slice(&speech.samples[from..to]);
        plan.forward.process(&mut scratch.input, &mut scratch.spectrum)?;
        for (s, h) in scratch.spectrum.iter_mut().zip(&response.spectrum) {
            *s *= h;
        }
        if let Some(first) = scratch.spectrum.first_mut() {
            first.im = 0.0;
        }
        if let Some(last) = scratch.spectrum.last_mut() {
            last.im = 0.0;
        }
        plan.inverse.process(&mut scratch.spectrum, &mut scratch.output)?;
        Ok(())
    }

    /// Noise for a clip: recorded, from a random moment of a random track and round its end; or computed.
    fn noise(&self, rng: &mut Pcg64, noises: &[&[f32]]) -> Result<Vec<f32>, Error> {
        if !noises.is_empty() && rng.random::<f64>() >= self.config.computed_noise_fraction {
            for _ in 0..8 {
                let track = noises[rng.random_range(0..noises.len())];
                let from = rng.random_range(0..track.len());
                let noise: Vec<f32> =
                    track[from..].iter().chain(track.iter().cycle()).take(self.samples).copied().collect();
                if power(&noise) > 1e-12 {
                    return Ok(noise);
                }
            }
        }
        coloured_noise(rng, self.samples, &self.plans[0].forward, &self.plans[0].inverse)
    }
}

fn power(samples: &[f32]) -> f64 {
    samples.iter().map(|s| f64::from(s * s)).sum::<f64>() / samples.len().max(1) as f64
}
