//! Sound on its way from the callback of one device to that of another.

use crate::{Error, Watch};
use dasp_sample::FromSample;
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A way for sound, `delay_s` long: short enough to play by, long enough that neither callback waits for the other.
///
/// Two devices have two clocks. Where the microphone's is slower, the reader runs dry now and then: it gives out silence until the
/// delay has gathered once more. Where it is faster, what does not fit is left out. Both are counted in the [`Watch`].
///
/// # Errors
/// [`Error::DeviceChannels`], [`Error::MicrophoneRate`], [`Error::Delay`].
pub fn microphone(
    channels: u16,
    microphone_hz: u32,
    output_hz: u32,
    delay_s: f64,
    watch: &Arc<Watch>,
) -> Result<(MicrophoneWriter, MicrophoneReader), Error> {
    let channels = check_channels(channels)?;
    if microphone_hz != output_hz {
        return Err(Error::MicrophoneRate { microphone_hz, output_hz });
    }
    if !(0.001..=2.0).contains(&delay_s) {
        return Err(Error::Delay { delay_s });
    }
    let delay = (delay_s * f64::from(output_hz)).ceil() as usize;
    let (ring, heard) = RingBuffer::new(2 * delay);
    let writer = MicrophoneWriter { ring, channels, watch: Arc::clone(watch) };
    Ok((writer, MicrophoneReader { heard, delay, gathering: true, watch: Arc::clone(watch) }))
}

pub(crate) fn check_channels(found: u16) -> Result<usize, Error> {
    if (1..=64).contains(&found) { Ok(usize::from(found)) } else { Err(Error::DeviceChannels { found }) }
}

/// For the callback of the microphone.
#[derive(Debug)]
pub struct MicrophoneWriter {
    ring: Producer<f32>,
    channels: usize,
    watch: Arc<Watch>,
}

impl MicrophoneWriter {
    /// Takes frames of any sample format, whose channels alternate; their mean is what is heard. What is not a number becomes
    /// silence: in a reverb it would sound for as long as the room does.
    pub fn write<T: Copy>(&mut self, input: &[T])
    where
        f32: FromSample<T>,
    {
        let mut left_out = 0;
        for frame in input.chunks_exact(self.channels) {
            let sum: f32 = frame.iter().map(|&sample| f32::from_sample_(sample)).sum();
            let mean = sum / self.channels as f32;
            let kept = self.ring.push(if mean.is_finite() { mean } else { 0.0 });
            left_out += u64::from(kept.is_err());
        }
        self.watch.microphone_left_out.fetch_add(left_out, Ordering::Relaxed);
    }
}

/// For the callback of the output.
#[derive(Debug)]
pub struct MicrophoneReader {
    heard: Consumer<f32>,
    delay: usize,
    /// Silence until as many frames lie ready as the delay has.
    gathering: bool,
    watch: Arc<Watch>,
}

impl MicrophoneReader {
    /// Gives out the next frames, mono.
    pub fn read(&mut self, output: &mut [f32]) {
        if self.gathering && self.heard.slots() < self.delay {
            return output.fill(0.0);
        }
        self.gathering = false;
        let (_, missing) = self.heard.pop_partial_slice(output);
        if !missing.is_empty() {
            missing.fill(0.0);
            self.gathering = true;
            self.watch.microphone_short.fetch_add(1, Ordering::Relaxed);
        }
    }
}
