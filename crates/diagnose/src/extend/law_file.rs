//! Files of laws.

use crate::error::Error;
use sabine_acoustics::{Error as Cause, OutOfRange};
use sabine_paths::laws::Law;
use serde::Deserialize;
use std::path::Path;

/// Longest file of laws, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// A file of laws: `[[laws]]` and nothing else.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LawFile {
    laws: Vec<Law>,
}

/// Reads the laws of a TOML file, in their order. Names of surfaces are checked when they are bound to a room.
///
/// ```no_run
/// let laws = sabine_diagnose::read_laws("laws.toml")?;
/// println!("{} says {}", laws[0].id(), laws[0].printed());
/// # Ok::<(), sabine_diagnose::Error>(())
/// ```
///
/// # Errors
/// [`Error::Model`] naming file, law and column for what is no such file; [`Error::Acoustics`] if it cannot be read, is longer than 1 MiB, or
/// has two laws of one identifier.
pub fn read_laws(path: impl AsRef<Path>) -> Result<Vec<Law>, Error> {
    let path = path.as_ref();
    let io = |source| Cause::Io { path: path.to_owned(), source };
    let bytes = std::fs::metadata(path).map_err(io)?.len();
    if bytes > MAX_BYTES {
        let error = OutOfRange { field: "length (bytes)", value: bytes as f64, range: "at most 1 MiB" };
        return Err(Cause::from(error).in_file(path, "laws").into());
    }
    let text = std::fs::read_to_string(path).map_err(io)?;
    let file: LawFile = toml::from_str(&text)
        .map_err(|source| Error::Model { path: path.to_owned(), source: Box::new(source) })?;
    Law::check_together(&file.laws).map_err(|error| Cause::from(error).in_file(path, "laws"))?;
    Ok(file.laws)
}
