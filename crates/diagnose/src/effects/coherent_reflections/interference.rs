//! Sums of the pressures of specular paths, in the bins in which energies are measured.

use crate::error::Error;
use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::observed_response;
use crate::observe::time_bins::Bins;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_pair::TracedPair;
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use crate::statistics::exp_all;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Bands, FilterBank, PerBand};
use std::f64::consts::PI;

/// Images that are summed for a pair, at most: where more would be heard in time, the last bins are open.
const MOST_IMAGES: f64 = 1e6;
/// Exact paths of a room that is no cuboid count for so long after the direct sound, in seconds: later ones are a choice of all.
const EXACT_S: f64 = 0.055;
/// Places of source and receiver at which pressures are summed, each with its mirror image about the stated ones.
const PLACES: usize = 3;
/// Bins to either side over which the variance by places is averaged: few places leave that of a single bin to chance.
const SMOOTHED: usize = 2;
/// Samples in a period of the band's middle.
const SAMPLES_PER_PERIOD: f64 = 10.0;
/// Slowest sample rate, in Hz: that of the slowest filter bank.
const MIN_RATE_HZ: f64 = 1e3;
/// Cells in which energies are gathered before they are spread over the bins, in seconds.
const FINE_CELL_S: f64 = 2.5e-4;
/// Relative variance of a bin in which pressures add, but were not summed: five decibels up or down, or ten where one mode is left.
const UNSUMMED_VARIANCE: f64 = 4.0;
/// Summed bins whose mean change stands for those after them, at most.
const LAST: usize = 10;
/// Largest change that counts, in nepers of energy: a node is never so deep where it is measured.
const MAX_CHANGE: f64 = 5.0;

/// What the sum of pressures changes in the bins of one band and pair; empty where nothing is known.
#[derive(Default)]
pub(super) struct Interference {
    /// Logarithm of the energy of the sum of pressures over the sum of energies.
    pub change: Vec<f64>,
    /// Relative variance of that energy by what is not known of places.
    pub open_variance: Vec<f64>,
    /// Bins in which pressures were summed: the first so many.
    pub summed: usize,
}

impl Interference {
    #[cfg(test)]
    pub fn by_hand(bins: usize) -> Self {
        Self {
            change: (0..bins).map(|bin| 0.5 * (1.7 * bin as f64 + 0.4).sin()).collect(),
            open_variance: (0..bins).map(|bin| 0.01 + 0.002 * bin as f64).collect(),
            summed: bins,
        }
    }
}

/// Specular paths of a pair, in full as far as they go.
struct SpecularPaths {
    lengths_m: Vec<f64>,
    departures: Vec<[f32; 3]>,
    arrivals: Vec<[f32; 3]>,
    /// `[band][path]`.
    energies: Vec<Vec<f64>>,
    /// Until when bins of each band are summed, in seconds after the direct sound: what is heard in them is there, with what arrives
    /// after them and rings back into them.
    summed_until_s: Vec<f64>,
    /// Whether those that arrive later are in phase as these are: images of a cuboid, not what a mesh of any shape scatters.
    is_in_phase_to_the_end: bool,
}

/// Tabulates by how much sums of pressures differ from those of energies at the materials of the expansion.
pub(super) fn prepare(room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
    let pulses = pulses(room.survey().bands())?;
    Ok(Tables::of_bins(room.by_pair(|pair| of_pair(pair, &pulses))?))
}

/// The pulse of each band by a filter of its own, at a sample rate that is enough for it.
fn pulses(bands: Bands) -> Result<Vec<(f64, BandPulse)>, Error> {
    let of = |band: usize| {
        let rate_hz = (SAMPLES_PER_PERIOD * bands.exact_hz(band)).max(MIN_RATE_HZ).ceil();
        let mut own = BandPulse::all(bands.part(band..band + 1), rate_hz as u32, CELL_S)?;
        Ok((rate_hz, own.swap_remove(0)))
    };
    (0..bands.len()).map(of).collect()
}

fn of_pair(pair: &TracedPairView<'_>, pulses: &[(f64, BandPulse)]) -> Result<Vec<Interference>, Error> {
    let reaches_s: Vec<f64> = pulses.iter().map(|(_, pulse)| pulse.reach_s()).collect();
    let paths = specular_paths(pair, &reaches_s)?;
    let moves = moves_m(pair, &paths);
    (0..pulses.len()).map(|band| of_band(pair, band, &paths, &moves, &pulses[band])).collect()
}

/// All images of a cuboid within the compared time, or the early exact paths of another room, and those that come so soon after that a pulse of
/// some band rings back (`reaches_s`); none where there is no direct sound.
fn specular_paths(pair: &TracedPairView<'_>, reaches_s: &[f64]) -> Result<SpecularPaths, Error> {
    let bands = pair.room().survey().bands();
    let mut found = SpecularPaths {
        lengths_m: Vec::new(),
        departures: Vec::new(),
        arrivals: Vec::new(),
        energies: vec![Vec::new(); bands.len()],
        summed_until_s: vec![0.0; bands.len()],
        is_in_phase_to_the_end: false,
    };
    if !pair.has_direct() {
        return Ok(found);
    }
    let (air, direct_s) = (pair.air(), pair.direct_s());
    let speed_m_s = air.speed_of_sound_m_s();
    let longest_s = reaches_s.iter().copied().fold(0.0, f64::max);
    let Some(faces) = pair.room().cuboid_faces() else {
        let energies = pair.expanded_energies()?;
        let paths = pair.paths();
        let end_m = (direct_s + EXACT_S + longest_s) * speed_m_s;
        let early = |i: &usize| paths.is_exact(*i) && f64::from(paths.lengths_m()[*i]) < end_m;
        for i in (0..paths.len()).filter(early) {
            found.lengths_m.push(f64::from(paths.lengths_m()[i]));
            found.departures.push(paths.departure(i).map(|x| x as f32));
            found.arrivals.push(paths.arrival(i).map(|x| x as f32));
            found.energies.iter_mut().zip(energies).for_each(|(own, all)| own.push(f64::from(all[i])));
        }
        found.summed_until_s.fill(EXACT_S);
        return Ok(found);
    };
    let compared_s = (0..bands.len()).map(|band| pair.compared_s(band)).fold(0.0, f64::max);
    let volume_m3 = pair.room().scene().volume_m3().abs();
    let most_m = (MOST_IMAGES * volume_m3 * 3.0 / (4.0 * PI)).cbrt();
    let max_length_m = ((direct_s + compared_s + longest_s) * speed_m_s).min(most_m);
    found.summed_until_s =
        reaches_s.iter().map(|reach_s| max_length_m / speed_m_s - direct_s - reach_s).collect();
    found.is_in_phase_to_the_end = true;
    let mut reflections: Vec<[u16; 6]> = Vec::new();
    pair.for_each_image(max_length_m, &mut |image| {
        found.lengths_m.push(image.length_m);
        found.departures.push(image.departure.map(|x| x as f32));
        found.arrivals.push(image.arrival.map(|x| x as f32));
        reflections.push(image.reflections.map(|n| n as u16));
    });
    let per_m: PerBand<f64> = air.energy_exponent_per_m(bands);
    for (band, energies) in found.energies.iter_mut().enumerate() {
        let left = faces.map(|face| {
            let material = &pair.room().materials()[face as usize];
            let (a, s) = (material.absorption().values()[band], material.scattering().values()[band]);
            ((1.0 - a) * (1.0 - s)).max(1e-9).ln()
        });
        let logarithm = |(reflections, length): (&[u16; 6], &f64)| -> f64 {
            let walls: f64 = reflections.iter().zip(left).map(|(&n, left)| f64::from(n) * left).sum();
            walls - per_m.values()[band] * length - 2.0 * length.ln()
        };
        *energies = reflections.iter().zip(&found.lengths_m).map(logarithm).collect();
        exp_all(energies);
    }
    Ok(found)
}

/// By how much each path is longer beside the direct sound if source and receiver stand elsewhere than stated, within what is known of them:
/// `[place][path]`, in metres.
fn moves_m(pair: &TracedPairView<'_>, paths: &SpecularPaths) -> Vec<Vec<f32>> {
    let Some(direct) =
        (0..paths.lengths_m.len()).min_by(|&a, &b| paths.lengths_m[a].total_cmp(&paths.lengths_m[b]))
    else {
        return Vec::new();
    };
    let (survey, response) = (pair.room().survey(), pair.response());
    let sd_m = [
        survey.sources()[response.source].position_sd_m,
        survey.receivers()[response.receiver].position_sd_m,
    ];
    // Of the pair and nothing else: the same on any number of threads.
    let mut random = Pcg64Mcg::seed_from_u64(((response.source as u64) << 32) | response.receiver as u64);
    let mut moves = Vec::with_capacity(2 * PLACES);
    for _ in 0..PLACES {
        let [source, receiver]: [[f32; 3]; 2] =
            sd_m.map(|sd| std::array::from_fn(|_| (sd * random.sample::<f64, _>(StandardNormal)) as f32));
        let longer = |i: usize| -> f32 {
            let along = |unit: &[f32; 3], by: &[f32; 3]| unit.iter().zip(by).map(|(u, b)| u * b).sum::<f32>();
            -along(&paths.departures[i], &source) - along(&paths.arrivals[i], &receiver)
        };
        let of_direct = longer(direct);
        let there: Vec<f32> = (0..paths.lengths_m.len()).map(|i| longer(i) - of_direct).collect();
        let mirrored = there.iter().map(|x| -x).collect();
        moves.extend([there, mirrored]);
    }
    moves
}

/// By how much a path is longer or shorter at most.
fn most_moved_m(moves_m: &[Vec<f32>]) -> f64 {
    moves_m.iter().flatten().fold(0.0f32, |most, moved| most.max(moved.abs())).into()
}

fn of_band(
    pair: &TracedPairView<'_>,
    band: usize,
    paths: &SpecularPaths,
    moves_m: &[Vec<f32>],
    (rate_hz, pulse): &(f64, BandPulse),
) -> Result<Interference, Error> {
    let bands = pair.room().survey().bands();
    let bins = Bins::new(bands, band);
    let compared = bins.count(pair.compared_s(band) + 1e-9).min(pair.ln_energy(band).len());
    let count = bins.count(paths.summed_until_s[band] + 1e-9).min(compared);
    if count == 0 || paths.lengths_m.is_empty() {
        return Ok(Interference::default());
    }
    let bank = FilterBank::new(bands.part(band..band + 1), *rate_hz as u32)?;
    let speed_m_s = pair.air().speed_of_sound_m_s();
    let end_s = bins.edge_s(count) + pulse.reach_s();
    let lead_s = pulse.reach_s() - bins.edge_s(0);
    let samples = ((lead_s + end_s) * rate_hz).ceil() as usize + 4;
    let after_s = |path: usize, longer_m: f32| {
        (paths.lengths_m[path] + f64::from(longer_m)) / speed_m_s - pair.direct_s()
    };
    // High octaves are compared for a shorter time: what comes after it is heard in none of their bins.
    let end_m = (pair.direct_s() + end_s) * speed_m_s + most_moved_m(moves_m);
    let heard: Vec<usize> = (0..paths.lengths_m.len()).filter(|&i| paths.lengths_m[i] < end_m).collect();
    let amplitudes: Vec<f64> = heard.iter().map(|&path| paths.energies[band][path].sqrt()).collect();
    let sums: Vec<Vec<f64>> = moves_m
        .iter()
        .map(|moves| {
            let mut signal = vec![0.0f64; samples];
            for (&path, &amplitude) in heard.iter().zip(&amplitudes) {
                add_pulse(&mut signal, (after_s(path, moves[path]) + lead_s) * rate_hz, amplitude);
            }
            let signal: Vec<f32> = signal.into_iter().map(|x| x as f32).collect();
            let filtered = bank.analyse(&signal);
            observed_response::energies(&filtered.values()[0], lead_s * rate_hz, *rate_hz, bins, pulse.energy)
        })
        .collect();
    let apart = energies_apart(paths, band, (bins, count), pulse, &|path| after_s(path, 0.0));
    let draws = sums.len() as f64;
    let (mut change, mut scatter) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for (bin, &apart) in apart.iter().enumerate() {
        let together = sums.iter().map(|s| s.get(bin).copied().unwrap_or(0.0)).sum::<f64>() / draws;
        // What is scattered has any phase.
        let scattered = (pair.ln_energy(band)[bin].exp() - apart).max(0.0);
        let whole = (scattered + together).max(1e-300);
        change.push((whole / (scattered + apart).max(1e-300)).ln().clamp(-MAX_CHANGE, MAX_CHANGE));
        let deviation = |s: &Vec<f64>| (s.get(bin).copied().unwrap_or(0.0) - together).powi(2);
        // Where they really stand is one place more, and the mean is that of a few.
        let unbiased = (1.0 + draws.recip()) / (draws - 1.0);
        scatter.push(unbiased * sums.iter().map(deviation).sum::<f64>() / (whole * whole));
    }
    let mean = |about: usize| {
        let near = &scatter[about.saturating_sub(SMOOTHED)..(about + SMOOTHED + 1).min(count)];
        near.iter().sum::<f64>() / near.len() as f64
    };
    let mut open_variance: Vec<f64> = (0..count).map(mean).collect();
    if paths.is_in_phase_to_the_end {
        let last = &change[count.saturating_sub(LAST)..];
        let held = last.iter().sum::<f64>() / last.len() as f64;
        change.resize(compared, held);
        open_variance.resize(compared, UNSUMMED_VARIANCE);
    }
    Ok(Interference { change, open_variance, summed: count })
}

/// Energies of the bins if paths add as energies.
fn energies_apart(
    paths: &SpecularPaths,
    band: usize,
    (bins, count): (Bins, usize),
    pulse: &BandPulse,
    after_s: &dyn Fn(usize) -> f64,
) -> Vec<f64> {
    let end_s = bins.edge_s(count) + pulse.reach_s();
    let mut cells = vec![0.0f64; (end_s / FINE_CELL_S).ceil().max(0.0) as usize + 1];
    for (path, &energy) in paths.energies[band].iter().enumerate() {
        if let Some(cell) = cells.get_mut((after_s(path).max(0.0) / FINE_CELL_S) as usize) {
            *cell += energy;
        }
    }
    let mut energies = vec![0.0; count];
    for (cell, energy) in cells.into_iter().enumerate().filter(|(_, e)| *e > 0.0) {
        // The direct sound stands at the beginning of its cell, the others anywhere in theirs.
        let time_s = if cell == 0 { 0.0 } else { (cell as f64 + 0.5) * FINE_CELL_S };
        TracedPair::shares(time_s, bins, pulse, count, |bin, share| energies[bin] += share * energy);
    }
    energies
}

/// Adds a pulse between samples, by the cubic through four of them (Lagrange).
fn add_pulse(signal: &mut [f64], at: f64, amplitude: f64) {
    let before = at.floor();
    if before < 1.0 {
        return;
    }
    let (x, first) = (at - before, before as usize - 1);
    let Some(four) = signal.get_mut(first..first + 4) else { return };
    let weights = [
        -x * (x - 1.0) * (x - 2.0) / 6.0,
        (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0,
        -(x + 1.0) * x * (x - 2.0) / 2.0,
        (x + 1.0) * x * (x - 1.0) / 6.0,
    ];
    four.iter_mut().zip(weights).for_each(|(sample, weight)| *sample += weight * amplitude);
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::infer::baseline::Baseline;

    /// A low octave rings for several bins: images that arrive after the last one are heard in it.
    #[test]
    fn what_arrives_after_the_last_bin_is_summed_with_it() {
        let baseline = Baseline::of_laboratory(31);
        let view = baseline.room_view().unwrap();
        let pair = view.pair(0);
        let pulses = pulses(view.survey().bands()).unwrap();
        let reaches_s: Vec<f64> = pulses.iter().map(|(_, pulse)| pulse.reach_s()).collect();
        let changes = |later_s: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> {
            let later: Vec<f64> = reaches_s.iter().map(|&r| later_s(r)).collect();
            let mut paths = specular_paths(&pair, &later).unwrap();
            paths.summed_until_s = vec![10.0; pulses.len()];
            // As they stand: other places would be drawn for other lists of paths.
            let moves = vec![vec![0.0; paths.lengths_m.len()]; 2];
            let of = |band| of_band(&pair, band, &paths, &moves, &pulses[band]).unwrap().change;
            (0..pulses.len()).map(of).collect()
        };
        let most_apart = |a: &[Vec<f64>], b: &[Vec<f64>]| -> f64 {
            let each = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs());
            each.fold(0.0, f64::max)
        };
        let (own, longer) = (changes(&|r| r), changes(&|r| r + 0.05));
        assert!(own.iter().all(|c| c.len() > 10));
        assert!(most_apart(&own, &longer) < 0.02, "{}", most_apart(&own, &longer));
        // The images that make the difference.
        let short = changes(&|_| 0.0);
        assert!(most_apart(&short, &longer) > 0.3, "{}", most_apart(&short, &longer));
    }

    #[test]
    fn a_pulse_between_samples_is_a_delay_below_a_fifth_of_the_sample_rate() {
        for (at, frequency) in [(20.0, 0.1), (20.3, 0.1), (20.5, 0.05), (20.77, 0.12)] {
            let mut signal = vec![0.0; 41];
            add_pulse(&mut signal, at, 2.0);
            let turn = std::f64::consts::TAU * frequency;
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (n, x) in signal.iter().enumerate() {
                real += x * (turn * (n as f64 - at)).cos();
                imaginary -= x * (turn * (n as f64 - at)).sin();
            }
            assert!(
                (real - 2.0).abs() < 0.04 && imaginary.abs() < 0.02,
                "{at} {frequency}: {real} {imaginary}"
            );
        }
        // Nothing beyond the ends.
        let mut short = vec![0.0; 4];
        [0.5, 2.5, 9.0].into_iter().for_each(|at| add_pulse(&mut short, at, 1.0));
        assert_eq!(short, [0.0; 4]);
    }
}
