//! Traced paths between one source and one receiver, and the energies that they predict.

pub(crate) mod class_sums;
mod gathering;
mod isolated_reflections;

pub(crate) use isolated_reflections::IsolatedReflection;

use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::time_bins::Bins;
use crate::simulate::band_state::BandState;
use crate::simulate::hit_groups;
use crate::simulate::path_chances;
use rayon::prelude::*;
use sabine_acoustics::{Air, Bands, Error, Material};
use sabine_paths::{Conditions, PathSet};
use std::collections::BTreeSet;

/// What the model itself may be off by, as a share of a bin's energy: a single early pulse is never predicted better.
const MODEL_SD: f64 = 0.07;
/// Within so long after the direct sound, in units of one over the bandwidth, single reflections add to it or take from it ...
const COHERENT_BANDWIDTH_TIMES: f64 = 2.5;
/// ... with a sign that does not change from place to place as that of later ones does: more than by chance, as a share of the energy.
const COHERENT_SD: f64 = 0.35;
/// A single reflection comes so much earlier or later than predicted (a centimetre of way): near the end of a bin, part of its
/// energy falls into the next.
const TIME_SD_S: f64 = 4e-5;
/// Exact paths keep their very time for so long after the direct sound, in seconds; later ones are gathered in cells.
const ISOLATED_S: f64 = 0.04;
/// Cell of paths that are in none.
const ISOLATED: u16 = u16::MAX;
/// Energy of a bin without paths, as a share of the strongest: it counts as nothing.
const NOTHING: f64 = 1e-12;

/// A path that was found exactly.
#[derive(Clone, Debug)]
pub(crate) struct Arrival {
    pub length_m: f64,
    pub departure: [f64; 3],
    pub arrival: [f64; 3],
    /// Mean energy over all frequencies of the bands: in a sharp peak, a band counts by its width.
    pub energy: f64,
    /// Surfaces (indices) that it meets, from the source on; none where it could not be followed.
    pub surfaces: Vec<usize>,
}

/// Paths of one pair with what does not change from fit to fit.
pub(crate) struct TracedPair {
    paths: PathSet,
    /// Paths around edges, where the direct line is blocked; not part of the prediction as traced.
    diffracted: Option<PathSet>,
    pub air: Air,
    pub speed_m_s: f64,
    /// Time of flight of the direct sound, or of the shortest path where that is blocked, those around edges included.
    pub direct_s: f64,
    /// Hits of each path on each material.
    hits: Vec<f32>,
    departures: Vec<[f32; 3]>,
    arrivals: Vec<[f32; 3]>,
    /// Time after the direct sound.
    times_s: Vec<f32>,
    /// Cell of time that each path falls into; [`ISOLATED`] for early exact ones.
    cells: Vec<u16>,
    /// Those: they keep their very times.
    isolated: Vec<u32>,
    /// Group of like hits that each path belongs to, within its slice of time.
    groups: Vec<u8>,
}

impl TracedPair {
    /// A neighbour from which a filter takes less than this share is left out.
    pub const MIN_LEAK: f64 = 1e-7;

    /// `stated` are the materials as far as they are known: they say which paths matter.
    pub fn new(
        mut paths: PathSet,
        diffracted: Option<PathSet>,
        air: Air,
        stated: &[Material],
    ) -> Result<Self, Error> {
        let speed_m_s = air.speed_of_sound_m_s();
        let around = diffracted.as_ref().map_or(&[][..], |diffracted| diffracted.lengths_m());
        let shortest = paths.lengths_m().iter().chain(around).copied().fold(f32::INFINITY, f32::min);
        let direct = (0..paths.len()).find(|&i| paths.is_direct(i)).map(|i| paths.lengths_m()[i]);
        let direct_s = f64::from(direct.unwrap_or(shortest)) / speed_m_s;
        let chances = path_chances::of(&paths, stated, &air, direct_s * speed_m_s)?;
        paths.thin(&chances, paths.len() as u64)?;
        Self::of_paths(paths, diffracted, (air, direct_s), stated)
    }

    /// What [so many fewer rays](PathSet::part_of_rays) predict.
    pub fn part_of_rays(&self, part: u8, parts: u8, stated: &[Material]) -> Result<Self, Error> {
        let paths = self.paths.part_of_rays(part, parts)?;
        Self::of_paths(paths, self.diffracted.clone(), (self.air, self.direct_s), stated)
    }

    /// How many of so many [parts of the rays](PathSet::part_of_rays) found paths: none where no rays were drawn.
    pub fn parts_with_paths(&self, parts: u8) -> u8 {
        let batches = (0..self.paths.len()).filter_map(|i| self.paths.batch(i));
        let found: BTreeSet<u8> = batches.map(|batch| batch % parts).collect();
        found.len() as u8
    }

    fn of_paths(
        paths: PathSet,
        diffracted: Option<PathSet>,
        (air, direct_s): (Air, f64),
        stated: &[Material],
    ) -> Result<Self, Error> {
        let speed_m_s = air.speed_of_sound_m_s();
        let materials = paths.materials();
        let counts = paths.hit_counts();
        let mut hits = Vec::with_capacity(paths.len() * materials);
        for i in 0..paths.len() {
            let row = |chain: u32| &counts[chain as usize * materials..][..materials];
            let (out, back) = (row(paths.chains()[i]), row(paths.tails()[i]));
            hits.extend(out.iter().zip(back).map(|(a, b)| f32::from(a + b)));
        }
        let departures = (0..paths.len()).map(|i| paths.departure(i).map(|x| x as f32)).collect();
        let arrivals = (0..paths.len()).map(|i| paths.arrival(i).map(|x| x as f32)).collect();
        let times_s: Vec<f32> =
            paths.lengths_m().iter().map(|l| (f64::from(*l) / speed_m_s - direct_s) as f32).collect();
        let energies = paths.energies(&Conditions::new(stated, &air))?;
        let weights: Vec<f32> = (0..paths.len()).map(|i| energies.iter().map(|e| e[i]).sum()).collect();
        let groups = hit_groups::group(&times_s, &weights, &hits, materials);
        let (cells, isolated) = in_cells(&paths, &times_s);
        Ok(Self {
            paths,
            diffracted,
            air,
            speed_m_s,
            direct_s,
            hits,
            departures,
            arrivals,
            times_s,
            cells,
            isolated,
            groups,
        })
    }

    /// The same paths in other air.
    pub fn set_air(&mut self, air: Air) {
        let slower = self.speed_m_s / air.speed_of_sound_m_s();
        self.air = air;
        self.speed_m_s = air.speed_of_sound_m_s();
        self.direct_s *= slower;
        self.times_s.iter_mut().for_each(|t| *t *= slower as f32);
        (self.cells, self.isolated) = in_cells(&self.paths, &self.times_s);
    }

    /// The exact paths, the shortest first. Which surfaces they meet is not filled in.
    pub fn arrivals(&self, materials: &[Material], within_s: f64) -> Result<Vec<Arrival>, Error> {
        let energies = self.energies(materials)?;
        let bands = materials[0].bands();
        // All bands are as wide in proportion.
        let widths: Vec<f64> = (0..bands.len()).map(|band| bands.exact_hz(band)).collect();
        let all: f64 = widths.iter().sum();
        let mean =
            |i: usize| energies.iter().zip(&widths).map(|(e, w)| w * f64::from(e[i])).sum::<f64>() / all;
        let mut found: Vec<Arrival> = (0..self.paths.len())
            .filter(|&i| self.paths.is_exact(i) && f64::from(self.times_s[i]) <= within_s)
            .map(|i| Arrival {
                length_m: f64::from(self.paths.lengths_m()[i]),
                departure: self.paths.departure(i),
                arrival: self.paths.arrival(i),
                energy: mean(i),
                surfaces: Vec::new(),
            })
            .collect();
        found.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
        Ok(found)
    }

    pub fn paths(&self) -> &PathSet {
        &self.paths
    }

    /// Paths around an edge between source and receiver, where these do not see each other.
    pub fn diffracted_paths(&self) -> Option<&PathSet> {
        self.diffracted.as_ref()
    }

    /// Whether source and receiver do not see each other, and sound bends around an edge between them.
    pub fn is_diffracted(&self) -> bool {
        self.diffracted.is_some()
    }

    pub fn has_direct(&self) -> bool {
        (0..self.paths.len()).any(|i| self.paths.is_direct(i))
    }

    /// Energies of the paths under materials, `[band][path]`.
    pub fn energies(&self, materials: &[Material]) -> Result<Vec<Vec<f32>>, Error> {
        self.paths.energies(&Conditions::new(materials, &self.air))
    }

    /// Predicted energies in all bands for `duration_s` after the direct sound, from those of the paths.
    pub fn expand(
        &self,
        energies: &[Vec<f32>],
        bands: Bands,
        kernels: &[BandPulse],
        duration_s: f64,
    ) -> Vec<BandState> {
        let factors = self.factors();
        let of_band = |(band, e): (usize, &Vec<f32>)| {
            self.band(band, (e, &factors), Bins::new(bands, band), &kernels[band], duration_s)
        };
        let mut states: Vec<BandState> = energies.par_iter().enumerate().map(of_band).collect();
        for (band, state) in states.iter_mut().enumerate() {
            for (b, &share) in kernels[band].shares.iter().enumerate() {
                if b != band && share > Self::MIN_LEAK {
                    let sums = self.sums(&energies[b], state.bins, &kernels[band], duration_s);
                    let floor = NOTHING * sums.iter().copied().fold(0.0, f64::max).max(1e-30);
                    state.leaks.push((b, share, sums.iter().map(|e| e.max(floor).ln()).collect()));
                }
            }
        }
        states
    }

    /// The bins that a path's energy falls into, with its share of each.
    pub fn shares(
        time_s: f64,
        bins: Bins,
        kernel: &BandPulse,
        count: usize,
        mut give: impl FnMut(usize, f64),
    ) {
        let reach = kernel.reach_s().min(2.0 * bins.width_s);
        let first = bins.count(time_s - reach).min(count);
        let mut before = kernel.before(bins.edge_s(first) - time_s);
        for bin in first..count {
            let edge = bins.edge_s(bin + 1) - time_s;
            let after = if edge >= reach { 1.0 } else { kernel.before(edge) };
            if after > before {
                give(bin, after - before);
            }
            before = after;
            if edge >= reach {
                break;
            }
        }
    }

    /// Energy of each bin, without anything else.
    pub fn sums(&self, energies: &[f32], bins: Bins, kernel: &BandPulse, duration_s: f64) -> Vec<f64> {
        let count = bins.count(duration_s);
        let cells = (duration_s / CELL_S).ceil() as usize + 1;
        let mut cell = vec![0.0f64; cells];
        let mut sums = vec![0.0; count];
        for (&c, &e) in self.cells.iter().zip(energies) {
            if let Some(c) = cell.get_mut(usize::from(c)) {
                *c += f64::from(e);
            }
        }
        for &i in &self.isolated {
            let (time_s, e) = (f64::from(self.times_s[i as usize]), f64::from(energies[i as usize]));
            Self::shares(time_s, bins, kernel, count, |bin, share| sums[bin] += share * e);
        }
        for (c, e) in cell.into_iter().enumerate().filter(|(_, e)| *e > 0.0) {
            let time_s = (c as f64 + 0.5) * CELL_S;
            Self::shares(time_s, bins, kernel, count, |bin, share| sums[bin] += share * e);
        }
        sums
    }
}

/// Cell of each path, and the paths that are in none.
fn in_cells(paths: &PathSet, times_s: &[f32]) -> (Vec<u16>, Vec<u32>) {
    let mut isolated = Vec::new();
    let cells = times_s
        .iter()
        .enumerate()
        .map(|(i, &t)| {
            let time_s = f64::from(t);
            if time_s < ISOLATED_S && paths.is_exact(i) {
                isolated.push(i as u32);
                return ISOLATED;
            }
            ((time_s.max(0.0) / CELL_S) as usize).min(usize::from(ISOLATED) - 1) as u16
        })
        .collect();
    (cells, isolated)
}
