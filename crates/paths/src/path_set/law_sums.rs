//! What laws ask of chains of reflections.

use super::PathSet;
use super::incidence::{ANGLES, UNKNOWN};
use crate::laws::Counted;
use crate::reweighting::Lanes;

impl PathSet {
    /// How often each contribution meets with what is counted.
    pub(crate) fn counts(&self, counted: Counted) -> Vec<u16> {
        let mut counts = vec![0u16; self.parents.len()];
        for chain in 1..self.parents.len() {
            let event = self.events[chain];
            let counts_here = match counted {
                Counted::Reflections => true,
                Counted::Scatterings => event & 1 == 1,
                Counted::Material(material) => usize::from(event >> 1) == material,
            };
            counts[chain] = counts[self.parents[chain] as usize].saturating_add(counts_here.into());
        }
        let of = |(&chain, &tail): (&u32, &u32)| counts[chain as usize].saturating_add(counts[tail as usize]);
        self.chains.iter().zip(&self.tails).map(of).collect()
    }

    /// Whether the angle is unknown at any meeting with a material, and whether it follows at any from the departure of the path.
    pub(crate) fn untold_angles(&self, material: usize) -> (bool, bool) {
        let met = self.events.iter().zip(&self.incidences).skip(1);
        let of_material =
            met.filter(|(event, _)| usize::from(**event >> 1) == material).map(|(_, angle)| *angle);
        of_material.fold((false, false), |(unknown, axis), angle| {
            let untold = usize::from(angle) >= ANGLES;
            (unknown || angle == UNKNOWN, axis || (untold && angle != UNKNOWN))
        })
    }

    /// Sum for each contribution of `table[material][angle]` less the last angle's, over the meetings whose angle follows from its departure.
    pub(crate) fn sums_along_axes(&self, table: &[Vec<Lanes>]) -> Vec<Lanes> {
        let is_axis = |chain: usize| {
            let angle = self.incidences[chain];
            chain > 0 && usize::from(angle) >= ANGLES && angle != UNKNOWN
        };
        let mut any = vec![false; self.parents.len()];
        for chain in 1..any.len() {
            any[chain] = any[self.parents[chain] as usize] || is_axis(chain);
        }
        let of = |i: usize| {
            let mut sum = [0.0; 4];
            if !any[self.chains[i] as usize] && !any[self.tails[i] as usize] {
                return sum;
            }
            let angles = self.angles_to_axes(i);
            for end in [self.chains[i], self.tails[i]] {
                let mut chain = end as usize;
                while any[chain] {
                    let rows = &table[usize::from(self.events[chain] >> 1)];
                    if is_axis(chain) && !rows.is_empty() {
                        let angle = angles[usize::from(self.incidences[chain]) - ANGLES];
                        let (here, nowhere) = (rows[angle], rows[ANGLES]);
                        sum = std::array::from_fn(|k| sum[k] + here[k] - nowhere[k]);
                    }
                    chain = self.parents[chain] as usize;
                }
            }
            sum
        };
        (0..self.len()).map(of).collect()
    }
}
