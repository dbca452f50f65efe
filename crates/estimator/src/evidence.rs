//! What one recording says of its room, before what is known of rooms in general.

use crate::combination::Levels;
use crate::joint::JointLabel;
use crate::labels::{LABEL_COUNT, T60_COUNT};

/// What one recording says of its room on the scale of the network: one reading of the thirteen labels, and the cues that warnings
/// rest on.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    joint: [JointLabel; LABEL_COUNT],
    cues: Vec<f64>,
}

impl Evidence {
    pub(crate) fn new(joint: [JointLabel; LABEL_COUNT], cues: Vec<f64>) -> Self {
        Self { joint, cues }
    }

    pub(crate) fn joint(&self, label: usize) -> &JointLabel {
        &self.joint[label]
    }

    pub(crate) fn eq_mean(&self) -> Levels {
        Levels::from_fn(|k, _| self.joint[T60_COUNT + k].mean)
    }

    pub(crate) fn eq_deviation(&self) -> Levels {
        Levels::from_fn(|k, _| self.joint[T60_COUNT + k].variance.sqrt())
    }

    /// Number of windows, less where some count more than others.
    pub fn windows(&self) -> f64 {
        self.joint.iter().map(|label| label.windows).sum::<f64>() / LABEL_COUNT as f64
    }

    /// What detectors of warnings see: the cues of `cues.rs`, then what the network says; none where windows are too small for them.
    pub(crate) fn detector_inputs(&self) -> Vec<f64> {
        if self.cues.is_empty() {
            return Vec::new();
        }
        let (t60, eq) = self.joint.split_at(T60_COUNT);
        let mean = |labels: &[JointLabel], of: fn(&JointLabel) -> f64| {
            labels.iter().map(of).sum::<f64>() / labels.len() as f64
        };
        let mut inputs = self.cues.clone();
        inputs.push(mean(t60, |label| label.mean));
        inputs.push(t60[0].mean - t60[T60_COUNT - 1].mean);
        inputs.push(mean(t60, |label| 0.5 * label.variance.ln()));
        inputs.push(mean(eq, |label| 0.5 * label.variance.ln()));
        inputs.extend(eq.iter().map(|label| label.mean));
        inputs
    }
}
