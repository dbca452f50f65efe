//! Failures of laws.

use crate::failure::Failure;
use sabine::diagnose::Error as DiagnoseError;
use sabine::paths::laws::LawError;
use std::path::Path;

/// A failure; one of laws names the file that they came from.
pub fn naming_laws(failure: Failure, file: Option<&Path>) -> Failure {
    let first: &(dyn std::error::Error + 'static) = &*failure;
    let of_law = std::iter::successors(Some(first), |error| error.source())
        .any(|error| error.is::<LawError>() || is_of_cause(error));
    match file.map(|path| path.display().to_string()) {
        Some(file) if of_law && !failure.to_string().contains(&file) => format!("{file}: {failure}").into(),
        _ => failure,
    }
}

/// Whether a law cannot be weighed as a cause.
fn is_of_cause(error: &(dyn std::error::Error + 'static)) -> bool {
    matches!(error.downcast_ref(), Some(DiagnoseError::LawNotWeighed { .. }))
}
