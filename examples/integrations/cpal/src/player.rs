//! What the callback of the output does.

use crate::microphone::check_channels;
use crate::{Error, MicrophoneReader, Watch};
use dasp_sample::FromSample;
use sabine_acoustics::ImpulseResponse;
use sabine_eqfilter::{RoomReverb, RoomReverbConfig, RoomReverbControl};
use std::sync::Arc;
use std::time::Instant;

/// Frames that go through the reverb at a time.
const PORTION: usize = 256;
/// Just below full scale, where every format of integers still has a value.
const LOUDEST: f32 = 1.0 - f32::EPSILON / 2.0;

/// Where the sound comes from.
#[derive(Debug)]
pub enum Input {
    /// A recording that begins again when it has ended, at the sample rate of the device; silence if there is nothing in it.
    Loop(Vec<f32>),
    /// Another device.
    Microphone(MicrophoneReader),
}

/// Settings of a [`Player`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayerConfig {
    /// Sample rate of the device and of the responses in Hz.
    pub sample_rate_hz: u32,
    /// Channels of the device, 1 to 64.
    pub channels: u16,
    /// Gain of the reverberation, as a factor of amplitude.
    pub wet: f32,
    /// Gain of the sound as it came in.
    pub dry: f32,
    /// Longest response in seconds, now and after a change.
    pub longest_s: f64,
}

/// Fills the buffers that a device hands in with sound in a room.
pub struct Player {
    input: Input,
    /// Next sample of a recording.
    position: usize,
    reverb: RoomReverb,
    channels: usize,
    sample_rate_hz: u32,
    watch: Arc<Watch>,
}

impl Player {
    /// From the input and the responses to the left and to the right.
    ///
    /// # Errors
    /// [`Error::DeviceChannels`], and what [`RoomReverb::new`] refuses.
    pub fn new(
        input: Input,
        responses: &[ImpulseResponse; 2],
        config: PlayerConfig,
        watch: &Arc<Watch>,
    ) -> Result<Self, Error> {
        let PlayerConfig { sample_rate_hz, channels, wet, dry, longest_s } = config;
        let channels = check_channels(channels)?;
        let config = RoomReverbConfig { sample_rate_hz, longest_s, wet, dry, ..RoomReverbConfig::default() };
        let reverb = RoomReverb::new(responses, config)?;
        Ok(Self { input, position: 0, reverb, channels, sample_rate_hz, watch: Arc::clone(watch) })
    }

    /// Changes room and gains from other threads.
    pub fn control(&self) -> RoomReverbControl {
        self.reverb.control()
    }

    /// Frames by which a recording is late; a microphone is late by its delay, too.
    pub fn latency_samples(&self) -> usize {
        self.reverb.latency_samples()
    }

    /// The callback. A device with one channel gets the mean of left and right; one with more gets them first, and silence on the
    /// others. What is louder than full scale is clipped.
    pub fn fill<T: FromSample<f32>>(&mut self, output: &mut [T]) {
        let begin = Instant::now();
        let channels = self.channels;
        let frames = output.len() / channels;
        let (mut mono, mut stereo) = ([0.0; PORTION], [0.0; 2 * PORTION]);
        for output in output.chunks_mut(channels * PORTION) {
            let frames = output.len() / channels;
            let (mono, stereo) = (&mut mono[..frames], &mut stereo[..2 * frames]);
            self.read(mono);
            let done = self.reverb.process_interleaved(mono, stereo);
            debug_assert!(done.is_ok(), "one channel in, two out");
            let mut output = output.chunks_exact_mut(channels);
            for (frame, ears) in output.by_ref().zip(stereo.chunks_exact(2)) {
                let mean = [0.5 * (ears[0] + ears[1])];
                let heard: &[f32] = if channels == 1 { &mean } else { ears };
                for (channel, sample) in frame.iter_mut().enumerate() {
                    let heard = heard.get(channel).copied().unwrap_or(0.0);
                    *sample = T::from_sample_(heard.clamp(-1.0, LOUDEST));
                }
            }
            // A part of a frame, which no sound system hands in.
            output.into_remainder().iter_mut().for_each(|sample| *sample = T::from_sample_(0.0));
        }
        self.watch.called_back(begin, Instant::now(), frames, self.sample_rate_hz);
    }

    fn read(&mut self, mono: &mut [f32]) {
        match &mut self.input {
            Input::Microphone(reader) => reader.read(mono),
            Input::Loop(recording) if recording.is_empty() => mono.fill(0.0),
            Input::Loop(recording) => {
                for sample in mono {
                    *sample = recording[self.position];
                    self.position = (self.position + 1) % recording.len();
                }
            }
        }
    }
}
