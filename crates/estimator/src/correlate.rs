//! The inner loops: correlation of many planes with many short filters, and its transpose in the weights.
//!
//! Products are added one by one in a fixed order, never fused: [`Correlate`] gives the same bits whatever vector
//! instructions the machine has, [`CorrelateWeights`] whatever the number of threads.

use pulp::{Arch, Simd, WithSimd};

/// Output planes that are computed together.
const PLANES: usize = 4;
/// Vectors of each plane that are computed together.
const VECTORS: usize = 2;
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
    fn block<S: Simd, const O: usize>(&mut self, simd: S, first: usize, weights: &[f32]) {
        let tile = VECTORS * S::F32_LANES;
        let mut p = 0;
        while p + tile <= self.length {
            self.tile::<S, O, VECTORS>(simd, first, weights, p);
            p += tile;
        }
        if p < self.length && self.length >= tile {
            // The last tile overlaps the one before: the same values are written again.
            if self.length - p <= S::F32_LANES {
                self.tile::<S, O, 1>(simd, first, weights, self.length - S::F32_LANES);
            } else {
                self.tile::<S, O, VECTORS>(simd, first, weights, self.length - tile);
            }
            p = self.length;
        }
        while p < self.length {
            self.single::<O>(first, weights, p);
            p += 1;
        }
    }

    #[inline(always)]
    fn tile<S: Simd, const O: usize, const V: usize>(
        &mut self,
        simd: S,
        first: usize,
        weights: &[f32],
        p: usize,
    ) {
        let length = V * S::F32_LANES;
        let offsets = self.weights.offsets.as_slice();
        let mut sums = [[simd.splat_f32s(0.0); V]; O];
        if let Some(bias) = self.bias {
            for o in 0..O {
                sums[o] = [simd.splat_f32s(bias[first + o]); V];
            }
        }
        for (input, weights) in weights.chunks_exact(offsets.len() * O).enumerate() {
            let x = &self.x[input * self.x_stride + p..];
            for (&offset, weights) in offsets.iter().zip(weights.chunks_exact(O)) {
                let (x, _) = S::as_simd_f32s(&x[offset..offset + length]);
                let x: [S::f32s; V] = std::array::from_fn(|v| x[v]);
                for o in 0..O {
                    let weight = simd.splat_f32s(weights[o]);
                    for v in 0..V {
                        sums[o][v] = simd.add_f32s(sums[o][v], simd.mul_f32s(weight, x[v]));
                    }
                }
            }
        }
        for (o, sums) in sums.iter().enumerate() {
            let start = (first + o) * self.out_stride + p;
            let (out, _) = S::as_mut_simd_f32s(&mut self.out[start..start + length]);
            out.copy_from_slice(sums);
        }
    }

    /// One position: for planes narrower than a tile.
    #[inline(always)]
    fn single<const O: usize>(&mut self, first: usize, weights: &[f32], p: usize) {
        let offsets = self.weights.offsets.as_slice();
        for o in 0..O {
            let mut sum = self.bias.map_or(0.0, |bias| bias[first + o]);
            for (input, weights) in weights.chunks_exact(offsets.len() * O).enumerate() {
                for (tap, &offset) in offsets.iter().enumerate() {
                    sum += weights[tap * O + o] * self.x[input * self.x_stride + p + offset];
                }
            }
            self.out[(first + o) * self.out_stride + p] = sum;
        }
    }
}

impl WithSimd for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let packed = self.weights;
        let per_plane = packed.inputs * packed.offsets.len();
        let mut first = 0;
        while first + PLANES <= packed.outputs {
            let weights = &packed.values[first * per_plane..(first + PLANES) * per_plane];
            self.block::<S, PLANES>(simd, first, weights);
            first += PLANES;
        }
        while first < packed.outputs {
            let weights = &packed.values[first * per_plane..(first + 1) * per_plane];
            self.block::<S, 1>(simd, first, weights);
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
    fn tile<S: Simd, const O: usize, const T: usize>(
        &mut self,
        simd: S,
        first: usize,
        input: usize,
        tap: usize,
        from: usize,
        to: usize,
    ) {
        let mut sums = [[simd.splat_f32s(0.0); T]; O];
        let g: [&[f32]; O] = std::array::from_fn(|o| &self.g[(first + o) * self.g_stride..][from..to]);
        let x: [&[f32]; T] =
            std::array::from_fn(|t| &self.x[input * self.x_stride + self.offsets[tap + t]..][from..to]);
        let vectors = (to - from) / S::F32_LANES;
        let gv: [&[S::f32s]; O] = std::array::from_fn(|o| &S::as_simd_f32s(g[o]).0[..vectors]);
        let xv: [&[S::f32s]; T] = std::array::from_fn(|t| &S::as_simd_f32s(x[t]).0[..vectors]);
        for p in 0..vectors {
            let x: [S::f32s; T] = std::array::from_fn(|t| xv[t][p]);
            for o in 0..O {
                let g = gv[o][p];
                for t in 0..T {
                    sums[o][t] = simd.add_f32s(sums[o][t], simd.mul_f32s(g, x[t]));
                }
            }
        }
        for o in 0..O {
            for t in 0..T {
                let mut total = simd.reduce_sum_f32s(sums[o][t]);
                for p in vectors * S::F32_LANES..to - from {
                    total += g[o][p] * x[t][p];
                }
                self.gradient[((first + o) * self.inputs + input) * self.offsets.len() + tap + t] += total;
            }
        }
    }

    #[inline(always)]
    fn planes<S: Simd, const O: usize>(&mut self, simd: S, first: usize, from: usize, to: usize) {
        for input in 0..self.inputs {
            let mut tap = 0;
            while tap + 2 <= self.offsets.len() {
                self.tile::<S, O, 2>(simd, first, input, tap, from, to);
                tap += 2;
            }
            while tap < self.offsets.len() {
                self.tile::<S, O, 1>(simd, first, input, tap, from, to);
                tap += 1;
            }
        }
    }
}

impl WithSimd for CorrelateWeights<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let mut from = 0;
        while from < self.length {
            let to = (from + SEGMENT).min(self.length);
            let mut first = 0;
            while first + PLANES <= self.outputs {
                self.planes::<S, PLANES>(simd, first, from, to);
                first += PLANES;
            }
            while first < self.outputs {
                self.planes::<S, 1>(simd, first, from, to);
                first += 1;
            }
            from = to;
        }
    }
}
