//! Several changes after one another.

use crate::augment::Augment;
use crate::drr::{DrrAugment, DrrConfig};
use crate::eq::{EqAugment, EqConfig};
use crate::error::{Error, check};
use crate::labels::Labels;
use crate::seed::{derive, generator};
use crate::t60::{T60Augment, T60Config};
use rand::Rng;
use sabine_acoustics::ImpulseResponse;

/// A response as it became, and what is measured on it.
#[derive(Clone, Debug, PartialEq)]
pub struct AugmentedResponse {
    /// The response.
    pub response: ImpulseResponse,
    /// Measured afterwards, not assumed.
    pub labels: Labels,
}

impl AugmentedResponse {
    /// Changes a response and measures what came of it.
    ///
    /// # Errors
    /// Where the response does not permit the change.
    pub fn new(augment: &dyn Augment, response: &ImpulseResponse, seed: u64) -> Result<Self, Error> {
        let response = augment.augment(response, seed)?;
        let labels = Labels::measure(&response)?;
        Ok(Self { response, labels })
    }
}

/// Changes that follow one another, each with a probability and a seed of its own. A chain is a change, too.
#[derive(Default)]
pub struct Chain {
    stages: Vec<(f64, Box<dyn Augment>)>,
    description: Vec<String>,
}

impl Chain {
    /// No change.
    pub fn new() -> Self {
        Self::default()
    }

    /// T60 in nine of ten responses, then DRR and EQ in two of three: what training sets are made with.
    ///
    /// # Errors
    /// [`Error::Setting`] for the sample rate.
    pub fn for_training(sample_rate_hz: u32) -> Result<Self, Error> {
        let (t60, drr, eq) = (T60Config::default(), DrrConfig::default(), EqConfig::default());
        let description = vec![format!("0.9 {t60:?}"), format!("0.66 {drr:?}"), format!("0.66 {eq:?}")];
        let mut chain = Self::new()
            .then(0.9, T60Augment::new(t60)?)?
            .then(0.66, DrrAugment::new(drr)?)?
            .then(0.66, EqAugment::new(eq, sample_rate_hz)?)?;
        chain.description = description;
        Ok(chain)
    }

    /// Adds a change that happens with a probability.
    ///
    /// # Errors
    /// [`Error::Setting`] for a probability outside 0 to 1.
    pub fn then(mut self, probability: f64, augment: impl Augment + 'static) -> Result<Self, Error> {
        check("probability", probability, 0.0, 1.0, "between 0 and 1")?;
        self.stages.push((probability, Box::new(augment)));
        Ok(self)
    }

    /// The settings in words, for manifests.
    pub(crate) fn describe(&self) -> String {
        self.description.join(" | ")
    }
}

impl Augment for Chain {
    fn augment(
        &self,
        response: &ImpulseResponse,
        seed: u64,
    ) -> Result<ImpulseResponse, sabine_acoustics::Error> {
        let mut changed = response.clone();
        for (stage, (probability, augment)) in self.stages.iter().enumerate() {
            let seed = derive(seed, stage as u64);
            if generator(derive(seed, 7)).random::<f64>() < *probability {
                changed = augment.augment(&changed, seed)?;
            }
        }
        Ok(changed)
    }
}
