//! Convolution of several inputs with several outputs, block by block: each input is transformed once for all outputs.

use crate::layout::{Channels, Layout, PartitionedConfig, PreparedResponse, TAIL_FACTOR};
use crate::uniform::Stage;
use realfft::num_complex::Complex;

/// One output of one set of responses: the state of its tail.
#[derive(Clone, Debug)]
struct Voice {
    /// Sum of products of the tail block under way.
    sum: Vec<Complex<f32>>,
    /// Output of the last finished tail block.
    ready: Vec<f32>,
}

impl Voice {
    fn clear(&mut self) {
        self.sum.fill(Complex::default());
        self.ready.fill(0.0);
    }
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

/// The start of the responses, in blocks of the caller's size.
#[derive(Debug)]
struct Head {
    /// One for each input.
    stages: Vec<Stage>,
    partitions: usize,
    sum: Vec<Complex<f32>>,
}

/// The rest of the responses, in blocks `TAIL_FACTOR` times as long.
#[derive(Debug)]
struct Tail {
    /// One for each input.
    stages: Vec<Stage>,
    partitions: usize,
    /// Input collected for the next tail block, for each input.
    collected: Vec<Vec<f32>>,
    /// Calls since the last tail block was complete, 0 to `TAIL_FACTOR - 1`.
    phase: usize,
}

/// A convolver with a response for each pair of input and output. Blocks of all inputs go in by [`Matrix::push`]; blocks
/// of all outputs come out by [`Matrix::pull`].
#[derive(Debug)]
pub(crate) struct Matrix {
    layout: Layout,
    head: Head,
    tail: Option<Tail>,
    incoming_out: Vec<f32>,
    current: Box<PreparedResponse>,
    current_voices: Vec<Voice>,
    incoming: Option<Box<PreparedResponse>>,
    incoming_voices: Vec<Voice>,
    retired: Option<Box<PreparedResponse>>,
    fade: Fade,
}

impl Matrix {
    pub fn new(layout: Layout, responses: PreparedResponse) -> Self {
        let Channels { inputs, outputs } = layout.channels;
        let tail = layout.tail.as_ref().map(|(transform, partitions)| Tail {
            stages: vec![Stage::new(transform.clone(), *partitions); inputs],
            partitions: *partitions,
            collected: vec![vec![0.0; transform.block]; inputs],
            phase: 0,
        });
        let (bins, block) = layout.tail.as_ref().map_or((0, 0), |(t, _)| (t.bins(), t.block));
        let voices = vec![Voice { sum: vec![Complex::default(); bins], ready: vec![0.0; block] }; outputs];
        Self {
            head: Head {
                stages: vec![Stage::new(layout.head.clone(), layout.head_partitions); inputs],
                partitions: layout.head_partitions,
                sum: vec![Complex::default(); layout.head.bins()],
            },
            tail,
            incoming_out: vec![0.0; layout.config.block],
            current: Box::new(responses),
            current_voices: voices.clone(),
            incoming: None,
            incoming_voices: voices,
            retired: None,
            fade: Fade::Idle,
            layout,
        }
    }

    pub fn config(&self) -> PartitionedConfig {
        self.layout.config
    }

    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Starts the cross-fade to other responses of the same layout, where [`Matrix::can_exchange`].
    pub fn exchange(&mut self, responses: Box<PreparedResponse>) {
        debug_assert!(self.can_exchange(), "one exchange at a time");
        self.incoming = Some(responses);
        self.fade = if self.tail.is_some() { Fade::Waiting(2) } else { Fade::Running(0) };
    }

    /// Whether no exchange is under way, and the responses replaced last have been taken.
    pub fn can_exchange(&self) -> bool {
        self.incoming.is_none() && self.retired.is_none()
    }

    pub fn is_exchanging(&self) -> bool {
        self.incoming.is_some()
    }

    pub fn take_retired(&mut self) -> Option<Box<PreparedResponse>> {
        self.retired.take()
    }

    pub fn clear(&mut self) {
        self.head.stages.iter_mut().for_each(Stage::clear);
        if let Some(tail) = &mut self.tail {
            tail.stages.iter_mut().for_each(Stage::clear);
            tail.collected.iter_mut().for_each(|input| input.fill(0.0));
            tail.phase = 0;
        }
        self.current_voices.iter_mut().chain(&mut self.incoming_voices).for_each(Voice::clear);
    }

    /// Takes one block of one input. All inputs must be pushed before the first output is pulled.
    pub fn push(&mut self, channel: usize, input: &[f32]) {
        self.head.stages[channel].push(input);
        if let Some(tail) = &mut self.tail {
            let at = tail.phase * input.len();
            tail.collected[channel][at..][..input.len()].copy_from_slice(input);
        }
    }

    /// Gives one block of one output.
    pub fn pull(&mut self, channel: usize, output: &mut [f32]) {
        let running = match (self.fade, &self.incoming) {
            (Fade::Running(done), Some(incoming)) => Some((done, incoming)),
            _ => None,
        };
        self.head.convolve(&self.current, channel, output);
        if let Some((_, incoming)) = running {
            self.head.convolve(incoming, channel, &mut self.incoming_out);
        }
        if let Some(tail) = &self.tail {
            tail.add_ready(&self.current_voices[channel], output);
            tail.step(&self.current, channel, &mut self.current_voices[channel]);
            if running.is_some() {
                tail.add_ready(&self.incoming_voices[channel], &mut self.incoming_out);
            }
            if let Some(incoming) = &self.incoming {
                tail.step(incoming, channel, &mut self.incoming_voices[channel]);
            }
        }
        if let Some((done, _)) = running {
            self.mix(done, output);
        }
    }

    /// Cross-fades one block of one output.
    fn mix(&self, done: usize, output: &mut [f32]) {
        let PartitionedConfig { block, fade_blocks, .. } = self.layout.config;
        let step = 1.0 / (fade_blocks * block) as f32;
        for (i, (old, &new)) in output.iter_mut().zip(&self.incoming_out).enumerate() {
            let share = (done * block + i + 1) as f32 * step;
            *old += share * (new - *old);
        }
    }

    /// Ends the block after all outputs have been pulled.
    pub fn end_block(&mut self) {
        let fading = self.fade;
        if let Some(tail) = &mut self.tail {
            tail.phase = (tail.phase + 1) % TAIL_FACTOR;
            if tail.phase == 0 {
                tail.finish(&mut self.current_voices);
                if self.incoming.is_some() {
                    tail.finish(&mut self.incoming_voices);
                }
                tail.begin();
                if let Fade::Waiting(left) = self.fade {
                    self.fade = if left > 1 { Fade::Waiting(left - 1) } else { Fade::Running(0) };
                }
            }
        }
        if let Fade::Running(done) = fading {
            self.advance_fade(done + 1);
        }
    }

    /// Counts the blocks of a fade, and ends the exchange after the last.
    fn advance_fade(&mut self, done: usize) {
        if done < self.layout.config.fade_blocks {
            self.fade = Fade::Running(done);
            return;
        }
        if let Some(incoming) = self.incoming.take() {
            self.retired = Some(std::mem::replace(&mut self.current, incoming));
            std::mem::swap(&mut self.current_voices, &mut self.incoming_voices);
            for voice in &mut self.incoming_voices {
                voice.sum.fill(Complex::default());
            }
        }
        self.fade = Fade::Idle;
    }
}

impl Head {
    fn convolve(&mut self, responses: &PreparedResponse, output_channel: usize, output: &mut [f32]) {
        self.sum.fill(Complex::default());
        for (input, stage) in self.stages.iter().enumerate() {
            let response = &responses.heads[responses.channels.pair(input, output_channel)];
            stage.accumulate(response, 0, self.partitions, &mut self.sum);
        }
        self.stages[0].finish(&mut self.sum, output);
    }
}

impl Tail {
    /// Adds this call's part of the last finished tail block.
    fn add_ready(&self, voice: &Voice, output: &mut [f32]) {
        let ready = &voice.ready[self.phase * output.len()..];
        for (sum, more) in output.iter_mut().zip(ready) {
            *sum += more;
        }
    }

    /// One call's share of the products of the tail block under way.
    fn step(&self, responses: &PreparedResponse, output_channel: usize, voice: &mut Voice) {
        let share = |phase: usize| self.partitions * phase / TAIL_FACTOR;
        for (input, stage) in self.stages.iter().enumerate() {
            let response = &responses.tails[responses.channels.pair(input, output_channel)];
            stage.accumulate(response, share(self.phase), share(self.phase + 1), &mut voice.sum);
        }
    }

    /// Turns the finished sums into the output of the next `TAIL_FACTOR` calls.
    fn finish(&mut self, voices: &mut [Voice]) {
        for voice in voices {
            self.stages[0].finish(&mut voice.sum, &mut voice.ready);
            voice.sum.fill(Complex::default());
        }
    }

    /// Starts the products of the blocks just collected.
    fn begin(&mut self) {
        for (stage, input) in self.stages.iter_mut().zip(&self.collected) {
            stage.push(input);
        }
    }
}
