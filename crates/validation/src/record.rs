//! Records: CSV files with a line for each room.

use crate::AnyError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::Write;
use std::path::Path;

/// Reads the lines of a record.
///
/// # Errors
/// With the name of the file, for one that cannot be read or has other columns.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, AnyError> {
    let in_file = |error: csv::Error| format!("{}: {error}", path.display());
    let mut reader = csv::Reader::from_path(path).map_err(in_file)?;
    let lines: Result<Vec<T>, csv::Error> = reader.deserialize().collect();
    Ok(lines.map_err(in_file)?)
}

/// The text of a record, its first line the names of the columns.
///
/// # Errors
/// For lines that are no flat table.
pub fn text<T: Serialize>(lines: &[T]) -> Result<String, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in lines {
        writer.serialize(line)?;
    }
    let bytes = writer.into_inner().map_err(|error| error.into_error())?;
    String::from_utf8(bytes).map_err(|error| std::io::Error::other(error).into())
}

/// Writes a record whole or not at all.
///
/// # Errors
/// As [`text`], and for a file that cannot be written.
pub fn write<T: Serialize>(path: &Path, lines: &[T]) -> Result<(), AnyError> {
    let text = text(lines)?;
    Ok(sabine::acoustics::write_atomically(path, |file| file.write_all(text.as_bytes()))?)
}
