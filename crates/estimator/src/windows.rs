//! A recording cut into windows, and what each of them is worth.

use ndarray::ArrayView2;

/// Level range below which a window is noise rather than speech, in dB.
const NOISE_RANGE_DB: f64 = 10.0;
/// How far below the loudest window one counts as silent, in dB.
const SILENCE_DB: f64 = 30.0;

/// First frames of the windows: every half window, and the last one at the end.
pub(crate) fn first_frames(frames: usize, window: usize) -> Vec<usize> {
    if frames <= window {
        return vec![0];
    }
    let hop = (window / 2).max(1);
    let mut firsts: Vec<usize> = (0..=frames - window).step_by(hop).collect();
    if firsts.last() != Some(&(frames - window)) {
        firsts.push(frames - window);
    }
    firsts
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
    /// Of levels in dB `[mel, frame]`: the power of a frame is the sum over its bands.
    pub fn of(window_db: ArrayView2<'_, f32>) -> Self {
        let mut levels: Vec<f64> = window_db
            .columns()
            .into_iter()
            .map(|frame| 10.0 * frame.iter().map(|db| 10f64.powf(f64::from(*db) / 10.0)).sum::<f64>().log10())
            .collect();
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

/// Share of the samples that lie on a flat top: runs of three or more equal samples within 0.1 % of the peak.
pub(crate) fn clipped_share(samples: &[f32]) -> f64 {
    let peak = samples.iter().fold(0.0f32, |peak, s| peak.max(s.abs()));
    let mut clipped = 0usize;
    let mut run = 0usize;
    let mut sign = 0.0f32;
    for &sample in samples.iter().chain([&0.0]) {
        let flat = sample.abs() >= 0.999 * peak && peak > 0.0;
        if flat && (run == 0 || sample.signum() == sign) {
            run += 1;
            sign = sample.signum();
            continue;
        }
        if run >= 3 {
            clipped += run;
        }
        run = usize::from(flat);
        sign = sample.signum();
    }
    clipped as f64 / samples.len() as f64
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
        assert_eq!(clipped_share(&sine), 0.0);
        let cut: Vec<f32> = sine.iter().map(|s| s.clamp(-0.7, 0.7)).collect();
        let share = cut.iter().filter(|s| s.abs() == 0.7).count() as f64 / cut.len() as f64;
        assert!((clipped_share(&cut) - share).abs() < 0.1 * share);
        assert_eq!(clipped_share(&[0.0; 10]), 0.0);
    }
}
