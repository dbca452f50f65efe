//! How a tracer fills a set of paths, and how sets are joined.

use super::incidence;
use super::{Contribution, EXACT, PathSet, Reflection};
use crate::edge_diffraction::EdgeDiffraction;
use crate::packed_direction::pack_direction;
use sabine_acoustics::{Error, OutOfRange};

impl PathSet {
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
    /// Where [`PathSet::try_push`] gives an error.
    pub fn push(&mut self, contribution: Contribution) {
        if let Err(error) = self.try_push(contribution) {
            panic!("{error}");
        }
    }

    /// Adds a path from source to receiver that somebody else's tracer reports.
    ///
    /// # Errors
    /// [`Error::Index`] if one of its chains does not exist or its batch is not below [`PathSet::batch_count`];
    /// [`Error::OutOfRange`] for a length or a weight that is not finite, or a negative length.
    pub fn try_push(&mut self, contribution: Contribution) -> Result<(), Error> {
        for chain in [contribution.chain, contribution.tail] {
            let (index, count) = (chain as usize, self.parents.len());
            if index >= count {
                return Err(Error::Index { what: "chain", index, count });
            }
        }
        if let Some(batch) = contribution.batch.filter(|&batch| batch >= self.batch_count) {
            let (index, count) = (usize::from(batch), usize::from(self.batch_count));
            return Err(Error::Index { what: "batch", index, count });
        }
        OutOfRange::check("length (m)", contribution.length_m, 0.0, f64::MAX, "finite and not negative")?;
        // A path that carries nothing has the logarithm of zero.
        if contribution.log_weight.is_nan() || contribution.log_weight == f64::INFINITY {
            let (field, value) = ("log weight", contribution.log_weight);
            return Err(OutOfRange { field, value, range: "finite, or minus infinity" }.into());
        }
        self.lengths_m.push(contribution.length_m as f32);
        self.log_weights.push(contribution.log_weight as f32);
        self.chains.push(contribution.chain);
        self.tails.push(contribution.tail);
        self.departures.push(pack_direction(contribution.departure));
        self.arrivals.push(pack_direction(contribution.arrival));
        self.batches.push(contribution.batch.unwrap_or(EXACT));
        Ok(())
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

    /// Appends the paths of another set between the same surfaces; weights stay as they are. Axes (see [`Incidence::Axis`](super::Incidence::Axis)) are those of the set
    /// that has any contribution so far, or else of the other.
    ///
    /// # Panics
    /// If the sets have different numbers of materials or, both holding paths, of batches.
    pub fn append(&mut self, other: &PathSet) {
        assert_eq!(self.materials, other.materials, "paths of different scenes");
        let before = self.len();
        if before == 0 {
            (self.axes, self.batch_count) = (other.axes, other.batch_count);
        }
        assert!(
            other.is_empty() || self.batch_count == other.batch_count,
            "paths of different numbers of batches"
        );
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
    /// its energy; exact paths stay behind, for they can be found again.
    ///
    /// # Panics
    /// As [`PathSet::append`].
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
        let kept: Vec<bool> = sampled.batches.iter().map(|&batch| batch != EXACT).collect();
        sampled.retain(&kept);
        self.append(&sampled);
    }

    /// Appends the exact paths of another set between the same surfaces.
    ///
    /// # Panics
    /// As [`PathSet::append`].
    pub fn append_exact(&mut self, other: &PathSet) {
        let mut exact = other.clone();
        let kept: Vec<bool> = exact.batches.iter().map(|&batch| batch == EXACT).collect();
        exact.retain(&kept);
        self.append(&exact);
    }
}
