//! ReLU and max pooling, and the way back to where the maximum was.

use crate::shape::BlockShape;
use pulp::{Arch, Simd, WithSimd};

/// One pooled row of every plane: `out = max(0, largest of the pool)`.
///
/// The mark of an output is 1 + the position of the maximum in its pool, row by row, or 0 where ReLU cut it off; of equal
/// values the first counts.
pub(crate) struct PoolRow<'a> {
    pub shape: BlockShape,
    /// Convolved positions of this row, `[plane][row_span]`.
    pub convolved: &'a [f32],
    pub convolved_stride: usize,
    /// Pooled planes of the sample.
    pub out: &'a mut [f32],
    /// Marks of the sample, where the gradient will be asked for.
    pub marks: Option<&'a mut [u8]>,
    pub row: usize,
}

impl PoolRow<'_> {
    pub fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for PoolRow<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (rows, columns) = self.shape.pooled();
        let (pool_rows, pool_columns) = self.shape.pool;
        let mut marks = self.marks;
        for plane in 0..self.shape.outputs {
            let convolved = &self.convolved[plane * self.convolved_stride..][..self.shape.row_span()];
            let start = (plane * rows + self.row) * columns;
            let out = &mut self.out[start..start + columns];
            let marks = marks.as_deref_mut().map(|marks| &mut marks[start..start + columns]);
            match (marks, pool_rows, pool_columns) {
                (None, 1, 2) => {
                    for (out, pair) in out.iter_mut().zip(convolved.chunks_exact(2)) {
                        *out = larger(larger(pair[0], pair[1]), 0.0);
                    }
                }
                (None, 2, 2) => {
                    let below = &convolved[self.shape.width..];
                    for ((out, a), b) in
                        out.iter_mut().zip(convolved.chunks_exact(2)).zip(below.chunks_exact(2))
                    {
                        *out = larger(larger(larger(a[0], a[1]), larger(b[0], b[1])), 0.0);
                    }
                }
                (Some(marks), 1, 2) => {
                    for ((out, mark), pair) in out.iter_mut().zip(marks).zip(convolved.chunks_exact(2)) {
                        let second = pair[1] > pair[0];
                        let value = if second { pair[1] } else { pair[0] };
                        *out = larger(value, 0.0);
                        *mark = if value > 0.0 { 1 + u8::from(second) } else { 0 };
                    }
                }
                (marks, _, _) => pool_any(self.shape, convolved, out, marks),
            }
        }
    }
}

/// The larger of two numbers; NaN passes through, so that a broken network shows.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[inline(always)]
fn pool_any(shape: BlockShape, convolved: &[f32], out: &mut [f32], mut marks: Option<&mut [u8]>) {
    for (column, out) in out.iter_mut().enumerate() {
        let mut value = convolved[column * shape.pool.1];
        let mut mark = 1;
        for dy in 0..shape.pool.0 {
            for dx in 0..shape.pool.1 {
                let candidate = convolved[dy * shape.width + column * shape.pool.1 + dx];
                if candidate > value {
                    value = candidate;
                    mark = (1 + dy * shape.pool.1 + dx) as u8;
                }
            }
        }
        *out = larger(value, 0.0);
        if let Some(marks) = marks.as_deref_mut() {
            marks[column] = if value > 0.0 { mark } else { 0 };
        }
    }
}

/// Puts the gradient of the pooled planes back to where each maximum was; all other positions become 0.
pub(crate) struct Unpool<'a> {
    pub shape: BlockShape,
    pub gradient: &'a [f32],
    pub marks: &'a [u8],
    /// Planes as wide as the input, each preceded by `pad` zeros; zero on entry.
    pub out: &'a mut [f32],
    pub pad: usize,
}

impl Unpool<'_> {
    pub fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Unpool<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let shape = self.shape;
        let (rows, columns) = shape.pooled();
        let (pool_rows, pool_columns) = shape.pool;
        for plane in 0..shape.outputs {
            let out = &mut self.out[plane * (self.pad + shape.plane()) + self.pad..][..shape.plane()];
            for row in 0..rows {
                let start = (plane * rows + row) * columns;
                let gradient = &self.gradient[start..start + columns];
                let marks = &self.marks[start..start + columns];
                for dy in 0..pool_rows {
                    let out = &mut out[(row * pool_rows + dy) * shape.width..][..columns * pool_columns];
                    let first = (1 + dy * pool_columns) as u8;
                    if pool_columns == 2 {
                        for ((pair, &g), &mark) in out.chunks_exact_mut(2).zip(gradient).zip(marks) {
                            pair[0] = if mark == first { g } else { 0.0 };
                            pair[1] = if mark == first + 1 { g } else { 0.0 };
                        }
                    } else {
                        for ((group, &g), &mark) in
                            out.chunks_exact_mut(pool_columns).zip(gradient).zip(marks)
                        {
                            for (dx, value) in group.iter_mut().enumerate() {
                                *value = if mark == first + dx as u8 { g } else { 0.0 };
                            }
                        }
                    }
                }
            }
        }
    }
}
