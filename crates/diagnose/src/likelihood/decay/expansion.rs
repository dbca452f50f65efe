//! The bins of one response, expanded about some values.

use super::EnergyModel;
use super::offsets::{BandBins, Directions};
use super::pair_likelihood::ComparedBand;
use crate::likelihood::expansion::Expansion;
use crate::statistics::pull;
use nalgebra::{DMatrix, DVector};

impl EnergyModel<'_> {
    /// All compared bins of a pair, one band after the other. Levels, drift and the tracer's chance are errors that they share.
    pub fn expansion(&self, values: &[f64], pair: usize) -> Expansion {
        let compared = self.compared_bands(values, pair, true);
        let bins: Vec<BandBins<'_>> = compared.iter().map(ComparedBand::bins).collect();
        let count: usize = compared.iter().map(|one| one.predicted.len()).sum();
        let mut slopes = DMatrix::zeros(count, self.priors.len());
        let mut first = 0;
        for one in &compared {
            let (columns, rows) = self.rows(values, pair, one);
            for (&column, row) in columns.iter().zip(&rows) {
                row.iter().enumerate().for_each(|(bin, slope)| slopes[(first + bin, column)] += slope);
            }
            first += one.predicted.len();
        }
        let weights = bins.iter().flat_map(|b| b.shapes.iter().copied());
        Expansion {
            predicted: self.ln_energies(&compared, count),
            weights: DVector::from_iterator(count, weights),
            shared: Directions::new(&bins).matrix(count),
            slopes,
        }
    }

    /// What the bins of a pair, in the order of [`EnergyModel::expansion`], pull at the prediction: the slope of the log-likelihood with the
    /// logarithm of each predicted energy, levels, drift and the tracer's chance where they are most probable.
    pub fn pulls(&self, values: &[f64], pair: usize) -> DVector<f64> {
        let compared = self.compared_bands(values, pair, false);
        let bins: Vec<BandBins<'_>> = compared.iter().map(ComparedBand::bins).collect();
        let offsets = Directions::new(&bins).top();
        let of_band = |(own, offset): (&BandBins<'_>, &Vec<f64>)| -> Vec<f64> {
            let each = own.ln_ratio.iter().zip(offset).zip(own.shapes);
            each.map(|((z, offset), shape)| shape * pull(z - offset)).collect()
        };
        let all: Vec<f64> = bins.iter().zip(&offsets.of).flat_map(of_band).collect();
        DVector::from_vec(all)
    }

    /// The compared bands of a pair and how many bins of each, in the order of [`EnergyModel::expansion`].
    pub fn rows_of(&self, pair: usize) -> Vec<(usize, usize)> {
        let bands = 0..self.data.survey.bands.len();
        bands.filter_map(|band| Some((band, self.compared(pair, band)?.len()))).collect()
    }

    /// The parameter that is the gain of the response which holds a pair, in dB.
    pub fn gain_of(&self, pair: usize) -> usize {
        self.layout.gain(self.assignment[pair])
    }

    /// Predicted logarithms of all compared bins of a pair, in the order of [`EnergyModel::expansion`].
    pub fn prediction(&self, values: &[f64], pair: usize) -> DVector<f64> {
        let compared = self.compared_bands(values, pair, false);
        let count = compared.iter().map(|one| one.predicted.len()).sum();
        self.ln_energies(&compared, count)
    }

    fn ln_energies(&self, compared: &[ComparedBand<'_>], count: usize) -> DVector<f64> {
        DVector::from_iterator(count, compared.iter().flat_map(|one| one.predicted.iter().copied()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::{SourceDirectivity, TransducerResponse};
    use crate::hand_made::Tables;
    use crate::likelihood::laplace::{Model, Slopes};
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn what_the_bins_say_is_the_information_of_the_likelihood() {
        let tables = Tables::new(Levels::Common, TimeZero::Emission);
        let data = tables.energy_data();
        let effects: [&dyn Effect; 2] = [&TransducerResponse, &SourceDirectivity];
        let cases: Vec<_> = effects.iter().flat_map(|e| e.cases(&tables.survey)).collect();
        let cases: Vec<_> = cases.iter().collect();
        for pair in 0..3 {
            let used: Vec<bool> = (0..3).map(|p| p == pair).collect();
            let model = EnergyModel::new(&data, &cases, &used);
            let mut values = model.start(None);
            values.iter_mut().skip(model.layout.len()).enumerate().for_each(|(i, v)| *v += 0.01 * i as f64);
            let mut slopes = Slopes::zero(values.len());
            model.log_likelihood(&values, Some(&mut slopes));
            let one = model.expansion(&values, pair);
            let found = one.products(&one.slopes);
            let size = slopes.information.amax();
            assert!(size > 1.0 && (found - slopes.information).amax() < 1e-9 * size);
            assert_eq!(one.predicted, model.prediction(&values, pair));
            // What bins pull at the prediction is the slope of the likelihood.
            let pulled = one.slopes.tr_mul(&model.pulls(&values, pair));
            assert!((pulled - &slopes.gradient).amax() < 1e-9 * slopes.gradient.amax());
            let rows: usize = model.rows_of(pair).iter().map(|(_, count)| count).sum();
            assert_eq!(rows, one.predicted.len());
        }
    }
}
