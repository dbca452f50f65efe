//! How far fitted absorption lies from what the laboratory has.

use crate::AnyError;
use sabine::diagnose::Diagnosis;
use sabine_testkit::{Hidden, Laboratory};

/// Mean absolute error over materials and octaves, under the baseline and beside the causes.
///
/// # Errors
/// For hidden effects that the laboratory does not have.
pub fn absorption_errors(
    found: &Diagnosis,
    lab: &Laboratory,
    hidden: &[Hidden],
) -> Result<[f64; 2], AnyError> {
    let truth = lab.truth(hidden)?;
    let (mut before, mut after, mut count) = (0.0, 0.0, 0.0);
    for (name, fitted) in &found.materials {
        let Some(material) = truth.materials.iter().find(|m| m.name == *name) else { continue };
        for (b, wanted) in material.absorption.iter().enumerate() {
            before += (fitted.absorption_before[b] - wanted).abs();
            after += (fitted.absorption[b] - wanted).abs();
            count += 1.0;
        }
    }
    Ok([before / f64::max(count, 1.0), after / f64::max(count, 1.0)])
}
