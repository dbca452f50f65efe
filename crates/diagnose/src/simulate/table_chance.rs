//! How chance moves the parameters that a table states.

use crate::observe::stated_parameter::StatedParameter;
use crate::simulate::modes::Modes;
use crate::simulate::table_readings::{TimeAxis, by_width_of_bins, read, readable, slopes};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::SeedableRng;
use rand_distr::{Distribution, Gamma};
use rand_pcg::Pcg64Mcg;

/// Variance of a logarithm below which chance moves nothing.
const NO_CHANCE: f64 = 1e-12;
/// Decays that are drawn: a standard deviation is known to a thirtieth, a correlation to a twentieth.
const DRAWS: usize = 400;
const SEED: u64 = 0x7AB1E;
/// Energy of a drawn bin over what is expected in it, at least.
const LEAST_DRAWN: f64 = 1e-6;

/// How chance moves the readings of a table together.
#[derive(Clone, Debug, Default)]
pub(crate) struct TableChance {
    /// Directions by the interference of arrivals, a standard deviation of each, `[value * count + direction]`.
    own: Vec<f64>,
    count: usize,
    /// Those of the tracer's chance.
    pub modes: Modes,
    /// By how much each reading of a decay that interference makes uneven lies above that of its mean, on average.
    pub bias: Vec<f64>,
    /// By how much each reading depends on where energy comes within its bin.
    pub by_width_of_bins: Vec<f64>,
}

impl TableChance {
    /// From draws of the bins, which scatter as they are expected to; the rays' part to first order. An early decay time hangs on few
    /// arrivals, and is no linear function of them. `None` where a value cannot be read from the prediction.
    pub fn of(
        stated: &[StatedParameter],
        axis: TimeAxis<'_>,
        (ln_energy, variance): (&[f64], &[f64]),
        modes: &Modes,
    ) -> Option<Self> {
        if stated.is_empty() || readable(stated, axis, ln_energy).contains(&false) {
            return None;
        }
        let values = stated.len();
        let (bias, covariance) = scatter(stated, axis, (ln_energy, variance));
        let found = SymmetricEigen::new(covariance);
        let kept: Vec<usize> = (0..values).filter(|&k| found.eigenvalues[k] > NO_CHANCE).collect();
        let direction = |i: usize, k: usize| found.eigenvectors[(i, k)] * found.eigenvalues[k].sqrt();
        let own = (0..values).flat_map(|i| kept.iter().map(move |&k| (i, k))).map(|(i, k)| direction(i, k));
        let by_bin = slopes(stated, axis, ln_energy);
        let moved = |i: usize, mode: usize| -> f64 {
            by_bin[i].iter().enumerate().map(|(bin, slope)| slope * modes.of(bin)[mode]).sum()
        };
        let count = modes.count();
        let moves = (0..values).flat_map(|i| (0..count).map(move |mode| (i, mode))).map(|(i, m)| moved(i, m));
        Some(Self {
            own: own.collect(),
            count: kept.len(),
            modes: Modes::new(count, moves.collect()),
            bias,
            by_width_of_bins: by_width_of_bins(stated, axis, ln_energy),
        })
    }

    /// Number of directions by interference.
    pub fn count(&self) -> usize {
        self.count
    }

    /// What they move a value by.
    pub fn of_value(&self, value: usize) -> &[f64] {
        &self.own[value * self.count..(value + 1) * self.count]
    }

    /// Covariance of the readings by all of them.
    pub fn covariance(&self, values: usize) -> DMatrix<f64> {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        DMatrix::from_fn(values, values, |i, j| {
            product(self.of_value(i), self.of_value(j)) + product(self.modes.of(i), self.modes.of(j))
        })
    }
}

/// Mean and covariance of the readings of drawn decays about that of the decay which they scatter about: energies are Gamma distributed, each
/// bin with its relative variance.
fn scatter(
    stated: &[StatedParameter],
    axis: TimeAxis<'_>,
    (ln_energy, variance): (&[f64], &[f64]),
) -> (Vec<f64>, DMatrix<f64>) {
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let gammas: Vec<Option<Gamma<f64>>> = variance.iter().map(|v| Gamma::new(1.0 / v, *v).ok()).collect();
    let about = read(stated, axis, ln_energy);
    let mut draw = || -> DVector<f64> {
        let drawn = |(ln, gamma): (&f64, &Option<Gamma<f64>>)| {
            ln + gamma.map_or(1.0, |gamma| gamma.sample(&mut random)).max(LEAST_DRAWN).ln()
        };
        let drawn: Vec<f64> = ln_energy.iter().zip(&gammas).map(drawn).collect();
        let read = read(stated, axis, &drawn);
        DVector::from_iterator(about.len(), read.iter().zip(&about).map(|(x, about)| x - about))
    };
    let draws: Vec<DVector<f64>> = (0..DRAWS).map(|_| draw()).collect();
    let count = DRAWS as f64;
    let mean = draws.iter().sum::<DVector<f64>>() / count;
    let products = draws.iter().map(|x| (x - &mean) * (x - &mean).transpose());
    let covariance = products.sum::<DMatrix<f64>>() / (count - 1.0);
    (mean.iter().copied().collect(), covariance)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::simulate::band_state::BandState;
    use crate::simulate::table_readings::tests::{ALL, exponential, stated};
    use rand_distr::StandardNormal;

    fn column(values: &[f64]) -> DVector<f64> {
        DVector::from_column_slice(values)
    }

    #[test]
    fn chance_moves_readings_as_far_and_as_much_together_as_draws_of_the_bins_do() {
        let (bins, ln_energy, time_s) = exponential(0.9, 500.0, 0.8);
        let count = ln_energy.len();
        let mut state = BandState::by_hand(bins, count, 2, 0.0);
        state.ln_energy.clone_from(&ln_energy);
        state.time_s.clone_from(&time_s);
        state.correction = vec![0.0; count];
        state.variance = (0..count).map(|bin| 0.06 + 0.02 * (bin % 3) as f64).collect();
        state.find_table_chance(&stated());
        let chance = state.table.clone().unwrap();
        let expected = chance.covariance(ALL.len());
        let axis = TimeAxis { bins, time_s: &time_s };
        let middle = column(&read(&stated(), axis, &ln_energy));
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut found = DMatrix::<f64>::zeros(ALL.len(), ALL.len());
        let mut mean = DVector::<f64>::zeros(ALL.len());
        let draws = 4000;
        for _ in 0..draws {
            let rays: Vec<f64> =
                (0..state.modes.count()).map(|_| StandardNormal.sample(&mut random)).collect();
            let bin = |k: usize| {
                let along: f64 = state.modes.of(k).iter().zip(&rays).map(|(m, z)| m * z).sum();
                let shape = 1.0 / state.variance[k];
                let drawn: f64 = Gamma::new(shape, 1.0 / shape).unwrap().sample(&mut random);
                ln_energy[k] + along + drawn.ln()
            };
            let drawn: Vec<f64> = (0..count).map(bin).collect();
            let off: DVector<f64> = column(&read(&stated(), axis, &drawn)) - &middle;
            found += &off * off.transpose() / f64::from(draws);
            mean += off / f64::from(draws);
        }
        found -= &mean * mean.transpose();
        for i in 0..ALL.len() {
            let (sd, expected_sd) = (found[(i, i)].sqrt(), expected[(i, i)].sqrt());
            // Of 400 draws a mean is known to a twentieth of the deviation.
            let bias = chance.bias[i];
            assert!((bias - mean[i]).abs() < 0.2 * sd, "{}: {bias} {} +- {sd}", ALL[i], mean[i]);
            assert!((sd / expected_sd - 1.0).abs() < 0.12, "{}: {sd} {expected_sd}", ALL[i]);
            for j in 0..i {
                let correlation = |c: &DMatrix<f64>| c[(i, j)] / (c[(i, i)] * c[(j, j)]).sqrt();
                let (r, expected_r) = (correlation(&found), correlation(&expected));
                assert!((r - expected_r).abs() < 0.15, "{} {}: {r} {expected_r}", ALL[i], ALL[j]);
            }
        }
    }

    /// ISO 3382-2:2008, A.2: one integrated impulse response counts as ten decays of interrupted noise, and in a band of the width B the standard
    /// deviations of T20 and T30 over the places of a diffuse field are these.
    #[test]
    fn decay_times_of_a_diffuse_field_scatter_as_the_standard_says() {
        for (t60_s, hz) in [(1.0, 1000.0), (0.8, 500.0)] {
            let (bins, ln_energy, time_s) = exponential(t60_s, hz, 1.2 * t60_s);
            let width_hz = hz * (2f64.sqrt() - 2f64.sqrt().recip());
            let variance = vec![1.0 / (width_hz * bins.width_s); ln_energy.len()];
            let axis = TimeAxis { bins, time_s: &time_s };
            let chance =
                TableChance::of(&stated(), axis, (&ln_energy, &variance), &Modes::new(0, Vec::new()))
                    .unwrap();
            let found = chance.covariance(ALL.len());
            for (value, a, b) in [(1, 0.88, 1.90), (2, 0.55, 1.52)] {
                let expected = a * ((1.0 + b / 10.0) / (width_hz * t60_s)).sqrt();
                let sd = found[(value, value)].sqrt();
                assert!((sd / expected - 1.0).abs() < 0.2, "{}: {sd} {expected}", ALL[value]);
            }
        }
    }
}
