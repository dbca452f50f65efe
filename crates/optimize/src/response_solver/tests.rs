//! Against a search that knows neither expansions nor gradients: every path is summed for every trial.

use super::*;
use crate::AbsorptionPrior;
use crate::history::History;
use crate::measured_decay::BinnedDecay;
use crate::pulse::Pulse;
use sabine_acoustics::{Air, Bands};
use sabine_paths::{Contribution, PathSet, Reflection};
use sabine_scene::Levels;

const OCTAVES: Bands = Bands::T60;
const WINDOWS: usize = 6;
const WINDOW_S: f64 = 0.02;
const NOISE: f64 = 0.05;
const VALUES: f64 = 9.0;

/// What the oracle knows of a path: its window, its energy if nothing absorbed, its hits, its batch.
struct Path {
    window: usize,
    energy: f64,
    hits: [i32; 2],
    batch: Option<u8>,
}

/// Paths every 1.7 ms, their hits different enough to tell two materials.
fn paths(response: usize) -> (PathSet, Vec<Path>) {
    let speed_m_s = Air::default().speed_of_sound_m_s();
    let mut set = PathSet::new(2, WINDOWS as f64 * WINDOW_S * speed_m_s);
    let mut plain = Vec::new();
    for i in 0..64usize {
        let time_s = 0.0018 * i as f64 + 0.0007;
        let hits = [(i * (3 + response) % 7) / 2, i / 12 + (i * 5 + response) % 3];
        let mut chain = PathSet::DIRECT;
        for (material, count) in hits.iter().enumerate() {
            for _ in 0..*count {
                chain = set.reflect(chain, material as u32, Reflection::Specular);
            }
        }
        let log_weight = -0.1 * ((i * 11 + response) % 5) as f64;
        // The early ones are exact, the others sampled.
        let batch = (i >= 16).then_some((i % 32) as u8);
        let up = [0.0, 0.0, 1.0];
        set.push(Contribution {
            length_m: time_s * speed_m_s,
            log_weight,
            chain,
            tail: PathSet::DIRECT,
            departure: up,
            arrival: up,
            batch,
        });
        plain.push(Path {
            window: (time_s / WINDOW_S) as usize,
            energy: log_weight.exp(),
            hits: hits.map(|n| n as i32),
            batch,
        });
    }
    (set, plain)
}

/// Measured energies that no absorption explains fully, and whose two bands differ.
fn measured(response: usize, band: usize) -> Vec<f64> {
    let truth = [[0.3, 0.12], [0.22, 0.2]][band];
    let mut energy = vec![0.0; WINDOWS];
    for path in paths(response).1 {
        energy[path.window] += 4.0 * path.at(truth);
    }
    energy.iter_mut().enumerate().for_each(|(j, e)| *e *= 1.0 + 0.25 * ((3 * j + response) as f64).sin());
    energy
}

impl Path {
    fn at(&self, absorption: [f64; 2]) -> f64 {
        self.energy * (1.0 - absorption[0]).powi(self.hits[0]) * (1.0 - absorption[1]).powi(self.hits[1])
    }
}

/// Energy and relative variance of every window of a response at an absorption, path by path.
fn simulated(response: usize, absorption: [f64; 2], path_error: f64) -> Vec<(f64, f64)> {
    let paths = paths(response).1;
    let window = |j: usize| {
        let mine = || paths.iter().filter(move |p| p.window == j);
        let exact = || mine().filter(|p| p.batch.is_none()).map(|p| p.at(absorption));
        let batch = |b: u8| mine().filter(|p| p.batch == Some(b)).map(|p| p.at(absorption)).sum::<f64>();
        let batches: Vec<f64> = (0..32).map(batch).collect();
        let (single, sampled) = (exact().sum::<f64>(), batches.iter().sum::<f64>());
        let rays = batches.iter().map(|b| (b - sampled / 32.0).powi(2)).sum::<f64>() * 32.0 / 31.0;
        let reflections = exact().map(|e| (path_error * e).powi(2)).sum::<f64>();
        let field = ((single + sampled).powi(2) - single * single) / VALUES;
        let total = single + sampled;
        (total, (rays + reflections + field) / (total * total) + NOISE)
    };
    (0..WINDOWS).map(window).collect()
}

/// Least cost by a compass search (Kolda, Lewis and Torczon 2003), weights and dispersions taken anew until nothing moves.
fn by_search(bands: usize, smoothness: f64, path_error: f64, prior: (f64, f64)) -> Vec<[f64; 2]> {
    let mut at = vec![[prior.0; 2]; bands];
    let mut dispersion = vec![1.0; bands];
    for _ in 0..60 {
        let weights: Vec<Vec<Vec<f64>>> = (0..bands)
            .map(|b| {
                let of = |r| simulated(r, at[b], path_error).into_iter().map(|(_, v)| 1.0 / v).collect();
                (0..2).map(of).collect()
            })
            .collect();
        let deviance = |b: usize, a: [f64; 2]| -> f64 {
            let mut terms = Vec::new();
            for (r, weights) in weights[b].iter().enumerate() {
                let energies = simulated(r, a, path_error).into_iter().map(|(e, _)| e);
                for ((e, y), w) in energies.zip(measured(r, b)).zip(weights) {
                    terms.push((*w, y / e));
                }
            }
            let weight: f64 = terms.iter().map(|t| t.0).sum();
            let gain = terms.iter().map(|(w, ratio)| w * ratio).sum::<f64>() / weight;
            let of = |(w, ratio): &(f64, f64)| 2.0 * w * (ratio / gain - 1.0 - (ratio / gain).ln());
            terms.iter().map(of).sum()
        };
        let cost = |at: &[[f64; 2]]| -> f64 {
            let z = |b: usize, k: usize| (at[b][k] - prior.0) / prior.1;
            let mut cost = 0.0;
            for b in 0..bands {
                cost += 0.5 * deviance(b, at[b]) / dispersion[b];
                for k in 0..2 {
                    cost += 0.5 * z(b, k).powi(2);
                    if b > 0 {
                        cost += 0.5 * smoothness * (z(b, k) - z(b - 1, k)).powi(2);
                    }
                }
            }
            cost
        };
        let before = at.clone();
        let (mut step, mut best) = (0.02, cost(&at));
        while step > 1e-7 {
            let mut found = false;
            for i in 0..4 * bands {
                let mut trial = at.clone();
                let value = &mut trial[i / 4][i / 2 % 2];
                *value = (*value + if i % 2 == 0 { step } else { -step }).clamp(0.005, 0.99);
                let there = cost(&trial);
                if there < best {
                    (at, best, found) = (trial, there, true);
                }
            }
            step *= if found { 1.5 } else { 0.5 };
        }
        dispersion =
            (0..bands).map(|b| (deviance(b, at[b]) / (2.0 * WINDOWS as f64 - 1.0)).max(1.0)).collect();
        let moved = at.iter().flatten().zip(before.iter().flatten()).map(|(a, b)| (a - b).abs());
        if moved.fold(0.0, f64::max) < 1e-6 {
            break;
        }
    }
    at
}

fn by_solver(bands: usize, smoothness: f64, path_error: f64, prior: (f64, f64)) -> Solved {
    let config = FitConfig { smoothness, reflection_error: path_error, ..FitConfig::default() };
    let priors = vec![AbsorptionPrior::uniform(OCTAVES, prior.0, prior.1); 2];
    let air = Air::default();
    let histories: Vec<History> = (0..2).map(|r| History::new(&paths(r).0, &air, config.bin_s)).collect();
    let decay = |r: usize, b: usize| BinnedDecay {
        edges_s: (0..=WINDOWS).map(|j| j as f64 * WINDOW_S).collect(),
        energy: measured(r, b),
        values: vec![VALUES; WINDOWS],
        // Noise of this relative variance.
        signal: vec![(1.0 + NOISE * VALUES).sqrt().recip(); WINDOWS],
        pulse: Pulse::new(&[0.0, 0.0, 1.0, 0.0, 0.0], 2, 1e7),
        leaks: Vec::new(),
        tail: 0.0,
    };
    let bands: Vec<ResponseBand<'_>> = (0..bands)
        .map(|b| {
            let mut band = ResponseBand::new(&priors, b, Levels::Common);
            for (r, history) in histories.iter().enumerate() {
                // Free of absorption and of air, in the order of the history.
                let mut plain = paths(r).1;
                plain.sort_by_key(|p| p.window);
                let weights = plain.iter().map(|p| p.energy as f32).collect();
                assert!(band.add(r, history, weights, &decay(r, b), 0.0, 0.0));
            }
            band
        })
        .collect();
    solve(&bands, &config, None).unwrap()
}

#[test]
fn it_finds_what_a_search_without_gradients_finds() {
    // Loose priors and tight ones, on either side of what the data say.
    for (prior, path_error) in
        [((0.5, 0.3), 0.25), ((0.1, 0.05), 0.25), ((0.7, 0.2), 0.0), ((0.02, 0.004), 0.1)]
    {
        let found = by_solver(1, 0.0, path_error, prior);
        let expected = by_search(1, 0.0, path_error, prior);
        assert!(found.unconverged.is_none());
        for (found, expected) in found.absorption[0].iter().zip(expected[0]) {
            assert!((found - expected).abs() < 0.01 * prior.1, "{prior:?}: {found} {expected}");
        }
    }
}

#[test]
fn smoothness_ties_bands_as_a_search_would() {
    let prior = (0.4, 0.1);
    let loose = by_search(2, 0.0, 0.25, prior);
    for smoothness in [1.0, 30.0] {
        let found = by_solver(2, smoothness, 0.25, prior);
        let expected = by_search(2, smoothness, 0.25, prior);
        assert!(found.unconverged.is_none());
        for (found, expected) in found.absorption.iter().zip(&expected) {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 0.01 * prior.1, "{smoothness}: {found} {expected}");
            }
        }
        let apart = |bands: &[[f64; 2]]| (bands[0][0] - bands[1][0]).abs();
        assert!(apart(&expected) < 0.9 * apart(&loose), "{expected:?} {loose:?}");
        // What a band knows helps its neighbour.
        let alone = by_solver(2, 0.0, 0.25, prior);
        assert!(found.spread.standard_error[0][0] < alone.spread.standard_error[0][0]);
    }
}

/// One material, a path every millisecond that has met it three times more than the last, and a measured decay that this explains
/// exactly with an absorption of 0.12.
fn long_decay(levels: Levels, prior: (f64, f64)) -> Solved {
    const TRUTH: f64 = 0.12;
    let air = Air::default();
    let speed_m_s = air.speed_of_sound_m_s();
    let (bins, bin_s) = (30, 0.01);
    let hits = |i: usize| 3 * i as i32;
    let mut set = PathSet::new(1, bins as f64 * bin_s * speed_m_s);
    let (mut chain, mut met) = (PathSet::DIRECT, 0);
    let up = [0.0, 0.0, 1.0];
    for i in 0..300usize {
        while met < hits(i) {
            chain = set.reflect(chain, 0, Reflection::Specular);
            met += 1;
        }
        let length_m = (1e-3 * i as f64 + 5e-4) * speed_m_s;
        let (tail, batch) = (PathSet::DIRECT, Some((i % 32) as u8));
        set.push(Contribution { length_m, log_weight: 0.0, chain, tail, departure: up, arrival: up, batch });
    }
    let config = FitConfig::default();
    let history = History::new(&set, &air, config.bin_s);
    let energy = |j: usize| (10 * j..10 * j + 10).map(|i| (1.0 - TRUTH).powi(hits(i))).sum();
    let decay = BinnedDecay {
        edges_s: (0..=bins).map(|j| j as f64 * bin_s).collect(),
        energy: (0..bins).map(energy).collect(),
        values: vec![VALUES; bins],
        signal: vec![1.0; bins],
        pulse: Pulse::new(&[0.0, 0.0, 1.0, 0.0, 0.0], 2, 1e7),
        leaks: Vec::new(),
        tail: 0.0,
    };
    let priors = [AbsorptionPrior::uniform(OCTAVES, prior.0, prior.1)];
    let mut band = ResponseBand::new(&priors, 0, levels);
    let weights = vec![1.0; history.len()];
    assert!(band.add(0, &history, weights, &decay, 0.0, 0.0));
    solve(&[band], &config, None).unwrap()
}

#[test]
fn a_first_step_to_where_the_cost_is_infinite_is_shortened() {
    // From a prior that rings far too long the steepest descent leads to the upper bound, where e^1000 stands in the cost.
    for levels in [Levels::Absolute, Levels::Common] {
        let found = long_decay(levels, (0.02, 0.1));
        assert_eq!(found.unconverged, None);
        assert!(found.iterations > 0);
        let absorption = found.absorption[0][0];
        assert!((absorption - 0.12).abs() < 1e-3, "{levels:?}: {absorption}");
    }
}
