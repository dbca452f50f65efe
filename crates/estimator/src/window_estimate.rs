//! What the windows of a recording say, before and after they are joined.

use crate::evidence::Evidence;
use crate::labels::LABEL_COUNT;
use crate::warning::Warning;
use crate::windows::Loudness;
use sabine_acoustics::RoomTargets;

/// What one window of a recording says.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowEstimate {
    /// Its beginning in seconds.
    pub start_s: f64,
    /// Its targets.
    pub targets: RoomTargets,
    /// Its share in the joint estimate, 0..=1; 0 without speech.
    pub weight: f64,
}

/// An estimate with all that is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct DetailedEstimate {
    /// The joint estimate of all windows.
    pub targets: RoomTargets,
    /// The windows that it is made of, in order.
    pub windows: Vec<WindowEstimate>,
    /// Reasons to trust it less.
    pub warnings: Vec<Warning>,
    /// What the recording says apart from what rooms are like in general, for [`Estimator::combine`](crate::Estimator::combine).
    pub evidence: Evidence,
}

/// What one window says, on the scale of the network.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WindowOutput {
    /// Standardised labels.
    pub mean: [f64; LABEL_COUNT],
    /// Their calibrated standard deviations.
    pub deviation: [f64; LABEL_COUNT],
    /// How unlike the training set the window is.
    pub novelty: f64,
}

/// A window that was heard, not yet weighed against others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HeardWindow {
    /// Its first frame.
    pub first: usize,
    pub loudness: Loudness,
    pub output: WindowOutput,
    /// Cues for warnings; none of small windows.
    pub cues: Vec<f64>,
}
