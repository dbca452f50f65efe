//! The reverberation of a room as an effect of [kira].
//!
//! Put [`RoomEffectBuilder`] on a send track: the game's sounds reach the main track dry, and the room by their send volume.
//! Responses at another sample rate than the engine's are resampled, at the start and when the engine changes its rate.

pub mod offline;

use kira::Frame;
use kira::effect::{Effect, EffectBuilder};
use kira::info::Info;
use sabine_acoustics::{ImpulseResponse, resample_response};
use sabine_eqfilter::{Error, RoomReverb, RoomReverbConfig, RoomReverbControl};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Frames that are convolved at a time: the reverberation is late by so many.
pub const BLOCK: usize = 64;
/// Frames that the effect hands on at a time, in buffers on the stack.
const PORTION: usize = 256;

/// Responses to the left and to the right, and the way to the reverb that runs them.
struct Room {
    responses: [ImpulseResponse; 2],
    control: RoomReverbControl,
}

/// Builds the effect. kira creates effects without a result, so everything that can fail fails in [`RoomEffectBuilder::new`].
pub struct RoomEffectBuilder {
    reverb: RoomReverb,
    room: Room,
}

impl RoomEffectBuilder {
    /// From the responses to the left and to the right, up to `longest_s` seconds long now and after a change.
    ///
    /// # Errors
    /// What [`RoomReverb::new`] refuses.
    pub fn new(responses: [ImpulseResponse; 2], longest_s: f64) -> Result<Self, Error> {
        let sample_rate_hz = responses[0].sample_rate_hz();
        let config =
            RoomReverbConfig { sample_rate_hz, block: BLOCK, longest_s, ..RoomReverbConfig::default() };
        let reverb = RoomReverb::new(&responses, config)?;
        let control = reverb.control();
        Ok(Self { reverb, room: Room { responses, control } })
    }
}

impl EffectBuilder for RoomEffectBuilder {
    type Handle = RoomHandle;

    fn build(self) -> (Box<dyn Effect>, RoomHandle) {
        let room = Arc::new(Mutex::new(self.room));
        let config = self.reverb.config();
        let effect = RoomEffect { config, reverb: Some(self.reverb), room: Arc::clone(&room) };
        (Box::new(effect), RoomHandle { room })
    }
}

/// Changes the room while the game runs.
pub struct RoomHandle {
    room: Arc<Mutex<Room>>,
}

impl RoomHandle {
    /// Cross-fades into another room.
    ///
    /// # Errors
    /// What [`RoomReverbControl::exchange`] refuses.
    pub fn change_room(&self, responses: [ImpulseResponse; 2]) -> Result<(), Error> {
        let mut room = lock(&self.room);
        room.control.exchange(&at_rate(&responses, room.control.sample_rate_hz())?)?;
        room.responses = responses;
        Ok(())
    }

    /// Gain of the reverberation, as a factor of amplitude.
    ///
    /// # Errors
    /// What [`RoomReverbControl::set_wet`] refuses.
    pub fn set_gain(&self, gain: f32) -> Result<(), Error> {
        lock(&self.room).control.set_wet(gain)
    }
}

struct RoomEffect {
    config: RoomReverbConfig,
    /// None at a sample rate that the responses cannot be brought to: the effect is silent then.
    reverb: Option<RoomReverb>,
    /// Shared with the handle. [`Effect::process`] does not touch it.
    room: Arc<Mutex<Room>>,
}

impl Effect for RoomEffect {
    fn init(&mut self, sample_rate_hz: u32, _internal_buffer_size: usize) {
        self.on_change_sample_rate(sample_rate_hz);
    }

    fn on_change_sample_rate(&mut self, sample_rate_hz: u32) {
        let mut room = lock(&self.room);
        if self.config.sample_rate_hz != sample_rate_hz {
            self.config.sample_rate_hz = sample_rate_hz;
            let responses = at_rate(&room.responses, sample_rate_hz);
            self.reverb = responses.and_then(|responses| RoomReverb::new(&responses, self.config)).ok();
            if let Some(reverb) = &self.reverb {
                room.control = reverb.control();
            }
        }
    }

    fn process(&mut self, frames: &mut [Frame], _dt: f64, _info: &Info) {
        let Some(reverb) = &mut self.reverb else { return frames.fill(Frame::ZERO) };
        let (mut mono, mut left, mut right) = ([0.0; PORTION], [0.0; PORTION], [0.0; PORTION]);
        for frames in frames.chunks_mut(PORTION) {
            let (mono, left, right) =
                (&mut mono[..frames.len()], &mut left[..frames.len()], &mut right[..frames.len()]);
            for (mono, frame) in mono.iter_mut().zip(&*frames) {
                *mono = 0.5 * (frame.left + frame.right);
            }
            let done = reverb.process_planar(&[mono], &mut [left, right]);
            debug_assert!(done.is_ok(), "one channel in, two out, equally long");
            for (frame, (&left, &right)) in frames.iter_mut().zip(left.iter().zip(&*right)) {
                *frame = Frame::new(left, right);
            }
        }
    }
}

fn at_rate(responses: &[ImpulseResponse; 2], sample_rate_hz: u32) -> Result<Vec<ImpulseResponse>, Error> {
    responses.iter().map(|response| Ok(resample_response(response, sample_rate_hz)?)).collect()
}

/// A room is whole whenever it is unlocked: what a panic elsewhere left is used on.
fn lock(room: &Mutex<Room>) -> MutexGuard<'_, Room> {
    room.lock().unwrap_or_else(PoisonError::into_inner)
}
