//! Measures impulse responses: room-acoustic parameters per octave, with the reason where there is no answer.

mod listener;
mod sheet;

use crate::channel::channel;
use crate::chart::{Chart, Look, Scale, Series, chart_sheet};
use crate::failure::Failure;
use crate::output::OutputFolder;
use clap::Args;
use sabine::acoustics::{
    BandParameters, Bands, Channel, DecayFit, FilterBank, ImpulseResponse, LocatedResponse, NoReading,
    PerBand, Reading, RoomParameters, equalisation, read_response, write_atomically,
};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Points in a plotted decay.
const PLOT_POINTS: usize = 300;

/// Read EDT, T20, T30, T60, C50, C80, D50 and DRR from impulse responses, octave by octave; with more channels and references
/// sound strength, lateral energy, interaural correlation and the speech transmission index.
#[derive(Args)]
pub struct Arguments {
    /// Impulse responses (WAV)
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Channel of files that have several, from 0, or `mean`; without it they must be mono
    #[arg(long, value_name = "N|mean", value_parser = channel)]
    channel: Option<Channel>,
    /// Lowest band in Hz [default: 62.5, or 50 in third octaves]
    #[arg(long, value_name = "HZ")]
    from: Option<f64>,
    /// Highest band in Hz [default: 8000, or 10000 in third octaves]
    #[arg(long, value_name = "HZ")]
    to: Option<f64>,
    /// Third octaves in place of octaves
    #[arg(long)]
    third_octaves: bool,
    /// Write all results as JSON
    #[arg(long, value_name = "F.json")]
    json: Option<PathBuf>,
    /// Folder for plots of the decays, an SVG for each file
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    #[command(flatten)]
    sheet: sheet::SheetArguments,
    #[command(flatten)]
    listener: listener::ListenerArguments,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let bands = if arguments.third_octaves {
        Bands::third_octaves(arguments.from.unwrap_or(50.0), arguments.to.unwrap_or(10_000.0))?
    } else {
        Bands::octaves(arguments.from.unwrap_or(62.5), arguments.to.unwrap_or(8000.0))?
    };
    arguments.listener.check(arguments.files.len())?;
    arguments.sheet.check()?;
    let channel = arguments.listener.channel().or(arguments.channel).unwrap_or_default();
    let (mut results, mut plots, mut rooms) = (Vec::new(), Vec::new(), Vec::new());
    for path in &arguments.files {
        let found = read_response(path, channel)?;
        let response = &found.response;
        let start = Instant::now();
        let room = RoomParameters::measure(response, bands)?;
        let octaves_seconds = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let whole = BandParameters::full_band(response);
        let whole_seconds = start.elapsed().as_secs_f64();
        let eq_db = equalisation(response, bands)?;
        let listener = arguments.listener.read(path, &found, bands)?;
        print!("{}", table(path, &room, &whole));
        println!(
            "eq_db re 1k   {}",
            eq_db.values().iter().map(|e| format!("{:>9}", cell(e))).collect::<String>()
        );
        print!("{}", listener.lines(&room));
        let notes = notes(&found);
        for note in &notes {
            println!("note: {note}");
        }
        let mut result = as_json(path, &room, &whole);
        result["start_s"] = json!(found.start_s);
        result["notes"] = json!(notes);
        result["eq_db"] = eq_db.values().iter().map(|e| e.as_ref().ok().map(|e| e.value)).collect();
        result["seconds"] = json!({ "octaves": octaves_seconds, "full_band": whole_seconds });
        listener.add_to(&mut result, &room);
        results.push(result);
        if arguments.plots.is_some() {
            plots.push((plot_name(path, plots.len()), plot(response, &room)?));
        }
        rooms.push(room);
    }
    if rooms.len() > 1 {
        print!("{}", listener::spatial_means(&rooms)?);
    }
    if let Some(folder) = &arguments.plots {
        let mut out = OutputFolder::create(folder)?;
        for (name, svg) in &plots {
            out.write(name, svg.as_bytes())?;
        }
        out.finish()?;
    }
    if let Some(path) = &arguments.sheet.sheet {
        let page = arguments.sheet.html(&arguments.files, &rooms)?;
        write_atomically(path, |file| file.write_all(page.as_bytes()))?;
    }
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&results)?;
        write_atomically(path, |file| writeln!(file, "{text}"))?;
    }
    Ok(())
}

/// What should be known of how the response was found in its file.
fn notes(found: &LocatedResponse) -> Vec<String> {
    let mut notes = Vec::new();
    let measured_s = found.response.duration_s();
    if measured_s < found.file_duration_s {
        notes.push(format!(
            "{measured_s:.1} s from {:.1} s on were measured, of {:.1} s",
            found.start_s, found.file_duration_s
        ));
    }
    if found.bursts_s.len() > 1 {
        let times: Vec<String> = found.bursts_s.iter().map(|time| format!("{time:.2} s")).collect();
        notes.push(format!(
            "sound sets in {} times (at {}): a strong echo, or several responses in one file, which must be cut apart",
            times.len(),
            times.join(", ")
        ));
    }
    notes
}

/// The quantities that are read per band, by name.
fn quantities(room: &RoomParameters) -> [(&'static str, &PerBand<Reading>); 9] {
    [
        ("edt_s", &room.edt_s),
        ("t20_s", &room.t20_s),
        ("t30_s", &room.t30_s),
        ("t60_s", &room.t60_s),
        ("c50_db", &room.c50_db),
        ("c80_db", &room.c80_db),
        ("d50", &room.d50),
        ("centre_time_s", &room.centre_time_s),
        ("drr_db", &room.drr_db),
    ]
}

/// A table for the terminal; a dash stands for what cannot be read, the reasons follow below it.
fn table(path: &Path, room: &RoomParameters, whole: &BandParameters) -> String {
    let mut text = format!("{}\n{:<14}", path.display(), "");
    for hz in room.bands().iter_hz() {
        let _ =
            write!(text, "{:>9}", if hz < 1000.0 { format!("{hz}") } else { format!("{}k", hz / 1000.0) });
    }
    text.push_str("     full\n");
    let mut reasons: Vec<(String, Vec<String>)> = Vec::new();
    let mut note = |reason: &NoReading, at: String| {
        let reason = reason.to_string();
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, places)) => places.push(at),
            None => reasons.push((reason, vec![at])),
        }
    };
    for ((name, per_band), whole) in quantities(room).into_iter().zip(whole_readings(whole)) {
        let _ = write!(text, "{name:<14}");
        for (hz, reading) in per_band.iter() {
            if let Err(reason) = reading {
                note(reason, format!("{name} {hz}"));
            }
            let _ = write!(text, "{:>9}", cell(reading));
        }
        let _ = writeln!(text, "{:>9}", cell(whole));
    }
    let _ = write!(text, "{:<14}", "slopes");
    for fit in room.fits.values().iter().chain([&whole.fit]) {
        let slopes = fit.as_ref().map_or_else(|_| "-".to_owned(), |fit| fit.slopes().len().to_string());
        let _ = write!(text, "{slopes:>9}");
    }
    text.push('\n');
    for (reason, places) in reasons {
        let _ = writeln!(text, "  - {reason}: {}", places.join(", "));
    }
    text.push('\n');
    text
}

fn whole_readings(whole: &BandParameters) -> [&Reading; 9] {
    [
        &whole.edt_s,
        &whole.t20_s,
        &whole.t30_s,
        &whole.t60_s,
        &whole.c50_db,
        &whole.c80_db,
        &whole.d50,
        &whole.centre_time_s,
        &whole.drr_db,
    ]
}

fn cell(reading: &Reading) -> String {
    reading.as_ref().map_or_else(|_| "-".to_owned(), |estimate| format!("{:.3}", estimate.value))
}

/// The value in each band, null where there is none.
fn as_values(readings: &PerBand<Reading>) -> Value {
    readings.values().iter().map(|reading| reading.as_ref().map_or(Value::Null, |e| json!(e.value))).collect()
}

fn as_json(path: &Path, room: &RoomParameters, whole: &BandParameters) -> Value {
    let value = |reading: &Reading| reading.as_ref().map_or(Value::Null, |e| json!(e.value));
    let deviation = |reading: &Reading| reading.as_ref().map_or(Value::Null, |e| json!(e.standard_error));
    let mut result = json!({ "file": path.display().to_string() });
    result["bands_hz"] = room.bands().iter_hz().collect();
    let mut reasons = vec![serde_json::Map::new(); room.bands().len()];
    for (name, per_band) in quantities(room) {
        result[name] = as_values(per_band);
        if name == "t60_s" {
            result["t60_sd_s"] = per_band.values().iter().map(deviation).collect();
        }
        for (reasons, reading) in reasons.iter_mut().zip(per_band.values()) {
            if let Err(reason) = reading {
                reasons.insert(name.to_owned(), json!(reason.to_string()));
            }
        }
    }
    result["slopes"] = room.fits.values().iter().map(|fit| slopes(fit.as_ref().ok())).collect();
    result["reasons"] = reasons.into_iter().map(Value::Object).collect();
    let mut all = serde_json::Map::new();
    let mut all_reasons = serde_json::Map::new();
    for ((name, _), reading) in quantities(room).into_iter().zip(whole_readings(whole)) {
        all.insert(name.to_owned(), value(reading));
        if let Err(reason) = reading {
            all_reasons.insert(name.to_owned(), json!(reason.to_string()));
        }
    }
    all.insert("t60_sd_s".to_owned(), deviation(&whole.t60_s));
    all.insert("slopes".to_owned(), slopes(whole.fit.as_ref().ok()));
    all.insert("reasons".to_owned(), Value::Object(all_reasons));
    result["full_band"] = Value::Object(all);
    result["onset_s"] = room.onset.as_ref().map_or(Value::Null, |onset| json!(onset.time_s));
    result
}

fn slopes(fit: Option<&DecayFit>) -> Value {
    fit.map_or(Value::Null, |fit| {
        fit.slopes()
            .iter()
            .map(|slope| {
                json!({
                    "t60_s": slope.t60_s.value,
                    "t60_sd_s": slope.t60_s.standard_error,
                    "level_db": slope.level_db.value,
                })
            })
            .collect()
    })
}

/// Files of the same name in different folders get different plots.
fn plot_name(path: &Path, index: usize) -> String {
    let stem = path.file_stem().map_or_else(|| "response".into(), |stem| stem.to_string_lossy());
    format!("{:03}_{stem}.svg", index + 1)
}

/// The level of each band over time, with the decay and the noise that were fitted.
fn plot(response: &ImpulseResponse, room: &RoomParameters) -> Result<String, Failure> {
    let rate = f64::from(response.sample_rate_hz());
    let bank = FilterBank::new(room.bands(), response.sample_rate_hz())?;
    let bands = bank.analyse(response.samples());
    let block = (response.samples().len() / PLOT_POINTS).max(1);
    let mut charts = Vec::new();
    for (i, (hz, samples)) in bands.iter().enumerate() {
        let measured: Vec<(f64, f64)> = samples
            .chunks(block)
            .enumerate()
            .map(|(k, chunk)| {
                let power = chunk.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / chunk.len() as f64;
                ((k as f64 + 0.5) * block as f64 / rate, 10.0 * power.log10())
            })
            .collect();
        let loudest = measured.iter().fold(f64::NEG_INFINITY, |most, point| most.max(point.1));
        let relative =
            |points: Vec<(f64, f64)>| points.into_iter().map(|(t, db)| (t, db - loudest)).collect();
        let mut series = vec![Series::new("measured", Look::Line, 5, relative(measured))];
        if let Ok(fit) = &room.fits.values()[i] {
            let times = (0..PLOT_POINTS).map(|k| {
                fit.start_s() + (response.duration_s() - fit.start_s()) * k as f64 / (PLOT_POINTS - 1) as f64
            });
            let fitted =
                times.map(|t| (t, 10.0 * (fit.decay_power_at(t) + fit.noise_power()).log10())).collect();
            series.push(Series::new("decay plus noise, fitted", Look::Dashed, 1, relative(fitted)));
        }
        let chart = Chart {
            x_label: "Time (s)".to_owned(),
            y_label: "Level (dB)".to_owned(),
            x: Scale::Linear(0.0, response.duration_s()),
            y: Some((-100.0, 5.0)),
            series,
            small: false,
        };
        let title = match &room.t60_s.values()[i] {
            Ok(t60) => format!("{hz} Hz: T60 {:.3} ± {:.3} s", t60.value, t60.standard_error),
            Err(reason) => format!("{hz} Hz: {reason}"),
        };
        charts.push((title, chart));
    }
    chart_sheet(&charts)
}
