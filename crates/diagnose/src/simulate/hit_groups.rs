//! Groups of paths that met like numbers of each material: within a group one mean stands for all, so that the energy of a bin at
//! any absorption is a sum over a few groups.

/// Groups in a slice of time, at most.
pub(crate) const MAX_GROUPS: usize = 16;
/// Length of a slice, in seconds.
const SLICE_S: f32 = 0.01;
/// A group whose hits scatter by less than this has no need to be split: a change of ln(1 - absorption) by 0.2 changes its
/// energies by 20 % among themselves.
const ALIKE: f64 = 1.0;

/// The slice of a time after the direct sound.
pub(crate) fn slice(time_s: f32) -> usize {
    (time_s.max(0.0) / SLICE_S) as usize
}

/// Group of each path within its slice.
pub(crate) fn group(times_s: &[f32], weights: &[f32], hits: &[f32], materials: usize) -> Vec<u8> {
    let mut slices: Vec<Vec<u32>> = Vec::new();
    for (i, &time_s) in times_s.iter().enumerate() {
        let slice = slice(time_s);
        if slices.len() <= slice {
            slices.resize(slice + 1, Vec::new());
        }
        slices[slice].push(i as u32);
    }
    let mut groups = vec![0u8; times_s.len()];
    for members in slices {
        for (number, part) in split(members, weights, hits, materials).into_iter().enumerate() {
            part.into_iter().for_each(|i| groups[i as usize] = number as u8);
        }
    }
    groups
}

/// Splits the group that scatters most, at its mean along the material in which it does, until all are alike or there are enough.
fn split(members: Vec<u32>, weights: &[f32], hits: &[f32], materials: usize) -> Vec<Vec<u32>> {
    let measured = |part: Vec<u32>| {
        let found = widest(&part, weights, hits, materials);
        (part, found)
    };
    let mut parts = vec![measured(members)];
    while parts.len() < MAX_GROUPS {
        let largest =
            parts.iter().enumerate().max_by(|a, b| a.1.1.gain.total_cmp(&b.1.1.gain)).map(|(i, _)| i);
        let Some(index) = largest.filter(|&i| parts[i].1.variance > ALIKE * ALIKE) else { break };
        let (part, HitVariance { material, mean, .. }) = parts.swap_remove(index);
        let (low, high): (Vec<u32>, Vec<u32>) =
            part.into_iter().partition(|&i| f64::from(hits[i as usize * materials + material]) <= mean);
        if low.is_empty() || high.is_empty() {
            let rest = [low, high].concat();
            parts.push((rest, HitVariance { material, mean, variance: 0.0, gain: 0.0 }));
            continue;
        }
        parts.push(measured(low));
        parts.push(measured(high));
    }
    parts.into_iter().map(|(part, _)| part).collect()
}

struct HitVariance {
    material: usize,
    mean: f64,
    variance: f64,
    /// Weight times variance: what a split may take away.
    gain: f64,
}

fn widest(part: &[u32], weights: &[f32], hits: &[f32], materials: usize) -> HitVariance {
    let mut sums = vec![(0.0f64, 0.0f64); materials];
    let mut total = 0.0;
    for &i in part {
        let w = f64::from(weights[i as usize]);
        total += w;
        for (sum, &n) in sums.iter_mut().zip(&hits[i as usize * materials..]) {
            let n = f64::from(n);
            sum.0 += w * n;
            sum.1 += w * n * n;
        }
    }
    let mut found = HitVariance { material: 0, mean: 0.0, variance: 0.0, gain: 0.0 };
    if total > 0.0 {
        for (material, (first, second)) in sums.into_iter().enumerate() {
            let mean = first / total;
            let variance = second / total - mean * mean;
            if variance > found.variance {
                // A light group that scatters widely matters once absorption changes: its weight counts by the root only.
                found = HitVariance { material, mean, variance, gain: total.sqrt() * variance };
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_predict_energy_at_another_absorption() {
        // Hits of two materials found as in a box; weights fall with them.
        let (mut hits, mut weights, mut times) = (Vec::new(), Vec::new(), Vec::new());
        for a in 0..60 {
            for b in 0..40 {
                hits.extend([a as f32, b as f32]);
                weights.push((-0.1 * a as f32 - 0.2 * b as f32).exp());
                times.push(0.004);
            }
        }
        let groups = group(&times, &weights, &hits, 2);
        let energy = |shift: [f64; 2]| -> f64 {
            (0..weights.len())
                .map(|i| {
                    let n = [0, 1].map(|k| f64::from(hits[2 * i + k]) * shift[k]);
                    f64::from(weights[i]) * (n[0] + n[1]).exp()
                })
                .sum()
        };
        let by_groups = |shift: [f64; 2]| -> f64 {
            (0..MAX_GROUPS as u8)
                .map(|g| {
                    let own: Vec<usize> = (0..weights.len()).filter(|&i| groups[i] == g).collect();
                    let e: f64 = own.iter().map(|&i| f64::from(weights[i])).sum();
                    if e == 0.0 {
                        return 0.0;
                    }
                    let n = [0, 1].map(|k| {
                        own.iter().map(|&i| f64::from(weights[i] * hits[2 * i + k])).sum::<f64>() / e
                            * shift[k]
                    });
                    e * (n[0] + n[1]).exp()
                })
                .sum()
        };
        // What a fit may move by before the groups are made anew at its end.
        for shift in [[0.05, 0.1], [0.08, -0.15], [-0.2, 0.05]] {
            let off_db = 10.0 * (by_groups(shift) / energy(shift)).log10();
            assert!(off_db.abs() < 0.5, "{shift:?}: {off_db} dB");
        }
    }
}
