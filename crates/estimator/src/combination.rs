//! What the equalisation of rooms is like in general, and how recordings of one room are joined with it.
//!
//! A recording gives one reading `y` of the six standardised levels `x` of its room. With `D` the network's own standard deviations of a
//! window of it and `n` its windows,
//!
//! ```text
//! y = offset + gain x + D (p + t + w / sqrt(n)),    p ~ N(0, P), t ~ N(0, T), w ~ N(0, W)
//! ```
//!
//! `p` is what all recordings of a place err by, `t` what a talker and `w` what a window errs by. Readings are joined by their
//! precision without `p`, which is added once; then the prior `x ~ N(m, S)` is applied, once as well (C. M. Bishop, Pattern Recognition and
//! Machine Learning, 2006, 2.3.3). The network's own answer to a window holds its training prior already: the mean over many windows
//! holds it many times over, and follows a room too little.
//!
//! Reverberation times are far better known than the prior knows them. Their readings are joined by their precision alone, as windows are.

use crate::WeightsFault;
use crate::evidence::Evidence;
use crate::labels::{EQ_COUNT, LABEL_COUNT, T60_COUNT};
use nalgebra::{Cholesky, SMatrix, SVector};

/// A number for each level.
pub(crate) type Levels = SVector<f64, EQ_COUNT>;
/// A number for each pair of levels.
pub(crate) type Square = SMatrix<f64, EQ_COUNT, EQ_COUNT>;

/// Prior over rooms and likelihood of recordings, on the scale of the network: levels at 62.5 Hz to 4 kHz without 1 kHz, squares row
/// after row. [`Combination::fit`] learns it.
#[derive(Clone, Debug, PartialEq)]
pub struct Combination {
    /// Mean of the levels over rooms.
    pub prior_mean: Vec<f64>,
    /// Their covariance.
    pub prior_covariance: Vec<f64>,
    /// What the network says of a room whose levels are all 0.
    pub offset: Vec<f64>,
    /// What it says more (rows) where a level (columns) is 1.
    pub gain: Vec<f64>,
    /// Covariance, in products of the network's deviations, of what all recordings of one place err by.
    pub place_covariance: Vec<f64>,
    /// Of what a talker errs by.
    pub talker_covariance: Vec<f64>,
    /// Of what a window errs by.
    pub window_covariance: Vec<f64>,
    /// Factor on the standard deviation of each level with which 90 % intervals hold 90 % of the places it was fitted to.
    pub eq_deviation: Vec<f64>,
    /// Correlation, 0..=1, of the errors of each reverberation time in recordings of one place.
    pub t60_correlation: Vec<f64>,
}

/// Names, lengths and values of the parts, as they stand in a file.
type Parts<T> = [(&'static str, usize, T); 9];

impl Combination {
    /// Mean and standard deviation of each label, given recordings of one room. None where the covariances are not those of a
    /// distribution, or without recordings.
    pub(crate) fn posterior(
        &self,
        recordings: &[&Evidence],
        windows: &[f64],
    ) -> Option<[(f64, f64); LABEL_COUNT]> {
        let eq = self.eq_posterior(recordings)?;
        Some(std::array::from_fn(|label| match label.checked_sub(T60_COUNT) {
            Some(level) => (eq.0[level], eq.1[level]),
            None => self.t60_joint(recordings, label, windows[label]),
        }))
    }

    /// Mean and standard deviation of each level.
    pub(crate) fn eq_posterior(&self, recordings: &[&Evidence]) -> Option<(Levels, Levels)> {
        let (mean, prior, gain) =
            (levels(&self.prior_mean), square(&self.prior_covariance), square(&self.gain));
        let (reading, error) = self.joint_reading(recordings)?;
        let innovation = Cholesky::new(gain * prior * gain.transpose() + error)?;
        let weight = innovation.solve(&(gain * prior)).transpose();
        let at = mean + weight * (reading - levels(&self.offset) - gain * mean);
        let covariance = prior - weight * gain * prior;
        Some((at, Levels::from_fn(|k, _| covariance[(k, k)].max(0.0).sqrt() * self.eq_deviation[k])))
    }

    /// One reading of all recordings, and the covariance of its error.
    fn joint_reading(&self, recordings: &[&Evidence]) -> Option<(Levels, Square)> {
        let (talker, window) = (square(&self.talker_covariance), square(&self.window_covariance));
        let (mut precision, mut sum, mut scale) = (Square::zeros(), Levels::zeros(), Levels::zeros());
        for recording in recordings {
            let own = recording.eq_deviation();
            let inverse = Cholesky::new(scaled(&(talker + window / recording.windows()), &own))?.inverse();
            precision += inverse;
            sum += inverse * recording.eq_mean();
            scale += own / recordings.len() as f64;
        }
        let error = Cholesky::new(precision)?;
        Some((error.solve(&sum), error.inverse() + scaled(&square(&self.place_covariance), &scale)))
    }

    /// Mean by precision of one reverberation time, and its standard deviation: the variance of one recording falls to
    /// `correlation + (1 - correlation) / recordings` of what it is. `windows` is the correlation of the windows of a recording.
    pub(crate) fn t60_joint(&self, recordings: &[&Evidence], label: usize, windows: f64) -> (f64, f64) {
        let joint = crate::joint::JointLabel::of_readings(recordings.iter().map(|recording| {
            let own = recording.joint(label);
            (own.mean, own.deviation(windows).powi(2), 1.0)
        }));
        (joint.mean, joint.deviation(self.t60_correlation[label]))
    }

    /// The parts as they stand in a file.
    pub(crate) fn parts(&self) -> Parts<&Vec<f64>> {
        let values = [
            &self.prior_mean,
            &self.prior_covariance,
            &self.offset,
            &self.gain,
            &self.place_covariance,
            &self.talker_covariance,
            &self.window_covariance,
            &self.eq_deviation,
            &self.t60_correlation,
        ];
        let mut values = values.into_iter();
        NAMES.map(|(name, count)| (name, count, values.next().unwrap_or(&self.prior_mean)))
    }

    /// From the parts of a file, each given by its name and length.
    pub(crate) fn read(
        mut part: impl FnMut(&'static str, usize) -> Result<Vec<f64>, WeightsFault>,
    ) -> Result<Self, WeightsFault> {
        let mut names = NAMES.into_iter();
        let mut next = || names.next().map_or(Ok(Vec::new()), |(name, count)| part(name, count));
        let read = Self {
            prior_mean: next()?,
            prior_covariance: next()?,
            offset: next()?,
            gain: next()?,
            place_covariance: next()?,
            talker_covariance: next()?,
            window_covariance: next()?,
            eq_deviation: next()?,
            t60_correlation: next()?,
        };
        read.check()?;
        Ok(read)
    }

    fn check(&self) -> Result<(), WeightsFault> {
        let fault = |field: &'static str, found: String, expected: &str| {
            Err(WeightsFault::Layout { field, found, expected: expected.into() })
        };
        for (field, values) in [
            ("combination.prior_covariance", &self.prior_covariance),
            ("combination.place_covariance", &self.place_covariance),
            ("combination.talker_covariance", &self.talker_covariance),
            ("combination.window_covariance", &self.window_covariance),
        ] {
            let square = square(values);
            if (square - square.transpose()).amax() > 1e-5 * square.amax() || Cholesky::new(square).is_none()
            {
                return fault(field, "another matrix".into(), "a symmetric positive definite one");
            }
        }
        if let Some(value) = self.eq_deviation.iter().find(|v| **v <= 0.0) {
            return fault("combination.eq_deviation", value.to_string(), "a positive number");
        }
        match self.t60_correlation.iter().find(|v| !(0.0..=1.0).contains(*v)) {
            Some(value) => fault("combination.t60_correlation", value.to_string(), "0 to 1"),
            None => Ok(()),
        }
    }
}

const NAMES: [(&str, usize); 9] = [
    ("combination.prior_mean", EQ_COUNT),
    ("combination.prior_covariance", EQ_COUNT * EQ_COUNT),
    ("combination.offset", EQ_COUNT),
    ("combination.gain", EQ_COUNT * EQ_COUNT),
    ("combination.place_covariance", EQ_COUNT * EQ_COUNT),
    ("combination.talker_covariance", EQ_COUNT * EQ_COUNT),
    ("combination.window_covariance", EQ_COUNT * EQ_COUNT),
    ("combination.eq_deviation", EQ_COUNT),
    ("combination.t60_correlation", T60_COUNT),
];

pub(crate) fn levels(values: &[f64]) -> Levels {
    Levels::from_column_slice(values)
}

pub(crate) fn square(values: &[f64]) -> Square {
    Square::from_row_slice(values)
}

/// Row after row.
pub(crate) fn rows(square: &Square) -> Vec<f64> {
    square.transpose().as_slice().to_vec()
}

/// `D S D` with `D` diagonal.
pub(crate) fn scaled(square: &Square, diagonal: &Levels) -> Square {
    Square::from_fn(|i, j| diagonal[i] * square[(i, j)] * diagonal[j])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::JointLabel;

    /// Numbers that look random, -1 to 1, and are the same every time.
    fn number(k: usize) -> f64 {
        ((k * k + 7 * k) as f64 * 0.731).sin()
    }

    fn covariance(from: usize, size: f64) -> Vec<f64> {
        let root = Square::from_fn(|i, j| size * number(from + 6 * i + j));
        rows(&(root * root.transpose() + Square::identity() * (0.3 * size * size)))
    }

    fn combination() -> Combination {
        Combination {
            prior_mean: (0..6).map(|k| 0.4 * number(k)).collect(),
            prior_covariance: covariance(10, 0.8),
            offset: (0..6).map(|k| 0.2 * number(50 + k)).collect(),
            gain: (0..36).map(|k| 0.3 * number(60 + k) + if k % 7 == 0 { 0.5 } else { 0.0 }).collect(),
            place_covariance: covariance(100, 0.3),
            talker_covariance: covariance(140, 0.5),
            window_covariance: covariance(180, 0.4),
            eq_deviation: vec![1.0; 6],
            t60_correlation: vec![0.25; 7],
        }
    }

    fn evidence(k: usize, deviation: f64, windows: f64) -> Evidence {
        let label = |i: usize| JointLabel {
            mean: number(300 + 20 * k + i),
            variance: deviation * deviation,
            windows,
        };
        Evidence::new(std::array::from_fn(label), Vec::new())
    }

    /// Solves by elimination, which shares nothing with the Cholesky factors.
    fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
        let n = b.len();
        for k in 0..n {
            let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap_or(k);
            a.swap(k, pivot);
            b.swap(k, pivot);
            let upper = a[k].clone();
            for i in k + 1..n {
                let factor = a[i][k] / upper[k];
                a[i].iter_mut().zip(&upper).skip(k).for_each(|(own, above)| *own -= factor * above);
                b[i] -= factor * b[k];
            }
        }
        let mut x = vec![0.0; n];
        for k in (0..n).rev() {
            x[k] = (b[k] - (k + 1..n).map(|j| a[k][j] * x[j]).sum::<f64>()) / a[k][k];
        }
        x
    }

    #[test]
    fn the_posterior_is_that_of_the_joint_normal_distribution_of_levels_and_readings() {
        let model = combination();
        let windows = [1.0, 3.0, 7.0];
        let deviation = 0.7;
        let recordings: Vec<Evidence> = (0..3).map(|k| evidence(k, deviation, windows[k])).collect();
        let found = model.eq_posterior(&recordings.iter().collect::<Vec<_>>()).unwrap_or_default();
        let at = |matrix: &[f64], i: usize, j: usize| matrix[6 * i + j];
        // All 18 readings at once: gain prior gain' + place everywhere, talker and window in their own block.
        let spread = |i: usize, j: usize| -> f64 {
            (0..36)
                .map(|m| at(&model.gain, i, m / 6) * model.prior_covariance[m] * at(&model.gain, j, m % 6))
                .sum()
        };
        let d2 = deviation * deviation;
        let entry = |r: usize, c: usize| {
            let (i, j) = (r % 6, c % 6);
            let own =
                at(&model.talker_covariance, i, j) + at(&model.window_covariance, i, j) / windows[r / 6];
            let shared = spread(i, j) + d2 * at(&model.place_covariance, i, j);
            shared + if r / 6 == c / 6 { d2 * own } else { 0.0 }
        };
        let full: Vec<Vec<f64>> = (0..18).map(|r| (0..18).map(|c| entry(r, c)).collect()).collect();
        let expected = |i: usize| {
            model.offset[i] + (0..6).map(|j| at(&model.gain, i, j) * model.prior_mean[j]).sum::<f64>()
        };
        let apart: Vec<f64> = (0..18).map(|r| recordings[r / 6].eq_mean()[r % 6] - expected(r % 6)).collect();
        let solved = solve(full.clone(), apart);
        for level in 0..6 {
            let cross: Vec<f64> = (0..18)
                .map(|r| {
                    (0..6).map(|j| at(&model.prior_covariance, level, j) * at(&model.gain, r % 6, j)).sum()
                })
                .collect();
            let mean = model.prior_mean[level] + cross.iter().zip(&solved).map(|(a, b)| a * b).sum::<f64>();
            let explained: f64 =
                cross.iter().zip(solve(full.clone(), cross.clone())).map(|(a, b)| a * b).sum();
            let deviation = (at(&model.prior_covariance, level, level) - explained).sqrt();
            assert!((found.0[level] - mean).abs() < 1e-9, "{level}: {} {mean}", found.0[level]);
            assert!((found.1[level] - deviation).abs() < 1e-9, "{level}: {} {deviation}", found.1[level]);
        }
    }

    #[test]
    fn more_recordings_are_surer_and_their_order_does_not_matter() {
        let model = combination();
        let all: Vec<Evidence> = (0..4).map(|k| evidence(k, 0.5 + 0.1 * k as f64, 1.0 + k as f64)).collect();
        let answer = |order: &[usize]| {
            let chosen: Vec<&Evidence> = order.iter().map(|k| &all[*k]).collect();
            model.posterior(&chosen, &[0.5; LABEL_COUNT]).unwrap_or([(f64::NAN, f64::NAN); LABEL_COUNT])
        };
        let (forward, backward, one) = (answer(&[0, 1, 2, 3]), answer(&[3, 2, 1, 0]), answer(&[0]));
        for label in 0..LABEL_COUNT {
            assert!((forward[label].0 - backward[label].0).abs() < 1e-12);
            assert!(forward[label].1 < one[label].1, "{label}: {:?} {:?}", forward[label], one[label]);
        }
    }

    #[test]
    fn what_is_no_covariance_is_refused_by_name() {
        let mut model = combination();
        model.talker_covariance[1] += 1.0;
        let fault = model.check().map_err(|fault| fault.to_string());
        assert!(fault.is_err_and(|text| text.contains("combination.talker_covariance")));
    }
}
