//! Tables of the estimator's errors on a data set, as Markdown; and of errors against the length of recordings.
//!
//! ```text
//! sabine evaluate --data DIR [--weights F] [--partition test]
//! sabine evaluate --data DIR --partition test --write DIR2 --speech DIR --rir DIR --noise DIR
//! sabine evaluate --recordings DIR2 [--weights F] [--calibrate F2]
//! ```
//!
//! The second form makes recordings of 30 s in the rooms of a part of the data set, with its speakers one after another and
//! its noise; the third one judges excerpts of 2 to 30 s of them, or writes the weights with the standard errors of long
//! recordings calibrated on them.

use crate::failure::Failure;
use crate::output::OutputFolder;
use clap::{Args, ValueEnum};
use sabine::acoustics::{
    Channel, ImpulseResponse, SampleFormat, Signal, encode_wav, read_audio, resample, write_atomically,
};
use sabine::augment::{
    Labels, Manifest, Partition as Dealt, ResponseCorpus, ResponseFilter, SyntheticRoomConfig, SyntheticRooms,
};
use sabine::eqfilter::convolve;
use sabine::estimator::{
    Dataset, Errors, Estimator, Evaluation, LABEL_COUNT, Partition, Recording, RecordingEvaluation, RoomMean,
    Selection, T60_COUNT, label_hz, label_name,
};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Lengths of the excerpts in seconds.
const LENGTHS_S: [f64; 5] = [2.0, 4.0, 8.0, 15.0, 30.0];
/// Those that the standard error of long recordings is calibrated on.
const LONG_S: [f64; 3] = [8.0, 15.0, 30.0];
/// Recordings in each measured room.
const PER_ROOM: usize = 8;
/// Simulated rooms beside the measured ones in validation.
const SIMULATED_ROOMS: usize = 120;
/// Name of the list of recordings in their folder.
const LIST: &str = "recordings.json";

/// Which part of the data set.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Part {
    /// Rooms that decided when to stop.
    Validation,
    /// Rooms that nothing was decided by.
    Test,
}

/// Prints tables of the estimator's errors.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder of the data set.
    #[arg(long, required_unless_present = "recordings")]
    data: Option<PathBuf>,
    /// Weights; those of the crate by default.
    #[arg(long)]
    weights: Option<PathBuf>,
    /// Which part of the data set.
    #[arg(long, value_enum, default_value = "test")]
    partition: Part,
    /// Folder of long recordings to judge.
    #[arg(long, conflicts_with = "data")]
    recordings: Option<PathBuf>,
    /// Write the weights here with the standard errors of long recordings calibrated on the recordings.
    #[arg(long, requires = "recordings")]
    calibrate: Option<PathBuf>,
    /// Write long recordings to this folder.
    #[arg(long, requires_all = ["data", "speech", "rir", "noise"])]
    write: Option<PathBuf>,
    /// Folder of speech that the data set was made of.
    #[arg(long)]
    speech: Option<PathBuf>,
    /// Folder of responses that the data set was made of. May be given several times.
    #[arg(long)]
    rir: Vec<PathBuf>,
    /// Folder of noise that the data set was made of.
    #[arg(long)]
    noise: Option<PathBuf>,
    /// Folders in which every file is a room of its own.
    #[arg(long, value_delimiter = ',')]
    rooms_by_file: Vec<String>,
}

/// One entry of the list of recordings; labels in the order of the estimator, null where missing.
#[derive(Serialize, Deserialize)]
struct Entry {
    file: String,
    room: String,
    response: String,
    snr_db: f64,
    t60_s: Vec<Option<f64>>,
    eq_db: Vec<Option<f64>>,
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
    if let Some(folder) = &arguments.recordings {
        return judge_recordings(arguments, &estimator, folder);
    }
    let Some(data) = &arguments.data else { return Err("--data is missing".into()) };
    if let (Some(out), Some(speech), Some(noise)) = (&arguments.write, &arguments.speech, &arguments.noise) {
        return write_recordings(arguments, data, speech, noise, out);
    }
    judge_clips(arguments, &estimator, data)
}

fn judge_clips(arguments: &Arguments, estimator: &Estimator, data: &Path) -> Result<(), Failure> {
    let dataset = Dataset::open(data)?;
    let partition = match arguments.partition {
        Part::Validation => Partition::Validation,
        Part::Test => Partition::Test,
    };
    let evaluation = Evaluation::new(estimator.model(), &dataset, partition)?;
    for (title, measured) in [("measured rooms", true), ("all rooms", false)] {
        let selection = Selection { measured, ..Selection::all(partition) };
        let rooms = evaluation.rooms(&selection);
        if rooms.is_empty() {
            continue;
        }
        println!("\n## {title}: {} rooms, {} clips\n", rooms.len(), rooms.values().sum::<usize>());
        if measured {
            for (room, clips) in &rooms {
                println!("- {room}: {clips} clips");
            }
            println!();
        }
        println!("| | model | constant | best constant | model - constant | bias | 90 % coverage | clips |");
        println!("|---|---|---|---|---|---|---|---|");
        for label in 0..LABEL_COUNT {
            let unit = if label < T60_COUNT { "s" } else { "dB" };
            row(&format!("{} ({unit})", label_name(label)), evaluation.label(label, &selection));
        }
        row("**T60, all octaves (s)**", evaluation.t60(&selection));
        row("**EQ, all octaves (dB)**", evaluation.eq(&selection));
        println!(
            "\n| selection | | model | constant | best constant | model - constant | bias | coverage | clips |"
        );
        println!("|---|---|---|---|---|---|---|---|---|");
        let levels = [[-30.0, 5.0], [5.0, 10.0], [10.0, 20.0], [20.0, 30.0], [30.0, f64::INFINITY]];
        for snr_db in levels {
            let name = format!("SNR {} to {} dB", snr_db[0], snr_db[1]);
            let part = Selection { snr_db, ..selection };
            row(&format!("{name} | T60 (s)"), evaluation.t60(&part));
            row(&format!("{name} | EQ (dB)"), evaluation.eq(&part));
        }
        for t60_s in [[0.0, 0.3], [0.3, 0.6], [0.6, 1.0], [1.0, 1.5], [0.0, 1.5], [1.5, 10.0]] {
            let part = Selection { t60_s, ..selection };
            row(&format!("T60 at 1 kHz {} to {} s | T60 (s)", t60_s[0], t60_s[1]), evaluation.t60(&part));
        }
    }
    Ok(())
}

fn judge_recordings(arguments: &Arguments, estimator: &Estimator, folder: &Path) -> Result<(), Failure> {
    let list = folder.join(LIST);
    let text = std::fs::read(&list).map_err(|error| format!("{}: {error}", list.display()))?;
    let entries: Vec<Entry> =
        serde_json::from_slice(&text).map_err(|error| format!("{}: {error}", list.display()))?;
    let mut recordings = Vec::new();
    for entry in entries {
        let values: Vec<f64> =
            entry.t60_s.iter().chain(&entry.eq_db).map(|v| v.unwrap_or(f64::NAN)).collect();
        let labels: [f64; LABEL_COUNT] = values
            .try_into()
            .map_err(|_| format!("{}: {} needs 7 `t60_s` and 6 `eq_db`", list.display(), entry.file))?;
        let speech = read_audio(folder.join(&entry.file), Channel::Mono)?;
        recordings.push(Recording { room: entry.room, speech, labels });
    }
    if let Some(path) = &arguments.calibrate {
        let model = estimator.calibrated(&recordings, &LONG_S)?;
        for (label, correlation) in model.calibration.window_correlation.iter().enumerate() {
            println!("{}: correlation of windows {correlation:.2}", label_name(label));
        }
        let bytes = model.to_safetensors(true)?;
        return Ok(write_atomically(path, |file| file.write_all(&bytes))?);
    }
    println!(
        "| length, windows | model | constant | best constant | model - constant | bias | 90 % coverage | excerpts |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for duration_s in LENGTHS_S {
        let evaluation = RecordingEvaluation::new(estimator, &recordings, duration_s)?;
        let name = format!("{duration_s} s, {:.1}", evaluation.windows());
        row(&format!("{name}: T60 (s)"), evaluation.t60());
        row(&format!("{name}: EQ (dB)"), evaluation.eq());
    }
    let longest = RecordingEvaluation::new(estimator, &recordings, LENGTHS_S[LENGTHS_S.len() - 1])?;
    for label in 0..LABEL_COUNT {
        row(&format!("{} s: {}", LENGTHS_S[LENGTHS_S.len() - 1], label_name(label)), longest.label(label));
    }
    Ok(())
}

/// Makes long recordings in the rooms of a part of a data set.
fn write_recordings(
    arguments: &Arguments,
    data: &Path,
    speech: &Path,
    noise: &Path,
    out: &Path,
) -> Result<(), Failure> {
    let manifest = Manifest::read(data)?;
    let rate_hz = manifest.sample_rate_hz;
    let wanted = match arguments.partition {
        Part::Validation => Dealt::Validation,
        Part::Test => Dealt::Test,
    };
    let files = |kind: &str| manifest.sources.get(kind).into_iter().flatten().map(|file| file.path.as_str());
    let read = |path: &Path| -> Result<Signal, Failure> {
        Ok(resample(&read_audio(path, Channel::Index(0))?, rate_hz)?)
    };
    // The speaker is the first part of the name of a file.
    let speaks = |path: &&str| {
        let name = path.rsplit('/').next().unwrap_or(path);
        manifest.speaker_partitions.get(name.split(['-', '_']).next().unwrap_or(name)) == Some(&wanted)
    };
    // All voices equally loud at their loudest.
    let level = |voice: Signal| {
        let gain = 1.0 / voice.peak().max(f32::MIN_POSITIVE);
        voice.samples().iter().map(|s| s * gain).collect::<Vec<f32>>()
    };
    let voices = files("speech")
        .filter(speaks)
        .map(|path| Ok(level(read(&speech.join(path))?)))
        .collect::<Result<Vec<_>, Failure>>()?;
    let tracks = files("noise")
        .filter(|path| manifest.noise_partitions.get(*path) == Some(&wanted))
        .map(|path| read(&noise.join(path)))
        .collect::<Result<Vec<_>, _>>()?;
    if voices.is_empty() || tracks.is_empty() {
        return Err("the data set names no speech or no noise of this part".into());
    }
    let mut out = OutputFolder::create(out)?;
    let mut entries = Vec::new();
    for (index, Place { room, name, response }) in
        responses(arguments, &manifest, wanted)?.into_iter().enumerate()
    {
        let labels = Labels::measure(&response)?;
        // Numbers that fill their range evenly: no two recordings are alike, and they are the same every time.
        let share = |ratio: f64| (index as f64 * ratio).fract();
        let snr_db = 40.0 * share(0.618_034);
        let track = tracks[index % tracks.len()].samples();
        let start = (share(0.754_878) * track.len() as f64) as usize;
        let samples = (LENGTHS_S[LENGTHS_S.len() - 1] * f64::from(rate_hz)) as usize;
        let turn = index * 7 % voices.len();
        let dry: Vec<f32> =
            voices[turn..].iter().chain(voices.iter().cycle()).flatten().copied().take(samples).collect();
        let mut wet = convolve(&dry, response.samples());
        wet.truncate(samples);
        let noise = || track[start..].iter().chain(track.iter().cycle()).take(samples);
        let power = |sum: f64, s: &f32| sum + f64::from(*s).powi(2);
        let ratio = wet.iter().fold(0.0, power) / noise().fold(1e-30, power);
        let gain = (ratio * 10f64.powf(-snr_db / 10.0)).sqrt() as f32;
        wet.iter_mut().zip(noise()).for_each(|(s, n)| *s += gain * n);
        let scale = 0.5 / wet.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
        wet.iter_mut().for_each(|s| *s *= scale);
        let file = format!("{index:04}.wav");
        out.write(&file, &encode_wav(&Signal::new(wet, rate_hz)?, SampleFormat::Int16)?)?;
        let t60_s = labels.t60_s().values().iter().map(|t| t.as_ref().ok().map(|t| t.value)).collect();
        let eq_db = (T60_COUNT..LABEL_COUNT)
            .map(|label| {
                labels.eq_db().at_hz(label_hz(label)).and_then(|level| Some(level.as_ref().ok()?.value))
            })
            .collect();
        entries.push(Entry { file, room, response: name, snr_db, t60_s, eq_db });
    }
    out.write(LIST, &serde_json::to_vec_pretty(&entries)?)?;
    out.finish()?;
    println!("{} recordings", entries.len());
    Ok(())
}

/// Where a recording is made.
struct Place {
    room: String,
    /// File and channel of the response, or its seed.
    name: String,
    response: ImpulseResponse,
}

/// Some responses of each measured room of the part, and for validation simulated rooms as well.
fn responses(arguments: &Arguments, manifest: &Manifest, wanted: Dealt) -> Result<Vec<Place>, Failure> {
    // Rooms of other parts are not even read.
    let others = manifest.room_partitions.iter().filter(|(_, part)| **part != wanted);
    let filter = ResponseFilter {
        excluded_rooms: others.map(|(room, _)| room.clone()).collect(),
        ..ResponseFilter::default()
    };
    let mut chosen = Vec::new();
    for folder in &arguments.rir {
        let read =
            ResponseCorpus::read(folder, manifest.sample_rate_hz, &filter, &arguments.rooms_by_file, &());
        let corpus = match read {
            Err(sabine::augment::Error::TooFew { .. }) => continue,
            corpus => corpus?,
        };
        for room in corpus.rooms() {
            if manifest.room_partitions.get(&room) != Some(&wanted) {
                continue;
            }
            let of_room: Vec<_> = corpus.responses().iter().filter(|r| r.room == room).collect();
            for k in 0..PER_ROOM {
                let response = of_room[k * of_room.len() / PER_ROOM];
                let (name, response) = (response.path.clone(), response.response.clone());
                chosen.push(Place { room: room.clone(), name, response });
            }
        }
    }
    if wanted == Dealt::Validation {
        let config =
            SyntheticRoomConfig { sample_rate_hz: manifest.sample_rate_hz, ..SyntheticRoomConfig::default() };
        let rooms = SyntheticRooms::new(config)?;
        // Seeds that the data set has not used: it derives its own from a hash.
        for seed in 0..SIMULATED_ROOMS as u64 {
            let name = format!("simulated/{seed}");
            chosen.push(Place { room: name.clone(), name, response: rooms.draw(seed)? });
        }
    }
    Ok(chosen)
}

fn row(name: &str, errors: Option<Errors>) {
    let Some(e) = errors else { return };
    let interval = |m: RoomMean| format!("{:.3} [{:.3}, {:.3}]", m.value, m.low, m.high);
    println!(
        "| {name} | {} | {} | {:.3} | {} | {:+.3} | {:.0} % | {} |",
        interval(e.model),
        interval(e.constant),
        e.best_constant.value,
        interval(e.gain),
        e.bias.value,
        100.0 * e.coverage_90,
        e.clips
    );
}
