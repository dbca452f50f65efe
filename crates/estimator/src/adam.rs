//! Adam with decoupled weight decay (Kingma and Ba 2015; Loshchilov and Hutter 2019), its state in plain sight.

use crate::Error;
use candle_core::backprop::GradStore;
use candle_core::{Device, Tensor, Var};
use std::collections::BTreeMap;

/// Settings of the optimiser other than the learning rate.
const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f64 = 1e-8;
/// Largest Euclidean norm of the whole gradient; a longer one is scaled down.
const NORM_LIMIT: f64 = 5.0;

/// State of the optimiser.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Adam {
    pub step: u64,
    /// First and second moment of the gradient of each tensor.
    pub moments: BTreeMap<String, (Vec<f32>, Vec<f32>)>,
}

impl Adam {
    /// One step downhill. Weights, not biases and not scales, decay by `decay * rate`.
    pub fn update(
        &mut self,
        variables: &BTreeMap<String, Var>,
        gradients: &GradStore,
        rate: f64,
        decay: f64,
    ) -> Result<(), Error> {
        self.step += 1;
        let mut all = Vec::new();
        let mut squares = 0.0;
        for (name, variable) in variables {
            let Some(gradient) = gradients.get(variable) else { continue };
            let gradient: Vec<f32> = gradient.flatten_all()?.to_vec1()?;
            squares += gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>();
            all.push((name, variable, gradient));
        }
        let clip = (NORM_LIMIT / squares.sqrt().max(1e-12)).min(1.0);
        let power = i32::try_from(self.step).unwrap_or(i32::MAX);
        let (bias_1, bias_2) = (1.0 - BETA_1.powi(power), 1.0 - BETA_2.powi(power));
        for (name, variable, gradient) in all {
            let zeros = || (vec![0.0; gradient.len()], vec![0.0; gradient.len()]);
            let (first, second) = self.moments.entry(name.clone()).or_insert_with(zeros);
            let shrink = if name.ends_with(".weight") { 1.0 - rate * decay } else { 1.0 };
            let mut values: Vec<f32> = variable.flatten_all()?.to_vec1()?;
            for (i, value) in values.iter_mut().enumerate() {
                let g = f64::from(gradient[i]) * clip;
                let m = BETA_1 * f64::from(first[i]) + (1.0 - BETA_1) * g;
                let v = BETA_2 * f64::from(second[i]) + (1.0 - BETA_2) * g * g;
                (first[i], second[i]) = (m as f32, v as f32);
                let step = rate * (m / bias_1) / ((v / bias_2).sqrt() + EPSILON);
                *value = (f64::from(*value) * shrink - step) as f32;
            }
            variable.set(&Tensor::from_vec(values, variable.shape(), &Device::Cpu)?)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottom_of_a_bowl_is_found() {
        let x = Var::from_vec(vec![3.0f32, -2.0], 2, &Device::Cpu).unwrap();
        let target = Tensor::from_vec(vec![1.0f32, 0.5], 2, &Device::Cpu).unwrap();
        let variables = BTreeMap::from([("x.bias".to_owned(), x.clone())]);
        let mut adam = Adam::default();
        for step in 0..2000 {
            let loss = (x.as_tensor() - &target).unwrap().sqr().unwrap().sum_all().unwrap();
            let rate = 0.05 * (1.0 - f64::from(step) / 2000.0);
            adam.update(&variables, &loss.backward().unwrap(), rate, 0.0).unwrap();
        }
        let found: Vec<f32> = x.to_vec1().unwrap();
        assert!((found[0] - 1.0).abs() < 1e-3 && (found[1] - 0.5).abs() < 1e-3, "{found:?}");
    }

    /// The oracle: candle-nn's own AdamW, which works on tensors and shares no code with the loop above.
    #[test]
    fn every_step_is_that_of_candles_adamw() {
        use candle_nn::{AdamW, Optimizer, ParamsAdamW};
        let start = || Var::from_vec(vec![0.3f32, -0.2, 0.9, -1.1], 4, &Device::Cpu).unwrap();
        let target = Tensor::from_vec(vec![0.1f32, 0.5, -0.4, 0.2], 4, &Device::Cpu).unwrap();
        let (ours, theirs) = (start(), start());
        let gradients = |x: &Var| {
            (x.as_tensor() - &target).unwrap().sqr().unwrap().sum_all().unwrap().backward().unwrap()
        };
        let settings =
            ParamsAdamW { lr: 0.01, beta1: BETA_1, beta2: BETA_2, eps: EPSILON, weight_decay: 0.1 };
        let mut oracle = AdamW::new(vec![theirs.clone()], settings).unwrap();
        let mut adam = Adam::default();
        let variables = BTreeMap::from([("x.weight".to_owned(), ours.clone())]);
        for step in 0..300 {
            adam.update(&variables, &gradients(&ours), 0.01, 0.1).unwrap();
            oracle.step(&gradients(&theirs)).unwrap();
            let (a, b): (Vec<f32>, Vec<f32>) = (ours.to_vec1().unwrap(), theirs.to_vec1().unwrap());
            for (a, b) in a.iter().zip(&b) {
                // Single precision in different order: a few units of the last place for each step.
                assert!((a - b).abs() < 1e-5, "step {step}: {a} != {b}");
            }
        }
    }
}
