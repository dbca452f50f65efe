//! Fewer contributions that stand for all.

use super::PathSet;
use sabine_acoustics::Error;

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
    use sabine_acoustics::{Air, Bands, Material};

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
