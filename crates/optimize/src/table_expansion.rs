//! The values of a table against the paths near given materials.

use crate::expansion::Bins;
use crate::parameter_readings::reading;
use crate::table_band::{TableBand, TableReadings};
use nalgebra::{DMatrix, DVector};

/// A value on the scale of the fit, and its derivative by the energy of each bin.
type Slope = (f64, Vec<f64>);

/// A table of a pair in a band, expanded about an absorption: energies follow the mean hits of their bins as in
/// [`Expansion`](crate::expansion::Expansion).
pub(crate) struct TableExpansion<'b> {
    pub band: &'b TableBand<'b>,
    about: Vec<f64>,
    bins: Bins,
    /// Inverse covariance of measured less predicted; held while the materials move.
    pub weight: DMatrix<f64>,
    /// Covariance of the measurement by chance.
    pub chance: DMatrix<f64>,
    /// What each batch of rays adds to each value.
    pub parts: Vec<DVector<f64>>,
}

impl<'b> TableExpansion<'b> {
    /// `None` where a value cannot be read.
    pub fn about(band: &'b TableBand<'b>, absorption: &[f64], path_error: f64) -> Option<Self> {
        let readings = band.readings(absorption, path_error)?;
        let weight = readings.weight();
        let TableReadings { chance, parts, .. } = readings;
        let bins = Bins::of(&band.traces, absorption);
        Some(Self { band, about: absorption.to_vec(), bins, weight, chance, parts })
    }

    /// The same about another absorption, the values weighing what they weigh here; `None` where one cannot be read there.
    pub fn moved_to(&self, absorption: &[f64]) -> Option<Self> {
        let moved = Self {
            band: self.band,
            about: absorption.to_vec(),
            bins: Bins::of(&self.band.traces, absorption),
            weight: self.weight.clone(),
            chance: self.chance.clone(),
            parts: self.parts.clone(),
        };
        moved.read(absorption).map(|_| moved)
    }

    /// Energies at an absorption, the values there and their derivatives by them.
    fn read(&self, absorption: &[f64]) -> Option<(Vec<f64>, Vec<Slope>)> {
        let ratio = |(a, a0): (&f64, &f64)| (-a).ln_1p() - (-a0).ln_1p();
        let change: Vec<f64> = absorption.iter().zip(&self.about).map(ratio).collect();
        let rows = self.bins.hits.chunks_exact(change.len());
        let of = |(e, hits): (&f64, &[f64])| {
            if *e == 0.0 { 0.0 } else { e * hits.iter().zip(&change).map(|(h, c)| h * c).sum::<f64>().exp() }
        };
        let energy: Vec<f64> = self.bins.energy.iter().zip(rows).map(of).collect();
        let values = self.band.values.iter();
        let read =
            values.map(|value| reading(value.kind, &energy, self.bins.bin_s)).collect::<Option<_>>()?;
        Some((energy, read))
    }

    /// Half the squared distance of the measured values from the predicted ones. `gradient` receives its derivative by each absorption,
    /// added to what is there. Infinite where a value cannot be read.
    pub fn cost(&self, absorption: &[f64], gradient: &mut [f64], share: f64) -> f64 {
        let Some((energy, read)) = self.read(absorption) else { return f64::INFINITY };
        let residual = self.residual(&read);
        let weighted = &self.weight * &residual;
        let rows = self.bins.hits.chunks_exact(absorption.len());
        for (j, (e, hits)) in energy.iter().zip(rows).enumerate() {
            // Of measured less predicted; a hit more takes energy away.
            let by: f64 = weighted.iter().zip(&read).map(|(w, (_, by))| w * by[j]).sum();
            for ((g, h), a) in gradient.iter_mut().zip(hits).zip(absorption) {
                *g += share * by * e * h / (1.0 - a);
            }
        }
        0.5 * share * residual.dot(&weighted)
    }

    /// Squared distance in what it is by chance, and the number of values.
    pub fn chi_squared(&self, absorption: &[f64]) -> (f64, f64) {
        let cost = self.cost(absorption, &mut vec![0.0; absorption.len()], 1.0);
        (2.0 * cost, self.band.values.len() as f64)
    }

    fn residual(&self, read: &[Slope]) -> DVector<f64> {
        let values = self.band.values.iter().zip(read);
        DVector::from_iterator(read.len(), values.map(|(value, (predicted, _))| value.measured - predicted))
    }

    /// Derivative of each value by the absorption of each material, at an absorption.
    pub fn slopes(&self, absorption: &[f64]) -> Option<DMatrix<f64>> {
        let (energy, read) = self.read(absorption)?;
        let k = absorption.len();
        let of = |i: usize, m: usize| {
            let by = &read[i].1;
            let sum: f64 = (0..energy.len()).map(|j| by[j] * energy[j] * self.bins.hits[j * k + m]).sum();
            -sum / (1.0 - absorption[m])
        };
        Some(DMatrix::from_fn(read.len(), k, of))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MeasuredParameter;
    use crate::history::History;
    use sabine_acoustics::{Air, Bands, ParameterKind};
    use sabine_paths::{Contribution, PathSet, Reflection};

    /// Rays and a few exact paths that meet two materials unequally often.
    fn paths() -> PathSet {
        let mut set = PathSet::new(2, 350.0);
        let up = [0.0, 0.0, 1.0];
        for ray in 0..64usize {
            let mut chain = PathSet::DIRECT;
            for hit in 0..80usize {
                let length_m = 4.0 + 4.2 * hit as f64 + 0.06 * ray as f64;
                let batch = (ray >= 2).then_some((ray % 32) as u8);
                let log_weight = -0.3 * ((7 * ray + hit) % 5) as f64;
                set.push(Contribution {
                    length_m,
                    log_weight,
                    chain,
                    tail: PathSet::DIRECT,
                    departure: up,
                    arrival: up,
                    batch,
                });
                chain =
                    set.reflect(chain, u32::from((ray + hit * hit).is_multiple_of(3)), Reflection::Specular);
            }
        }
        set
    }

    #[test]
    fn the_gradient_is_that_of_central_differences_and_exact_where_it_is_expanded() {
        let (set, air) = (paths(), Air::default());
        let history = History::since_first_arrival(&set, &air, None, 1e-3);
        let weights = (0..history.len()).map(|i| 1.0 - 0.4 * ((i % 7) as f32) / 7.0).collect();
        let of = |(kind, value)| MeasuredParameter { band_hz: 500.0, kind, value, standard_deviation: None };
        let list: Vec<MeasuredParameter> = [
            (ParameterKind::Edt, 0.6),
            (ParameterKind::T20, 0.7),
            (ParameterKind::T30, 0.72),
            (ParameterKind::C80, 3.0),
            (ParameterKind::C50, 0.4),
            (ParameterKind::CentreTime, 0.06),
        ]
        .map(of)
        .to_vec();
        let band = TableBand::new(&list, (Bands::octaves(500.0, 500.0).unwrap(), 0), (&history, weights));
        let about = [0.12, 0.2];
        let expansion = TableExpansion::about(&band, &about, 0.25).unwrap();
        for at in [about, [0.1, 0.26]] {
            let mut gradient = [0.0; 2];
            expansion.cost(&at, &mut gradient, 0.7);
            for k in 0..2 {
                let moved = |step: f64| {
                    let mut a = at;
                    a[k] += step;
                    expansion.cost(&a, &mut [0.0; 2], 0.7)
                };
                let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                assert!(
                    (gradient[k] - difference).abs() < 1e-4 * difference.abs(),
                    "{gradient:?} {difference}"
                );
            }
        }
        // At the point of expansion the paths themselves have this slope.
        let slopes = expansion.slopes(&about).unwrap();
        let plain = |a: &[f64; 2]| expansion.moved_to(a).unwrap().read(a).unwrap().1;
        for k in 0..2 {
            let moved = |step: f64| {
                let mut a = about;
                a[k] += step;
                plain(&a)
            };
            let (up, down) = (moved(1e-5), moved(-1e-5));
            for i in 0..list.len() {
                let difference = (up[i].0 - down[i].0) / 2e-5;
                let slope = slopes[(i, k)];
                assert!(
                    (slope - difference).abs() < 1e-3 * difference.abs().max(0.1),
                    "{i} {k}: {slope} {difference}"
                );
            }
        }
    }
}
