//! The network as it learns: a candle graph whose blocks are this crate's own kernels.
//!
//! candle's max-pool gradient is wrong and its convolutions are slow at these sizes; everything with a gradient of its own
//! here is checked against central differences of a naive network in double precision (`tests` below).

use crate::Error;
use crate::config::{NetworkConfig, Summary, is_running};
use crate::network::spectrum;
use crate::norm::BatchMoments;
use crate::parameters::Parameters;
use crate::stack::{Stack, Workspace};
use candle_core::{D, Device, Tensor, Var};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Weight of the newest batch in the running moments.
const MOMENTUM: f32 = 0.05;

/// The trainable network.
pub(crate) struct Graph {
    config: NetworkConfig,
    variables: BTreeMap<String, Var>,
    running: Vec<BatchMoments>,
    workspace: Arc<Mutex<Workspace>>,
}

impl Graph {
    pub fn new(parameters: &Parameters) -> Result<Self, Error> {
        let config = parameters.config().clone();
        let mut variables = BTreeMap::new();
        for (name, shape) in config.parameter_shapes()? {
            if !is_running(&name) {
                let values = parameters.tensor(&name).to_vec();
                variables.insert(name, Var::from_vec(values, shape, &Device::Cpu)?);
            }
        }
        let running = (0..config.blocks.len())
            .map(|i| BatchMoments {
                mean: parameters.block_tensor(i, "norm.running_mean").to_vec(),
                variance: parameters.block_tensor(i, "norm.running_variance").to_vec(),
            })
            .collect();
        Ok(Self { config, variables, running, workspace: Arc::default() })
    }

    /// The trained tensors, by name.
    pub fn variables(&self) -> &BTreeMap<String, Var> {
        &self.variables
    }

    /// All numbers, as plain arrays.
    pub fn parameters(&self) -> Result<Parameters, Error> {
        let mut tensors = BTreeMap::new();
        for (name, variable) in &self.variables {
            tensors.insert(name.clone(), variable.as_tensor().flatten_all()?.to_vec1::<f32>()?);
        }
        for (i, moments) in self.running.iter().enumerate() {
            tensors.insert(format!("block{}.norm.running_mean", i + 1), moments.mean.clone());
            tensors.insert(format!("block{}.norm.running_variance", i + 1), moments.variance.clone());
        }
        Parameters::new(self.config.clone(), tensors)
    }

    /// Outputs `[sample, output]` for a batch of inputs that `fill` writes; updates the running moments. `keep` holds a
    /// factor for each value that reaches the dense layers (dropout), or nothing.
    pub fn forward(
        &mut self,
        fill: impl FnOnce(&mut Vec<f32>),
        keep: Option<Vec<f32>>,
    ) -> Result<Tensor, Error> {
        let (mels, frames) = (self.config.mels, self.config.frames);
        let mut statistics = Vec::new();
        let samples = {
            let mut workspace = self.workspace.lock().unwrap_or_else(PoisonError::into_inner);
            let inputs = workspace.input_mut();
            fill(inputs);
            if self.config.spectrum {
                inputs.chunks_exact(mels * frames).for_each(|input| spectrum(input, frames, &mut statistics));
            }
            inputs.len() / (mels * frames)
        };
        let parameters: Vec<Tensor> = (0..self.config.blocks.len())
            .flat_map(|i| {
                ["conv.weight", "conv.bias", "norm.scale", "norm.shift"]
                    .map(|part| self.variables[&format!("block{}.{part}", i + 1)].flatten_all())
            })
            .collect::<Result<_, _>>()?;
        let stack = Stack { shapes: self.config.shapes(), workspace: self.workspace.clone() };
        let x = Tensor::cat(&parameters, 0)?.apply_op1(stack)?;
        let workspace = self.workspace.lock().unwrap_or_else(PoisonError::into_inner);
        for (running, batch) in self.running.iter_mut().zip(workspace.moments()) {
            update(running, batch);
        }
        drop(workspace);
        let x = match self.config.summary {
            Summary::Flatten => x,
            Summary::TimeMean => x.mean(D::Minus1)?,
        };
        let mut x = x.flatten_from(1)?;
        if self.config.spectrum {
            let statistics = Tensor::from_vec(statistics, (samples, 2 * mels), &Device::Cpu)?;
            x = Tensor::cat(&[&x, &statistics], 1)?;
        }
        if let Some(keep) = keep {
            x = (x * Tensor::from_vec(keep, (samples, self.config.summary_len()), &Device::Cpu)?)?;
        }
        if self.config.hidden.is_some() {
            x = self.dense(&x, "hidden")?.relu()?;
        }
        self.dense(&x, "output")
    }

    fn dense(&self, x: &Tensor, name: &str) -> Result<Tensor, Error> {
        let weight = self.variables[&format!("{name}.weight")].as_tensor();
        let bias = self.variables[&format!("{name}.bias")].as_tensor();
        Ok(x.matmul(&weight.t()?)?.broadcast_add(bias)?)
    }
}

/// Moves the running moments towards those of a batch.
fn update(running: &mut BatchMoments, batch: &BatchMoments) {
    let pairs = running.mean.iter_mut().zip(&batch.mean);
    for (running, batch) in pairs.chain(running.variance.iter_mut().zip(&batch.variance)) {
        *running += MOMENTUM * (batch - *running);
    }
}

#[cfg(test)]
#[path = "graph_tests.rs"]
mod tests;
