//! Directions in which the tracer's chance moves the bins of one response together.

/// By how much directions of the tracer's chance move the logarithm of each bin of one band, a standard deviation of each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Modes {
    count: usize,
    /// `[bin * count + mode]`.
    moves: Vec<f64>,
}

impl Modes {
    /// So many directions; `moves` is `[bin * count + mode]`.
    pub fn new(count: usize, moves: Vec<f64>) -> Self {
        Self { count, moves }
    }

    /// Number of directions: the same in all bands of a response.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Those of a bin.
    pub fn of(&self, bin: usize) -> &[f64] {
        &self.moves[bin * self.count..(bin + 1) * self.count]
    }
}
