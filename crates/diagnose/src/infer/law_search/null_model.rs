//! What measurements look like where no law acts: the fitted model, with everything that moves many bins together.
//!
//! Bins that scattered independently would make any law far too sure. Beside the levels, drifts and chance of the tracer that every likelihood
//! knows, two random effects are drawn: one of each response in each octave, and one of each place, which all octaves and all sources at that
//! receiver share. How large they are is told by how far what the fit leaves differs from response to response, not by what all have in
//! common: that may be a law. Each measurement that is drawn has sizes of its own, as probable as the data make them.
//!
//! Source: variance components by restricted maximum likelihood, H. D. Patterson, R. Thompson, Biometrika 58, 1971.

use super::screen::ScreenPair;
use crate::error::Error;
use crate::likelihood::decay::{DRIFTS, unit_drift};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::Rng;
use rand_distr::{Distribution, Gamma, StandardNormal};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::LN_10;

/// Logarithm of energy in one decibel.
const LN_PER_DB: f64 = LN_10 / 10.0;
/// Standard deviations that are tried, each as probable beforehand, in dB.
const TRIED_DB: [f64; 11] = [0.0, 0.1, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8];
/// Of what all responses have in common in an octave, in dB: anything that occurs.
const COMMON_SD_DB: f64 = 10.0;
/// What no normal density describes.
const SINGULAR: Error = Error::Singular { what: "the search for laws" };
/// Numbers that say what a response does in an octave: its level, and cosines along the compared time.
const OF_BAND: usize = 1 + DRIFTS;

/// The bins of one response where no law acts.
struct NullPair {
    receiver: usize,
    /// The octaves that are compared.
    bands: Vec<usize>,
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

/// Where a response was taken, and the octaves of it that are compared, with the number of bins of each.
pub(crate) struct Rows {
    pub receiver: usize,
    pub of_bands: Vec<(usize, usize)>,
}

/// Measurements of a room without a law.
pub(crate) struct NullModel {
    pairs: Vec<NullPair>,
    /// The inverse of the covariance of the parameters beforehand, factored.
    known: Cholesky<f64, Dyn>,
    /// Their covariance once these responses are known.
    covariance: DMatrix<f64>,
    /// Sizes that the random effects may have, and the probability of each, given what the fit leaves.
    sizes: Vec<(Sizes, f64)>,
}

/// Standard deviations of the random effects, as logarithms of energy: of a place, and of a response in an octave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sizes {
    place_sd: f64,
    band_sd: f64,
}

/// What all responses may have in common: information on it, and pull.
struct Common {
    information: DMatrix<f64>,
    pull: DVector<f64>,
}

/// What a unit of the random effects moves bins by: four cosines along the compared time that all octaves share, and of each octave its level
/// and four cosines. `rows` has the compared octaves and the number of bins of each.
fn random_effects(rows: &[(usize, usize)]) -> (DMatrix<f64>, DMatrix<f64>) {
    let count: usize = rows.iter().map(|(_, bins)| bins).sum();
    let mut of_place = DMatrix::zeros(count, DRIFTS);
    let mut of_bands = DMatrix::zeros(count, rows.len() * OF_BAND);
    let mut first = 0;
    for (place, &(_, bins)) in rows.iter().enumerate() {
        for bin in 0..bins {
            let unit = unit_drift(bin, bins);
            let own = place * OF_BAND;
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
    /// That of a fit: its responses, and the inverse of the covariance of its parameters beforehand.
    pub fn of(pairs: &[ScreenPair], rows: &[Rows], known: DMatrix<f64>) -> Result<Self, Error> {
        let one = |(pair, rows): (&ScreenPair, &Rows)| {
            let e = &pair.expansion;
            let (of_place, of_bands) = random_effects(&rows.of_bands);
            let mut both = DMatrix::zeros(of_place.nrows(), of_place.ncols() + of_bands.ncols());
            both.columns_mut(0, of_place.ncols()).copy_from(&of_place);
            both.columns_mut(of_place.ncols(), of_bands.ncols()).copy_from(&of_bands);
            NullPair {
                receiver: rows.receiver,
                bands: rows.of_bands.iter().map(|(band, _)| *band).collect(),
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
        let pairs: Vec<NullPair> = pairs.iter().zip(rows).map(one).collect();
        // Not that of the fit: a cause that changes how bins scatter is known better there than these slopes tell, and what a measurement that is
        // drawn has of it would then be left in all columns.
        let mut information = known.clone();
        pairs.iter().for_each(|pair| information += pair.slopes.tr_mul(&pair.over));
        let covariance = information.cholesky().ok_or(SINGULAR)?.inverse();
        let mut model =
            Self { pairs, known: known.cholesky().ok_or(SINGULAR)?, covariance, sizes: Vec::new() };
        model.sizes = model.weighed();
        Ok(model)
    }

    /// Covariance of the parameters of the fit, given its responses.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// The same without random effects.
    #[cfg(test)]
    pub fn without_random_effects(self) -> Self {
        Self { sizes: vec![(Sizes::default(), 1.0)], ..self }
    }

    /// All sizes that are tried, and how probable each is.
    fn weighed(&self) -> Vec<(Sizes, f64)> {
        let tried = TRIED_DB.map(|db| db * LN_PER_DB);
        let all: Vec<Sizes> =
            tried.into_iter().flat_map(|place_sd| tried.map(|band_sd| Sizes { place_sd, band_sd })).collect();
        let evidence: Vec<f64> = all.par_iter().map(|sizes| self.evidence(*sizes)).collect();
        let most = evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = evidence.iter().map(|own| (own - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        all.into_iter().zip(weights.into_iter().map(|weight| weight / sum)).collect()
    }

    /// Logarithm of the probability of what the fit leaves under random effects of this size, over that without any, whatever all responses
    /// have in common.
    fn evidence(&self, sizes: Sizes) -> f64 {
        let bands = self.pairs.iter().flat_map(|pair| &pair.bands).max().map_or(0, |band| band + 1);
        let width = bands * OF_BAND;
        let known = (COMMON_SD_DB * LN_PER_DB).powi(-2);
        let mut all =
            Common { information: DMatrix::identity(width, width) * known, pull: DVector::zeros(width) };
        let mut sum = 0.0;
        for pair in &self.pairs {
            let Some((evidence, own)) = pair.under(sizes) else { return f64::NEG_INFINITY };
            sum += evidence;
            let place = |i: usize| pair.bands[i / OF_BAND] * OF_BAND + i % OF_BAND;
            for i in 0..own.pull.len() {
                all.pull[place(i)] += own.pull[i];
                for j in 0..own.pull.len() {
                    all.information[(place(i), place(j))] += own.information[(i, j)];
                }
            }
        }
        let evidence = |factor| sum + evidence_of(&factor, &all.pull);
        all.information.cholesky().map_or(f64::NEG_INFINITY, evidence)
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
        let Sizes { place_sd, band_sd } = self.draw_sizes(random);
        let mut parameters = normal(self.covariance.nrows(), 1.0, random);
        self.known.l_dirty().tr_solve_lower_triangular_mut(&mut parameters);
        let mut places: BTreeMap<usize, DVector<f64>> = BTreeMap::new();
        let mut drawn = Vec::with_capacity(self.pairs.len());
        for pair in &self.pairs {
            // As the energy of noise scatters (Kuttruff, 6th ed., 3.5).
            let bin = |shape: &f64| Gamma::new(*shape, 1.0 / shape).map_or(0.0, |g| g.sample(random) - 1.0);
            let bins: Vec<f64> = pair.weights.iter().map(bin).collect();
            let mut y = DVector::from_vec(bins);
            y += &pair.shared * normal(pair.shared.ncols(), 1.0, random);
            y += &pair.slopes * &parameters;
            let place = places.entry(pair.receiver).or_insert_with(|| normal(DRIFTS, place_sd, random));
            y += &pair.of_place * &*place;
            y += &pair.of_bands * normal(pair.of_bands.ncols(), band_sd, random);
            drawn.push(y);
        }
        drawn
    }

    /// Sizes of the random effects, as probable as they are.
    fn draw_sizes(&self, random: &mut impl Rng) -> Sizes {
        let mut left: f64 = random.random();
        let reached = |(_, weight): &&(Sizes, f64)| {
            left -= weight;
            left <= 0.0
        };
        self.sizes.iter().find(reached).or(self.sizes.last()).map_or_else(Sizes::default, |(sizes, _)| *sizes)
    }
}

/// Logarithm of the probability of a pull over that of none, of normal deviates with this information.
fn evidence_of(factor: &Cholesky<f64, Dyn>, pull: &DVector<f64>) -> f64 {
    let half_ln_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    0.5 * pull.dot(&factor.solve(pull)) - half_ln_determinant
}

impl NullPair {
    /// The same under random effects of this size, and what is left to say of what all responses have in common.
    fn under(&self, sizes: Sizes) -> Option<(f64, Common)> {
        let n = self.pull.len();
        let sd = DVector::from_fn(n, |i, _| if i < DRIFTS { sizes.place_sd } else { sizes.band_sd });
        let scaled = DMatrix::from_fn(n, n, |i, j| sd[i] * self.information[(i, j)]);
        let among = DMatrix::from_fn(n, n, |i, j| scaled[(i, j)] * sd[j] + if i == j { 1.0 } else { 0.0 });
        let pull = sd.component_mul(&self.pull);
        let factor = among.cholesky()?;
        // What is common moves bins as the effects of octaves do.
        let common = n - DRIFTS;
        let along = scaled.columns(DRIFTS, common);
        let solved = factor.solve(&along);
        let information = self.information.view((DRIFTS, DRIFTS), (common, common)) - along.tr_mul(&solved);
        let left = self.pull.rows(DRIFTS, common) - solved.tr_mul(&pull);
        Some((evidence_of(&factor, &pull), Common { information, pull: left }))
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
    use std::ops::AddAssign;

    /// Probabilities of the whole family in worlds without a law, whose places have effects of their own; `known` says whether the null model
    /// has random effects; `of` says what a value among those drawn is worth.
    fn probabilities(place_sd: f64, known: bool, of: fn(f64, &[f64]) -> f64) -> Vec<f64> {
        let world = |seed: u64| -> f64 {
            let (mut pairs, covariance, sd) = linear(100 + seed, 8, 6);
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
            let null = NullModel::of(&pairs, &rows(8), independent(&sd)).unwrap();
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

    fn independent(sd: &[f64]) -> DMatrix<f64> {
        DMatrix::from_diagonal(&DVector::from_iterator(sd.len(), sd.iter().map(|sd| sd.powi(-2))))
    }

    fn rows(pairs: usize) -> Vec<Rows> {
        (0..pairs).map(|receiver| Rows { receiver, of_bands: vec![(0, 12), (1, 12)] }).collect()
    }

    /// A null model of the responses that `linear` makes, with differences between measurement and prediction of one's own.
    fn null_of(pairs: &mut [ScreenPair], ys: &[DVector<f64>], sd: &[f64]) -> NullModel {
        for (pair, y) in pairs.iter_mut().zip(ys) {
            let y = DMatrix::from_column_slice(24, 1, y.as_slice());
            pair.pulls = pair.expansion.over_covariance(&y).column(0).into_owned();
        }
        NullModel::of(pairs, &rows(ys.len()), independent(sd)).unwrap()
    }

    /// Both covariances written out and inverted.
    #[test]
    fn the_evidence_for_sizes_is_the_ratio_of_two_normal_densities() {
        let (mut pairs, _, sd) = linear(7, 3, 1);
        let y = |pair: usize| DVector::from_fn(24, |i, _| (1.3 * i as f64 + 2.1 * pair as f64).sin());
        let ys: Vec<DVector<f64>> = (0..3).map(y).collect();
        let null = null_of(&mut pairs, &ys, &sd);
        let (of_place, of_bands) = random_effects(&[(0, 12), (1, 12)]);
        let ln_density = |Sizes { place_sd, band_sd }: Sizes, common_sd: f64| {
            let mut whole = DMatrix::zeros(72, 72);
            let common = &of_bands * of_bands.transpose() * common_sd.powi(2);
            for (a, pair) in pairs.iter().enumerate() {
                for b in 0..3 {
                    whole.view_mut((24 * a, 24 * b), (24, 24)).copy_from(&common);
                }
                let e = &pair.expansion;
                let own = DMatrix::from_diagonal(&e.weights.map(|w| 1.0 / w))
                    + &e.shared * e.shared.transpose()
                    + &of_place * of_place.transpose() * place_sd.powi(2)
                    + &of_bands * of_bands.transpose() * band_sd.powi(2);
                whole.view_mut((24 * a, 24 * a), (24, 24)).add_assign(&own);
            }
            let y = DVector::from_iterator(72, ys.iter().flat_map(|y| y.iter().copied()));
            let factor = whole.cholesky().unwrap();
            let ln_determinant: f64 = factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
            -0.5 * (y.dot(&factor.solve(&y)) + ln_determinant)
        };
        let common_sd = COMMON_SD_DB * LN_PER_DB;
        let none = null.evidence(Sizes::default()) - ln_density(Sizes::default(), common_sd);
        for sizes in
            [(0.2, 0.0), (0.0, 0.4), (0.3, 0.1)].map(|(place_sd, band_sd)| Sizes { place_sd, band_sd })
        {
            let found = null.evidence(sizes) - ln_density(sizes, common_sd);
            assert!((found - none).abs() < 1e-7, "{sizes:?}: {found} {none}");
        }
    }

    #[test]
    fn what_all_responses_have_in_common_is_no_scatter_of_places() {
        let place_db = |common: f64, own: f64| {
            let (mut pairs, _, sd) = linear(9, 8, 1);
            let mut random = Pcg64Mcg::seed_from_u64(3);
            let (of_place, _) = random_effects(&[(0, 12), (1, 12)]);
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            let ys: Vec<DVector<f64>> = (0..8)
                .map(|pair| {
                    let course = DVector::from_fn(DRIFTS, |k, _| common / (1.0 + k as f64) + own * normal());
                    let e = &pairs[pair as usize].expansion;
                    let moved = &of_place * course;
                    DVector::from_fn(24, |i, _| moved[i] + normal() / e.weights[i].sqrt())
                })
                .collect();
            let null = null_of(&mut pairs, &ys, &sd);
            null.sizes.iter().map(|(sizes, weight)| weight * sizes.place_sd / LN_PER_DB).sum::<f64>()
        };
        assert!(place_db(0.0, 0.0) < 0.4, "{}", place_db(0.0, 0.0));
        assert!((place_db(1.0, 0.0) - place_db(0.0, 0.0)).abs() < 0.1, "{}", place_db(1.0, 0.0));
        let scattered = place_db(0.0, 1.4 * LN_PER_DB);
        assert!((1.0..2.0).contains(&scattered), "{scattered}");
    }

    /// One response does not tell a law from what its place does: any size is as probable.
    #[test]
    fn one_response_says_nothing_of_how_places_scatter() {
        let (mut pairs, _, sd) = linear(5, 1, 1);
        let null = null_of(&mut pairs, &[DVector::from_fn(24, |i, _| (0.4 * i as f64).sin())], &sd);
        let of_place = |tried: f64| -> f64 {
            let own = |(sizes, _): &&(Sizes, f64)| (sizes.place_sd / LN_PER_DB - tried).abs() < 1e-9;
            null.sizes.iter().filter(own).map(|(_, weight)| weight).sum()
        };
        let even = 1.0 / TRIED_DB.len() as f64;
        for tried in TRIED_DB {
            assert!((of_place(tried) / even - 1.0).abs() < 0.3, "{tried}: {}", of_place(tried));
        }
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
