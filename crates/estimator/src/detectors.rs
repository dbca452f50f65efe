//! Whether a recording is what the estimator was trained for.

use crate::WeightsFault;
use crate::cues::CUES;
use crate::evidence::Evidence;
use crate::labels::EQ_COUNT;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Numbers that a detector sees.
const INPUTS: usize = CUES + 4 + EQ_COUNT;
/// Weight of the penalty on squared coefficients of standardised inputs, in recordings.
const PENALTY: f64 = 1.0;
/// Newton steps at most; a dozen are enough where classes overlap.
const STEPS: usize = 60;

/// What a detector looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Sound {
    /// Noise without speech.
    Noise,
    /// Music.
    Music,
    /// Speech of which a telephone left nothing above 4 kHz.
    Telephone,
    /// Speech without anything above 5.5 kHz.
    BandLimited,
    /// Two or more who speak at once.
    SeveralTalkers,
    /// A room more reverberant than those that were trained on.
    LongDecay,
    /// Speech without a room.
    Dry,
}

impl Sound {
    /// All of them, in the order of files.
    pub const ALL: [Self; 7] = [
        Self::Noise,
        Self::Music,
        Self::Telephone,
        Self::BandLimited,
        Self::SeveralTalkers,
        Self::LongDecay,
        Self::Dry,
    ];
}

/// A logistic regression for each [`Sound`], on numbers of the recording that are listed in `cues.rs` and what the network says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Detectors {
    /// Mean of each input over ordinary recordings.
    pub mean: Vec<f64>,
    /// Standard deviation of each.
    pub deviation: Vec<f64>,
    /// For each of [`Sound::ALL`] the coefficient of each standardised input, then the constant: it is heard where the sum is above 0.
    pub coefficients: Vec<f64>,
}

impl Detectors {
    /// Claims to hear nothing.
    pub fn none() -> Self {
        let mut coefficients = vec![0.0; Sound::ALL.len() * (INPUTS + 1)];
        coefficients.chunks_exact_mut(INPUTS + 1).for_each(|own| own[INPUTS] = -1.0);
        Self { mean: vec![0.0; INPUTS], deviation: vec![1.0; INPUTS], coefficients }
    }

    /// What is heard in a recording.
    pub(crate) fn heard(&self, evidence: &Evidence) -> Vec<Sound> {
        let inputs = evidence.detector_inputs();
        if inputs.len() != self.mean.len() {
            return Vec::new();
        }
        let inputs = self.standardised(&inputs);
        let score = |sound: usize| {
            let own = &self.coefficients[sound * (INPUTS + 1)..(sound + 1) * (INPUTS + 1)];
            own.iter().zip(inputs.iter()).map(|(a, b)| a * b).sum::<f64>()
        };
        (0..Sound::ALL.len()).filter(|sound| score(*sound) > 0.0).map(|sound| Sound::ALL[sound]).collect()
    }

    /// Inputs with mean 0 and deviation 1, and a 1.
    fn standardised(&self, inputs: &[f64]) -> DVector<f64> {
        let standard =
            inputs.iter().zip(self.mean.iter().zip(&self.deviation)).map(|(v, (m, s))| (v - m) / s);
        DVector::from_iterator(INPUTS + 1, standard.chain([1.0]))
    }

    /// Takes mean and deviation of the inputs from ordinary recordings; hears nothing yet.
    ///
    /// Recordings whose windows are too small for cues do not count.
    pub fn of_inputs<'a>(ordinary: impl IntoIterator<Item = &'a Evidence>) -> Self {
        let inputs: Vec<Vec<f64>> =
            ordinary.into_iter().map(Evidence::detector_inputs).filter(|i| i.len() == INPUTS).collect();
        let n = inputs.len().max(1) as f64;
        let mean: Vec<f64> = (0..INPUTS).map(|k| inputs.iter().map(|i| i[k]).sum::<f64>() / n).collect();
        let deviation = (0..INPUTS)
            .map(|k| (inputs.iter().map(|i| (i[k] - mean[k]).powi(2)).sum::<f64>() / n).sqrt().max(1e-3))
            .collect();
        Self { mean, deviation, ..Self::none() }
    }

    /// Learns to tell recordings `with` a sound from those `without`, both counting as much as the other in all, by logistic
    /// regression with a penalty on squares, and sets the constant so that a share `false_alarms` of those without is heard falsely.
    /// Without recordings on either side nothing changes.
    #[must_use]
    pub fn learned(
        mut self,
        sound: Sound,
        with: &[&Evidence],
        without: &[&Evidence],
        false_alarms: f64,
    ) -> Self {
        let rows = |all: &[&Evidence]| -> Vec<DVector<f64>> {
            let inputs = all.iter().map(|e| e.detector_inputs()).filter(|i| i.len() == INPUTS);
            inputs.map(|i| self.standardised(&i)).collect()
        };
        let (with, without) = (rows(with), rows(without));
        if with.is_empty() || without.is_empty() {
            return self;
        }
        let mut b = regress(&with, &without);
        let mut scores: Vec<f64> = without.iter().map(|row| row.dot(&b)).collect();
        scores.sort_by(|a, b| b.total_cmp(a));
        b[INPUTS] -= scores[((scores.len() - 1) as f64 * false_alarms).round() as usize];
        if let Some(at) = Sound::ALL.iter().position(|known| *known == sound) {
            self.coefficients[at * (INPUTS + 1)..(at + 1) * (INPUTS + 1)].copy_from_slice(b.as_slice());
        }
        self
    }

    pub(crate) fn parts(&self) -> [(&'static str, &Vec<f64>); 3] {
        let [mean, deviation, coefficients] = NAMES;
        [(mean.0, &self.mean), (deviation.0, &self.deviation), (coefficients.0, &self.coefficients)]
    }

    pub(crate) fn read(
        mut part: impl FnMut(&'static str, usize) -> Result<Vec<f64>, WeightsFault>,
    ) -> Result<Self, WeightsFault> {
        let [mean, deviation, coefficients] = NAMES;
        let read = Self {
            mean: part(mean.0, mean.1)?,
            deviation: part(deviation.0, deviation.1)?,
            coefficients: part(coefficients.0, coefficients.1)?,
        };
        match read.deviation.iter().find(|v| **v <= 0.0) {
            Some(value) => Err(WeightsFault::Layout {
                field: deviation.0,
                found: value.to_string(),
                expected: "a positive number".into(),
            }),
            None => Ok(read),
        }
    }
}

const NAMES: [(&str, usize); 3] = [
    ("detectors.mean", INPUTS),
    ("detectors.deviation", INPUTS),
    ("detectors.coefficients", Sound::ALL.len() * (INPUTS + 1)),
];

/// Logistic regression by Newton's method (T. Hastie, R. Tibshirani, J. Friedman, The Elements of Statistical Learning, 2009, 4.4.1).
fn regress(with: &[DVector<f64>], without: &[DVector<f64>]) -> DVector<f64> {
    let width = with[0].len();
    let total = (with.len() + without.len()) as f64;
    let classes =
        [(with, 1.0, 0.5 * total / with.len() as f64), (without, 0.0, 0.5 * total / without.len() as f64)];
    let mut b = DVector::zeros(width);
    for _ in 0..STEPS {
        let mut hessian = DMatrix::identity(width, width) * PENALTY;
        // The constant is free, but for what keeps the matrix regular.
        hessian[(width - 1, width - 1)] = 1e-6;
        let mut gradient = &hessian * &b;
        for (rows, is, weight) in classes {
            for row in rows {
                let p = 1.0 / (1.0 + (-row.dot(&b)).exp());
                gradient.axpy(weight * (p - is), row, 1.0);
                hessian.ger(weight * (p * (1.0 - p)).max(1e-9), row, row, 1.0);
            }
        }
        let Some(factor) = Cholesky::new(hessian) else { break };
        let step = factor.solve(&gradient);
        b -= &step;
        if step.amax() < 1e-9 {
            break;
        }
    }
    b
}

#[cfg(test)]
mod tests {
    use super::regress;
    use nalgebra::DVector;

    #[test]
    fn the_regression_is_where_the_slope_of_its_likelihood_is_nothing() {
        // Two overlapping classes on a line; the penalised likelihood by a fine search, no derivative in it.
        let row = |x: f64| DVector::from_vec(vec![x, 1.0]);
        let with: Vec<_> = [0.2, 1.0, 1.5, 3.0].map(row).to_vec();
        let without: Vec<_> = [-2.0, -0.5, 0.4, 0.9, 1.2].map(row).to_vec();
        let found = regress(&with, &without);
        let cost = |a: f64, c: f64| {
            let class = |rows: &[DVector<f64>], sign: f64| {
                rows.iter().map(|r| (1.0 + (-sign * (a * r[0] + c)).exp()).ln()).sum::<f64>() * 4.5
                    / rows.len() as f64
            };
            class(&with, 1.0) + class(&without, -1.0) + 0.5 * a * a + 0.5e-6 * c * c
        };
        let here = cost(found[0], found[1]);
        for k in 0..64 {
            let (sin, cos) = (f64::from(k) / 64.0 * std::f64::consts::TAU).sin_cos();
            for step in [1e-3, 0.1, 1.0] {
                assert!(cost(found[0] + step * cos, found[1] + step * sin) > here);
            }
        }
    }
}
