//! How a [`Combination`] is learned from rooms whose labels are known.

use crate::calibrate::{QUANTILE_90, weighted_quantile};
use crate::combination::{Combination, Levels, Square, rows};
use crate::evidence::Evidence;
use crate::labels::{EQ_COUNT, LABEL_COUNT, LabelScale, T60_COUNT};
use crate::{DatasetFault, Error};
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use std::collections::BTreeMap;

/// Recordings count as one window below this.
const ONE_WINDOW: f64 = 1.5;
/// Penalty that draws the gain to 0, in rooms.
const RIDGE: f64 = 3.0;
/// Share of the covariance between levels that few rooms do not show and that is taken for chance.
const SHRINKAGE: f64 = 0.1;
/// Least eigenvalue of a covariance, in squares of standardised levels or of the network's deviations.
const LEAST_VARIANCE: f64 = 1e-2;

/// A place in a room whose labels are known, and what was heard there: each talker in a recording of one window and in a longer one.
#[derive(Clone, Debug, PartialEq)]
pub struct HeardPlace {
    /// Name of the room.
    pub room: String,
    /// Whether the room was measured: measured and simulated rooms count half each, rooms of a kind equally.
    pub measured: bool,
    /// Whether the network can be judged there: not where it was trained. Labels count for the prior all the same.
    pub is_judged: bool,
    /// Reverberation times in seconds, then levels in dB; NaN where missing.
    pub labels: [f64; LABEL_COUNT],
    /// What was heard.
    pub recordings: Vec<Evidence>,
}

/// A place with its standardised levels and its weight.
struct Known<'a> {
    place: &'a HeardPlace,
    levels: Levels,
    weight: f64,
}

impl Combination {
    /// Learns prior and likelihood. `windows` is the correlation of the errors of each reverberation time in windows of one recording
    /// ([`Calibration::window_correlation`](crate::Calibration::window_correlation)).
    ///
    /// The prior has the moments of measured and simulated rooms, half each, with a tenth of what the levels of measured rooms have in common taken for chance.
    /// Offset and gain are least squares over the mean of a place's recordings; the covariances are those of talkers and windows
    /// about the mean of their place, and of places about the line.
    ///
    /// # Errors
    /// [`Error::Dataset`] with less than two rooms of either kind, or without recordings of one window and of several by several
    /// talkers at a judged place.
    pub fn fit(scale: &LabelScale, windows: &[f64], places: &[HeardPlace]) -> Result<Self, Error> {
        let (mean, covariance) = prior(scale, places)?;
        let known = known(scale, places, &mean, &covariance);
        let too_few = || {
            let fault = DatasetFault::Rooms { partition: "places", found: known.len(), needed: 2 };
            Error::dataset("combination", fault)
        };
        if known.len() < 2 {
            return Err(too_few());
        }
        let (offset, gain) = line(&known);
        let (short, short_place, _) =
            scatter(&known, &offset, &gain, |n| n < ONE_WINDOW).ok_or_else(too_few)?;
        let (long, place, share) =
            scatter(&known, &offset, &gain, |n| n >= ONE_WINDOW).ok_or_else(too_few)?;
        // One window: T + W; many: T + share W.
        let window = (short - long) / (1.0 - share);
        let talker = long - window * share;
        let mut fitted = Self {
            prior_mean: mean.as_slice().to_vec(),
            prior_covariance: rows(&covariance),
            offset: offset.as_slice().to_vec(),
            gain: rows(&gain),
            place_covariance: rows(&definite(&((place + short_place) / 2.0))),
            talker_covariance: rows(&definite(&talker)),
            window_covariance: rows(&definite(&window)),
            eq_deviation: vec![1.0; EQ_COUNT],
            t60_correlation: vec![1.0; T60_COUNT],
        };
        fitted.calibrate(scale, windows, &known);
        Ok(fitted)
    }

    /// Makes 90 % intervals hold 90 % of the known places, from one recording and from all together.
    fn calibrate(&mut self, scale: &LabelScale, windows: &[f64], known: &[Known<'_>]) {
        let cases: Vec<(&Known<'_>, Vec<&Evidence>)> = known
            .iter()
            .flat_map(|k| {
                let long: Vec<&Evidence> =
                    k.place.recordings.iter().filter(|r| r.windows() >= ONE_WINDOW).collect();
                let one = k.place.recordings.iter().take(1).collect();
                [(k, one), (k, long)]
            })
            .collect();
        for level in 0..EQ_COUNT {
            let ratios = cases.iter().filter(|(k, _)| !k.place.labels[T60_COUNT + level].is_nan());
            let ratios = ratios.filter_map(|(k, recordings)| {
                let (mean, deviation) = self.eq_posterior(recordings)?;
                Some(((mean[level] - k.levels[level]).abs() / deviation[level], k.weight))
            });
            if let Some(quantile) = weighted_quantile(ratios.collect(), 0.9) {
                self.eq_deviation[level] = quantile / QUANTILE_90;
            }
        }
        for (label, windows) in windows.iter().enumerate().take(T60_COUNT) {
            let coverage = |correlation: f64| {
                let mut trial = self.clone();
                trial.t60_correlation[label] = correlation;
                let (mut covered, mut total) = (0.0, 0.0);
                for (k, recordings) in
                    cases.iter().filter(|(k, r)| r.len() > 1 && !k.place.labels[label].is_nan())
                {
                    let truth = scale.encode(label, k.place.labels[label]);
                    let (mean, deviation) = trial.t60_joint(recordings, label, *windows);
                    covered += if (mean - truth).abs() <= QUANTILE_90 * deviation { k.weight } else { 0.0 };
                    total += k.weight;
                }
                covered / total
            };
            let least = (0..50).map(|step| f64::from(step) / 50.0).find(|c| coverage(*c) >= 0.9);
            self.t60_correlation[label] = least.unwrap_or(1.0);
        }
    }
}

/// Standardised levels of a place; NaN where missing.
fn standardised(scale: &LabelScale, place: &HeardPlace) -> Levels {
    Levels::from_fn(|k, _| scale.encode(T60_COUNT + k, place.labels[T60_COUNT + k]))
}

/// Moments of measured and simulated rooms, half each.
fn prior(scale: &LabelScale, places: &[HeardPlace]) -> Result<(Levels, Square), Error> {
    let of_kind = |measured: bool| {
        let mut rooms: BTreeMap<&str, Vec<Levels>> = BTreeMap::new();
        for place in places.iter().filter(|p| p.measured == measured) {
            rooms.entry(&place.room).or_default().push(standardised(scale, place));
        }
        // Means of what is known.
        let mean = |all: &[Levels], k: usize| mean(all.iter().map(|l| l[k]));
        let rooms: Vec<Levels> = rooms.values().map(|all| Levels::from_fn(|k, _| mean(all, k))).collect();
        if rooms.len() < 2 {
            let partition = if measured { "measured rooms" } else { "simulated rooms" };
            let fault = DatasetFault::Rooms { partition, found: rooms.len(), needed: 2 };
            return Err(Error::dataset("combination", fault));
        }
        let centre = Levels::from_fn(|k, _| mean(&rooms, k));
        let keep = if measured { 1.0 - SHRINKAGE } else { 1.0 };
        let product = |i: usize, j: usize| rooms.iter().map(move |r| (r[i] - centre[i]) * (r[j] - centre[j]));
        let covariance = Square::from_fn(|i, j| self::mean(product(i, j)) * if i == j { 1.0 } else { keep });
        Ok((centre, covariance))
    };
    let ((a, a_covariance), (b, b_covariance)) = (of_kind(true)?, of_kind(false)?);
    let apart = (a - b) / 2.0;
    Ok(((a + b) / 2.0, definite(&((a_covariance + b_covariance) / 2.0 + apart * apart.transpose()))))
}

/// Mean of the values that are numbers.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.filter(|v| !v.is_nan()).fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// The judged places with missing levels as the prior expects them from those that are known, and weights with which both kinds of
/// rooms count equally.
fn known<'a>(
    scale: &LabelScale,
    places: &'a [HeardPlace],
    mean: &Levels,
    covariance: &Square,
) -> Vec<Known<'a>> {
    let judged = || places.iter().filter(|p| p.is_judged && p.recordings.len() > 1);
    let mut in_room: BTreeMap<(bool, &str), f64> = BTreeMap::new();
    for place in judged() {
        *in_room.entry((place.measured, &place.room)).or_insert(0.0) += 1.0;
    }
    let rooms = |measured: bool| in_room.keys().filter(|key| key.0 == measured).count() as f64;
    judged()
        .map(|place| {
            let own = standardised(scale, place);
            let (seen, missing): (Vec<usize>, Vec<usize>) = (0..EQ_COUNT).partition(|k| !own[*k].is_nan());
            let mut levels = own;
            let seen_covariance =
                DMatrix::from_fn(seen.len(), seen.len(), |i, j| covariance[(seen[i], seen[j])]);
            let apart = DVector::from_iterator(seen.len(), seen.iter().map(|k| own[*k] - mean[*k]));
            let solved = Cholesky::new(seen_covariance).map(|factor| factor.solve(&apart));
            for k in missing {
                let pull = |solved: &DVector<f64>| {
                    seen.iter().zip(solved.iter()).map(|(s, v)| covariance[(k, *s)] * v).sum::<f64>()
                };
                levels[k] = mean[k] + solved.as_ref().map_or(0.0, pull);
            }
            // Both kinds have the weight of all rooms of the larger kind.
            let larger = rooms(true).max(rooms(false));
            let weight = larger / rooms(place.measured) / in_room[&(place.measured, place.room.as_str())];
            Known { place, levels, weight }
        })
        .collect()
}

/// Offset and gain by least squares over places.
fn line(known: &[Known<'_>]) -> (Levels, Square) {
    let reading = |k: &Known<'_>| {
        k.place.recordings.iter().map(Evidence::eq_mean).sum::<Levels>() / k.place.recordings.len() as f64
    };
    let total: f64 = known.iter().map(|k| k.weight).sum();
    let x: Levels = known.iter().map(|k| k.levels * k.weight).sum::<Levels>() / total;
    let y: Levels = known.iter().map(|k| reading(k) * k.weight).sum::<Levels>() / total;
    let (mut xx, mut yx) = (Square::identity() * RIDGE, Square::zeros());
    for k in known {
        let apart = k.levels - x;
        xx += k.weight * apart * apart.transpose();
        yx += k.weight * (reading(k) - y) * apart.transpose();
    }
    let gain =
        Cholesky::new(xx).map_or_else(Square::zeros, |factor| factor.solve(&yx.transpose()).transpose());
    (y - gain * x, gain)
}

/// Of the recordings with such a number of windows: covariance of talkers about their place, covariance of places about the line, and
/// mean of one over the number of windows; all in products of the network's deviations.
fn scatter(
    known: &[Known<'_>],
    offset: &Levels,
    gain: &Square,
    windows: impl Fn(f64) -> bool,
) -> Option<(Square, Square, f64)> {
    let (mut within, mut between, mut share, mut total) = (Square::zeros(), Square::zeros(), 0.0, 0.0);
    for k in known {
        let errors: Vec<(Levels, f64)> = k
            .place
            .recordings
            .iter()
            .filter(|r| windows(r.windows()))
            .map(|r| {
                let apart = r.eq_mean() - offset - gain * k.levels;
                (apart.component_div(&r.eq_deviation()), 1.0 / r.windows())
            })
            .collect();
        let n = errors.len() as f64;
        if errors.len() < 2 {
            continue;
        }
        let centre = errors.iter().map(|e| e.0).sum::<Levels>() / n;
        let own =
            errors.iter().map(|e| (e.0 - centre) * (e.0 - centre).transpose()).sum::<Square>() / (n - 1.0);
        within += k.weight * own;
        between += k.weight * (centre * centre.transpose() - own / n);
        share += k.weight * errors.iter().map(|e| e.1).sum::<f64>() / n;
        total += k.weight;
    }
    (total > 0.0).then(|| (within / total, between / total, share / total))
}

/// The nearest symmetric matrix whose eigenvalues are not below [`LEAST_VARIANCE`].
fn definite(matrix: &Square) -> Square {
    let eigen = SymmetricEigen::new((matrix + matrix.transpose()) / 2.0);
    let lifted = Square::from_diagonal(&eigen.eigenvalues.map(|v| v.max(LEAST_VARIANCE)));
    let found = eigen.eigenvectors * lifted * eigen.eigenvectors.transpose();
    (found + found.transpose()) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::JointLabel;
    use crate::labels::T60Scale;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Standard normal numbers as sums of twelve uniform ones.
    fn normal(rng: &mut Pcg64Mcg) -> f64 {
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    /// Levels with deviation 1 and correlation 0.6 of neighbours, read as 0.1 + half of them, with errors of deviation 0.2
    /// (place), 0.3 (talker) and 0.4 (window) in units of the network's deviation of 0.5.
    fn places(rooms: usize, talkers: usize, rng: &mut Pcg64Mcg) -> Vec<HeardPlace> {
        let place = |number: usize| {
            let mut levels = [normal(rng); EQ_COUNT];
            (1..EQ_COUNT).for_each(|k| levels[k] = 0.6 * levels[k - 1] + 0.8 * normal(rng));
            let at: [f64; EQ_COUNT] =
                std::array::from_fn(|k| 0.1 + 0.5 * levels[k] + 0.5 * 0.2 * normal(rng));
            let mut recordings = Vec::new();
            for _ in 0..talkers {
                let talker: [f64; EQ_COUNT] = std::array::from_fn(|_| 0.3 * normal(rng));
                for windows in [1.0f64, 5.0] {
                    let mut label = |k: usize| {
                        let error =
                            |talker: f64, rng: &mut Pcg64Mcg| talker + 0.4 * normal(rng) / windows.sqrt();
                        let level = k.checked_sub(T60_COUNT);
                        let mean = level.map_or(0.1 * normal(rng), |l| at[l] + 0.5 * error(talker[l], rng));
                        JointLabel { mean, variance: 0.25, windows }
                    };
                    recordings.push(Evidence::new(std::array::from_fn(&mut label), Vec::new()));
                }
            }
            let labels = std::array::from_fn(|k| k.checked_sub(T60_COUNT).map_or(1.0, |l| levels[l]));
            let measured = number.is_multiple_of(2);
            HeardPlace { room: format!("room {number}"), measured, is_judged: true, labels, recordings }
        };
        (0..rooms).map(place).collect()
    }

    fn scale() -> LabelScale {
        LabelScale { t60: T60Scale::Log, mean: vec![0.0; LABEL_COUNT], deviation: vec![1.0; LABEL_COUNT] }
    }

    #[test]
    fn what_recordings_were_drawn_from_is_found_again() -> Result<(), Error> {
        let mut rng = Pcg64Mcg::seed_from_u64(26);
        let (rooms, talkers) = (600.0f64, 6.0f64);
        let drawn = places(rooms as usize, talkers as usize, &mut rng);
        let found = Combination::fit(&scale(), &[1.0; LABEL_COUNT], &drawn)?;
        // Five standard errors each. Reading of a place: 0.5 of (place + talkers + windows) by 600 rooms; levels that neighbours
        // explain have a variance of 0.64 / 1.36 of their own; the penalty of three rooms takes 0.5 * 3 / (600 * 0.47) at most.
        let reading = 0.5 * (0.04 + (0.09 + 0.16 * 0.6) / talkers).sqrt();
        let gain_error = 5.0 * reading / (rooms * 0.47).sqrt() + 1.5 / (rooms * 0.47);
        for (k, gain) in found.gain.iter().enumerate() {
            let truth = if k % 7 == 0 { 0.5 } else { 0.0 };
            assert!((gain - truth).abs() < gain_error, "gain {k}: {gain}, {gain_error}");
        }
        // A variance of v by n values: v sqrt(2 / n); talkers and windows have 600 * 5 values, and each is a difference of two.
        let check = |name: &str, found: &[f64], truth: f64, error: f64| {
            for k in 0..EQ_COUNT {
                let variance = found[7 * k];
                assert!((variance - truth).abs() < 5.0 * error, "{name} {k}: {variance}, {truth} +- {error}");
            }
        };
        let values = (2.0 / (rooms * (talkers - 1.0))).sqrt();
        check("talker", &found.talker_covariance, 0.09, 1.5 * 0.25 * values);
        check("window", &found.window_covariance, 0.16, 2.0 * 0.25 * values);
        check("place", &found.place_covariance, 0.04, 0.1 * (2.0 / rooms).sqrt());
        check("prior", &found.prior_covariance, 1.0, (2.0 / rooms).sqrt());
        // A tenth of what half of the rooms have in common is taken for chance.
        assert!((found.prior_covariance[1] - 0.6 * 0.95).abs() < 5.0 * 1.2 / rooms.sqrt());
        Ok(())
    }

    #[test]
    fn intervals_hold_nine_of_ten_new_rooms() -> Result<(), Error> {
        let mut rng = Pcg64Mcg::seed_from_u64(27);
        let found = Combination::fit(&scale(), &[1.0; LABEL_COUNT], &places(300, 5, &mut rng))?;
        let (mut held, mut total) = (0.0, 0.0);
        for place in places(400, 5, &mut rng) {
            let all: Vec<&Evidence> = place.recordings.iter().filter(|r| r.windows() > 1.5).collect();
            let Some((mean, deviation)) = found.eq_posterior(&all) else { continue };
            for k in 0..EQ_COUNT {
                let inside = (mean[k] - place.labels[T60_COUNT + k]).abs() < QUANTILE_90 * deviation[k];
                held += f64::from(u8::from(inside));
                total += 1.0;
            }
        }
        // 400 rooms, levels of a room counted as one value; as much again for the quantile fitted to 300 rooms.
        let error = (0.09f64 / 400.0 + 0.09 / 300.0).sqrt();
        assert!(total == 2400.0 && (held / total - 0.9).abs() < 4.0 * error, "{held} of {total}");
        Ok(())
    }

    #[test]
    fn one_kind_of_rooms_is_not_enough() {
        let mut rng = Pcg64Mcg::seed_from_u64(28);
        let mut drawn = places(20, 3, &mut rng);
        drawn.iter_mut().for_each(|place| place.measured = true);
        let refused = Combination::fit(&scale(), &[1.0; LABEL_COUNT], &drawn);
        assert!(refused.is_err_and(|error| error.to_string().contains("simulated rooms")));
    }
}
