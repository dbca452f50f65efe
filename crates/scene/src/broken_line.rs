//! Lines of a table that have another length than its head.

use crate::error::Error;
use std::path::Path;

/// A line with too few or too many cells.
pub(crate) fn broken(path: &Path, error: &csv::Error) -> Error {
    let line = error.position().map_or(0, csv::Position::line);
    let (expected, found) = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => (*expected_len, *len),
        _ => (0, 0),
    };
    let error = Error::Shape { expected: format!("{expected} cells"), found: format!("{found} cells") };
    error.in_file(path, format!("line {line}"))
}
