//! How responses are cut into partitions, and responses so cut.

use crate::Error;
use crate::error::check_taps;
use crate::uniform::BlockTransform;
use realfft::num_complex::Complex;
use sabine_acoustics::OutOfRange;

/// Blocks of the head that make one block of the tail, where the response is long enough to need a tail.
pub(crate) const TAIL_FACTOR: usize = 16;
/// Tail blocks by which the tail of the response starts late: one to fill the block, one to compute it.
const TAIL_START: usize = 2;

/// Settings of a [`PartitionedConvolver`](crate::PartitionedConvolver).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartitionedConfig {
    /// Samples that each call takes and gives, 16 to 16384.
    pub block: usize,
    /// Longest response, in samples, 1 to 2^24.
    pub longest_response: usize,
    /// Length of the cross-fade when the response is exchanged, in blocks, 1 to 10000.
    pub fade_blocks: usize,
}

impl Default for PartitionedConfig {
    /// Blocks of 128 samples, responses of up to 3 s at 48 kHz, a cross-fade of 8 blocks.
    fn default() -> Self {
        Self { block: 128, longest_response: 144_000, fade_blocks: 8 }
    }
}

/// Channels in and out. Each pair of them has a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Channels {
    pub inputs: usize,
    pub outputs: usize,
}

impl Channels {
    pub const MONO: Self = Self { inputs: 1, outputs: 1 };

    pub fn pairs(self) -> usize {
        self.inputs * self.outputs
    }

    /// Index of the response from an input to an output.
    pub fn pair(self, input: usize, output: usize) -> usize {
        input * self.outputs + output
    }
}

/// How a response is cut: a head in blocks of the caller's size, then a tail in longer ones.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub config: PartitionedConfig,
    pub channels: Channels,
    pub head: BlockTransform,
    pub head_partitions: usize,
    pub tail: Option<(BlockTransform, usize)>,
}

impl Layout {
    pub fn new(config: PartitionedConfig, channels: Channels) -> Result<Self, Error> {
        OutOfRange::check("block", config.block as f64, 16.0, 16384.0, "between 16 and 16384 samples")?;
        OutOfRange::check(
            "longest_response",
            config.longest_response as f64,
            1.0,
            16_777_216.0,
            "between 1 and 2^24 samples",
        )?;
        OutOfRange::check("fade_blocks", config.fade_blocks as f64, 1.0, 1e4, "between 1 and 10000")?;
        let (block, length) = (config.block, config.longest_response);
        let long_block = TAIL_FACTOR * block;
        let head_length = TAIL_START * long_block;
        let head = BlockTransform::new(block);
        // A short tail would cost more than it saves.
        if length < 2 * head_length {
            return Ok(Self { config, channels, head, head_partitions: length.div_ceil(block), tail: None });
        }
        let tail = (BlockTransform::new(long_block), (length - head_length).div_ceil(long_block));
        Ok(Self { config, channels, head, head_partitions: head_length / block, tail: Some(tail) })
    }

    /// Transforms the responses of all pairs, those of the first input first.
    pub fn prepare<R: AsRef<[f32]>>(&self, responses: &[R]) -> Result<PreparedResponse, Error> {
        if responses.len() != self.channels.pairs() {
            return Err(Error::Responses { expected: self.channels.pairs(), found: responses.len() });
        }
        let mut prepared = PreparedResponse {
            config: self.config,
            channels: self.channels,
            heads: Vec::new(),
            tails: Vec::new(),
        };
        for response in responses.iter().map(AsRef::as_ref) {
            check_taps(response, self.config.longest_response)?;
            let (head, tail) =
                response.split_at(response.len().min(self.head_partitions * self.config.block));
            prepared.heads.push(self.head.partition(head));
            if let Some((transform, _)) = &self.tail {
                prepared.tails.push(transform.partition(tail));
            }
        }
        Ok(prepared)
    }
}

/// A response transformed for a [`PartitionedConvolver`](crate::PartitionedConvolver); made away from the audio thread by
/// [`ResponsePreparer::prepare`](crate::ResponsePreparer::prepare).
#[derive(Clone, Debug)]
pub struct PreparedResponse {
    pub(crate) config: PartitionedConfig,
    pub(crate) channels: Channels,
    /// Spectra for each pair of input and output, those of the first input first.
    pub(crate) heads: Vec<Vec<Complex<f32>>>,
    pub(crate) tails: Vec<Vec<Complex<f32>>>,
}
