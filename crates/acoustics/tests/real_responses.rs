//! Real measured responses: every one is read, or says why not.
//!
//! The data are not part of the project: without them these tests pass with a message.
//! `cargo test -p sabine-acoustics --test real_responses -- --nocapture` prints the tables of
//! `docs/validation/measures.md`.

use sabine_acoustics::{
    BandParameters, ImpulseResponse, NoReading, OctaveBands, Reading, RoomParameters, ThirdOctaveBands,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn data() -> Option<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    if folder.join("rir").is_dir() {
        return Some(folder.to_path_buf());
    }
    eprintln!("skipped: {} is absent", folder.display());
    None
}

fn first_channel(path: &Path) -> ImpulseResponse {
    let mut reader = hound::WavReader::open(path).unwrap();
    let spec = reader.spec();
    let channels = usize::from(spec.channels);
    let samples: Vec<f32> = match spec.sample_format {
        hound::SampleFormat::Float => reader.samples::<f32>().step_by(channels).map(Result::unwrap).collect(),
        hound::SampleFormat::Int => {
            let full_scale = (1i64 << (spec.bits_per_sample - 1)) as f32;
            reader.samples::<i32>().step_by(channels).map(|x| x.unwrap() as f32 / full_scale).collect()
        }
    };
    ImpulseResponse::new(samples, spec.sample_rate).unwrap()
}

fn wav_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            wav_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "wav") {
            found.push(path);
        }
    }
    found.sort();
}

fn reason(reading: &Reading) -> &'static str {
    match reading {
        Ok(_) => "read",
        Err(NoReading::DynamicRange { .. }) => "range",
        Err(NoReading::NoOnset) => "no onset",
        Err(NoReading::AboveNyquist { .. }) => "Nyquist",
        Err(NoReading::TooShort { .. }) => "short",
        Err(NoReading::FilterRinging { .. }) => "ringing",
        Err(NoReading::NoDecay) => "no decay",
        Err(_) => "other",
    }
}

#[test]
fn every_real_response_is_read_or_says_why_not() {
    let Some(data) = data() else { return };
    let mut files = Vec::new();
    wav_files(&data.join("rir"), &mut files);
    wav_files(&data.join("rooms"), &mut files);
    assert!(!files.is_empty());
    let bands = OctaveBands::SIMULATION;
    // For each folder and band: how often T60 was read, and each reason why not; the values that were.
    let mut counts: BTreeMap<String, Vec<BTreeMap<&'static str, usize>>> = BTreeMap::new();
    let mut values: BTreeMap<String, Vec<Vec<f64>>> = BTreeMap::new();
    for path in &files {
        let response = first_channel(path);
        let room = RoomParameters::measure(&response, bands).unwrap();
        let folder = path.strip_prefix(&data).unwrap().components().nth(1).unwrap();
        let folder = folder.as_os_str().to_string_lossy().into_owned();
        let count = counts.entry(folder.clone()).or_insert_with(|| vec![BTreeMap::new(); bands.len()]);
        let value = values.entry(folder).or_insert_with(|| vec![Vec::new(); bands.len()]);
        let mut row = String::new();
        for (i, reading) in room.t60_s.values().iter().enumerate() {
            *count[i].entry(reason(reading)).or_default() += 1;
            match reading {
                Ok(t60) => {
                    value[i].push(t60.value);
                    assert!(t60.value > 0.02 && t60.value < 30.0, "{}: {t60:?}", path.display());
                    assert!(t60.standard_error > 0.0 && t60.standard_error.is_finite());
                    let slopes = room.fits.values()[i].as_ref().unwrap().slopes().len();
                    row += &format!(
                        " {:.3}±{:.3}{}",
                        t60.value,
                        t60.standard_error,
                        ["", "", "''", "'''"][slopes]
                    );
                }
                Err(why) => row += &format!(" ({})", reason(&Err(why.clone()))),
            }
        }
        let full = BandParameters::full_band(&response);
        println!(
            "{}: full band {}{row}",
            path.strip_prefix(&data).unwrap().display(),
            full.t60_s.as_ref().map_or_else(|e| e.to_string(), |t| format!("{:.3}", t.value))
        );
        // T20 and the fit look at the same decay: where both are sure of themselves they agree.
        for (t20, t60) in room.t20_s.values().iter().zip(room.t60_s.values()) {
            if let (Ok(t20), Ok(t60)) = (t20, t60) {
                let (difference, error) = (t20.value / t60.value - 1.0, t20.standard_error / t20.value);
                if difference.abs() > 0.3 + 4.0 * error {
                    println!("   T20 {:.3} but T60 {:.3}", t20.value, t60.value);
                }
            }
        }
    }
    println!(
        "\n| responses | n | 62.5 | 125 | 250 | 500 | 1k | 2k | 4k | 8k |\n|---|---|---|---|---|---|---|---|---|---|"
    );
    for (folder, count) in &counts {
        let n: usize = count[0].values().sum();
        let mut row = format!("| {folder} | {n} |");
        for (i, reasons) in count.iter().enumerate() {
            let v = &mut values.get_mut(folder).unwrap()[i];
            v.sort_by(f64::total_cmp);
            let mut cell = v.get(v.len() / 2).map_or_else(String::new, |median| format!("{median:.2} s"));
            for (why, how_often) in reasons.iter().filter(|(why, _)| **why != "read") {
                cell += &format!(" {how_often} {why}");
            }
            row += &format!(" {} |", cell.trim());
        }
        println!("{row}");
    }
}

/// BRAS CR2: the published figures are means over positions; we have one position. In third octaves from 500 Hz on, where
/// the room is far above its Schroeder frequency, one position tells the mean.
#[test]
fn bras_cr2_agrees_with_its_published_room_means() {
    let Some(data) = data() else { return };
    let folder = data.join("rooms/bras_cr2");
    let table = std::fs::read_to_string(folder.join("measured_parameters.csv")).unwrap();
    println!("{}", table.lines().take(3).collect::<Vec<_>>().join("\n"));
    let response = first_channel(&folder.join("ir/LS1_MP1.wav"));
    let bands = ThirdOctaveBands::new(25.0, 10000.0).unwrap();
    for (i, band) in BandParameters::third_octaves(&response, bands).iter().enumerate() {
        let show = |r: &Reading| {
            r.as_ref().map_or_else(|e| e.to_string(), |t| format!("{:.3}±{:.3}", t.value, t.standard_error))
        };
        println!(
            "{} T20 {} T30 {} T60 {} EDT {} C80 {} D50 {}",
            bands.nominal_hz(i),
            show(&band.t20_s),
            show(&band.t30_s),
            show(&band.t60_s),
            show(&band.edt_s),
            show(&band.c80_db),
            show(&band.d50)
        );
    }
}
