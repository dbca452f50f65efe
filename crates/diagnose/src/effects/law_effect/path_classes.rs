//! Classes of paths within which the variables of a law differ little.

use crate::error::Error;
use crate::simulate::traced_pair::class_sums::ClassedPaths;
use crate::simulate::traced_views::TracedPairView;
use sabine_acoustics::Error as Cause;
use sabine_paths::PathSet;
use sabine_paths::laws::{BoundLaws, Law, LawTarget, LawVariable};

/// Cosines of the angle of incidence between which a law of reflections is taken to be straight: 0, 1/11 ... 1.
pub(super) const COSINES: usize = 12;
/// Slices of time, of as many paths each, in which paths are ranked.
const SLICES: usize = 32;
/// Classes of each variable, by how many there are.
const CLASSES: [usize; 4] = [12, 6, 4, 3];
/// Variables by which paths are told apart; of others the mean is known.
const MAX_RANKED: usize = 5;
/// Classes of paths by what a law of reflections takes from them.
const CLASSES_BY_LEVEL: usize = 10;

/// Paths in classes, and what their numbers are.
pub(super) struct SketchedPaths {
    pub paths: ClassedPaths,
    /// Names of the variables; those of meetings with a surface at each of [`COSINES`], or at any angle, have none.
    pub names: Vec<String>,
}

/// The classes of a pair's paths under a law at some values of its parameters.
pub(super) fn sketched(
    law: &Law,
    values: &[f64],
    bound: &BoundLaws,
    pair: &TracedPairView<'_>,
) -> Result<SketchedPaths, Error> {
    let paths = pair.paths();
    if law.is_uniform() && law.target() != LawTarget::Reflection {
        let paths = ClassedPaths { classes: vec![0; paths.len()], count: 1, numbers: Vec::new() };
        return Ok(SketchedPaths { paths, names: Vec::new() });
    }
    let slices = slices(paths);
    if law.target() == LawTarget::Reflection {
        return of_reflections(law, values, pair, &slices);
    }
    let variables = bound.path_variables(paths, pair.air().speed_of_sound_m_s());
    let ranked: Vec<&Vec<f32>> =
        variables.iter().filter(|v| !v.is_time).map(|v| &v.values).take(MAX_RANKED).collect();
    let each = ranked.len().checked_sub(1).map_or(1, |i| CLASSES.get(i).copied().unwrap_or(2));
    let mut classes = vec![0u16; paths.len()];
    for values in &ranked {
        let ranks = ranks(values, &slices, each);
        classes.iter_mut().zip(ranks).for_each(|(class, rank)| *class = *class * each as u16 + rank);
    }
    let count = each.pow(ranked.len() as u32);
    let (names, numbers) = variables.into_iter().map(|v| (v.name, v.values)).unzip();
    Ok(SketchedPaths { paths: ClassedPaths { classes, count, numbers }, names })
}

/// Paths by length, in slices of as many each.
fn slices(paths: &PathSet) -> Vec<Vec<u32>> {
    let lengths_m = paths.lengths_m();
    let mut order: Vec<u32> = (0..paths.len() as u32).collect();
    order.sort_by(|&a, &b| lengths_m[a as usize].total_cmp(&lengths_m[b as usize]).then(a.cmp(&b)));
    order.chunks(paths.len().div_ceil(SLICES).max(1)).map(<[u32]>::to_vec).collect()
}

/// The rank of each path within its slice by a value, from 0 to `count` - 1, as many paths in each; those of one value have one rank.
fn ranks(values: &[f32], slices: &[Vec<u32>], count: usize) -> Vec<u16> {
    let mut ranks = vec![0u16; values.len()];
    for slice in slices {
        let mut order = slice.clone();
        order.sort_by(|&a, &b| values[a as usize].total_cmp(&values[b as usize]).then(a.cmp(&b)));
        let (mut rank, mut last) = (0, f32::NAN);
        for (place, &path) in order.iter().enumerate() {
            let value = values[path as usize];
            if value != last {
                rank = (place * count / order.len()) as u16;
            }
            (ranks[path as usize], last) = (rank, value);
        }
    }
    ranks
}

/// Classes by what the law takes in all bands together; their numbers are meetings with the surface at each cosine.
fn of_reflections(
    law: &Law,
    values: &[f64],
    pair: &TracedPairView<'_>,
    slices: &[Vec<u32>],
) -> Result<SketchedPaths, Error> {
    let (paths, survey) = (pair.paths(), pair.room().survey());
    let material = survey.materials().iter().position(|name| Some(name.as_str()) == law.surface());
    let Some(material) = material else {
        let paths = ClassedPaths { classes: vec![0; paths.len()], count: 1, numbers: Vec::new() };
        return Ok(SketchedPaths { paths, names: Vec::new() });
    };
    let numbers = if asks_for_angle(law) {
        let meetings =
            paths.sums_by_angle(|own, cosine| if own == material { hats(cosine) } else { [0.0; COSINES] });
        (0..COSINES).map(|k| meetings.iter().map(|of| of[k]).collect()).collect()
    } else {
        let counts = paths.hit_counts();
        let of = |chain: u32| counts[chain as usize * paths.materials() + material];
        let chains = paths.chains().iter().zip(paths.tails());
        vec![chains.map(|(&out, &back)| f32::from(of(out) + of(back))).collect::<Vec<f32>>()]
    };
    let mut by_cosine = vec![0.0; numbers.len()];
    for hz in survey.bands().iter_hz() {
        let levels = at_cosines(law, values, hz, &|name| pair.law_site().variable(name))?;
        by_cosine.iter_mut().zip(levels).for_each(|(sum, level)| *sum += level);
    }
    let level = |path: usize| -> f32 {
        numbers.iter().zip(&by_cosine).map(|(of, level): (&Vec<f32>, &f64)| of[path] * *level as f32).sum()
    };
    let levels: Vec<f32> = (0..paths.len()).map(level).collect();
    let classes = ranks(&levels, slices, CLASSES_BY_LEVEL);
    let names = vec![String::new(); numbers.len()];
    Ok(SketchedPaths { paths: ClassedPaths { classes, count: CLASSES_BY_LEVEL, numbers }, names })
}

/// Whether a law of reflections asks for the angle.
fn asks_for_angle(law: &Law) -> bool {
    law.variables().iter().any(|name| name == "cos_incidence")
}

/// What a law of reflections gives at each of [`COSINES`], in dB; one number where it does not ask for the angle.
pub(super) fn at_cosines(
    law: &Law,
    values: &[f64],
    hz: f64,
    site: &dyn Fn(&str) -> Option<f64>,
) -> Result<Vec<f64>, Error> {
    let cosines: [f64; COSINES] = std::array::from_fn(|k| k as f64 / (COSINES - 1) as f64);
    let count = if asks_for_angle(law) { COSINES } else { 1 };
    let variable = |name: &str| match name {
        "cos_incidence" => Some(LawVariable::Each(&cosines)),
        "frequency_hz" => Some(LawVariable::Same(hz)),
        other => site(other).map(LawVariable::Same),
    };
    Ok(law.values(values, count, variable).map_err(Cause::from)?)
}

/// Shares of the two neighbours among [`COSINES`] in a cosine.
fn hats(cosine: f64) -> [f64; COSINES] {
    let place = cosine.clamp(0.0, 1.0) * (COSINES - 1) as f64;
    std::array::from_fn(|k| (1.0 - (place - k as f64).abs()).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_hold_as_many_paths_each_and_like_values_stay_together() {
        let slices = vec![vec![0, 1, 2, 3], vec![4, 5, 6, 7]];
        let values = [3.0, 1.0, 2.0, 4.0, 10.0, 10.0, 10.0, 20.0];
        assert_eq!(ranks(&values, &slices, 2), [1, 0, 0, 1, 0, 0, 0, 1]);
    }

    #[test]
    fn a_cosine_lies_between_two_others() {
        let found = hats(0.25);
        let mean: f64 = found.iter().enumerate().map(|(k, share)| share * k as f64 / 11.0).sum();
        assert!((mean - 0.25).abs() < 1e-12 && (found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(found.iter().filter(|share| **share > 0.0).count(), 2);
    }
}
