//! Tables of materials as Odeon keeps them in a list (`.Li8`): a line with number and description, below it the absorption in the eight
//! octaves from 63 Hz to 8 kHz, shares of 1, with a tab before each.
//!
//! Source: the list that the public program Just4RIR (Sorbonne Université, 2018) carries, and what reads it there. Of EASE's tables no
//! public description was found.

use super::materials::{MaterialTable, Materials};
use super::{MaterialPrior, tables::DEFAULT_SCATTERING};
use crate::error::Error;
use sabine_acoustics::{Bands, OutOfRange, PerBand, read_at_most};
use std::path::Path;

/// Largest file that is read (bytes).
const MAX_FILE_BYTES: u64 = 16 << 20;
/// The number of what is no surface: sound passes through.
const TRANSPARENT: u32 = 0;

impl Materials {
    /// Reads a list of materials of Odeon (`.Li8`). Each is called by its number and description, `100 Rough concrete (Bobran, 1973)`; number
    /// 0, which is transparent, is left out. The list holds no scattering: the default of `room.toml` stands for it.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`]; [`Error::InFile`] naming the line, with the cause [`Error::TextLine`], [`Error::Shape`],
    /// [`sabine_acoustics::Error::OutOfRange`] or [`Error::DuplicateId`]; [`sabine_acoustics::Error::Empty`] without a table.
    pub fn read_odeon(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let bytes = read_at_most(path, MAX_FILE_BYTES + 1)?;
        if bytes.len() as u64 > MAX_FILE_BYTES {
            let error = Error::TooManyValues { found: bytes.len() as u64, limit: MAX_FILE_BYTES };
            return Err(error.in_file(path, "bytes"));
        }
        // Older lists are in Latin-1, whose bytes are the first code points.
        let text = String::from_utf8(bytes)
            .unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect());
        parse(&text, path)
    }
}

fn parse(text: &str, path: &Path) -> Result<Materials, Error> {
    let bands = Bands::octaves(62.5, 8000.0)?;
    let mut tables: Vec<MaterialTable> = Vec::new();
    let mut numbers: Vec<u32> = Vec::new();
    // The number, the name and the line of a material whose values are still to come.
    let mut open: Option<(u32, String, usize)> = None;
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let at = |error: Error| error.in_file(path, format!("line {}", index + 1));
        if line.trim().is_empty() {
            continue;
        }
        if !line.starts_with(char::is_whitespace) {
            if let Some((_, _, head)) = open {
                return Err(
                    broken(VALUES, line).in_file(path, format!("line {}, below line {head}", index + 1))
                );
            }
            let (number, name) = head(line).map_err(at)?;
            if numbers.contains(&number) {
                return Err(at(Error::DuplicateId { id: number.to_string() }));
            }
            numbers.push(number);
            open = Some((number, name, index + 1));
            continue;
        }
        let Some((number, name, _)) = open.take() else {
            return Err(at(broken("a number and a description", line)));
        };
        let absorption = PerBand::new(bands, values(line).map_err(at)?).map_err(|error| at(error.into()))?;
        if number != TRANSPARENT {
            tables.push(MaterialTable {
                name,
                absorption: Some(absorption),
                absorption_sd: PerBand::uniform(bands, MaterialPrior::TABLE_SD),
                scattering: PerBand::uniform(bands, DEFAULT_SCATTERING),
            });
        }
    }
    if let Some((_, name, line)) = open {
        return Err(broken(VALUES, &name).in_file(path, format!("line {line}, the last")));
    }
    Materials::new(tables).map_err(|error| error.in_file(path, "materials"))
}

const VALUES: &str = "a line of eight values below the description";

fn broken(expected: &'static str, text: &str) -> Error {
    Error::TextLine { expected, text: text.trim().chars().take(80).collect() }
}

/// `100<tab>Rough concrete (Bobran, 1973)`.
fn head(line: &str) -> Result<(u32, String), Error> {
    let expected = "a number and a description";
    let (number, description) = line.split_once(char::is_whitespace).ok_or_else(|| broken(expected, line))?;
    let number: u32 = number.parse().map_err(|_| broken(expected, line))?;
    let words: Vec<&str> = description.split_whitespace().collect();
    if words.is_empty() {
        return Err(broken(expected, line));
    }
    Ok((number, format!("{number} {}", words.join(" "))))
}

fn values(line: &str) -> Result<Vec<f64>, Error> {
    let value = |word: &str| {
        let share = word.parse::<f64>().map_err(|_| broken("a number", word))?;
        Ok(OutOfRange::check("absorption", share, 0.0, 1.0, "between 0 and 1").map(|()| share)?)
    };
    let values = line.split_whitespace().map(value).collect::<Result<Vec<f64>, Error>>()?;
    if values.len() == 8 {
        return Ok(values);
    }
    Err(Error::Shape { expected: "8 values".into(), found: format!("{} values", values.len()) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the form of the public list.
    const LIST: &str = "0\tTransparent\n\t0.00000\t0.00000\t0.00000\t0.00000\t0.00000\t0.00000\t0.00000\t0.00000\n\n\
        17\tTimber  floor, 20 mm (made up)\n\t0.15000\t0.14000\t0.13000\t0.12000\t0.11000\t0.10000\t0.09000\t0.08000\n\n\
        1200\tFelt, \"soft\"\r\n\t0.10000\t0.20000\t0.30000\t0.40000\t0.50000\t0.60000\t0.70000\t1.00000\r\n";

    fn read(text: &str) -> Result<Materials, String> {
        parse(text, Path::new("list.li8")).map_err(|error| error.to_string())
    }

    #[test]
    fn a_list_is_read_without_what_is_transparent() {
        let materials = read(LIST).unwrap();
        assert_eq!(materials.bands(), Bands::octaves(62.5, 8000.0).unwrap());
        let names: Vec<&str> = materials.tables().iter().map(|table| table.name.as_str()).collect();
        assert_eq!(names, ["17 Timber floor, 20 mm (made up)", "1200 Felt, \"soft\""]);
        let felt = &materials.tables()[1];
        assert_eq!(felt.absorption.as_ref().unwrap().values(), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 1.0]);
        assert_eq!(felt.scattering.values(), [DEFAULT_SCATTERING; 8]);
        // Names with spaces and quotation marks are keys of TOML too.
        assert_eq!(Materials::from_toml(&materials.to_toml().unwrap()).unwrap(), materials);
    }

    #[test]
    fn letters_of_latin_1_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.li8");
        let bytes: Vec<u8> = LIST.replace("soft", "blød").chars().map(|c| u8::try_from(c).unwrap()).collect();
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(Materials::read_odeon(&path).unwrap().tables()[1].name, "1200 Felt, \"blød\"");
    }

    #[test]
    fn each_fault_names_its_line() {
        for (from, to, words) in [
            ("0.15000\t", "", "line 5: has the shape 7 values"),
            ("0.15000", "1.50000", "line 5: absorption is 1.5"),
            ("0.15000", "nan", "line 5: absorption"),
            ("0.15000", "0,15000", "line 5: cannot read `0,15000`"),
            ("\t0.15000", "0.15000", "line 5, below line 4: cannot read"),
            ("17\t", "x17\t", "line 4: cannot read `x17"),
            ("17\t", "1200\t", "line 7: `1200` is there twice"),
            ("17\tTimber  floor, 20 mm (made up)\n", "", "line 4: cannot read `0.15000"),
            ("\t1.00000\r\n", "\r\n1201\tcut short", "line 8: has the shape 7 values"),
        ] {
            assert!(LIST.contains(from), "{from}");
            let error = read(&LIST.replace(from, to)).unwrap_err();
            assert!(error.contains(words), "{to}: {error}");
        }
        assert!(read("1201\tcut short").unwrap_err().contains("line 1, the last: cannot read"));
        assert!(read("").unwrap_err().contains("is empty"));
    }
}
