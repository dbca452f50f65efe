//! Settings of a training and its learning curve.

use crate::config::NetworkConfig;
use crate::error::Error;
use crate::labels::T60Scale;
use crate::loss::Loss;
use crate::perturb::PerturbConfig;
use serde::{Deserialize, Serialize};

/// How the learning rate goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Schedule {
    /// The same throughout (the paper).
    Constant,
    /// Down to a hundredth along half a cosine over all epochs.
    Cosine,
}

/// Settings of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainConfig {
    /// The network; its `outputs` follow from `loss`.
    pub network: NetworkConfig,
    /// How reverberation times are taught.
    pub t60: T60Scale,
    /// Whether the level of a clip is removed before the network hears it.
    pub remove_level: bool,
    /// What is minimised.
    pub loss: Loss,
    /// Clips in a step, 2..=4096.
    pub batch: usize,
    /// Passes over the training set, 1 or more.
    pub epochs: usize,
    /// Steps of the optimiser are as long as this at first, above 0.
    pub learning_rate: f64,
    /// How that changes.
    pub schedule: Schedule,
    /// Decay of the weights, 0 or more.
    pub weight_decay: f64,
    /// Epochs without improvement of the validation error after which training ends.
    pub patience: usize,
    /// Relative improvement that counts as one.
    pub minimum_improvement: f64,
    /// Changes of the features, if any.
    pub perturb: Option<PerturbConfig>,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            network: NetworkConfig::small(),
            t60: T60Scale::Log,
            remove_level: true,
            loss: Loss::Gaussian,
            batch: 64,
            epochs: 60,
            learning_rate: 2e-3,
            schedule: Schedule::Cosine,
            weight_decay: 1e-2,
            patience: 30,
            minimum_improvement: 0.0,
            perturb: Some(PerturbConfig::default()),
            seed: 1,
        }
    }
}

impl TrainConfig {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let check = |field, value: f64, low: f64, high: f64, range| {
            if value >= low && value <= high { Ok(()) } else { Err(Error::Config { field, value, range }) }
        };
        check("batch", self.batch as f64, 2.0, 4096.0, "2 to 4096")?;
        check("epochs", self.epochs as f64, 1.0, 1e6, "1 to 1,000,000")?;
        check("learning_rate", self.learning_rate, f64::MIN_POSITIVE, 1.0, "above 0, at most 1")?;
        check("weight_decay", self.weight_decay, 0.0, 1.0, "0 to 1")?;
        check("minimum_improvement", self.minimum_improvement, 0.0, 1.0, "0 to 1")?;
        self.network.check()
    }

    pub(crate) fn rate(&self, progress: f64) -> f64 {
        match self.schedule {
            Schedule::Constant => self.learning_rate,
            Schedule::Cosine => {
                let fall = 0.5 * (1.0 + (std::f64::consts::PI * progress).cos());
                self.learning_rate * (0.01 + 0.99 * fall)
            }
        }
    }
}

/// One epoch of the learning curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochRecord {
    /// From 1.
    pub epoch: usize,
    /// Mean loss over the steps.
    pub train_loss: f64,
    /// Validation error: mean over labels of the error relative to that of the constant guess.
    pub validation_error: f64,
    /// Mean absolute error of T60 over validation rooms and octaves, in seconds.
    pub validation_t60_s: f64,
    /// The same of EQ, in dB.
    pub validation_eq_db: f64,
    /// Training clips per second.
    pub clips_per_s: f64,
}
