//! The inner loops: correlation of many planes with many short filters, and its transpose in the weights.
//!
//! Products are added one by one in a fixed order, never fused: the result is the same to the last bit whatever vector
//! instructions the machine has.

use pulp::{Arch, Simd, WithSimd};

/// Output planes that are computed together.
const PLANES: usize = 4;
/// Lanes of a partial sum in the gradient of the weights.
const LANES: usize = 8;
/// Positions after which the gradient of the weights moves on to other planes, so that all of them stay in the cache.
const SEGMENT: usize = 512;

/// Weights in the order in which the inner loop reads them: `[block of output planes][input][tap][plane in the block]`.
#[derive(Clone, Debug)]
pub(crate) struct PackedWeights {
    values: Vec<f32>,
    outputs: usize,
    inputs: usize,
    offsets: Vec<usize>,
}

impl PackedWeights {
    /// Packs `weight(output, input, tap)`.
    pub fn new(
        outputs: usize,
        inputs: usize,
        offsets: Vec<usize>,
        weight: impl Fn(usize, usize, usize) -> f32,
    ) -> Self {
        let mut values = Vec::with_capacity(outputs * inputs * offsets.len());
        let mut first = 0;
        while first < outputs {
            let block = if outputs - first >= PLANES { PLANES } else { 1 };
            for input in 0..inputs {
                for tap in 0..offsets.len() {
                    values.extend((first..first + block).map(|output| weight(output, input, tap)));
                }
            }
            first += block;
        }
        Self { values, outputs, inputs, offsets }
    }
}

/// `out[o][p] = bias[o] + sum over i and taps of w[o][i][tap] x[i][p + offset(tap)]` for `p < length`.
pub(crate) struct Correlate<'a> {
    pub weights: &'a PackedWeights,
    /// One for each output, or none.
    pub bias: Option<&'a [f32]>,
    pub x: &'a [f32],
    /// Distance between the planes of `x`.
    pub x_stride: usize,
    pub out: &'a mut [f32],
    /// Distance between the planes of `out`.
    pub out_stride: usize,
    pub length: usize,
}

impl Correlate<'_> {
    pub fn run(self) {
        Arch::new().dispatch(self);
    }

    #[inline(always)]
    fn block<const O: usize>(&mut self, first: usize, weights: &[f32]) {
        let mut p = 0;
        while p + 16 <= self.length {
            self.tile::<O, 16>(first, weights, p);
            p += 16;
        }
        if p < self.length && self.length >= 16 {
            // The last tile overlaps the one before: the same values are written again.
            self.tile::<O, 16>(first, weights, self.length - 16);
            p = self.length;
        }
        while p < self.length {
            self.tile::<O, 1>(first, weights, p);
            p += 1;
        }
    }

    #[inline(always)]
    fn tile<const O: usize, const T: usize>(&mut self, first: usize, weights: &[f32], p: usize) {
        let offsets = self.weights.offsets.as_slice();
        let mut sums = [[0.0f32; T]; O];
        if let Some(bias) = self.bias {
            for o in 0..O {
                sums[o] = [bias[first + o]; T];
            }
        }
        for (input, weights) in weights.chunks_exact(offsets.len() * O).enumerate() {
            let x = &self.x[input * self.x_stride + p..];
            for (&offset, weights) in offsets.iter().zip(weights.chunks_exact(O)) {
                let x = &x[offset..offset + T];
                for o in 0..O {
                    for j in 0..T {
                        sums[o][j] += weights[o] * x[j];
                    }
                }
            }
        }
        for o in 0..O {
            let start = (first + o) * self.out_stride + p;
            self.out[start..start + T].copy_from_slice(&sums[o]);
        }
    }
}

impl WithSimd for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let packed = self.weights;
        let per_plane = packed.inputs * packed.offsets.len();
        let mut first = 0;
        while first + PLANES <= packed.outputs {
            let weights = &packed.values[first * per_plane..(first + PLANES) * per_plane];
            self.block::<PLANES>(first, weights);
            first += PLANES;
        }
        while first < packed.outputs {
            let weights = &packed.values[first * per_plane..(first + 1) * per_plane];
            self.block::<1>(first, weights);
            first += 1;
        }
    }
}

/// `gradient[o][i][tap] += sum over p < length of g[o][p] x[i][p + offset(tap)]`.
pub(crate) struct CorrelateWeights<'a> {
    pub g: &'a [f32],
    pub g_stride: usize,
    pub outputs: usize,
    pub x: &'a [f32],
    pub x_stride: usize,
    pub inputs: usize,
    pub offsets: &'a [usize],
    pub gradient: &'a mut [f32],
    pub length: usize,
}

impl CorrelateWeights<'_> {
    pub fn run(self) {
        Arch::new().dispatch(self);
    }

    #[inline(always)]
    fn tile<const O: usize, const T: usize>(
        &mut self,
        first: usize,
        input: usize,
        tap: usize,
        from: usize,
        to: usize,
    ) {
        let mut sums = [[[0.0f32; LANES]; T]; O];
        let g: [&[f32]; O] =
            std::array::from_fn(|o| &self.g[(first + o) * self.g_stride..(first + o) * self.g_stride + to]);
        let x: [&[f32]; T] = std::array::from_fn(|t| {
            let start = input * self.x_stride + self.offsets[tap + t];
            &self.x[start..start + to]
        });
        let mut p = from;
        while p + LANES <= to {
            for t in 0..T {
                let x = &x[t][p..p + LANES];
                for o in 0..O {
                    let g = &g[o][p..p + LANES];
                    for j in 0..LANES {
                        sums[o][t][j] += g[j] * x[j];
                    }
                }
            }
            p += LANES;
        }
        while p < to {
            for t in 0..T {
                for o in 0..O {
                    sums[o][t][0] += g[o][p] * x[t][p];
                }
            }
            p += 1;
        }
        for o in 0..O {
            for t in 0..T {
                let s = &sums[o][t];
                let total = ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
                self.gradient[((first + o) * self.inputs + input) * self.offsets.len() + tap + t] += total;
            }
        }
    }

    #[inline(always)]
    fn planes<const O: usize>(&mut self, first: usize, from: usize, to: usize) {
        for input in 0..self.inputs {
            let mut tap = 0;
            while tap + 2 <= self.offsets.len() {
                self.tile::<O, 2>(first, input, tap, from, to);
                tap += 2;
            }
            while tap < self.offsets.len() {
                self.tile::<O, 1>(first, input, tap, from, to);
                tap += 1;
            }
        }
    }
}

impl WithSimd for CorrelateWeights<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let mut from = 0;
        while from < self.length {
            let to = (from + SEGMENT).min(self.length);
            let mut first = 0;
            while first + PLANES <= self.outputs {
                self.planes::<PLANES>(first, from, to);
                first += PLANES;
            }
            while first < self.outputs {
                self.planes::<1>(first, from, to);
                first += 1;
            }
            from = to;
        }
    }
}
