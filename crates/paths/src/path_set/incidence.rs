//! At which angles paths meet surfaces.

use super::{PathSet, Reflection};

/// At which angle a surface is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Incidence {
    /// Nobody has looked.
    Unknown,
    /// Cosine of the angle to the surface's normal, 0 to 1; kept to about 0.002.
    Cosine(f64),
    /// The surface is at right angles to this one (0 to 2) of the set's axes, and the path keeps its angle to it all the way, as in a cuboid
    /// of mirrors: the cosine is that of each contribution's departure.
    Axis(u8),
}

/// Cosines that are told apart.
const STEPS: u8 = 252;
pub(crate) const ANGLES: usize = STEPS as usize;
pub(super) const UNKNOWN: u8 = u8::MAX;

/// The cosine of an angle that is told apart.
pub(crate) fn angle_cosine(angle: usize) -> f64 {
    (angle as f64 + 0.5) / f64::from(STEPS)
}

/// The angle of a cosine, below [`ANGLES`].
fn angle_of(cosine: f64) -> usize {
    usize::from(code(Incidence::Cosine(cosine)))
}

/// Incidence in a byte.
pub(super) fn code(incidence: Incidence) -> u8 {
    match incidence {
        Incidence::Unknown => UNKNOWN,
        Incidence::Cosine(cosine) => ((cosine * f64::from(STEPS)) as u8).min(STEPS - 1),
        Incidence::Axis(axis) => STEPS + axis.min(2),
    }
}

pub(super) const NONE: u8 = UNKNOWN;

impl PathSet {
    /// As [`PathSet::reflect`], the angle being known.
    ///
    /// # Panics
    /// As [`PathSet::reflect`].
    pub fn reflect_at(
        &mut self,
        chain: u32,
        material: u32,
        reflection: Reflection,
        incidence: Incidence,
    ) -> u32 {
        let longer = self.reflect(chain, material, reflection);
        self.incidences[longer as usize] = code(incidence);
        longer
    }

    /// The directions that [`Incidence::Axis`] refers to: unit vectors.
    pub fn set_axes(&mut self, axes: [[f64; 3]; 3]) {
        self.axes = axes;
    }

    /// Sums over the reflections of each contribution whose angle is known, `N` at a time (octaves, say): `step(material, cosine)`, the
    /// cosine being that of the angle to the surface's normal. `step` is asked for 252 cosines of each material, not for each reflection.
    pub fn sums_by_angle<const N: usize>(&self, step: impl Fn(usize, f64) -> [f64; N]) -> Vec<[f32; N]> {
        let steps = usize::from(STEPS);
        let table: Vec<[f32; N]> = (0..self.materials)
            .flat_map(|material| (0..steps).map(move |code| (material, angle_cosine(code))))
            .map(|(material, cosine)| step(material, cosine).map(|x| x as f32))
            .collect();
        // Hits on each material along each axis, one row for each chain that has any; the first row is that of all others.
        let wide = 3 * self.materials;
        let mut rows = vec![0u32; self.parents.len()];
        let mut along = vec![0u16; wide];
        let mut sums = vec![[0.0f32; N]; self.parents.len()];
        for chain in 1..self.parents.len() {
            let parent = self.parents[chain] as usize;
            sums[chain] = sums[parent];
            rows[chain] = rows[parent];
            let material = usize::from(self.events[chain] >> 1);
            match self.incidences[chain] {
                UNKNOWN => {}
                code if code < STEPS => {
                    add(&mut sums[chain], 1.0, &table[material * steps + usize::from(code)])
                }
                axis => {
                    let before = rows[parent] as usize * wide;
                    rows[chain] = (along.len() / wide) as u32;
                    along.extend_from_within(before..before + wide);
                    along[rows[chain] as usize * wide + 3 * material + usize::from(axis - STEPS)] += 1;
                }
            }
        }
        (0..self.len())
            .map(|i| {
                let chains = [self.chains[i] as usize, self.tails[i] as usize];
                let mut sum = sums[chains[0]];
                add(&mut sum, 1.0, &sums[chains[1]]);
                let rows = chains.map(|chain| rows[chain] as usize);
                if rows == [0, 0] {
                    return sum;
                }
                let codes = self.angles_to_axes(i);
                for place in 0..wide {
                    let hits: u16 = rows.iter().map(|row| along[row * wide + place]).sum();
                    if hits > 0 {
                        add(&mut sum, f32::from(hits), &table[place / 3 * steps + codes[place % 3]]);
                    }
                }
                sum
            })
            .collect()
    }
}

impl PathSet {
    /// The angle to each of the axes at which a contribution departs.
    pub(super) fn angles_to_axes(&self, contribution: usize) -> [usize; 3] {
        let departure = self.departure(contribution);
        self.axes.map(|axis| {
            let cosine: f64 = (0..3).map(|k| axis[k] * departure[k]).sum();
            angle_of(cosine.abs())
        })
    }
}

fn add<const N: usize>(sum: &mut [f32; N], times: f32, more: &[f32; N]) {
    sum.iter_mut().zip(more).for_each(|(s, m)| *s += times * m);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path_set::Contribution;

    #[test]
    fn sums_go_along_both_halves_and_axes_follow_the_departure() {
        let mut paths = PathSet::new(2, 100.0);
        let floor = paths.reflect_at(PathSet::DIRECT, 0, Reflection::Specular, Incidence::Cosine(0.25));
        let wall = paths.reflect_at(PathSet::DIRECT, 1, Reflection::Scattered, Incidence::Cosine(0.75));
        let twice = paths.reflect_at(PathSet::DIRECT, 1, Reflection::Specular, Incidence::Axis(2));
        let twice = paths.reflect_at(twice, 0, Reflection::Specular, Incidence::Axis(2));
        let unknown = paths.reflect(PathSet::DIRECT, 1, Reflection::Specular);
        let mut push = |chain, tail, departure| {
            paths.push(Contribution {
                length_m: 5.0,
                log_weight: 0.0,
                chain,
                tail,
                departure,
                arrival: [0.0, 0.0, 1.0],
                batch: None,
            });
        };
        push(floor, wall, [1.0, 0.0, 0.0]);
        push(twice, PathSet::DIRECT, [0.8, 0.0, -0.6]);
        push(unknown, PathSet::DIRECT, [1.0, 0.0, 0.0]);
        push(PathSet::DIRECT, PathSet::DIRECT, [1.0, 0.0, 0.0]);
        let found = paths.sums_by_angle(|material, cosine| [(material + 1) as f64 * cosine, 1.0]);
        for ([found, hits], (expected, known)) in
            found.iter().zip([(0.25 + 2.0 * 0.75, 2.0), (3.0 * 0.6, 2.0), (0.0, 0.0), (0.0, 0.0)])
        {
            assert!((f64::from(*found) - expected).abs() < 0.01, "{found} {expected}");
            assert_eq!(*hits, known);
        }
        // What is copied keeps its angles.
        let mut more = PathSet::new(2, 100.0);
        more.reflect(PathSet::DIRECT, 0, Reflection::Specular);
        more.append(&paths);
        assert_eq!(more.sums_by_angle(|m, c| [(m + 1) as f64 * c, 1.0]), found);
    }
}
