//! The room as stated and as found, as models that can be rendered.

use sabine::diagnose::{Diagnosis, ExtendedModel};
use std::collections::BTreeMap;

/// A model with other absorption by octave.
#[must_use]
pub fn with_absorption(model: &ExtendedModel, absorption: BTreeMap<String, Vec<f64>>) -> ExtendedModel {
    let mut model = model.clone();
    model.absorption = absorption;
    // It is that of other numbers.
    model.uncertainty = None;
    model
}

/// The room as stated, with its absorption fitted to the same responses before anything was named.
#[must_use]
pub fn as_stated(found: &Diagnosis) -> ExtendedModel {
    let before =
        found.materials.iter().map(|(name, fitted)| (name.clone(), fitted.absorption_before.clone()));
    let mut model = with_absorption(&found.model, before.collect());
    model.causes.clear();
    model
}
