//! What tells speech in a room from music, noise, a telephone or several talkers: numbers of a window that a person can read.
//!
//! All are of levels in dB, of bands about a quarter of the mel axis wide: how far loud, middling and quiet frames lie apart, how much the
//! level changes from one moment to another at six scales of time (a modulation spectrum by Haar's wavelets), how fast it falls and
//! rises, and the long-term spectrum.

/// Bands that the mel axis is divided into.
const GROUPS: usize = 4;
/// Bands of the long-term spectrum.
const SPECTRUM: usize = 16;
/// Half widths, in frames of 8 ms, of the wavelets: 16 ms to 0.5 s, half periods of 31 to 1 Hz.
const SCALES: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Frames over which a level falls: 0.24 s.
const FALL: usize = 30;
/// Frames over which a level rises: 40 ms.
const RISE: usize = 5;
/// Frames that a level is averaged over before it falls or rises.
const SMOOTH: usize = 5;
/// Fewest frames that hold all of this.
const LEAST_FRAMES: usize = 2 * SCALES[SCALES.len() - 1] + 1;
/// Cues of each group: two ranges, the wavelets, two falls, a rise.
const PER_GROUP: usize = 2 + SCALES.len() + 3;

/// How many cues a window has, where it is large enough to have any.
pub(crate) const CUES: usize = GROUPS * PER_GROUP + SPECTRUM + 4;

/// Levels of a window in a few bands.
pub(crate) struct GroupLevels {
    /// Linear power `[group][frame]`.
    power: Vec<f64>,
    frames: usize,
}

impl GroupLevels {
    /// Of levels in dB `[mel][frame]`.
    pub fn of(window_db: &[f32], frames: usize) -> Self {
        let mels = window_db.len() / frames;
        let mut power = vec![0.0f64; GROUPS * frames];
        for (mel, row) in window_db.chunks_exact(frames).enumerate() {
            let group = mel * GROUPS / mels;
            for (power, db) in power[group * frames..].iter_mut().zip(row) {
                *power += 10f64.powf(f64::from(*db) / 10.0);
            }
        }
        Self { power, frames }
    }

    /// Level of each frame over all bands, in dB.
    pub fn total_db(&self) -> Vec<f64> {
        let mut total = vec![0.0f64; self.frames];
        for row in self.power.chunks_exact(self.frames) {
            total.iter_mut().zip(row).for_each(|(total, power)| *total += power);
        }
        total.iter_mut().for_each(|level| *level = 10.0 * level.log10());
        total
    }

    /// The cues, none where the window is too small for them.
    pub fn cues(&self, window_db: &[f32], total_db: &[f64]) -> Vec<f64> {
        if self.frames < LEAST_FRAMES || window_db.len() < SPECTRUM * self.frames {
            return Vec::new();
        }
        let mut cues = Vec::with_capacity(CUES);
        let levels: Vec<Vec<f64>> = self
            .power
            .chunks_exact(self.frames)
            .map(|row| row.iter().map(|power| 10.0 * power.max(f64::MIN_POSITIVE).log10()).collect())
            .collect();
        levels.iter().for_each(|level| group_cues(level, &mut cues));
        spectrum_cues(window_db, self.frames, &mut cues);
        cues.push(correlation(&levels[0], &levels[2]));
        cues.push(correlation(&levels[1], &levels[3]));
        cues.extend(third_and_fourth_moment(total_db));
        cues
    }
}

/// Ranges, modulation, falls and rises of a level in dB.
fn group_cues(level_db: &[f64], cues: &mut Vec<f64>) {
    let [low, middle, high] = quantiles(level_db.to_vec(), [0.05, 0.5, 0.95]);
    cues.extend([high - middle, middle - low]);
    let mut sums = vec![0.0];
    for level in level_db {
        sums.push(sums[sums.len() - 1] + level);
    }
    for scale in SCALES {
        let count = level_db.len() - 2 * scale + 1;
        let square = |k: usize| {
            let (first, second) = (sums[k + scale] - sums[k], sums[k + 2 * scale] - sums[k + scale]);
            ((second - first) / scale as f64).powi(2)
        };
        cues.push(0.5 * ((0..count).map(square).sum::<f64>() / count as f64 + 0.01).ln());
    }
    let smooth = |k: usize| (sums[k + SMOOTH] - sums[k]) / SMOOTH as f64;
    let change = |lag: usize| -> Vec<f64> {
        (0..level_db.len() - SMOOTH - lag + 1).map(|k| smooth(k + lag) - smooth(k)).collect()
    };
    let [steep, usual, _] = quantiles(change(FALL), [0.05, 0.2, 0.5]);
    cues.extend([steep, usual].map(|fall| (-fall).max(0.1).ln()));
    let [_, _, rise] = quantiles(change(RISE), [0.05, 0.5, 0.95]);
    cues.push(rise.max(0.1).ln());
}

/// The loud moments of each band relative to their mean, in dB.
fn spectrum_cues(window_db: &[f32], frames: usize, cues: &mut Vec<f64>) {
    let mels = window_db.len() / frames;
    let mut bands = [(0.0, 0.0); SPECTRUM];
    for (mel, row) in window_db.chunks_exact(frames).enumerate() {
        let [_, _, loud] = quantiles(row.iter().map(|v| f64::from(*v)).collect(), [0.05, 0.5, 0.9]);
        let band = &mut bands[mel * SPECTRUM / mels];
        *band = (band.0 + loud, band.1 + 1.0);
    }
    let levels = bands.map(|(sum, count)| sum / count);
    let mean = levels.iter().sum::<f64>() / SPECTRUM as f64;
    cues.extend(levels.map(|level| level - mean));
}

fn quantiles<const N: usize>(mut values: Vec<f64>, shares: [f64; N]) -> [f64; N] {
    let last = values.len() - 1;
    shares.map(|share| {
        let at = (last as f64 * share).round() as usize;
        *values.select_nth_unstable_by(at, f64::total_cmp).1
    })
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (mean_a, mean_b) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let product = |x: &[f64], mx: f64, y: &[f64], my: f64| {
        x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>()
    };
    let scale = (product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b)).sqrt();
    if scale > 0.0 { product(a, mean_a, b, mean_b) / scale } else { 0.0 }
}

/// Skewness and kurtosis; 0 and 0 of a constant.
fn third_and_fourth_moment(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let moment = |power: i32| values.iter().map(|v| (v - mean).powi(power)).sum::<f64>() / n;
    let deviation = moment(2).sqrt();
    if deviation < 1e-9 {
        return [0.0; 2];
    }
    [moment(3) / deviation.powi(3), moment(4) / deviation.powi(4)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 32 bands of levels that fall by 60 dB in `t60_s`, again and again each 1.6 s.
    fn falling(t60_s: f64) -> Vec<f32> {
        (0..32 * 499).map(|k| (-60.0 / t60_s * 0.008 * ((k % 499) % 200) as f64) as f32).collect()
    }

    fn cues(window_db: &[f32]) -> Vec<f64> {
        let groups = GroupLevels::of(window_db, 499);
        groups.cues(window_db, &groups.total_db())
    }

    #[test]
    fn the_fall_is_that_of_the_decay() {
        for t60_s in [0.5, 1.0, 4.0] {
            let found = cues(&falling(t60_s));
            assert_eq!(found.len(), CUES);
            // Every quarter second but those across a new beginning falls by 60 * 0.24 / T60.
            for group in 0..GROUPS {
                let fall = found[group * PER_GROUP + 2 + SCALES.len() + 1];
                assert!((fall - (60.0 * 0.24 / t60_s).ln()).abs() < 1e-3, "{t60_s} s: {fall}");
            }
        }
    }

    #[test]
    fn a_tone_that_is_switched_shows_at_its_scale_and_in_its_band() {
        // The second quarter of the bands goes between 0 and -40 dB each 32 frames, the others stay.
        let window: Vec<f32> = (0..32 * 499)
            .map(|k| if (8..16).contains(&(k / 499)) && (k % 499 / 32) % 2 == 1 { -40.0 } else { 0.0 })
            .collect();
        let found = cues(&window);
        let modulation = |group: usize, scale: usize| found[group * PER_GROUP + 2 + scale].exp();
        // Averages over 32 frames differ by 40 dB at best and by nothing at worst, evenly in between: 40 / sqrt(3).
        assert!((modulation(1, 4) - 40.0 / 3f64.sqrt()).abs() < 1.0, "{}", modulation(1, 4));
        assert!(modulation(1, 0) < 0.5 * modulation(1, 4));
        assert!((modulation(0, 4) - 0.1).abs() < 1e-6);
    }

    #[test]
    fn small_windows_have_none() {
        assert!(GroupLevels::of(&[0.0; 320], 10).cues(&[0.0; 320], &[0.0; 10]).is_empty());
    }
}
