//! The likelihood of one response and its slopes.

use super::chance::{Place, TakenOff};
use super::offsets::{BandBins, Directions, SharedInformation};
use super::table_band::TableBand;
use super::{EnergyModel, LN_PER_DB, STEP};
use crate::effect::DecayTerm;
use crate::likelihood::laplace::Slopes;
use crate::likelihood::parameters::ModelTerm;
use crate::simulate::modes::Modes;
use crate::simulate::reflection_reweighting::HitChanges;
use crate::simulate::views::BandView;
use crate::statistics::pull;

/// The compared bins of one band of a response under some values.
pub(super) struct ComparedBand<'a> {
    pub band: usize,
    /// Logarithm of the energy of the paths before any effect, and, where slopes are wanted, its change with each absorption.
    paths: (Vec<f64>, Vec<f64>),
    /// Logarithm of the predicted energy.
    pub predicted: Vec<f64>,
    /// Logarithm of measured over predicted energy.
    pub ln_ratio: Vec<f64>,
    /// Expected relative variances, dispersion left out.
    pub variances: Vec<f64>,
    /// Shapes of the Gamma distributions.
    shapes: Vec<f64>,
    modes: &'a Modes,
    level_sd: f64,
    drift_sd: f64,
    /// The table whose values take the place of the bins, where the pair has one.
    table: Option<TableBand<'a>>,
}

impl ComparedBand<'_> {
    pub fn place(&self, pair: usize) -> Place<'_> {
        Place { pair, band: self.band, paths: &self.paths.0, predicted: &self.predicted }
    }

    pub fn bins(&self) -> BandBins<'_> {
        let Self { ln_ratio, shapes, modes, level_sd, drift_sd, table, .. } = self;
        let table = table.as_ref().map(|table| table.chance);
        BandBins { ln_ratio, shapes, modes, level_sd: *level_sd, drift_sd: *drift_sd, table }
    }
}

impl EnergyModel<'_> {
    /// The bands of a pair that are compared; `sloping` if slopes are wanted of them.
    pub(super) fn compared_bands(&self, values: &[f64], pair: usize, sloping: bool) -> Vec<ComparedBand<'_>> {
        (0..self.data.survey.bands.len())
            .filter_map(|band| {
                let energies = self.compared(pair, band)?;
                let bins = self.predicted_bins(pair, band, energies.len());
                let paths = self.paths(values, (pair, band), bins, sloping);
                let ln_energy = self.affected(values, (pair, band), paths.0.clone());
                let table = self.table(pair, band, &ln_energy);
                let (predicted, variances, modes) = match &table {
                    Some(table) => (table.predicted(), table.variances(), &table.chance.modes),
                    None => {
                        let variances = self.variances(values, pair, band, bins);
                        (ln_energy, variances, &self.data.states[pair][band].modes)
                    }
                };
                let ln_ratio = self.ln_ratio(band, energies, &predicted);
                let shapes = self.shapes(band, &variances);
                Some(ComparedBand {
                    band,
                    paths,
                    predicted,
                    ln_ratio,
                    variances,
                    shapes,
                    modes,
                    level_sd: self.data.level_sd[band],
                    drift_sd: self.data.drift_sd[band],
                    table,
                })
            })
            .collect()
    }

    /// Log-likelihood of one pair, its slopes added where wanted.
    pub(super) fn pair_likelihood(&self, values: &[f64], pair: usize, slopes: Option<&mut Slopes>) -> f64 {
        let compared = self.compared_bands(values, pair, slopes.is_some());
        let bins: Vec<BandBins<'_>> = compared.iter().map(ComparedBand::bins).collect();
        let directions = Directions::new(&bins);
        let offsets = directions.top();
        // What a table leaves to chance no effect changes.
        let of_bins = |one: &&ComparedBand<'_>| one.table.is_none();
        let tops: f64 =
            compared.iter().filter(of_bins).map(|one| self.tops((pair, one.band), &one.variances)).sum();
        let taken_off: Vec<Option<TakenOff>> = compared
            .iter()
            .map(|one| {
                Some(one).filter(of_bins).and_then(|one| self.chance_taken_off(values, one.place(pair)))
            })
            .collect();
        let chance: f64 = taken_off.iter().flatten().map(|t| t.nats).sum();
        let value = offsets.log_likelihood + tops + chance;
        let Some(slopes) = slopes else { return value };
        let mut shared = SharedInformation::new(&directions);
        for (place, (one, offset)) in compared.iter().zip(&offsets.of).enumerate() {
            let ln_ratio: Vec<f64> = one.ln_ratio.iter().zip(offset).map(|(z, offset)| z - offset).collect();
            let (columns, rows) = self.rows(values, pair, one);
            add_slopes(slopes, (&columns, &rows), (&one.shapes, &ln_ratio));
            shared.add(place, (&columns, &rows));
            if one.table.is_none() {
                self.add_variance_slopes(values, (pair, one.band), &one.variances, &ln_ratio, slopes);
            }
            if let Some(taken_off) = &taken_off[place] {
                self.add_chance_gradient(values, one.place(pair), (taken_off, &one.paths.1), slopes);
            }
        }
        shared.take_off(slopes);
        value
    }

    /// Columns that matter in a band, and the change of the predicted logarithm of each bin with each.
    pub(super) fn rows(
        &self,
        values: &[f64],
        pair: usize,
        one: &ComparedBand<'_>,
    ) -> (Vec<usize>, Vec<Vec<f64>>) {
        let (band, (paths, path_slopes)) = (one.band, &one.paths);
        let m = self.data.absorption.len();
        let gain_db = self.gain_db(values, pair);
        let changes = HitChanges::default();
        let view = self.view((pair, band), gain_db, &changes);
        let mut columns: Vec<usize> = (0..m).map(|k| self.layout.absorption(k, band)).collect();
        let through = self.through(values, &view, gain_db, paths);
        let mut rows: Vec<Vec<f64>> = (0..m)
            .map(|k| (0..paths.len()).map(|bin| path_slopes[bin * m + k] * through[bin]).collect())
            .collect();
        // What is added beside the paths has the same gain.
        let adds = |p: &ModelTerm<'_>| p.case.decay_term().is_some_and(DecayTerm::adds_sound_of_source);
        let gained =
            if self.terms.iter().any(adds) { self.with_gain(values, &view, gain_db, paths) } else { through };
        let gain: Vec<f64> = gained.iter().map(|t| t * LN_PER_DB).collect();
        if let Some(index) = self.layout.common_gain() {
            columns.push(index);
            rows.push(gain.clone());
        }
        columns.push(self.layout.gain(self.assignment[pair]));
        rows.push(gain);
        for placed in &self.terms {
            for (i, p) in placed.case.parameters.iter().enumerate() {
                if self.bears_on(p, pair, band) {
                    columns.push(placed.first + i);
                    rows.push(self.difference(values, placed.first + i, &view, gain_db, paths));
                }
            }
        }
        if let Some(table) = &one.table {
            let by_bin = table.slopes();
            let along = |row: &Vec<f64>| -> Vec<f64> {
                by_bin.iter().map(|own| own.iter().zip(row).map(|(s, x)| s * x).sum()).collect()
            };
            rows.iter_mut().for_each(|row| *row = along(row));
        }
        (columns, rows)
    }

    /// How much of a change of the paths' energy comes through the effects.
    fn through(&self, values: &[f64], view: &BandView<'_>, gain_db: f64, paths: &[f64]) -> Vec<f64> {
        let at = |offset: f64| {
            let mut moved: Vec<f64> = paths.iter().map(|p| p + offset).collect();
            self.apply(values, view, gain_db, &mut moved);
            moved
        };
        at(STEP).iter().zip(at(-STEP)).map(|(up, down)| (up - down) / (2.0 * STEP)).collect()
    }

    /// The same of a change of the gain, with which goes what does not come along the paths.
    fn with_gain(&self, values: &[f64], view: &BandView<'_>, gain_db: f64, paths: &[f64]) -> Vec<f64> {
        let at = |offset: f64| {
            let mut moved: Vec<f64> = paths.iter().map(|p| p + offset).collect();
            let view = BandView { gain: view.gain * offset.exp(), ..*view };
            self.apply(values, &view, gain_db + offset / LN_PER_DB, &mut moved);
            moved
        };
        at(STEP).iter().zip(at(-STEP)).map(|(up, down)| (up - down) / (2.0 * STEP)).collect()
    }

    /// Change of the predicted logarithm with a parameter of an effect.
    fn difference(
        &self,
        values: &[f64],
        index: usize,
        view: &BandView<'_>,
        gain_db: f64,
        paths: &[f64],
    ) -> Vec<f64> {
        let prior = self.priors[index];
        let step = STEP * prior.sd;
        let at = |offset: f64| {
            let mut moved = values.to_vec();
            moved[index] = (moved[index] + offset).clamp(prior.low, prior.high);
            let mut ln_energy = paths.to_vec();
            self.apply(&moved, view, gain_db, &mut ln_energy);
            (moved[index], ln_energy)
        };
        let ((high, up), (low, down)) = (at(step), at(-step));
        if high <= low {
            return vec![0.0; paths.len()];
        }
        up.iter().zip(down).map(|(u, d)| (u - d) / (high - low)).collect()
    }
}

/// Adds what the bins of one band say.
fn add_slopes(
    slopes: &mut Slopes,
    (columns, rows): (&[usize], &[Vec<f64>]),
    (shapes, ln_ratio): (&[f64], &[f64]),
) {
    for (bin, (&weight, ln_ratio)) in shapes.iter().zip(ln_ratio).enumerate() {
        let pull = weight * pull(*ln_ratio);
        for (i, &a) in columns.iter().enumerate() {
            let slope = rows[i][bin];
            if slope == 0.0 {
                continue;
            }
            slopes.gradient[a] += pull * slope;
            for (j, &b) in columns[..=i].iter().enumerate() {
                let product = weight * slope * rows[j][bin];
                slopes.information[(a, b)] += product;
                if a != b {
                    slopes.information[(b, a)] += product;
                }
            }
        }
    }
}
