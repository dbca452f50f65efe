//! What is printed, and the same as CSV.

use crate::error::Error;
use crate::judge::{Octave, Quantity};
use crate::methods::Method;
use crate::rooms::History;
use serde::Serialize;
use std::fmt::Write as _;

/// A room with what came of each of its responses.
pub struct RoomResult {
    /// Its name.
    pub name: &'static str,
    /// Whether the estimator knows it.
    pub history: History,
    /// Its responses.
    pub pairs: Vec<PairResult>,
}

/// What came of a response.
pub struct PairResult {
    /// Source and receiver.
    pub name: String,
    /// Octaves of which the measured response tells nothing.
    pub left_out: Vec<(Quantity, f64)>,
    /// Octaves by method.
    pub rendered: Vec<(Method, Vec<Octave>)>,
}

/// Published results of five rooms (Tang et al. 2020, table 3): mean errors of T60 in seconds and of EQ in dB.
const PUBLISHED_BLIND: (f64, f64) = (0.128, 3.63);
const PUBLISHED_LI_2018: (f64, f64) = (0.108, 4.84);

/// From this octave on the filter of a match mutes.
const MUTED_FROM_HZ: f64 = 8000.0;

/// A number that is taken of an octave.
type Pick = fn(&Octave) -> Option<f64>;

const TOTAL: Pick = |o| o.error();
const HEARD: Pick = |o| Some((o.target - o.measured).abs());
const FITTED: Pick = |o| Some((o.unfiltered? - o.target).abs());
const BEFORE_FILTER: Pick = |o| Some((o.unfiltered? - o.measured).abs());
const BEHIND_FILTER: Pick = |o| Some((o.rendered? - o.target).abs());
/// The match sets what lies from the octave at 8 kHz on to -50 dB: what is then read there is the slope of the filter at its lower edge.
const MUTED: Pick = |o| {
    let muted = o.quantity == Quantity::T60 && o.band_hz >= MUTED_FROM_HZ;
    Some((if muted { o.unfiltered } else { o.rendered }? - o.measured).abs())
};
const SIGNED: Pick = |o| Some(o.target - o.measured);

impl RoomResult {
    /// Mean over responses of the mean over octaves.
    fn mean(&self, method: Method, quantity: Quantity, pick: Pick) -> Option<f64> {
        mean(self.pairs.iter().filter_map(|pair| mean(pair.octaves(method, quantity).filter_map(pick))))
    }

    /// Mean over responses of one octave.
    fn at(&self, method: Method, quantity: Quantity, band_hz: f64, pick: Pick) -> Option<f64> {
        let octaves = self.pairs.iter().flat_map(|pair| pair.octaves(method, quantity));
        mean(octaves.filter(|o| o.band_hz == band_hz).filter_map(pick))
    }
}

impl PairResult {
    fn octaves(&self, method: Method, quantity: Quantity) -> impl Iterator<Item = &Octave> {
        let own = self.rendered.iter().filter(move |(own, _)| *own == method);
        own.flat_map(|(_, octaves)| octaves).filter(move |o| o.quantity == quantity)
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// Seconds with three decimals, decibels with two.
fn number(quantity: Quantity, value: Option<f64>) -> String {
    match (value, quantity) {
        (None, _) => "-".to_owned(),
        (Some(value), Quantity::T60) => format!("{value:.3}"),
        (Some(value), Quantity::Eq) => format!("{value:.2}"),
    }
}

fn row(cells: impl IntoIterator<Item = String>) -> String {
    format!("| {} |\n", cells.into_iter().collect::<Vec<_>>().join(" | "))
}

fn head(columns: &[String]) -> String {
    format!("{}|{}\n", row(columns.iter().cloned()), "---|".repeat(columns.len()))
}

/// All tables in Markdown.
pub fn markdown(rooms: &[RoomResult]) -> String {
    let mut text = String::new();
    for quantity in [Quantity::T60, Quantity::Eq] {
        let _ = writeln!(text, "{}", by_room(rooms, quantity));
    }
    for quantity in [Quantity::T60, Quantity::Eq] {
        let _ = writeln!(text, "{}", by_octave(rooms, quantity));
    }
    let _ = writeln!(text, "{}", by_stage(rooms));
    for quantity in [Quantity::T60, Quantity::Eq] {
        let _ = writeln!(text, "{}", heard(rooms, quantity));
    }
    text.push_str(&left_out(rooms));
    text
}

fn words(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::T60 => "T60 error (s)",
        Quantity::Eq => "EQ error (dB)",
    }
}

/// Every room, and means over rooms: the room is the independent unit.
fn by_room(rooms: &[RoomResult], quantity: Quantity) -> String {
    let mut columns = vec![
        words(quantity),
        "estimator",
        "responses",
        "blind",
        "blind, the paper's objective",
        "response given",
        "T30 and EQ given",
        "Li 2018, T30 and EQ given",
    ];
    let mut picked: Vec<(Method, Pick)> = Method::ALL.map(|method| (method, TOTAL)).to_vec();
    if quantity == Quantity::T60 {
        columns.push("blind, 8 kHz before the filter");
        picked.push((Method::Blind, MUTED));
    }
    let mut text = head(&columns.iter().map(|&column| column.to_owned()).collect::<Vec<_>>());
    let of = |room: &RoomResult| -> Vec<Option<f64>> {
        picked.iter().map(|&(method, pick)| room.mean(method, quantity, pick)).collect()
    };
    for room in rooms {
        let labels = [room.name.to_owned(), room.history.word().to_owned(), room.pairs.len().to_string()];
        text += &row(labels.into_iter().chain(of(room).into_iter().map(|value| number(quantity, value))));
    }
    let mut add = |label: String, chosen: &[&RoomResult], of_column: fn(&[f64]) -> Option<f64>| {
        let responses: usize = chosen.iter().map(|room| room.pairs.len()).sum();
        let columns = (0..picked.len()).map(|i| {
            let values: Vec<f64> = chosen.iter().filter_map(|room| of(room)[i]).collect();
            format!("**{}**", number(quantity, of_column(&values)))
        });
        text +=
            &row([format!("**{label}**"), String::new(), responses.to_string()].into_iter().chain(columns));
    };
    let average: fn(&[f64]) -> Option<f64> = |values| mean(values.iter().copied());
    let all: Vec<&RoomResult> = rooms.iter().collect();
    add(format!("mean of all rooms: {}", all.len()), &all, average);
    add("its standard error".to_owned(), &all, standard_error);
    let others: Vec<&RoomResult> = rooms.iter().filter(|room| room.history != History::Trained).collect();
    add(format!("mean of rooms not trained on: {}", others.len()), &others, average);
    let published = |(t60_s, eq_db): (f64, f64)| match quantity {
        Quantity::T60 => number(quantity, Some(t60_s)),
        Quantity::Eq => number(quantity, Some(eq_db)),
    };
    let mut cells = vec!["the paper's five rooms".to_owned(), String::new(), "5".to_owned()];
    cells.push(published(PUBLISHED_BLIND));
    cells.extend(["-"; 3].map(str::to_owned));
    cells.push(published(PUBLISHED_LI_2018));
    cells.resize(columns.len(), "-".to_owned());
    text + &row(cells)
}

/// Of a mean, from the scatter of its values.
fn standard_error(values: &[f64]) -> Option<f64> {
    let mean = mean(values.iter().copied())?;
    let count = values.len() as f64;
    let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (count > 1.0).then(|| (square / (count - 1.0) / count).sqrt())
}

/// Octaves that occur, in rising order.
fn bands_hz(rooms: &[RoomResult], quantity: Quantity) -> Vec<f64> {
    let octaves = rooms.iter().flat_map(|room| &room.pairs);
    let octaves = octaves.flat_map(|pair| pair.octaves(Method::Blind, quantity));
    let mut bands: Vec<f64> = octaves.map(|octave| octave.band_hz).collect();
    bands.sort_by(f64::total_cmp);
    bands.dedup();
    bands
}

/// Mean over rooms, for each octave.
fn by_octave(rooms: &[RoomResult], quantity: Quantity) -> String {
    let columns = [
        format!("octave (Hz), {}", words(quantity)),
        "rooms".to_owned(),
        "blind".to_owned(),
        "blind, before the filter".to_owned(),
        "heard".to_owned(),
        "response given".to_owned(),
        "T30 and EQ given".to_owned(),
    ];
    let mut text = head(&columns);
    for band_hz in bands_hz(rooms, quantity) {
        let at = |method: Method, pick: Pick| {
            let all = rooms.iter().filter_map(|room| room.at(method, quantity, band_hz, pick));
            number(quantity, mean(all))
        };
        let read =
            rooms.iter().filter(|room| room.at(Method::Blind, quantity, band_hz, HEARD).is_some()).count();
        text += &row([
            format!("{band_hz}"),
            read.to_string(),
            at(Method::Blind, TOTAL),
            at(Method::Blind, BEFORE_FILTER),
            at(Method::Blind, HEARD),
            at(Method::Given, TOTAL),
            at(Method::GivenTargets, TOTAL),
        ]);
    }
    text
}

/// Where an error comes from: mean over rooms.
fn by_stage(rooms: &[RoomResult]) -> String {
    let columns = [
        "stage",
        "blind: T60 (s)",
        "blind: EQ (dB)",
        "response given: T60 (s)",
        "response given: EQ (dB)",
        "T30 and EQ given: T60 (s)",
        "T30 and EQ given: EQ (dB)",
    ];
    let mut text = head(&columns.map(str::to_owned));
    let stages: [(&str, Pick); 5] = [
        ("target against measured", HEARD),
        ("rendered, before the filter, against target", FITTED),
        ("rendered, behind the filter, against target", BEHIND_FILTER),
        ("rendered, before the filter, against measured", BEFORE_FILTER),
        ("rendered, behind the filter, against measured", TOTAL),
    ];
    for (stage, pick) in stages {
        let mut cells = vec![stage.to_owned()];
        for method in [Method::Blind, Method::Given, Method::GivenTargets] {
            for quantity in [Quantity::T60, Quantity::Eq] {
                let all = rooms.iter().filter_map(|room| room.mean(method, quantity, pick));
                cells.push(number(quantity, mean(all)));
            }
        }
        text += &row(cells);
    }
    text
}

/// What the estimator heard less what was measured, signed, in each room.
fn heard(rooms: &[RoomResult], quantity: Quantity) -> String {
    let bands = bands_hz(rooms, quantity);
    let unit = match quantity {
        Quantity::T60 => "heard less measured, T60 (s)",
        Quantity::Eq => "heard less measured, EQ (dB)",
    };
    let columns: Vec<String> =
        std::iter::once(unit.to_owned()).chain(bands.iter().map(|hz| format!("{hz} Hz"))).collect();
    let mut text = head(&columns);
    for room in rooms {
        let cells = bands.iter().map(|&hz| {
            let value = room.at(Method::Blind, quantity, hz, SIGNED);
            value.map_or("-".to_owned(), |_| {
                let digits = number(quantity, value.map(f64::abs));
                format!("{}{digits}", if value.is_some_and(f64::is_sign_negative) { '-' } else { '+' })
            })
        });
        text += &row(std::iter::once(room.name.to_owned()).chain(cells));
    }
    text
}

/// Octaves that were not judged, and renderings that could not be read.
fn left_out(rooms: &[RoomResult]) -> String {
    let mut text = String::new();
    for room in rooms {
        for quantity in [Quantity::T60, Quantity::Eq] {
            let mut lines: Vec<String> = Vec::new();
            for pair in &room.pairs {
                let own = pair.left_out.iter().filter(|(of, _)| *of == quantity);
                let bands: Vec<String> = own.map(|(_, hz)| hz.to_string()).collect();
                if !bands.is_empty() {
                    lines.push(format!("{} ({})", pair.name, bands.join(", ")));
                }
            }
            if !lines.is_empty() {
                let _ =
                    writeln!(text, "left out, {}: {}: {} Hz", words(quantity), room.name, lines.join("; "));
            }
        }
        for method in Method::ALL {
            let octaves = room.pairs.iter().flat_map(|pair| &pair.rendered);
            let own = octaves.filter(|(own, _)| *own == method).flat_map(|(_, octaves)| octaves);
            let unread = own.filter(|octave| octave.rendered.is_none()).count();
            if unread > 0 {
                let _ =
                    writeln!(text, "not read from what {method:?} rendered: {}: {unread} octaves", room.name);
            }
        }
    }
    text
}

/// A line of the CSV file.
#[derive(Serialize)]
struct Line<'a> {
    room: &'a str,
    response: &'a str,
    method: Method,
    quantity: Quantity,
    band_hz: f64,
    measured: f64,
    target: f64,
    before_filter: Option<f64>,
    rendered: Option<f64>,
}

/// Every octave of every method.
///
/// # Errors
/// [`Error::Csv`]; writing into memory does not fail by itself.
pub fn csv(rooms: &[RoomResult]) -> Result<Vec<u8>, Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for room in rooms {
        for pair in &room.pairs {
            for (method, octaves) in &pair.rendered {
                for octave in octaves {
                    writer.serialize(Line {
                        room: room.name,
                        response: &pair.name,
                        method: *method,
                        quantity: octave.quantity,
                        band_hz: octave.band_hz,
                        measured: octave.measured,
                        target: octave.target,
                        before_filter: octave.unfiltered,
                        rendered: octave.rendered,
                    })?;
                }
            }
        }
    }
    writer
        .into_inner()
        .map_err(|error| Error::Io { path: "five_rooms.csv".into(), source: error.into_error() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octave(quantity: Quantity, band_hz: f64, target: f64, rendered: Option<f64>) -> Octave {
        Octave { quantity, band_hz, measured: 1.0, target, unfiltered: rendered, rendered }
    }

    fn room(name: &'static str, history: History, errors: &[f64]) -> RoomResult {
        let pair = |error: &f64| PairResult {
            name: "s/r".into(),
            left_out: vec![(Quantity::T60, 8000.0)],
            rendered: vec![(
                Method::Blind,
                vec![
                    octave(Quantity::T60, 500.0, 1.0 - error, Some(1.0 - error)),
                    octave(Quantity::T60, 1000.0, 1.0 + error, Some(1.0 + error)),
                ],
            )],
        };
        RoomResult { name, history, pairs: errors.iter().map(pair).collect() }
    }

    #[test]
    fn a_room_with_many_responses_counts_once() {
        let rooms = [room("a", History::Trained, &[0.1, 0.1, 0.1]), room("b", History::New, &[0.3])];
        let text = by_room(&rooms, Quantity::T60);
        assert!(text.contains("| a | trained on | 3 | 0.100 | - |"), "{text}");
        assert!(text.contains("| **mean of all rooms: 2** |  | 4 | **0.200** |"), "{text}");
        assert!(text.contains("| **mean of rooms not trained on: 1** |  | 1 | **0.300** |"), "{text}");
        assert!(text.contains("| 5 | 0.128 | - | - | - | 0.108 | - |"), "{text}");
        assert!(left_out(&rooms).contains("b: s/r (8000) Hz"));
    }

    #[test]
    fn signs_are_those_of_what_was_heard() {
        let text = heard(&[room("a", History::New, &[0.1])], Quantity::T60);
        assert!(text.contains("| a | -0.100 | +0.100 |"), "{text}");
    }
}
