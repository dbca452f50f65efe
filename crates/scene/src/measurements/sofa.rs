//! SOFA files (AES69-2022) of room responses: the conventions SingleRoomSRIR and SingleRoomMIMOSRIR, versions 1.

mod arrays;
mod coordinates;
mod hdf5_checksum;
mod hdf5_writer;
mod write;

pub use write::SofaConvention;
pub(super) use write::write;

use super::places::Places;
use super::{ImportOptions, Measurements, meaning};
use crate::error::Error;
use crate::measured_room::response_check;
use crate::measured_room::{Levels, NewResponse, TimeZero};
use arrays::{Array, SofaFile};
use coordinates::{Frames, Points, placed, turned, unit};
use sabine_acoustics::{Air, Error as ValueError, ImpulseResponse, OutOfRange};
use std::path::Path;

/// Most responses that one file may hold: each becomes a file of its own.
const MAX_RESPONSES: usize = 20_000;
/// Longest delay (s) that is put before a response.
const MAX_DELAY_S: f64 = 60.0;
/// Attributes of our own: identifiers of sources or receivers, one in a line, and what times and levels mean.
const IDENTIFIERS: &str = "Identifiers";
const TIME_ZERO: &str = "TimeZero";
const LEVELS: &str = "Levels";

/// Reads a file.
pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Measurements, Error> {
    measurements(&SofaFile::open(path)?, options)
}

/// Reads a file that is in memory.
pub(super) fn of_bytes(name: &Path, bytes: Vec<u8>, options: &ImportOptions) -> Result<Measurements, Error> {
    measurements(&SofaFile::of_bytes(name, bytes)?, options)
}

fn measurements(file: &SofaFile, options: &ImportOptions) -> Result<Measurements, Error> {
    let path = file.path();
    let mimo = convention(file)? == "SingleRoomMIMOSRIR";
    let responses = Responses::read(file, mimo)?;
    let (m, r, e) = (responses.measurements, responses.receivers, responses.emitters);
    let listener = Object::read(
        file,
        ["ListenerPosition", "ListenerView", "ListenerUp", "ReceiverPosition", "ReceiverView"],
        r,
        m,
    )?;
    let source = Object::read(
        file,
        ["SourcePosition", "SourceView", "SourceUp", "EmitterPosition", "EmitterView"],
        e,
        m,
    )?;
    let (mut sources, mut receivers) = (Places::new("s"), Places::new("r"));
    let airs = airs(file, m, options)?;
    let mut found = Vec::new();
    let mut rounded = 0;
    for measurement in 0..m {
        for receiver in 0..r {
            for emitter in 0..e {
                let field =
                    format!("Data.IR[measurement {measurement}, receiver {receiver}, emitter {emitter}]");
                let (samples, exact) = responses.samples(measurement, receiver, emitter);
                rounded += usize::from(!exact);
                let samples = ImpulseResponse::new(samples, responses.rate_hz(measurement))
                    .map_err(|error| Error::from(error).in_file(path, &field))?;
                response_check::check(samples.samples(), samples.sample_rate_hz())
                    .map_err(|error| error.in_file(path, &field))?;
                let from = source.place(file, emitter, measurement)?;
                let to = listener.place(file, receiver, measurement)?;
                found.push((sources.index(from), receivers.index(to), measurement, samples));
            }
        }
    }
    let (sources, receivers) = (sources.finish(), receivers.finish());
    let mut names = super::file_names::Names::default();
    let responses = found
        .into_iter()
        .map(|(s, r, measurement, samples)| {
            let (source, receiver) = (sources[s].id.clone(), receivers[r].id.clone());
            let name = names.unique(&format!("{source}_{receiver}"));
            // Where it is the same for all, the room says it.
            let air = airs.get(measurement).copied().filter(|air| airs.first() != Some(air));
            NewResponse { source, receiver, name, air, session: None, recorded_at: None, samples }
        })
        .collect();
    let mut notes = Vec::new();
    if rounded > 0 {
        notes.push(format!("{rounded} responses have samples that 32-bit floats do not hold: rounded"));
    }
    let time_zero = options.time_zero.or_else(|| TimeZero::from_word(&file.attribute(TIME_ZERO)?));
    let levels = options.levels.or_else(|| Levels::from_word(&file.attribute(LEVELS)?));
    let (measurement, note) = meaning(time_zero, levels, "SOFA");
    notes.extend(note);
    Ok(Measurements {
        sources: sources.into_iter().map(crate::scene::Source::from).collect(),
        receivers,
        air: airs.first().copied(),
        measurement,
        shoebox_m: shoebox(file)?,
        responses,
        notes,
    })
}

/// The name of the convention, which must be one of those that are read.
fn convention(file: &SofaFile) -> Result<String, Error> {
    let missing = |name: &str| Error::Missing.in_file(file.path(), name);
    let outer = file.attribute("Conventions").ok_or_else(|| missing("Conventions"))?;
    let name = file.attribute("SOFAConventions").ok_or_else(|| missing("SOFAConventions"))?;
    let version = file.attribute("SOFAConventionsVersion").unwrap_or_else(|| "1.0".into());
    let known = outer == "SOFA"
        && version.starts_with("1.")
        && ["SingleRoomSRIR", "SingleRoomMIMOSRIR"].contains(&name.as_str());
    if !known {
        let found = format!("{name} {version}");
        return Err(Error::SofaConvention { found }.in_file(file.path(), "SOFAConventions"));
    }
    let (kind, wanted) = (file.attribute("DataType"), if name == "SingleRoomSRIR" { "FIR" } else { "FIR-E" });
    if kind.as_deref() != Some(wanted) {
        let error = Error::Unit { found: kind.unwrap_or_default(), expected: wanted };
        return Err(error.in_file(file.path(), "DataType"));
    }
    Ok(name)
}

/// `Data.IR`, its delay and its sample rate.
struct Responses {
    measurements: usize,
    receivers: usize,
    emitters: usize,
    length: usize,
    values: Vec<f64>,
    /// In samples: of all or of one measurement, of each receiver, of all or of one emitter.
    delay: Option<Array>,
    rates_hz: Vec<u32>,
}

impl Responses {
    fn read(file: &SofaFile, mimo: bool) -> Result<Self, Error> {
        let ir = file.needed("Data.IR")?;
        let found = format!("{:?}", ir.shape);
        let [measurements, receivers, length, emitters] = match (mimo, ir.shape.as_slice()) {
            (false, &[m, r, n]) => [m, r, n, 1],
            (true, &[m, r, n, e]) => [m, r, n, e],
            _ => {
                let expected = if mimo { "[M, R, N, E]" } else { "[M, R, N]" }.to_owned();
                return Err(Error::Shape { expected, found }.in_file(file.path(), "Data.IR"));
            }
        };
        let count = measurements.saturating_mul(receivers).saturating_mul(emitters);
        if count > MAX_RESPONSES {
            let error = Error::TooManyValues { found: count as u64, limit: MAX_RESPONSES as u64 };
            return Err(error.in_file(file.path(), "Data.IR"));
        }
        let rates_hz = rates(file, measurements)?;
        let delay = delay(file, [measurements, receivers, emitters], mimo, &rates_hz)?;
        Ok(Self { measurements, receivers, emitters, length, values: ir.values, delay, rates_hz })
    }

    fn rate_hz(&self, measurement: usize) -> u32 {
        self.rates_hz[if self.rates_hz.len() == 1 { 0 } else { measurement }]
    }

    /// Samples with their delay, and whether 32 bits hold them.
    fn samples(&self, m: usize, r: usize, e: usize) -> (Vec<f32>, bool) {
        let at = |n: usize| self.values[((m * self.receivers + r) * self.length + n) * self.emitters + e];
        let delay = self.delay.as_ref().map_or(0.0, |array| {
            let one = |length: usize, index: usize| if length == 1 { 0 } else { index };
            let (rows, parts) = (array.shape[0], array.shape.get(2).copied().unwrap_or(1));
            array.values[(one(rows, m) * self.receivers + r) * parts + one(parts, e)]
        });
        let mut samples = vec![0.0; delay as usize];
        samples.extend((0..self.length).map(|n| at(n) as f32));
        let exact = (0..self.length).all(|n| f64::from(at(n) as f32) == at(n));
        (samples, exact)
    }
}

fn rates(file: &SofaFile, measurements: usize) -> Result<Vec<u32>, Error> {
    let name = "Data.SamplingRate";
    let array = file.needed(name)?;
    if array.shape != [1] && array.shape != [measurements] {
        let expected = format!("[1] or [{measurements}]");
        return Err(Error::Shape { expected, found: format!("{:?}", array.shape) }.in_file(file.path(), name));
    }
    let unit = file.attribute_of(name, "Units")?.unwrap_or_else(|| "hertz".into());
    if !["hertz", "hz"].contains(&unit.to_ascii_lowercase().as_str()) {
        let error = Error::Unit { found: unit, expected: "hertz" };
        return Err(error.in_file(file.path(), "Data.SamplingRate:Units"));
    }
    let rate = |&hz: &f64| {
        let whole = if hz.fract() == 0.0 { hz } else { f64::NAN };
        OutOfRange::check("sample rate (Hz)", whole, 1e3, 768e3, "a whole number from 1 kHz to 768 kHz")?;
        Ok(hz as u32)
    };
    let rates = array.values.iter().map(rate).collect::<Result<_, OutOfRange>>();
    rates.map_err(|error| Error::from(error).in_file(file.path(), name))
}

/// `Data.Delay`, whole samples that are not negative.
fn delay(
    file: &SofaFile,
    [m, r, e]: [usize; 3],
    mimo: bool,
    rates_hz: &[u32],
) -> Result<Option<Array>, Error> {
    let name = "Data.Delay";
    let Some(array) = file.numbers(name)? else { return Ok(None) };
    let fits = match *array.shape.as_slice() {
        [rows, receivers] => (rows == 1 || rows == m) && receivers == r,
        [rows, receivers, parts] if mimo => {
            (rows == 1 || rows == m) && receivers == r && (parts == 1 || parts == e)
        }
        _ => false,
    };
    if !fits {
        let expected = if mimo { format!("[1 or {m}, {r}, 1 or {e}]") } else { format!("[1 or {m}, {r}]") };
        return Err(Error::Shape { expected, found: format!("{:?}", array.shape) }.in_file(file.path(), name));
    }
    let most = MAX_DELAY_S * f64::from(rates_hz.iter().copied().min().unwrap_or(1));
    for &delay in &array.values {
        let whole = if delay.fract() == 0.0 { delay } else { f64::NAN };
        OutOfRange::check("delay (samples)", whole, 0.0, most, "a whole number of samples, at most 60 s")
            .map_err(|error| Error::from(error).in_file(file.path(), name))?;
    }
    Ok(Some(array))
}

/// A listener with its receivers, or a source with its emitters.
struct Object {
    names: [&'static str; 5],
    position: Points,
    frames: Frames,
    parts: Option<Points>,
    part_views: Option<Points>,
    /// Of each measurement, or of each part of a single one.
    identifiers: Vec<String>,
}

impl Object {
    fn read(file: &SofaFile, names: [&'static str; 5], parts: usize, m: usize) -> Result<Self, Error> {
        let [position, view, up, part, part_view] = names;
        let missing = || Error::Missing.in_file(file.path(), position);
        let lines = |name: &str| -> Result<Option<Vec<String>>, Error> {
            let text = file.attribute_of(name, IDENTIFIERS)?;
            Ok(text.map(|text| text.split('\n').map(str::to_owned).collect()))
        };
        // Identifiers that do not fit were left behind by a program that did not know them.
        let of_parts = lines(part)?.filter(|list| m == 1 && list.len() == parts);
        let identifiers = of_parts.or(lines(position)?.filter(|list| parts == 1 && list.len() == m));
        Ok(Self {
            names,
            position: Points::of_measurements(file, position, m)?.ok_or_else(missing)?,
            frames: Frames::read(file, view, up, m)?,
            parts: Points::of_parts(file, part, parts, m)?,
            part_views: Points::of_parts(file, part_view, parts, m)?,
            identifiers: identifiers.unwrap_or_default(),
        })
    }

    /// Where a part is in a measurement, and where it looks.
    fn place(&self, file: &SofaFile, part: usize, measurement: usize) -> Result<super::places::Place, Error> {
        let axes = self.frames.at(file, measurement)?;
        let own = self.parts.as_ref().map_or([0.0; 3], |parts| parts.at(part, measurement));
        let view = self.part_views.as_ref().map_or([1.0, 0.0, 0.0], |views| views.at(part, measurement));
        let named =
            |name: &'static str| move |error: OutOfRange| Error::from(error).in_file(file.path(), name);
        let axis = unit(turned(axes, view)).map_err(named(self.names[4]))?;
        let position_m = placed(self.position.at(0, measurement), axes, own);
        for coordinate in position_m {
            OutOfRange::check("position (m)", coordinate, -1e5, 1e5, "within 100 km")
                .map_err(named(self.names[0]))?;
        }
        let id = match self.identifiers.len() {
            0 => None,
            1 => self.identifiers.first(),
            _ => self.identifiers.get(measurement.max(part)),
        };
        Ok(super::places::Place { id: id.cloned(), position_m, axis: Some(axis) })
    }
}

/// The air of each measurement, or one for all; empty where the file is silent.
fn airs(file: &SofaFile, measurements: usize, options: &ImportOptions) -> Result<Vec<Air>, Error> {
    let name = "RoomTemperature";
    let Some(array) = file.numbers(name)? else { return Ok(Vec::new()) };
    if array.shape != [1] && array.shape != [measurements] {
        let expected = format!("[1] or [{measurements}]");
        return Err(Error::Shape { expected, found: format!("{:?}", array.shape) }.in_file(file.path(), name));
    }
    // Zero is what templates fill in.
    if array.values.iter().all(|&value| value == 0.0) {
        return Ok(Vec::new());
    }
    let unit = file.attribute_of(name, "Units")?.unwrap_or_default().to_ascii_lowercase();
    let zero = match unit.as_str() {
        "kelvin" | "k" => 273.15,
        "celsius" | "degree celsius" | "degrees celsius" => 0.0,
        _ => {
            let error = Error::Unit { found: unit, expected: "kelvin or degree celsius" };
            return Err(error.in_file(file.path(), "RoomTemperature:Units"));
        }
    };
    // Kelvin with two decimals is Celsius with two decimals, not one that ends in 99999.
    let celsius = |value: f64| ((value - zero) * 1e6).round() / 1e6;
    let air = |&value: &f64| {
        Air::new(celsius(value), options.relative_humidity_percent, Air::default().pressure_kpa())
    };
    let airs = array.values.iter().map(air).collect::<Result<_, ValueError>>();
    airs.map_err(|error| Error::from(error).in_file(file.path(), name))
}

/// The box that the file states: `RoomCornerA` and `RoomCornerB`.
fn shoebox(file: &SofaFile) -> Result<Option<[[f64; 3]; 2]>, Error> {
    if file.attribute("RoomType").as_deref() != Some("shoebox") {
        return Ok(None);
    }
    let corner = |name: &'static str| -> Result<Option<[f64; 3]>, Error> {
        Ok(Points::of_measurements(file, name, 1)?.map(|points| points.at(0, 0)))
    };
    let (Some(a), Some(b)) = (corner("RoomCornerA")?, corner("RoomCornerB")?) else { return Ok(None) };
    Ok(Some([[0, 1, 2].map(|k| a[k].min(b[k])), [0, 1, 2].map(|k| a[k].max(b[k]))]))
}
