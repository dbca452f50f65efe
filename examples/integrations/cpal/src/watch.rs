//! What happens in the callbacks, seen from outside of them.

use crate::Error;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A device that asks for no sound for so long has vanished. Callbacks come every 5 to 100 ms.
const PATIENCE: Duration = Duration::from_secs(2);

/// Counted since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Callbacks of the output.
    pub callbacks: u64,
    /// Frames that they asked for.
    pub frames: u64,
    /// Callbacks that took longer than what they gave out lasts.
    pub missed: u64,
    /// The longest callback, as a share of what it gave out lasts.
    pub longest: f32,
    /// Time in callbacks, as a share of all that they gave out.
    pub load: f64,
    /// Gaps that the sound system reported.
    pub gaps: u64,
    /// Faults that it reported and may have got over.
    pub faults: u64,
    /// Times that the microphone had too little, and silence took its place.
    pub microphone_short: u64,
    /// Frames of the microphone that came too fast and were left out.
    pub microphone_left_out: u64,
}

/// Shared between the callbacks, which write, and a thread that looks after them. The callbacks only count: they wait for nobody.
#[derive(Debug)]
pub struct Watch {
    start: Instant,
    callbacks: AtomicU64,
    frames: AtomicU64,
    missed: AtomicU64,
    longest: AtomicU32,
    busy_ns: AtomicU64,
    sound_ns: AtomicU64,
    last_ns: AtomicU64,
    gaps: AtomicU64,
    faults: AtomicU64,
    pub(crate) microphone_short: AtomicU64,
    pub(crate) microphone_left_out: AtomicU64,
    /// What the sound system said last, for the error that may follow.
    fault: Mutex<Option<String>>,
    ended: Mutex<Option<(&'static str, String)>>,
}

impl Default for Watch {
    fn default() -> Self {
        Self {
            start: Instant::now(),
            callbacks: AtomicU64::new(0),
            frames: AtomicU64::new(0),
            missed: AtomicU64::new(0),
            longest: AtomicU32::new(0),
            busy_ns: AtomicU64::new(0),
            sound_ns: AtomicU64::new(0),
            last_ns: AtomicU64::new(0),
            gaps: AtomicU64::new(0),
            faults: AtomicU64::new(0),
            microphone_short: AtomicU64::new(0),
            microphone_left_out: AtomicU64::new(0),
            fault: Mutex::new(None),
            ended: Mutex::new(None),
        }
    }
}

impl Watch {
    /// A callback of the output has ended.
    pub fn called_back(&self, begin: Instant, end: Instant, frames: usize, sample_rate_hz: u32) {
        let (busy, sound_s) = (end.duration_since(begin), frames as f64 / f64::from(sample_rate_hz));
        self.callbacks.fetch_add(1, Ordering::Relaxed);
        self.frames.fetch_add(frames as u64, Ordering::Relaxed);
        self.busy_ns.fetch_add(busy.as_nanos() as u64, Ordering::Relaxed);
        self.sound_ns.fetch_add((1e9 * sound_s) as u64, Ordering::Relaxed);
        self.last_ns.store(end.duration_since(self.start).as_nanos() as u64, Ordering::Relaxed);
        if frames > 0 {
            let share = busy.as_secs_f64() / sound_s;
            self.missed.fetch_add(u64::from(share > 1.0), Ordering::Relaxed);
            // Numbers that are not negative are ordered as their bits are.
            self.longest.fetch_max((share as f32).to_bits(), Ordering::Relaxed);
        }
    }

    /// The sound system reports a gap in the sound that it has got over.
    pub fn gap(&self) {
        self.gaps.fetch_add(1, Ordering::Relaxed);
    }

    /// The sound system reports a fault that it may get over. If it does not, the output falls silent, and [`Watch::check`] says so.
    pub fn fault(&self, device: &'static str, reason: &str) {
        self.faults.fetch_add(1, Ordering::Relaxed);
        *self.fault.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("the {device}: {reason}"));
    }

    /// The sound system reports that a device works no more. The first report counts.
    pub fn end(&self, device: &'static str, reason: String) {
        let mut ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        ended.get_or_insert((device, reason));
    }

    /// The figures so far, as long as the devices work.
    ///
    /// # Errors
    /// [`Error::Gone`] after [`Watch::end`], [`Error::Silent`] if the output has not called back for two seconds before `now`.
    pub fn check(&self, now: Instant) -> Result<Figures, Error> {
        if let Some((device, reason)) = self.ended.lock().unwrap_or_else(PoisonError::into_inner).clone() {
            return Err(Error::Gone { device, reason });
        }
        let last = Duration::from_nanos(self.last_ns.load(Ordering::Relaxed));
        let since = now.duration_since(self.start).saturating_sub(last);
        if since > PATIENCE {
            let fault = self.last_fault().unwrap_or_else(|| "no fault is known".into());
            return Err(Error::Silent { since, fault });
        }
        Ok(self.figures())
    }

    /// What the sound system said with the last fault.
    pub fn last_fault(&self) -> Option<String> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The figures so far.
    pub fn figures(&self) -> Figures {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Figures {
            callbacks: count(&self.callbacks),
            frames: count(&self.frames),
            missed: count(&self.missed),
            longest: f32::from_bits(self.longest.load(Ordering::Relaxed)),
            load: count(&self.busy_ns) as f64 / count(&self.sound_ns).max(1) as f64,
            gaps: count(&self.gaps),
            faults: count(&self.faults),
            microphone_short: count(&self.microphone_short),
            microphone_left_out: count(&self.microphone_left_out),
        }
    }
}
