//! From a recording to the targets of a room.

use crate::Error;
use crate::cues::GroupLevels;
use crate::labels::LABEL_COUNT;
use crate::layout::Normalisation;
use crate::model::Model;
use crate::network::{Network, Scratch, spectrum};
use crate::warning::Warning;
use crate::window_estimate::{DetailedEstimate, HeardWindow, WindowOutput};
use crate::windows::{FlatTops, Loudness, first_frames, limit_range};
use ndarray::Array2;
use rayon::prelude::*;
use sabine_acoustics::{RoomEstimator, RoomTargets, Signal, resample};
use sabine_features::FeatureExtractor;
use sabine_features::LogMel;
use std::path::Path;

/// The weights that come with the crate.
const PRETRAINED: &[u8] = include_bytes!("../weights/room.safetensors");
/// Least length of a recording in seconds.
pub const LEAST_DURATION_S: f64 = 1.0;
/// Peak below which a recording is silent; full scale is 1 (the last bit of 24-bit samples is 1.2e-7).
const SILENT_PEAK: f32 = 1e-6;
/// Peak above which powers would leave single precision, 200 dB beyond full scale.
const LOUDEST_PEAK: f32 = 1e10;
/// Share of samples on flat tops above which a recording counts as clipped.
const CLIPPED_SHARE: f64 = 1e-4;

/// The network with everything around it: a recording in, reverberation time and equalisation with standard errors out.
#[derive(Clone, Debug)]
pub struct Estimator {
    pub(crate) model: Model,
    network: Network,
    pub(crate) extractor: LogMel,
}

/// A recording ready to be heard.
struct Prepared {
    /// Levels in dB, `[mel, frame]`.
    spectrogram_db: Array2<f32>,
    /// First frames of its windows.
    firsts: Vec<usize>,
    warnings: Vec<Warning>,
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
    /// [`Error::SampleRate`] below the network's rate, [`Error::TooShort`] below [`LEAST_DURATION_S`] or a frame of the features,
    /// [`Error::Silent`], [`Error::TooLoud`], or [`Error::Weights`] where the network's output is not finite.
    pub fn estimate_detailed(&self, speech: &Signal) -> Result<DetailedEstimate, Error> {
        let prepared = self.prepare(speech)?;
        let heard = self.hear_all(&prepared.windows().collect::<Vec<_>>());
        self.judge(&heard, prepared.warnings)
    }

    /// Estimates each of many recordings, in order, on all threads: the windows of all of them go through the network
    /// together. Each answer is that of [`Estimator::estimate_detailed`]; what is wrong with one recording does not keep the
    /// others from theirs.
    pub fn estimate_batch(&self, recordings: &[Signal]) -> Vec<Result<DetailedEstimate, Error>> {
        let prepared: Vec<Result<Prepared, Error>> =
            recordings.par_iter().map(|recording| self.prepare(recording)).collect();
        let windows: Vec<_> = prepared.iter().flatten().flat_map(Prepared::windows).collect();
        let mut heard = self.hear_all(&windows).into_iter();
        prepared
            .into_iter()
            .map(|prepared| {
                let prepared = prepared?;
                let own: Vec<HeardWindow> = heard.by_ref().take(prepared.firsts.len()).collect();
                self.judge(&own, prepared.warnings)
            })
            .collect()
    }

    /// The windows of a recording before they are joined.
    pub(crate) fn windows(&self, speech: &Signal) -> Result<Vec<HeardWindow>, Error> {
        Ok(self.hear_all(&self.prepare(speech)?.windows().collect::<Vec<_>>()))
    }

    /// Checks a recording and extracts its features.
    fn prepare(&self, speech: &Signal) -> Result<Prepared, Error> {
        let layout = &self.model.layout;
        let (found_hz, needed_hz) = (speech.sample_rate_hz(), layout.sample_rate_hz);
        if found_hz < needed_hz {
            return Err(Error::SampleRate { found_hz, needed_hz });
        }
        // Flat tops are flat at the rate at which they were recorded only.
        let mut tops = FlatTops::default();
        tops.push(speech.samples());
        let mut warnings = self.hearable(&tops, speech.duration_s())?;
        let resampled;
        let speech = if found_hz == needed_hz {
            speech
        } else {
            warnings.push(Warning::Resampled { from_hz: found_hz, to_hz: needed_hz });
            resampled = resample(speech, needed_hz)?;
            &resampled
        };
        let spectrogram_db = self.extractor.extract(speech.samples());
        if spectrogram_db.ncols() == 0 {
            let needed_s = layout.n_fft as f64 / f64::from(needed_hz);
            return Err(Error::TooShort { duration_s: speech.duration_s(), needed_s });
        }
        let firsts = first_frames(spectrogram_db.ncols(), layout.frames);
        Ok(Prepared { spectrogram_db, firsts, warnings })
    }

    /// Whether there is anything to hear, and what may be wrong with it.
    pub(crate) fn hearable(&self, tops: &FlatTops, duration_s: f64) -> Result<Vec<Warning>, Error> {
        // Weights of one's own may have frames longer than that.
        let needed_s =
            LEAST_DURATION_S.max(self.model.layout.n_fft as f64 / f64::from(self.sample_rate_hz()));
        if duration_s < needed_s {
            return Err(Error::TooShort { duration_s, needed_s });
        }
        if tops.peak() < SILENT_PEAK {
            return Err(Error::Silent { peak: tops.peak() });
        }
        if tops.peak() > LOUDEST_PEAK {
            return Err(Error::TooLoud { peak: tops.peak() });
        }
        let mut warnings = Vec::new();
        if tops.share() > CLIPPED_SHARE {
            warnings.push(Warning::Clipped { share: tops.share() });
        }
        let window_s = self.model.layout.window_s();
        if duration_s < window_s {
            warnings.push(Warning::Short { duration_s, window_s });
        }
        Ok(warnings)
    }

    /// Hears windows, each of a spectrogram from a first frame on, on all threads.
    fn hear_all(&self, windows: &[(&Array2<f32>, usize)]) -> Vec<HeardWindow> {
        windows
            .par_iter()
            .map_init(
                || (Vec::new(), Scratch::default()),
                |(window, scratch), &(spectrogram_db, first)| {
                    Normalisation::cut(spectrogram_db.view(), first, self.model.layout.frames, window);
                    self.hear(first, window, scratch)
                },
            )
            .collect()
    }

    /// Hears one window of levels in dB, `[mel][frame]`, and overwrites it.
    pub(crate) fn hear(&self, first: usize, window_db: &mut [f32], scratch: &mut Scratch) -> HeardWindow {
        limit_range(window_db);
        let groups = GroupLevels::of(window_db, self.model.layout.frames);
        let total_db = groups.total_db();
        let cues = groups.cues(window_db, &total_db);
        let loudness = Loudness::of(total_db);
        self.model.normalisation.apply(window_db);
        let mut statistics = Vec::new();
        spectrum(window_db, self.model.layout.frames, &mut statistics);
        let novelty = self.model.calibration.novelty(&statistics);
        let raw = self.network.infer_with_scratch(window_db, scratch);
        let learned = self.model.learned_variance();
        let factor = &self.model.calibration.deviation;
        let output = WindowOutput {
            mean: std::array::from_fn(|k| f64::from(raw[k])),
            deviation: std::array::from_fn(|k| {
                factor[k] * if learned { (0.5 * f64::from(raw[LABEL_COUNT + k])).exp() } else { 1.0 }
            }),
            novelty,
        };
        HeardWindow { first, loudness, output, cues }
    }
}

impl Prepared {
    fn windows(&self) -> impl Iterator<Item = (&Array2<f32>, usize)> {
        self.firsts.iter().map(|&first| (&self.spectrogram_db, first))
    }
}

impl RoomEstimator for Estimator {
    fn estimate(&self, speech: &Signal) -> Result<RoomTargets, sabine_acoustics::Error> {
        Ok(self.estimate_detailed(speech)?.targets)
    }
}
