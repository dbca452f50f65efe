//! Room responses written as a SOFA file.

use super::hdf5_writer::{Hdf5Content, MAX_MESSAGE_BYTES, Variable};
use super::{IDENTIFIERS, LEVELS, TIME_ZERO};
use crate::error::Error;
use crate::measured_room::NewResponse;
use crate::measurements::Measurements;
use crate::scene::{Receiver, cross, norm};
use sabine_acoustics::{Error as ValueError, write_atomically};
use std::collections::HashMap;
use std::io::Write as _;
use std::path::Path;

/// The convention of a SOFA file of room responses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SofaConvention {
    /// SingleRoomSRIR 1.0: one pair of source and receiver in each measurement.
    #[default]
    Pairs,
    /// SingleRoomMIMOSRIR 1.0: one measurement with a response from every source to every receiver.
    Grid,
}

/// Order of the dimensions in the file, as their indices.
const I: usize = 0;
const C: usize = 1;
const M: usize = 2;
const R: usize = 3;
const N: usize = 4;
const E: usize = 5;

/// Writes a file, whole or not at all.
pub(in crate::measurements) fn write(
    set: &Measurements,
    path: &Path,
    convention: SofaConvention,
    created: &str,
) -> Result<(), Error> {
    let (rate_hz, length) = shape(&set.responses).map_err(|error| error.in_file(path, "Data.IR"))?;
    let mut content = match convention {
        SofaConvention::Pairs => pairs(set, length),
        SofaConvention::Grid => grid(set, length),
    }
    .map_err(|error| error.in_file(path, "Data.IR"))?;
    content.variables.push(numbers(
        "Data.SamplingRate",
        &[I],
        vec![f64::from(rate_hz)],
        &[("Units", "hertz")],
    ));
    content.attributes = attributes(set, convention, created);
    let texts = content.variables.iter().flat_map(|variable| &variable.attributes);
    if let Some((name, text)) = texts.into_iter().find(|(_, text)| text.len() + 64 > MAX_MESSAGE_BYTES) {
        let error = Error::TooManyValues { found: text.len() as u64, limit: MAX_MESSAGE_BYTES as u64 };
        return Err(error.in_file(path, *name));
    }
    Ok(write_atomically(path, |file| file.write_all(&content.to_bytes()))?)
}

/// Sample rate and length, which a file has one of.
fn shape(responses: &[NewResponse]) -> Result<(u32, usize), Error> {
    let first = &responses.first().ok_or(ValueError::Empty { what: "the list of responses" })?.samples;
    let (rate_hz, length) = (first.sample_rate_hz(), first.samples().len());
    for response in responses {
        let (right_hz, found) = (response.samples.sample_rate_hz(), response.samples.samples().len());
        if right_hz != rate_hz {
            return Err(ValueError::SampleRates { left_hz: rate_hz, right_hz }.into());
        }
        if found != length {
            return Err(ValueError::Length { expected: length, found }.into());
        }
    }
    Ok((rate_hz, length))
}

/// SingleRoomSRIR: a measurement for each response.
fn pairs(set: &Measurements, length: usize) -> Result<Hdf5Content, Error> {
    let m = set.responses.len();
    let places = |of: &dyn Fn(&NewResponse) -> Result<Receiver, Error>| {
        set.responses.iter().map(of).collect::<Result<Vec<_>, _>>()
    };
    let sources: Vec<Receiver> = set
        .sources
        .iter()
        .map(|s| Receiver { id: s.id.clone(), position_m: s.position_m, axis: s.axis })
        .collect();
    let (source_of, receiver_of) = (by_id(&sources), by_id(&set.receivers));
    let sources = places(&|response| found(&source_of, &response.source))?;
    let receivers = places(&|response| found(&receiver_of, &response.receiver))?;
    let mut variables = Vec::new();
    for (names, places) in [
        (["ListenerPosition", "ListenerView", "ListenerUp", "ReceiverPosition"], &receivers),
        (["SourcePosition", "SourceView", "SourceUp", "EmitterPosition"], &sources),
    ] {
        let [position, view, up, part] = names;
        let ids: Vec<&str> = places.iter().map(|place| place.id.as_str()).collect();
        let mut positions = numbers(position, &[M, C], flat(places.iter().map(|p| p.position_m)), &METRES);
        positions.attributes.push((IDENTIFIERS, ids.join("\n")));
        variables.push(positions);
        variables.push(numbers(view, &[M, C], flat(places.iter().map(view_of)), &METRES));
        variables.push(numbers(up, &[M, C], flat(places.iter().map(|p| up_of(view_of(p)))), &[]));
        let parts = if part == "ReceiverPosition" { R } else { E };
        variables.push(numbers(part, &[parts, C, I], vec![0.0; 3], &METRES));
    }
    if let Some(kelvin) = kelvin(set) {
        variables.push(numbers("RoomTemperature", &[M], kelvin, &[("Units", "kelvin")]));
    }
    variables.push(numbers("Data.Delay", &[I, R], vec![0.0], &[]));
    let samples = set.responses.iter().flat_map(|response| response.samples.samples());
    variables.push(numbers("Data.IR", &[M, R, N], samples.map(|&x| f64::from(x)).collect(), &[]));
    Ok(Hdf5Content { attributes: Vec::new(), dimensions: dimensions([m, 1, length, 1]), variables })
}

/// SingleRoomMIMOSRIR: one measurement; listener and source are the origin, receivers and emitters where they stand.
fn grid(set: &Measurements, length: usize) -> Result<Hdf5Content, Error> {
    let (r, e) = (set.receivers.len(), set.sources.len());
    let mut responses: HashMap<(&str, &str), &[f32]> = HashMap::new();
    for response in &set.responses {
        let pair = (response.source.as_str(), response.receiver.as_str());
        if responses.insert(pair, response.samples.samples()).is_some() {
            return Err(Error::DuplicateId { id: format!("{} to {}", pair.0, pair.1) });
        }
    }
    let mut values = vec![0.0; r * length * e];
    for (i, receiver) in set.receivers.iter().enumerate() {
        for (k, source) in set.sources.iter().enumerate() {
            let pair = (source.id.as_str(), receiver.id.as_str());
            let samples = responses.get(&pair).ok_or_else(|| Error::MissingPair {
                source_id: source.id.clone(),
                receiver_id: receiver.id.clone(),
            })?;
            for (n, &sample) in samples.iter().enumerate() {
                values[(i * length + n) * e + k] = f64::from(sample);
            }
        }
    }
    let sources: Vec<Receiver> = set
        .sources
        .iter()
        .map(|s| Receiver { id: s.id.clone(), position_m: s.position_m, axis: s.axis })
        .collect();
    let mut variables = Vec::new();
    for (names, part, places) in [
        (
            [
                "ListenerPosition",
                "ListenerView",
                "ListenerUp",
                "ReceiverPosition",
                "ReceiverView",
                "ReceiverUp",
            ],
            R,
            &set.receivers,
        ),
        (
            ["SourcePosition", "SourceView", "SourceUp", "EmitterPosition", "EmitterView", "EmitterUp"],
            E,
            &sources,
        ),
    ] {
        let [origin, view, up, position, part_view, part_up] = names;
        variables.push(numbers(origin, &[M, C], vec![0.0; 3], &METRES));
        variables.push(numbers(view, &[M, C], vec![1.0, 0.0, 0.0], &METRES));
        variables.push(numbers(up, &[M, C], vec![0.0, 0.0, 1.0], &[]));
        let ids: Vec<&str> = places.iter().map(|place| place.id.as_str()).collect();
        let mut positions =
            numbers(position, &[part, C, I], flat(places.iter().map(|p| p.position_m)), &METRES);
        positions.attributes.push((IDENTIFIERS, ids.join("\n")));
        variables.push(positions);
        variables.push(numbers(part_view, &[part, C, I], flat(places.iter().map(view_of)), &METRES));
        variables.push(numbers(part_up, &[part, C, I], flat(places.iter().map(|p| up_of(view_of(p)))), &[]));
    }
    if let Some(kelvin) = kelvin(set) {
        variables.push(numbers("RoomTemperature", &[I], kelvin[..1].to_vec(), &[("Units", "kelvin")]));
    }
    variables.push(numbers("Data.Delay", &[I, R, I], vec![0.0; r], &[]));
    variables.push(numbers("Data.IR", &[M, R, N, E], values, &[]));
    Ok(Hdf5Content { attributes: Vec::new(), dimensions: dimensions([1, r, length, e]), variables })
}

/// Temperature of each response, where the room states its air.
fn kelvin(set: &Measurements) -> Option<Vec<f64>> {
    let room = set.air?;
    Some(set.responses.iter().map(|response| response.air.unwrap_or(room).temperature_c() + 273.15).collect())
}

fn by_id(places: &[Receiver]) -> HashMap<&str, &Receiver> {
    places.iter().map(|place| (place.id.as_str(), place)).collect()
}

fn found(places: &HashMap<&str, &Receiver>, id: &str) -> Result<Receiver, Error> {
    let place = places.get(id).ok_or_else(|| ValueError::UnknownId { id: id.to_owned() })?;
    Ok((*place).clone())
}

fn dimensions([m, r, n, e]: [usize; 4]) -> Vec<(&'static str, usize)> {
    vec![("I", 1), ("C", 3), ("M", m), ("R", r), ("N", n), ("E", e)]
}

const METRES: [(&str, &str); 2] = [("Type", "cartesian"), ("Units", "metre")];

fn numbers(
    name: &'static str,
    dimensions: &[usize],
    values: Vec<f64>,
    attributes: &[(&'static str, &str)],
) -> Variable {
    let attributes = attributes.iter().map(|&(name, text)| (name, text.to_owned())).collect();
    Variable { name, dimensions: dimensions.to_vec(), values, attributes }
}

fn flat(points: impl Iterator<Item = [f64; 3]>) -> Vec<f64> {
    points.flatten().collect()
}

/// SOFA demands a view: (1, 0, 0) where there is none.
fn view_of(place: &Receiver) -> [f64; 3] {
    place.axis.unwrap_or([1.0, 0.0, 0.0])
}

/// A direction square to the view: upwards, or along -x for a view that is vertical.
fn up_of(view: [f64; 3]) -> [f64; 3] {
    let left = cross([0.0, 0.0, 1.0], view);
    let up = if norm(left) < 1e-3 { [-1.0, 0.0, 0.0] } else { cross(view, left) };
    let length = norm(up);
    up.map(|c| c / length)
}

fn attributes(set: &Measurements, convention: SofaConvention, created: &str) -> Vec<(String, String)> {
    let (name, data_type) = match convention {
        SofaConvention::Pairs => ("SingleRoomSRIR", "FIR"),
        SofaConvention::Grid => ("SingleRoomMIMOSRIR", "FIR-E"),
    };
    let version = env!("CARGO_PKG_VERSION");
    [
        ("Conventions", "SOFA"),
        ("Version", "2.1"),
        ("SOFAConventions", name),
        ("SOFAConventionsVersion", "1.0"),
        ("DataType", data_type),
        ("RoomType", "reverberant"),
        // Demanded of reverberant rooms.
        ("RoomDescription", "as measured"),
        ("Title", "Room responses"),
        ("DateCreated", created),
        ("DateModified", created),
        ("APIName", "Sabine"),
        ("APIVersion", version),
        ("AuthorContact", ""),
        ("Organization", ""),
        ("License", "No license provided, ask the author for permission"),
        ("ApplicationName", "Sabine"),
        ("ApplicationVersion", version),
        ("DatabaseName", ""),
        (TIME_ZERO, set.measurement.time_zero.word()),
        (LEVELS, set.measurement.levels.word()),
    ]
    .map(|(name, text)| (name.to_owned(), text.to_owned()))
    .into()
}
