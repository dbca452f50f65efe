//! Groups of paths that met like numbers of each material: within a group one mean stands for all, so that the energy of a bin at
//! any absorption is a sum over a few groups.

/// Groups in a slice of time, at most.
pub(crate) const MAX_GROUPS: usize = 16;
/// Length of a slice, in seconds.
const SLICE_S: f32 = 0.01;
/// A group whose hits scatter by less than this has no need to be split: a change of ln(1 - absorption) by 0.2 changes its
/// energies by 20 % among themselves.
const ALIKE: f64 = 1.0;
/// Means of groups that share a bin may scatter by this much where they are joined: their own paths scatter by more.
const JOINED: f64 = 0.5;

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
        for (number, part) in split(members, weights, hits, materials, ALIKE).into_iter().enumerate() {
            part.into_iter().for_each(|i| groups[i as usize] = number as u8);
        }
    }
    groups
}

/// Joins the groups of a bin, `[energy, energy times hits of each material]` each: slices that share it bring groups of the same hits.
/// Their sums stay.
pub(crate) fn joined(rows: Vec<&[f64]>) -> Vec<Vec<f64>> {
    let Some(materials) = rows.first().map(|row| row.len() - 1) else { return Vec::new() };
    let most = rows.iter().map(|row| row[0]).fold(0.0, f64::max);
    let weights: Vec<f32> = rows.iter().map(|row| (row[0] / most) as f32).collect();
    let hits: Vec<f32> = rows.iter().flat_map(|row| row[1..].iter().map(|n| (n / row[0]) as f32)).collect();
    let parts = split((0..rows.len() as u32).collect(), &weights, &hits, materials, JOINED);
    let sum = |part: Vec<u32>| {
        let mut sum = vec![0.0; 1 + materials];
        for i in part {
            sum.iter_mut().zip(rows[i as usize]).for_each(|(sum, x)| *sum += x);
        }
        sum
    };
    parts.into_iter().map(sum).collect()
}

/// Splits the group that scatters most, at its mean along the material in which it does, until all are alike or there are enough.
fn split(members: Vec<u32>, weights: &[f32], hits: &[f32], materials: usize, most_sd: f64) -> Vec<Vec<u32>> {
    let measured = |part: Vec<u32>| {
        let found = widest(&part, weights, hits, materials);
        (part, found)
    };
    let mut parts = vec![measured(members)];
    while parts.len() < MAX_GROUPS {
        let largest =
            parts.iter().enumerate().max_by(|a, b| a.1.1.gain.total_cmp(&b.1.1.gain)).map(|(i, _)| i);
        let Some(index) = largest.filter(|&i| parts[i].1.variance > most_sd * most_sd) else { break };
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

    /// A bin of a box hears three slices: sums stay, and so does its energy at any absorption that a fit tries before groups are made again.
    #[test]
    fn joined_groups_of_three_slices_predict_energy_at_another_absorption() {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for slice in 0..3 {
            for group in 0..MAX_GROUPS {
                let hits = [12.0 + 0.8 * slice as f64, 9.0 + 0.4 * slice as f64, 4.0]
                    .map(|mean| mean + (7.3 * group as f64 + 2.1 * mean).sin() * 0.4 * mean);
                let energy = (-0.3 * slice as f64 - 0.1 * hits[0] - 0.2 * hits[1]).exp();
                rows.push([energy, energy * hits[0], energy * hits[1], energy * hits[2]].to_vec());
            }
        }
        let together = joined(rows.iter().map(Vec::as_slice).collect());
        assert_eq!(together.len(), MAX_GROUPS);
        let sum = |rows: &[Vec<f64>], k: usize| rows.iter().map(|row| row[k]).sum::<f64>();
        for k in 0..4 {
            assert!((sum(&together, k) / sum(&rows, k) - 1.0).abs() < 1e-12);
        }
        let energy = |rows: &[Vec<f64>], ln_kept: [f64; 3]| -> f64 {
            let change = |row: &Vec<f64>| (0..3).map(|k| row[1 + k] / row[0] * ln_kept[k]).sum::<f64>();
            rows.iter().map(|row| row[0] * change(row).exp()).sum()
        };
        for ln_kept in [[0.05, 0.1, 0.0], [0.08, -0.15, 0.05], [-0.2, 0.05, 0.1]] {
            let off_db = 10.0 * (energy(&together, ln_kept) / energy(&rows, ln_kept)).log10();
            assert!(off_db.abs() < 0.05, "{ln_kept:?}: {off_db} dB");
        }
        assert!(joined(Vec::new()).is_empty());
    }

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
