//! What moves many bins of one response together and is nobody's parameter: the level of each octave, which interference, the microphone
//! and its place move by a fraction of a decibel; its drift along the decay, where reflections add in phase; and the tracer's chance, for
//! one ray that happens to be found carries energy into many bins and all octaves. Bins that scatter by themselves show none of these.
//! All are fitted with every likelihood, and their uncertainty is taken off what the bins say together (a Schur complement), so that no
//! model has a parameter for them.

use crate::likelihood::laplace::Slopes;
use crate::simulate::modes::Modes;
use crate::simulate::table_chance::TableChance;
use crate::statistics::{HUBER_LOG_RATIO, exp_all, log_density};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::ops::Range;

/// Cosines along the compared bins that a drift is made of.
pub(crate) const DRIFTS: usize = 4;
/// Steps of Newton's method, at most.
const MAX_STEPS: usize = 50;
/// Longest of them, in standard deviations of an offset (a level alone: as a logarithm of energy).
const LONGEST_STEP: f64 = 2.0;
/// Shortest.
const TOLERANCE: f64 = 1e-11;

/// The compared bins of one band.
#[derive(Clone, Copy)]
pub(super) struct BandBins<'a> {
    /// Logarithm of measured over predicted energy.
    pub ln_ratio: &'a [f64],
    /// Shapes of the Gamma distributions.
    pub shapes: &'a [f64],
    pub modes: &'a Modes,
    /// Standard deviation of the level, as a logarithm of energy.
    pub level_sd: f64,
    /// Standard deviation of the drift's first cosine, as a logarithm of energy; that of the k-th is a k-th of it.
    pub drift_sd: f64,
    /// How chance moves the values of a table, where these take the place of bins: they have no level and no drift.
    pub table: Option<&'a TableChance>,
}

impl BandBins<'_> {
    /// Number of directions of its own.
    fn own(&self) -> usize {
        match self.table {
            Some(chance) => chance.count(),
            None if self.drift_sd > 0.0 => 1 + DRIFTS,
            None => 1,
        }
    }
}

/// All directions in which the bins of one response move together, a standard normal deviate along each: first those of each band (its
/// level, and its drift where there is one), then the modes of the tracer's chance.
pub(super) struct Directions<'a> {
    bands: &'a [BandBins<'a>],
    /// Where the directions of each band's own stand.
    own: Vec<Range<usize>>,
    modes: usize,
    /// What each direction that bears on a band moves its bins by, `[band][bin * (own + modes) + direction]`.
    moves: Vec<Vec<f64>>,
}

/// The most probable offsets of one response.
pub(super) struct Offsets {
    /// Level of each compared band beside the prediction, as a logarithm of energy.
    pub levels: Vec<f64>,
    /// What all offsets together move each bin by, as a logarithm of energy.
    pub of: Vec<Vec<f64>>,
    /// Of the bins, with what is known of the offsets.
    pub log_likelihood: f64,
}

impl<'a> Directions<'a> {
    /// Those of bins compared in some bands.
    pub fn new(bands: &'a [BandBins<'a>]) -> Self {
        let modes = bands.first().map_or(0, |b| b.modes.count());
        let mut count = 0;
        let own: Vec<Range<usize>> = bands
            .iter()
            .map(|b| {
                let first = count;
                count += b.own();
                first..count
            })
            .collect();
        let moves = bands.iter().zip(&own).map(|(b, own)| moves(b, own.len())).collect();
        Self { bands, own, modes, moves }
    }

    fn count(&self) -> usize {
        self.own.last().map_or(0, |own| own.end) + self.modes
    }

    /// Directions that bear on a band, in the order of its moves.
    fn of_band(&self, band: usize) -> impl Iterator<Item = usize> + Clone {
        self.own[band].clone().chain(self.count() - self.modes..self.count())
    }

    /// What moves each bin of a band: as many figures as there are directions that bear on it.
    fn rows(&self, band: usize) -> std::slice::ChunksExact<'_, f64> {
        self.moves[band].chunks_exact(self.own[band].len() + self.modes)
    }

    /// What a unit of each direction moves each bin by, `(bin, direction)`, the `bins` of one band after those of another.
    pub fn matrix(&self, bins: usize) -> DMatrix<f64> {
        let mut moved = DMatrix::zeros(bins, self.count());
        let rows = (0..self.bands.len()).flat_map(|band| self.rows(band).map(move |row| (band, row)));
        for (bin, (band, row)) in rows.enumerate() {
            self.of_band(band).zip(row).for_each(|(direction, by)| moved[(bin, direction)] = *by);
        }
        moved
    }

    /// The most probable offsets.
    pub fn top(&self) -> Offsets {
        let deviates = self.most_probable();
        let of = (0..self.bands.len()).map(|band| self.moved(&deviates, band)).collect();
        let level = |(own, b): (&Range<usize>, &BandBins<'_>)| {
            if b.table.is_some() { 0.0 } else { deviates[own.start] * b.level_sd }
        };
        let levels = self.own.iter().zip(self.bands).map(level).collect();
        let log_likelihood = self.log_likelihood(&deviates, 0..self.bands.len(), 0..self.count());
        Offsets { levels, of, log_likelihood }
    }

    /// The most probable deviates, by direction.
    fn most_probable(&self) -> Vec<f64> {
        let mut deviates = vec![0.0; self.count()];
        if self.modes > 0 {
            self.climb(&mut deviates, 0..self.bands.len(), 0..self.count());
            return deviates;
        }
        // Bands have nothing in common.
        for (band, own) in self.own.iter().enumerate() {
            if own.len() == 1 && self.bands[band].table.is_none() {
                let BandBins { ln_ratio, shapes, level_sd, .. } = self.bands[band];
                deviates[own.start] = most_probable_level(ln_ratio, shapes, level_sd) / level_sd;
            } else {
                self.climb(&mut deviates, band..band + 1, own.clone());
            }
        }
        deviates
    }

    /// Newton's method in some bands and all directions that bear on them.
    fn climb(&self, deviates: &mut [f64], bands: Range<usize>, directions: Range<usize>) {
        let mut value = self.log_likelihood(deviates, bands.clone(), directions.clone());
        for _ in 0..MAX_STEPS {
            let (slope, curvature) = self.slope_and_curvature(deviates, bands.clone(), directions.clone());
            let Some(factor) = curvature.cholesky() else { break };
            let mut step = factor.solve(&slope);
            let longest = step.amax();
            if longest > LONGEST_STEP {
                step *= LONGEST_STEP / longest;
            }
            // The likelihood has a kink: a whole step may go too far.
            let before = deviates[directions.clone()].to_vec();
            let mut taken = false;
            for _ in 0..20 {
                for ((z, from), move_by) in deviates[directions.clone()].iter_mut().zip(&before).zip(&step) {
                    *z = from + move_by;
                }
                let next = self.log_likelihood(deviates, bands.clone(), directions.clone());
                if next >= value - 1e-12 * value.abs() {
                    (value, taken) = (next, true);
                    break;
                }
                step *= 0.5;
            }
            if !taken {
                deviates[directions.clone()].copy_from_slice(&before);
            }
            if !taken || longest < TOLERANCE {
                break;
            }
        }
    }

    /// What the offsets move each bin of a band by, as a logarithm of energy.
    fn moved(&self, deviates: &[f64], band: usize) -> Vec<f64> {
        let own: Vec<f64> = self.of_band(band).map(|i| deviates[i]).collect();
        self.rows(band).map(|row| row.iter().zip(&own).map(|(m, z)| m * z).sum()).collect()
    }

    /// Log-likelihood of some bands, with what is known of their directions.
    fn log_likelihood(&self, deviates: &[f64], bands: Range<usize>, directions: Range<usize>) -> f64 {
        let bins = |band: usize| -> f64 {
            let BandBins { ln_ratio, shapes, .. } = self.bands[band];
            let each = ln_ratio.iter().zip(shapes).zip(self.moved(deviates, band));
            each.map(|((z, shape), offset)| shape * log_density(z - offset)).sum()
        };
        let known: f64 = deviates[directions].iter().map(|z| z * z).sum();
        bands.map(bins).sum::<f64>() - 0.5 * known
    }

    /// Slope of the log-posterior, and the opposite of its curvature.
    fn slope_and_curvature(
        &self,
        deviates: &[f64],
        bands: Range<usize>,
        directions: Range<usize>,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let mut slope =
            DVector::from_iterator(directions.len(), deviates[directions.clone()].iter().map(|z| -z));
        let mut curvature = DMatrix::identity(directions.len(), directions.len());
        for band in bands {
            let BandBins { ln_ratio, shapes, .. } = self.bands[band];
            let mut ratios: Vec<f64> =
                ln_ratio.iter().zip(self.moved(deviates, band)).map(|(z, offset)| z - offset).collect();
            let beyond: Vec<bool> = ratios.iter().map(|z| *z >= HUBER_LOG_RATIO).collect();
            ratios.iter_mut().for_each(|z| *z = z.min(HUBER_LOG_RATIO));
            exp_all(&mut ratios);
            let places: Vec<usize> = self.of_band(band).map(|i| i - directions.start).collect();
            for (bin, row) in self.rows(band).enumerate() {
                let pull = shapes[bin] * (ratios[bin] - 1.0);
                places.iter().zip(row).for_each(|(&i, m)| slope[i] += pull * m);
                if !beyond[bin] {
                    add_outer(&mut curvature, &places, row, shapes[bin] * ratios[bin]);
                }
            }
        }
        curvature.fill_upper_triangle_with_lower_triangle();
        (slope, curvature)
    }

    /// What the bins say of all directions on the average over what might be measured, and what is known of them.
    fn information(&self) -> DMatrix<f64> {
        let mut information = DMatrix::identity(self.count(), self.count());
        for (band, bins) in self.bands.iter().enumerate() {
            let places: Vec<usize> = self.of_band(band).collect();
            for (row, &shape) in self.rows(band).zip(bins.shapes) {
                add_outer(&mut information, &places, row, shape);
            }
        }
        information.fill_upper_triangle_with_lower_triangle();
        information
    }

    /// Logarithm of the probability of the bins whatever the offsets, but for what the shapes alone decide (Laplace's approximation).
    pub fn log_evidence(&self) -> f64 {
        let curvature = self.information().cholesky();
        let ln_determinant = curvature.map_or(0.0, |c| 2.0 * c.l().diagonal().map(f64::ln).sum());
        self.top().log_likelihood - 0.5 * ln_determinant
    }
}

/// What a drift is made of in one of the compared bins: cosines along the decay, the k-th of a k-th of the first one's standard deviation.
pub(crate) fn unit_drift(bin: usize, count: usize) -> [f64; DRIFTS] {
    let angle = PI * (bin as f64 + 0.5) / count as f64;
    std::array::from_fn(|k| (1.0 + k as f64).recip() * ((1.0 + k as f64) * angle).cos())
}

/// What the directions that bear on a band move its bins by.
fn moves(bins: &BandBins<'_>, own: usize) -> Vec<f64> {
    let count = bins.ln_ratio.len();
    let mut moves = Vec::with_capacity(count * (own + bins.modes.count()));
    for bin in 0..count {
        if let Some(chance) = bins.table {
            moves.extend_from_slice(chance.of_value(bin));
        } else {
            moves.push(bins.level_sd);
            moves.extend(unit_drift(bin, count).iter().take(own - 1).map(|unit| bins.drift_sd * unit));
        }
        moves.extend_from_slice(bins.modes.of(bin));
    }
    moves
}

/// Adds what a bin says of the directions at these places, ascending: the outer product of what a unit of each moves it by, its lower
/// triangle.
fn add_outer(target: &mut DMatrix<f64>, places: &[usize], moves: &[f64], weight: f64) {
    for (a, (&i, x)) in places.iter().zip(moves).enumerate() {
        for (&j, y) in places[..=a].iter().zip(moves) {
            target[(i, j)] += weight * x * y;
        }
    }
}

/// The most probable level of one band's bins without drift and modes. One unknown wants no exponential but that of the start.
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
pub(super) struct SharedInformation<'a> {
    directions: &'a Directions<'a>,
    /// By column of the model: how it goes with each offset.
    shared: Vec<(usize, DVector<f64>)>,
}

impl<'a> SharedInformation<'a> {
    pub fn new(directions: &'a Directions<'a>) -> Self {
        Self { directions, shared: Vec::new() }
    }

    /// Adds one band, whose bins change with these columns as the rows say.
    pub fn add(&mut self, band: usize, (columns, rows): (&[usize], &[Vec<f64>])) {
        let shapes = self.directions.bands[band].shapes;
        for (&column, row) in columns.iter().zip(rows) {
            let place = self.shared.iter().position(|(known, _)| *known == column).unwrap_or_else(|| {
                self.shared.push((column, DVector::zeros(self.directions.count())));
                self.shared.len() - 1
            });
            let target = &mut self.shared[place].1;
            for ((slope, shape), moves) in row.iter().zip(shapes).zip(self.directions.rows(band)) {
                let weighted = slope * shape;
                self.directions.of_band(band).zip(moves).for_each(|(i, m)| target[i] += weighted * m);
            }
        }
    }

    /// Takes off the information on parameters what unknown offsets have of it.
    pub fn take_off(self, slopes: &mut Slopes) {
        let Some(factor) = self.directions.information().cholesky() else { return };
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
        Directions::new(&[BandBins {
            ln_ratio,
            shapes,
            modes: &Modes::default(),
            level_sd: sd,
            drift_sd: 0.0,
            table: None,
        }])
        .top()
        .levels[0]
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
            let bins = [BandBins {
                ln_ratio: &ratios,
                shapes: &shapes,
                modes: &modes,
                level_sd: 0.3,
                drift_sd: 0.0,
                table: None,
            }];
            let best = level_of(&ratios, &shapes, 0.3);
            let directions = Directions::new(&bins);
            let at = |level: f64| directions.log_likelihood(&[level / 0.3], 0..1, 0..1);
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
        let bins = [0, 1].map(|b| BandBins {
            ln_ratio: &ratios[b],
            shapes: &shapes,
            modes: &modes,
            level_sd: 0.2,
            drift_sd: 0.0,
            table: None,
        });
        let directions = Directions::new(&bins);
        let found = directions.top();
        assert!((directions.most_probable()[2] - 1.5).abs() < 0.05, "{:?}", directions.most_probable());
        assert!((found.levels[0] - 0.3).abs() < 0.02 && found.levels[1].abs() < 0.02, "{:?}", found.levels);
        is_a_top(&directions, &found);
    }

    /// Nothing near it is more probable.
    fn is_a_top(directions: &Directions<'_>, found: &Offsets) {
        for offset in 0..directions.count() {
            for step in [1e-3, -1e-3] {
                let mut near = directions.most_probable();
                near[offset] += step;
                let value =
                    directions.log_likelihood(&near, 0..directions.bands.len(), 0..directions.count());
                assert!(value < found.log_likelihood, "{offset}");
            }
        }
    }

    #[test]
    fn a_drift_is_found_beside_a_level_with_modes_and_without() {
        let drift = |bin: usize| 0.5 * (PI * (bin as f64 + 0.5) / 60.0).cos();
        let scatter = |bin: usize| 0.05 * (2.3 * bin as f64).sin();
        let ratios: Vec<f64> = (0..60).map(|bin| 0.2 + drift(bin) + scatter(bin)).collect();
        let shapes = vec![400.0; 60];
        // A mode that has nothing to say here.
        let alternating = Modes::new(1, (0..60).map(|bin| if bin % 2 == 0 { 0.1 } else { -0.1 }).collect());
        for modes in [&Modes::default(), &alternating] {
            let bins = [BandBins {
                ln_ratio: &ratios,
                shapes: &shapes,
                modes,
                level_sd: 0.2,
                drift_sd: 0.3,
                table: None,
            }];
            let directions = Directions::new(&bins);
            let found = directions.top();
            assert!((found.levels[0] - 0.2).abs() < 0.02, "{:?}", found.levels);
            for (bin, offset) in found.of[0].iter().enumerate() {
                assert!((offset - 0.2 - drift(bin)).abs() < 0.05, "{bin}: {offset}");
            }
            is_a_top(&directions, &found);
            // The data speak for a drift, and where there is none, against it.
            let without = [BandBins { drift_sd: 0.0, ..bins[0] }];
            let level_alone = Directions::new(&without).log_evidence();
            assert!(directions.log_evidence() > level_alone + 100.0);
            let flat: Vec<f64> = (0..60).map(scatter).collect();
            let flat = [BandBins { ln_ratio: &flat, ..bins[0] }];
            let flat_without = [BandBins { drift_sd: 0.0, ..flat[0] }];
            let evidence = |bins: &[BandBins<'_>]| Directions::new(bins).log_evidence();
            assert!(evidence(&flat) < evidence(&flat_without) - 2.0);
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
        let bins = [BandBins {
            ln_ratio: &vec![0.0; 1000],
            shapes: &shapes,
            modes: &modes,
            level_sd: sd,
            drift_sd: 0.0,
            table: None,
        }];
        let directions = Directions::new(&bins);
        let mut shared = SharedInformation::new(&directions);
        shared.add(0, (&[0, 1, 2], &rows));
        shared.take_off(&mut slopes);
        // One over the variance of the level; what moves bins against each other is known as before; and a quarter of a deviation of
        // the mode is one unit of the last.
        assert!((slopes.information[(0, 0)] - 1.0 / (sd * sd)).abs() < 3.0, "{}", slopes.information);
        assert!((slopes.information[(1, 1)] - 5000.0).abs() < 1.0, "{}", slopes.information);
        assert!((slopes.information[(2, 2)] - 16.0).abs() < 0.2, "{}", slopes.information);
    }
}
