//! Sizes of one block of the network.

/// Sizes of a convolution without padding and with stride 1, followed by ReLU and max pooling without overlap.
///
/// A plane is stored row by row, so a filter tap is an offset into it: the convolution of a plane is a sum of shifted
/// copies. The `kernel_width - 1` last positions of a row are computed with wrapped neighbours and never read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BlockShape {
    pub inputs: usize,
    pub height: usize,
    pub width: usize,
    pub outputs: usize,
    pub kernel: (usize, usize),
    pub pool: (usize, usize),
}

impl BlockShape {
    /// Rows and columns after pooling; what does not fill a pool is dropped, as everywhere.
    pub fn pooled(&self) -> (usize, usize) {
        let rows = (self.height + 1).saturating_sub(self.kernel.0) / self.pool.0;
        let columns = (self.width + 1).saturating_sub(self.kernel.1) / self.pool.1;
        (rows, columns)
    }

    /// Floats of one input sample.
    pub fn input_len(&self) -> usize {
        self.inputs * self.plane()
    }

    /// Floats of one output sample.
    pub fn output_len(&self) -> usize {
        let (rows, columns) = self.pooled();
        self.outputs * rows * columns
    }

    /// Floats of one input plane.
    pub fn plane(&self) -> usize {
        self.height * self.width
    }

    /// Taps of the filter.
    pub fn taps(&self) -> usize {
        self.kernel.0 * self.kernel.1
    }

    /// Number of filter weights, `[output][input][row][column]`.
    pub fn weights(&self) -> usize {
        self.outputs * self.inputs * self.taps()
    }

    /// Where each tap reads, relative to the position that is computed.
    pub fn offsets(&self) -> Vec<usize> {
        (0..self.kernel.0)
            .flat_map(|row| (0..self.kernel.1).map(move |column| row * self.width + column))
            .collect()
    }

    /// Positions from the first to the last that one pooled row reads.
    pub fn row_span(&self) -> usize {
        (self.pool.0 - 1) * self.width + self.pool.1 * self.pooled().1
    }

    /// Positions from the first to the last that any pooled row reads.
    pub fn span(&self) -> usize {
        let (rows, columns) = self.pooled();
        (rows * self.pool.0 - 1) * self.width + self.pool.1 * columns
    }
}
