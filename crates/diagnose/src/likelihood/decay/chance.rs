//! What a prediction would gain by holding less of the tracer's chance than that without any effect.
//!
//! An error of variance V in the logarithm of a prediction costs half of the bin's shape times V of log-likelihood on average. An effect that adds
//! energy beside the paths, or lets other paths count, makes V less, and would be credited with the difference, in every bin of every response,
//! whatever was measured. It is taken off, so that the log-likelihood is on average that of predictions without error (a corrected
//! score: Nakamura 1990, Biometrika 77, 127). Where an effect makes V more, its expected variance grows instead
//! ([`DecayTerm::variance`](crate::effect::DecayTerm::variance)).

use super::{EnergyModel, LN_PER_DB, STEP};
use crate::likelihood::laplace::Slopes;
use crate::simulate::band_state::BandState;
use crate::simulate::reflection_reweighting::HitChanges;
use crate::simulate::views::BandView;
use nalgebra::DMatrix;

/// Step of second differences, as a logarithm of energy.
const BEND_STEP: f64 = 1e-3;
/// Step of one-sided differences, in prior standard deviations.
const SIDE_STEP: f64 = 1e-5;
/// Variance of a logarithm below which nothing is left to chance.
const NO_CHANCE: f64 = 1e-12;
/// Less than this is nothing, in nats.
const LEAST_NATS: f64 = 1e-6;

/// A band of a pair under some values.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub pair: usize,
    pub band: usize,
    /// Logarithm of the energy of the paths before any effect.
    pub paths: &'a [f64],
    /// The same of what is predicted.
    pub predicted: &'a [f64],
}

/// What is taken off in one band.
pub(super) struct TakenOff {
    pub nats: f64,
    /// Nats in each bin that all of its chance costs on average.
    weights: Vec<f64>,
    /// Of which so much is left.
    shares: Vec<f64>,
}

impl EnergyModel<'_> {
    /// What is taken off in a band, if effects make chance less there.
    pub(super) fn chance_taken_off(&self, values: &[f64], at: Place<'_>) -> Option<TakenOff> {
        let weights = self.weights_of_chance(at)?;
        let shares = self.shares_of_chance(values, at);
        let nats: f64 = weights.iter().zip(&shares).map(|(w, share)| w * (share - 1.0)).sum();
        (nats < -LEAST_NATS).then_some(TakenOff { nats, weights, shares })
    }

    /// Adds the gradient of it. `path_slopes` is the change of each bin's paths with each absorption, `[bin * materials + material]`. Its
    /// curvature is left out: it would make intervals wider by little, and could leave none.
    pub(super) fn add_chance_gradient(
        &self,
        values: &[f64],
        at: Place<'_>,
        (taken_off, path_slopes): (&TakenOff, &[f64]),
        slopes: &mut Slopes,
    ) {
        let TakenOff { weights, shares, .. } = taken_off;
        // With the paths, each bin by itself: a share is the square of a slope.
        let gain_db = self.gain_db(values, at.pair);
        let changes = HitChanges::default();
        let view = self.view((at.pair, at.band), gain_db, &changes);
        let [up, down] =
            [BEND_STEP, -BEND_STEP].map(|more| self.with_paths(values, &view, gain_db, at.paths, more));
        let m = self.data.absorption.len();
        for (bin, (weight, share)) in weights.iter().zip(shares).enumerate() {
            let slope = (up[bin] - down[bin]) / (2.0 * BEND_STEP);
            let bend = (up[bin] - 2.0 * at.predicted[bin] + down[bin]) / (BEND_STEP * BEND_STEP);
            if slope <= 0.0 {
                continue;
            }
            let with_paths = weight * 2.0 * share * bend / slope;
            for k in 0..m {
                slopes.gradient[self.layout.absorption(k, at.band)] += with_paths * path_slopes[bin * m + k];
            }
        }
        let own_gain = self.layout.gain(self.assignment[at.pair]);
        let with_gain = self.chance_slope(values, at, taken_off, own_gain);
        for index in self.layout.common_gain().into_iter().chain([own_gain]) {
            slopes.gradient[index] += with_gain;
        }
        for placed in &self.terms {
            for (i, p) in placed.case.parameters.iter().enumerate() {
                if self.bears_on(p, at.pair, at.band) {
                    let index = placed.first + i;
                    slopes.gradient[index] += self.chance_slope(values, at, taken_off, index);
                }
            }
        }
    }

    /// Change of what is taken off with a gain or a parameter of an effect.
    fn chance_slope(&self, values: &[f64], at: Place<'_>, taken_off: &TakenOff, index: usize) -> f64 {
        let (prior, mut moved) = (self.priors[index], values.to_vec());
        let step = SIDE_STEP * prior.sd;
        moved[index] =
            if values[index] + step < prior.high { values[index] + step } else { values[index] - step };
        let louder = (self.gain_db(&moved, at.pair) - self.gain_db(values, at.pair)) * LN_PER_DB;
        let paths: Vec<f64> = at.paths.iter().map(|p| p + louder).collect();
        let predicted = self.affected(&moved, (at.pair, at.band), paths.clone());
        let shares = self.shares_of_chance(&moved, Place { paths: &paths, predicted: &predicted, ..at });
        let change = shares.iter().zip(&taken_off.shares).zip(&taken_off.weights);
        change.map(|((now, before), w)| w * (now - before)).sum::<f64>() / (moved[index] - values[index])
    }

    /// Nats in each bin that all of its chance costs on average; none where there is no effect, or nothing is left to chance.
    fn weights_of_chance(&self, at: Place<'_>) -> Option<Vec<f64>> {
        let weights = self.data.states[at.pair][at.band].weights_of_chance(self.data.dispersion[at.band]);
        let weights: Vec<f64> = weights.take(at.paths.len()).collect();
        (!self.terms.is_empty() && weights.iter().any(|w| *w > 0.0)).then_some(weights)
    }

    /// Variance of the logarithm of each predicted bin by the tracer's chance, as a share of that without any effect.
    fn shares_of_chance(&self, values: &[f64], at: Place<'_>) -> Vec<f64> {
        let through = self.through_paths(values, at);
        let Some(mixed) = self.mixed_chance(values, at) else {
            return through.iter().map(|t| t * t).collect();
        };
        let BandState { batch_deviations: stated, batches, .. } = &self.data.states[at.pair][at.band];
        let bins = mixed.chunks_exact(*batches).zip(stated.chunks_exact(*batches)).zip(&through);
        let share = |((mixed, stated), through): ((&[f64], &[f32]), &f64)| {
            let whole: f64 = stated.iter().map(|d| f64::from(d * d)).sum();
            let now: f64 = mixed.iter().map(|d| d * d).sum();
            if whole > NO_CHANCE { through * through * now / whole } else { 1.0 }
        };
        bins.map(share).collect()
    }

    /// How much of a change of the logarithm of the paths' energy, those of neighbouring octaves among them, is predicted.
    fn through_paths(&self, values: &[f64], at: Place<'_>) -> Vec<f64> {
        let gain_db = self.gain_db(values, at.pair);
        let changes = HitChanges::default();
        let view = self.view((at.pair, at.band), gain_db, &changes);
        let louder = self.with_paths(values, &view, gain_db, at.paths, STEP);
        louder.iter().zip(at.predicted).map(|(up, here)| (up - here) / STEP).collect()
    }

    /// What each batch of rays moves the paths' energy by, `[bin * batches + batch]`, if not all paths count as stated.
    fn mixed_chance(&self, values: &[f64], at: Place<'_>) -> Option<Vec<f64>> {
        let changes = HitChanges::default();
        let view = self.view((at.pair, at.band), self.gain_db(values, at.pair), &changes);
        let stated = || self.data.states[at.pair][at.band].batch_deviations.iter().map(|d| f64::from(*d));
        let mut mixed: Option<Vec<f64>> = None;
        for placed in &self.terms {
            let Some(term) = placed.case.decay_term() else { continue };
            let Some(own) = term.chance(placed.own(values), &view.with_table(placed.case.slot)) else {
                continue;
            };
            let all = mixed.get_or_insert_with(|| stated().collect());
            all.iter_mut().zip(own.iter().zip(stated())).for_each(|(d, (now, stated))| *d += now - stated);
        }
        mixed
    }

    /// What each batch of rays moves the predicted logarithms of all compared bins of a pair by, `(bin, batch)`, in the order of
    /// [`EnergyModel::expansion`], each bin in units of what costs a nat.
    pub fn chance(&self, values: &[f64], pair: usize) -> DMatrix<f64> {
        let (mut rows, mut batches) = (Vec::new(), 1);
        for one in self.compared_bands(values, pair, false) {
            let at = one.place(pair);
            let state = &self.data.states[pair][one.band];
            batches = state.batches;
            let mixed = self.mixed_chance(values, at);
            let mixed =
                mixed.unwrap_or_else(|| state.batch_deviations.iter().map(|d| f64::from(*d)).collect());
            let through = self.through_paths(values, at);
            for (bin, (through, variance)) in through.iter().zip(&one.variances).enumerate() {
                let own = &state.batch_deviations[bin * batches..][..batches];
                let whole: f64 = own.iter().map(|d| f64::from(d * d)).sum();
                let paid = if whole > NO_CHANCE { state.monte_carlo[bin] / whole } else { 1.0 };
                let unit = through * (0.5 * paid / (variance * self.data.dispersion[one.band])).sqrt();
                rows.extend(mixed[bin * batches..][..batches].iter().map(|d| unit * d));
            }
        }
        DMatrix::from_row_slice(rows.len() / batches, batches, &rows)
    }

    /// Logarithm of what is predicted if the paths, those of neighbouring octaves among them, carried more by this logarithm.
    fn with_paths(
        &self,
        values: &[f64],
        view: &BandView<'_>,
        gain_db: f64,
        paths: &[f64],
        more: f64,
    ) -> Vec<f64> {
        let mut moved: Vec<f64> = paths.iter().map(|p| p + more).collect();
        self.apply(values, view, gain_db + more / LN_PER_DB, &mut moved);
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Case, Effect};
    use crate::effects::CoupledVolume;
    use crate::hand_made::Tables;
    use crate::likelihood::decay::EnergyData;
    use crate::likelihood::laplace::Model;
    use crate::simulate::modes::Modes;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;
    use sabine_paths::PathSet;
    use sabine_scene::{Levels, TimeZero};

    /// Variance of the logarithm of each prediction by chance.
    const CHANCE: f64 = 0.01;
    const DRAWS: usize = 4000;
    const BATCHES: usize = PathSet::BATCHES as usize;

    /// Neutral values, but for a coupled volume, where the model has one, that is far louder than the paths late in the decay.
    fn loud(model: &EnergyModel<'_>) -> Vec<f64> {
        let mut values = model.start(None);
        if let [level, _, decay_s, ..] = &mut values[model.layout.len()..] {
            (*level, *decay_s) = (10.0, 2.0);
        }
        values
    }

    /// Mean of the log-likelihood of predictions with an error of [`CHANCE`] less that without any, where the measurement is what the latter
    /// says: of the model with these cases.
    fn mean_cost(cases: &[&Case]) -> f64 {
        let mut tables = Tables::new(Levels::Absolute, TimeZero::Emission);
        for state in tables.states.iter_mut().flatten() {
            state.variance.fill(0.05);
            state.modes = Modes::default();
        }
        let used = [true; 3];
        let exact = tables.states.clone();
        // A level of its own would follow the error.
        let of = |tables: &Tables| -> f64 {
            let data = EnergyData { level_sd: &[1e-6; 2], drift_sd: &[0.0; 2], ..tables.energy_data() };
            let model = EnergyModel::new(&data, cases, &used);
            model.log_likelihood(&loud(&model), None)
        };
        for pair in 0..3 {
            for band in 0..2 {
                let data = tables.energy_data();
                let model = EnergyModel::new(&data, cases, &used);
                let count = tables.states[pair][band].ln_energy.len();
                let energies =
                    model.predicted(&loud(&model), pair, band, count).iter().map(|l| l.exp()).collect();
                tables.measured[pair].energies[band] = Some(energies);
            }
        }
        let without_error = of(&tables);
        tables.states.iter_mut().flatten().for_each(|state| state.monte_carlo.fill(CHANCE));
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let mut sum = 0.0;
        for _ in 0..DRAWS {
            for (state, exact) in tables.states.iter_mut().flatten().zip(exact.iter().flatten()) {
                for bin in 0..exact.ln_energy.len() {
                    let deviate: f64 = StandardNormal.sample(&mut random);
                    // What a logarithm loses by chance on average is corrected for where predictions are made.
                    let error = (CHANCE.sqrt() * deviate - 0.5 * CHANCE).exp();
                    for group in exact.groups[bin]..exact.groups[bin + 1] {
                        state.group_energy[group] = exact.group_energy[group] * error;
                    }
                }
            }
            sum += of(&tables) - without_error;
        }
        sum / DRAWS as f64
    }

    #[test]
    fn what_makes_chance_less_gains_nothing_by_it() {
        let plain = mean_cost(&[]);
        // 0.01 / (2 x 0.05 x dispersion) in each of 84 bins, the dispersion being some 1.
        assert!((-12.0..-5.0).contains(&plain), "{plain}");
        let cases = CoupledVolume.cases(&Tables::new(Levels::Absolute, TimeZero::Emission).survey);
        let cases: Vec<&Case> = cases.iter().collect();
        // Three quarters of what chance costs are no more.
        let with = mean_cost(&cases);
        assert!((with / plain - 1.0).abs() < 0.06, "{with} {plain}");
    }

    #[test]
    fn what_chance_makes_of_the_difference_of_two_predictions_is_told() {
        let mut tables = Tables::new(Levels::Absolute, TimeZero::Emission);
        for state in tables.states.iter_mut().flatten() {
            // All of the chance is paid for.
            let own = state.batch_deviations.chunks_exact(BATCHES);
            state.monte_carlo = own.map(|own| own.iter().map(|d| f64::from(d * d)).sum()).collect();
        }
        let cases = CoupledVolume.cases(&tables.survey);
        let cases: Vec<&Case> = cases.iter().collect();
        let used = [true; 3];
        let exact = tables.states.clone();
        let (pair, dispersion) = (1, tables.energy_data().dispersion.to_vec());
        // Predictions with a coupled volume less those without.
        let apart = |tables: &Tables| -> DMatrix<f64> {
            let data = tables.energy_data();
            let [without, with] = [&[][..], &cases].map(|cases| {
                let model = EnergyModel::new(&data, cases, &used);
                model.prediction(&loud(&model), pair)
            });
            DMatrix::from_column_slice(with.len(), 1, (with - without).as_slice())
        };
        let exactly = apart(&tables);
        let mut random = Pcg64Mcg::seed_from_u64(6);
        let mut sum = 0.0;
        for _ in 0..DRAWS {
            let deviates: Vec<f64> = (0..BATCHES).map(|_| StandardNormal.sample(&mut random)).collect();
            for (state, exact) in tables.states[pair].iter_mut().zip(&exact[pair]) {
                for bin in 0..exact.ln_energy.len() {
                    let own = &exact.batch_deviations[bin * BATCHES..][..BATCHES];
                    let error: f64 = own.iter().zip(&deviates).map(|(d, z)| f64::from(*d) * z).sum();
                    for group in exact.groups[bin]..exact.groups[bin + 1] {
                        state.group_energy[group] = exact.group_energy[group] * error.exp();
                    }
                }
            }
            let off = apart(&tables) - &exactly;
            let variances = exact[pair].iter().zip(&dispersion);
            let weights = variances.flat_map(|(state, d)| state.variance.iter().map(move |v| 1.0 / (v * d)));
            sum += off.iter().zip(weights).map(|(off, weight)| weight * off * off).sum::<f64>();
        }
        let data = tables.energy_data();
        let [without, with] = [&[][..], &cases].map(|cases| {
            let model = EnergyModel::new(&data, cases, &used);
            model.chance(&loud(&model), pair)
        });
        let (found, expected) = (2.0 * (with - without).norm_squared(), sum / DRAWS as f64);
        assert!(expected > 0.01 && (found / expected - 1.0).abs() < 0.1, "{found} {expected}");
    }
}
