//! A recording cut into windows, and what each of them is worth.

/// Level range below which a window is noise rather than speech, in dB.
const NOISE_RANGE_DB: f64 = 10.0;
/// How far below the loudest window one counts as silent, in dB.
const SILENCE_DB: f64 = 30.0;
/// Levels of a window further below its loudest one are not told apart, in dB: about what the training clips have.
const RANGE_DB: f32 = 100.0;

/// First frames of the windows: every half window, and the last one at the end.
pub(crate) fn first_frames(frames: usize, window: usize) -> Vec<usize> {
    if frames <= window {
        return vec![0];
    }
    let hop = window_hop(window);
    let mut firsts: Vec<usize> = (0..=frames - window).step_by(hop).collect();
    if firsts.last() != Some(&(frames - window)) {
        firsts.push(frames - window);
    }
    firsts
}

/// Frames from one window to the next.
pub(crate) fn window_hop(window: usize) -> usize {
    (window / 2).max(1)
}

/// Raises what lies further than [`RANGE_DB`] below the loudest level of a window: digital silence would be minus infinity.
/// The floor belongs to the window, so that a window says the same whatever comes before and after it.
pub(crate) fn limit_range(window_db: &mut [f32]) {
    let floor_db = window_db.iter().copied().fold(f32::NEG_INFINITY, f32::max) - RANGE_DB;
    window_db.iter_mut().for_each(|level| *level = level.max(floor_db));
}

/// Loudness of the frames of a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Loudness {
    /// 95th percentile of the frame levels in dB.
    pub high_db: f64,
    /// 95th minus 5th percentile in dB.
    pub range_db: f64,
}

impl Loudness {
    /// Of the levels of frames in dB.
    pub fn of(mut levels: Vec<f64>) -> Self {
        levels.sort_by(f64::total_cmp);
        let at = |share: f64| levels[((levels.len() - 1) as f64 * share).round() as usize];
        Self { high_db: at(0.95), range_db: at(0.95) - at(0.05) }
    }

    /// Whether there is speech, given the level of the loudest window.
    pub fn is_active(&self, loudest_db: f64) -> bool {
        self.high_db > loudest_db - SILENCE_DB
    }

    /// Whether noise covers the speech.
    pub fn is_noisy(&self) -> bool {
        self.range_db < NOISE_RANGE_DB
    }

    /// Weight of the window beside others: how much of the level range of clean speech (about 30 dB) is left.
    pub fn weight(&self) -> f64 {
        (self.range_db / 30.0).clamp(0.05, 1.0)
    }
}

/// Counts samples on flat tops, runs of three or more within 0.1 % of the peak so far, as they come in.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlatTops {
    peak: f32,
    samples: u64,
    clipped: u64,
    run: u64,
    sign: f32,
}

impl FlatTops {
    /// Takes more samples; it does not matter in what portions.
    pub fn push(&mut self, samples: &[f32]) {
        self.samples += samples.len() as u64;
        for &sample in samples {
            if sample.abs() > 1.001 * self.peak {
                // Whatever was flat below was no limit of the recorder.
                *self = Self { peak: sample.abs(), samples: self.samples, ..Self::default() };
            }
            let flat = self.peak > 0.0 && sample.abs() >= 0.999 * self.peak;
            if flat && (self.run == 0 || sample.signum() == self.sign) {
                self.run += 1;
            } else {
                self.close();
                self.run = u64::from(flat);
            }
            self.sign = sample.signum();
        }
    }

    fn close(&mut self) {
        if self.run >= 3 {
            self.clipped += self.run;
        }
        self.run = 0;
    }

    /// Largest magnitude so far, within 0.1 %.
    pub fn peak(&self) -> f32 {
        self.peak
    }

    /// Number of samples so far.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Share of the samples on flat tops.
    pub fn share(&self) -> f64 {
        let mut ended = self.clone();
        ended.close();
        ended.clipped as f64 / self.samples.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_cover_the_recording_and_end_with_it() {
        assert_eq!(first_frames(300, 499), [0]);
        assert_eq!(first_frames(499, 499), [0]);
        assert_eq!(first_frames(500, 499), [0, 1]);
        assert_eq!(first_frames(1000, 499), [0, 249, 498, 501]);
        assert_eq!(first_frames(997, 499), [0, 249, 498]);
    }

    #[test]
    fn flat_tops_are_counted_and_pure_tones_are_not() {
        let sine: Vec<f32> = (0..16_000).map(|n| (n as f32 * 0.3).sin()).collect();
        assert_eq!(share(&sine, 7), 0.0);
        let cut: Vec<f32> = sine.iter().map(|s| s.clamp(-0.7, 0.7)).collect();
        let wanted = cut.iter().filter(|s| s.abs() == 0.7).count() as f64 / cut.len() as f64;
        assert!((share(&cut, 16_000) - wanted).abs() < 0.1 * wanted);
        assert_eq!(share(&cut, 16_000), share(&cut, 1));
        assert_eq!(share(&cut, 16_000), share(&cut, 977));
        assert_eq!(share(&[0.0; 10], 10), 0.0);
    }

    fn share(samples: &[f32], portion: usize) -> f64 {
        let mut tops = FlatTops::default();
        samples.chunks(portion).for_each(|portion| tops.push(portion));
        tops.share()
    }

    #[test]
    fn the_floor_of_a_window_is_its_own() {
        let mut window = vec![-300.0, -20.0, -130.0, -50.0];
        limit_range(&mut window);
        assert_eq!(window, [-120.0, -20.0, -120.0, -50.0]);
    }
}
