//! Sets of measurements, chosen one after the other: each time the one that adds most to those chosen before.
//!
//! Where what a set is worth has diminishing returns, such a choice is worth at least 63 % of the best (Nemhauser, Wolsey and Fisher 1978).

/// Chooses `count` of some candidates (indices). `worth` is that of a set; `None` where a figure is none. Ties go to the first.
pub(crate) fn choose(
    candidates: &[usize],
    count: usize,
    chosen: &mut Vec<usize>,
    worth: &(impl Fn(&[usize]) -> Option<f64> + Sync),
) {
    use rayon::prelude::*;
    for _ in 0..count {
        let with = |c: usize| -> f64 {
            let set: Vec<usize> = chosen.iter().copied().chain([c]).collect();
            worth(&set).filter(|w| w.is_finite()).unwrap_or(f64::NEG_INFINITY)
        };
        let free: Vec<usize> = candidates.iter().copied().filter(|c| !chosen.contains(c)).collect();
        let worths: Vec<f64> = free.par_iter().map(|&c| with(c)).collect();
        let best =
            worths.iter().enumerate().fold(None, |best: Option<(usize, f64)>, (place, &w)| match best {
                Some((_, most)) if most >= w => best,
                _ => Some((place, w)),
            });
        let Some((place, _)) = best else { break };
        chosen.push(free[place]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_already_say_is_not_chosen_again() {
        // The area that intervals cover together.
        let intervals = [(0.0, 4.0), (0.5, 4.5), (5.0, 7.0), (4.0, 6.0), (0.0, 4.0)];
        let covered = |set: &[usize]| {
            let inside = |x: f64| set.iter().any(|&i| intervals[i].0 <= x && x < intervals[i].1);
            Some((0..80).filter(|k| inside(0.05 + 0.1 * f64::from(*k))).count() as f64)
        };
        let mut chosen = Vec::new();
        choose(&[0, 1, 2, 3, 4], 3, &mut chosen, &covered);
        assert_eq!(chosen, [0, 2, 3]);
        // What is there already counts, and nothing is chosen twice.
        let mut chosen = vec![2];
        choose(&[0, 2], 5, &mut chosen, &covered);
        assert_eq!(chosen, [2, 0]);
    }
}
