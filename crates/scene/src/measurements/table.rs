//! A table of measurements: a file of sound in each line, and where its source and receiver were.

use super::file_names::Names;
use super::places::{Place, Places};
use super::{ImportOptions, Measurements, Sound, meaning, number};
use crate::error::Error;
use crate::inside_folder::check_inside;
use crate::measured_room::NewResponse;
use crate::scene::Source;
use crate::table_lines::LineNumbers;
use csv::{ReaderBuilder, StringRecord, Trim};
use sabine_acoustics::{Air, OutOfRange, read_at_most};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Largest table that is read (bytes), and most lines: each names a file.
const MAX_FILE_BYTES: u64 = 64 << 20;
const MAX_RESPONSES: usize = 20_000;
/// Nearer than this, two places are one (m).
const SAME_PLACE_M: f64 = 1e-3;
/// The columns: all but the last five must be there.
const COLUMNS: [&str; 12] = [
    "file",
    "source_x_m",
    "source_y_m",
    "source_z_m",
    "receiver_x_m",
    "receiver_y_m",
    "receiver_z_m",
    "source",
    "receiver",
    "temperature_c",
    "session",
    "recorded_at",
];
const NEEDED: usize = 7;

/// A line that is being read.
struct Line<'a> {
    path: &'a Path,
    number: u64,
    record: &'a StringRecord,
    columns: &'a HashMap<&'static str, usize>,
    /// Whether the comma is free to be the point of a number.
    decimal_comma: bool,
}

impl Line<'_> {
    fn at(&self, column: &str) -> String {
        format!("line {}, {column}", self.number)
    }

    fn text(&self, column: &'static str) -> Option<&str> {
        let index = *self.columns.get(column)?;
        self.record.get(index).filter(|text| !text.is_empty())
    }

    fn needed(&self, column: &'static str) -> Result<&str, Error> {
        self.text(column).ok_or_else(|| Error::Missing.in_file(self.path, self.at(column)))
    }

    fn number_of(&self, column: &'static str, text: &str) -> Result<f64, Error> {
        let found = number(text).filter(|_| self.decimal_comma || !text.contains(','));
        let found = found.filter(|value| value.is_finite());
        let error = || Error::TextLine { expected: "a number", text: text.chars().take(60).collect() };
        found.ok_or_else(|| error().in_file(self.path, self.at(column)))
    }

    fn place(&self, id: &'static str, columns: [&'static str; 3]) -> Result<Place, Error> {
        let mut position_m = [0.0; 3];
        for (coordinate, column) in position_m.iter_mut().zip(columns) {
            *coordinate = self.number_of(column, self.needed(column)?)?;
            OutOfRange::check("position (m)", *coordinate, -1e5, 1e5, "within 100 km")
                .map_err(|error| Error::from(error).in_file(self.path, self.at(column)))?;
        }
        Ok(Place { id: self.text(id).map(str::to_owned), position_m, axis: None })
    }
}

/// Places by name, so that a name that moves, or a place of two names, is found.
#[derive(Default)]
struct Known(Vec<(Option<String>, [f64; 3])>);

impl Known {
    fn check(&mut self, place: &Place) -> Result<(), Error> {
        for (id, position_m) in &self.0 {
            let near = (0..3).all(|k| (position_m[k] - place.position_m[k]).abs() < SAME_PLACE_M);
            let same = position_m == &place.position_m;
            if id.is_some() && *id == place.id && !same {
                let (id, here_m, before_m) = (id.clone().unwrap_or_default(), place.position_m, *position_m);
                return Err(Error::MovedPlace { id, here_m, before_m });
            }
            if near && (*id != place.id || !same) {
                let name =
                    |id: &Option<String>| id.clone().unwrap_or_else(|| "a place without a name".into());
                return Err(Error::SamePlace { id: name(&place.id), other: name(id) });
            }
        }
        if !self.0.iter().any(|(id, position_m)| *id == place.id && *position_m == place.position_m) {
            self.0.push((place.id.clone(), place.position_m));
        }
        Ok(())
    }
}

/// Reads a table and the files that it names.
pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Measurements, Error> {
    let bytes = read_at_most(path, MAX_FILE_BYTES + 1)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let error = Error::TooManyValues { found: bytes.len() as u64, limit: MAX_FILE_BYTES };
        return Err(error.in_file(path, "bytes"));
    }
    let text = String::from_utf8_lossy(&bytes);
    let text = text.trim_start_matches('\u{feff}');
    let head = text.lines().next().unwrap_or_default();
    let delimiter = [b'\t', b';'].into_iter().find(|&mark| head.contains(char::from(mark))).unwrap_or(b',');
    let mut lines = LineNumbers::of(text);
    let mut reader = ReaderBuilder::new().delimiter(delimiter).trim(Trim::All).from_reader(text.as_bytes());
    let columns = columns(reader.headers().map_err(|error| lines.broken(path, &error))?)
        .map_err(|error| error.in_file(path, "line 1"))?;
    let (mut sources, mut receivers) = (Places::new("s"), Places::new("r"));
    let mut known = [Known::default(), Known::default()];
    let (mut files, mut rows) = (HashSet::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(|error| lines.broken(path, &error))?;
        let number = lines.at(record.position());
        let line =
            Line { path, number, record: &record, columns: &columns, decimal_comma: delimiter != b',' };
        let source = line.place("source", ["source_x_m", "source_y_m", "source_z_m"])?;
        let receiver = line.place("receiver", ["receiver_x_m", "receiver_y_m", "receiver_z_m"])?;
        for (known, (place, column)) in known.iter_mut().zip([(&source, "source"), (&receiver, "receiver")]) {
            known.check(place).map_err(|error| error.in_file(path, line.at(column)))?;
        }
        let file = line.needed("file")?;
        if !files.insert(file.to_owned()) {
            return Err(Error::DuplicateId { id: file.to_owned() }.in_file(path, line.at("file")));
        }
        if rows.len() == MAX_RESPONSES {
            let error = Error::TooManyValues { found: MAX_RESPONSES as u64 + 1, limit: MAX_RESPONSES as u64 };
            return Err(error.in_file(path, line.at("file")));
        }
        let row = Row::read(&line, file, options)?;
        rows.push((sources.index(source), receivers.index(receiver), row));
    }
    let (sources, receivers) = (sources.finish(), receivers.finish());
    let (mut names, mut notes) = (Names::default(), Vec::new());
    let mut responses = Vec::new();
    for (s, r, row) in rows {
        let (samples, more) = Sound::read(&row.file)
            .and_then(|sound| sound.response(&row.file, options))
            .map_err(|error| error.in_file(path, row.field))?;
        notes.extend(more.into_iter().map(|note| format!("{}: {note}", row.file.display())));
        let (source, receiver) = (sources[s].id.clone(), receivers[r].id.clone());
        let name = names.unique(&format!("{source}_{receiver}"));
        let Row { air, session, recorded_at, .. } = row;
        responses.push(NewResponse { source, receiver, name, air, session, recorded_at, samples });
    }
    if responses.is_empty() {
        return Err(Error::Missing.in_file(path, "line 2"));
    }
    // One temperature for all is the room's.
    let first = responses[0].air;
    let air = first.filter(|_| responses.iter().all(|response| response.air == first));
    if air.is_some() {
        responses.iter_mut().for_each(|response| response.air = None);
    }
    let (measurement, note) = meaning(options.time_zero, options.levels, "The table");
    notes.extend(note);
    let sources = sources.into_iter().map(Source::from).collect();
    Ok(Measurements { sources, receivers, air, measurement, shoebox_m: None, responses, notes })
}

/// What a line says beside the places.
struct Row {
    file: PathBuf,
    field: String,
    air: Option<Air>,
    session: Option<String>,
    recorded_at: Option<f64>,
}

impl Row {
    fn read(line: &Line<'_>, name: &str, options: &ImportOptions) -> Result<Self, Error> {
        let folder = line.path.parent().unwrap_or(Path::new(""));
        let file = folder.join(name);
        if !options.allow_outside {
            check_inside(folder, &file).map_err(|error| error.in_file(line.path, line.at("file")))?;
        }
        let optional =
            |column: &'static str| line.text(column).map(|text| line.number_of(column, text)).transpose();
        let air = optional("temperature_c")?.map(|temperature_c| {
            Air::new(temperature_c, options.relative_humidity_percent, Air::default().pressure_kpa())
                .map_err(|error| Error::from(error).in_file(line.path, line.at("temperature_c")))
        });
        Ok(Self {
            file,
            field: line.at("file"),
            air: air.transpose()?,
            session: line.text("session").map(str::to_owned),
            recorded_at: optional("recorded_at")?,
        })
    }
}

/// Where each column stands.
fn columns(head: &StringRecord) -> Result<HashMap<&'static str, usize>, Error> {
    let mut columns = HashMap::new();
    for (index, name) in head.iter().enumerate() {
        let lower = name.to_ascii_lowercase();
        let Some(&column) = COLUMNS.iter().find(|column| **column == lower) else {
            let expected =
                "file, source_x_m ... receiver_z_m, source, receiver, temperature_c, session, recorded_at";
            return Err(Error::Unit { found: name.to_owned(), expected });
        };
        if columns.insert(column, index).is_some() {
            return Err(Error::DuplicateId { id: column.to_owned() });
        }
    }
    match COLUMNS[..NEEDED].iter().find(|column| !columns.contains_key(**column)) {
        Some(&text) => Err(Error::TextLine {
            expected: "a head of a table: a column is missing in it",
            text: text.to_owned(),
        }),
        None => Ok(columns),
    }
}
