//! The reverberation of a room as a source of [rodio]: [`Room`] wraps any source, as rodio's own filters do.

use rodio::source::UniformSourceIterator;
use rodio::{ChannelCount, Sample, SampleRate, Source};
use sabine_acoustics::ImpulseResponse;
use sabine_eqfilter::{Error, RoomReverb, RoomReverbConfig, RoomReverbControl};
use std::time::Duration;

/// Frames that are convolved at a time.
const BLOCK: usize = 256;
const STEREO: ChannelCount = ChannelCount::new(2).expect("not zero");

/// A source heard in a room: its channels are mixed down, and the responses to the left and to the right lead to two ears.
///
/// The sample rate is that of the responses; rodio converts the source. The reverberation starts with the source, without latency,
/// and outlasts it by the longest response.
pub struct Room<S: Source> {
    source: UniformSourceIterator<S>,
    reverb: RoomReverb,
    sample_rate: SampleRate,
    mono: [f32; BLOCK],
    /// Left and right alternating; what lies before `given` has been given out, what lies behind `ready` is none.
    stereo: [f32; 2 * BLOCK],
    given: usize,
    ready: usize,
    /// Frames that follow the end of the source.
    tail: usize,
}

impl<S: Source> Room<S> {
    /// Puts a source into the room of these responses, or of others up to `longest_s` long later.
    ///
    /// # Errors
    /// What [`RoomReverb::new`] refuses.
    pub fn new(source: S, responses: &[ImpulseResponse; 2], longest_s: f64) -> Result<Self, Error> {
        let rate_hz = responses[0].sample_rate_hz();
        let config = RoomReverbConfig {
            sample_rate_hz: rate_hz,
            block: BLOCK,
            longest_s,
            ..RoomReverbConfig::default()
        };
        let reverb = RoomReverb::new(responses, config)?;
        // The reverb accepts 1000 Hz and more.
        let sample_rate = SampleRate::new(rate_hz).unwrap_or(SampleRate::MIN);
        let mut room = Self {
            source: UniformSourceIterator::new(source, STEREO, sample_rate),
            tail: reverb.tail_samples(),
            reverb,
            sample_rate,
            mono: [0.0; BLOCK],
            stereo: [0.0; 2 * BLOCK],
            given: 0,
            ready: 0,
        };
        // The first block out is the latency: silence.
        room.convolve_block();
        room.given = room.ready;
        Ok(room)
    }

    /// Changes gains and responses while the source plays, from any thread.
    pub fn control(&self) -> RoomReverbControl {
        self.reverb.control()
    }

    /// Reads a block of the source, or silence for its tail, and convolves it. False when the tail has ended.
    fn convolve_block(&mut self) -> bool {
        let mut frames = 0;
        while frames < BLOCK {
            let (Some(left), right) = (self.source.next(), self.source.next()) else { break };
            self.mono[frames] = 0.5 * (left + right.unwrap_or(left));
            frames += 1;
        }
        let silent = self.tail.min(BLOCK - frames);
        self.mono[frames..frames + silent].fill(0.0);
        self.tail -= silent;
        frames += silent;
        let (input, output) = (&self.mono[..frames], &mut self.stereo[..2 * frames]);
        let done = self.reverb.process_interleaved(input, output);
        debug_assert!(done.is_ok(), "one channel in, two out");
        (self.given, self.ready) = (0, 2 * frames);
        frames > 0
    }
}

impl<S: Source> Iterator for Room<S> {
    type Item = Sample;

    fn next(&mut self) -> Option<Sample> {
        if self.given == self.ready && !self.convolve_block() {
            return None;
        }
        self.given += 1;
        Some(self.stereo[self.given - 1])
    }
}

impl<S: Source> Source for Room<S> {
    fn current_span_len(&self) -> Option<usize> {
        None
    }

    fn channels(&self) -> ChannelCount {
        STEREO
    }

    fn sample_rate(&self) -> SampleRate {
        self.sample_rate
    }

    fn total_duration(&self) -> Option<Duration> {
        let tail = self.reverb.tail_samples() - self.reverb.latency_samples();
        Some(
            self.source.total_duration()?
                + Duration::from_secs_f64(tail as f64 / f64::from(self.sample_rate.get())),
        )
    }
}
