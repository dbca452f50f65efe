//! Reverberation in an audio callback: any number of frames, several channels.

use crate::Error;
use crate::handover::{RoomReverbControl, Shared, check_gain, prepare};
use crate::layout::{Channels, Layout, PartitionedConfig, PreparedResponse};
use crate::matrix::Matrix;
use crate::ramp::Ramp;
use sabine_acoustics::{ImpulseResponse, OutOfRange};
use std::sync::Arc;

/// Settings of a [`RoomReverb`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoomReverbConfig {
    /// Sample rate of the callback and of the responses in Hz, 1000 to 768,000.
    pub sample_rate_hz: u32,
    /// Channels of the input, 1 or 2.
    pub inputs: usize,
    /// Channels of the output, from as many as the input has to 64.
    pub outputs: usize,
    /// Samples that are convolved at a time, 16 to 16384. By so many samples the output is late; the more, the less work.
    pub block: usize,
    /// Longest response in seconds, up to 2^24 samples.
    pub longest_s: f64,
    /// Length of the cross-fade when the responses are exchanged, and of changes of gain, in seconds, more than 0 and at most 10000
    /// blocks. Cross-fades are rounded up to whole blocks.
    pub fade_s: f64,
    /// Gain of the convolved sound at the start, as a factor of amplitude from -1000 to 1000.
    pub wet: f32,
    /// Gain of the sound as it came in at the start, as `wet`.
    pub dry: f32,
}

impl Default for RoomReverbConfig {
    /// Mono in and stereo out at 48 kHz, blocks of 64 samples (1.3 ms), responses of up to 3 s, fades of 50 ms, the convolved
    /// sound alone.
    fn default() -> Self {
        Self {
            sample_rate_hz: 48_000,
            inputs: 1,
            outputs: 2,
            block: 64,
            longest_s: 3.0,
            fade_s: 0.05,
            wet: 1.0,
            dry: 0.0,
        }
    }
}

impl RoomReverbConfig {
    fn fade_samples(&self) -> usize {
        (self.fade_s * f64::from(self.sample_rate_hz)).ceil() as usize
    }

    fn layout(&self) -> Result<Layout, Error> {
        let rate_hz = f64::from(self.sample_rate_hz);
        let (inputs, outputs, block) = (self.inputs as f64, self.outputs as f64, self.block as f64);
        OutOfRange::check("sample_rate_hz", rate_hz, 1e3, 768e3, "between 1000 and 768,000 Hz")?;
        OutOfRange::check("inputs", inputs, 1.0, 2.0, "1 or 2")?;
        OutOfRange::check("outputs", outputs, inputs, 64.0, "between the number of inputs and 64")?;
        OutOfRange::check("block", block, 16.0, 16384.0, "between 16 and 16384 samples")?;
        let (shortest, longest) = (1.0 / rate_hz, 16_777_216.0 / rate_hz);
        OutOfRange::check("longest_s", self.longest_s, shortest, longest, "between 1 and 2^24 samples")?;
        OutOfRange::check(
            "fade_s",
            self.fade_s,
            shortest,
            1e4 * block / rate_hz,
            "between 1 sample and 10000 blocks",
        )?;
        check_gain("wet", self.wet)?;
        check_gain("dry", self.dry)?;
        let config = PartitionedConfig {
            block: self.block,
            longest_response: (self.longest_s * rate_hz).ceil() as usize,
            fade_blocks: self.fade_samples().div_ceil(self.block),
        };
        Layout::new(config, Channels { inputs: self.inputs, outputs: self.outputs })
    }
}

/// Convolves what an audio callback hands in with the responses of a room.
///
/// **Frames.** Each call takes and gives any number of frames, 0 included, and the number may change from call to call. The
/// output is late by a constant number of samples, [`RoomReverb::latency_samples`], the dry sound as well as the wet.
///
/// **Channels.** There is one response for each pair of input and output; those of the first input come first. Mono to stereo:
/// left, right. Stereo to stereo ("true stereo"): left to left, left to right, right to left, right to right. Each input is
/// transformed once for all outputs. The dry sound of a mono input goes to every output; that of a stereo input
/// to the first two.
///
/// **Real time.** [`RoomReverb::process_interleaved`] and [`RoomReverb::process_planar`] allocate nothing, free nothing and wait
/// for nobody, from the first call on. Other threads change gains and responses by [`RoomReverb::control`]; responses that go
/// out of use return to them. Drop the reverb itself elsewhere too.
///
/// **What is not a number** in the input is in the output too, until the longest response has passed; [`RoomReverb::clear`] ends
/// it at once. Nothing panics.
///
/// ```
/// use sabine_acoustics::ImpulseResponse;
/// use sabine_eqfilter::{RoomReverb, RoomReverbConfig};
/// // Left at once, right three samples later.
/// let left = ImpulseResponse::new(vec![1.0], 48_000)?;
/// let right = ImpulseResponse::new(vec![0.0, 0.0, 0.0, 0.5], 48_000)?;
/// let mut reverb = RoomReverb::new(&[left, right], RoomReverbConfig::default())?;
///
/// // In the callback: 100 frames, mono in, stereo out.
/// let (mut input, mut output) = ([0.0; 100], [0.0; 200]);
/// input[0] = 1.0;
/// reverb.process_interleaved(&input, &mut output)?;
/// let late = reverb.latency_samples();
/// assert!((output[2 * late] - 1.0).abs() < 1e-6 && (output[2 * (late + 3) + 1] - 0.5).abs() < 1e-6);
///
/// // On another thread: another room, some of the dry sound.
/// let control = reverb.control();
/// let hall = [0.5, 0.25].map(|gain| ImpulseResponse::new(vec![gain; 9000], 48_000));
/// let [left, right] = hall;
/// control.exchange(&[left?, right?])?;
/// control.set_dry(0.7)?;
/// # Ok::<(), sabine_eqfilter::Error>(())
/// ```
#[derive(Debug)]
pub struct RoomReverb {
    config: RoomReverbConfig,
    matrix: Matrix,
    /// Frames of the block under way that have been taken, less than a block.
    position: usize,
    /// Input of the block under way up to `position`; from there on that of the block before: the dry sound.
    collected: Vec<Vec<f32>>,
    /// Convolved blocks, given out while the next input is collected.
    ready: Vec<Vec<f32>>,
    wet: Ramp,
    dry: Ramp,
    shared: Arc<Shared>,
    /// Responses out of use that no other thread has taken yet.
    retired: Option<Box<PreparedResponse>>,
}

impl RoomReverb {
    /// Plans everything and transforms the first responses. This allocates: not for the audio thread.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting, [`Error::Responses`] for another number of responses than pairs of input and output,
    /// [`Error::ResponseRate`] for another sample rate, [`Error::ResponseLength`] for a response that is empty or longer than
    /// `config.longest_s`, [`Error::NotFinite`].
    pub fn new(responses: &[ImpulseResponse], config: RoomReverbConfig) -> Result<Self, Error> {
        let layout = config.layout()?;
        let prepared = prepare(&layout, responses, config.sample_rate_hz)?;
        Ok(Self {
            matrix: Matrix::new(layout, prepared),
            position: 0,
            collected: vec![vec![0.0; config.block]; config.inputs],
            ready: vec![vec![0.0; config.block]; config.outputs],
            wet: Ramp::at(config.wet),
            dry: Ramp::at(config.dry),
            shared: Arc::new(Shared::new(config.wet, config.dry)),
            retired: None,
            config,
        })
    }

    /// The settings.
    pub fn config(&self) -> RoomReverbConfig {
        self.config
    }

    /// Samples by which the output is late, whatever the number of frames: one block.
    pub fn latency_samples(&self) -> usize {
        self.config.block
    }

    /// Samples of output that follow the last sample of input until all is silent.
    pub fn tail_samples(&self) -> usize {
        self.latency_samples() + self.matrix.config().longest_response - 1
    }

    /// What other threads need to change gains and responses.
    pub fn control(&self) -> RoomReverbControl {
        let layout = self.matrix.layout().clone();
        RoomReverbControl::new(layout, self.config.sample_rate_hz, Arc::clone(&self.shared))
    }

    /// Whether a cross-fade to other responses is under way or about to begin.
    pub fn is_exchanging(&self) -> bool {
        self.matrix.is_exchanging()
    }

    /// Forgets all past input.
    pub fn clear(&mut self) {
        self.matrix.clear();
        self.position = 0;
        self.collected.iter_mut().chain(&mut self.ready).for_each(|samples| samples.fill(0.0));
    }

    /// Takes and gives frames whose channels alternate from sample to sample.
    ///
    /// # Errors
    /// [`Error::Frames`] if the input is not a whole number of frames, or the output another number of them; nothing has been
    /// taken then.
    pub fn process_interleaved(&mut self, input: &[f32], output: &mut [f32]) -> Result<(), Error> {
        let RoomReverbConfig { inputs, outputs, .. } = self.config;
        let frames = input.len() / inputs;
        check_frames("input", input.len(), inputs * input.len().div_ceil(inputs))?;
        check_frames("output", output.len(), outputs * frames)?;
        self.process(
            frames,
            |channel, frame| input[frame * inputs + channel],
            |channel, frame, sample| output[frame * outputs + channel] = sample,
        );
        Ok(())
    }

    /// Takes and gives a slice for each channel.
    ///
    /// # Errors
    /// [`Error::ChannelCount`] for another number of channels than the settings say, [`Error::Frames`] if the channels are not equally
    /// long; nothing has been taken then.
    pub fn process_planar(&mut self, input: &[&[f32]], output: &mut [&mut [f32]]) -> Result<(), Error> {
        check_channels("input", input.len(), self.config.inputs)?;
        check_channels("output", output.len(), self.config.outputs)?;
        let frames = input[0].len();
        for channel in input {
            check_frames("input", channel.len(), frames)?;
        }
        for channel in output.iter() {
            check_frames("output", channel.len(), frames)?;
        }
        self.process(
            frames,
            |channel, frame| input[channel][frame],
            |channel, frame, sample| output[channel][frame] = sample,
        );
        Ok(())
    }

    /// Gives out the blocks that are ready, collects input for the next, and convolves it when it is full.
    fn process(
        &mut self,
        frames: usize,
        read: impl Fn(usize, usize) -> f32,
        mut write: impl FnMut(usize, usize, f32),
    ) {
        let (block, fade) = (self.config.block, self.config.fade_samples());
        self.wet.aim(self.shared.wet(), fade);
        self.dry.aim(self.shared.dry(), fade);
        let mut done = 0;
        while done < frames {
            let now = (block - self.position).min(frames - done);
            let part = self.position..self.position + now;
            for (channel, ready) in self.ready.iter().enumerate() {
                let wet = ready[part.clone()].iter().enumerate().map(|(n, s)| self.wet.gain(n) * s);
                // The mono input, or the input of the same side; further outputs have none.
                let dry = if self.config.inputs == 1 { 0 } else { channel };
                match self.collected.get(dry) {
                    Some(before) => {
                        let dry = before[part.clone()].iter().enumerate().map(|(n, s)| self.dry.gain(n) * s);
                        wet.zip(dry)
                            .enumerate()
                            .for_each(|(n, (wet, dry))| write(channel, done + n, wet + dry));
                    }
                    None => wet.enumerate().for_each(|(n, wet)| write(channel, done + n, wet)),
                }
            }
            for (channel, collected) in self.collected.iter_mut().enumerate() {
                for (n, sample) in collected[part.clone()].iter_mut().enumerate() {
                    *sample = read(channel, done + n);
                }
            }
            self.wet.advance(now);
            self.dry.advance(now);
            self.position += now;
            done += now;
            if self.position == block {
                self.convolve_block();
            }
        }
    }

    fn convolve_block(&mut self) {
        self.position = 0;
        for (channel, input) in self.collected.iter().enumerate() {
            self.matrix.push(channel, input);
        }
        for (channel, output) in self.ready.iter_mut().enumerate() {
            self.matrix.pull(channel, output);
        }
        self.matrix.end_block();
        self.hand_over();
    }

    /// Lays aside the responses that have been replaced, and takes up new ones.
    fn hand_over(&mut self) {
        if self.retired.is_none() {
            self.retired = self.matrix.take_retired();
        }
        if self.retired.is_some() {
            self.shared.retire(&mut self.retired);
        }
        if self.matrix.can_exchange()
            && let Some(responses) = self.shared.take_incoming()
        {
            self.matrix.exchange(responses);
        }
    }
}

fn check_frames(side: &'static str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected { Ok(()) } else { Err(Error::Frames { side, expected, found }) }
}

fn check_channels(side: &'static str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected { Ok(()) } else { Err(Error::ChannelCount { side, expected, found }) }
}
