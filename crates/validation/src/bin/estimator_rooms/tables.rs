//! Tables of errors and of warnings, every figure the mean over rooms of the mean over a room's recordings.

use crate::error::Error;
use crate::record::{DEFECTS, LONG_S, PLAIN, Record, SHORT_S};
use crate::rooms::Use;
use sabine::acoustics::{Bands, Estimate, PerBand, RoomTargets};
use sabine::estimator::{DetailedEstimate, Estimator, LABEL_COUNT, T60_COUNT, Warning, label_hz};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Normal quantile of a 90 % interval.
const QUANTILE_90: f64 = 1.645;
/// Reverberation time to which rooms are ordinary, and from which they are beyond the training, in seconds.
const RANGES_S: [(&str, f64, f64); 3] =
    [("to 1.5 s", 0.0, 1.5), ("1.5 to 2.5 s", 1.5, 2.5), ("above 2.5 s", 2.5, 99.0)];

/// How recordings become an answer.
#[derive(Clone, Copy)]
enum Method {
    Each,
    EachCombined,
    Mean,
    Combined,
}

/// Absolute error and whether it lies in the 90 % interval, label by label, of one answer; none where the label is missing.
type Judged = [Option<(f64, bool)>; LABEL_COUNT];

/// Errors of all ways to join recordings.
///
/// # Errors
/// What joining refuses.
pub fn errors(estimator: &Estimator, records: &[Record]) -> Result<String, Error> {
    let mut text = String::from(
        "| rooms, T60 | recordings | answer | T60 (s) | its 90 % interval holds | EQ (dB) | holds | 62.5 | 125 | 250 | 500 | 2000 | 4000 Hz |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (range, low_s, high_s) in RANGES_S {
        let chosen: Vec<&Record> = records
            .iter()
            .filter(|r| r.condition == PLAIN && (low_s..high_s).contains(&r.middle_t60_s))
            .collect();
        let rooms = chosen.iter().map(|r| &r.room).collect::<BTreeSet<_>>().len();
        for duration_s in [SHORT_S, LONG_S] {
            for (many, name, method) in [
                (false, "the network's (before)", Method::Each),
                (false, "prior applied once", Method::EachCombined),
                (true, "mean of five (before)", Method::Mean),
                (true, "`combine`", Method::Combined),
            ] {
                let judged = judge(estimator, &chosen, duration_s, method)?;
                if judged.is_empty() {
                    continue;
                }
                let count = if many { "five talkers" } else { "one" };
                write!(text, "| {rooms}, {range} | {count}, {duration_s} s | {name} |").ok();
                for labels in [0..T60_COUNT, T60_COUNT..LABEL_COUNT] {
                    let (error, held) = mean(&judged, labels.clone());
                    let digits = if labels.start == 0 { 3 } else { 2 };
                    write!(text, " {error:.digits$} | {:.0} % |", 100.0 * held).ok();
                }
                for label in T60_COUNT..LABEL_COUNT {
                    write!(text, " {:.2} |", mean(&judged, label..label + 1).0).ok();
                }
                text.push('\n');
            }
        }
    }
    Ok(text)
}

/// T60 by octave and room of five talkers.
///
/// # Errors
/// What joining refuses.
pub fn t60_by_room(estimator: &Estimator, records: &[Record]) -> Result<String, Error> {
    let mut text = String::from("| room | T60 at 1 kHz (s) |");
    (0..T60_COUNT).for_each(|label| write!(text, " {} Hz |", label_hz(label)).unwrap_or(()));
    text.push_str(" EQ (dB) |\n|---|---|---|---|---|---|---|---|---|---|\n");
    for (name, places) in
        places(&records.iter().filter(|r| r.used != Use::SimulatedTest).collect::<Vec<_>>(), SHORT_S)
    {
        let (mut errors, mut judged) = (vec![Vec::new(); T60_COUNT], Vec::new());
        let mut truth = Vec::new();
        for recordings in places.values() {
            let answer =
                estimator.combine(&recordings.iter().map(|r| r.estimate.clone()).collect::<Vec<_>>())?;
            truth.push(recordings[0].middle_t60_s);
            for (label, errors) in errors.iter_mut().enumerate() {
                errors.push(answer.t60_s().values()[label].value - recordings[0].labels[label]);
            }
            judged.push(compare(&answer, &recordings[0].labels));
        }
        write!(text, "| {name} | {:.2} |", truth.iter().sum::<f64>() / truth.len() as f64).ok();
        for errors in errors {
            let known: Vec<f64> = errors.into_iter().filter(|e| !e.is_nan()).collect();
            let value = known.iter().sum::<f64>() / known.len() as f64;
            if known.is_empty() {
                write!(text, " - |").ok()
            } else {
                write!(text, " {value:+.2} |").ok()
            };
        }
        let eq = mean(&BTreeMap::from([(name, judged)]), T60_COUNT..LABEL_COUNT).0;
        writeln!(text, " {eq:.2} |").ok();
    }
    Ok(text)
}

type Places<'a> = BTreeMap<usize, Vec<&'a Record>>;

/// Recordings of one length by room and place.
fn places<'a>(records: &[&'a Record], duration_s: f64) -> BTreeMap<&'a str, Places<'a>> {
    let mut rooms: BTreeMap<&str, Places<'_>> = BTreeMap::new();
    for record in records.iter().filter(|r| r.condition == PLAIN && (r.duration_s - duration_s).abs() < 0.01)
    {
        rooms.entry(&record.room).or_default().entry(record.response).or_default().push(record);
    }
    rooms
}

fn judge<'a>(
    estimator: &Estimator,
    records: &[&'a Record],
    duration_s: f64,
    method: Method,
) -> Result<BTreeMap<&'a str, Vec<Judged>>, Error> {
    let mut rooms = BTreeMap::new();
    for (name, places) in places(records, duration_s) {
        let mut judged = Vec::new();
        for recordings in places.values() {
            let labels = &recordings[0].labels;
            let all: Vec<DetailedEstimate> = recordings.iter().map(|r| r.estimate.clone()).collect();
            match method {
                Method::Each => judged.extend(all.iter().map(|one| compare(&one.targets, labels))),
                Method::EachCombined => {
                    for one in all {
                        judged.push(compare(&estimator.combine(&[one])?, labels));
                    }
                }
                Method::Mean => judged.push(compare(&mean_of(&all)?, labels)),
                Method::Combined => judged.push(compare(&estimator.combine(&all)?, labels)),
            }
        }
        rooms.insert(name, judged);
    }
    Ok(rooms)
}

/// The mean, geometric of reverberation times, with the mean of the standard errors: what a user could do before.
fn mean_of(all: &[DetailedEstimate]) -> Result<RoomTargets, Error> {
    let n = all.len() as f64;
    let over = |of: &dyn Fn(&DetailedEstimate) -> Estimate, is_log: bool| {
        let values = all.iter().map(|e| if is_log { of(e).value.ln() } else { of(e).value });
        let mean = values.sum::<f64>() / n;
        let value = if is_log { mean.exp() } else { mean };
        Estimate::new(value, all.iter().map(|e| of(e).standard_error).sum::<f64>() / n)
    };
    let t60_s = PerBand::from_fn(Bands::T60, |band| over(&|e| e.targets.t60_s().values()[band], true));
    let eq_db = PerBand::from_fn(Bands::EQ, |band| over(&|e| e.targets.eq_db().values()[band], false));
    Ok(RoomTargets::new(t60_s, eq_db)?)
}

fn compare(answer: &RoomTargets, labels: &[f64; LABEL_COUNT]) -> Judged {
    std::array::from_fn(|label| {
        let truth = labels[label];
        let readings = if label < T60_COUNT { answer.t60_s() } else { answer.eq_db() };
        let found = readings.at_hz(label_hz(label)).filter(|_| !truth.is_nan())?;
        let (low, high) = if label < T60_COUNT {
            found.log_normal_interval(QUANTILE_90)
        } else {
            found.interval(QUANTILE_90)
        };
        Some(((found.value - truth).abs(), (low..=high).contains(&truth)))
    })
}

/// Mean error and share within the interval: over recordings, then rooms, then labels.
fn mean(rooms: &BTreeMap<&str, Vec<Judged>>, labels: std::ops::Range<usize>) -> (f64, f64) {
    let (mut error, mut held, mut count) = (0.0, 0.0, 0.0);
    for label in labels {
        let of_rooms: Vec<(f64, f64)> = rooms
            .values()
            .filter_map(|judged| {
                let known: Vec<(f64, bool)> = judged.iter().filter_map(|j| j[label]).collect();
                let n = known.len() as f64;
                let share = known.iter().filter(|k| k.1).count() as f64 / n;
                (n > 0.0).then(|| (known.iter().map(|k| k.0).sum::<f64>() / n, share))
            })
            .collect();
        if !of_rooms.is_empty() {
            let n = of_rooms.len() as f64;
            error += of_rooms.iter().map(|r| r.0).sum::<f64>() / n;
            held += of_rooms.iter().map(|r| r.1).sum::<f64>() / n;
            count += 1.0;
        }
    }
    (error / count, held / count)
}

/// A column of the table of warnings.
type Column = (&'static str, fn(&Warning) -> bool);

const COLUMNS: [Column; 9] = [
    ("noise alone", |w| matches!(w, Warning::NoiseAlone)),
    ("music", |w| matches!(w, Warning::Music)),
    ("band-limited", |w| matches!(w, Warning::BandLimited)),
    ("several talkers", |w| matches!(w, Warning::SeveralTalkers)),
    ("long decay", |w| matches!(w, Warning::LongDecay { .. })),
    ("no room", |w| matches!(w, Warning::Dry)),
    ("clipped", |w| matches!(w, Warning::Clipped { .. })),
    ("before: `Unfamiliar`", |w| matches!(w, Warning::Unfamiliar { .. })),
    ("before: `EdgeOfRange`", |w| matches!(w, Warning::EdgeOfRange { .. })),
];

/// Shares of the recordings in which each warning is given.
pub fn warnings(records: &[Record]) -> String {
    let mut text = String::from("| what | rooms | recordings |");
    COLUMNS.iter().for_each(|(name, _)| write!(text, " {name} |").unwrap_or(()));
    text.push_str("\n|---|---|---|");
    text.push_str(&"---|".repeat(COLUMNS.len()));
    text.push('\n');
    let mut row = |name: &str, chosen: &[&Record]| {
        let mut rooms: BTreeMap<&str, Vec<&Record>> = BTreeMap::new();
        chosen.iter().for_each(|r| rooms.entry(&r.room).or_default().push(r));
        if rooms.is_empty() {
            return;
        }
        write!(text, "| {name} | {} | {} |", rooms.len(), chosen.len()).ok();
        for (_, is) in COLUMNS {
            let of_room = |all: &Vec<&Record>| {
                all.iter().filter(|r| r.estimate.warnings.iter().any(is)).count() as f64 / all.len() as f64
            };
            let share = rooms.values().map(of_room).sum::<f64>() / rooms.len() as f64;
            write!(text, " {:.1} % |", 100.0 * share).ok();
        }
        text.push('\n');
    };
    for (kind, simulated) in [("measured", false), ("simulated", true)] {
        let of_kind = |r: &&Record| (r.used == Use::SimulatedTest) == simulated;
        let plain = |low_s: f64, high_s: f64| -> Vec<&Record> {
            let within = |r: &&Record| r.condition == PLAIN && (low_s..high_s).contains(&r.middle_t60_s);
            records.iter().filter(of_kind).filter(within).collect()
        };
        for (low_s, high_s) in [(0.0, 1.5), (1.5, 2.3), (2.3, 3.0), (3.0, 4.0), (4.0, 99.0)] {
            row(&format!("{kind}, speech, T60 {low_s} to {high_s} s"), &plain(low_s, high_s));
        }
        for condition in DEFECTS {
            let chosen =
                records.iter().filter(of_kind).filter(|r| r.condition == condition && r.middle_t60_s < 2.5);
            row(&format!("{kind}, {condition}"), &chosen.collect::<Vec<_>>());
        }
    }
    text
}
