//! Traced paths: the seam between a tracer and everything after it.

mod arrivals;
mod builder;
mod energies;
mod incidence;
mod law_sums;
mod thinning;

pub use incidence::Incidence;
pub(crate) use incidence::{ANGLES, angle_cosine};

use crate::edge_diffraction::EdgeDiffraction;
use crate::packed_direction::unpack_direction;

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
    /// Else the independent batch of rays (below [`PathSet::batch_count`]) that it stems from.
    pub batch: Option<u8>,
}

/// Everything that a tracer found between one source and one receiver, free of absorption, air and speed of sound: these
/// are applied afterwards, without tracing again.
///
/// Reflections form a forest in which chains share their prefixes; contributions are kept as columns.
/// Energies are scaled so that the direct sound at 1 m is 1.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Material};
/// use sabine_paths::{Conditions, Contribution, PathSet, Reflection};
/// let mut paths = PathSet::new(1, 100.0);
/// let floor = paths.reflect(PathSet::DIRECT, 0, Reflection::Specular);
/// let up = [0.0, 0.0, 1.0];
/// paths.push(Contribution {
///     length_m: 5.0, log_weight: -2.0 * 5f64.ln(), chain: floor, tail: PathSet::DIRECT,
///     departure: up, arrival: up, batch: None });
/// let hard = Material::uniform(Bands::T60, 0.2, 0.0)?;
/// let energy = paths.energies(&Conditions::new(&[hard], &Air::default()))?;
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
    batch_count: u8,
    /// Ways around edges, by contribution, rising.
    diffractions: Vec<(usize, EdgeDiffraction)>,
}

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
            batch_count: Self::BATCHES,
            diffractions: Vec::new(),
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

    /// Number of independent batches of rays: [`PathSet::BATCHES`], fewer in [a part of them](PathSet::part_of_rays).
    pub fn batch_count(&self) -> u8 {
        self.batch_count
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conditions::Conditions;
    use sabine_acoustics::{Air, Bands, Error, Material};

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
        let found = paths.energies(&Conditions::new(&materials, &air)).unwrap()[0][0];
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
        let found = paths.energies(&Conditions::new(&wall, &air).with_attenuation(&dry)).unwrap()[0][0];
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
        let found = left.energies(&Conditions::new(&materials, &air)).unwrap()[0][0];
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
        let energy = paths.energies(&Conditions::new(&[black], &Air::default())).unwrap();
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
        let response = paths.energy_response(&Conditions::new(&[m], &Air::default()), 0.01).unwrap();
        // 16 batches of 1 and 16 of 2: mean 1.5, sample variance 8/31, sum of 32 independent parts.
        assert!((response.band(0)[0] - 48.0).abs() < 0.01);
        assert!((response.band_standard_error(0)[0] - (32.0f64 * 8.0 / 31.0).sqrt()).abs() < 0.01);
    }

    #[test]
    fn the_wrong_number_of_materials_is_refused() {
        let paths = PathSet::new(2, 10.0);
        let m = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        assert!(matches!(
            paths.energies(&Conditions::new(&[m], &Air::default())),
            Err(Error::MaterialCount { expected: 2, found: 1 })
        ));
    }
}
