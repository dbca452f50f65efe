//! Convolution in real time.

use crate::Error;
use crate::layout::{Channels, Layout, PartitionedConfig, PreparedResponse};
use crate::matrix::Matrix;
use sabine_acoustics::OutOfRange;

/// Prepares responses for a convolver, on any thread.
#[derive(Clone, Debug)]
pub struct ResponsePreparer {
    layout: Layout,
}

impl ResponsePreparer {
    /// Transforms a response. This allocates: not for the audio thread.
    ///
    /// # Errors
    /// [`Error::ResponseLength`] if it is empty or longer than the convolver's longest, [`Error::NotFinite`].
    pub fn prepare(&self, response: &[f32]) -> Result<Box<PreparedResponse>, Error> {
        Ok(Box::new(self.layout.prepare(&[response])?))
    }
}

/// Convolves a stream with a long response, block by block.
///
/// The output is exactly as late as the block that the caller hands in is long: sample `n` of the output block belongs to
/// sample `n` of the input block ([`PartitionedConvolver::latency_samples`] is 0; collecting a block is the caller's latency). The
/// head of the response is convolved in blocks of the caller's size, the rest in blocks 16 times as long whose work is
/// spread evenly over the calls, so no call takes much longer than another. Nothing is allocated or freed after
/// construction.
///
/// The response can be exchanged while it runs: [`ResponsePreparer::prepare`] on another thread, hand the box over,
/// [`PartitionedConvolver::exchange`]; the old one is cross-faded into the new, then comes back from
/// [`PartitionedConvolver::take_retired`] to be dropped elsewhere.
///
/// ```
/// use sabine_eqfilter::{PartitionedConfig, PartitionedConvolver, convolve};
/// let response: Vec<f32> = (0..9000).map(|n| (-(n as f32) / 2000.0).exp() * (n as f32).sin()).collect();
/// let config = PartitionedConfig { longest_response: response.len(), ..Default::default() };
/// let mut convolver = PartitionedConvolver::new(&response, config)?;
/// let input: Vec<f32> = (0..12_800).map(|n| (0.1 * n as f32).cos()).collect();
/// let mut output = vec![0.0; input.len()];
/// for (block_in, block_out) in input.chunks(128).zip(output.chunks_mut(128)) {
///     convolver.process_block(block_in, block_out)?;
/// }
/// let whole = convolve(&input, &response);
/// assert!(output.iter().zip(&whole).all(|(a, b)| (a - b).abs() < 2e-3));
/// # Ok::<(), sabine_eqfilter::Error>(())
/// ```
#[derive(Debug)]
pub struct PartitionedConvolver {
    matrix: Matrix,
}

impl PartitionedConvolver {
    /// Plans everything and prepares the first response.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting out of its range, [`Error::ResponseLength`] for a response that is empty or longer than
    /// `config.longest_response`, [`Error::NotFinite`] for one with a sample that is NaN or infinite.
    pub fn new(response: &[f32], config: PartitionedConfig) -> Result<Self, Error> {
        let layout = Layout::new(config, Channels::MONO)?;
        let prepared = layout.prepare(&[response])?;
        Ok(Self { matrix: Matrix::new(layout, prepared) })
    }

    /// The settings.
    pub fn config(&self) -> PartitionedConfig {
        self.matrix.config()
    }

    /// Samples by which the output is late beyond the caller's own blocks: none.
    pub fn latency_samples(&self) -> usize {
        0
    }

    /// What other threads need to prepare responses for this convolver.
    pub fn preparer(&self) -> ResponsePreparer {
        ResponsePreparer { layout: self.matrix.layout().clone() }
    }

    /// Starts the cross-fade to another response. It begins at once if the responses are short; else when the new tail has been
    /// computed, 16 to 32 blocks later.
    ///
    /// # Errors
    /// The response comes back if another exchange is under way, if the one that was replaced last has not been taken by
    /// [`PartitionedConvolver::take_retired`], or if it was prepared for other settings.
    pub fn exchange(&mut self, response: Box<PreparedResponse>) -> Result<(), Box<PreparedResponse>> {
        let fits = response.config == self.config() && response.channels == Channels::MONO;
        if !fits || !self.matrix.can_exchange() {
            return Err(response);
        }
        self.matrix.exchange(response);
        Ok(())
    }

    /// Whether an exchange is under way.
    pub fn is_exchanging(&self) -> bool {
        self.matrix.is_exchanging()
    }

    /// The response that an exchange has replaced, once.
    pub fn take_retired(&mut self) -> Option<Box<PreparedResponse>> {
        self.matrix.take_retired()
    }

    /// Forgets all past input.
    pub fn clear(&mut self) {
        self.matrix.clear();
    }

    /// Takes one block and gives one block. Neither allocates nor locks.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] if a slice is not one block long; nothing has been taken then.
    pub fn process_block(&mut self, input: &[f32], output: &mut [f32]) -> Result<(), Error> {
        let block = self.config().block;
        for length in [input.len(), output.len()] {
            if length != block {
                let (field, range) = ("length of the block", "the block size of the convolver");
                return Err(OutOfRange { field, value: length as f64, range }.into());
            }
        }
        self.matrix.push(0, input);
        self.matrix.pull(0, output);
        self.matrix.end_block();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn responses_that_are_no_numbers_are_refused() {
        for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let response = [0.5, 0.25, wrong];
            let new = PartitionedConvolver::new(&response, PartitionedConfig::default());
            assert!(matches!(new, Err(Error::NotFinite { index: 2 })), "{wrong}");
            let good = PartitionedConvolver::new(&[1.0], PartitionedConfig::default()).unwrap();
            let prepared = good.preparer().prepare(&response);
            assert!(matches!(prepared, Err(Error::NotFinite { index: 2 })), "{wrong}");
        }
    }
}
