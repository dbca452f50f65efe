//! The reverberation of a room as a node of the audio graph [firewheel].
//!
//! [`RoomNode`] holds what changes often, wet and dry: firewheel's own `Diff` sends it to the audio thread. [`RoomHandle`], the
//! custom state of the node, exchanges the room while it plays. Responses at another sample rate than the stream's are resampled,
//! at the start and when a stream with another rate follows.

pub mod offline;

use firewheel::Volume;
use firewheel::channel_config::{ChannelConfig, ChannelCount};
use firewheel::diff::{Diff, Patch};
use firewheel::event::ProcEvents;
use firewheel::node::{
    AudioNode, AudioNodeInfo, AudioNodeProcessor, ConstructProcessorContext, NodeError, ProcBuffers,
    ProcExtra, ProcInfo, ProcStreamCtx, ProcessStatus,
};
use firewheel::{FirewheelContext, StreamInfo, node::NodeID};
use sabine_acoustics::{ImpulseResponse, resample_response};
use sabine_eqfilter::{Error, RoomReverb, RoomReverbConfig, RoomReverbControl};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Gains of the node, from silence to 60 dB.
#[derive(Clone, Copy, Debug, Diff, PartialEq, Patch)]
pub struct RoomNode {
    /// Gain of the reverberation.
    pub wet: Volume,
    /// Gain of the sound as it came in, which is as late as the reverberation.
    pub dry: Volume,
}

impl Default for RoomNode {
    /// The reverberation alone: for a node beside the dry path.
    fn default() -> Self {
        Self { wet: Volume::UNITY_GAIN, dry: Volume::SILENT }
    }
}

/// What is fixed for the life of the node, and the first room.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomNodeConfig {
    /// Two responses, to the left and to the right, make a node with one input; four (left to left, left to right, right to left,
    /// right to right) a node with two. The default has none, and firewheel refuses the node.
    pub responses: Vec<ImpulseResponse>,
    /// Longest response in seconds, now and after a change.
    pub longest_s: f64,
    /// Frames that are convolved at a time: by so many the output is late.
    pub block: usize,
}

impl Default for RoomNodeConfig {
    fn default() -> Self {
        let RoomReverbConfig { longest_s, block, .. } = RoomReverbConfig::default();
        Self { responses: Vec::new(), longest_s, block }
    }
}

impl RoomNodeConfig {
    fn inputs(&self) -> usize {
        if self.responses.len() == 4 { 2 } else { 1 }
    }

    /// The reverb at a sample rate.
    fn reverb(&self, gains: RoomNode, sample_rate_hz: u32) -> Result<RoomReverb, Error> {
        let (wet, dry) = (gains.wet.amp(), gains.dry.amp());
        let (inputs, block, longest_s) = (self.inputs(), self.block, self.longest_s);
        let config =
            RoomReverbConfig { sample_rate_hz, inputs, block, longest_s, wet, dry, ..Default::default() };
        RoomReverb::new(&at_rate(&self.responses, sample_rate_hz)?, config)
    }

    /// Refuses here what would otherwise fail once a stream starts.
    fn check(&self, gains: RoomNode) -> Result<(), Error> {
        let sample_rate_hz = self.responses.first().map_or(48_000, ImpulseResponse::sample_rate_hz);
        self.reverb(gains, sample_rate_hz).map(drop)
    }
}

/// The room that is heard, and the way to the reverb that runs it, if a stream runs.
struct Room {
    config: RoomNodeConfig,
    control: Option<RoomReverbControl>,
}

/// Exchanges the room of a node, from any thread. It may be cloned.
#[derive(Clone)]
pub struct RoomHandle {
    room: Arc<Mutex<Room>>,
}

impl RoomHandle {
    /// The handle of a [`RoomNode`]; none if `node` is another kind of node.
    pub fn of(context: &FirewheelContext, node: NodeID) -> Option<Self> {
        context.node_state::<Self>(node).cloned()
    }

    /// Cross-fades into another room, of as many responses. Where no stream runs yet, the next one starts with it.
    ///
    /// # Errors
    /// What [`RoomReverbControl::exchange`] refuses; the room stays as it is then.
    pub fn change_room(&self, responses: Vec<ImpulseResponse>) -> Result<(), Error> {
        let mut room = lock(&self.room);
        let (expected, found) = (room.config.responses.len(), responses.len());
        if found != expected {
            return Err(Error::Responses { expected, found });
        }
        let config = RoomNodeConfig { responses, ..room.config.clone() };
        match &room.control {
            Some(control) => control.exchange(&at_rate(&config.responses, control.sample_rate_hz())?)?,
            None => config.check(RoomNode::default())?,
        }
        room.config = config;
        Ok(())
    }

    /// Frees the room that was exchanged last: otherwise the next exchange does.
    pub fn collect(&self) {
        if let Some(control) = &lock(&self.room).control {
            control.collect();
        }
    }
}

impl AudioNode for RoomNode {
    type Configuration = RoomNodeConfig;

    fn info(&self, config: &RoomNodeConfig) -> Result<AudioNodeInfo, NodeError> {
        config.check(*self)?;
        let channels = ChannelConfig::new(ChannelCount::from(config.inputs()), ChannelCount::STEREO);
        let room = Arc::new(Mutex::new(Room { config: config.clone(), control: None }));
        Ok(AudioNodeInfo::new()
            .debug_name("room")
            .channel_config(channels)
            .latency_frames(config.block as u32)
            .custom_state(RoomHandle { room }))
    }

    fn construct_processor(
        &self,
        config: &RoomNodeConfig,
        context: ConstructProcessorContext,
    ) -> Result<impl AudioNodeProcessor, NodeError> {
        let handle = match context.custom_state::<RoomHandle>() {
            Some(handle) => handle.clone(),
            // firewheel keeps the state that `info` made.
            None => RoomHandle { room: Arc::new(Mutex::new(Room { config: config.clone(), control: None })) },
        };
        let (reverb, control) = start(&mut lock(&handle.room), *self, context.stream_info.sample_rate.get())?;
        Ok(RoomProcessor { gains: *self, reverb: Some(reverb), control, room: handle.room })
    }
}

/// Takes up the room at the sample rate of a stream. Not for the audio thread.
fn start(
    room: &mut Room,
    gains: RoomNode,
    sample_rate_hz: u32,
) -> Result<(RoomReverb, RoomReverbControl), Error> {
    room.control = None;
    let reverb = room.config.reverb(gains, sample_rate_hz)?;
    let control = reverb.control();
    room.control = Some(control.clone());
    Ok((reverb, control))
}

/// What runs in the audio thread.
struct RoomProcessor {
    gains: RoomNode,
    /// None at a sample rate that the responses cannot be brought to: the node is silent then.
    reverb: Option<RoomReverb>,
    control: RoomReverbControl,
    /// Shared with the handle. Nothing that runs in the audio thread touches it.
    room: Arc<Mutex<Room>>,
}

impl AudioNodeProcessor for RoomProcessor {
    fn events(&mut self, _info: &ProcInfo, events: &mut ProcEvents, extra: &mut ProcExtra) {
        for patch in events.drain_patches::<RoomNode>() {
            let done = match &patch {
                RoomNodePatch::Wet(gain) => self.control.set_wet(gain.amp()),
                RoomNodePatch::Dry(gain) => self.control.set_dry(gain.amp()),
            };
            match done {
                Ok(()) => self.gains.apply(patch),
                Err(_) => {
                    // Where the log is full, nothing else is to be done in the audio thread.
                    let message = "room: a gain must be a number of up to 60 dB; it stays as it was";
                    let _ = extra.logger.try_error(message);
                }
            }
        }
    }

    fn bypassed(&mut self, _bypassed: bool) {
        // Nothing of what was heard before a pause is heard after it.
        if let Some(reverb) = &mut self.reverb {
            reverb.clear();
        }
    }

    fn process(&mut self, _info: &ProcInfo, buffers: ProcBuffers, _extra: &mut ProcExtra) -> ProcessStatus {
        let Some(reverb) = &mut self.reverb else { return ProcessStatus::ClearAllOutputs };
        match reverb.process_planar(buffers.inputs, buffers.outputs) {
            Ok(()) => ProcessStatus::OutputsModified,
            Err(_) => {
                debug_assert!(false, "firewheel hands in the channels that `info` asks for, equally long");
                ProcessStatus::ClearAllOutputs
            }
        }
    }

    fn new_stream(&mut self, stream_info: &StreamInfo, context: &mut ProcStreamCtx) {
        self.reverb = None;
        match start(&mut lock(&self.room), self.gains, stream_info.sample_rate.get()) {
            Ok((reverb, control)) => (self.reverb, self.control) = (Some(reverb), control),
            Err(error) => {
                let _ = context.logger.try_error_with(|text| text.push_str(&format!("room: {error}")));
            }
        }
    }
}

fn at_rate(responses: &[ImpulseResponse], sample_rate_hz: u32) -> Result<Vec<ImpulseResponse>, Error> {
    responses.iter().map(|response| Ok(resample_response(response, sample_rate_hz)?)).collect()
}

/// A room is whole whenever it is unlocked: what a panic elsewhere left is used on.
fn lock(room: &Mutex<Room>) -> MutexGuard<'_, Room> {
    room.lock().unwrap_or_else(PoisonError::into_inner)
}
