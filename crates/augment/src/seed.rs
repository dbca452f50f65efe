//! Random numbers that depend on what is drawn, never on who draws it or when.

use rand::SeedableRng;
use rand_pcg::Pcg64;

/// A seed for a part of the work named by `tag`: neighbouring tags give unrelated seeds (the finaliser of SplitMix64,
/// Steele et al. 2014).
pub(crate) fn derive(seed: u64, tag: u64) -> u64 {
    let mut z = seed
        .wrapping_add(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(tag.wrapping_add(1)))
        .wrapping_add(tag.rotate_left(32));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A generator for a seed.
pub(crate) fn generator(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn tags_give_distinct_seeds() {
        let seeds: HashSet<u64> = (0..100).flat_map(|s| (0..100).map(move |t| derive(s, t))).collect();
        assert_eq!(seeds.len(), 10_000);
    }
}
