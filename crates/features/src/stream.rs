//! Log-mel frames of live input.

use crate::log_mel::{LogMel, LogMelScratch};

/// Log-mel frames as samples come in, in pieces of any length: the same numbers, bit for bit, as
/// [`LogMel::extract_into`] gives for the whole signal.
///
/// A frame is ready as soon as its last sample is in. Nothing is allocated after construction.
///
/// ```
/// use sabine_features::{LogMel, LogMelConfig};
/// let mut stream = LogMel::new(LogMelConfig::default())?.stream();
/// let mut frames = 0;
/// for piece in vec![0.5_f32; 16_000].chunks(441) {
///     stream.push(piece, |levels_db| {
///         assert_eq!(levels_db.len(), 32);
///         frames += 1;
///     });
/// }
/// assert_eq!(frames, 124);
/// # Ok::<(), sabine_features::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct LogMelStream {
    log_mel: LogMel,
    scratch: LogMelScratch,
    /// The samples of the frame under way; `filled` of them are in.
    frame: Vec<f32>,
    filled: usize,
    levels_db: Vec<f32>,
}

impl LogMelStream {
    /// Starts with no samples.
    pub fn new(log_mel: &LogMel) -> Self {
        Self {
            scratch: log_mel.scratch(),
            frame: vec![0.0; log_mel.config().n_fft],
            filled: 0,
            levels_db: vec![0.0; log_mel.bands().len()],
            log_mel: log_mel.clone(),
        }
    }

    /// Takes samples and hands the levels in dB of each frame they complete to `on_frame`, lowest band first.
    pub fn push(&mut self, samples: &[f32], mut on_frame: impl FnMut(&[f32])) {
        let mut rest = samples;
        while !rest.is_empty() {
            let taken = rest.len().min(self.frame.len() - self.filled);
            let (now, later) = rest.split_at(taken);
            self.frame[self.filled..][..taken].copy_from_slice(now);
            self.filled += taken;
            rest = later;
            if self.filled == self.frame.len() {
                self.log_mel.frame_levels(&self.frame, &mut self.scratch, &mut self.levels_db);
                on_frame(&self.levels_db);
                let hop = self.log_mel.config().hop;
                self.frame.copy_within(hop.., 0);
                self.filled -= hop;
            }
        }
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.filled = 0;
    }
}
