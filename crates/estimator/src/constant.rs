//! The guess that any estimator has to beat.

use crate::Error;
use crate::labels::{LABEL_COUNT, per_band};
use crate::model::Model;
use sabine_acoustics::{Estimate, RoomEstimator, RoomTargets, Signal};

/// Says the same whatever it hears: the mean of the training labels, with their deviation as the standard error.
///
/// ```
/// use sabine_acoustics::{Bands, Estimate, PerBand, RoomEstimator, RoomTargets, Signal};
/// use sabine_estimator::ConstantEstimator;
/// let t60_s = PerBand::uniform(Bands::T60, Estimate::new(0.6, 0.3));
/// let eq_db = PerBand::uniform(Bands::EQ, Estimate::new(0.0, 4.0));
/// let guess = ConstantEstimator::new(RoomTargets::new(t60_s, eq_db)?);
/// let speech = Signal::new(vec![0.1; 16_000], 16_000)?;
/// assert_eq!(guess.estimate(&speech)?.t60_s().at_hz(500.0).map(|t| t.value), Some(0.6));
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ConstantEstimator {
    targets: RoomTargets,
}

impl ConstantEstimator {
    /// Always `targets`.
    pub fn new(targets: RoomTargets) -> Self {
        Self { targets }
    }

    /// The mean of the labels that a model was trained on (the geometric mean of reverberation times where the model takes
    /// their logarithm).
    ///
    /// # Errors
    /// [`Error::Acoustics`] if the labels of the model are out of range.
    pub fn of_training(model: &Model) -> Result<Self, Error> {
        let labels: Vec<Estimate> = (0..LABEL_COUNT).map(|k| model.labels.decode(k, 0.0, 1.0)).collect();
        let (t60_s, eq_db) = per_band(&labels);
        Ok(Self::new(RoomTargets::new(t60_s, eq_db)?))
    }
}

impl RoomEstimator for ConstantEstimator {
    fn estimate(&self, _: &Signal) -> Result<RoomTargets, sabine_acoustics::Error> {
        Ok(self.targets.clone())
    }
}
