//! Traced paths: the seam between a tracer and everything after it.

mod incidence;

pub use incidence::Incidence;

use crate::packed_direction::{pack_direction, unpack_direction};
use crate::reweighting::{LANES, Lanes, exp, sums_along};
use crate::{
    Air, Bands, Conditions, Directivity, EdgeDiffraction, EnergyResponse, Error, Material, Orientation,
};
use rayon::prelude::*;

/// What a surface did to a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reflection {
    /// Mirror reflection: energy times (1 - absorption) (1 - scattering).
    Specular,
    /// Lambert reflection: energy times (1 - absorption) scattering.
    Scattered,
}

/// One way from the source to the receiver, as a tracer reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// Whole length of the path in metres.
    pub length_m: f64,
    /// Natural logarithm of the geometric energy weight (1/m2), absorption, scattering and air left out, and divided by the
    /// density with which the tracer samples such a path: a direct path of length d has weight 1/d2.
    pub log_weight: f64,
    /// Chain of reflections from the source on: [`PathSet::DIRECT`] or what [`PathSet::reflect`] returned.
    pub chain: u32,
    /// Chain of the reflections that follow, listed from the receiver backwards: [`PathSet::DIRECT`] where `chain` is all.
    /// Tracers that start at both ends join their halves by it, each half being stored once.
    pub tail: u32,
    /// Unit vector in which the path leaves the source.
    pub departure: [f64; 3],
    /// Unit vector from the receiver towards where the path comes from.
    pub arrival: [f64; 3],
    /// `None` for a path that was found exactly (direct sound, image sources): it renders as a coherent reflection.
    /// Else the independent batch of rays (below [`PathSet::BATCHES`]) that it stems from.
    pub batch: Option<u8>,
}

/// Everything that a tracer found between one source and one receiver, free of absorption, air and speed of sound: these
/// are applied afterwards, without tracing again.
///
/// Reflections form a forest in which chains share their prefixes; contributions are kept as columns.
/// Energies are scaled so that the direct sound at 1 m is 1.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Contribution, Material, PathSet, Reflection};
/// let mut paths = PathSet::new(1, 100.0);
/// let floor = paths.reflect(PathSet::DIRECT, 0, Reflection::Specular);
/// let up = [0.0, 0.0, 1.0];
/// paths.push(Contribution {
///     length_m: 5.0, log_weight: -2.0 * 5f64.ln(), chain: floor, tail: PathSet::DIRECT,
///     departure: up, arrival: up, batch: None });
/// let hard = Material::uniform(Bands::T60, 0.2, 0.0)?;
/// let energy = paths.energies(&[hard], &Air::default())?;
/// // 1/25 of the energy at 1 m, less 20 % in the floor and a little in 5 m of air.
/// assert!((energy[0][0] / (0.8 / 25.0) - 1.0).abs() < 1e-3);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PathSet {
    materials: usize,
    max_length_m: f64,
    parents: Vec<u32>,
    events: Vec<u16>,
    /// Angle of each reflection.
    incidences: Vec<u8>,
    /// What some of these angles refer to.
    axes: [[f64; 3]; 3],
    lengths_m: Vec<f32>,
    log_weights: Vec<f32>,
    chains: Vec<u32>,
    tails: Vec<u32>,
    departures: Vec<u32>,
    arrivals: Vec<u32>,
    batches: Vec<u8>,
    /// Ways around edges, by contribution, rising.
    diffractions: Vec<(usize, EdgeDiffraction)>,
}

/// Paths that are weighed at a time.
const BLOCK: usize = 256;
/// Batch of contributions that are exact.
const EXACT: u8 = u8::MAX;

impl PathSet {
    /// The chain without reflections.
    pub const DIRECT: u32 = 0;
    /// Number of independent batches into which a tracer splits its rays, for Monte-Carlo standard errors.
    pub const BATCHES: u8 = 32;
    /// Bytes kept for each contribution; a reflection takes seven more, shared by all chains that pass through it.
    pub const BYTES_PER_CONTRIBUTION: usize = 25;

    /// No paths yet, between surfaces of `materials` kinds, all paths up to `max_length_m` being looked for.
    ///
    /// # Panics
    /// If there are 32,768 materials or more.
    pub fn new(materials: usize, max_length_m: f64) -> Self {
        assert!(materials < 1 << 15, "too many materials");
        Self {
            materials,
            max_length_m,
            parents: vec![0],
            events: vec![0],
            incidences: vec![incidence::NONE],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            lengths_m: Vec::new(),
            log_weights: Vec::new(),
            chains: Vec::new(),
            tails: Vec::new(),
            departures: Vec::new(),
            arrivals: Vec::new(),
            batches: Vec::new(),
            diffractions: Vec::new(),
        }
    }

    /// Adds a reflection to the end of a chain and returns the longer chain.
    ///
    /// # Panics
    /// If the chain or the material does not exist.
    pub fn reflect(&mut self, chain: u32, material: u32, reflection: Reflection) -> u32 {
        assert!((chain as usize) < self.parents.len(), "unknown chain {chain}");
        assert!((material as usize) < self.materials, "unknown material {material}");
        self.parents.push(chain);
        self.events.push((material as u16) << 1 | u16::from(reflection == Reflection::Scattered));
        self.incidences.push(incidence::NONE);
        (self.parents.len() - 1) as u32
    }

    /// Adds a path from source to receiver.
    ///
    /// # Panics
    /// If one of its chains does not exist or its batch is not below [`PathSet::BATCHES`].
    pub fn push(&mut self, contribution: Contribution) {
        for chain in [contribution.chain, contribution.tail] {
            assert!((chain as usize) < self.parents.len(), "unknown chain {chain}");
        }
        assert!(contribution.batch.is_none_or(|b| b < Self::BATCHES), "unknown batch");
        self.lengths_m.push(contribution.length_m as f32);
        self.log_weights.push(contribution.log_weight as f32);
        self.chains.push(contribution.chain);
        self.tails.push(contribution.tail);
        self.departures.push(pack_direction(contribution.departure));
        self.arrivals.push(pack_direction(contribution.arrival));
        self.batches.push(contribution.batch.unwrap_or(EXACT));
    }

    /// Adds a path that bends around an edge: its energy in each band is that of the contribution times
    /// [`EdgeDiffraction::band_energy_gain`]. The contribution is exact, without reflections, as long as the way around the
    /// edge, and of the weight of an undisturbed path of that length. Directions are as in [`Contribution`].
    pub fn push_diffracted(&mut self, departure: [f64; 3], arrival: [f64; 3], diffraction: EdgeDiffraction) {
        let length_m = diffraction.length_m();
        self.diffractions.push((self.len(), diffraction));
        self.push(Contribution {
            length_m,
            log_weight: -2.0 * length_m.ln(),
            chain: Self::DIRECT,
            tail: Self::DIRECT,
            departure,
            arrival,
            batch: None,
        });
    }

    /// Appends the paths of another set between the same surfaces; weights stay as they are. Axes (see [`Incidence::Axis`]) are those of the set
    /// that has any contribution so far, or else of the other.
    ///
    /// # Panics
    /// If the sets have different numbers of materials.
    pub fn append(&mut self, other: &PathSet) {
        assert_eq!(self.materials, other.materials, "paths of different scenes");
        let before = self.len();
        if before == 0 {
            self.axes = other.axes;
        }
        self.diffractions.extend(other.diffractions.iter().map(|(i, d)| (before + i, d.clone())));
        let offset = self.parents.len() as u32 - 1;
        let shifted = |chain: u32| if chain == Self::DIRECT { chain } else { chain + offset };
        self.parents.extend(other.parents[1..].iter().map(|&p| shifted(p)));
        self.events.extend_from_slice(&other.events[1..]);
        self.incidences.extend_from_slice(&other.incidences[1..]);
        self.lengths_m.extend_from_slice(&other.lengths_m);
        self.log_weights.extend_from_slice(&other.log_weights);
        self.chains.extend(other.chains.iter().map(|&c| shifted(c)));
        self.tails.extend(other.tails.iter().map(|&c| shifted(c)));
        self.departures.extend_from_slice(&other.departures);
        self.arrivals.extend_from_slice(&other.arrivals);
        self.batches.extend_from_slice(&other.batches);
    }

    /// Appends the sampled paths of another set between the same surfaces as they would be had the source and the receiver moved
    /// by these displacements (m): to first order, a path grows by what its ends move against the directions in which it
    /// leaves and comes. None gets shorter than `least_length_m`, the distance of the new places. Each brings `share` of
    /// its energy; exact paths stay behind, for they can be found anew.
    ///
    /// # Panics
    /// If the sets have different numbers of materials.
    pub fn append_displaced(
        &mut self,
        other: &PathSet,
        [source_m, receiver_m]: [[f64; 3]; 2],
        least_length_m: f64,
        share: f64,
    ) {
        let mut sampled = other.clone();
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        for i in 0..sampled.len() {
            let shorter_m = dot(source_m, other.departure(i)) + dot(receiver_m, other.arrival(i));
            let length_m = f64::from(sampled.lengths_m[i]) - shorter_m;
            sampled.lengths_m[i] = length_m.max(least_length_m) as f32;
            sampled.log_weights[i] += share.ln() as f32;
        }
        sampled.retain(|batch| batch != EXACT);
        self.append(&sampled);
    }

    /// Appends the exact paths of another set between the same surfaces.
    ///
    /// # Panics
    /// If the sets have different numbers of materials.
    pub fn append_exact(&mut self, other: &PathSet) {
        let mut exact = other.clone();
        exact.retain(|batch| batch == EXACT);
        self.append(&exact);
    }

    /// Keeps the contributions of some batches, and the chains that they need.
    fn retain(&mut self, keep: impl Fn(u8) -> bool) {
        fn of<T>(column: &mut Vec<T>, kept: &[bool]) {
            let mut marks = kept.iter();
            column.retain(|_| marks.next() == Some(&true));
        }
        let kept: Vec<bool> = self.batches.iter().map(|&batch| keep(batch)).collect();
        of(&mut self.lengths_m, &kept);
        of(&mut self.log_weights, &kept);
        of(&mut self.chains, &kept);
        of(&mut self.tails, &kept);
        of(&mut self.departures, &kept);
        of(&mut self.arrivals, &kept);
        of(&mut self.batches, &kept);
        let places: Vec<usize> = kept
            .iter()
            .scan(0, |next, &kept| Some(std::mem::replace(next, *next + usize::from(kept))))
            .collect();
        self.diffractions.retain_mut(|(contribution, _)| {
            let stays = kept[*contribution];
            *contribution = places[*contribution];
            stays
        });
        self.prune_chains();
    }

    /// Drops the chains that no contribution passes through.
    fn prune_chains(&mut self) {
        let mut needed = vec![false; self.parents.len()];
        needed[Self::DIRECT as usize] = true;
        for &chain in self.chains.iter().chain(&self.tails) {
            needed[chain as usize] = true;
        }
        for chain in (1..needed.len()).rev() {
            if needed[chain] {
                needed[self.parents[chain] as usize] = true;
            }
        }
        let mut renamed = vec![Self::DIRECT; needed.len()];
        let mut count = 0;
        for chain in 0..needed.len() {
            if needed[chain] {
                renamed[chain] = count as u32;
                self.parents[count] = renamed[self.parents[chain] as usize];
                self.events[count] = self.events[chain];
                self.incidences[count] = self.incidences[chain];
                count += 1;
            }
        }
        self.parents.truncate(count);
        self.events.truncate(count);
        self.incidences.truncate(count);
        for chain in self.chains.iter_mut().chain(&mut self.tails) {
            *chain = renamed[*chain as usize];
        }
    }

    /// Number of contributions.
    pub fn len(&self) -> usize {
        self.lengths_m.len()
    }

    /// Whether no path reaches the receiver.
    pub fn is_empty(&self) -> bool {
        self.lengths_m.is_empty()
    }

    /// Number of materials.
    pub fn materials(&self) -> usize {
        self.materials
    }

    /// Length up to which paths were looked for, in metres.
    pub fn max_length_m(&self) -> f64 {
        self.max_length_m
    }

    /// Length of each contribution in metres.
    pub fn lengths_m(&self) -> &[f32] {
        &self.lengths_m
    }

    /// Logarithm of the geometric weight of each contribution; see [`Contribution::log_weight`].
    pub fn log_weights(&self) -> &[f32] {
        &self.log_weights
    }

    /// Chain of each contribution from the source on; what the surfaces do to it is what they do along this chain **and**
    /// along its tail.
    pub fn chains(&self) -> &[u32] {
        &self.chains
    }

    /// Chain of each contribution from the receiver backwards; see [`Contribution::tail`].
    pub fn tails(&self) -> &[u32] {
        &self.tails
    }

    /// Number of chains, [`PathSet::DIRECT`] included; a chain's parent has a lower index.
    pub fn chain_count(&self) -> usize {
        self.parents.len()
    }

    /// The last reflection of a chain: the chain before it, the material and what happened; `None` for the direct path.
    ///
    /// # Panics
    /// If there is no such chain.
    pub fn last_reflection(&self, chain: u32) -> Option<(u32, u32, Reflection)> {
        if chain == Self::DIRECT {
            return None;
        }
        let event = self.events[chain as usize];
        let reflection = if event & 1 == 1 { Reflection::Scattered } else { Reflection::Specular };
        Some((self.parents[chain as usize], u32::from(event >> 1), reflection))
    }

    /// Whether a contribution met no surface and no edge.
    ///
    /// # Panics
    /// If there is no such contribution.
    pub fn is_direct(&self, contribution: usize) -> bool {
        let met_nothing =
            self.chains[contribution] == Self::DIRECT && self.tails[contribution] == Self::DIRECT;
        met_nothing && self.diffractions.binary_search_by_key(&contribution, |(i, _)| *i).is_err()
    }

    /// Whether a contribution was found exactly and renders as a coherent reflection.
    ///
    /// # Panics
    /// If there is no such contribution.
    #[inline]
    pub fn is_exact(&self, contribution: usize) -> bool {
        self.batches[contribution] == EXACT
    }

    /// Independent batch of rays that a contribution stems from; `None` where it is exact.
    ///
    /// # Panics
    /// If there is no such contribution.
    #[inline]
    pub fn batch(&self, contribution: usize) -> Option<u8> {
        Some(self.batches[contribution]).filter(|&b| b != EXACT)
    }

    /// Unit vector in which a contribution leaves the source, to about 0.005 degrees.
    ///
    /// # Panics
    /// If there is no such contribution.
    pub fn departure(&self, contribution: usize) -> [f64; 3] {
        unpack_direction(self.departures[contribution])
    }

    /// Unit vector from the receiver towards where a contribution comes from, to about 0.005 degrees.
    ///
    /// # Panics
    /// If there is no such contribution.
    pub fn arrival(&self, contribution: usize) -> [f64; 3] {
        unpack_direction(self.arrivals[contribution])
    }

    /// Contributions that bend around an edge, each with its diffraction, by rising index. Neither
    /// [`PathSet::log_weights`] nor [`PathSet::log_reflectance`] contains their gain; [`PathSet::energies`] does.
    pub fn diffractions(&self) -> &[(usize, EdgeDiffraction)] {
        &self.diffractions
    }

    /// How often each chain hit each material: `counts[chain * materials + material]`.
    pub fn hit_counts(&self) -> Vec<u16> {
        let mut counts = vec![0u16; self.parents.len() * self.materials];
        for chain in 1..self.parents.len() {
            let parent = self.parents[chain] as usize;
            for material in 0..self.materials {
                counts[chain * self.materials + material] = counts[parent * self.materials + material];
            }
            counts[chain * self.materials + usize::from(self.events[chain] >> 1)] += 1;
        }
        counts
    }

    /// Logarithm of what the surfaces leave of the energy of each chain in one band.
    ///
    /// # Errors
    /// [`Error::MaterialCount`] if the number of materials is not that of the paths, [`Error::Index`] for an unknown band.
    pub fn log_reflectance(&self, materials: &[Material], band: usize) -> Result<Vec<f32>, Error> {
        self.check_materials(materials)?;
        let count = materials[0].bands().len();
        if band >= count {
            return Err(Error::Index { what: "band", index: band, count });
        }
        let sums = sums_along(&self.parents, &self.events, &log_steps(materials, band, count));
        Ok(sums.into_iter().map(|lanes| lanes[0]).collect())
    }

    /// Energy of each contribution in each band of the materials, `[band][contribution]`, between an omnidirectional source and
    /// an omnidirectional receiver.
    ///
    /// # Errors
    /// As [`PathSet::log_reflectance`].
    pub fn energies(&self, materials: &[Material], air: &Air) -> Result<Vec<Vec<f32>>, Error> {
        self.energies_under(&Conditions::new(materials, air))
    }

    /// Energy of each contribution in each band of the materials, `[band][contribution]`.
    ///
    /// # Errors
    /// As [`PathSet::log_reflectance`]; [`Error::BandMismatch`] for a directivity on other bands than the materials.
    pub fn energies_under(&self, conditions: &Conditions) -> Result<Vec<Vec<f32>>, Error> {
        let Conditions { materials, air, attenuation, .. } = *conditions;
        let bands = self.check_materials(materials)?;
        conditions.check_bands(bands)?;
        let exponents = attenuation.unwrap_or(air).energy_exponent_per_m(bands);
        let groups: Vec<usize> = (0..bands.len()).step_by(LANES).collect();
        let mut energies: Vec<Vec<f32>> = groups
            .into_par_iter()
            .flat_map_iter(|first| {
                let exponents = lanes(first, bands.len(), |band| exponents.values()[band] as f32);
                let sums = sums_along(&self.parents, &self.events, &log_steps(materials, first, bands.len()));
                let mut columns = [const { Vec::new() }; LANES];
                columns.iter_mut().for_each(|column| column.resize(self.len(), 0.0));
                let mut block = [[0.0; LANES]; BLOCK];
                for start in (0..self.len()).step_by(BLOCK) {
                    let range = start..self.len().min(start + BLOCK);
                    let paths = self.lengths_m[range.clone()].iter().zip(&self.log_weights[range.clone()]);
                    let chains = self.chains[range.clone()].iter().zip(&self.tails[range.clone()]);
                    for (x, ((&length, &log_weight), (&chain, &tail))) in
                        block.iter_mut().zip(paths.zip(chains))
                    {
                        let (out, back) = (sums[chain as usize], sums[tail as usize]);
                        *x = std::array::from_fn(|i| log_weight + out[i] + back[i] - exponents[i] * length);
                    }
                    block.iter_mut().for_each(|x| *x = exp(*x));
                    for (i, column) in columns.iter_mut().enumerate() {
                        column[range.clone()].iter_mut().zip(&block).for_each(|(e, lanes)| *e = lanes[i]);
                    }
                }
                let used = LANES.min(bands.len() - first);
                columns.into_iter().take(used)
            })
            .collect();
        for (ends, directed) in [(&self.departures, conditions.source), (&self.arrivals, conditions.receiver)]
        {
            if let Some((directivity, orientation)) = directed {
                weigh_directions(&mut energies, ends, directivity, &orientation);
            }
        }
        self.weigh_diffractions(&mut energies, bands, conditions.air.speed_of_sound_m_s());
        Ok(energies)
    }

    fn weigh_diffractions(&self, energies: &mut [Vec<f32>], bands: Bands, speed_m_s: f64) {
        for (contribution, diffraction) in &self.diffractions {
            for (band, column) in energies.iter_mut().enumerate() {
                column[*contribution] *= diffraction.band_energy_gain(bands, band, speed_m_s) as f32;
            }
        }
    }

    /// Energy in time bins between an omnidirectional source and an omnidirectional receiver, with Monte-Carlo standard
    /// errors from the scatter between batches of rays.
    ///
    /// # Errors
    /// As [`PathSet::log_reflectance`]; [`Error::OutOfRange`] for a bin width that is not positive.
    pub fn energy_response(
        &self,
        materials: &[Material],
        air: &Air,
        bin_s: f64,
    ) -> Result<EnergyResponse, Error> {
        self.energy_response_under(&Conditions::new(materials, air), bin_s)
    }

    /// Energy in time bins, with Monte-Carlo standard errors from the scatter between batches of rays.
    ///
    /// # Errors
    /// As [`PathSet::energies_under`]; [`Error::OutOfRange`] for a bin width that is not positive.
    pub fn energy_response_under(
        &self,
        conditions: &Conditions,
        bin_s: f64,
    ) -> Result<EnergyResponse, Error> {
        let bands = self.check_materials(conditions.materials)?;
        crate::error::check_range("bin width (s)", bin_s, 1e-6, 10.0, "between 1 us and 10 s")?;
        let speed = conditions.air.speed_of_sound_m_s();
        let bins = (self.max_length_m / speed / bin_s).ceil() as usize;
        let batches = usize::from(Self::BATCHES);
        let mut energy = Vec::with_capacity(bins * bands.len());
        let mut standard_error = Vec::with_capacity(bins * bands.len());
        for column in self.energies_under(conditions)? {
            let mut exact = vec![0.0f64; bins];
            let mut sampled = vec![0.0f64; bins * batches];
            for (i, &e) in column.iter().enumerate() {
                let bin = (f64::from(self.lengths_m[i]) / speed / bin_s) as usize;
                if bin >= bins {
                    continue;
                }
                match self.batches[i] {
                    EXACT => exact[bin] += f64::from(e),
                    batch => sampled[bin * batches + usize::from(batch)] += f64::from(e),
                }
            }
            for (bin, exact) in exact.into_iter().enumerate() {
                let parts = &sampled[bin * batches..(bin + 1) * batches];
                let sum: f64 = parts.iter().sum();
                let mean = sum / batches as f64;
                let scatter: f64 = parts.iter().map(|p| (p - mean) * (p - mean)).sum();
                energy.push(exact + sum);
                standard_error.push((scatter * batches as f64 / (batches as f64 - 1.0)).sqrt());
            }
        }
        EnergyResponse::new(bands, bin_s, energy, standard_error)
    }

    fn check_materials(&self, materials: &[Material]) -> Result<Bands, Error> {
        if materials.len() != self.materials || materials.is_empty() {
            return Err(Error::MaterialCount { expected: self.materials, found: materials.len() });
        }
        let bands = materials[0].bands();
        match materials.iter().find(|m| m.bands() != bands) {
            Some(other) => Err(Error::BandMismatch { left: bands, right: other.bands() }),
            None => Ok(bands),
        }
    }
}

/// Multiplies energies by the gains of a directivity in packed directions.
fn weigh_directions(
    energies: &mut [Vec<f32>],
    directions: &[u32],
    directivity: &Directivity,
    orientation: &Orientation,
) {
    for (i, &packed) in directions.iter().enumerate() {
        let place = directivity.place(orientation.to_local(unpack_direction(packed)));
        for (band, column) in energies.iter_mut().enumerate() {
            column[i] *= directivity.gain_at(place, band) as f32;
        }
    }
}

/// A value for each of the bands from `first` on, as far as there are any.
fn lanes(first: usize, bands: usize, value: impl Fn(usize) -> f32) -> Lanes {
    std::array::from_fn(|i| if first + i < bands { value(first + i) } else { 0.0 })
}

/// Logarithm of what each event leaves of the energy, `material * 2 + scattered`, in the bands from `first` on. That of nothing
/// is minus infinity: the path carries nothing, as it should.
fn log_steps(materials: &[Material], first: usize, bands: usize) -> Vec<Lanes> {
    let event = |material: &Material, scattered: bool| {
        lanes(first, bands, |band| {
            let scattering = material.scattering().values()[band];
            let share = if scattered { scattering } else { 1.0 - scattering };
            ((1.0 - material.absorption().values()[band]) * share).ln() as f32
        })
    };
    materials.iter().flat_map(|material| [event(material, false), event(material, true)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f64; 3] = [0.0, 0.0, 1.0];

    fn path(length_m: f64, log_weight: f64, chain: u32, batch: Option<u8>) -> Contribution {
        Contribution { length_m, log_weight, chain, tail: PathSet::DIRECT, departure: UP, arrival: UP, batch }
    }

    #[test]
    fn chains_multiply_what_their_surfaces_leave() {
        let mut paths = PathSet::new(2, 100.0);
        let a = paths.reflect(PathSet::DIRECT, 0, Reflection::Specular);
        let ab = paths.reflect(a, 1, Reflection::Scattered);
        paths.push(path(10.0, 0.0, ab, Some(0)));
        let bands = Bands::octaves(1000.0, 1000.0).unwrap();
        let materials =
            [Material::uniform(bands, 0.5, 0.2).unwrap(), Material::uniform(bands, 0.1, 0.3).unwrap()];
        let air = Air::default();
        let expected = 0.5 * 0.8 * 0.9 * 0.3 * (-10.0 * air.energy_exponent_per_m(bands).values()[0]).exp();
        let found = paths.energies(&materials, &air).unwrap()[0][0];
        assert!((f64::from(found) / expected - 1.0).abs() < 1e-6);
        assert_eq!(&paths.hit_counts()[ab as usize * 2..], &[1, 1]);
        assert_eq!(paths.last_reflection(ab), Some((a, 1, Reflection::Scattered)));
    }

    #[test]
    fn attenuation_may_come_from_another_air() {
        let mut paths = PathSet::new(1, 100.0);
        paths.push(path(50.0, 0.0, PathSet::DIRECT, None));
        let bands = Bands::octaves(8000.0, 8000.0).unwrap();
        let wall = [Material::uniform(bands, 0.1, 0.1).unwrap()];
        let (air, dry) = (Air::default(), Air::new(20.0, 10.0, 101.325).unwrap());
        let found = paths.energies_under(&Conditions::new(&wall, &air).with_attenuation(&dry)).unwrap()[0][0];
        let expected = 10f64.powf(-5.0 * dry.attenuation_db_per_m(bands.exact_hz(0)));
        assert!((f64::from(found) / expected - 1.0).abs() < 1e-5);
    }

    #[test]
    fn chain_and_tail_both_take_their_share() {
        let mut left = PathSet::new(2, 100.0);
        let mut right = left.clone();
        let out = right.reflect(PathSet::DIRECT, 0, Reflection::Specular);
        let back = right.reflect(PathSet::DIRECT, 1, Reflection::Scattered);
        right.push(Contribution { tail: back, ..path(3.0, 0.0, out, None) });
        left.append(&right);
        let bands = Bands::octaves(1000.0, 1000.0).unwrap();
        let materials =
            [Material::uniform(bands, 0.5, 0.2).unwrap(), Material::uniform(bands, 0.1, 0.3).unwrap()];
        let air = Air::default();
        let in_air = (-3.0 * air.energy_exponent_per_m(bands).values()[0]).exp();
        let found = left.energies(&materials, &air).unwrap()[0][0];
        assert!((f64::from(found) / (0.5 * 0.8 * 0.9 * 0.3 * in_air) - 1.0).abs() < 1e-6);
        assert_eq!((left.chains()[0], left.tails()[0]), (out, back));
    }

    #[test]
    fn a_perfect_absorber_silences_its_paths_and_only_them() {
        let mut paths = PathSet::new(1, 100.0);
        let hit = paths.reflect(PathSet::DIRECT, 0, Reflection::Specular);
        paths.push(path(1.0, 0.0, PathSet::DIRECT, None));
        paths.push(path(2.0, 0.0, hit, None));
        let black = Material::uniform(Bands::T60, 1.0, 0.0).unwrap();
        let energy = paths.energies(&[black], &Air::default()).unwrap();
        assert!(energy[0][0] > 0.9 && energy[0][1] == 0.0);
    }

    #[test]
    fn appending_keeps_chains_apart() {
        let mut left = PathSet::new(2, 100.0);
        let a = left.reflect(PathSet::DIRECT, 0, Reflection::Specular);
        left.push(path(1.0, 0.0, a, None));
        let mut right = PathSet::new(2, 100.0);
        let b = right.reflect(PathSet::DIRECT, 1, Reflection::Specular);
        let bb = right.reflect(b, 1, Reflection::Specular);
        right.push(path(2.0, 0.0, bb, None));
        right.push(path(3.0, 0.0, PathSet::DIRECT, None));
        left.append(&right);
        let counts = left.hit_counts();
        let of = |i: usize| &counts[left.chains()[i] as usize * 2..][..2];
        assert_eq!((of(0), of(1), of(2)), (&[1, 0][..], &[0, 2][..], &[0, 0][..]));
    }

    #[test]
    fn displaced_paths_change_their_length_and_share() {
        let mut frame = PathSet::new(1, 100.0);
        let early = frame.reflect(PathSet::DIRECT, 0, Reflection::Specular);
        let hit = frame.reflect(PathSet::DIRECT, 0, Reflection::Scattered);
        frame.push(path(10.0, 0.0, early, None));
        frame.push(path(20.0, 0.0, hit, Some(3)));
        frame.push(path(4.0, 0.0, hit, Some(4)));
        let mut now = PathSet::new(1, 100.0);
        // All paths leave and come from above: the source rises by 1 m towards them, the receiver sinks by 0.25 m.
        now.append_displaced(&frame, [[0.0, 0.0, 1.0], [0.3, 0.0, -0.25]], 3.5, 0.5);
        assert_eq!((now.len(), now.batch(0), now.chains()[1]), (2, Some(3), 1));
        assert_eq!(now.last_reflection(1), frame.last_reflection(hit));
        assert!((now.lengths_m()[0] - 19.25).abs() < 1e-5 && now.lengths_m()[1] == 3.5);
        assert!((now.log_weights()[0] - 0.5f32.ln()).abs() < 1e-6);
    }

    #[test]
    fn the_standard_error_is_that_of_a_sum_over_batches() {
        let mut paths = PathSet::new(1, 34.0);
        for batch in 0..PathSet::BATCHES {
            paths.push(path(1.0, f64::from(batch % 2) * 2f64.ln(), PathSet::DIRECT, Some(batch)));
        }
        let bands = Bands::octaves(125.0, 125.0).unwrap();
        let m = Material::uniform(bands, 0.0, 0.0).unwrap();
        let response = paths.energy_response(&[m], &Air::default(), 0.01).unwrap();
        // 16 batches of 1 and 16 of 2: mean 1.5, sample variance 8/31, sum of 32 independent parts.
        assert!((response.band(0)[0] - 48.0).abs() < 0.01);
        assert!((response.band_standard_error(0)[0] - (32.0f64 * 8.0 / 31.0).sqrt()).abs() < 0.01);
    }

    #[test]
    fn the_wrong_number_of_materials_is_refused() {
        let paths = PathSet::new(2, 10.0);
        let m = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        assert!(matches!(
            paths.energies(&[m], &Air::default()),
            Err(Error::MaterialCount { expected: 2, found: 1 })
        ));
    }
}
