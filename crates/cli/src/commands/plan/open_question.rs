//! What a diagnosis leaves open, from its file.

use sabine::diagnose::{OpenQuestion, QuestionError};
use sabine::paths::laws::Law;
use sabine::scene::MeasuredRoom;
use std::path::{Path, PathBuf};

/// A file of a diagnosis that serves no plan.
#[derive(Debug, thiserror::Error)]
pub enum DiagnosisFileError {
    #[error("{}: {source}", path.display())]
    Read {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    #[error("{}: {source}", path.display())]
    Question {
        path: PathBuf,
        #[source]
        source: QuestionError,
    },
}

/// The open question of a diagnosis of this room, and the laws that it found ([`OpenQuestion::of_json`]).
///
/// # Errors
/// [`DiagnosisFileError`]: the file cannot be read, is no diagnosis, or has other materials or octaves than the room.
pub fn read(
    path: &Path,
    room: &MeasuredRoom,
    knows: impl Fn(&str) -> bool,
) -> Result<(OpenQuestion, Vec<Law>), DiagnosisFileError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| DiagnosisFileError::Read { path: path.to_owned(), source })?;
    OpenQuestion::of_json(&text, room, knows)
        .map_err(|source| DiagnosisFileError::Question { path: path.to_owned(), source })
}
