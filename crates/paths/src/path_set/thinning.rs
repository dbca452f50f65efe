//! Fewer contributions that stand for all.

use super::{EXACT, PathSet};
use sabine_acoustics::{Error, OutOfRange};

impl PathSet {
    /// Keeps each contribution with a chance of its own and lets it carry one over that chance: on average energies stay as they are,
    /// whatever the materials (Russian roulette: Arvo and Kirk 1990). Give high chances to what carries much. Contributions of like length are
    /// drawn together, one from each full unit of chance (systematic sampling), so that sums over time scatter little. Chances
    /// outside 0 to 1 count as the nearest of these; what has none goes.
    ///
    /// Same chances and seed, same choice.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is one chance for each contribution.
    pub fn thin(&mut self, chances: &[f32], seed: u64) -> Result<(), Error> {
        if chances.len() != self.len() {
            return Err(Error::Length { expected: self.len(), found: chances.len() });
        }
        let mut kept: Vec<bool> = chances.iter().map(|&chance| chance >= 1.0).collect();
        let by_lot = |&i: &usize| chances[i] > 0.0 && chances[i] < 1.0;
        // Lengths are positive: their bits are in their order, and to sort numbers is faster than to look each of them up.
        let key = |i: usize| u64::from(self.lengths_m[i].to_bits()) << 32 | i as u64;
        let mut drawn: Vec<u64> = (0..self.len()).filter(by_lot).map(key).collect();
        drawn.sort_unstable();
        let mut sum = unit_interval(seed);
        for i in drawn.into_iter().map(|key| (key & u64::from(u32::MAX)) as usize) {
            sum += f64::from(chances[i]);
            if sum >= 1.0 {
                sum -= 1.0;
                kept[i] = true;
                self.log_weights[i] -= chances[i].ln();
            }
        }
        self.retain(&kept);
        Ok(())
    }

    /// What fewer rays would have found: of `parts` equal parts of the batches that one alone (from 0 on), its contributions `parts` times as
    /// strong; exact ones stay as they are. The parts are independent of each other, and their mean is the whole: how far what is made of
    /// them scatters says what the whole owes to chance. [`PathSet::batch_count`] falls, and standard errors become as much less certain.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the batches can be shared out in `parts` parts of two and more; [`Error::Index`] unless there is that part.
    pub fn part_of_rays(&self, part: u8, parts: u8) -> Result<Self, Error> {
        if parts == 0 || !self.batch_count.is_multiple_of(parts) || self.batch_count / parts < 2 {
            let range = "a divisor of the number of batches that leaves two and more in each part";
            return Err(OutOfRange { field: "parts of rays", value: f64::from(parts), range }.into());
        }
        if part >= parts {
            let (index, count) = (usize::from(part), usize::from(parts));
            return Err(Error::Index { what: "part of rays", index, count });
        }
        let mut alone = self.clone();
        let kept: Vec<bool> = self.batches.iter().map(|&b| b == EXACT || b % parts == part).collect();
        alone.retain(&kept);
        alone.batch_count = self.batch_count / parts;
        for (batch, log_weight) in alone.batches.iter_mut().zip(&mut alone.log_weights) {
            if *batch != EXACT {
                *batch /= parts;
                *log_weight += f32::from(parts).ln();
            }
        }
        Ok(alone)
    }

    /// Keeps the marked contributions, and the chains that they need.
    pub(super) fn retain(&mut self, kept: &[bool]) {
        fn of<T>(column: &mut Vec<T>, kept: &[bool]) {
            let mut marks = kept.iter();
            column.retain(|_| marks.next() == Some(&true));
        }
        of(&mut self.lengths_m, kept);
        of(&mut self.log_weights, kept);
        of(&mut self.chains, kept);
        of(&mut self.tails, kept);
        of(&mut self.departures, kept);
        of(&mut self.arrivals, kept);
        of(&mut self.batches, kept);
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
}

/// A number from 0 to 1 that differs from seed to seed (SplitMix64: Steele, Lea and Flood 2014).
fn unit_interval(seed: u64) -> f64 {
    let mut x = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conditions::Conditions;
    use crate::path_set::{Contribution, Reflection};
    use sabine_acoustics::{Air, Bands, EnergyResponse, Material};

    const UP: [f64; 3] = [0.0, 0.0, 1.0];

    /// Contributions of up to 20 reflections at two materials, every third along a chain and a tail.
    fn many() -> PathSet {
        let mut paths = PathSet::new(2, 100.0);
        let mut chains = vec![PathSet::DIRECT];
        for depth in 0..20 {
            let kind = if depth % 3 == 0 { Reflection::Scattered } else { Reflection::Specular };
            chains.push(paths.reflect(chains[depth], (depth % 2) as u32, kind));
        }
        for i in 0..4000usize {
            let depth = i % 21;
            paths.push(Contribution {
                length_m: 1.0 + 0.02 * i as f64,
                log_weight: -0.001 * (i * 7 % 1000) as f64,
                chain: chains[depth],
                tail: if i % 3 == 0 { chains[20 - depth] } else { PathSet::DIRECT },
                departure: UP,
                arrival: UP,
                batch: (i % 5 > 0).then_some((i % 32) as u8),
            });
        }
        paths
    }

    fn energy(paths: &PathSet, absorption: f64) -> f64 {
        let walls = [absorption, 0.5 * absorption]
            .map(|a| Material::uniform(Bands::octaves(1000.0, 1000.0).unwrap(), a, 0.3).unwrap());
        let found = paths.energies(&Conditions::new(&walls, &Air::default())).unwrap().remove(0);
        found.into_iter().map(f64::from).sum()
    }

    #[test]
    fn energy_stays_in_the_mean_at_any_absorption() {
        let all = many();
        let chances: Vec<f32> = (0..all.len()).map(|i| 0.05 + 0.009 * (i * 37 % 101) as f32).collect();
        let expected: f32 = chances.iter().sum();
        for absorption in [0.1, 0.6] {
            let found: Vec<f64> = (0..400)
                .map(|seed| {
                    let mut thinned = all.clone();
                    thinned.thin(&chances, seed).unwrap();
                    assert!((thinned.len() as f32 - expected).abs() < 2.0);
                    energy(&thinned, absorption) / energy(&all, absorption) - 1.0
                })
                .collect();
            let mean = found.iter().sum::<f64>() / 400.0;
            let standard_error =
                (found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / 399.0 / 400.0).sqrt();
            assert!(mean.abs() < 4.0 * standard_error, "{absorption}: {mean} +- {standard_error}");
            assert!(standard_error < 0.02, "{standard_error}");
        }
    }

    #[test]
    fn parts_of_the_rays_make_the_whole_and_tell_what_it_owes_to_chance() {
        let all = many();
        let parts: Vec<PathSet> = (0..4).map(|part| all.part_of_rays(part, 4).unwrap()).collect();
        let walls =
            [0.1, 0.3].map(|a| Material::uniform(Bands::octaves(1000.0, 1000.0).unwrap(), a, 0.3).unwrap());
        let air = Air::default();
        let conditions = Conditions::new(&walls, &air);
        let response = |paths: &PathSet| paths.energy_response(&conditions, 0.01).unwrap();
        let (whole, each) = (response(&all), parts.iter().map(response).collect::<Vec<_>>());
        for bin in 0..whole.band(0).len() {
            let mean = each.iter().map(|part| part.band(0)[bin]).sum::<f64>() / 4.0;
            assert!((mean - whole.band(0)[bin]).abs() <= 1e-5 * whole.band(0)[bin], "{bin}");
        }
        // A quarter of the rays err twice as much: the variance is four times that of all.
        let squared = |r: &EnergyResponse| r.band_standard_error(0).iter().map(|e| e * e).sum::<f64>();
        let ratio = each.iter().map(squared).sum::<f64>() / 4.0 / squared(&whole);
        assert!((3.0..5.0).contains(&ratio), "{ratio}");
        let exact = |paths: &PathSet| (0..paths.len()).filter(|&i| paths.is_exact(i)).count();
        assert!(parts.iter().all(|part| exact(part) == exact(&all) && part.batch_count() == 8));
        let sampled: usize = parts.iter().map(|part| part.len() - exact(part)).sum();
        assert_eq!(sampled, all.len() - exact(&all));
        // Parts of a part; none that do not come out even, and none with a single batch.
        assert_eq!(parts[1].part_of_rays(3, 4).unwrap().batch_count(), 2);
        for parts in [0, 3, 32, 64] {
            assert!(matches!(all.part_of_rays(0, parts), Err(Error::OutOfRange { .. })), "{parts}");
        }
        assert!(matches!(all.part_of_rays(4, 4), Err(Error::Index { .. })));
    }

    #[test]
    fn certain_ones_stay_as_they_are_and_others_go() {
        let all = many();
        let chances: Vec<f32> = (0..all.len()).map(|i| if i.is_multiple_of(2) { 1.0 } else { 0.0 }).collect();
        let mut thinned = all.clone();
        thinned.thin(&chances, 3).unwrap();
        assert_eq!(thinned.len(), all.len() / 2);
        for i in 0..thinned.len() {
            assert_eq!(thinned.lengths_m()[i], all.lengths_m()[2 * i]);
            assert_eq!(thinned.log_weights()[i], all.log_weights()[2 * i]);
            assert_eq!(thinned.batch(i), all.batch(2 * i));
        }
        assert!(matches!(thinned.thin(&chances, 3), Err(Error::Length { .. })));
    }
}
