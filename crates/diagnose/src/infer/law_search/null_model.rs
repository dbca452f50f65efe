//! What measurements look like where no law acts: the fitted model, with everything that moves many bins together.
//!
//! Bins that scattered independently would make any law far too sure. Beside the levels, drifts and chance of the tracer that every likelihood
//! knows, two random effects are drawn: one of each response in each octave, and one of each place, which all octaves and all sources at that
//! receiver share. How large they are is estimated from what the fit leaves (variance components, as probable as the data make them).

use super::screen::ScreenPair;
use crate::likelihood::decay::{DRIFTS, unit_drift};
use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_distr::{Distribution, Gamma, StandardNormal};
use std::collections::BTreeMap;
use std::f64::consts::LN_10;

/// Standard deviations that are tried, in dB.
const TRIED_DB: [f64; 11] = [0.0, 0.1, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8];
/// Rounds over the two.
const ROUNDS: usize = 3;

/// The bins of one response where no law acts.
struct NullPair {
    receiver: usize,
    weights: DVector<f64>,
    shared: DMatrix<f64>,
    slopes: DMatrix<f64>,
    /// Slopes over the covariance of the data.
    over: DMatrix<f64>,
    /// What a unit of each random effect moves each bin by: of the place, and of each octave.
    of_place: DMatrix<f64>,
    of_bands: DMatrix<f64>,
    /// Of both together: information, and pull.
    information: DMatrix<f64>,
    pull: DVector<f64>,
}

/// Measurements of a room without a law.
pub(crate) struct NullModel {
    pairs: Vec<NullPair>,
    /// What is known of the parameters beforehand: standard deviations.
    prior_sd: Vec<f64>,
    /// Standard deviations of the random effects, as logarithms of energy: of a place, and of a response in an octave.
    place_sd: f64,
    band_sd: f64,
}

/// What a unit of the random effects moves bins by: four cosines along the compared time that all octaves share, and of each octave its level
/// and four cosines. `rows` has the number of bins of each compared octave.
fn random_effects(rows: &[usize]) -> (DMatrix<f64>, DMatrix<f64>) {
    let count: usize = rows.iter().sum();
    let mut of_place = DMatrix::zeros(count, DRIFTS);
    let mut of_bands = DMatrix::zeros(count, rows.len() * (1 + DRIFTS));
    let mut first = 0;
    for (band, &bins) in rows.iter().enumerate() {
        for bin in 0..bins {
            let unit = unit_drift(bin, bins);
            let own = band * (1 + DRIFTS);
            of_bands[(first + bin, own)] = 1.0;
            for (k, u) in unit.into_iter().enumerate() {
                of_place[(first + bin, k)] = u;
                of_bands[(first + bin, own + 1 + k)] = u;
            }
        }
        first += bins;
    }
    (of_place, of_bands)
}

impl NullModel {
    /// That of a fit: its responses, the receiver and the bins by octave of each, and what is known of its parameters beforehand.
    pub fn of(pairs: &[ScreenPair], places: &[(usize, Vec<usize>)], prior_sd: Vec<f64>) -> Self {
        let one = |(pair, (receiver, rows)): (&ScreenPair, &(usize, Vec<usize>))| {
            let e = &pair.expansion;
            let (of_place, of_bands) = random_effects(rows);
            let mut both = DMatrix::zeros(of_place.nrows(), of_place.ncols() + of_bands.ncols());
            both.columns_mut(0, of_place.ncols()).copy_from(&of_place);
            both.columns_mut(of_place.ncols(), of_bands.ncols()).copy_from(&of_bands);
            NullPair {
                receiver: *receiver,
                weights: e.weights.clone(),
                shared: e.shared.clone(),
                slopes: e.slopes.clone(),
                over: e.over_covariance(&e.slopes),
                information: both.tr_mul(&e.over_covariance(&both)),
                pull: both.tr_mul(&pair.pulls),
                of_place,
                of_bands,
            }
        };
        let pairs = pairs.iter().zip(places).map(one).collect();
        let mut model = Self { pairs, prior_sd, place_sd: 0.0, band_sd: 0.0 };
        model.estimate();
        model
    }

    /// The same without random effects.
    #[cfg(test)]
    fn without_random_effects(self) -> Self {
        Self { place_sd: 0.0, band_sd: 0.0, ..self }
    }

    /// Most probable standard deviations of the random effects.
    fn estimate(&mut self) {
        let tried = TRIED_DB.map(|db| db * LN_10 / 10.0);
        let best = |of: &dyn Fn(f64) -> f64| {
            let mut found = (0.0, f64::NEG_INFINITY);
            for sd in tried {
                let evidence = of(sd);
                if evidence > found.1 {
                    found = (sd, evidence);
                }
            }
            found.0
        };
        for _ in 0..ROUNDS {
            self.band_sd = best(&|sd| self.evidence(self.place_sd, sd));
            self.place_sd = best(&|sd| self.evidence(sd, self.band_sd));
        }
    }

    /// Logarithm of the probability of what the fit leaves under random effects of this size, over that without any.
    fn evidence(&self, place_sd: f64, band_sd: f64) -> f64 {
        let of_pair = |pair: &NullPair| {
            let n = pair.pull.len();
            let sd = |i: usize| if i < DRIFTS { place_sd } else { band_sd };
            let among = DMatrix::from_fn(n, n, |i, j| {
                sd(i) * pair.information[(i, j)] * sd(j) + if i == j { 1.0 } else { 0.0 }
            });
            let pull = DVector::from_fn(n, |i, _| sd(i) * pair.pull[i]);
            let Some(factor) = among.cholesky() else { return f64::NEG_INFINITY };
            let half_ln_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
            0.5 * pull.dot(&factor.solve(&pull)) - half_ln_determinant
        };
        self.pairs.iter().map(of_pair).sum()
    }

    /// Slopes of each response over the covariance of its data.
    pub fn over(&self) -> Vec<DMatrix<f64>> {
        self.pairs.iter().map(|pair| pair.over.clone()).collect()
    }

    /// By how much the bins of each response differ from the prediction in a measurement that is drawn.
    pub fn draw(&self, random: &mut impl Rng) -> Vec<DVector<f64>> {
        fn normal(count: usize, sd: f64, random: &mut impl Rng) -> DVector<f64> {
            DVector::from_fn(count, |_, _| {
                let deviate: f64 = StandardNormal.sample(random);
                sd * deviate
            })
        }
        let mut parameters = normal(self.prior_sd.len(), 1.0, random);
        parameters.iter_mut().zip(&self.prior_sd).for_each(|(x, sd)| *x *= sd);
        let mut places: BTreeMap<usize, DVector<f64>> = BTreeMap::new();
        let mut drawn = Vec::with_capacity(self.pairs.len());
        for pair in &self.pairs {
            // As the energy of noise scatters (Kuttruff, 6th ed., 3.5).
            let bin = |shape: &f64| Gamma::new(*shape, 1.0 / shape).map_or(0.0, |g| g.sample(random) - 1.0);
            let bins: Vec<f64> = pair.weights.iter().map(bin).collect();
            let mut y = DVector::from_vec(bins);
            y += &pair.shared * normal(pair.shared.ncols(), 1.0, random);
            y += &pair.slopes * &parameters;
            let place = places.entry(pair.receiver).or_insert_with(|| normal(DRIFTS, self.place_sd, random));
            y += &pair.of_place * &*place;
            y += &pair.of_bands * normal(pair.of_bands.ncols(), self.band_sd, random);
            drawn.push(y);
        }
        drawn
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::super::family::{by_chance, largest, tail};
    use super::super::screen::tests::{linear, term};
    use super::super::screen::{ReadyTerm, Screen};
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    /// Probabilities of the whole family in worlds without a law, whose places have effects of their own; `known` says whether the null model
    /// has random effects; `of` says what a value among those drawn is worth.
    fn probabilities(place_sd: f64, known: bool, of: fn(f64, &[f64]) -> f64) -> Vec<f64> {
        let world = |seed: u64| -> f64 {
            let (mut pairs, covariance, sd) = linear(100 + seed, 5, 6);
            let mut random = Pcg64Mcg::seed_from_u64(seed);
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            let parameters: Vec<f64> = sd.iter().map(|sd| sd * normal()).collect();
            let ys: Vec<DVector<f64>> = pairs
                .iter()
                .map(|pair| {
                    let e = &pair.expansion;
                    let place: Vec<f64> = (0..DRIFTS).map(|_| place_sd * normal()).collect();
                    let shared: Vec<f64> = (0..e.shared.ncols()).map(|_| normal()).collect();
                    DVector::from_fn(24, |i, _| {
                        let unit = unit_drift(i % 12, 12);
                        let moved: f64 = unit.iter().zip(&place).map(|(u, z)| u * z).sum();
                        let together: f64 =
                            shared.iter().enumerate().map(|(k, z)| e.shared[(i, k)] * z).sum();
                        let known: f64 =
                            parameters.iter().enumerate().map(|(k, x)| e.slopes[(i, k)] * x).sum();
                        normal() / e.weights[i].sqrt() + moved + together + known
                    })
                })
                .collect();
            // The fit of the nuisances, and what it leaves.
            let over: Vec<DMatrix<f64>> =
                pairs.iter().map(|p| p.expansion.over_covariance(&p.expansion.slopes)).collect();
            let along: DVector<f64> = over.iter().zip(&ys).map(|(o, y)| o.tr_mul(y)).sum();
            let fitted = &covariance * along;
            for (pair, y) in pairs.iter_mut().zip(&ys) {
                let left = y - &pair.expansion.slopes * &fitted;
                let left = DMatrix::from_column_slice(24, 1, left.as_slice());
                pair.pulls = pair.expansion.over_covariance(&left).column(0).into_owned();
            }
            let places: Vec<(usize, Vec<usize>)> = (0..5).map(|p| (p, vec![12, 12])).collect();
            let null = NullModel::of(&pairs, &places, sd);
            let null = if known { null } else { null.without_random_effects() };
            let screen = Screen::new(2, pairs, &covariance);
            let both = [&[1.0, 1.0][..], &[1.0, 0.0][..], &[0.0, 1.0][..]];
            let terms: Vec<ReadyTerm> = (0..6)
                .flat_map(|c| both.map(|shares| (c, shares)))
                .map(|(c, shares)| screen.ready(term(c, &[shares], &[0.5])))
                .collect();
            let best = terms.iter().map(|t| screen.nats(t, &screen.slopes)).fold(f64::NEG_INFINITY, f64::max);
            of(best, &largest(&screen, &terms, 6, &null, (60, seed)))
        };
        (0..120).map(world).collect()
    }

    #[test]
    fn without_a_law_probabilities_of_the_family_are_what_they_say() {
        for (place_sd, of) in
            [(0.0, by_chance as fn(f64, &[f64]) -> f64), (0.3, by_chance), (0.0, tail), (0.3, tail)]
        {
            let found = probabilities(place_sd, true, of);
            let below = |p: f64| found.iter().filter(|own| **own <= p).count();
            // 12, 60 of 120 are expected, give or take 3.3 and 5.5; variances that are estimated add to that.
            assert!(
                (3..=23).contains(&below(0.1)) && (40..=80).contains(&below(0.5)),
                "{place_sd}: {found:?}"
            );
        }
        // Bins that were taken to scatter independently would find laws far too often: these worlds are small;
        // no larger than those of bins.
        let found = probabilities(1.0, false, by_chance);
        assert!(found.iter().filter(|p| **p <= 0.1).count() > 23, "{found:?}");
    }
}
