//! Estimates from a live stream.

use crate::Error;
use crate::estimator::Estimator;
use crate::network::Scratch;
use crate::warning::Warning;
use crate::window_estimate::DetailedEstimate;
use crate::window_estimate::HeardWindow;
use crate::windows::{FlatTops, window_hop};
use sabine_features::LogMelStream;

/// Windows that a live estimate is made of by default: about one minute.
const DEFAULT_WINDOWS: usize = 30;

/// Listens to a stream and gives a new estimate whenever a window is full.
///
/// The first estimate comes when four seconds are in ([`LiveEstimator::first_latency_s`]), the following ones every two
/// seconds ([`LiveEstimator::hop_s`]), each with the last sample of its window; nothing is looked ahead. Only the newest
/// windows count, so that the estimate follows a listener from room to room; a stream that is not longer than they are gives
/// the very numbers of [`Estimator::estimate_detailed`], in portions of any size. Memory is set at the beginning and does not
/// grow with the stream.
///
/// ```
/// use sabine_estimator::{Estimator, LiveEstimator};
/// let mut live = LiveEstimator::new(&Estimator::pretrained()?);
/// // Noise bursts, four each second, in portions of 10 ms.
/// let sound: Vec<f32> =
///     (0..112_000_usize).map(|n| ((n * n) as f32 * 0.7).sin() * 10f32.powf(-3.0 * (n % 4000) as f32 / 4800.0)).collect();
/// let mut estimates = 0;
/// for portion in sound.chunks(160) {
///     live.push(portion, |estimate| estimates += usize::from(estimate.is_ok()))?;
/// }
/// // At 4.0 and 6.0 s of 7.
/// assert_eq!(estimates, 2);
/// # Ok::<(), sabine_estimator::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct LiveEstimator {
    estimator: Estimator,
    features: LogMelStream,
    tops: FlatTops,
    /// Number of frames so far.
    frames: usize,
    /// The newest frames of one window, `[frame][mel]`, round and round.
    recent_db: Vec<f32>,
    window_db: Vec<f32>,
    heard: Vec<HeardWindow>,
    most: usize,
    scratch: Scratch,
}

impl LiveEstimator {
    /// Starts with no samples; the newest 30 windows (one minute) will count.
    pub fn new(estimator: &Estimator) -> Self {
        Self::with_windows(estimator, DEFAULT_WINDOWS)
    }

    /// Starts with no samples; the newest `windows` windows (at least one) will count.
    pub fn with_windows(estimator: &Estimator, windows: usize) -> Self {
        let layout = &estimator.model().layout;
        let values = layout.mels * layout.frames;
        let most = windows.max(1);
        Self {
            features: estimator.extractor.stream(),
            tops: FlatTops::default(),
            frames: 0,
            recent_db: vec![0.0; values],
            window_db: vec![0.0; values],
            // One more: that of the newest samples, in between.
            heard: Vec::with_capacity(most + 1),
            most,
            scratch: Scratch::default(),
            estimator: estimator.clone(),
        }
    }

    /// Sample rate of the stream in Hz.
    pub fn sample_rate_hz(&self) -> u32 {
        self.estimator.sample_rate_hz()
    }

    /// Seconds of sound before the first estimate: the length of a window.
    pub fn first_latency_s(&self) -> f64 {
        self.estimator.model().layout.window_s()
    }

    /// Seconds from estimate to estimate.
    pub fn hop_s(&self) -> f64 {
        let layout = &self.estimator.model().layout;
        window_hop(layout.frames) as f64 * layout.frame_s()
    }

    /// Seconds of sound so far.
    pub fn duration_s(&self) -> f64 {
        self.tops.samples() as f64 / f64::from(self.sample_rate_hz())
    }

    /// Takes samples at [`LiveEstimator::sample_rate_hz`] and hands an estimate to `on_estimate` for each window that they
    /// fill; [`Error::Silent`] if there has been no sound so far.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for a sample that is no number; none of the samples is taken then.
    pub fn push(
        &mut self,
        samples: &[f32],
        mut on_estimate: impl FnMut(Result<DetailedEstimate, Error>),
    ) -> Result<(), Error> {
        if let Some(index) = samples.iter().position(|sample| !sample.is_finite()) {
            return Err(Error::NotFinite { index: self.tops.samples() + index as u64 });
        }
        // Up to the next sample that could fill a window, and on from there: what is known of the samples (peak, flat tops)
        // must not run ahead of the windows.
        let mut rest = samples;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(self.until_window().min(rest.len()));
            rest = later;
            if self.take(now) {
                on_estimate(self.judge());
            }
        }
        Ok(())
    }

    /// As [`LiveEstimator::push`] without estimates on the way; every window counts from now on.
    pub(crate) fn listen(&mut self, samples: &[f32]) {
        self.most = usize::MAX;
        let mut rest = samples;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(self.until_window().min(rest.len()));
            rest = later;
            self.take(now);
        }
    }

    /// The estimate of all windows, the last one at the end of the samples included.
    pub(crate) fn conclude(mut self, warnings: Vec<Warning>) -> Result<DetailedEstimate, Error> {
        let first = self.frames.saturating_sub(self.estimator.model().layout.frames);
        if self.heard.last().is_none_or(|last| last.first != first) {
            self.hear(first);
        }
        self.estimator.judge(&self.heard, warnings)
    }

    /// The estimate of all samples so far, those after the last full window included: what
    /// [`Estimator::estimate_detailed`] says of them.
    ///
    /// # Errors
    /// [`Error::TooShort`] or [`Error::Silent`].
    pub fn estimate(&mut self) -> Result<DetailedEstimate, Error> {
        self.estimator.hearable(&self.tops, self.duration_s())?;
        let window = self.estimator.model().layout.frames;
        let first = self.frames.saturating_sub(window);
        let is_heard = self.heard.last().is_some_and(|last| last.first == first);
        if !is_heard {
            self.hear(first);
        }
        let estimate = self.judge();
        if !is_heard {
            self.heard.pop();
        }
        estimate
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.features.reset();
        self.tops = FlatTops::default();
        self.frames = 0;
        self.heard.clear();
    }

    /// Samples until the next window is full.
    fn until_window(&self) -> usize {
        let layout = &self.estimator.model().layout;
        let hop = window_hop(layout.frames);
        // Frame that ends the next window, counted from 0.
        let next = self.frames.saturating_sub(layout.frames - 1).div_ceil(hop) * hop + layout.frames - 1;
        let end = (next * layout.hop + layout.n_fft) as u64;
        (end - self.tops.samples()) as usize
    }

    /// Takes samples that fill at most one window; says whether they do.
    fn take(&mut self, samples: &[f32]) -> bool {
        let (mels, window) = (self.estimator.model.layout.mels, self.estimator.model.layout.frames);
        self.tops.push(samples);
        let (recent, frames) = (&mut self.recent_db, &mut self.frames);
        let before = *frames;
        self.features.push(samples, |levels_db| {
            let at = *frames % window * mels;
            recent[at..at + mels].copy_from_slice(levels_db);
            *frames += 1;
        });
        let is_full =
            *frames > before && *frames >= window && (*frames - window).is_multiple_of(window_hop(window));
        if is_full {
            self.hear(self.frames - window);
            if self.heard.len() > self.most {
                self.heard.remove(0);
            }
        }
        is_full
    }

    /// Hears the newest frames, repeated where there are less than a window.
    fn hear(&mut self, first: usize) {
        let layout = &self.estimator.model.layout;
        let (mels, window) = (layout.mels, layout.frames);
        let available = self.frames.min(window);
        for (mel, row) in self.window_db.chunks_exact_mut(window).enumerate() {
            for (k, level) in row.iter_mut().enumerate() {
                *level = self.recent_db[(first + k % available) % window * mels + mel];
            }
        }
        self.heard.push(self.estimator.hear(first, &mut self.window_db, &mut self.scratch));
    }

    fn judge(&self) -> Result<DetailedEstimate, Error> {
        let warnings = self.estimator.hearable(&self.tops, self.duration_s())?;
        self.estimator.judge(&self.heard, warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::Error as AcousticsError;

    #[test]
    fn memory_does_not_grow_with_the_stream() -> Result<(), Box<dyn std::error::Error>> {
        let mut live = LiveEstimator::with_windows(&Estimator::pretrained()?, 3);
        let noise =
            |n: usize| 0.3 * ((n * n % 7919) as f32 / 7919.0 - 0.5) * (1.0 - (n % 8000) as f32 / 8000.0);
        let sound: Vec<f32> = (0..160_000).map(noise).collect();
        let mut failure = Ok::<(), AcousticsError>(());
        let mut capacities = Vec::new();
        for _ in 0..4 {
            live.push(&sound, |estimate| {
                if let Err(error) = estimate {
                    failure = Err(error.into());
                }
            })?;
            live.estimate()?;
            assert!(live.heard.len() <= 3);
            capacities.push([live.heard.capacity(), live.recent_db.capacity(), live.window_db.capacity()]);
        }
        failure?;
        assert!(capacities.windows(2).all(|pair| pair[0] == pair[1]), "{capacities:?}");
        Ok(())
    }
}
