//! Estimates reverberation time and equalisation from recordings of speech.
//!
//! `sabine estimate FILE... [--one-room] [--json F]`

use crate::channel::channel;
use crate::failure::Failure;
use clap::Args;
use sabine::acoustics::{AudioReader, Channel, RoomTargets, write_atomically};
use sabine::estimator::{Estimator, LABEL_COUNT, T60_COUNT, Warning, label_hz};
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;

/// Estimates reverberation time and equalisation from recordings of speech.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Recordings, 1 s or longer.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The recordings are of one place in one room, best each by another talker: say what they tell together, too.
    #[arg(long)]
    one_room: bool,
    /// Channel of files that have several, from 0, or `mean`; without it they must be mono
    #[arg(long, value_name = "N|mean", value_parser = channel)]
    channel: Option<Channel>,
    /// Write the numbers here as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Weights; those of the crate by default.
    #[arg(long)]
    weights: Option<PathBuf>,
}

/// Quantile of a normal distribution that leaves 5 % on either side.
const NORMAL_90: f64 = 1.645;

/// One recording in the JSON file, or all of one room; octaves rise from 125 Hz (T60) and from 62.5 Hz (EQ, without 1 kHz).
#[derive(Serialize)]
struct Entry {
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<PathBuf>,
    /// Files that are combined.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    combined: Vec<PathBuf>,
    t60_s: Vec<f64>,
    t60_sd_s: Vec<f64>,
    /// Ends of the 90 % intervals, log-normal.
    t60_low_s: Vec<f64>,
    t60_high_s: Vec<f64>,
    eq_db: Vec<f64>,
    eq_sd_db: Vec<f64>,
    warnings: Vec<String>,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let estimator = match &arguments.weights {
        Some(path) => Estimator::from_file(path)?,
        None => Estimator::pretrained()?,
    };
    let (mut entries, mut heard) = (Vec::new(), Vec::new());
    for file in &arguments.files {
        let name = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
        let channel = arguments.channel.unwrap_or_default();
        let estimate = match estimator.estimate_reader(&mut AudioReader::open(file, channel)?) {
            // It names the file already.
            Err(error @ sabine::estimator::Error::Acoustics(_)) => return Err(error.into()),
            other => other.map_err(|error| name(&error))?,
        };
        let entry = Entry { file: Some(file.clone()), ..entry(&estimate.targets, &estimate.warnings) };
        print(&file.display().to_string(), &entry);
        entries.push(entry);
        heard.push(estimate);
    }
    if arguments.one_room {
        let combined = arguments.files.clone();
        let entry = Entry { combined, ..entry(&estimator.combine(&heard)?, &[]) };
        print(&format!("{} recordings of one room", heard.len()), &entry);
        entries.push(entry);
    }
    if let Some(path) = &arguments.json {
        let text = serde_json::to_vec_pretty(&entries)?;
        write_atomically(path, |file| file.write_all(&text))?;
    }
    Ok(())
}

fn entry(targets: &RoomTargets, warnings: &[Warning]) -> Entry {
    let (t60, eq) = (targets.t60_s(), targets.eq_db());
    let levels = || eq.iter().filter(|(hz, _)| *hz != 1000.0);
    Entry {
        file: None,
        combined: Vec::new(),
        t60_s: t60.values().iter().map(|e| e.value).collect(),
        t60_sd_s: t60.values().iter().map(|e| e.standard_error).collect(),
        t60_low_s: t60.values().iter().map(|e| e.log_normal_interval(NORMAL_90).0).collect(),
        t60_high_s: t60.values().iter().map(|e| e.log_normal_interval(NORMAL_90).1).collect(),
        eq_db: levels().map(|(_, e)| e.value).collect(),
        eq_sd_db: levels().map(|(_, e)| e.standard_error).collect(),
        warnings: warnings.iter().map(ToString::to_string).collect(),
    }
}

fn print(title: &str, entry: &Entry) {
    println!("{title}");
    for label in 0..T60_COUNT {
        println!(
            "  {:>6} Hz  T60 {:.2} s, 90 % within {:.2} to {:.2} s",
            label_hz(label),
            entry.t60_s[label],
            entry.t60_low_s[label],
            entry.t60_high_s[label]
        );
    }
    for label in T60_COUNT..LABEL_COUNT {
        let eq = label - T60_COUNT;
        println!(
            "  {:>6} Hz  EQ {:+.1} dB, standard error {:.1}",
            label_hz(label),
            entry.eq_db[eq],
            entry.eq_sd_db[eq]
        );
    }
    for warning in &entry.warnings {
        println!("  warning: {warning}");
    }
}
