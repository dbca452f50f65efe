//! What is minimised.

use crate::Error;
use crate::labels::LABEL_COUNT;
use candle_core::{Device, Tensor};
use serde::{Deserialize, Serialize};

/// The loss, over labels that are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// Mean squared error (the paper); 13 outputs.
    Squared,
    /// Negative log likelihood of a normal distribution whose variance the network gives as well; 26 outputs. Weighted by
    /// the deviation (Seitzer et al. 2022, beta = 0.5), so that hard clips are not given up.
    Gaussian,
}

/// Labels of a batch on the network's scale, and which of them are there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Targets {
    pub values: Vec<f32>,
    pub mask: Vec<f32>,
}

/// Mean loss over the labels that are there.
pub(crate) fn loss(out: &Tensor, targets: &Targets, loss: Loss) -> Result<Tensor, Error> {
    let samples = targets.values.len() / LABEL_COUNT;
    let tensor = |values: &[f32]| Tensor::from_vec(values.to_vec(), (samples, LABEL_COUNT), &Device::Cpu);
    let mask = tensor(&targets.mask)?;
    let count = f64::from(targets.mask.iter().sum::<f32>()).max(1.0);
    let squares = (out.narrow(1, 0, LABEL_COUNT)? - tensor(&targets.values)?)?.sqr()?;
    let each = match loss {
        Loss::Squared => squares,
        Loss::Gaussian => {
            let log_variance = out.narrow(1, LABEL_COUNT, LABEL_COUNT)?.clamp(-8f32, 4f32)?;
            let likelihood = ((squares * log_variance.neg()?.exp()?)? + &log_variance)?;
            let weight = (log_variance.detach() * 0.5)?.exp()?;
            (likelihood * weight)?.affine(0.5, 0.0)?
        }
    };
    Ok(((each * mask)?.sum_all()? / count)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Var;

    #[test]
    fn missing_labels_have_no_gradient_and_the_others_have_that_of_their_differences() {
        let mut values: Vec<f32> = (0..LABEL_COUNT).map(|k| k as f32 * 0.1).collect();
        let mut mask = vec![1.0; LABEL_COUNT];
        (values[3], mask[3]) = (0.0, 0.0);
        let targets = Targets { values: values.clone(), mask };
        let start: Vec<f32> = (0..2 * LABEL_COUNT).map(|k| (k as f32 * 0.7).sin()).collect();
        let out = Var::from_vec(start.clone(), (1, 2 * LABEL_COUNT), &Device::Cpu).unwrap();
        let value = loss(&out, &targets, Loss::Gaussian).unwrap();
        let gradients = value.backward().unwrap();
        let found: Vec<f32> = gradients.get(&out).unwrap().flatten_all().unwrap().to_vec1().unwrap();
        let there = (LABEL_COUNT - 1) as f64;
        for k in 0..LABEL_COUNT {
            // By hand: beta = 0.5 weights the gradients of the Gaussian likelihood by the deviation, held fixed.
            let (mean, s) = (f64::from(start[k]), f64::from(start[LABEL_COUNT + k]));
            let d = mean - f64::from(values[k]);
            let weight = (0.5 * s).exp() / there * if k == 3 { 0.0 } else { 1.0 };
            assert!((f64::from(found[k]) - weight * d * (-s).exp()).abs() < 1e-6, "mean {k}");
            let expected = weight * 0.5 * (1.0 - d * d * (-s).exp());
            assert!((f64::from(found[LABEL_COUNT + k]) - expected).abs() < 1e-6, "log variance {k}");
        }
        let out = Var::from_vec(start[..LABEL_COUNT].to_vec(), (1, LABEL_COUNT), &Device::Cpu).unwrap();
        let value = f64::from(loss(&out, &targets, Loss::Squared).unwrap().to_scalar::<f32>().unwrap());
        let expected: f64 = (0..LABEL_COUNT)
            .filter(|k| *k != 3)
            .map(|k| f64::from(start[k] - values[k]).powi(2) / there)
            .sum();
        assert!((value - expected).abs() < 1e-6);
    }
}
