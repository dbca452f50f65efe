//! Tables of materials as CATT-Acoustic keeps them in its geometry files: `ABS name = <10 20 30 40 50 60> L <30 30 30 30 30 30>`.
//!
//! Absorption and scattering in percent from 125 Hz to 4 kHz, after a colon at 8 and 16 kHz; `ABS1` and `L1` hold shares of 1; `{r g b}` is a
//! colour; a semicolon begins a remark. Source: CATT-Acoustic v8.0, example of the manual (MASTER.GEO), and programs that are public
//! and read such files.

use super::materials::{MaterialTable, Materials};
use super::{MaterialPrior, tables::DEFAULT_SCATTERING};
use crate::error::Error;
use sabine_acoustics::{Bands, Error as ValueError, OutOfRange, PerBand, read_at_most, write_atomically};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Largest file that is read (bytes).
const MAX_FILE_BYTES: u64 = 64 << 20;
/// Longest name that the program takes.
const MAX_NAME: usize = 15;
/// Fewest and most values of a list: octaves from 125 Hz to 4 kHz, or to 16 kHz.
const LEAST_VALUES: usize = 6;
const MOST_VALUES: usize = 8;
/// The program wants shares between 0 and 1, both excluded.
const LEAST_SHARE: f64 = 1e-4;

impl Materials {
    /// Reads the tables of a geometry file of CATT-Acoustic (`.geo`); corners, planes and directives are passed over. All take the
    /// bands of the shortest list.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::Io`]; [`Error::InFile`] naming the line, with the cause [`Error::TextLine`], [`Error::Unit`] for what is not
    /// read (transmission, `estimate`), [`sabine_acoustics::Error::OutOfRange`] or [`Error::DuplicateId`];
    /// [`sabine_acoustics::Error::Empty`] without a table.
    pub fn read_catt(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let bytes = read_at_most(path, MAX_FILE_BYTES + 1)?;
        if bytes.len() as u64 > MAX_FILE_BYTES {
            let error = Error::TooManyValues { found: bytes.len() as u64, limit: MAX_FILE_BYTES };
            return Err(error.in_file(path, "bytes"));
        }
        parse(&String::from_utf8_lossy(&bytes), path)
    }

    /// Writes tables for CATT-Acoustic, whole or not at all: octaves from 125 Hz to 4 kHz, with 8 kHz where they go as far; shares
    /// of 1 to four decimals, at least 0.0001 and at most 0.9999. A material whose absorption is unknown gets the usual guess.
    ///
    /// # Errors
    /// [`Error::InFile`] with the cause [`Error::TextLine`] for a name that the program does not take: 1 to 15 letters, digits and `_`,
    /// beginning with a letter; [`sabine_acoustics::Error::Io`].
    pub fn write_catt(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let last_hz = if self.bands().iter_hz().any(|hz| hz >= 8000.0) { 8000.0 } else { 4000.0 };
        let bands = Bands::octaves(125.0, last_hz)?;
        let mut text =
            String::from("; absorption and scattering from 125 Hz to 4 kHz : 8 kHz, shares of 1\n");
        for table in self.on(bands).tables() {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let name = &table.name;
            let fits = name.len() <= MAX_NAME
                && name.starts_with(|c: char| c.is_ascii_alphabetic())
                && name.chars().all(plain);
            if !fits {
                let error = Error::TextLine {
                    expected: "a name of CATT-Acoustic: 1 to 15 letters, digits and _",
                    text: name.clone(),
                };
                return Err(error.in_file(path, format!("materials.{name}")));
            }
            let material = table.material()?;
            let (absorption, scattering) = (list(material.absorption()), list(material.scattering()));
            // Writing to a String cannot fail.
            let _ = writeln!(text, "ABS1 {name} = <{absorption}> L1 <{scattering}>");
        }
        Ok(write_atomically(path, |file| file.write_all(text.as_bytes()))?)
    }
}

/// Six values, and what comes after them behind a colon.
fn list(column: &PerBand<f64>) -> String {
    let words: Vec<String> = column
        .values()
        .iter()
        .map(|share| format!("{:.4}", share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE)))
        .collect();
    let (usual, more) = words.split_at(LEAST_VALUES.min(words.len()));
    let more = if more.is_empty() { String::new() } else { format!(" : {}", more.join(" ")) };
    usual.join(" ") + &more
}

/// A surface as a line states it.
struct Line {
    number: usize,
    name: String,
    absorption: Vec<f64>,
    scattering: Option<Vec<f64>>,
}

fn parse(text: &str, path: &Path) -> Result<Materials, Error> {
    let mut lines: Vec<Line> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let code = line.split(';').next().unwrap_or_default().trim();
        let word = code.split_whitespace().next().unwrap_or_default();
        let scale = match word {
            "ABS" => 0.01,
            "ABS1" => 1.0,
            _ => continue,
        };
        let number = index + 1;
        let at = |error: Error| error.in_file(path, format!("line {number}"));
        let (name, absorption, scattering) = surface(code[word.len()..].trim(), scale).map_err(at)?;
        if lines.iter().any(|other| other.name == name) {
            return Err(at(Error::DuplicateId { id: name }));
        }
        lines.push(Line { number, name, absorption, scattering });
    }
    let lengths = lines.iter().flat_map(|l| l.scattering.iter().map(Vec::len).chain([l.absorption.len()]));
    let Some(length) = lengths.min() else {
        return Err(Error::from(ValueError::Empty { what: "the list of ABS lines" }).in_file(path, "ABS"));
    };
    let bands = Bands::octaves(125.0, 125.0 * f64::from(1 << (length - 1)))?;
    let table = |line: Line| {
        let per_band = |values: &[f64]| PerBand::new(bands, values[..length].to_vec());
        let at = |error: ValueError| Error::from(error).in_file(path, format!("line {}", line.number));
        let uniform = |value| PerBand::uniform(bands, value);
        Ok(MaterialTable {
            absorption: Some(per_band(&line.absorption).map_err(at)?),
            absorption_sd: uniform(MaterialPrior::TABLE_SD),
            scattering: line
                .scattering
                .as_deref()
                .map_or(Ok(uniform(DEFAULT_SCATTERING)), per_band)
                .map_err(at)?,
            name: line.name,
        })
    };
    Materials::new(lines.into_iter().map(table).collect::<Result<_, Error>>()?)
        .map_err(|error| error.in_file(path, "ABS"))
}

type Surface = (String, Vec<f64>, Option<Vec<f64>>);

/// `name = <...> L <...> {...}`.
fn surface(text: &str, scale: f64) -> Result<Surface, Error> {
    let broken = || Error::TextLine {
        expected: "ABS name = <absorption> L <scattering>",
        text: text.chars().take(80).collect(),
    };
    let (name, rest) = text.split_once('=').ok_or_else(broken)?;
    let name = name.trim();
    if name.is_empty() || name.contains(char::is_whitespace) {
        return Err(broken());
    }
    let (absorption, rest) = brackets(rest).ok_or_else(broken)?;
    let absorption = shares("absorption", absorption, scale)?;
    let rest = rest.split('{').next().unwrap_or_default().trim();
    if rest.is_empty() {
        return Ok((name.to_owned(), absorption, None));
    }
    let word = rest.split(|c: char| c == '<' || c.is_whitespace()).next().unwrap_or_default();
    let scale = match word {
        "L" => 0.01,
        "L1" => 1.0,
        _ => return Err(broken()),
    };
    let (scattering, rest) = brackets(&rest[word.len()..]).ok_or_else(broken)?;
    if !rest.trim().is_empty() {
        return Err(broken());
    }
    Ok((name.to_owned(), absorption, Some(shares("scattering", scattering, scale)?)))
}

/// What stands between the brackets with which a text begins, and what comes after them.
fn brackets(text: &str) -> Option<(&str, &str)> {
    text.trim_start().strip_prefix('<')?.split_once('>')
}

fn shares(what: &'static str, text: &str, scale: f64) -> Result<Vec<f64>, Error> {
    for (mark, found) in [("/", "a transmission"), ("estimate", "an estimate"), ("auto", "an estimate")] {
        if text.contains(mark) {
            return Err(Error::Unit {
                found: format!("{found}: {}", text.trim()),
                expected: "values of the octaves",
            });
        }
    }
    let words = text.split(|c: char| c.is_whitespace() || c == ':').filter(|word| !word.is_empty());
    let value = |word: &str| {
        let number = || Error::TextLine { expected: "a number", text: word.chars().take(40).collect() };
        let share = word.parse::<f64>().map_err(|_| number())? * scale;
        OutOfRange::check(what, share, 0.0, 1.0, "between 0 and 100 % (ABS, L) or 0 and 1 (ABS1, L1)")?;
        Ok(share)
    };
    let values = words.map(value).collect::<Result<Vec<f64>, Error>>()?;
    if (LEAST_VALUES..=MOST_VALUES).contains(&values.len()) {
        return Ok(values);
    }
    let expected = format!("{LEAST_VALUES} to {MOST_VALUES} values");
    Err(Error::Shape { expected, found: format!("{} values", values.len()) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the manual's example, with what other files hold beside it.
    const MASTER: &str = "\
;CATT-Acoustic v8.0 Manual Shoebox Example
LOCAL  h  =  8\t;hall height
ABS wedges = <96 98 99 99 99 99> L <30 30 30 30 30 30>
 ABS floor = <1 2 3 4 5 6 : 7 8> L <10 11 12 13 14 15 : 16 17> {255 0 10} ; ABS no = <1>
ABS1 wood =<.1 0.2 0.3 0.4 0.5 1>
CORNERS
1 0 0 0
";

    fn read(text: &str) -> Result<Materials, String> {
        parse(text, Path::new("master.geo")).map_err(|error| error.to_string())
    }

    #[test]
    fn the_tables_of_a_geometry_file_are_read() {
        let materials = read(MASTER).unwrap();
        assert_eq!(materials.bands(), Bands::octaves(125.0, 4000.0).unwrap());
        let near = |found: &PerBand<f64>, expected: [f64; 6]| {
            assert!(found.values().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        };
        let of = |name: &str| materials.get(name).unwrap();
        near(of("wedges").absorption.as_ref().unwrap(), [0.96, 0.98, 0.99, 0.99, 0.99, 0.99]);
        near(&of("wedges").scattering, [0.3; 6]);
        near(of("floor").absorption.as_ref().unwrap(), [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]);
        near(&of("floor").scattering, [0.10, 0.11, 0.12, 0.13, 0.14, 0.15]);
        near(of("wood").absorption.as_ref().unwrap(), [0.1, 0.2, 0.3, 0.4, 0.5, 1.0]);
        near(&of("wood").scattering, [DEFAULT_SCATTERING; 6]);
        assert_eq!(materials.tables().len(), 3);
    }

    #[test]
    fn what_is_written_is_read_as_it_was() {
        let text = "bands.centres_hz = [125, 250, 500, 1000, 2000, 4000, 8000]\n[materials.wall_2]\nabsorption = [0.0123, 0.02, 0.03, 0.04, 0.05, 0.06, 0.0777]\nscattering = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]\n";
        let materials = Materials::from_toml(text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.geo");
        materials.write_catt(&path).unwrap();
        assert_eq!(Materials::read_catt(&path).unwrap(), materials);
        for name in ["a_name_of_sixteen", "2nd", "wall-2"] {
            let bad = Materials::from_toml(&text.replace("wall_2", name)).unwrap();
            let error = bad.write_catt(folder.path().join("bad.geo")).unwrap_err().to_string();
            assert!(error.contains(&format!("materials.{name}")), "{error}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn each_fault_names_its_line() {
        for (from, to, words) in [
            ("<96 98 99 99 99 99>", "<96 98 99 99 99>", "line 3: has the shape 5 values"),
            ("<96 98 99 99 99 99>", "<96 98 99 99 99 101>", "line 3: absorption is 1.01"),
            ("<96 98 99 99 99 99>", "<96 98 99 99 99 nan>", "line 3: absorption"),
            ("<96 98 99 99 99 99>", "<96 98 99 99 99 9,9>", "line 3: cannot read `9,9`"),
            ("<96 98 99 99 99 99>", "<10/2 9/1 8/1 8/1 8/1 8/1>", "line 3: is `a transmission"),
            ("L <30 30 30 30 30 30>", "L <estimate(0.4)>", "line 3: is `an estimate"),
            ("L <30 30 30 30 30 30>", "M <30 30 30 30 30 30>", "line 3: cannot read"),
            ("wedges = <", "wedges <", "line 3: cannot read"),
            ("floor =", "wedges =", "line 4: `wedges` is there twice"),
        ] {
            let error = read(&MASTER.replace(from, to)).unwrap_err();
            assert!(error.contains(words), "{to}: {error}");
        }
        assert!(read("CORNERS\n").unwrap_err().contains("is empty"));
    }
}
