//! Receivers that no search for a law sees.
//!
//! A formula is chosen among many, and positions that had a say in the choice cannot confirm it. So a quarter of the receivers is set aside
//! before anything is fitted, and looked at once, for the laws that have been chosen by then.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

/// Receivers below which none can be spared: of six, four are left to fit.
const LEAST_RECEIVERS: usize = 6;
/// Receivers in the vault, at least: one may be odd.
const LEAST_IN_VAULT: usize = 2;
/// One in so many is set aside.
const ONE_IN: usize = 4;

/// Receivers (indices, ascending) to be set aside with all their responses, whatever the source; none where too few are measured. `measured`
/// names the receiver of each response that may be fitted. The same seed draws the same.
pub(crate) fn draw(measured: impl IntoIterator<Item = usize>, seed: u64) -> Vec<usize> {
    let mut receivers: Vec<usize> = measured.into_iter().collect();
    receivers.sort_unstable();
    receivers.dedup();
    if receivers.len() < LEAST_RECEIVERS {
        return Vec::new();
    }
    let count = (receivers.len() / ONE_IN).max(LEAST_IN_VAULT);
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0x7A_u64.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    receivers.shuffle(&mut random);
    receivers.truncate(count);
    receivers.sort_unstable();
    receivers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_of_the_receivers_is_set_aside_and_none_of_five() {
        for (count, expected) in [(5, 0), (6, 2), (8, 2), (11, 2), (12, 3), (40, 10)] {
            // Two sources: each receiver has two responses.
            let vault = draw((0..count).chain(0..count), 3);
            assert_eq!(vault.len(), expected, "{count}");
            assert!(vault.windows(2).all(|w| w[0] < w[1]) && vault.iter().all(|&r| r < count));
        }
    }

    #[test]
    fn the_seed_decides_and_each_receiver_has_the_same_chance() {
        assert_eq!(draw(0..12, 5), draw(0..12, 5));
        let mut drawn = [0; 8];
        (0..2000).for_each(|seed| draw(0..8, seed).into_iter().for_each(|r| drawn[r] += 1));
        // A quarter of 2000, give or take 19.
        assert!(drawn.iter().all(|n| (420..580).contains(n)), "{drawn:?}");
    }
}
