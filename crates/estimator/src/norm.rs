//! Batch normalisation of a batch `[sample][channel][position]`, forward and backward.

use pulp::Arch;
use rayon::prelude::*;

/// Mean and reciprocal standard deviation of each channel over a batch.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct BatchMoments {
    pub mean: Vec<f32>,
    /// Biased variance (the one that normalises).
    pub variance: Vec<f32>,
}

impl BatchMoments {
    /// 1 / sqrt(variance + epsilon) of a channel.
    pub fn inverse_deviation(&self, channel: usize, epsilon: f64) -> f32 {
        (1.0 / (f64::from(self.variance[channel]) + epsilon).sqrt()) as f32
    }
}

/// Sum of `f` over positions with a fixed order of additions: sixteen lanes in chunks, the chunks in double precision.
pub(crate) fn lane_sum<const N: usize>(inputs: [&[f32]; N], f: impl Fn([f32; N]) -> f32) -> f64 {
    Arch::new().dispatch(
        #[inline(always)]
        || lane_sum_inline(inputs, f),
    )
}

#[inline(always)]
fn lane_sum_inline<const N: usize>(inputs: [&[f32]; N], f: impl Fn([f32; N]) -> f32) -> f64 {
    const LANES: usize = 16;
    const CHUNK: usize = 256;
    let length = inputs[0].len();
    let mut total = 0.0f64;
    let mut from = 0;
    while from < length {
        let to = (from + CHUNK).min(length);
        let mut sums = [0.0f32; LANES];
        let mut p = from;
        while p + LANES <= to {
            let rows: [&[f32]; N] = std::array::from_fn(|n| &inputs[n][p..p + LANES]);
            for j in 0..LANES {
                sums[j] += f(std::array::from_fn(|n| rows[n][j]));
            }
            p += LANES;
        }
        for q in p..to {
            sums[q - p] += f(std::array::from_fn(|n| inputs[n][q]));
        }
        total += sums.iter().map(|s| f64::from(*s)).sum::<f64>();
        from = to;
    }
    total
}

/// Sums over the batch, channel by channel, of what `per_plane` gives for each plane; in the order of the samples.
fn channel_sums<const K: usize>(
    samples: usize,
    channels: usize,
    per_plane: impl Fn(usize, usize) -> [f64; K] + Sync,
) -> Vec<[f64; K]> {
    let rows: Vec<Vec<[f64; K]>> = (0..samples)
        .into_par_iter()
        .map(|sample| (0..channels).map(|channel| per_plane(sample, channel)).collect())
        .collect();
    let mut totals = vec![[0.0; K]; channels];
    for row in &rows {
        for (total, value) in totals.iter_mut().zip(row) {
            for k in 0..K {
                total[k] += value[k];
            }
        }
    }
    totals
}

/// Writes the normalised, scaled and shifted batch to `y`; gives the moments it was normalised by.
pub(crate) fn forward(
    x: &[f32],
    channels: usize,
    positions: usize,
    scale: &[f32],
    shift: &[f32],
    epsilon: f64,
    y: &mut [f32],
) -> BatchMoments {
    let sample_len = channels * positions;
    let samples = x.len() / sample_len;
    let count = (samples * positions) as f64;
    let plane = |sample: usize, channel: usize| &x[sample * sample_len + channel * positions..][..positions];
    let mean: Vec<f64> = channel_sums(samples, channels, |s, c| [lane_sum([plane(s, c)], |[v]| v)])
        .into_iter()
        .map(|[sum]| sum / count)
        .collect();
    let variance: Vec<f64> = channel_sums(samples, channels, |s, c| {
        let mean = mean[c] as f32;
        [lane_sum([plane(s, c)], |[v]| (v - mean) * (v - mean))]
    })
    .into_iter()
    .map(|[sum]| sum / count)
    .collect();
    let moments = BatchMoments {
        mean: mean.into_iter().map(|m| m as f32).collect(),
        variance: variance.into_iter().map(|v| v as f32).collect(),
    };
    y.par_chunks_exact_mut(sample_len).zip(x.par_chunks_exact(sample_len)).for_each(|(y, x)| {
        let planes = y.chunks_exact_mut(positions).zip(x.chunks_exact(positions));
        for (channel, (y, x)) in planes.enumerate() {
            let gain = scale[channel] * moments.inverse_deviation(channel, epsilon);
            let (mean, shift) = (moments.mean[channel], shift[channel]);
            Arch::new().dispatch(|| {
                for (y, x) in y.iter_mut().zip(x) {
                    *y = (x - mean) * gain + shift;
                }
            });
        }
    });
    moments
}

/// The way back of [`forward`]: the moments depend on the batch, and so their gradient flows too. `gradient` is that of the
/// output on entry and that of the input on return; gives the gradients of scale and shift.
pub(crate) fn backward(
    x: &[f32],
    channels: usize,
    positions: usize,
    scale: &[f32],
    moments: &BatchMoments,
    epsilon: f64,
    gradient: &mut [f32],
) -> (Vec<f32>, Vec<f32>) {
    let sample_len = channels * positions;
    let samples = x.len() / sample_len;
    let count = (samples * positions) as f64;
    let start = |sample: usize, channel: usize| sample * sample_len + channel * positions;
    let sums = channel_sums(samples, channels, |s, c| {
        let g = &gradient[start(s, c)..][..positions];
        let x = &x[start(s, c)..][..positions];
        let (mean, inverse) = (moments.mean[c], moments.inverse_deviation(c, epsilon));
        [lane_sum([g], |[g]| g), lane_sum([g, x], |[g, x]| g * (x - mean) * inverse)]
    });
    gradient.par_chunks_exact_mut(sample_len).zip(x.par_chunks_exact(sample_len)).for_each(|(g, x)| {
        let planes = g.chunks_exact_mut(positions).zip(x.chunks_exact(positions));
        for (channel, (g, x)) in planes.enumerate() {
            let (mean, inverse) = (moments.mean[channel], moments.inverse_deviation(channel, epsilon));
            let gain = scale[channel] * inverse;
            let mean_g = (sums[channel][0] / count) as f32;
            let mean_gx = (sums[channel][1] / count) as f32;
            Arch::new().dispatch(|| {
                for (g, x) in g.iter_mut().zip(x) {
                    *g = gain * (*g - mean_g - (x - mean) * inverse * mean_gx);
                }
            });
        }
    });
    (sums.iter().map(|s| s[1] as f32).collect(), sums.iter().map(|s| s[0] as f32).collect())
}
