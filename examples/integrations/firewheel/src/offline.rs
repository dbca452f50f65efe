//! A stream that renders into memory in place of a sound card.

use audioadapter_buffers::direct::InterleavedSlice;
use firewheel::backend::BackendProcessInfo;
use firewheel::error::ActivateError;
use firewheel::node::StreamStatus;
use firewheel::processor::FirewheelProcessor;
use firewheel::{ActivateInfo, FirewheelContext};
use std::num::NonZeroU32;
use std::time::Duration;

/// Renders when asked to: stereo out, and as many channels in as the graph has inputs.
pub struct Offline {
    processor: FirewheelProcessor,
    inputs: usize,
}

impl Offline {
    /// Starts the graph. `inputs` is the number of channels that [`Offline::render`] is given.
    ///
    /// # Errors
    /// What firewheel refuses: a stream that runs already, a node that cannot run at the sample rate.
    pub fn start(
        context: &mut FirewheelContext,
        sample_rate_hz: NonZeroU32,
        inputs: u32,
    ) -> Result<Self, ActivateError> {
        let processor = context.activate(ActivateInfo {
            sample_rate: sample_rate_hz,
            max_block_frames: NonZeroU32::new(1024).unwrap_or(NonZeroU32::MIN),
            num_stream_in_channels: inputs,
            num_stream_out_channels: 2,
            input_to_output_latency_seconds: 0.0,
        })?;
        Ok(Self { processor, inputs: inputs as usize })
    }

    /// One call of a sound card: channels alternate from sample to sample, and a part of a frame at the end is left as it is.
    pub fn render(&mut self, input: &[f32], output: &mut [f32]) {
        let frames = output.len() / 2;
        let given = input.len().checked_div(self.inputs).unwrap_or(frames);
        let frames = frames.min(given);
        let (Ok(input), Ok(mut output)) =
            (InterleavedSlice::new(input, self.inputs, frames), InterleavedSlice::new_mut(output, 2, frames))
        else {
            return;
        };
        let info = BackendProcessInfo {
            frames,
            process_timestamp: None,
            duration_since_stream_start: Duration::ZERO,
            input_stream_status: StreamStatus::empty(),
            output_stream_status: StreamStatus::empty(),
            dropped_frames: 0,
            process_to_playback_delay: None,
        };
        self.processor.process(&input, &mut output, info);
    }
}
