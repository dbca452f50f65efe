//! From a recording to the targets of a room.

use crate::Error;
use crate::labels::{LABEL_COUNT, T60_COUNT, label_hz, per_band};
use crate::layout::Normalisation;
use crate::model::Model;
use crate::network::{Network, Scratch, spectrum};
use crate::warning::Warning;
use crate::windows::{Loudness, clipped_share, first_frames};
use ndarray::{ArrayView2, Axis, Slice};
use rayon::prelude::*;
use sabine_acoustics::{FeatureExtractor, RoomEstimator, RoomTargets, Signal, resample};
use sabine_features::LogMel;
use std::path::Path;

/// The weights that come with the crate.
const PRETRAINED: &[u8] = include_bytes!("../weights/room.safetensors");
/// Least length of a recording in seconds.
pub const LEAST_DURATION_S: f64 = 1.0;
/// Peak below which a recording is silent; full scale is 1 (the last bit of 24-bit samples is 1.2e-7).
const SILENT_PEAK: f32 = 1e-6;
/// Share of samples on flat tops above which a recording counts as clipped.
const CLIPPED_SHARE: f64 = 1e-4;

/// The network with everything around it: a recording in, reverberation time and equalisation with standard errors out.
#[derive(Clone, Debug)]
pub struct Estimator {
    model: Model,
    network: Network,
    extractor: LogMel,
}

/// What one window says, on the scale of the network.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WindowOutput {
    /// Standardised labels.
    pub mean: Vec<f64>,
    /// Their calibrated standard deviations.
    pub deviation: Vec<f64>,
    /// How unlike the training set the window is.
    pub novelty: f64,
}

/// What one window of a recording says.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowEstimate {
    /// Its beginning in seconds.
    pub start_s: f64,
    /// Its targets.
    pub targets: RoomTargets,
    /// Its share in the joint estimate, 0..=1; 0 without speech.
    pub weight: f64,
}

/// An estimate with all that is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct DetailedEstimate {
    /// The joint estimate of all windows.
    pub targets: RoomTargets,
    /// The windows that it is made of, in order.
    pub windows: Vec<WindowEstimate>,
    /// Reasons to trust it less.
    pub warnings: Vec<Warning>,
}

impl Estimator {
    /// An estimator from a model.
    ///
    /// # Errors
    /// [`Error::Weights`] if there is no extractor for its features.
    pub fn new(model: Model) -> Result<Self, Error> {
        let extractor = model.layout.extractor()?;
        Ok(Self { network: Network::new(&model.parameters), extractor, model })
    }

    /// The estimator with the weights that come with the crate: `docs/model_card.md` says what they were trained on and how
    /// far they can be trusted.
    ///
    /// # Errors
    /// [`Error::Weights`] if the file in the crate was replaced by one that does not fit.
    pub fn pretrained() -> Result<Self, Error> {
        Self::new(Model::from_safetensors("of the crate", PRETRAINED)?)
    }

    /// An estimator from the bytes of a weights file.
    ///
    /// # Errors
    /// [`Error::Weights`] with the reason why they do not fit.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, Error> {
        Self::new(Model::from_safetensors("in memory", bytes)?)
    }

    /// An estimator from a weights file.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Weights`] with the reason why it does not fit.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(Error::io(path))?;
        Self::new(Model::from_safetensors(&path.display().to_string(), &bytes)?)
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Sample rate of the network in Hz; recordings at higher rates are resampled.
    pub fn sample_rate_hz(&self) -> u32 {
        self.model.layout.sample_rate_hz
    }

    /// Estimates, and says what each window said and what may be wrong.
    ///
    /// Windows of four seconds every two seconds are heard independently and joined, each label weighted by the window's
    /// precision and by how clearly speech stands out in it.
    ///
    /// # Errors
    /// [`Error::SampleRate`] below the network's rate, [`Error::TooShort`] below [`LEAST_DURATION_S`], or [`Error::Silent`].
    pub fn estimate_detailed(&self, speech: &Signal) -> Result<DetailedEstimate, Error> {
        let layout = &self.model.layout;
        let (found_hz, needed_hz) = (speech.sample_rate_hz(), layout.sample_rate_hz);
        if found_hz < needed_hz {
            return Err(Error::SampleRate { found_hz, needed_hz });
        }
        if speech.duration_s() < LEAST_DURATION_S {
            return Err(Error::TooShort { duration_s: speech.duration_s(), needed_s: LEAST_DURATION_S });
        }
        if speech.peak() < SILENT_PEAK {
            return Err(Error::Silent { peak: speech.peak() });
        }
        let mut warnings = Vec::new();
        // Flat tops are flat at the rate at which they were recorded only.
        let clipped = clipped_share(speech.samples());
        if clipped > CLIPPED_SHARE {
            warnings.push(Warning::Clipped { share: clipped });
        }
        let resampled;
        let speech = if found_hz == needed_hz {
            speech
        } else {
            warnings.push(Warning::Resampled { from_hz: found_hz, to_hz: needed_hz });
            resampled = resample(speech, needed_hz)?;
            &resampled
        };
        if speech.samples().len() < layout.window_samples() {
            warnings.push(Warning::Short { duration_s: speech.duration_s(), window_s: layout.window_s() });
        }
        // The floor of the features is absolute: a quiet recording would drown in it. A fixed level costs nothing where
        // the network does not hear the level.
        let gain = 0.5 / speech.peak();
        let scaled: Vec<f32> = speech.samples().iter().map(|s| s * gain).collect();
        let spectrogram = self.extractor.extract(&scaled);
        self.judge(spectrogram.view(), warnings)
    }

    /// Joins the windows of a spectrogram in dB `[mel, frame]`.
    fn judge(
        &self,
        spectrogram_db: ArrayView2<'_, f32>,
        mut warnings: Vec<Warning>,
    ) -> Result<DetailedEstimate, Error> {
        let layout = &self.model.layout;
        let firsts = first_frames(spectrogram_db.ncols(), layout.frames);
        let heard: Vec<(Loudness, WindowOutput)> = firsts
            .par_iter()
            .map_init(Scratch::default, |scratch, &first| {
                let end = (first + layout.frames).min(spectrogram_db.ncols());
                let loudness = Loudness::of(spectrogram_db.slice_axis(Axis(1), Slice::from(first..end)));
                let window = Normalisation::cut(spectrogram_db, first, layout.frames);
                (loudness, self.hear(window, scratch))
            })
            .collect();
        let loudest_db = heard.iter().map(|(l, _)| l.high_db).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = heard
            .iter()
            .map(|(loudness, _)| if loudness.is_active(loudest_db) { loudness.weight() } else { 0.0 })
            .collect();
        let inactive = weights.iter().filter(|w| **w == 0.0).count();
        if inactive > 0 {
            warnings.push(Warning::Inactive { windows: inactive, of: heard.len() });
        }
        let active = || heard.iter().zip(&weights).filter(|(_, w)| **w > 0.0).map(|(heard, _)| heard);
        let range_db = active().map(|(l, _)| l.range_db).fold(f64::NEG_INFINITY, f64::max);
        if active().all(|(l, _)| l.is_noisy()) {
            warnings.push(Warning::Noisy { range_db });
        }
        let count = active().count().max(1) as f64;
        let novelty = active().map(|(_, output)| output.novelty).sum::<f64>() / count;
        if novelty > self.model.calibration.novelty_limit {
            warnings.push(Warning::Unfamiliar { novelty, limit: self.model.calibration.novelty_limit });
        }
        let outputs: Vec<&WindowOutput> = heard.iter().map(|(_, output)| output).collect();
        let targets = self.targets(&self.join(&outputs, &weights))?;
        for (band, range) in self.model.calibration.t60_range_s.iter().enumerate().take(T60_COUNT) {
            let t60_s = targets.t60_s().values()[band].value;
            if t60_s < range[0] || t60_s > range[1] {
                let band_hz = label_hz(band);
                warnings.push(Warning::EdgeOfRange { band_hz, t60_s, low_s: range[0], high_s: range[1] });
            }
        }
        let total: f64 = weights.iter().sum();
        let windows = firsts
            .iter()
            .zip(&outputs)
            .zip(&weights)
            .map(|((&first, output), weight)| {
                Ok(WindowEstimate {
                    start_s: first as f64 * layout.frame_s(),
                    targets: self.targets(output)?,
                    weight: weight / total,
                })
            })
            .collect::<Result<_, Error>>()?;
        Ok(DetailedEstimate { targets, windows, warnings })
    }

    /// Hears one window of levels in dB, `[mel][frame]`.
    pub(crate) fn hear(&self, mut window_db: Vec<f32>, scratch: &mut Scratch) -> WindowOutput {
        self.model.normalisation.apply(&mut window_db);
        let novelty = self.novelty(&window_db);
        let raw = self.network.infer_with_scratch(&window_db, scratch);
        let factor = |label: usize| self.model.calibration.deviation[label];
        let learned = self.model.learned_variance();
        let deviation = (0..LABEL_COUNT)
            .map(|k| factor(k) * if learned { (0.5 * f64::from(raw[LABEL_COUNT + k])).exp() } else { 1.0 })
            .collect();
        WindowOutput { mean: raw[..LABEL_COUNT].iter().map(|v| f64::from(*v)).collect(), deviation, novelty }
    }

    fn novelty(&self, window: &[f32]) -> f64 {
        let mut statistics = Vec::new();
        spectrum(window, self.model.layout.frames, &mut statistics);
        self.model.calibration.novelty(&statistics)
    }

    /// One answer from many: the mean weighted by precision and `weights`, label by label.
    ///
    /// Windows of one recording err together, so their joint variance falls less than with independent errors: to
    /// `correlation + (1 - correlation) / n` of one window's, n being the effective number of windows.
    fn join(&self, outputs: &[&WindowOutput], weights: &[f64]) -> WindowOutput {
        let correlation = self.model.calibration.window_correlation.min(1.0);
        let mut joint = WindowOutput { mean: Vec::new(), deviation: Vec::new(), novelty: 0.0 };
        for label in 0..LABEL_COUNT {
            let precision: Vec<f64> =
                outputs.iter().zip(weights).map(|(o, w)| w / o.deviation[label].powi(2)).collect();
            let total: f64 = precision.iter().sum();
            let average = |f: &dyn Fn(&WindowOutput) -> f64| {
                outputs.iter().zip(&precision).map(|(o, p)| p * f(o)).sum::<f64>() / total
            };
            let mean = average(&|o| o.mean[label]);
            let variance = average(&|o| o.deviation[label].powi(2));
            let effective = total * total / precision.iter().map(|p| p * p).sum::<f64>();
            joint.mean.push(mean);
            joint.deviation.push((variance * (correlation + (1.0 - correlation) / effective)).sqrt());
        }
        joint
    }

    fn targets(&self, output: &WindowOutput) -> Result<RoomTargets, Error> {
        let labels: Vec<_> = (0..LABEL_COUNT)
            .map(|k| self.model.labels.decode(k, output.mean[k], output.deviation[k]))
            .collect();
        let (t60_s, eq_db) = per_band(&labels);
        Ok(RoomTargets::new(t60_s, eq_db)?)
    }
}

impl RoomEstimator for Estimator {
    fn estimate(&self, speech: &Signal) -> Result<RoomTargets, sabine_acoustics::Error> {
        Ok(self.estimate_detailed(speech)?.targets)
    }
}
