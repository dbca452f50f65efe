//! Energies of bins at other absorption, summed over their groups of paths.

use crate::simulate::band_state::BandState;
use crate::statistics::exp_all;
use pulp::Arch;

/// Products that are summed side by side.
const LANES: usize = 8;

/// Energy of each of the first so many bins if every meeting with a material left so much less (`ln_kept`: its logarithm, `[material]`); and, where
/// wanted, the sum of energy times hits on each material, `[bin * materials + material]`. No sum depends on how wide the machine is.
pub(super) fn energies_and_hits(
    state: &BandState,
    count: usize,
    ln_kept: &[f64],
    with_hits: bool,
) -> (Vec<f64>, Vec<f64>) {
    let groups = state.groups[count];
    let mut energies = state.group_energy[..groups].to_vec();
    if ln_kept.iter().any(|kept| *kept != 0.0) {
        let mut changes = vec![0.0; groups];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (hits, kept) in state.group_hits.iter().zip(ln_kept) {
                    changes.iter_mut().zip(hits).for_each(|(change, n)| *change += n * kept);
                }
            },
        );
        exp_all(&mut changes);
        energies.iter_mut().zip(&changes).for_each(|(e, change)| *e *= change);
    }
    let mut sums = Vec::with_capacity(count);
    let mut weighted = Vec::with_capacity(if with_hits { count * ln_kept.len() } else { 0 });
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for bin in 0..count {
                let groups = state.groups[bin]..state.groups[bin + 1];
                let own = &energies[groups.clone()];
                sums.push(own.iter().sum());
                if with_hits {
                    weighted.extend(state.group_hits.iter().map(|hits| dot(own, &hits[groups.clone()])));
                }
            }
        },
    );
    (sums, weighted)
}

/// Sum of products, [`LANES`] at a time.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut a, mut b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let mut lanes = [0.0; LANES];
    for (a, b) in a.by_ref().zip(b.by_ref()) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(lane, (a, b))| *lane += a * b);
    }
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    lanes.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::time_bins::Bins;

    #[test]
    fn sums_are_those_of_one_group_after_the_other() {
        let (bins, materials) = (6, 3);
        let mut state = BandState::by_hand(Bins { start_s: 0.0, width_s: 0.01 }, bins, materials, 0.3);
        // Bins of 0 to 20 groups: none, less than a vector of them, and more.
        state.groups = vec![0, 0, 3, 11, 12, 32, 37];
        state.group_energy = (0..37).map(|g| 1.0 / (1.0 + f64::from(g))).collect();
        state.group_hits =
            (0..materials).map(|m| (0..37).map(|g| f64::from(g % 5) + m as f64).collect()).collect();
        let ln_kept = [0.1, -0.2, 0.05];
        for (count, with_hits) in [(bins, true), (4, true), (bins, false)] {
            let (energies, hits) = energies_and_hits(&state, count, &ln_kept, with_hits);
            assert_eq!((energies.len(), hits.len()), (count, if with_hits { count * materials } else { 0 }));
            for bin in 0..count {
                let of_group = |g: usize| {
                    let change: f64 =
                        ln_kept.iter().zip(&state.group_hits).map(|(k, hits)| k * hits[g]).sum();
                    state.group_energy[g] * change.exp()
                };
                let groups = state.groups[bin]..state.groups[bin + 1];
                let energy: f64 = groups.clone().map(of_group).sum();
                assert!((energies[bin] - energy).abs() <= 1e-12 * energy, "bin {bin}");
                for m in (0..materials).filter(|_| with_hits) {
                    let expected: f64 = groups.clone().map(|g| of_group(g) * state.group_hits[m][g]).sum();
                    assert!((hits[bin * materials + m] - expected).abs() <= 1e-12 * expected, "bin {bin}");
                }
            }
        }
        let unchanged = energies_and_hits(&state, bins, &[0.0; 3], false).0;
        assert!((unchanged[1] - (1.0 + 0.5 + 1.0 / 3.0)).abs() < 1e-15);
    }
}
