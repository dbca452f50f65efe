//! Tables of measured room-acoustic parameters: what a measuring program lists for each source, receiver and octave.

use super::MeasuredRoom;
use super::file::ParameterTable;
use crate::error::Error;
use crate::table_lines::LineNumbers;
use csv::{ReaderBuilder, StringRecord, Trim};
use sabine_acoustics::{Bands, Error as ValueError, OutOfRange, ParameterKind, read_at_most};
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

/// Largest table that is read (bytes), and most values of all tables: 1,000 pairs of ten octaves hold 70,000.
const MAX_FILE_BYTES: u64 = 16 << 20;
const MAX_VALUES: usize = 500_000;
/// Cells that say "not measured", besides empty ones.
const GAPS: [&str; 6] = ["-", "--", "nan", "n/a", "na", "*"];
/// Ends the name of a column of standard deviations.
const SD: &str = "_sd";
/// What a table may hold, for messages.
const EXPECTED: &str = "pair or source and receiver, band_hz, edt_s, t20_s, t30_s, c50_db, c80_db, d50, d50_percent, ts_s, ts_ms, each with _sd";

/// A measured value of a table, with its place in it.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterEntry {
    /// Index of the source.
    pub source: usize,
    /// Index of the receiver.
    pub receiver: usize,
    /// Nominal centre of the octave, in Hz.
    pub band_hz: f64,
    /// What was measured.
    pub kind: ParameterKind,
    /// Its value, in the unit of [`ParameterKind`].
    pub value: f64,
    /// How well it was measured: one standard deviation in the same unit, where the table states it.
    pub standard_deviation: Option<f64>,
    /// The table.
    pub path: PathBuf,
    /// Its line there, counted from 1.
    pub line: u64,
}

impl MeasuredRoom {
    /// Values of the room's tables of parameters (`[[parameters]]`), in the order of the file.
    ///
    /// ```
    /// use sabine_acoustics::ParameterKind;
    /// use sabine_scene::MeasuredRoom;
    /// let folder = tempfile::tempdir()?;
    /// let text = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
    /// text("room.toml", r#"
    ///     room = { mesh = "room.obj" }
    ///     bands = { centres_hz = [500, 1000] }
    ///     materials.wall = {}
    ///     sources = [{ id = "s1", position_m = [0.5, 0.5, 0.5] }]
    ///     receivers = [{ id = "r1", position_m = [1, 1, 1] }]
    ///     parameters = [{ file = "room.csv" }]
    /// "#)?;
    /// text("room.obj", "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nusemtl wall\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")?;
    /// text("room.csv", "pair;band_hz;t30_s;t30_s_sd;c80_db\ns1-r1;500;1,93;0,04;-0,8\ns1-r1;1000;-;;2,1\n")?;
    /// let room = MeasuredRoom::read(folder.path())?;
    /// let t30 = &room.parameters()[0];
    /// assert_eq!((t30.kind, t30.value, t30.standard_deviation), (ParameterKind::T30, 1.93, Some(0.04)));
    /// assert_eq!(room.parameters().len(), 3); // T30 at 1 kHz was not measured
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn parameters(&self) -> &[ParameterEntry] {
        &self.parameters
    }

    /// Reads the table `[[parameters]]` of this number. What was read before is not stated twice.
    pub(super) fn read_parameters(
        &mut self,
        index: usize,
        table: &ParameterTable,
        path: &Path,
    ) -> Result<(), Error> {
        let of_file = self
            .named_ends(table)
            .map_err(|(name, error)| error.in_file(&self.file, format!("parameters[{index}].{name}")))?;
        let bytes = read_at_most(path, MAX_FILE_BYTES + 1)?;
        if bytes.len() as u64 > MAX_FILE_BYTES {
            let error = Error::TooManyValues { found: bytes.len() as u64, limit: MAX_FILE_BYTES };
            return Err(error.in_file(path, "bytes"));
        }
        let text = String::from_utf8_lossy(&bytes);
        let text = text.trim_start_matches('\u{feff}');
        let head = text.lines().next().unwrap_or_default();
        let delimiter =
            [b'\t', b';'].into_iter().find(|&mark| head.contains(char::from(mark))).unwrap_or(b',');
        let mut lines = LineNumbers::of(text);
        let mut reader =
            ReaderBuilder::new().delimiter(delimiter).trim(Trim::All).from_reader(text.as_bytes());
        let columns = reader
            .headers()
            .map_err(|error| lines.broken(path, &error))
            .and_then(|head| Columns::read(head, of_file.is_some()).map_err(|e| e.in_file(path, "line 1")))?;
        let mut known: HashSet<(usize, usize, u64, ParameterKind)> =
            self.parameters.iter().map(ParameterEntry::key).collect();
        let before = self.parameters.len();
        for record in reader.records() {
            let record = record.map_err(|error| lines.broken(path, &error))?;
            let line = Line {
                path,
                number: lines.at(record.position()),
                record: &record,
                decimal_comma: delimiter != b',',
            };
            let (source, receiver) = match of_file {
                Some(ends) => ends,
                None => self.ends_of_line(&columns, &line)?,
            };
            for entry in columns.entries(&line, (source, receiver))? {
                if !known.insert(entry.key()) {
                    let (s, r) = (&self.sources[source].id, &self.receivers[receiver].id);
                    let id = format!("{} of {s}-{r} at {} Hz", entry.kind, entry.band_hz);
                    return Err(Error::DuplicateId { id }.in_file(path, line.at(entry.kind.column())));
                }
                if self.parameters.len() == MAX_VALUES {
                    let (found, limit) = (MAX_VALUES as u64 + 1, MAX_VALUES as u64);
                    return Err(Error::TooManyValues { found, limit }.in_file(path, line.at("line")));
                }
                self.parameters.push(entry);
            }
        }
        if self.parameters.len() == before {
            return Err(Error::Missing.in_file(path, "any measured value"));
        }
        Ok(())
    }

    /// Source and receiver that the room file names for a whole table, or the offending field.
    fn named_ends(&self, table: &ParameterTable) -> Result<Option<(usize, usize)>, (&'static str, Error)> {
        match (&table.source, &table.receiver) {
            (None, None) => Ok(None),
            (Some(source), Some(receiver)) => {
                let source = self.source_index(source).map_err(|e| ("source", e))?;
                Ok(Some((source, self.receiver_index(receiver).map_err(|e| ("receiver", e))?)))
            }
            (Some(_), None) => Err(("receiver", Error::Missing)),
            (None, Some(_)) => Err(("source", Error::Missing)),
        }
    }

    fn ends_of_line(&self, columns: &Columns, line: &Line<'_>) -> Result<(usize, usize), Error> {
        if let Some(column) = columns.pair {
            let text = line.needed(column, "pair")?;
            return self.ends_of_pair(text).map_err(|error| error.in_file(line.path, line.at("pair")));
        }
        let index =
            |column: Option<usize>, name: &'static str| line.needed(column.unwrap_or(usize::MAX), name);
        let (source, receiver) = (index(columns.source, "source")?, index(columns.receiver, "receiver")?);
        let source = self.source_index(source).map_err(|e| e.in_file(line.path, line.at("source")))?;
        let receiver =
            self.receiver_index(receiver).map_err(|e| e.in_file(line.path, line.at("receiver")))?;
        Ok((source, receiver))
    }

    /// `LS1-MP1`, `s1_r1` or `s1/r1`: the names themselves may hold such marks.
    fn ends_of_pair(&self, text: &str) -> Result<(usize, usize), Error> {
        let halves = text.char_indices().filter(|(_, c)| matches!(c, '-' | '_' | '/' | ' ' | ':'));
        let found = halves.filter_map(|(at, mark)| {
            let (source, receiver) = (text[..at].trim(), text[at + mark.len_utf8()..].trim());
            Some((self.source_index(source).ok()?, self.receiver_index(receiver).ok()?))
        });
        let mut found = found.collect::<HashSet<_>>().into_iter();
        match (found.next(), found.next()) {
            (Some(ends), None) => Ok(ends),
            _ => Err(ValueError::UnknownId { id: text.to_owned() }.into()),
        }
    }
}

impl ParameterEntry {
    fn key(&self) -> (usize, usize, u64, ParameterKind) {
        (self.source, self.receiver, self.band_hz.to_bits(), self.kind)
    }
}

/// A line that is being read.
struct Line<'a> {
    path: &'a Path,
    number: u64,
    record: &'a StringRecord,
    /// Whether the comma is free to be the point of a number.
    decimal_comma: bool,
}

impl Line<'_> {
    fn at(&self, column: &str) -> String {
        format!("line {}, {column}", self.number)
    }

    fn text(&self, column: usize) -> Option<&str> {
        let gap = |text: &&str| text.is_empty() || GAPS.contains(&text.to_ascii_lowercase().as_str());
        self.record.get(column).filter(|text| !gap(text))
    }

    fn needed(&self, column: usize, name: &str) -> Result<&str, Error> {
        self.text(column).ok_or_else(|| Error::Missing.in_file(self.path, self.at(name)))
    }

    /// A number in a cell; none in a gap.
    fn number(&self, column: usize, name: &str) -> Result<Option<f64>, Error> {
        let Some(text) = self.text(column) else { return Ok(None) };
        let plain = match (text.contains(','), text.contains('.')) {
            // Groups of thousands in one locale are decimals in another.
            (true, true) => None,
            (true, false) => Some(text.replace(',', ".")).filter(|_| self.decimal_comma),
            _ => Some(text.to_owned()),
        };
        let value = plain.and_then(|text| text.parse().ok()).filter(|value: &f64| value.is_finite());
        let error = || Error::TextLine { expected: "a number", text: text.chars().take(60).collect() };
        value.map(Some).ok_or_else(|| error().in_file(self.path, self.at(name)))
    }
}

/// Where a parameter stands in a table.
struct Column {
    name: String,
    kind: ParameterKind,
    /// What a value of the table counts in the parameter's unit.
    unit: f64,
    value: usize,
    sd: Option<usize>,
}

/// Where everything stands.
struct Columns {
    pair: Option<usize>,
    source: Option<usize>,
    receiver: Option<usize>,
    band: usize,
    parameters: Vec<Column>,
}

impl Columns {
    /// From the head of a table; `ends_known` where the room file says between which places all of it was measured.
    fn read(head: &StringRecord, ends_known: bool) -> Result<Self, Error> {
        let mut at = BTreeMap::new();
        for (index, name) in head.iter().enumerate() {
            let lower = name.to_ascii_lowercase();
            let plain = lower.strip_suffix(SD).unwrap_or(&lower);
            let is_place = ["pair", "source", "receiver", "band_hz"].contains(&lower.as_str());
            if !is_place && parameter(plain).is_none() {
                return Err(Error::Unit { found: name.to_owned(), expected: EXPECTED });
            }
            if at.insert(lower.clone(), index).is_some() {
                return Err(Error::DuplicateId { id: lower });
            }
        }
        let missing = |text: &str| Error::TextLine {
            expected: "a head of a table: a column is missing in it",
            text: text.to_owned(),
        };
        let place = |name: &str| at.get(name).copied();
        let (pair, source, receiver) = (place("pair"), place("source"), place("receiver"));
        match (ends_known, pair, source, receiver) {
            (true, None, None, None) | (false, Some(_), None, None) | (false, None, Some(_), Some(_)) => {}
            (true, ..) | (false, Some(_), ..) => {
                let id = "the pair of a line".to_owned();
                return Err(Error::DuplicateId { id });
            }
            (false, None, Some(_), None) => return Err(missing("receiver")),
            (false, None, None, _) => return Err(missing("source")),
        }
        let band = place("band_hz").ok_or_else(|| missing("band_hz"))?;
        let mut parameters: Vec<Column> = Vec::new();
        for name in at.keys().filter(|name| name.ends_with(SD)) {
            let value = name.strip_suffix(SD).unwrap_or(name);
            place(value).ok_or_else(|| missing(value))?;
        }
        for (name, &value) in &at {
            let Some((kind, unit)) = parameter(name) else { continue };
            if parameters.iter().any(|other| other.kind == kind) {
                return Err(Error::DuplicateId { id: kind.symbol().to_owned() });
            }
            parameters.push(Column {
                name: name.clone(),
                kind,
                unit,
                value,
                sd: place(&format!("{name}{SD}")),
            });
        }
        if parameters.is_empty() {
            return Err(missing("t30_s"));
        }
        parameters.sort_by_key(|column| column.value);
        Ok(Self { pair, source, receiver, band, parameters })
    }

    /// What a line holds.
    fn entries(
        &self,
        line: &Line<'_>,
        (source, receiver): (usize, usize),
    ) -> Result<Vec<ParameterEntry>, Error> {
        let in_file = |error: Error, name: &str| error.in_file(line.path, line.at(name));
        let band = line.number(self.band, "band_hz")?;
        let band = band.ok_or_else(|| in_file(Error::Missing, "band_hz"))?;
        let band_hz = octave(band).map_err(|error| in_file(error, "band_hz"))?;
        let mut entries = Vec::new();
        for column in &self.parameters {
            let number = |index: usize, name: &str| line.number(index, name);
            let Some(value) = number(column.value, &column.name)? else { continue };
            let value = value * column.unit;
            column.kind.check(value).map_err(|error| in_file(error.into(), &column.name))?;
            let sd_name = format!("{}{SD}", column.name);
            let sd = column.sd.map(|index| number(index, &sd_name)).transpose()?.flatten();
            let standard_deviation = sd.map(|sd| sd * column.unit);
            if let Some(sd) = standard_deviation {
                // A value whose error is as large as any value can be says nothing.
                OutOfRange::check("standard deviation", sd, 1e-6, 60.0, "above 0, at most 60")
                    .map_err(|error| in_file(error.into(), &sd_name))?;
            }
            entries.push(ParameterEntry {
                source,
                receiver,
                band_hz,
                kind: column.kind,
                value,
                standard_deviation,
                path: line.path.to_owned(),
                line: line.number,
            });
        }
        Ok(entries)
    }
}

/// The parameter of a column, and what its unit counts in that of [`ParameterKind`].
fn parameter(name: &str) -> Option<(ParameterKind, f64)> {
    match name {
        "d50_percent" => Some((ParameterKind::D50, 0.01)),
        "ts_ms" => Some((ParameterKind::CentreTime, 1e-3)),
        _ => ParameterKind::ALL.into_iter().find(|kind| kind.column() == name).map(|kind| (kind, 1.0)),
    }
}

/// The nominal centre of an octave.
fn octave(centre_hz: f64) -> Result<f64, Error> {
    Ok(Bands::from_centres_hz(&[centre_hz])
        .ok()
        .filter(|bands| bands.per_octave() == 1)
        .map(|bands| bands.nominal_hz(0))
        .ok_or(OutOfRange {
            field: "band (Hz)",
            value: centre_hz,
            range: "the nominal centre of an octave",
        })?)
}
