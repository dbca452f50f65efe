//! All blocks of a batch as one operation of the graph, with buffers that live from step to step.

use crate::block::{self, BlockBackward};
use crate::network::EPSILON;
use crate::norm::{self, BatchMoments};
use crate::shape::BlockShape;
use candle_core::{CpuStorage, CustomOp1, Device, Layout, Shape, Storage, Tensor};
use std::sync::{Arc, Mutex, PoisonError};

/// Buffers of one block for a batch.
#[derive(Default)]
struct Layer {
    /// After pooling.
    pooled: Vec<f32>,
    marks: Vec<u8>,
    /// After normalisation: the input of the next block.
    normal: Vec<f32>,
    moments: BatchMoments,
}

/// Buffers of all blocks. Large vectors that are freed go back to the system and come again page by page: at these sizes that
/// costs as much as the arithmetic.
#[derive(Default)]
pub(crate) struct Workspace {
    input: Vec<f32>,
    layers: Vec<Layer>,
    gradient: Vec<f32>,
    other: Vec<f32>,
}

impl Workspace {
    /// The buffer of the normalised input, `[sample][mel][frame]`.
    pub fn input_mut(&mut self) -> &mut Vec<f32> {
        &mut self.input
    }

    /// Moments of each block in the last batch.
    pub fn moments(&self) -> impl Iterator<Item = &BatchMoments> {
        self.layers.iter().map(|layer| &layer.moments)
    }
}

/// The blocks as a function of their parameters, one after the other in one tensor: for each block the filters, their
/// biases, and the scales and shifts of the normalisation. The input lies in the workspace.
pub(crate) struct Stack {
    pub shapes: Vec<BlockShape>,
    pub workspace: Arc<Mutex<Workspace>>,
}

/// The parameters of one block.
struct BlockParameters<'a> {
    weights: &'a [f32],
    bias: &'a [f32],
    scale: &'a [f32],
    shift: &'a [f32],
}

impl Stack {
    /// Number of parameters of one block.
    fn count(shape: BlockShape) -> usize {
        shape.weights() + 3 * shape.outputs
    }

    fn split(shape: BlockShape, parameters: &[f32]) -> (BlockParameters<'_>, &[f32]) {
        let (weights, rest) = parameters.split_at(shape.weights());
        let (bias, rest) = rest.split_at(shape.outputs);
        let (scale, rest) = rest.split_at(shape.outputs);
        let (shift, rest) = rest.split_at(shape.outputs);
        (BlockParameters { weights, bias, scale, shift }, rest)
    }

    fn forward(&self, parameters: &[f32]) -> (Vec<f32>, Shape) {
        let mut workspace = self.workspace.lock().unwrap_or_else(PoisonError::into_inner);
        let Workspace { input, layers, .. } = &mut *workspace;
        let samples = self.shapes.first().map_or(0, |shape| input.len() / shape.input_len());
        layers.resize_with(self.shapes.len(), Layer::default);
        let mut rest = parameters;
        for (i, &shape) in self.shapes.iter().enumerate() {
            let (block, next) = Self::split(shape, rest);
            rest = next;
            let (before, after) = layers.split_at_mut(i);
            let x = before.last().map_or(input.as_slice(), |layer| layer.normal.as_slice());
            let Some(layer) = after.first_mut() else { break };
            let length = samples * shape.output_len();
            layer.pooled.resize(length, 0.0);
            layer.marks.resize(length, 0);
            layer.normal.resize(length, 0.0);
            block::forward(shape, x, block.weights, block.bias, &mut layer.pooled, &mut layer.marks);
            let positions = shape.output_len() / shape.outputs;
            layer.moments = norm::forward(
                &layer.pooled,
                shape.outputs,
                positions,
                block.scale,
                block.shift,
                EPSILON,
                &mut layer.normal,
            );
        }
        let out = layers.last().map_or_else(Vec::new, |layer| layer.normal.clone());
        let (channels, (rows, columns)) = self.shapes.last().map_or((0, (0, 0)), |s| (s.outputs, s.pooled()));
        (out, Shape::from((samples, channels, rows, columns)))
    }

    /// Gradient of the parameters, given that of the output.
    fn backward(&self, parameters: &[f32], gradient: &[f32]) -> Vec<f32> {
        let mut workspace = self.workspace.lock().unwrap_or_else(PoisonError::into_inner);
        let Workspace { input, layers, gradient: current, other } = &mut *workspace;
        current.clear();
        current.extend_from_slice(gradient);
        let mut result = vec![0.0; parameters.len()];
        let mut end = parameters.len();
        for (i, &shape) in self.shapes.iter().enumerate().rev() {
            let start = end - Self::count(shape);
            let (block, _) = Self::split(shape, &parameters[start..end]);
            let layer = &layers[i];
            let (convolution, normalisation) =
                result[start..end].split_at_mut(shape.weights() + shape.outputs);
            let (scale, shift) = norm::backward(
                &layer.pooled,
                shape.outputs,
                shape.output_len() / shape.outputs,
                block.scale,
                &layer.moments,
                EPSILON,
                current,
            );
            normalisation[..shape.outputs].copy_from_slice(&scale);
            normalisation[shape.outputs..].copy_from_slice(&shift);
            let x = if i == 0 { input.as_slice() } else { layers[i - 1].normal.as_slice() };
            let back =
                BlockBackward { shape, x, weights: block.weights, marks: &layer.marks, gradient: current };
            if i == 0 {
                block::backward(back, convolution, None);
            } else {
                other.resize(x.len(), 0.0);
                block::backward(back, convolution, Some(other));
                std::mem::swap(current, other);
            }
            end = start;
        }
        result
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
fn with_floats<R>(
    tensor: &Tensor,
    f: impl FnOnce(&[f32]) -> candle_core::Result<R>,
) -> candle_core::Result<R> {
    let tensor = tensor.contiguous()?;
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(storage) => f(floats(storage, layout)?),
        _ => candle_core::bail!("a tensor on the CPU is needed"),
    }
}

impl CustomOp1 for Stack {
    fn name(&self) -> &'static str {
        "blocks"
    }

    fn cpu_fwd(&self, parameters: &CpuStorage, layout: &Layout) -> candle_core::Result<(CpuStorage, Shape)> {
        let (out, shape) = self.forward(floats(parameters, layout)?);
        Ok((CpuStorage::F32(out), shape))
    }

    fn bwd(&self, parameters: &Tensor, _: &Tensor, gradient: &Tensor) -> candle_core::Result<Option<Tensor>> {
        let result = with_floats(parameters, |parameters| {
            with_floats(gradient, |gradient| Ok(self.backward(parameters, gradient)))
        })?;
        Ok(Some(Tensor::from_vec(result, parameters.shape(), &Device::Cpu)?))
    }
}
