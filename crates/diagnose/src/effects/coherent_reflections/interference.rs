//! What sums of pressures change in the bins in which energies are measured.

use super::pressure_sums::{BandSums, Places, SummedBins, add_all, for_each_portion};
use crate::error::Error;
use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::time_bins::Bins;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use sabine_acoustics::Bands;
use std::f64::consts::PI;

/// Images that are summed for a pair, at most: where more would be heard in time, the last bins are open.
const MOST_IMAGES: f64 = 1e6;
/// Exact paths of a room that is no cuboid count for so long after the direct sound, in seconds: later ones are a choice of all.
const EXACT_S: f64 = 0.055;
/// Bins to either side over which the variance by places is averaged: few places leave that of a single bin to chance.
const SMOOTHED: usize = 2;
/// Samples in a period of the band's middle.
const SAMPLES_PER_PERIOD: f64 = 10.0;
/// Slowest sample rate, in Hz: that of the slowest filter bank.
const MIN_RATE_HZ: f64 = 1e3;
/// Relative variance of a bin in which pressures add, but were not summed: five decibels up or down, or ten where one mode is left.
const UNSUMMED_VARIANCE: f64 = 4.0;
/// Summed bins whose mean stands for those after them, at most.
const LAST: usize = 10;
/// Largest change that counts, in nepers of energy: a node is never so deep where it is measured.
const MAX_CHANGE: f64 = 5.0;

/// What the sum of pressures changes in the bins of one band and pair; empty where nothing is known.
#[derive(Clone, Default)]
pub(super) struct Interference {
    /// Energy of the sum of pressures beyond that of the sum of energies, as a share of the latter.
    excess: Vec<f64>,
    /// Share of the sum of energies whose phase is known: what was not scattered.
    in_phase: Vec<f64>,
    /// Relative variance of the sum of pressures by what is not known of places.
    open_variance: Vec<f64>,
    /// Bins in which pressures were summed: the first so many.
    summed: usize,
}

impl Interference {
    #[cfg(test)]
    pub fn by_hand(bins: usize) -> Self {
        Self {
            excess: (0..bins).map(|bin| 0.5 * (1.7 * bin as f64 + 0.4).sin()).collect(),
            in_phase: (0..bins).map(|bin| 0.9 - 0.01 * bin as f64).collect(),
            open_variance: (0..bins).map(|bin| 0.01 + 0.002 * bin as f64).collect(),
            summed: bins,
        }
    }

    /// Adds what logarithms of energies change where so much of the energy adds as pressures.
    pub fn add_change(&self, of_pressures: f64, ln_energy: &mut [f64]) {
        for (l, excess) in ln_energy.iter_mut().zip(&self.excess) {
            *l += (of_pressures * excess).ln_1p();
        }
    }

    /// What is left of the variance that chance gives, and what places leave open.
    ///
    /// A share r of the energy with any phase beside a known pressure: the energy of their sum has the relative variance 1 - (1 - r)^2
    /// (the noncentral chi-squared distribution of two degrees of freedom), 1 where nothing is known.
    pub fn limit_variance(&self, of_pressures: f64, variance: &mut [f64]) {
        let tables = self.excess.iter().zip(&self.in_phase).zip(&self.open_variance);
        for (bin, (v, ((excess, in_phase), open))) in variance.iter_mut().zip(tables).enumerate() {
            let of_any_phase = (1.0 - of_pressures * in_phase) / (1.0 + of_pressures * excess);
            let known = (1.0 - of_any_phase).max(0.0).powi(2);
            if bin < self.summed {
                *v = v.min((1.0 - known) * *v + known * open);
            } else {
                // Only the mean of these is known.
                *v += of_pressures * in_phase * open;
            }
        }
    }
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
    if !pair.has_direct() {
        return Ok(vec![Interference::default(); pulses.len()]);
    }
    let reaches_s: Vec<f64> = pulses.iter().map(|(_, pulse)| pulse.reach_s()).collect();
    interferences(pair, pulses, &Extent::of(pair, &reaches_s), &Places::drawn(pair))
}

/// How far specular paths of a pair are known in full.
struct Extent {
    max_length_m: f64,
    /// Until when bins of each band are summed, in seconds after the direct sound: what is heard in them is there, with what arrives after
    /// them and rings back into them.
    summed_until_s: Vec<f64>,
    /// Whether those that arrive later are in phase as these are: images of a cuboid, not what a mesh of any shape scatters.
    is_in_phase_to_the_end: bool,
}

impl Extent {
    /// All images of a cuboid within the compared time, or the early exact paths of another room, and those that come so soon after that a
    /// pulse of some band rings back (`reaches_s`).
    fn of(pair: &TracedPairView<'_>, reaches_s: &[f64]) -> Self {
        let speed_m_s = pair.air().speed_of_sound_m_s();
        let longest_s = reaches_s.iter().copied().fold(0.0, f64::max);
        let until_m = |end_s: f64| (pair.direct_s() + end_s + longest_s) * speed_m_s;
        if pair.room().cuboid_faces().is_none() {
            let summed_until_s = vec![EXACT_S; reaches_s.len()];
            return Self { max_length_m: until_m(EXACT_S), summed_until_s, is_in_phase_to_the_end: false };
        }
        let compared_s = (0..reaches_s.len()).map(|band| pair.compared_s(band)).fold(0.0, f64::max);
        let volume_m3 = pair.room().scene().volume_m3().abs();
        let most_m = (MOST_IMAGES * volume_m3 * 3.0 / (4.0 * PI)).cbrt();
        let max_length_m = until_m(compared_s).min(most_m);
        let until_s = |reach_s: &f64| max_length_m / speed_m_s - pair.direct_s() - reach_s;
        let summed_until_s = reaches_s.iter().map(until_s).collect();
        Self { max_length_m, summed_until_s, is_in_phase_to_the_end: true }
    }
}

/// Sums what is heard at these places, in all bands.
fn interferences(
    pair: &TracedPairView<'_>,
    pulses: &[(f64, BandPulse)],
    extent: &Extent,
    places: &Places,
) -> Result<Vec<Interference>, Error> {
    let bands = pair.room().survey().bands();
    let compared = |band: usize| {
        Bins::new(bands, band).count(pair.compared_s(band) + 1e-9).min(pair.ln_energy(band).len())
    };
    let sum = |band: usize| {
        let summed = Bins::new(bands, band).count(extent.summed_until_s[band] + 1e-9);
        BandSums::new(pair, (band, summed.min(compared(band))), places, &pulses[band])
    };
    let mut sums: Vec<BandSums<'_>> = (0..pulses.len()).map(sum).collect();
    for_each_portion(pair, extent.max_length_m, &mut |paths| add_all(&mut sums, places, paths))?;
    let of_band = |(band, sums): (usize, BandSums<'_>)| {
        let mut found = of_sums(&sums.finish(pair)?, pair.ln_energy(band));
        if extent.is_in_phase_to_the_end {
            go_on(&mut found, compared(band));
        }
        Ok(found)
    };
    sums.into_iter().enumerate().map(of_band).collect()
}

fn of_sums(sums: &SummedBins, ln_energy: &[f64]) -> Interference {
    let draws = sums.together.len() as f64;
    // Where they really stand is one place more, and the mean is that of a few.
    let unbiased = (1.0 + draws.recip()) / (draws - 1.0);
    let mut found = Interference { summed: sums.apart.len(), ..Interference::default() };
    let mut scatter = Vec::with_capacity(found.summed);
    for (bin, &apart) in sums.apart.iter().enumerate() {
        let together = sums.together.iter().map(|s| s[bin]).sum::<f64>() / draws;
        // What is scattered has any phase.
        let scattered = (ln_energy[bin].exp() - apart).max(0.0);
        let (whole, by_energies) = ((scattered + together).max(1e-300), (scattered + apart).max(1e-300));
        let change = (whole / by_energies).ln().clamp(-MAX_CHANGE, MAX_CHANGE);
        found.excess.push(change.exp_m1());
        found.in_phase.push(apart / by_energies);
        let deviation = |s: &Vec<f64>| (s[bin] - together).powi(2);
        scatter.push(unbiased * sums.together.iter().map(deviation).sum::<f64>() / (whole * whole));
    }
    let near =
        |about: usize| &scatter[about.saturating_sub(SMOOTHED)..(about + SMOOTHED + 1).min(found.summed)];
    found.open_variance = (0..found.summed).map(|about| mean(near(about))).collect();
    found
}

/// Bins that were not summed, up to so many: the mean of the last that were, and open.
fn go_on(found: &mut Interference, count: usize) {
    if found.summed == 0 {
        return;
    }
    let last = found.summed.saturating_sub(LAST);
    let held = [&found.excess, &found.in_phase].map(|of_bins| mean(&of_bins[last..]));
    found.excess.resize(count, held[0]);
    found.in_phase.resize(count, held[1]);
    found.open_variance.resize(count, UNSUMMED_VARIANCE);
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
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
            let extent = Extent { summed_until_s: vec![10.0; pulses.len()], ..Extent::of(&pair, &later) };
            let found = interferences(&pair, &pulses, &extent, &Places::as_stated()).unwrap();
            found.iter().map(|f| f.excess.iter().map(|x| x.ln_1p()).collect()).collect()
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

    /// Two waves, one of known pressure and one of any phase, drawn many times.
    #[test]
    fn variance_is_that_of_a_known_pressure_beside_one_of_any_phase() {
        use rand::{Rng, SeedableRng};
        use rand_distr::StandardNormal;
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        // Pressures of two images of energy 1: in phase (energy 4), and almost cancelling (0.2).
        for (together, of_pressures) in [(4.0f64, 0.8f64), (0.2, 0.8), (2.0, 0.3), (1.5, 0.0)] {
            let of_any_phase = 2.0 * (1.0 - of_pressures);
            let known = (of_pressures * together).sqrt();
            let draws: Vec<f64> = (0..200_000)
                .map(|_| {
                    let [x, y]: [f64; 2] = std::array::from_fn(|_| random.sample(StandardNormal));
                    let sd = (0.5 * of_any_phase).sqrt();
                    (known + sd * x).powi(2) + (sd * y).powi(2)
                })
                .collect();
            let expected = mean(&draws);
            let relative = mean(&draws.iter().map(|e| (e / expected - 1.0).powi(2)).collect::<Vec<f64>>());
            let table = Interference {
                excess: vec![together / 2.0 - 1.0],
                in_phase: vec![1.0],
                open_variance: vec![0.0],
                summed: 1,
            };
            let (mut ln_energy, mut variance) = ([2f64.ln()], [1.0]);
            table.add_change(of_pressures, &mut ln_energy);
            table.limit_variance(of_pressures, &mut variance);
            assert!((ln_energy[0].exp() / expected - 1.0).abs() < 0.02, "{} {expected}", ln_energy[0].exp());
            assert!((variance[0] - relative).abs() < 0.02, "{variance:?} {relative}");
        }
    }
}
