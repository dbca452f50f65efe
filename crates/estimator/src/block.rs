//! Convolution, ReLU and max pooling of a batch, forward and backward.

use crate::correlate::{Correlate, CorrelateWeights, PackedWeights};
use crate::norm::lane_sum;
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
        PoolRow { shape, convolved: scratch, convolved_stride: span, out, marks: marks.as_deref_mut(), row }
            .run();
    }
}

/// A batch forward: pooled planes and the marks of where each maximum was.
pub(crate) fn forward(
    shape: BlockShape,
    x: &[f32],
    weights: &[f32],
    bias: &[f32],
    out: &mut [f32],
    marks: &mut [u8],
) {
    let packed = pack_forward(shape, weights);
    out.par_chunks_exact_mut(shape.output_len())
        .zip(marks.par_chunks_exact_mut(shape.output_len()))
        .zip(x.par_chunks_exact(shape.input_len()))
        .for_each_init(Vec::new, |scratch, ((out, marks), x)| {
            forward_sample(shape, &packed, bias, x, out, Some(marks), scratch);
        });
}

/// What the way back of a block reads.
#[derive(Clone, Copy)]
pub(crate) struct BlockBackward<'a> {
    pub shape: BlockShape,
    pub x: &'a [f32],
    pub weights: &'a [f32],
    pub marks: &'a [u8],
    /// Gradient of the pooled planes.
    pub gradient: &'a [f32],
}

/// A batch backward: adds the gradients of weights and bias (one after the other) to `out`, and writes that of the input
/// to `gx` where it is asked for. Sums over the batch run in the order of the samples.
pub(crate) fn backward(block: BlockBackward<'_>, out: &mut [f32], gx: Option<&mut [f32]>) {
    let shape = block.shape;
    let packed = pack_backward(shape, block.weights);
    let samples = block.x.len() / shape.input_len();
    // One row of gradients for each sample: added up afterwards in a fixed order.
    let row = shape.weights() + shape.outputs;
    let mut rows = vec![0.0f32; samples * row];
    if let Some(gx) = gx {
        rows.par_chunks_exact_mut(row)
            .zip(gx.par_chunks_exact_mut(shape.input_len()))
            .enumerate()
            .for_each_init(Vec::new, |scratch, (sample, (out, gx))| {
                backward_sample(block, sample, &packed, out, Some(gx), scratch);
            });
    } else {
        rows.par_chunks_exact_mut(row).enumerate().for_each_init(Vec::new, |scratch, (sample, out)| {
            backward_sample(block, sample, &packed, out, None, scratch);
        });
    }
    let mut total = vec![0.0f64; row];
    for row in rows.chunks_exact(row) {
        for (total, value) in total.iter_mut().zip(row) {
            *total += f64::from(*value);
        }
    }
    for (out, total) in out.iter_mut().zip(total) {
        *out += total as f32;
    }
}

fn backward_sample(
    block: BlockBackward<'_>,
    sample: usize,
    packed: &PackedWeights,
    out: &mut [f32],
    gx: Option<&mut [f32]>,
    scratch: &mut Vec<f32>,
) {
    let shape = block.shape;
    let x = &block.x[sample * shape.input_len()..][..shape.input_len()];
    let gradient = &block.gradient[sample * shape.output_len()..][..shape.output_len()];
    let marks = &block.marks[sample * shape.output_len()..][..shape.output_len()];
    let offsets = shape.offsets();
    let reach = reach(&offsets);
    let stride = reach + shape.plane();
    // Unpooling writes every position that it reaches, and no other is ever written: zeros stay zeros.
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
        offsets: &offsets,
        gradient: weights,
        length: shape.span(),
    }
    .run();
    for (plane, bias) in bias.iter_mut().enumerate() {
        *bias = lane_sum([&scratch[plane * stride..(plane + 1) * stride]], |[g]| g) as f32;
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
