//! Convolution, ReLU and max pooling of a batch, forward and backward.

use crate::correlate::{Correlate, CorrelateWeights, PackedWeights};
use crate::pool::{PoolRow, Unpool};
use crate::shape::BlockShape;
use rayon::prelude::*;

/// Packs weights `[output][input][row][column]` for the way forward.
pub(crate) fn pack_forward(shape: BlockShape, weights: &[f32]) -> PackedWeights {
    let taps = shape.taps();
    PackedWeights::new(shape.outputs, shape.inputs, shape.offsets(), |output, input, tap| {
        weights[(output * shape.inputs + input) * taps + tap]
    })
}

/// Packs the same weights for the gradient of the input: the roles of input and output change, and so does the direction.
fn pack_backward(shape: BlockShape, weights: &[f32]) -> PackedWeights {
    let taps = shape.taps();
    let offsets = shape.offsets();
    let reach = reach(&offsets);
    let reversed = offsets.iter().map(|offset| reach - offset).collect();
    PackedWeights::new(shape.inputs, shape.outputs, reversed, |input, output, tap| {
        weights[(output * shape.inputs + input) * taps + tap]
    })
}

fn reach(offsets: &[usize]) -> usize {
    offsets.last().copied().unwrap_or(0)
}

/// One sample forward. `scratch` is reused between calls.
pub(crate) fn forward_sample(
    shape: BlockShape,
    packed: &PackedWeights,
    bias: &[f32],
    x: &[f32],
    out: &mut [f32],
    mut marks: Option<&mut [u8]>,
    scratch: &mut Vec<f32>,
) {
    let span = shape.row_span();
    scratch.resize(shape.outputs * span, 0.0);
    for row in 0..shape.pooled().0 {
        Correlate {
            weights: packed,
            bias: Some(bias),
            x: &x[row * shape.pool.0 * shape.width..],
            x_stride: shape.plane(),
            out: scratch,
            out_stride: span,
            length: span,
        }
        .run();
        PoolRow { shape, convolved: scratch, convolved_stride: span, out, marks: marks.as_deref_mut(), row }.run();
    }
}

/// A batch forward: pooled planes and the marks of where each maximum was.
pub(crate) fn forward(shape: BlockShape, x: &[f32], weights: &[f32], bias: &[f32]) -> (Vec<f32>, Vec<u8>) {
    let packed = pack_forward(shape, weights);
    let samples = x.len() / shape.input_len();
    let mut out = vec![0.0; samples * shape.output_len()];
    let mut marks = vec![0u8; out.len()];
    out.par_chunks_exact_mut(shape.output_len())
        .zip(marks.par_chunks_exact_mut(shape.output_len()))
        .zip(x.par_chunks_exact(shape.input_len()))
        .for_each_init(Vec::new, |scratch, ((out, marks), x)| {
            forward_sample(shape, &packed, bias, x, out, Some(marks), scratch);
        });
    (out, marks)
}

/// Gradients of a block.
pub(crate) struct BlockGradients {
    /// With respect to the input, where it was asked for.
    pub x: Option<Vec<f32>>,
    pub weights: Vec<f32>,
    pub bias: Vec<f32>,
}

/// A batch backward, given the gradient of the pooled planes. Sums over the batch run in the order of the samples.
pub(crate) fn backward(
    shape: BlockShape,
    x: &[f32],
    weights: &[f32],
    marks: &[u8],
    gradient: &[f32],
    input_gradient: bool,
) -> BlockGradients {
    let packed = pack_backward(shape, weights);
    let offsets = shape.offsets();
    let samples = x.len() / shape.input_len();
    let mut gx = vec![0.0; if input_gradient { x.len() } else { 0 }];
    // One row of gradients for each sample: added up afterwards in a fixed order.
    let row = shape.weights() + shape.outputs;
    let mut rows = vec![0.0f32; samples * row];
    let one = |scratch: &mut Vec<f32>, index: usize, out: &mut [f32], gx: Option<&mut [f32]>| {
        let x = &x[index * shape.input_len()..][..shape.input_len()];
        let range = index * shape.output_len()..(index + 1) * shape.output_len();
        backward_sample(shape, &packed, &offsets, x, &marks[range.clone()], &gradient[range], out, gx, scratch);
    };
    if input_gradient {
        rows.par_chunks_exact_mut(row)
            .zip(gx.par_chunks_exact_mut(shape.input_len()))
            .enumerate()
            .for_each_init(Vec::new, |scratch, (index, (out, gx))| one(scratch, index, out, Some(gx)));
    } else {
        rows.par_chunks_exact_mut(row)
            .enumerate()
            .for_each_init(Vec::new, |scratch, (index, out)| one(scratch, index, out, None));
    }
    let mut total = vec![0.0f64; row];
    for row in rows.chunks_exact(row) {
        for (total, value) in total.iter_mut().zip(row) {
            *total += f64::from(*value);
        }
    }
    let bias = total.split_off(shape.weights()).into_iter().map(|g| g as f32).collect();
    let weights = total.into_iter().map(|g| g as f32).collect();
    BlockGradients { x: input_gradient.then_some(gx), weights, bias }
}

#[allow(clippy::too_many_arguments)] // the sizes and buffers of one kernel call
fn backward_sample(
    shape: BlockShape,
    packed: &PackedWeights,
    offsets: &[usize],
    x: &[f32],
    marks: &[u8],
    gradient: &[f32],
    out: &mut [f32],
    gx: Option<&mut [f32]>,
    scratch: &mut Vec<f32>,
) {
    let reach = reach(offsets);
    let stride = reach + shape.plane();
    scratch.clear();
    scratch.resize(shape.outputs * stride, 0.0);
    Unpool { shape, gradient, marks, out: scratch, pad: reach }.run();
    let (weights, bias) = out.split_at_mut(shape.weights());
    CorrelateWeights {
        g: &scratch[reach..],
        g_stride: stride,
        outputs: shape.outputs,
        x,
        x_stride: shape.plane(),
        inputs: shape.inputs,
        offsets,
        gradient: weights,
        length: shape.span(),
    }
    .run();
    for (plane, bias) in bias.iter_mut().enumerate() {
        let pooled = shape.output_len() / shape.outputs;
        let range = plane * pooled..(plane + 1) * pooled;
        let passed = gradient[range.clone()].iter().zip(&marks[range]).filter(|(_, mark)| **mark != 0);
        *bias = passed.map(|(g, _)| f64::from(*g)).sum::<f64>() as f32;
    }
    if let Some(gx) = gx {
        Correlate {
            weights: packed,
            bias: None,
            x: scratch,
            x_stride: stride,
            out: gx,
            out_stride: shape.plane(),
            length: shape.plane(),
        }
        .run();
    }
}
