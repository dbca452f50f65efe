//! Measured energies by plain sums over paths, one band leaking into the other.

use super::*;
use crate::AbsorptionPrior;
use crate::history::History;
use crate::measured_decay::BinnedDecay;
use crate::pulse::Pulse;
use sabine_acoustics::{Air, Bands};
use sabine_paths::{Contribution, PathSet, Reflection};
use sabine_scene::Levels;

const PATHS: usize = 300;
const BINS: usize = 30;
/// Absorption in either band: by the hundredth millisecond nearly all of the first is what leaks in from the second.
const TRUTH: [f64; 2] = [0.4, 0.1];
const SHARES: [f64; 2] = [0.05, 0.08];
/// What the source radiates in either band, for each of two responses.
const GAINS: [[f64; 2]; 2] = [[3.0, 0.7], [0.2, 0.9]];
/// So wide that it does not pull.
const PRIOR: (f64, f64) = (0.25, 2.0);

/// A path every millisecond, one more reflection every three: the first reflections exact, the others sampled.
fn hits(path: usize) -> i32 {
    (path / 3) as i32
}

fn energy(band: usize, bin: usize) -> f64 {
    (10 * bin..10 * bin + 10).map(|path| (1.0 - TRUTH[band]).powi(hits(path))).sum()
}

/// What the filter of a band passes of both.
fn measured(response: usize, band: usize, bin: usize) -> f64 {
    let other = 1 - band;
    GAINS[response][band] * energy(band, bin) + SHARES[band] * GAINS[response][other] * energy(other, bin)
}

/// The absorption that is found in either band; the second response is not read in the second band if `unread`.
fn found(leaking: bool, unread: bool) -> (Vec<f64>, Vec<Solved>) {
    with_bands(leaking, unread, |bands, config| {
        let solved = solve_with_leaks(bands, 1, config).unwrap();
        (solved.iter().map(|s| s.absorption[0][0]).collect(), solved)
    })
}

fn with_bands<T>(
    leaking: bool,
    unread: bool,
    then: impl FnOnce(&mut [ResponseBand<'_>], &FitConfig) -> T,
) -> T {
    let air = Air::default();
    let speed_m_s = air.speed_of_sound_m_s();
    let mut set = PathSet::new(1, 0.3 * speed_m_s);
    let (mut chain, mut met) = (PathSet::DIRECT, 0);
    let up = [0.0, 0.0, 1.0];
    for path in 0..PATHS {
        while met < hits(path) {
            chain = set.reflect(chain, 0, Reflection::Specular);
            met += 1;
        }
        let length_m = (1e-3 * path as f64 + 5e-4) * speed_m_s;
        let (tail, batch) = (PathSet::DIRECT, (path >= 20).then_some((path % 32) as u8));
        set.push(Contribution { length_m, log_weight: 0.0, chain, tail, departure: up, arrival: up, batch });
    }
    let config = FitConfig { arrival_error_s: 0.0, ..FitConfig::default() };
    let history = History::new(&set, &air, config.bin_s);
    let priors = [AbsorptionPrior::uniform(Bands::T60, PRIOR.0, PRIOR.1)];
    let decay = |response: usize, band: usize| BinnedDecay {
        edges_s: (0..=BINS).map(|j| 0.01 * j as f64).collect(),
        energy: (0..BINS).map(|bin| measured(response, band, bin)).collect(),
        values: vec![9.0; BINS],
        signal: vec![1.0; BINS],
        pulse: Pulse::new(&[0.0, 0.0, 1.0, 0.0, 0.0], 2, 1e7),
        leaks: if leaking { vec![(1 - band, SHARES[band])] } else { Vec::new() },
        tail: 0.0,
    };
    let mut bands: Vec<ResponseBand<'_>> = (0..2)
        .map(|b| {
            let mut band = ResponseBand::new(&priors, b, Levels::PerResponse);
            for response in 0..2 {
                let weights = vec![1.0; history.len()];
                if unread && (response, b) == (1, 1) {
                    band.add_unread(response, &history, weights);
                } else {
                    assert!(band.add(response, &history, weights, &decay(response, b), 0.0, 0.0));
                }
            }
            band
        })
        .collect();
    then(&mut bands, &config)
}

#[test]
fn a_band_that_the_paths_do_not_explain_does_not_leak_more_than_was_measured_in_it() {
    with_bands(true, false, |bands, _| {
        let response = &bands[1].responses[0];
        let measured: f64 = response.windows.iter().map(|window| window.energy).sum();
        let leaking = |absorption: f64, db: f64| {
            let energies = Energies::of(response, &[absorption], &[(0, db)]);
            let paths: f64 = response.windows.iter().map(|window| energies.within(window)).sum();
            energies.gain.unwrap() * paths / measured
        };
        // The gain of paths that do explain it is taken as it is.
        let db = 10.0 * GAINS[0][1].log10();
        let explained = leaking(TRUTH[1], db);
        assert!(explained > 0.5 && explained < 1.0, "{explained}");
        assert!((leaking(TRUTH[1], db + 3.0) / explained - 10f64.powf(0.3)).abs() < 1e-9);
        // Paths that are all but absorbed: as a mean of ratios, their gain is that of the last bins.
        assert!((leaking(0.99, 600.0) - 1.0).abs() < 1e-9);
    });
}

#[test]
fn absorption_is_found_under_what_leaks_in_from_a_band_that_rings_longer() {
    let (absorption, solved) = found(true, false);
    for (b, (found, truth)) in absorption.iter().zip(TRUTH).enumerate() {
        assert_eq!(solved[b].unconverged, None);
        assert!((found - truth).abs() < 0.002, "{b}: {found} {truth}");
        let dispersion = solved[b].dispersion[0].unwrap();
        assert!((dispersion - 1.0).abs() < 1e-9, "{b}: {dispersion}");
        for (response, db) in &solved[b].gains_db[0] {
            let expected = 10.0 * GAINS[*response][b].log10();
            assert!((db - expected).abs() < 0.05, "{b}, {response}: {db} {expected}");
        }
    }
    // Taken for the band's own, the late decay asks for much less.
    let (blind, _) = found(false, false);
    assert!(blind[0] < TRUTH[0] - 0.1, "{blind:?}");
}

#[test]
fn a_response_that_is_not_read_in_a_band_leaks_all_the_same() {
    let (absorption, solved) = found(true, true);
    assert!(solved.iter().all(|s| s.unconverged.is_none()));
    // How loud the second band is in the second response is not known, and it is taken to be as loud as the first. There it is 6.5 dB
    // louder.
    let (blind, _) = found(false, true);
    assert!((absorption[0] - TRUTH[0]).abs() < 0.5 * (blind[0] - TRUTH[0]).abs(), "{absorption:?} {blind:?}");
    assert!((absorption[1] - TRUTH[1]).abs() < 0.004, "{absorption:?}");
    assert!(solved[1].gains_db[0].iter().all(|(response, _)| *response == 0));
}

#[test]
fn a_slow_approach_is_shortened() {
    // F(L) = 0.9 L + 0.1 in the logarithm: plain steps keep nine tenths of the distance each time.
    let mut leak = [1.0f64, 2.0];
    let mut relaxation = Relaxation::default();
    for _ in 0..4 {
        let to = leak.map(|l| (0.9 * l.ln() + 0.1).exp());
        relaxation.take(leak.iter_mut(), &to);
    }
    assert!(leak.iter().all(|l| (l.ln() - 1.0).abs() < 0.2), "{leak:?}");
}
