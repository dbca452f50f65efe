//! The network as it learns: a candle graph whose blocks are this crate's own kernels.
//!
//! candle's max-pool gradient is wrong and its convolutions are slow at these sizes; everything with a gradient of its own
//! here is checked against central differences of a naive network in double precision (`tests` below).

use crate::block;
use crate::config::{NetworkConfig, Summary, is_running};
use crate::network::{EPSILON, spectrum};
use crate::norm::{self, BatchMoments};
use crate::parameters::Parameters;
use crate::shape::BlockShape;
use crate::Error;
use candle_core::{CpuStorage, CustomOp3, D, Device, Layout, Shape, Storage, Tensor, Var};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Weight of the newest batch in the running moments.
const MOMENTUM: f32 = 0.05;

/// The trainable network.
pub(crate) struct Graph {
    config: NetworkConfig,
    variables: BTreeMap<String, Var>,
    running: Vec<BatchMoments>,
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
        Ok(Self { config, variables, running })
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

    /// Outputs `[sample, output]` for a batch of normalised inputs; updates the running moments. `keep` holds a factor for
    /// each value that reaches the dense layers (dropout), or nothing.
    pub fn forward(&mut self, inputs: Vec<f32>, keep: Option<Vec<f32>>) -> Result<Tensor, Error> {
        let (mels, frames) = (self.config.mels, self.config.frames);
        let samples = inputs.len() / (mels * frames);
        let mut statistics = Vec::new();
        if self.config.spectrum {
            inputs.chunks_exact(mels * frames).for_each(|input| spectrum(input, frames, &mut statistics));
        }
        let mut x = Tensor::from_vec(inputs, (samples, 1, mels, frames), &Device::Cpu)?;
        let mut saved = Vec::new();
        for (i, shape) in self.config.shapes().into_iter().enumerate() {
            let convolve = ConvReluPool { shape, input_gradient: i > 0, marks: Mutex::default() };
            x = x.apply_op3(self.block(i, "conv.weight"), self.block(i, "conv.bias"), convolve)?;
            let moments = Arc::new(Mutex::new(BatchMoments::default()));
            saved.push(moments.clone());
            x = x.apply_op3(self.block(i, "norm.scale"), self.block(i, "norm.shift"), BatchNorm { moments })?;
        }
        for (running, batch) in self.running.iter_mut().zip(&saved) {
            update(running, &batch.lock().unwrap_or_else(PoisonError::into_inner));
        }
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

    fn block(&self, index: usize, part: &str) -> &Tensor {
        self.variables[&format!("block{}.{part}", index + 1)].as_tensor()
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

/// The floats of a contiguous argument.
fn floats<'a>(storage: &'a CpuStorage, layout: &Layout) -> candle_core::Result<&'a [f32]> {
    let all = storage.as_slice::<f32>()?;
    match layout.contiguous_offsets() {
        Some((start, end)) => Ok(&all[start..end]),
        None => candle_core::bail!("a contiguous tensor is needed"),
    }
}

/// Calls `f` with the floats of a tensor on the CPU.
fn with_floats<R>(tensor: &Tensor, f: impl FnOnce(&[f32]) -> candle_core::Result<R>) -> candle_core::Result<R> {
    let tensor = tensor.contiguous()?;
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(storage) => f(floats(storage, layout)?),
        _ => candle_core::bail!("a tensor on the CPU is needed"),
    }
}

/// Convolution, ReLU and max pooling in one: `(x, weight, bias)`.
struct ConvReluPool {
    shape: BlockShape,
    input_gradient: bool,
    /// Where each maximum was, from the way forward to the way back.
    marks: Mutex<Vec<u8>>,
}

impl CustomOp3 for ConvReluPool {
    fn name(&self) -> &'static str {
        "conv-relu-pool"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let x = floats(x, x_layout)?;
        let samples = x.len() / self.shape.input_len();
        let (out, marks) =
            block::forward(self.shape, x, floats(weight, weight_layout)?, floats(bias, bias_layout)?);
        *self.marks.lock().unwrap_or_else(PoisonError::into_inner) = marks;
        let (rows, columns) = self.shape.pooled();
        Ok((CpuStorage::F32(out), Shape::from((samples, self.shape.outputs, rows, columns))))
    }

    fn bwd(
        &self,
        x: &Tensor,
        weight: &Tensor,
        bias: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let marks = self.marks.lock().unwrap_or_else(PoisonError::into_inner);
        let gradients = with_floats(x, |x| {
            with_floats(weight, |weight| {
                with_floats(gradient, |gradient| {
                    Ok(block::backward(self.shape, x, weight, &marks, gradient, self.input_gradient))
                })
            })
        })?;
        let gx = gradients.x.map(|gx| Tensor::from_vec(gx, x.shape(), &Device::Cpu)).transpose()?;
        let gw = Tensor::from_vec(gradients.weights, weight.shape(), &Device::Cpu)?;
        let gb = Tensor::from_vec(gradients.bias, bias.shape(), &Device::Cpu)?;
        Ok((gx, Some(gw), Some(gb)))
    }
}

/// Batch normalisation: `(x, scale, shift)`.
struct BatchNorm {
    moments: Arc<Mutex<BatchMoments>>,
}

impl CustomOp3 for BatchNorm {
    fn name(&self) -> &'static str {
        "batch-norm"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        scale: &CpuStorage,
        scale_layout: &Layout,
        shift: &CpuStorage,
        shift_layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let (_, channels, rows, columns) = x_layout.shape().dims4()?;
        let (y, moments) = norm::forward(
            floats(x, x_layout)?,
            channels,
            rows * columns,
            floats(scale, scale_layout)?,
            floats(shift, shift_layout)?,
            EPSILON,
        );
        *self.moments.lock().unwrap_or_else(PoisonError::into_inner) = moments;
        Ok((CpuStorage::F32(y), x_layout.shape().clone()))
    }

    fn bwd(
        &self,
        x: &Tensor,
        scale: &Tensor,
        shift: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let (_, channels, rows, columns) = x.dims4()?;
        let moments = self.moments.lock().unwrap_or_else(PoisonError::into_inner);
        let gradients = with_floats(x, |x| {
            with_floats(scale, |scale| {
                with_floats(gradient, |gradient| {
                    Ok(norm::backward(x, channels, rows * columns, scale, &moments, EPSILON, gradient))
                })
            })
        })?;
        Ok((
            Some(Tensor::from_vec(gradients.x, x.shape(), &Device::Cpu)?),
            Some(Tensor::from_vec(gradients.scale, scale.shape(), &Device::Cpu)?),
            Some(Tensor::from_vec(gradients.shift, shift.shape(), &Device::Cpu)?),
        ))
    }
}

#[cfg(test)]
#[path = "graph_tests.rs"]
mod tests;
