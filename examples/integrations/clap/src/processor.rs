//! The audio thread: no memory, no file, no lock.

use crate::LATENCY_SAMPLES;
use crate::main_thread::MainThread;
use crate::parameters::Parameter;
use crate::shared::Shared;
use clack_extensions::params::PluginAudioProcessorParams;
use clack_extensions::tail::{HostTail, PluginTailImpl, TailLength};
use clack_plugin::events::event_types::ParamValueEvent;
use clack_plugin::prelude::*;
use sabine_eqfilter::{RoomReverb, RoomReverbControl};
use std::ops::Range;

/// Frames that are convolved at a time, in buffers of the processor's own: a host may give one buffer for input and output.
const PORTION: usize = 256;
/// What is louder is no sound: 120 dB beyond full scale. Nor is what is not a number. Both would stay in the reverberation for seconds.
const LOUDEST: f32 = 1e6;

/// What belongs to the audio thread.
pub struct Processor<'a> {
    host: HostAudioProcessorHandle<'a>,
    host_tail: Option<HostTail>,
    shared: &'a Shared<'a>,
    reverb: RoomReverb,
    control: RoomReverbControl,
    input: [[f32; PORTION]; 2],
    output: [[f32; PORTION]; 2],
    /// Length of the response that the host was told of, in samples.
    told_samples: u32,
    /// Bad input is told of once.
    told_bad_input: bool,
}

impl<'a> PluginAudioProcessor<'a, Shared<'a>, MainThread<'a>> for Processor<'a> {
    fn activate(
        host: HostAudioProcessorHandle<'a>,
        main_thread: &MainThread<'a>,
        shared: &'a Shared<'a>,
        audio_config: PluginAudioConfiguration,
    ) -> Result<Self, PluginError> {
        let reverb =
            main_thread.activate(audio_config.sample_rate).map_err(|error| PluginError::Error(error))?;
        Ok(Self {
            host_tail: host.get_extension(),
            host,
            shared,
            control: reverb.control(),
            reverb,
            input: [[0.0; PORTION]; 2],
            output: [[0.0; PORTION]; 2],
            told_samples: shared.response_samples(),
            told_bad_input: false,
        })
    }

    fn process(
        &mut self,
        _process: Process,
        mut audio: Audio,
        events: Events,
    ) -> Result<ProcessStatus, PluginError> {
        let frames = audio.frames_count() as usize;
        let mut sides = [None, None];
        if let Some(mut ports) = audio.port_pair(0) {
            let channels = ports.channels()?.into_f32();
            let mut channels =
                channels.ok_or(PluginError::Message("64-bit samples were not offered"))?.into_iter();
            sides = [channels.next(), channels.next()];
            for mut further in channels {
                output(&mut further).fill(0.0);
            }
        }
        let mut done = 0;
        for event in events.input {
            // Values hold from their sample on; one that comes out of order holds at once.
            let at = (event.header().time() as usize).clamp(done, frames);
            self.convolve(&mut sides, done..at);
            done = at;
            self.take(event);
        }
        self.convolve(&mut sides, done..frames);
        self.tell_tail();
        Ok(ProcessStatus::Tail)
    }

    fn deactivate(self, main_thread: &MainThread<'a>) {
        main_thread.deactivate();
    }

    fn reset(&mut self) {
        self.reverb.clear();
        self.told_bad_input = false;
    }
}

impl Processor<'_> {
    fn take(&mut self, event: &UnknownEvent) {
        let changed = event.as_event().and_then(|event: &ParamValueEvent| self.shared.set_by_event(event));
        let set = match changed {
            Some(Parameter::Wet) => self.control.set_wet(self.shared.parameters.factor(Parameter::Wet)),
            Some(Parameter::Dry) => self.control.set_dry(self.shared.parameters.factor(Parameter::Dry)),
            Some(Parameter::Room) | None => Ok(()),
        };
        debug_assert!(set.is_ok(), "gains are kept in range");
    }

    /// Convolves these frames of a block. A channel that the host does not give is silent.
    fn convolve(&mut self, sides: &mut [Option<ChannelPair<f32>>; 2], frames: Range<usize>) {
        let inputs = self.reverb.config().inputs;
        for start in frames.clone().step_by(PORTION) {
            let part = start..frames.end.min(start + PORTION);
            let length = part.len();
            let mut all_sound = true;
            for (own, side) in self.input.iter_mut().zip(&*sides) {
                match side.as_ref().and_then(ChannelPair::input) {
                    Some(given) => all_sound &= copy_sound(&given[part.clone()], &mut own[..length]),
                    None => own[..length].fill(0.0),
                }
            }
            if !all_sound && !self.told_bad_input {
                self.told_bad_input = true;
                self.shared.tell_bad_input();
            }
            let [left, right] = &self.input;
            let given = [&left[..length], &right[..length]];
            let [left, right] = &mut self.output;
            let done = self
                .reverb
                .process_planar(&given[..inputs], &mut [&mut left[..length], &mut right[..length]]);
            debug_assert!(done.is_ok(), "channels of the settings, equally long");
            for (side, own) in sides.iter_mut().zip(&self.output) {
                if let Some(channel) = side {
                    let wanted = output(channel);
                    if !wanted.is_empty() {
                        wanted[part.clone()].copy_from_slice(&own[..length]);
                    }
                }
            }
        }
    }

    fn tell_tail(&mut self) {
        let samples = self.shared.response_samples();
        if samples != self.told_samples {
            self.told_samples = samples;
            if let Some(tail) = self.host_tail {
                tail.changed(&mut self.host);
            }
        }
    }
}

/// Where a channel is to be written; empty if it is an input alone.
fn output<'s>(channel: &'s mut ChannelPair<'_, f32>) -> &'s mut [f32] {
    match channel {
        ChannelPair::OutputOnly(out) | ChannelPair::InputOutput(_, out) | ChannelPair::InPlace(out) => out,
        ChannelPair::InputOnly(_) => &mut [],
    }
}

/// Copies sound; what is none becomes silence. False if there was any.
fn copy_sound(from: &[f32], to: &mut [f32]) -> bool {
    let mut all_sound = true;
    for (&from, to) in from.iter().zip(to) {
        // False for what is not a number, too.
        let is_sound = from.abs() <= LOUDEST;
        *to = if is_sound { from } else { 0.0 };
        all_sound &= is_sound;
    }
    all_sound
}

impl PluginTailImpl for Processor<'_> {
    fn get(&self) -> TailLength {
        TailLength::Finite((LATENCY_SAMPLES + self.shared.response_samples()).saturating_sub(1))
    }
}

impl PluginAudioProcessorParams for Processor<'_> {
    fn flush(&mut self, changes: &InputEvents, _answers: &mut OutputEvents) {
        for event in changes {
            self.take(event);
        }
    }
}
