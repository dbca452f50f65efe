//! What a prediction would gain by holding less of the tracer's chance than that without any effect.
//!
//! An error of variance V in the logarithm of a prediction costs half of the bin's shape times V of log-likelihood on average. An effect that adds
//! energy beside the paths, or lets other paths count, makes V less, and would be credited with the difference, in every bin of every response,
//! whatever was measured. It is taken off, so that the log-likelihood is on average that of predictions without error (a corrected
//! score: Nakamura 1990, Biometrika 77, 127). Where an effect makes V more, its expected variance grows instead
//! ([`DecayTerm::variance`](crate::effect::DecayTerm::variance)).

use super::{EnergyModel, LN_PER_DB, STEP};
use crate::likelihood::laplace::Slopes;
use crate::simulate::reflection_reweighting::HitChanges;
use crate::simulate::views::BandView;

/// Step of second differences, as a logarithm of energy.
const BEND_STEP: f64 = 1e-3;
/// Step of one-sided differences, in prior standard deviations.
const SIDE_STEP: f64 = 1e-5;
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
        let mut louder = 0.0;
        for (bin, (weight, share)) in weights.iter().zip(shares).enumerate() {
            let slope = (up[bin] - down[bin]) / (2.0 * BEND_STEP);
            let bend = (up[bin] - 2.0 * at.predicted[bin] + down[bin]) / (BEND_STEP * BEND_STEP);
            if slope <= 0.0 {
                continue;
            }
            let with_paths = weight * 2.0 * share * bend / slope;
            louder += with_paths;
            for k in 0..m {
                slopes.gradient[self.layout.absorption(k, at.band)] += with_paths * path_slopes[bin * m + k];
            }
        }
        // With gains, all together; added sound of the source goes with them, which counts for nothing here.
        for index in self.layout.common_gain().into_iter().chain([self.layout.gain(self.assignment[at.pair])])
        {
            slopes.gradient[index] += louder * LN_PER_DB;
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

    /// Change of what is taken off with a parameter of an effect.
    fn chance_slope(&self, values: &[f64], at: Place<'_>, taken_off: &TakenOff, index: usize) -> f64 {
        let (prior, mut moved) = (self.priors[index], values.to_vec());
        let step = SIDE_STEP * prior.sd;
        moved[index] =
            if values[index] + step < prior.high { values[index] + step } else { values[index] - step };
        let predicted = self.affected(&moved, (at.pair, at.band), at.paths.to_vec());
        let shares = self.shares_of_chance(&moved, Place { predicted: &predicted, ..at });
        let change = shares.iter().zip(&taken_off.shares).zip(&taken_off.weights);
        change.map(|((now, before), w)| w * (now - before)).sum::<f64>() / (moved[index] - values[index])
    }

    /// Nats in each bin that all of its chance costs on average; none where no effect is at work, or nothing is left to chance.
    fn weights_of_chance(&self, at: Place<'_>) -> Option<Vec<f64>> {
        let state = &self.data.states[at.pair][at.band];
        let dispersion = self.data.dispersion[at.band];
        let own = || state.monte_carlo.iter().zip(&state.variance).take(at.paths.len());
        let some = !self.terms.is_empty() && own().any(|(chance, _)| *chance > 0.0);
        some.then(|| own().map(|(chance, variance)| 0.5 * chance / (variance * dispersion)).collect())
    }

    /// Variance of the logarithm of each predicted bin by the tracer's chance, as a share of that without any effect.
    fn shares_of_chance(&self, values: &[f64], at: Place<'_>) -> Vec<f64> {
        let gain_db = self.gain_db(values, at.pair);
        let changes = HitChanges::default();
        let view = self.view((at.pair, at.band), gain_db, &changes);
        let louder = self.with_paths(values, &view, gain_db, at.paths, STEP);
        let through = louder.iter().zip(at.predicted).map(|(up, here)| ((up - here) / STEP).powi(2));
        let mut shares: Vec<f64> = through.collect();
        for placed in &self.terms {
            if let Some(term) = placed.case.decay_term() {
                term.chance(placed.own(values), &view.with_table(placed.case.slot), &mut shares);
            }
        }
        shares
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
    use sabine_scene::{Levels, TimeZero};

    /// Variance of the logarithm of each prediction by chance.
    const CHANCE: f64 = 0.01;
    const DRAWS: usize = 4000;

    /// Mean of the log-likelihood of predictions with an error of [`CHANCE`] less that without any, where the measurement is what the latter
    /// says: of the model with these cases at the values that `set` makes of the neutral ones.
    fn mean_cost(cases: &[&Case], set: impl Fn(&mut [f64])) -> f64 {
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
            let mut values = model.start(None);
            set(&mut values[model.layout.len()..]);
            model.log_likelihood(&values, None)
        };
        for pair in 0..3 {
            for band in 0..2 {
                let data = tables.energy_data();
                let model = EnergyModel::new(&data, cases, &used);
                let mut values = model.start(None);
                set(&mut values[model.layout.len()..]);
                let count = tables.states[pair][band].ln_energy.len();
                let energies = model.predicted(&values, pair, band, count).iter().map(|l| l.exp()).collect();
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
        let plain = mean_cost(&[], |_| {});
        // 0.01 / (2 x 0.05 x dispersion) in each of 84 bins, the dispersion being some 1.
        assert!((-12.0..-5.0).contains(&plain), "{plain}");
        let cases = CoupledVolume.cases(&Tables::new(Levels::Absolute, TimeZero::Emission).survey);
        let cases: Vec<&Case> = cases.iter().collect();
        // Far more energy than the paths have late in the decay: three quarters of what chance costs are no more.
        let with = mean_cost(&cases, |own| {
            own[0] = 10.0;
            own[2] = 2.0;
        });
        assert!((with / plain - 1.0).abs() < 0.06, "{with} {plain}");
    }
}
