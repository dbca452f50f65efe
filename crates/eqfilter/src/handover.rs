//! What other threads say to a reverb at work, and how responses change hands without waiting.

use crate::Error;
use crate::layout::{Layout, PreparedResponse};
use sabine_acoustics::{ImpulseResponse, OutOfRange};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, TryLockError};

/// Place for one set of responses on its way to another thread.
///
/// Both sides only ever try the lock. So neither sleeps, and neither makes a system call to wake the other: the audio
/// thread, if it finds the slot in use, comes back with the next block.
#[derive(Debug, Default)]
struct Slot(Mutex<Option<Box<PreparedResponse>>>);

impl Slot {
    /// Exchanges the content, unless the other side uses the slot at this moment.
    fn try_swap(&self, content: &mut Option<Box<PreparedResponse>>) -> bool {
        let mut guard = match self.0.try_lock() {
            Ok(guard) => guard,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return false,
        };
        std::mem::swap(&mut *guard, content);
        true
    }

    /// Exchanges the content; for threads that may wait.
    fn swap(&self, mut content: Option<Box<PreparedResponse>>) -> Option<Box<PreparedResponse>> {
        while !self.try_swap(&mut content) {
            std::thread::yield_now();
        }
        content
    }
}

/// What the audio thread and the others share.
#[derive(Debug)]
pub(crate) struct Shared {
    /// Gains as bits of an `f32`.
    wet: AtomicU32,
    dry: AtomicU32,
    incoming: Slot,
    retired: Slot,
}

impl Shared {
    pub fn new(wet: f32, dry: f32) -> Self {
        Self {
            wet: AtomicU32::new(wet.to_bits()),
            dry: AtomicU32::new(dry.to_bits()),
            incoming: Slot::default(),
            retired: Slot::default(),
        }
    }

    pub fn wet(&self) -> f32 {
        f32::from_bits(self.wet.load(Ordering::Relaxed))
    }

    pub fn dry(&self) -> f32 {
        f32::from_bits(self.dry.load(Ordering::Relaxed))
    }

    /// Responses that wait to be taken up.
    pub fn take_incoming(&self) -> Option<Box<PreparedResponse>> {
        let mut content = None;
        self.incoming.try_swap(&mut content);
        content
    }

    /// Puts responses aside to be dropped by another thread. If others lie there still, these come back in their place.
    pub fn retire(&self, responses: &mut Option<Box<PreparedResponse>>) {
        self.retired.try_swap(responses);
    }
}

/// Steers a [`RoomReverb`](crate::RoomReverb) from other threads: gains and responses.
///
/// It may be cloned, and it may outlive the reverb.
#[derive(Clone, Debug)]
pub struct RoomReverbControl {
    layout: Layout,
    sample_rate_hz: u32,
    shared: Arc<Shared>,
}

impl RoomReverbControl {
    pub(crate) fn new(layout: Layout, sample_rate_hz: u32, shared: Arc<Shared>) -> Self {
        Self { layout, sample_rate_hz, shared }
    }

    /// Sample rate that responses must have, in Hz.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Gain of the convolved sound, as a factor of amplitude from -1000 to 1000. It is reached in a straight line within the
    /// fade of the reverb's settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`].
    pub fn set_wet(&self, gain: f32) -> Result<(), Error> {
        check_gain("wet", gain)?;
        self.shared.wet.store(gain.to_bits(), Ordering::Relaxed);
        Ok(())
    }

    /// Gain of the sound as it came in, as [`RoomReverbControl::set_wet`].
    ///
    /// # Errors
    /// [`Error::OutOfRange`].
    pub fn set_dry(&self, gain: f32) -> Result<(), Error> {
        check_gain("dry", gain)?;
        self.shared.dry.store(gain.to_bits(), Ordering::Relaxed);
        Ok(())
    }

    /// Transforms new responses on this thread and leaves them for the audio thread, which cross-fades all of them together. If
    /// others wait there still, these take their place. Responses that went out of use earlier are dropped here.
    ///
    /// # Errors
    /// [`Error::Responses`], [`Error::ResponseRate`], [`Error::ResponseLength`], [`Error::NotFinite`]; the sound stays as it is then.
    pub fn exchange(&self, responses: &[ImpulseResponse]) -> Result<(), Error> {
        let prepared = prepare(&self.layout, responses, self.sample_rate_hz)?;
        self.collect();
        self.shared.incoming.swap(Some(Box::new(prepared)));
        Ok(())
    }

    /// Drops responses that have gone out of use; true if there were any. Without it they stay in memory until the next exchange.
    pub fn collect(&self) -> bool {
        self.shared.retired.swap(None).is_some()
    }
}

pub(crate) fn check_gain(field: &'static str, gain: f32) -> Result<(), Error> {
    OutOfRange::check(field, f64::from(gain), -1000.0, 1000.0, "between -1000 and 1000")?;
    Ok(())
}

/// Transforms responses at the sample rate of the reverb.
pub(crate) fn prepare(
    layout: &Layout,
    responses: &[ImpulseResponse],
    reverb_hz: u32,
) -> Result<PreparedResponse, Error> {
    for response_hz in responses.iter().map(ImpulseResponse::sample_rate_hz) {
        if response_hz != reverb_hz {
            return Err(Error::ResponseRate { reverb_hz, response_hz });
        }
    }
    layout.prepare(&responses.iter().map(ImpulseResponse::samples).collect::<Vec<_>>())
}
