//! Paths between one source and one receiver, sorted by time for fast evaluation.

use crate::Error;
use sabine_acoustics::{Air, Material, PerBand};
use sabine_paths::PathSet;

/// What the energy of each path depends on: when it comes and how often it met each material. Shared by all bands.
pub(crate) struct History {
    pub materials: usize,
    pub bin_s: f64,
    /// Paths of bin j: `starts[j]..starts[j + 1]`.
    pub starts: Vec<u32>,
    /// `counts[path * materials + material]`, paths sorted by bin.
    pub counts: Vec<u16>,
    /// Greatest count of any material, for tables of powers.
    pub longest: usize,
    /// How often any path met each material.
    pub hits: Vec<u64>,
    /// Arrival of each path in seconds, sorted by bin only.
    pub times_s: Vec<f64>,
    /// Batch of each path; `PathSet::BATCHES` for an exact one.
    pub batches: Vec<u8>,
    /// Number of batches.
    pub batch_count: usize,
    /// Where in the path set each path stands.
    order: Vec<u32>,
    speed_m_s: f64,
}

/// What the energies of paths are if no surface absorbs.
pub(crate) enum Unabsorbed {
    /// By distance, scattering and air alone: the exponents of the air by band, per metre.
    Air(PerBand<f64>),
    /// Under conditions of their own, `[band][contribution]`.
    Under(Vec<Vec<f32>>),
}

impl History {
    pub fn new(paths: &PathSet, air: &Air, bin_s: f64) -> Self {
        Self::delayed(paths, air, None, bin_s)
    }

    /// Of paths that arrive later than their length says, each by so many seconds.
    pub fn delayed(paths: &PathSet, air: &Air, delays_s: Option<&[f64]>, bin_s: f64) -> Self {
        let materials = paths.materials();
        let speed_m_s = air.speed_of_sound_m_s();
        let bins = (paths.max_length_m() / speed_m_s / bin_s).ceil() as usize;
        let time_s = |i: usize| {
            f64::from(paths.lengths_m()[i]) / speed_m_s + delays_s.map_or(0.0, |delays_s| delays_s[i])
        };
        let bin_of: Vec<usize> = (0..paths.len()).map(|i| (time_s(i) / bin_s) as usize).collect();
        // Counting sort; paths past the end are left out, as they are in an energy response.
        let mut starts = vec![0u32; bins + 1];
        for &bin in bin_of.iter().filter(|&&bin| bin < bins) {
            starts[bin + 1] += 1;
        }
        for bin in 0..bins {
            starts[bin + 1] += starts[bin];
        }
        let mut next = starts.clone();
        let mut order = vec![0u32; starts[bins] as usize];
        for (i, &bin) in bin_of.iter().enumerate().filter(|&(_, &bin)| bin < bins) {
            order[next[bin] as usize] = i as u32;
            next[bin] += 1;
        }
        let by_chain = paths.hit_counts();
        let mut counts = Vec::with_capacity(order.len() * materials);
        let mut hits = vec![0u64; materials];
        for &i in &order {
            let row = |chain: u32| &by_chain[chain as usize * materials..][..materials];
            let (out, back) = (row(paths.chains()[i as usize]), row(paths.tails()[i as usize]));
            for ((total, n), m) in hits.iter_mut().zip(out).zip(back) {
                counts.push(n + m);
                *total += u64::from(n + m);
            }
        }
        Self {
            materials,
            bin_s,
            longest: usize::from(counts.iter().copied().max().unwrap_or(0)),
            hits,
            times_s: order.iter().map(|&i| time_s(i as usize)).collect(),
            batches: order.iter().map(|&i| paths.batch(i as usize).unwrap_or(PathSet::BATCHES)).collect(),
            batch_count: usize::from(paths.batch_count()),
            starts,
            counts,
            order,
            speed_m_s,
        }
    }

    /// The same, time counted from the first arrival in place of the emission.
    pub fn since_first_arrival(paths: &PathSet, air: &Air, delays_s: Option<&[f64]>, bin_s: f64) -> Self {
        let speed_m_s = air.speed_of_sound_m_s();
        let delay_s = |i: usize| delays_s.map_or(0.0, |delays_s| delays_s[i]);
        let lengths_m = || paths.lengths_m().iter().enumerate();
        let arrival_s = |(i, length_m): (usize, &f32)| f64::from(*length_m) / speed_m_s + delay_s(i);
        let first_s = lengths_m().map(arrival_s).fold(f64::INFINITY, f64::min);
        let earlier_s: Vec<f64> = (0..paths.len()).map(|i| delay_s(i) - first_s).collect();
        Self::delayed(paths, air, Some(&earlier_s), bin_s)
    }

    pub fn bins(&self) -> usize {
        self.starts.len() - 1
    }

    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Energy of each path in one band if no surface absorbed, times `share`.
    pub fn weights(
        &self,
        paths: &PathSet,
        materials: &[Material],
        unabsorbed: &Unabsorbed,
        band: usize,
        share: f64,
    ) -> Result<Vec<f32>, Error> {
        let exponents = match unabsorbed {
            Unabsorbed::Air(exponents) => exponents,
            Unabsorbed::Under(energies) => {
                return Ok(self.order.iter().map(|&i| share as f32 * energies[band][i as usize]).collect());
            }
        };
        let scattering = paths.log_reflectance(&rigid(materials)?, band)?;
        let exponent = exponents.values()[band] as f32;
        let log_share = share.ln() as f32;
        let weight = |&i: &u32| {
            let i = i as usize;
            let surfaces = scattering[paths.chains()[i] as usize] + scattering[paths.tails()[i] as usize];
            (log_share + paths.log_weights()[i] + surfaces - exponent * paths.lengths_m()[i]).exp()
        };
        let mut weights: Vec<f32> = self.order.iter().map(weight).collect();
        // Few, if any: the ways around edges.
        for (contribution, diffraction) in paths.diffractions() {
            let gain = diffraction.band_energy_gain(materials[0].bands(), band, self.speed_m_s) as f32;
            let places = self.order.iter().zip(&mut weights).filter(|(i, _)| **i as usize == *contribution);
            places.for_each(|(_, w)| *w *= gain);
        }
        Ok(weights)
    }

    /// Energy of each bin at an absorption of each material, and, where `moments` is not empty, the sum over paths of energy
    /// times hits, `moments[bin * materials + material]`: minus its derivative by ln(1 - absorption).
    pub fn accumulate(&self, weights: &[f32], absorption: &[f64], energy: &mut [f64], moments: &mut [f64]) {
        match self.materials {
            1 => self.accumulate_fixed::<1>(weights, absorption, energy, moments),
            2 => self.accumulate_fixed::<2>(weights, absorption, energy, moments),
            3 => self.accumulate_fixed::<3>(weights, absorption, energy, moments),
            4 => self.accumulate_fixed::<4>(weights, absorption, energy, moments),
            5 => self.accumulate_fixed::<5>(weights, absorption, energy, moments),
            6 => self.accumulate_fixed::<6>(weights, absorption, energy, moments),
            7 => self.accumulate_fixed::<7>(weights, absorption, energy, moments),
            8 => self.accumulate_fixed::<8>(weights, absorption, energy, moments),
            _ => self.accumulate_any(weights, absorption, energy, moments),
        }
    }

    /// Powers of the reflected share of each material: `powers[material * stride + hits]`.
    fn powers(&self, absorption: &[f64]) -> (Vec<f64>, usize) {
        let stride = self.longest + 1;
        let mut powers = vec![1.0; self.materials * stride];
        for (row, &a) in powers.chunks_exact_mut(stride).zip(absorption) {
            for n in 1..stride {
                row[n] = row[n - 1] * (1.0 - a);
            }
        }
        (powers, stride)
    }

    fn accumulate_fixed<const K: usize>(
        &self,
        weights: &[f32],
        absorption: &[f64],
        energy: &mut [f64],
        moments: &mut [f64],
    ) {
        let (powers, stride) = self.powers(absorption);
        for (bin, out) in energy.iter_mut().enumerate() {
            let range = self.starts[bin] as usize..self.starts[bin + 1] as usize;
            let (mut sum, mut moment) = (0.0, [0.0; K]);
            let counts = self.counts[range.start * K..range.end * K].chunks_exact(K);
            for (&weight, counts) in weights[range].iter().zip(counts) {
                let mut e = f64::from(weight);
                for k in 0..K {
                    e *= powers[k * stride + usize::from(counts[k])];
                }
                sum += e;
                for k in 0..K {
                    moment[k] += e * f64::from(counts[k]);
                }
            }
            *out = sum;
            if !moments.is_empty() {
                moments[bin * K..(bin + 1) * K].copy_from_slice(&moment);
            }
        }
    }

    fn accumulate_any(&self, weights: &[f32], absorption: &[f64], energy: &mut [f64], moments: &mut [f64]) {
        let (powers, stride) = self.powers(absorption);
        let k = self.materials;
        moments.fill(0.0);
        for (bin, out) in energy.iter_mut().enumerate() {
            *out = 0.0;
            for (e, counts, _) in self.paths(bin, weights, &powers, stride) {
                *out += e;
                if !moments.is_empty() {
                    let row = &mut moments[bin * k..(bin + 1) * k];
                    row.iter_mut().zip(counts).for_each(|(m, &n)| *m += e * f64::from(n));
                }
            }
        }
    }

    /// Energy, hits and batch of each path of a bin.
    fn paths<'s>(
        &'s self,
        bin: usize,
        weights: &'s [f32],
        powers: &'s [f64],
        stride: usize,
    ) -> impl Iterator<Item = (f64, &'s [u16], u8)> {
        let range = self.starts[bin] as usize..self.starts[bin + 1] as usize;
        let k = self.materials;
        let counts = self.counts[range.start * k..range.end * k].chunks_exact(k);
        weights[range.clone()].iter().zip(&self.batches[range]).zip(counts).map(
            move |((weight, batch), counts)| {
                let gains =
                    counts.iter().zip(powers.chunks_exact(stride)).map(|(&n, row)| row[usize::from(n)]);
                (gains.fold(f64::from(*weight), |e, gain| e * gain), counts, *batch)
            },
        )
    }
}

/// Energies of the bins by batches of rays.
pub(crate) struct BatchEnergies {
    /// `energy[bin * (BATCHES + 1) + batch]`; the last place of a bin is for exact paths.
    pub energy: Vec<f64>,
    /// Sum of the squared energies of the exact paths of each bin.
    pub exact_squares: Vec<f64>,
}

impl History {
    /// Energy of each batch in each bin.
    pub fn batch_energies(&self, weights: &[f32], absorption: &[f64]) -> BatchEnergies {
        let (powers, stride) = self.powers(absorption);
        let places = usize::from(PathSet::BATCHES) + 1;
        let mut energy = vec![0.0; self.bins() * places];
        let mut exact_squares = vec![0.0; self.bins()];
        for bin in 0..self.bins() {
            for (e, _, batch) in self.paths(bin, weights, &powers, stride) {
                energy[bin * places + usize::from(batch)] += e;
                if batch == PathSet::BATCHES {
                    exact_squares[bin] += e * e;
                }
            }
        }
        BatchEnergies { energy, exact_squares }
    }

    /// What each batch of rays contributes to a linear functional of the bins' energies.
    pub fn batch_sums(&self, weights: &[f32], absorption: &[f64], functional: &[f64]) -> Vec<f64> {
        let (powers, stride) = self.powers(absorption);
        // The last place is for exact paths, which do not scatter.
        let mut parts = vec![0.0; usize::from(PathSet::BATCHES) + 1];
        for (bin, factor) in functional.iter().enumerate().filter(|(_, f)| **f != 0.0) {
            for (e, _, batch) in self.paths(bin, weights, &powers, stride) {
                parts[usize::from(batch)] += factor * e;
            }
        }
        parts.truncate(self.batch_count);
        parts
    }

    /// Monte-Carlo variance of a linear functional of the bins' energies, from the scatter between batches of rays.
    pub fn variance(&self, weights: &[f32], absorption: &[f64], functional: &[f64]) -> f64 {
        variance_of_sum(&self.batch_sums(weights, absorption, functional))
    }
}

/// Variance of the sum of independent parts, from their scatter.
pub(crate) fn variance_of_sum(parts: &[f64]) -> f64 {
    let n = parts.len() as f64;
    let mean = parts.iter().sum::<f64>() / n;
    let scatter: f64 = parts.iter().map(|p| (p - mean) * (p - mean)).sum();
    scatter * n / (n - 1.0)
}

/// The traces of one source-receiver pair, each a history and the weights of its paths in a band, the share of the trace in
/// the whole included: their energies add up.
pub(crate) type Traces<H> = Vec<(H, Vec<f32>)>;

/// Materials that scatter as these and absorb nothing.
pub(crate) fn rigid(materials: &[Material]) -> Result<Vec<Material>, Error> {
    let one = |m: &Material| m.with_absorption(PerBand::uniform(m.bands(), 0.0));
    Ok(materials.iter().map(one).collect::<Result<_, _>>()?)
}

/// One trace of a source-receiver pair.
#[derive(Clone, Copy)]
pub(crate) struct Trace<'p> {
    pub pair: usize,
    pub paths: &'p PathSet,
    /// What its energies count: the shares of the traces of a pair sum to 1.
    pub share: f64,
}

/// Collects what belongs to the same pair.
pub(crate) fn by_pair<T>(traces: &[Trace<'_>], of_trace: Vec<T>) -> Vec<Vec<T>> {
    let pairs = traces.iter().map(|t| t.pair + 1).max().unwrap_or(0);
    let mut grouped: Vec<Vec<T>> = (0..pairs).map(|_| Vec::new()).collect();
    for (trace, value) in traces.iter().zip(of_trace) {
        grouped[trace.pair].push(value);
    }
    grouped
}

/// That there are paths, and that they and the materials belong together.
pub(crate) fn check_paths(paths: &[&PathSet], materials: &[Material]) -> Result<(), Error> {
    if paths.is_empty() {
        return Err(Error::NoPaths { index: 0, count: 0 });
    }
    for (index, set) in paths.iter().enumerate() {
        if set.is_empty() {
            return Err(Error::NoPaths { index, count: paths.len() });
        }
        if set.materials() != materials.len() || materials.is_empty() {
            return Err(sabine_acoustics::Error::MaterialCount {
                expected: set.materials(),
                found: materials.len(),
            }
            .into());
        }
    }
    let bands = materials[0].bands();
    match materials.iter().find(|m| m.bands() != bands) {
        Some(other) => {
            Err(sabine_acoustics::Error::BandMismatch { left: bands, right: other.bands() }.into())
        }
        None => Ok(()),
    }
}
