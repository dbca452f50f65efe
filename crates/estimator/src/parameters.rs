//! The numbers of a network, as plain arrays.

use crate::config::NetworkConfig;
use crate::{Error, WeightsFault};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::collections::BTreeMap;

/// Every tensor of a network by name, row by row, with the configuration that they fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    config: NetworkConfig,
    tensors: BTreeMap<String, Vec<f32>>,
}

impl Parameters {
    /// Random weights (He et al. 2015: uniform with variance 2 / inputs, and 1 / inputs for the output layer), biases and
    /// shifts 0, scales 1.
    ///
    /// # Errors
    /// [`Error::Config`] for a configuration that cannot be.
    pub fn random(config: &NetworkConfig, seed: u64) -> Result<Self, Error> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut tensors = BTreeMap::new();
        for (name, shape) in config.parameter_shapes()? {
            let count = shape.iter().product();
            let values = if name.ends_with(".weight") {
                let inputs: usize = shape[1..].iter().product();
                let gain = if name.starts_with("output") { 1.0 } else { 2.0 };
                let limit = (3.0 * gain / inputs as f64).sqrt() as f32;
                (0..count).map(|_| rng.random_range(-limit..limit)).collect()
            } else if name.ends_with("norm.scale") || name.ends_with("running_variance") {
                vec![1.0; count]
            } else {
                vec![0.0; count]
            };
            tensors.insert(name, values);
        }
        Ok(Self { config: config.clone(), tensors })
    }

    /// Takes tensors and checks that they are those of the configuration, and finite.
    ///
    /// # Errors
    /// [`Error::Config`], or [`Error::Weights`] naming the tensor.
    pub fn new(config: NetworkConfig, tensors: BTreeMap<String, Vec<f32>>) -> Result<Self, Error> {
        let fault = |fault| Error::Weights { name: "in memory".into(), fault: Box::new(fault) };
        for (name, shape) in config.parameter_shapes()? {
            let Some(values) = tensors.get(&name) else {
                return Err(fault(WeightsFault::Missing { tensor: name }));
            };
            if values.len() != shape.iter().product::<usize>() {
                let found = vec![values.len()];
                let found_type = "F32".into();
                return Err(fault(WeightsFault::Shape { tensor: name, found_type, found, expected: shape }));
            }
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(fault(WeightsFault::NotFinite { tensor: name, index }));
            }
        }
        Ok(Self { config, tensors })
    }

    /// The configuration.
    pub fn config(&self) -> &NetworkConfig {
        &self.config
    }

    /// The tensors, by name.
    pub fn tensors(&self) -> &BTreeMap<String, Vec<f32>> {
        &self.tensors
    }

    /// A tensor that the configuration promises; empty for any other name.
    pub(crate) fn tensor(&self, name: &str) -> &[f32] {
        self.tensors.get(name).map_or(&[], Vec::as_slice)
    }

    /// One of block `index`, from 0.
    pub(crate) fn block_tensor(&self, index: usize, part: &str) -> &[f32] {
        self.tensor(&format!("block{}.{part}", index + 1))
    }
}
