//! What moves many bins of one response together and is nobody's parameter: the level of each octave, which interference, the microphone
//! and its place move by a fraction of a decibel, and the tracer's chance, for one ray that happens to be found carries energy into many
//! bins and all octaves. Bins that scatter by themselves show neither. Both are fitted with every likelihood, and their uncertainty is
//! taken off what the bins say together (a Schur complement), so that no model has a parameter for them.

use crate::likelihood::laplace::Slopes;
use crate::simulate::monte_carlo_modes::Modes;
use crate::statistics::{HUBER_LOG_RATIO, exp_all, log_density};
use nalgebra::{DMatrix, DVector};

/// Steps of Newton's method, at most.
const MAX_STEPS: usize = 50;
/// Longest of them, as a logarithm of energy (a level) or in standard deviations (a mode).
const LONGEST_STEP: f64 = 2.0;
/// Shortest.
const TOLERANCE: f64 = 1e-11;

/// The compared bins of one band.
pub(super) struct BandBins<'a> {
    /// Logarithm of measured over predicted energy.
    pub ln_ratio: &'a [f64],
    /// Shapes of the Gamma distributions.
    pub shapes: &'a [f64],
    pub modes: &'a Modes,
}

/// The most probable offsets of one response.
pub(super) struct Offsets {
    /// Level of each compared band beside the prediction, as a logarithm of energy.
    pub levels: Vec<f64>,
    /// Each mode of the tracer's chance, in standard deviations.
    modes: Vec<f64>,
}

impl Offsets {
    /// Those of bins compared in some bands; `level_sd` is what is known of a level.
    pub fn most_probable(bands: &[BandBins<'_>], level_sd: f64) -> Self {
        let modes = bands.first().map_or(0, |b| b.modes.count());
        let levels = bands.iter().map(|b| most_probable_level(b.ln_ratio, b.shapes, level_sd)).collect();
        let mut found = Self { levels, modes: vec![0.0; modes] };
        if modes == 0 {
            return found;
        }
        let mut value = found.log_likelihood(bands, level_sd);
        for _ in 0..MAX_STEPS {
            let (slope, curvature) = found.slope_and_curvature(bands, level_sd);
            let Some(factor) = curvature.cholesky() else { break };
            let mut step = factor.solve(&slope);
            let longest = step.amax();
            if longest > LONGEST_STEP {
                step *= LONGEST_STEP / longest;
            }
            // The likelihood has a kink: a whole step may go too far.
            let mut taken = false;
            for _ in 0..20 {
                let tried = found.moved(&step);
                let next = tried.log_likelihood(bands, level_sd);
                if next >= value - 1e-12 * value.abs() {
                    (found, value, taken) = (tried, next, true);
                    break;
                }
                step *= 0.5;
            }
            if !taken || longest < TOLERANCE {
                break;
            }
        }
        found
    }

    fn moved(&self, step: &DVector<f64>) -> Self {
        let (levels, modes) = step.as_slice().split_at(self.levels.len());
        let add = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect();
        Self { levels: add(&self.levels, levels), modes: add(&self.modes, modes) }
    }

    /// What they move each bin of a band by, as a logarithm of energy.
    pub fn of(&self, band: usize, bins: &BandBins<'_>) -> Vec<f64> {
        let chance = |bin: usize| bins.modes.of(bin).iter().zip(&self.modes).map(|(m, z)| m * z).sum::<f64>();
        (0..bins.ln_ratio.len()).map(|bin| self.levels[band] + chance(bin)).collect()
    }

    /// Log-likelihood of the bins, with what is known of the offsets.
    pub fn log_likelihood(&self, bands: &[BandBins<'_>], level_sd: f64) -> f64 {
        let bins = |(band, bins): (usize, &BandBins<'_>)| -> f64 {
            let offsets = self.of(band, bins);
            let each = bins.ln_ratio.iter().zip(bins.shapes).zip(&offsets);
            each.map(|((z, shape), offset)| shape * log_density(z - offset)).sum()
        };
        let levels: f64 = self.levels.iter().map(|level| (level / level_sd).powi(2)).sum();
        let modes: f64 = self.modes.iter().map(|z| z * z).sum();
        bands.iter().enumerate().map(bins).sum::<f64>() - 0.5 * (levels + modes)
    }

    /// Slope of the log-posterior, and the opposite of its curvature; levels first, then modes.
    fn slope_and_curvature(&self, bands: &[BandBins<'_>], level_sd: f64) -> (DVector<f64>, DMatrix<f64>) {
        let (levels, modes) = (self.levels.len(), self.modes.len());
        let mut slope = DVector::zeros(levels + modes);
        let mut curvature = precision(levels, modes, level_sd);
        for (band, bins) in bands.iter().enumerate() {
            let mut ratios: Vec<f64> =
                bins.ln_ratio.iter().zip(self.of(band, bins)).map(|(z, offset)| z - offset).collect();
            let beyond: Vec<bool> = ratios.iter().map(|z| *z >= HUBER_LOG_RATIO).collect();
            ratios.iter_mut().for_each(|z| *z = z.min(HUBER_LOG_RATIO));
            exp_all(&mut ratios);
            for (bin, (ratio, shape)) in ratios.iter().zip(bins.shapes).enumerate() {
                let pull = shape * (ratio - 1.0);
                let weight = if beyond[bin] { 0.0 } else { shape * ratio };
                let own = bins.modes.of(bin);
                slope[band] += pull;
                own.iter().enumerate().for_each(|(i, m)| slope[levels + i] += pull * m);
                add_outer(&mut curvature, (band, levels), own, weight);
            }
        }
        for i in 0..levels {
            slope[i] -= self.levels[i] / (level_sd * level_sd);
        }
        for i in 0..modes {
            slope[levels + i] -= self.modes[i];
        }
        (slope, curvature)
    }
}

/// What is known of offsets beforehand.
fn precision(levels: usize, modes: usize, level_sd: f64) -> DMatrix<f64> {
    let own = |i: usize| if i < levels { level_sd.powi(-2) } else { 1.0 };
    DMatrix::from_fn(levels + modes, levels + modes, |i, j| if i == j { own(i) } else { 0.0 })
}

/// Adds what a bin of one band says of the offsets: the outer product of what a unit of each moves it by.
fn add_outer(target: &mut DMatrix<f64>, (band, levels): (usize, usize), modes: &[f64], weight: f64) {
    target[(band, band)] += weight;
    for (i, a) in modes.iter().enumerate() {
        target[(band, levels + i)] += weight * a;
        target[(levels + i, band)] += weight * a;
        for (j, b) in modes.iter().enumerate() {
            target[(levels + i, levels + j)] += weight * a * b;
        }
    }
}

/// The most probable level of one band's bins without modes. One unknown wants no exponential but that of the start.
fn most_probable_level(ln_ratio: &[f64], shapes: &[f64], sd: f64) -> f64 {
    let mut ratios = ln_ratio.to_vec();
    exp_all(&mut ratios);
    let mut offset = 0.0f64;
    for _ in 0..MAX_STEPS {
        let lower = (-offset).exp();
        // Slope of the log-posterior, and the opposite of its curvature.
        let (mut slope, mut curvature) = (-offset / (sd * sd), 1.0 / (sd * sd));
        for ((z, ratio), shape) in ln_ratio.iter().zip(&ratios).zip(shapes) {
            let pull = if z - offset < HUBER_LOG_RATIO {
                curvature += shape * ratio * lower;
                ratio * lower
            } else {
                HUBER_LOG_RATIO.exp()
            };
            slope += shape * (pull - 1.0);
        }
        let step = (slope / curvature).clamp(-LONGEST_STEP, LONGEST_STEP);
        offset += step;
        if step.abs() < TOLERANCE {
            break;
        }
    }
    offset
}

/// What the bins of one response say of its offsets, and of parameters and offsets together.
pub(super) struct SharedInformation {
    levels: usize,
    own: DMatrix<f64>,
    /// By column of the model: how it goes with each offset.
    shared: Vec<(usize, DVector<f64>)>,
}

impl SharedInformation {
    pub fn new(bands: &[BandBins<'_>], level_sd: f64) -> Self {
        let modes = bands.first().map_or(0, |b| b.modes.count());
        let mut own = precision(bands.len(), modes, level_sd);
        for (band, bins) in bands.iter().enumerate() {
            for (bin, &shape) in bins.shapes.iter().enumerate() {
                add_outer(&mut own, (band, bands.len()), bins.modes.of(bin), shape);
            }
        }
        Self { levels: bands.len(), own, shared: Vec::new() }
    }

    /// Adds one band, whose bins change with these columns as the rows say.
    pub fn add(&mut self, band: usize, (columns, rows): (&[usize], &[Vec<f64>]), bins: &BandBins<'_>) {
        for (&column, row) in columns.iter().zip(rows) {
            let place = self.shared.iter().position(|(known, _)| *known == column).unwrap_or_else(|| {
                self.shared.push((column, DVector::zeros(self.own.nrows())));
                self.shared.len() - 1
            });
            let target = &mut self.shared[place].1;
            for (bin, (slope, shape)) in row.iter().zip(bins.shapes).enumerate() {
                let weighted = slope * shape;
                target[band] += weighted;
                for (i, m) in bins.modes.of(bin).iter().enumerate() {
                    target[self.levels + i] += weighted * m;
                }
            }
        }
    }

    /// Takes off the information on parameters what unknown offsets have of it.
    pub fn take_off(self, slopes: &mut Slopes) {
        let Some(factor) = self.own.cholesky() else { return };
        let solved: Vec<DVector<f64>> = self.shared.iter().map(|(_, x)| factor.solve(x)).collect();
        for (a, x) in &self.shared {
            for ((b, _), y) in self.shared.iter().zip(&solved) {
                slopes.information[(*a, *b)] -= x.dot(y);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bins of one band.
    fn level_of(ln_ratio: &[f64], shapes: &[f64], sd: f64) -> f64 {
        Offsets::most_probable(&[BandBins { ln_ratio, shapes, modes: &Modes::default() }], sd).levels[0]
    }

    #[test]
    fn a_level_is_found_as_far_as_its_prior_lets_it() {
        let shapes = [4.0; 60];
        let scatter =
            |level: f64| -> Vec<f64> { (0..60).map(|i| level + 0.3 * (2.3 * f64::from(i)).sin()).collect() };
        let found = level_of(&scatter(0.4), &shapes, 10.0);
        // The mean of the exponential of the scatter is a little above one.
        assert!((found - 0.4).abs() < 0.05, "{found}");
        let held = level_of(&scatter(0.4), &shapes, 0.02);
        assert!(held > 0.0 && held < 0.1, "{held}");
        // No other level is more probable, outliers or not.
        let mut wild = scatter(-0.2);
        wild[3] = 9.0;
        for ratios in [scatter(0.4), wild] {
            let modes = Modes::default();
            let bins = [BandBins { ln_ratio: &ratios, shapes: &shapes, modes: &modes }];
            let best = level_of(&ratios, &shapes, 0.3);
            let at = |level: f64| Offsets { levels: vec![level], modes: vec![] }.log_likelihood(&bins, 0.3);
            assert!(at(best) > at(best + 0.01) && at(best) > at(best - 0.01));
        }
    }

    #[test]
    fn chance_that_moves_two_bands_alike_is_told_from_their_levels() {
        // A mode that grows with time in both bands, one and a half deviations of it, and a level in one band.
        let mode = |bin: usize| 0.005 * bin as f64;
        let modes = Modes::new(1, (0..60).map(mode).collect());
        let scatter = |bin: usize| 0.05 * (2.3 * bin as f64).sin();
        let ratios = [0.3, 0.0]
            .map(|level| -> Vec<f64> { (0..60).map(|bin| level + 1.5 * mode(bin) + scatter(bin)).collect() });
        let shapes = vec![400.0; 60];
        let bins = [0, 1].map(|b| BandBins { ln_ratio: &ratios[b], shapes: &shapes, modes: &modes });
        let found = Offsets::most_probable(&bins, 0.2);
        assert!((found.modes[0] - 1.5).abs() < 0.05, "{:?}", found.modes);
        assert!((found.levels[0] - 0.3).abs() < 0.02 && found.levels[1].abs() < 0.02, "{:?}", found.levels);
        // The top: nothing near it is more probable.
        let best = found.log_likelihood(&bins, 0.2);
        for offset in 0..3 {
            for step in [1e-3, -1e-3] {
                let step = DVector::from_fn(3, |i, _| if i == offset { step } else { 0.0 });
                assert!(found.moved(&step).log_likelihood(&bins, 0.2) < best);
            }
        }
    }

    #[test]
    fn what_moves_all_bins_as_an_offset_does_is_known_no_better_than_that() {
        let (shapes, sd) = (vec![5.0; 1000], 0.1);
        let tilt: Vec<f64> = (0..1000).map(|i| 0.001 * f64::from(i) - 0.5).collect();
        let rows = [
            vec![1.0; 1000],
            (0..1000).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect(),
            tilt.iter().map(|t| 4.0 * t).collect(),
        ];
        let mut slopes = Slopes::zero(3);
        for (a, row) in rows.iter().enumerate() {
            slopes.information[(a, a)] = row.iter().map(|s| 5.0 * s * s).sum();
        }
        let modes = Modes::new(1, tilt);
        let bins = BandBins { ln_ratio: &vec![0.0; 1000], shapes: &shapes, modes: &modes };
        let mut shared = SharedInformation::new(std::slice::from_ref(&bins), sd);
        shared.add(0, (&[0, 1, 2], &rows), &bins);
        shared.take_off(&mut slopes);
        // One over the variance of the level; what moves bins against each other is known as before; and a quarter of a deviation of
        // the mode is one unit of the last.
        assert!((slopes.information[(0, 0)] - 1.0 / (sd * sd)).abs() < 3.0, "{}", slopes.information);
        assert!((slopes.information[(1, 1)] - 5000.0).abs() < 1.0, "{}", slopes.information);
        assert!((slopes.information[(2, 2)] - 16.0).abs() < 0.2, "{}", slopes.information);
    }
}
