//! Sums of the pressures of specular paths, a portion of the paths at a time: there may be millions.

use crate::error::Error;
use crate::observe::band_pulse::BandPulse;
use crate::observe::observed_response;
use crate::observe::time_bins::Bins;
use crate::simulate::traced_pair::TracedPair;
use crate::simulate::traced_views::TracedPairView;
use crate::statistics::exp_all;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{FilterBank, PerBand};

/// Places of source and receiver at which pressures are summed, each with its mirror image about the stated ones.
const PLACES: usize = 3;
/// Path differences by places, in wave lengths, below which one of them and its mirror image say it all.
const STILL: f64 = 0.05;
/// Images that are held at a time.
const AT_ONCE: usize = 1 << 15;
/// Cells in which energies are gathered before they are spread over the bins, in seconds.
const FINE_CELL_S: f64 = 2.5e-4;

/// Some of the specular paths of a pair.
pub(super) struct Portion<'a> {
    lengths_m: Vec<f64>,
    departures: Vec<[f32; 3]>,
    arrivals: Vec<[f32; 3]>,
    energies: Energies<'a>,
}

/// Energies of paths.
enum Energies<'a> {
    /// Those of exact paths, `[band][path]`.
    Known(Vec<Vec<f64>>),
    /// Images: how often each meets the six faces, and what each band keeps.
    Images { reflections: Vec<[u16; 6]>, kept: &'a [Kept] },
}

/// What walls and air leave of a band.
struct Kept {
    /// Logarithm of what is left of the specular energy at each face.
    ln_left: [f64; 6],
    per_m: f64,
}

impl Portion<'_> {
    /// Energies of some of the paths in a band.
    fn energies(&self, band: usize, paths: &[usize]) -> Vec<f64> {
        match &self.energies {
            Energies::Known(energies) => paths.iter().map(|&path| energies[band][path]).collect(),
            Energies::Images { reflections, kept } => {
                let Kept { ln_left, per_m } = &kept[band];
                let exponent = |path: &usize| -> f64 {
                    let met = reflections[*path].iter().zip(ln_left);
                    met.map(|(&n, left)| f64::from(n) * left).sum::<f64>() - per_m * self.lengths_m[*path]
                };
                let mut energies: Vec<f64> = paths.iter().map(exponent).collect();
                exp_all(&mut energies);
                let lengths_m = paths.iter().map(|&path| self.lengths_m[path]);
                energies.iter_mut().zip(lengths_m).for_each(|(energy, length)| *energy /= length * length);
                energies
            }
        }
    }
}

/// Shows the specular paths of a pair that are no longer than this: all images of a cuboid, or the exact paths of another room.
pub(super) fn for_each_portion(
    pair: &TracedPairView<'_>,
    max_length_m: f64,
    show: &mut dyn FnMut(&Portion<'_>),
) -> Result<(), Error> {
    match pair.room().cuboid_faces() {
        Some(faces) => images(pair, faces, max_length_m, show),
        None => show(&exact_paths(pair, max_length_m)?),
    }
    Ok(())
}

fn exact_paths(pair: &TracedPairView<'_>, max_length_m: f64) -> Result<Portion<'static>, Error> {
    let (energies, paths) = (pair.expanded_energies()?, pair.paths());
    let early = |i: &usize| paths.is_exact(*i) && f64::from(paths.lengths_m()[*i]) <= max_length_m;
    let found: Vec<usize> = (0..paths.len()).filter(early).collect();
    let of_band = |all: &Vec<f32>| found.iter().map(|&i| f64::from(all[i])).collect();
    Ok(Portion {
        lengths_m: found.iter().map(|&i| f64::from(paths.lengths_m()[i])).collect(),
        departures: found.iter().map(|&i| paths.departure(i).map(|x| x as f32)).collect(),
        arrivals: found.iter().map(|&i| paths.arrival(i).map(|x| x as f32)).collect(),
        energies: Energies::Known(energies.iter().map(of_band).collect()),
    })
}

fn images(pair: &TracedPairView<'_>, faces: [u32; 6], max_length_m: f64, show: &mut dyn FnMut(&Portion<'_>)) {
    let bands = pair.room().survey().bands();
    let per_m: PerBand<f64> = pair.air().energy_exponent_per_m(bands);
    let ln_left = |band: usize| {
        faces.map(|face| {
            let material = &pair.room().materials()[face as usize];
            let (a, s) = (material.absorption().values()[band], material.scattering().values()[band]);
            ((1.0 - a) * (1.0 - s)).max(1e-9).ln()
        })
    };
    let kept: Vec<Kept> =
        (0..bands.len()).map(|band| Kept { ln_left: ln_left(band), per_m: per_m.values()[band] }).collect();
    let empty = || Portion {
        lengths_m: Vec::with_capacity(AT_ONCE),
        departures: Vec::with_capacity(AT_ONCE),
        arrivals: Vec::with_capacity(AT_ONCE),
        energies: Energies::Images { reflections: Vec::with_capacity(AT_ONCE), kept: &kept },
    };
    let mut held = empty();
    pair.for_each_image(max_length_m, &mut |image| {
        held.lengths_m.push(image.length_m);
        held.departures.push(image.departure.map(|x| x as f32));
        held.arrivals.push(image.arrival.map(|x| x as f32));
        if let Energies::Images { reflections, .. } = &mut held.energies {
            reflections.push(image.reflections.map(|n| n as u16));
        }
        if held.lengths_m.len() == AT_ONCE {
            show(&std::mem::replace(&mut held, empty()));
        }
    });
    show(&held);
}

/// Places of source and receiver within what is known of them.
pub(super) struct Places {
    /// By how much the two stand elsewhere.
    moves_m: Vec<[[f32; 3]; 2]>,
    /// The way of the direct sound.
    direct: [f32; 3],
}

impl Places {
    pub fn drawn(pair: &TracedPairView<'_>) -> Self {
        let (room, response) = (pair.room(), pair.response());
        let (source, receiver) = (response.source, response.receiver);
        let survey = room.survey();
        let sd_m = [survey.sources()[source].position_sd_m, survey.receivers()[receiver].position_sd_m];
        // Of the pair and nothing else: the same on any number of threads.
        let mut random = Pcg64Mcg::seed_from_u64(((source as u64) << 32) | receiver as u64);
        let mut moves_m = Vec::with_capacity(2 * PLACES);
        for _ in 0..PLACES {
            let there: [[f32; 3]; 2] =
                sd_m.map(|sd| std::array::from_fn(|_| (sd * random.sample::<f64, _>(StandardNormal)) as f32));
            moves_m.extend([there, there.map(|end| end.map(|x| -x))]);
        }
        let (from, to) = (room.source(source).position_m, room.receiver(receiver).position_m);
        let way: [f64; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
        // Two in one place have no direction, and need none.
        let length = way.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
        Self { moves_m, direct: way.map(|x| (x / length) as f32) }
    }

    /// The stated places, twice.
    #[cfg(test)]
    pub fn as_stated() -> Self {
        Self { moves_m: vec![[[0.0; 3]; 2]; 2], direct: [1.0, 0.0, 0.0] }
    }

    /// By how much each path is longer beside the direct sound: `[place][path]`, in metres.
    fn longer_m(&self, paths: &Portion<'_>) -> Vec<Vec<f32>> {
        let along = |unit: &[f32; 3], by: &[f32; 3]| unit.iter().zip(by).map(|(u, b)| u * b).sum::<f32>();
        let of_place = |[source, receiver]: &[[f32; 3]; 2]| -> Vec<f32> {
            let of_direct = along(&self.direct, receiver) - along(&self.direct, source);
            let ends = paths.departures.iter().zip(&paths.arrivals);
            ends.map(|(from, to)| -along(from, source) - along(to, receiver) - of_direct).collect()
        };
        self.moves_m.iter().map(of_place).collect()
    }

    /// By how much a path is longer or shorter at most.
    fn most_m(&self) -> f64 {
        let length = |end: &[f32; 3]| end.iter().map(|x| x * x).sum::<f32>().sqrt();
        let of_place = |ends: &[[f32; 3]; 2]| 2.0 * (length(&ends[0]) + length(&ends[1]));
        self.moves_m.iter().map(of_place).fold(0.0, f32::max).into()
    }
}

/// Pressures and energies of one band, summed so far.
pub(super) struct BandSums<'a> {
    band: usize,
    bins: Bins,
    count: usize,
    rate_hz: f64,
    pulse: &'a BandPulse,
    direct_s: f64,
    speed_m_s: f64,
    /// What is longer is heard in none of the bins.
    end_m: f64,
    /// So long before the direct sound signals begin.
    lead_s: f64,
    /// `[place][sample]`.
    signals: Vec<Vec<f64>>,
    cells: Vec<f64>,
}

/// What was summed in the bins of one band.
pub(super) struct SummedBins {
    /// Energies of the sums of pressures, `[place][bin]`.
    pub together: Vec<Vec<f64>>,
    /// Sums of energies.
    pub apart: Vec<f64>,
}

impl<'a> BandSums<'a> {
    /// For the first so many bins of a band, whose pulse has this sample rate.
    pub fn new(
        pair: &TracedPairView<'_>,
        (band, count): (usize, usize),
        places: &Places,
        (rate_hz, pulse): &'a (f64, BandPulse),
    ) -> Self {
        let bands = pair.room().survey().bands();
        let bins = Bins::new(bands, band);
        let (direct_s, speed_m_s) = (pair.direct_s(), pair.air().speed_of_sound_m_s());
        // High octaves are compared for a shorter time: what comes after it is heard in none of their bins.
        let end_s = bins.edge_s(count) + pulse.reach_s();
        let lead_s = pulse.reach_s() - bins.edge_s(0);
        let wave_length_m = speed_m_s / bands.exact_hz(band);
        let places_of_band = if places.most_m() < STILL * wave_length_m { 2 } else { places.moves_m.len() };
        let samples = ((lead_s + end_s) * rate_hz).ceil() as usize + 4;
        let cells = (end_s / FINE_CELL_S).ceil().max(0.0) as usize + 1;
        Self {
            band,
            bins,
            count,
            rate_hz: *rate_hz,
            pulse,
            direct_s,
            speed_m_s,
            end_m: (direct_s + end_s) * speed_m_s + places.most_m(),
            lead_s,
            signals: vec![vec![0.0; samples]; places_of_band],
            cells: vec![0.0; cells],
        }
    }

    /// Adds some paths, longer by so much at each place (`[place][path]`).
    fn add(&mut self, paths: &Portion<'_>, longer_m: &[Vec<f32>]) {
        let lengths_m = &paths.lengths_m;
        let heard: Vec<usize> = (0..lengths_m.len()).filter(|&i| lengths_m[i] < self.end_m).collect();
        let energies = paths.energies(self.band, &heard);
        let after_s = |length_m: f64| length_m / self.speed_m_s - self.direct_s;
        for (&path, energy) in heard.iter().zip(&energies) {
            let cell = (after_s(lengths_m[path]).max(0.0) / FINE_CELL_S) as usize;
            if let Some(cell) = self.cells.get_mut(cell) {
                *cell += energy;
            }
        }
        let amplitudes: Vec<f64> = energies.iter().map(|energy| energy.sqrt()).collect();
        for (signal, longer_m) in self.signals.iter_mut().zip(longer_m) {
            for (&path, &amplitude) in heard.iter().zip(&amplitudes) {
                let time_s = after_s(lengths_m[path] + f64::from(longer_m[path]));
                add_pulse(signal, (time_s + self.lead_s) * self.rate_hz, amplitude);
            }
        }
    }

    /// What the band's filter makes of the sums.
    pub fn finish(self, pair: &TracedPairView<'_>) -> Result<SummedBins, Error> {
        let Self { band, bins, count, rate_hz, pulse, lead_s, .. } = self;
        let bands = pair.room().survey().bands();
        let bank = FilterBank::new(bands.part(band..band + 1), rate_hz as u32)?;
        let energies = |signal: &Vec<f64>| {
            let signal: Vec<f32> = signal.iter().map(|x| *x as f32).collect();
            let filtered = bank.analyse(&signal);
            let own = &filtered.values()[0];
            let mut energies =
                observed_response::energies(own, lead_s * rate_hz, rate_hz, bins, pulse.energy);
            energies.resize(count, 0.0);
            energies
        };
        let mut apart = vec![0.0; count];
        for (cell, &energy) in self.cells.iter().enumerate().filter(|(_, e)| **e > 0.0) {
            // The direct sound stands at the beginning of its cell, the others anywhere in theirs.
            let time_s = if cell == 0 { 0.0 } else { (cell as f64 + 0.5) * FINE_CELL_S };
            TracedPair::shares(time_s, bins, pulse, count, |bin, share| apart[bin] += share * energy);
        }
        Ok(SummedBins { together: self.signals.iter().map(energies).collect(), apart })
    }
}

/// Adds a portion of the paths to the sums of all bands.
pub(super) fn add_all(sums: &mut [BandSums<'_>], places: &Places, paths: &Portion<'_>) {
    let longer_m = places.longer_m(paths);
    sums.iter_mut().for_each(|band| band.add(paths, &longer_m));
}

/// Adds a pulse between samples, by the cubic through four of them (Lagrange).
fn add_pulse(signal: &mut [f64], at: f64, amplitude: f64) {
    if at < 1.0 {
        return;
    }
    let before = at as usize;
    let x = at - before as f64;
    let Some(four) = signal.get_mut(before - 1..before + 3) else { return };
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
    use super::*;

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
