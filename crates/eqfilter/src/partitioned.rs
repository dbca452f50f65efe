//! Convolution in real time.

use crate::Error;
use crate::error::check_taps;
use crate::uniform::{BlockTransform, Stage};
use realfft::num_complex::Complex;
use sabine_acoustics::OutOfRange;

/// Blocks of the head that make one block of the tail, where the response is long enough to need a tail.
const TAIL_FACTOR: usize = 16;
/// Tail blocks by which the tail of the response starts late: one to fill the block, one to compute it.
const TAIL_START: usize = 2;

/// Settings of a [`PartitionedConvolver`].
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

/// How a response is cut: a head in blocks of the caller's size, then a tail in longer ones.
#[derive(Clone, Debug)]
struct Layout {
    config: PartitionedConfig,
    head: BlockTransform,
    head_partitions: usize,
    tail: Option<(BlockTransform, usize)>,
}

impl Layout {
    fn new(config: PartitionedConfig) -> Result<Self, Error> {
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
            return Ok(Self { config, head, head_partitions: length.div_ceil(block), tail: None });
        }
        let tail = (BlockTransform::new(long_block), (length - head_length).div_ceil(long_block));
        Ok(Self { config, head, head_partitions: head_length / block, tail: Some(tail) })
    }

    fn prepare(&self, response: &[f32]) -> Result<PreparedResponse, Error> {
        check_taps(response, self.config.longest_response)?;
        let (head, tail) = response.split_at(response.len().min(self.head_partitions * self.config.block));
        Ok(PreparedResponse {
            config: self.config,
            head: self.head.partition(head, self.head_partitions),
            tail: self.tail.as_ref().map_or_else(Vec::new, |(transform, n)| transform.partition(tail, *n)),
        })
    }
}

/// A response transformed for a [`PartitionedConvolver`]; made away from the audio thread by [`ResponsePreparer::prepare`].
#[derive(Clone, Debug)]
pub struct PreparedResponse {
    config: PartitionedConfig,
    head: Vec<Complex<f32>>,
    tail: Vec<Complex<f32>>,
}

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
        Ok(Box::new(self.layout.prepare(response)?))
    }
}

/// One response at work: its spectra, and the state of its tail.
#[derive(Debug)]
struct Voice {
    /// Sum of products of the tail block under way.
    sum: Vec<Complex<f32>>,
    /// Output of the last finished tail block.
    ready: Vec<f32>,
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
    layout: Layout,
    head: Stage,
    tail: Option<Tail>,
    sum: Vec<Complex<f32>>,
    incoming_out: Vec<f32>,
    current: Box<PreparedResponse>,
    current_voice: Voice,
    incoming: Option<Box<PreparedResponse>>,
    incoming_voice: Voice,
    retired: Option<Box<PreparedResponse>>,
    fade: Fade,
}

/// Where an exchange stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fade {
    /// No exchange.
    Idle,
    /// Waits for this many starts of tail blocks before the new tail has output.
    Waiting(usize),
    /// Fades; so many blocks are done.
    Running(usize),
}

#[derive(Debug)]
struct Tail {
    stage: Stage,
    partitions: usize,
    /// Input collected for the next tail block.
    input: Vec<f32>,
    /// Calls since the last tail block was complete, 0 to `TAIL_FACTOR - 1`.
    phase: usize,
}

impl PartitionedConvolver {
    /// Plans everything and prepares the first response.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting out of its range, [`Error::ResponseLength`] for a response that is empty or longer than
    /// `config.longest_response`, [`Error::NotFinite`] for one with a sample that is NaN or infinite.
    pub fn new(response: &[f32], config: PartitionedConfig) -> Result<Self, Error> {
        let layout = Layout::new(config)?;
        let current = Box::new(layout.prepare(response)?);
        let tail = layout.tail.as_ref().map(|(transform, partitions)| Tail {
            stage: Stage::new(transform.clone(), *partitions),
            partitions: *partitions,
            input: vec![0.0; transform.block],
            phase: 0,
        });
        let voice = || {
            let (bins, block) = layout.tail.as_ref().map_or((0, 0), |(t, _)| (t.bins(), t.block));
            Voice { sum: vec![Complex::default(); bins], ready: vec![0.0; block] }
        };
        Ok(Self {
            head: Stage::new(layout.head.clone(), layout.head_partitions),
            tail,
            sum: vec![Complex::default(); layout.head.bins()],
            incoming_out: vec![0.0; config.block],
            current,
            current_voice: voice(),
            incoming: None,
            incoming_voice: voice(),
            retired: None,
            fade: Fade::Idle,
            layout,
        })
    }

    /// The settings.
    pub fn config(&self) -> PartitionedConfig {
        self.layout.config
    }

    /// Samples by which the output is late beyond the caller's own blocks: none.
    pub fn latency_samples(&self) -> usize {
        0
    }

    /// What other threads need to prepare responses for this convolver.
    pub fn preparer(&self) -> ResponsePreparer {
        ResponsePreparer { layout: self.layout.clone() }
    }

    /// Starts the cross-fade to another response. It begins at once if the responses are short; else when the new tail has been
    /// computed, 16 to 32 blocks later.
    ///
    /// # Errors
    /// The response comes back if another exchange is under way, if the one that was replaced last has not been taken by
    /// [`PartitionedConvolver::take_retired`], or if it was prepared for other settings.
    pub fn exchange(&mut self, response: Box<PreparedResponse>) -> Result<(), Box<PreparedResponse>> {
        if self.incoming.is_some() || self.retired.is_some() || response.config != self.layout.config {
            return Err(response);
        }
        self.incoming = Some(response);
        self.fade = if self.tail.is_some() { Fade::Waiting(2) } else { Fade::Running(0) };
        Ok(())
    }

    /// Whether an exchange is under way.
    pub fn is_exchanging(&self) -> bool {
        self.incoming.is_some()
    }

    /// The response that an exchange has replaced, once.
    pub fn take_retired(&mut self) -> Option<Box<PreparedResponse>> {
        self.retired.take()
    }

    /// Forgets all past input.
    pub fn clear(&mut self) {
        self.head.clear();
        if let Some(tail) = &mut self.tail {
            tail.stage.clear();
            tail.input.fill(0.0);
            tail.phase = 0;
        }
        for voice in [&mut self.current_voice, &mut self.incoming_voice] {
            voice.sum.fill(Complex::default());
            voice.ready.fill(0.0);
        }
    }

    /// Takes one block and gives one block. Neither allocates nor locks.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] if a slice is not one block long; nothing has been taken then.
    pub fn process_block(&mut self, input: &[f32], output: &mut [f32]) -> Result<(), Error> {
        let block = self.layout.config.block;
        for length in [input.len(), output.len()] {
            if length != block {
                let (field, range) = ("length of the block", "the block size of the convolver");
                return Err(OutOfRange { field, value: length as f64, range }.into());
            }
        }
        self.head.push(input);
        self.sum.fill(Complex::default());
        self.head.accumulate(&self.current.head, 0, self.layout.head_partitions, &mut self.sum);
        self.head.finish(&mut self.sum, output);
        let fading = matches!(self.fade, Fade::Running(_));
        if let (true, Some(incoming)) = (fading, &self.incoming) {
            self.sum.fill(Complex::default());
            self.head.accumulate(&incoming.head, 0, self.layout.head_partitions, &mut self.sum);
            self.head.finish(&mut self.sum, &mut self.incoming_out);
        }
        if let Some(tail) = &mut self.tail {
            let at = tail.phase * block;
            add(output, &self.current_voice.ready[at..][..block]);
            if fading {
                add(&mut self.incoming_out, &self.incoming_voice.ready[at..][..block]);
            }
            tail.step(&self.current.tail, &mut self.current_voice);
            if let Some(incoming) = &self.incoming {
                tail.step(&incoming.tail, &mut self.incoming_voice);
            }
            let wrapped = tail.advance(input, block);
            if wrapped {
                tail.finish(&mut self.current_voice);
                if self.incoming.is_some() {
                    tail.finish(&mut self.incoming_voice);
                }
                tail.begin();
            }
            if let (true, Fade::Waiting(left)) = (wrapped, self.fade) {
                self.fade = if left > 1 { Fade::Waiting(left - 1) } else { Fade::Running(0) };
            }
        }
        if fading {
            self.mix(output);
        }
        Ok(())
    }

    /// Cross-fades one block, and ends the exchange after the last.
    fn mix(&mut self, output: &mut [f32]) {
        let Fade::Running(done) = self.fade else { return };
        let PartitionedConfig { block, fade_blocks, .. } = self.layout.config;
        let step = 1.0 / (fade_blocks * block) as f32;
        for (i, (old, &new)) in output.iter_mut().zip(&self.incoming_out).enumerate() {
            let share = (done * block + i + 1) as f32 * step;
            *old += share * (new - *old);
        }
        if done + 1 < fade_blocks {
            self.fade = Fade::Running(done + 1);
            return;
        }
        if let Some(incoming) = self.incoming.take() {
            self.retired = Some(std::mem::replace(&mut self.current, incoming));
            std::mem::swap(&mut self.current_voice, &mut self.incoming_voice);
            self.incoming_voice.sum.fill(Complex::default());
        }
        self.fade = Fade::Idle;
    }
}

impl Tail {
    /// One call's share of the products of the tail block under way.
    fn step(&self, response: &[Complex<f32>], voice: &mut Voice) {
        let share = |phase: usize| self.partitions * phase / TAIL_FACTOR;
        self.stage.accumulate(response, share(self.phase), share(self.phase + 1), &mut voice.sum);
    }

    /// Collects input; true when a tail block is complete.
    fn advance(&mut self, input: &[f32], block: usize) -> bool {
        self.input[self.phase * block..][..block].copy_from_slice(input);
        self.phase = (self.phase + 1) % TAIL_FACTOR;
        self.phase == 0
    }

    /// Turns the finished sum into the output of the next `TAIL_FACTOR` calls.
    fn finish(&mut self, voice: &mut Voice) {
        self.stage.finish(&mut voice.sum, &mut voice.ready);
        voice.sum.fill(Complex::default());
    }

    /// Starts the products of the block just collected.
    fn begin(&mut self) {
        self.stage.push(&self.input);
    }
}

fn add(sum: &mut [f32], more: &[f32]) {
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum += more;
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
