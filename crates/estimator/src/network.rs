//! The network as it listens: normalisations folded into the layers that follow, plain arrays throughout.

use crate::block::{forward_sample, pack_forward};
use crate::config::{NetworkConfig, Summary};
use crate::correlate::PackedWeights;
use crate::parameters::Parameters;
use crate::shape::BlockShape;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Added to the variance in batch normalisation.
pub(crate) const EPSILON: f64 = 1e-5;

/// A network ready for inference. It is `Sync`: one serves all threads.
#[derive(Clone, Debug)]
pub struct Network {
    config: NetworkConfig,
    blocks: Vec<(BlockShape, PackedWeights, Vec<f32>)>,
    dense: Vec<Dense>,
}

/// A dense layer, weights `[input][output]`.
#[derive(Clone, Debug)]
struct Dense {
    weights: Vec<f32>,
    bias: Vec<f32>,
    rectify: bool,
}

impl Network {
    /// Folds the parameters.
    pub fn new(parameters: &Parameters) -> Self {
        let config = parameters.config().clone();
        // What the normalisation of the block before does to each of its channels.
        let mut gain = vec![1.0f64];
        let mut offset = vec![0.0f64];
        let mut blocks = Vec::new();
        for (i, shape) in config.shapes().into_iter().enumerate() {
            let taps = shape.taps();
            let mut weights = parameters.block_tensor(i, "conv.weight").to_vec();
            let mut bias = Vec::with_capacity(shape.outputs);
            for (output, filter) in weights.chunks_exact_mut(shape.inputs * taps).enumerate() {
                let mut total = f64::from(parameters.block_tensor(i, "conv.bias")[output]);
                for (input, filter) in filter.chunks_exact_mut(taps).enumerate() {
                    for weight in filter {
                        total += f64::from(*weight) * offset[input];
                        *weight = (f64::from(*weight) * gain[input]) as f32;
                    }
                }
                bias.push(total as f32);
            }
            blocks.push((shape, pack_forward(shape, &weights), bias));
            let part = |part| parameters.block_tensor(i, part).iter().map(|v| f64::from(*v));
            gain = part("norm.scale")
                .zip(part("norm.running_variance"))
                .map(|(scale, variance)| scale / (variance + EPSILON).sqrt())
                .collect();
            offset = part("norm.shift")
                .zip(part("norm.running_mean").zip(&gain))
                .map(|(shift, (mean, gain))| shift - mean * gain)
                .collect();
        }
        let from_blocks = config.block_summary_len();
        let per_channel = from_blocks / gain.len();
        let names: &[&str] = if config.hidden.is_some() { &["hidden", "output"] } else { &["output"] };
        let mut dense: Vec<Dense> = Vec::new();
        for (layer, name) in names.iter().enumerate() {
            let bias = parameters.tensor(&format!("{name}.bias"));
            let weights = parameters.tensor(&format!("{name}.weight"));
            let (outputs, inputs) = (bias.len(), weights.len() / bias.len());
            let mut transposed = vec![0.0; weights.len()];
            let mut folded = Vec::with_capacity(outputs);
            for output in 0..outputs {
                let mut total = f64::from(bias[output]);
                for input in 0..inputs {
                    let weight = f64::from(weights[output * inputs + input]);
                    let channel =
                        if layer == 0 && input < from_blocks { Some(input / per_channel) } else { None };
                    total += channel.map_or(0.0, |c| weight * offset[c]);
                    transposed[input * outputs + output] = (weight * channel.map_or(1.0, |c| gain[c])) as f32;
                }
                folded.push(total as f32);
            }
            dense.push(Dense { weights: transposed, bias: folded, rectify: layer + 1 < names.len() });
        }
        Self { config, blocks, dense }
    }

    /// The configuration.
    pub fn config(&self) -> &NetworkConfig {
        &self.config
    }

    /// Number of input values of one sample: mel bands times frames.
    pub fn input_len(&self) -> usize {
        self.config.mels * self.config.frames
    }

    /// Outputs for one normalised input, `[mel][frame]`.
    ///
    /// # Panics
    /// If `input` does not hold [`Network::input_len`] values.
    pub fn infer(&self, input: &[f32]) -> Vec<f32> {
        self.infer_with_scratch(input, &mut Scratch::default())
    }

    /// The same without allocating anything but the outputs.
    ///
    /// # Panics
    /// As [`Network::infer`].
    pub fn infer_with_scratch(&self, input: &[f32], scratch: &mut Scratch) -> Vec<f32> {
        assert_eq!(input.len(), self.input_len(), "mel bands times frames");
        let Scratch { a, b, convolved, summary } = scratch;
        for (i, (shape, weights, bias)) in self.blocks.iter().enumerate() {
            b.resize(shape.output_len(), 0.0);
            forward_sample(*shape, weights, bias, if i == 0 { input } else { a }, b, None, convolved);
            std::mem::swap(a, b);
        }
        let Some((last, _, _)) = self.blocks.last() else { return Vec::new() };
        summary.clear();
        summarise(&self.config, *last, &a[..last.output_len()], summary);
        if self.config.spectrum {
            spectrum(input, self.config.frames, summary);
        }
        let mut values = summary.clone();
        for dense in &self.dense {
            values = DenseCall { dense, x: &values }.run();
        }
        values
    }

    /// Outputs for a batch of inputs one after the other, `[sample][output]`, on all threads; the same on any number.
    ///
    /// # Panics
    /// If `inputs` is not a whole number of samples.
    pub fn infer_batch(&self, inputs: &[f32]) -> Vec<f32> {
        assert_eq!(inputs.len() % self.input_len(), 0, "whole samples");
        inputs
            .par_chunks_exact(self.input_len())
            .map_init(Scratch::default, |scratch, input| self.infer_with_scratch(input, scratch))
            .collect::<Vec<_>>()
            .concat()
    }
}

/// Buffers that a thread reuses from call to call.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    a: Vec<f32>,
    b: Vec<f32>,
    convolved: Vec<f32>,
    summary: Vec<f32>,
}

fn summarise(config: &NetworkConfig, last: BlockShape, planes: &[f32], out: &mut Vec<f32>) {
    match config.summary {
        Summary::Flatten => out.extend_from_slice(planes),
        Summary::TimeMean => {
            let columns = last.pooled().1;
            out.extend(planes.chunks_exact(columns).map(|row| row.iter().sum::<f32>() / columns as f32));
        }
    }
}

/// Mean over time of each mel band, then the standard deviation of each.
pub(crate) fn spectrum(input: &[f32], frames: usize, out: &mut Vec<f32>) {
    let moments = |row: &[f32]| {
        let mean = row.iter().map(|v| f64::from(*v)).sum::<f64>() / frames as f64;
        let variance = row.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / frames as f64;
        (mean as f32, variance.sqrt() as f32)
    };
    let moments: Vec<_> = input.chunks_exact(frames).map(moments).collect();
    out.extend(moments.iter().map(|m| m.0));
    out.extend(moments.iter().map(|m| m.1));
}

struct DenseCall<'a> {
    dense: &'a Dense,
    x: &'a [f32],
}

impl DenseCall<'_> {
    fn run(self) -> Vec<f32> {
        Arch::new().dispatch(self)
    }
}

impl WithSimd for DenseCall<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<f32> {
        let Dense { weights, bias, rectify } = self.dense;
        let mut y = bias.clone();
        for (&x, weights) in self.x.iter().zip(weights.chunks_exact(bias.len())) {
            for (y, w) in y.iter_mut().zip(weights) {
                *y += x * w;
            }
        }
        if *rectify {
            for y in &mut y {
                // NaN passes through, so that a broken network shows.
                *y = if *y < 0.0 { 0.0 } else { *y };
            }
        }
        y
    }
}
