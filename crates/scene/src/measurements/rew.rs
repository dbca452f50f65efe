//! Impulse responses as the Room EQ Wizard exports them as text.
//!
//! The grammar is that of its "Export impulse response as text": remarks (`* ...`; without the star in old versions), values with
//! their names (`65536 // Response length`), `* Data start`, then a sample in each line. It follows the locale of the computer,
//! so that the point of a number may be a comma. Verified against exports that are public; the program's help describes the menu only.

use super::number;
use crate::error::Error;
use sabine_acoustics::{Error as ValueError, ImpulseResponse, OutOfRange, read_at_most};
use std::path::Path;

/// Largest file that is read (bytes).
const MAX_FILE_BYTES: u64 = 1 << 30;
/// How far the sample rate may be from a whole number, as a ratio: the interval is printed with 17 digits.
const RATE_TOLERANCE: f64 = 1e-6;
/// Most samples of silence that are put before a response for its start.
const MAX_START_S: f64 = 60.0;

/// A response, and where its first sample lies.
#[derive(Debug)]
pub(super) struct RewResponse {
    pub samples: ImpulseResponse,
    /// Time of the first sample in seconds; zero is the program's reference.
    pub start_s: f64,
    pub notes: Vec<String>,
}

/// What stands before the samples.
#[derive(Default)]
struct Head {
    interval_s: Option<f64>,
    start_s: f64,
    length: Option<usize>,
    peak: Option<f64>,
    normalised: bool,
    windowed: bool,
}

/// Reads a file.
pub(super) fn read(path: &Path) -> Result<RewResponse, Error> {
    of_bytes(path, &read_at_most(path, MAX_FILE_BYTES + 1)?)
}

/// Reads the bytes of a file; `path` is its name in messages.
pub(super) fn of_bytes(path: &Path, bytes: &[u8]) -> Result<RewResponse, Error> {
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let error = Error::TooManyValues { found: bytes.len() as u64, limit: MAX_FILE_BYTES };
        return Err(error.in_file(path, "bytes"));
    }
    parse(&String::from_utf8_lossy(bytes), path)
}

fn parse(text: &str, path: &Path) -> Result<RewResponse, Error> {
    let (mut head, mut samples) = (Head::default(), Vec::<f64>::new());
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = line.trim();
        let at = |error: Error| error.in_file(path, format!("line {}", index + 1));
        let remark = line.strip_prefix('*');
        // Old versions have no stars: before the samples a line of words is a remark.
        let words =
            samples.is_empty() && line.starts_with(|c: char| c.is_alphabetic()) && number(line).is_none();
        if line.is_empty() {
            continue;
        } else if let Some((value, label)) = line.split_once("//").filter(|_| samples.is_empty()) {
            head.value(value.trim(), label.trim()).map_err(at)?;
        } else if remark.is_some() || words {
            head.remark(remark.unwrap_or(line).trim()).map_err(at)?;
        } else {
            let found = || Error::TextLine { expected: "a sample", text: line.chars().take(60).collect() };
            let sample = number(line).ok_or_else(found).map_err(at)?;
            if !sample.is_finite() {
                return Err(at(
                    ValueError::NotFinite { what: "impulse response", index: samples.len() }.into()
                ));
            }
            samples.push(sample);
        }
    }
    head.finish(samples, path)
}

impl Head {
    fn value(&mut self, text: &str, label: &str) -> Result<(), Error> {
        let expected = || Error::TextLine { expected: "a number", text: text.chars().take(60).collect() };
        let value = number(text).filter(|value| value.is_finite()).ok_or_else(expected)?;
        match label.to_ascii_lowercase().as_str() {
            "sample interval (seconds)" => self.interval_s = Some(value),
            "start time (seconds)" => {
                OutOfRange::check("start time (s)", value, -MAX_START_S, MAX_START_S, "within 60 s")?;
                self.start_s = value;
            }
            "response length" => self.length = Some(value as usize),
            "peak value before normalisation" => self.peak = Some(value),
            // Peak index, data offset and what later versions add.
            _ => {}
        }
        Ok(())
    }

    fn remark(&mut self, text: &str) -> Result<(), Error> {
        match text.to_ascii_lowercase().as_str() {
            "ir is normalised" => self.normalised = true,
            "ir window has been applied" => self.windowed = true,
            "ir is the min phase version" => {
                let found = "the minimum phase version".into();
                return Err(Error::Unit { found, expected: "the response as it was measured" });
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(self, mut samples: Vec<f64>, path: &Path) -> Result<RewResponse, Error> {
        let interval_s =
            self.interval_s.ok_or_else(|| Error::Missing.in_file(path, "Sample interval (seconds)"))?;
        let rate_hz = (1.0 / interval_s).round();
        let near = (rate_hz * interval_s - 1.0).abs() < RATE_TOLERANCE;
        OutOfRange::check(
            "sample rate (Hz)",
            if near { rate_hz } else { 1.0 / interval_s },
            1e3,
            768e3,
            "a whole number from 1 kHz to 768 kHz",
        )
        .map_err(|error| Error::from(error).in_file(path, "Sample interval (seconds)"))?;
        if !near {
            let error =
                OutOfRange { field: "sample rate (Hz)", value: 1.0 / interval_s, range: "a whole number" };
            return Err(Error::from(error).in_file(path, "Sample interval (seconds)"));
        }
        if let Some(expected) = self.length.filter(|&length| length != samples.len()) {
            let error = ValueError::Length { expected, found: samples.len() };
            return Err(Error::from(error).in_file(path, "Response length"));
        }
        let mut notes = Vec::new();
        if self.normalised {
            let peak = self.peak.filter(|peak| *peak != 0.0);
            match peak {
                Some(peak) => samples.iter_mut().for_each(|sample| *sample *= peak.abs()),
                None => {
                    notes.push("the export is normalised and states no peak: its level is lost".to_owned())
                }
            }
        }
        if self.windowed {
            notes.push("a window was applied before the export: the late decay may be cut".to_owned());
        }
        let samples = ImpulseResponse::new(samples.into_iter().map(|x| x as f32).collect(), rate_hz as u32)
            .map_err(|error| Error::from(error).in_file(path, "samples"))?;
        Ok(RewResponse { samples, start_s: self.start_s, notes })
    }
}

impl RewResponse {
    /// The samples from time zero on: cut, or with silence before them.
    pub(super) fn starting_at_zero(self) -> Result<ImpulseResponse, Error> {
        let rate_hz = self.samples.sample_rate_hz();
        let shift = (self.start_s * f64::from(rate_hz)).round();
        let samples = self.samples.samples();
        let kept = if shift < 0.0 {
            samples[(-shift as usize).min(samples.len())..].to_vec()
        } else {
            let mut silence = vec![0.0; shift as usize];
            silence.extend(samples);
            silence
        };
        Ok(ImpulseResponse::new(kept, rate_hz)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn export(samples: &[f32], start: &str, comma: bool) -> String {
        let head = "* Impulse Response data saved by REW V5.40 Beta 132\r\n* IR is not normalised\r\n* IR window has not been applied\r\n* IR is not the min phase version\r\n* Dated: Jun 15, 2026, 2:47:02 PM\r\n* Excitation: 512k Log Swept Sine, 1 sweep at -10.0 dBFS using a loopback as a timing reference\r\n* Response measured over: 20.1 to 19,999.9 Hz\r\n";
        let mut numbers = format!(
            "0.0034054601565003395 // Peak value before normalisation\r\n1 // Peak index\r\n{} // Response length\r\n2.0833333333333333E-5 // Sample interval (seconds)\r\n{start} // Start time (seconds)\r\n",
            samples.len()
        );
        let mut data: String = samples.iter().map(|x| format!("{x:e}\r\n")).collect();
        if comma {
            (numbers, data) = (numbers.replace('.', ","), data.replace('.', ","));
        }
        format!("{head}{numbers}* Data start\r\n{data}")
    }

    fn read(text: &str) -> Result<RewResponse, String> {
        parse(text, Path::new("ir.txt")).map_err(|error| error.to_string())
    }

    #[test]
    fn an_export_is_read_to_the_bit_in_either_locale() {
        let samples: Vec<f32> = (0..500).map(|i| ((i * 37 % 101) as f32 - 50.0) / 3.0e5).collect();
        for comma in [false, true] {
            let found = read(&export(&samples, "-0.001", comma)).unwrap();
            assert_eq!(found.samples.samples(), samples);
            assert_eq!(found.samples.sample_rate_hz(), 48_000);
            assert!(found.notes.is_empty());
            // 48 samples lie before time zero.
            assert_eq!(found.starting_at_zero().unwrap().samples(), &samples[48..]);
        }
        let late = read(&export(&samples, "0.0005", false)).unwrap().starting_at_zero().unwrap();
        assert!(late.samples()[..24].iter().all(|&x| x == 0.0) && late.samples()[24..] == samples);
    }

    #[test]
    fn old_versions_have_no_stars() {
        let text = "Impulse Response data saved by REW V5.19\nIR is normalised\n2.0 // Peak value before normalisation\n2 // Response length\n2.2675736961451248E-5 // Sample interval (seconds)\n\n0.5\n-1.0\n";
        let found = read(text).unwrap();
        assert_eq!((found.samples.samples(), found.samples.sample_rate_hz()), (&[1.0, -2.0][..], 44_100));
    }

    #[test]
    fn each_fault_names_its_line_or_field() {
        let good = export(&[0.0, 1.0, 0.5, 0.25], "0.0", false);
        read(&good).unwrap();
        for (from, to, words) in [
            ("5e-1", "half", "ir.txt: line 16: cannot read `half` as a sample"),
            ("5e-1", "NaN", "ir.txt: line 16: impulse response: sample 2 is not finite"),
            ("5e-1", "1e99", "ir.txt: samples"),
            ("5e-1", "1.000,5", "line 16: cannot read `1.000,5`"),
            ("5e-1\r\n", "", "ir.txt: Response length: 3 values; there must be 4"),
            ("2.0833333333333333E-5", "0", "sample rate (Hz)"),
            ("2.0833333333333333E-5", "2.0830E-5", "a whole number"),
            ("2.0833333333333333E-5 //", "fast //", "line 11: cannot read `fast` as a number"),
            ("0.0 // Start", "1e9 // Start", "line 12: start time (s)"),
            ("not the min phase", "the min phase", "line 4: is `the minimum phase version`"),
            ("Sample interval (seconds)", "Something", "Sample interval (seconds): is missing"),
        ] {
            assert!(good.contains(from), "{from}");
            let error = read(&good.replace(from, to)).unwrap_err();
            assert!(error.contains(words), "{to}: {error}");
        }
        assert!(read("").unwrap_err().contains("is missing"));
        let windowed = good.replace("has not been applied", "has been applied");
        assert!(read(&windowed).unwrap().notes[0].contains("window"));
    }
}
