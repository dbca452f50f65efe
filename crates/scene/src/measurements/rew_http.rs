//! Impulse responses from the Room EQ Wizard while it runs, through its local interface (HTTP).
//!
//! `GET /measurements` lists what is loaded, by index; `GET /measurements/ID/impulse-response` gives a response, its samples as 32-bit
//! floats, the highest byte first, in base64. Without `normalised=false` every response comes with a peak of 1, whatever its level;
//! with it samples are percent of full scale. After the program's help ("API", version 5.40); no running program was at hand.

use super::rew::RewResponse;
use crate::error::Error;
use base64::Engine as _;
use sabine_acoustics::{ImpulseResponse, OutOfRange};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

/// Most bytes of an answer: 24 million samples, eight minutes at 48 kHz.
const MAX_ANSWER_BYTES: u64 = 128 << 20;
/// Longest wait for an answer.
const TIMEOUT: Duration = Duration::from_secs(60);
/// Full scale in the program's unit.
const FULL_SCALE_PERCENT: f32 = 100.0;
/// Farthest start of a response from time zero (s).
const MAX_START_S: f64 = 60.0;
/// Measurements that a message lists.
const MAX_LISTED: usize = 20;
/// Characters of an answer or a title that a message repeats.
const MAX_REPEATED: usize = 80;

/// What names a measurement.
const ADDRESS: &str = "the address of one measurement, as http://127.0.0.1:4735/measurements/1";

/// A response as the program sends it. What else an answer holds is passed over.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Answer {
    unit: Option<String>,
    start_time: Option<f64>,
    sample_rate: Option<f64>,
    data: Option<String>,
}

/// A measurement in the list.
#[derive(Deserialize)]
struct Summary {
    #[serde(default)]
    title: String,
}

/// Fetches the measurement at an address.
pub(super) fn fetch(address: &str) -> Result<RewResponse, Error> {
    let at = |error: Error| error.in_file(address, "address");
    let (server, measurement) = parts(address).map_err(at)?;
    let Some(measurement) = measurement else {
        let list = get(&format!("{server}/measurements"))?;
        let found = listed(&list).unwrap_or_else(|_| shortened(&String::from_utf8_lossy(&list)));
        return Err(Error::Unit { found, expected: ADDRESS }.in_file(address, "measurements"));
    };
    let url = format!("{server}/measurements/{measurement}/impulse-response?normalised=false&unit=percent");
    of_answer(Path::new(address), &get(&url)?)
}

/// The server, and the measurement if one is named: by its index, or by its identifier, which stays when others are removed.
fn parts(address: &str) -> Result<(&str, Option<&str>), Error> {
    let unknown = || Error::Unit { found: shortened(address), expected: ADDRESS };
    let rest = address.strip_prefix("http://").ok_or_else(unknown)?;
    let host = rest.split('/').next().unwrap_or_default();
    if host.is_empty() || host.contains(|c: char| !(c.is_ascii_alphanumeric() || ".:-[]".contains(c))) {
        return Err(unknown());
    }
    let server = &address[.."http://".len() + host.len()];
    let words: Vec<&str> = rest[host.len()..].split('/').filter(|word| !word.is_empty()).collect();
    match words[..] {
        [] | ["measurements"] => Ok((server, None)),
        ["measurements", id] | ["measurements", id, "impulse-response"]
            if id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-') =>
        {
            Ok((server, Some(id)))
        }
        _ => Err(unknown()),
    }
}

/// The body of an answer, which must say that all went well.
fn get(url: &str) -> Result<Vec<u8>, Error> {
    let failed = |source: ureq::Error| match source {
        ureq::Error::BodyExceedsLimit(_) => {
            Error::TooManyValues { found: MAX_ANSWER_BYTES + 1, limit: MAX_ANSWER_BYTES }
                .in_file(url, "bytes")
        }
        source => Error::Http { address: url.into(), source: Box::new(source) },
    };
    let agent: ureq::Agent = ureq::Agent::config_builder()
        .timeout_global(Some(TIMEOUT))
        .max_redirects(0)
        .http_status_as_error(false)
        .proxy(None)
        .build()
        .into();
    let mut answer = agent.get(url).call().map_err(failed)?;
    if let Some(bytes) = answer.body().content_length().filter(|&bytes| bytes > MAX_ANSWER_BYTES) {
        return Err(Error::TooManyValues { found: bytes, limit: MAX_ANSWER_BYTES }.in_file(url, "bytes"));
    }
    let status = answer.status().as_u16();
    let body = answer.body_mut().with_config().limit(MAX_ANSWER_BYTES).read_to_vec().map_err(failed)?;
    if status != 200 {
        let text = shortened(&String::from_utf8_lossy(&body));
        return Err(Error::HttpStatus { address: url.into(), status, text });
    }
    Ok(body)
}

/// Reads an answer; `path` is its name in messages.
pub(super) fn of_answer(path: &Path, body: &[u8]) -> Result<RewResponse, Error> {
    let answer: Answer = serde_json::from_slice(body).map_err(|error| {
        let text = shortened(&String::from_utf8_lossy(body));
        let found = if text.is_empty() { "nothing".to_owned() } else { format!("{text} ({error})") };
        Error::Unit { found, expected: "an impulse response in JSON" }.in_file(path, "answer")
    })?;
    let missing = |field: &str| Error::Missing.in_file(path, field);
    let mut notes = Vec::new();
    match answer.unit.as_deref() {
        Some(unit) if unit.eq_ignore_ascii_case("percent") => {}
        Some(unit) => {
            let error = Error::Unit { found: shortened(unit), expected: "percent" };
            return Err(error.in_file(path, "unit"));
        }
        None => notes.push("the answer states no unit: percent of full scale is assumed".to_owned()),
    }
    let rate_hz = answer.sample_rate.ok_or_else(|| missing("sampleRate"))?;
    let range = "a whole number from 1 kHz to 768 kHz";
    let checked = OutOfRange::check("sample rate (Hz)", rate_hz, 1e3, 768e3, range).and_then(|()| {
        let whole = rate_hz.fract() == 0.0;
        if whole { Ok(()) } else { Err(OutOfRange { field: "sample rate (Hz)", value: rate_hz, range }) }
    });
    checked.map_err(|error| Error::from(error).in_file(path, "sampleRate"))?;
    let start_s = answer.start_time.ok_or_else(|| missing("startTime"))?;
    OutOfRange::check("start time (s)", start_s, -MAX_START_S, MAX_START_S, "within 60 s")
        .map_err(|error| Error::from(error).in_file(path, "startTime"))?;
    let samples =
        samples(&answer.data.ok_or_else(|| missing("data"))?).map_err(|error| error.in_file(path, "data"))?;
    let samples = ImpulseResponse::new(samples, rate_hz as u32)
        .map_err(|error| Error::from(error).in_file(path, "data"))?;
    Ok(RewResponse { samples, start_s, notes })
}

/// The samples of a response in full scale.
fn samples(data: &str) -> Result<Vec<f32>, Error> {
    let bytes = base64::engine::general_purpose::STANDARD.decode(data.as_bytes()).map_err(|error| {
        Error::Unit { found: format!("{} ({error})", shortened(data)), expected: "base64" }
    })?;
    let (samples, rest) = bytes.as_chunks::<4>();
    if !rest.is_empty() {
        let found = format!("{} bytes", bytes.len());
        return Err(Error::Shape { expected: "a whole number of samples of 4 bytes".into(), found });
    }
    Ok(samples.iter().map(|bytes| f32::from_be_bytes(*bytes) / FULL_SCALE_PERCENT).collect())
}

/// What is loaded, as a message says it: `1: Seat 1, 2: Seat 2`.
fn listed(list: &[u8]) -> Result<String, serde_json::Error> {
    let all: BTreeMap<String, Summary> = serde_json::from_str(&plain_json(&String::from_utf8_lossy(list)))?;
    let mut numbered: Vec<(Option<u32>, String)> = all
        .into_iter()
        .map(|(id, one)| (id.parse().ok(), format!("{id}: {}", shortened(&one.title))))
        .collect();
    numbered.sort();
    let count = numbered.len();
    let mut text: Vec<String> = numbered.into_iter().map(|(_, text)| text).take(MAX_LISTED).collect();
    if count > MAX_LISTED {
        text.push(format!("and {} more", count - MAX_LISTED));
    }
    Ok(if text.is_empty() { "empty: no measurement is loaded".into() } else { text.join(", ") })
}

/// JSON as the standard has it: the program writes `NaN` and `Infinity` where a number has no value, which become `null`.
fn plain_json(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let (mut quoted, mut escaped) = (false, false);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if !quoted
            && let Some(word) = ["NaN", "-Infinity", "Infinity"].into_iter().find(|w| rest.starts_with(w))
        {
            plain.push_str("null");
            rest = &rest[word.len()..];
            continue;
        }
        quoted ^= c == '"' && !escaped;
        escaped = quoted && c == '\\' && !escaped;
        plain.push(c);
        rest = &rest[c.len_utf8()..];
    }
    plain
}

/// The beginning of a text from outside, on one line.
fn shortened(text: &str) -> String {
    let mut short = String::new();
    for c in text.trim().chars().take(MAX_REPEATED) {
        let _ = short.write_char(if c.is_control() { ' ' } else { c });
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base64(samples: &[f32]) -> String {
        let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_be_bytes()).collect();
        base64::engine::general_purpose::STANDARD.encode(bytes)
    }

    fn answer(data: &str) -> String {
        format!(
            r#"{{"unit": "percent", "startTime": -0.25, "sampleRate": 48000.0, "timingReference": "Loopback", "data": "{data}"}}"#
        )
    }

    fn read(text: &str) -> Result<RewResponse, String> {
        of_answer(Path::new("rew"), text.as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn samples_are_percent_of_full_scale_with_the_highest_byte_first() {
        let found = read(&answer(&base64(&[50.0, -12.5, 0.0, 1.5625]))).unwrap();
        assert_eq!(found.samples.samples(), [0.5, -0.125, 0.0, 0.015625]);
        assert_eq!((found.samples.sample_rate_hz(), found.start_s), (48_000, -0.25));
        assert!(found.notes.is_empty());
        // 1.0 is 3F 80 00 00, which base64 writes so.
        assert_eq!(read(&answer("P4AAAA==")).unwrap().samples.samples(), [0.01]);
    }

    #[test]
    fn each_fault_names_its_field() {
        let good = answer(&base64(&[1.0, 0.5]));
        read(&good).unwrap();
        for (from, to, words) in [
            ("percent", "dBFS", "rew: unit: is `dBFS`; percent can be read"),
            ("48000.0", "48000.5", "rew: sampleRate: sample rate (Hz) is 48000.5"),
            ("48000.0", "0", "rew: sampleRate"),
            ("48000.0", "null", "rew: sampleRate: is missing"),
            ("-0.25", "1e9", "rew: startTime"),
            ("\"startTime\"", "\"start\"", "rew: startTime: is missing"),
            ("\"data\"", "\"dates\"", "rew: data: is missing"),
            ("P4AAAD8AAAA=", "P4AAAD8AAA==", "rew: data: has the shape 7 bytes"),
            ("P4AAAD8AAAA=", "P4AA!", "base64 can be read"),
            ("P4AAAD8AAAA=", "", "rew: data"),
            ("P4AAAD8AAAA=", "f8AAAA==", "rew: data"),
            ("{", "[", "an impulse response in JSON can be read"),
            ("}", "", "an impulse response in JSON can be read"),
        ] {
            assert!(good.contains(from), "{from}");
            let error = read(&good.replace(from, to)).unwrap_err();
            assert!(error.contains(words), "{to}: {error}");
        }
        assert!(read("").unwrap_err().contains("is `nothing`"));
        assert!(read("<html>").unwrap_err().contains("<html>"));
        let unitless = good.replace("\"unit\": \"percent\",", "");
        assert!(read(&unitless).unwrap().notes[0].contains("percent of full scale"));
    }

    #[test]
    fn addresses_name_one_measurement_or_none() {
        let base = "http://127.0.0.1:4735";
        for (rest, id) in [
            ("", None),
            ("/", None),
            ("/measurements", None),
            ("/measurements/3", Some("3")),
            ("/measurements/3/impulse-response", Some("3")),
            ("/measurements/71a0f-00c2/", Some("71a0f-00c2")),
        ] {
            assert_eq!(parts(&format!("{base}{rest}")).unwrap(), (base, id));
        }
        for bad in [
            "https://a/",
            "http://",
            "http://a b/",
            "http://u@h/",
            "http://h/x",
            "http://h/measurements/1?a",
            "ftp://h",
        ] {
            assert!(parts(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_list_may_hold_numbers_without_a_value() {
        let list = r#"{"10": {"title": "NaN \"Infinity", "x": NaN}, "2": {"title": "Seat 1", "y": -Infinity, "z": Infinity}}"#;
        assert_eq!(listed(list.as_bytes()).unwrap(), "2: Seat 1, 10: NaN \"Infinity");
        assert!(listed(b"{}").unwrap().contains("no measurement"));
        assert!(listed(b"[1").is_err());
    }
}
