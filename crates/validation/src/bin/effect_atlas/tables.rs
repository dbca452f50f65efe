//! What a record of trials comes to.

use crate::trial::{Outcome, Trial};
use sabine_validation::median;
use std::collections::BTreeMap;

/// Edges of the classes of d'.
const CLASSES: [f64; 5] = [0.0, 3.0, 5.0, PLAIN, f64::INFINITY];
/// From here on a single name is due.
const PLAIN: f64 = 7.0;

/// Prints all tables as Markdown.
pub fn print(trials: &[Trial]) {
    println!("## Answers\n");
    println!(
        "| hidden | strength | receivers | shams | rooms | right | set | extra | part | wrong | missed | unnamed | d' |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let mut groups: BTreeMap<(&str, String, usize, usize), Vec<&Trial>> = BTreeMap::new();
    for t in trials {
        groups.entry((&t.hidden, format!("{:.2}", t.strength), t.receivers, t.shams)).or_default().push(t);
    }
    for ((hidden, strength, receivers, shams), own) in &groups {
        let count = |o: Outcome| own.iter().filter(|t| t.outcome == o).count();
        println!(
            "| {hidden} | {strength} | {receivers} | {shams} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            own.len(),
            count(Outcome::Right),
            count(Outcome::Set),
            count(Outcome::Extra),
            count(Outcome::Part),
            count(Outcome::Wrong),
            count(Outcome::Missed),
            count(Outcome::Unnamed),
            mean_d_prime(own).map_or("-".into(), |d| format!("{d:.1}"))
        );
    }
    println!(
        "\n## Other answers than what was hidden\n\n| hidden | strength | seed | answer |\n|---|---|---|---|"
    );
    for t in trials.iter().filter(|t| t.outcome != Outcome::Right) {
        println!("| {} | {:.2} | {} | {} |", t.hidden, t.strength, t.seed, t.answer);
    }
    conditions(trials);
    figures(trials);
}

/// How the answers depend on how the room was measured, if that differs.
fn conditions(trials: &[Trial]) {
    type Condition = (usize, usize, u32, usize, usize, bool);
    let mut groups: BTreeMap<Condition, Vec<&Trial>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.shams == 0) {
        let condition = (
            t.receivers,
            t.sources,
            t.sample_rate_hz,
            t.sessions,
            t.bands_per_octave,
            t.positive_reflections,
        );
        groups.entry(condition).or_default().push(t);
    }
    if groups.len() < 2 {
        return;
    }
    println!("\n## By conditions\n");
    println!(
        "| receivers | sources | sample rate, kHz | sessions | bands in an octave | signs of reflections | null rooms: false alarms | detected | right single name | wrong or a name too many | root mean square d' | seconds (median) |"
    );
    println!("|{}", "---|".repeat(12));
    for ((receivers, sources, rate, sessions, per_octave, positive), own) in &groups {
        let (nulls, hidden): (Vec<&Trial>, Vec<&Trial>) = own.iter().partition(|t| t.hidden == "none");
        let of = |among: &[&Trial], hit: &dyn Fn(&Trial) -> bool| {
            format!("{} of {}", among.iter().filter(|t| hit(t)).count(), among.len())
        };
        println!(
            "| {receivers} | {sources} | {} | {sessions} | {per_octave} | {} | {} | {} | {} | {} | {} | {} |",
            f64::from(*rate) / 1000.0,
            if *positive { "kept" } else { "random" },
            of(&nulls, &|t| t.outcome != Outcome::Right),
            of(&hidden, &|t| t.outcome != Outcome::Missed),
            of(&hidden, &|t| t.outcome == Outcome::Right),
            of(&hidden, &|t| matches!(t.outcome, Outcome::Wrong | Outcome::Extra)),
            mean_d_prime(&hidden).map_or("-".into(), |d| format!("{d:.1}")),
            seconds(own)
        );
    }
}

/// Share of rooms named rightly if the truth of each were that of another, in the mean over all ways to turn the list.
fn by_permuted_names(trials: &[&Trial]) -> f64 {
    let n = trials.len();
    let hits = (1..n)
        .flat_map(|turn| (0..n).map(move |i| (i, (i + turn) % n)))
        .filter(|&(i, other)| trials[i].answer == trials[other].hidden)
        .count();
    hits as f64 / (n * n.saturating_sub(1)).max(1) as f64
}

fn figures(trials: &[Trial]) {
    println!("\n## Figures\n\n| figure | found | 95 % interval |\n|---|---|---|");
    let plain: Vec<&Trial> = trials.iter().filter(|t| t.shams == 0).collect();
    let nulls: Vec<&Trial> = plain.iter().copied().filter(|t| t.hidden == "none").collect();
    share("false alarm on null rooms", nulls.iter().map(|t| t.outcome != Outcome::Right));
    share("a cause named on null rooms", nulls.iter().map(|t| t.outcome == Outcome::Wrong));
    let with_shams: Vec<&Trial> = trials.iter().filter(|t| t.shams > 0).collect();
    let sham_nulls = with_shams.iter().filter(|t| t.hidden == "none");
    share("the same with shams in the catalogue", sham_nulls.map(|t| t.outcome == Outcome::Wrong));
    let named_sham = with_shams.iter().map(|t| t.answer.contains("sham"));
    share("a sham named, of all rooms with shams", named_sham);
    let outside = |t: &Trial| sabine_testkit::Hidden::OUTSIDE.contains(&t.hidden.as_str());
    let single: Vec<&Trial> = plain
        .iter()
        .copied()
        .filter(|t| t.hidden != "none" && !t.hidden.contains('+') && !outside(t))
        .collect();
    // One room's d' is what its name hangs on: the mean over the rooms of a case is not.
    let mut cases: BTreeMap<(&str, String, usize), Vec<&Trial>> = BTreeMap::new();
    for t in &single {
        cases.entry((&t.hidden, format!("{:.2}", t.strength), t.receivers)).or_default().push(t);
    }
    for class in CLASSES.windows(2) {
        let own: Vec<&Trial> = cases
            .values()
            .filter(|c| mean_d_prime(c).is_some_and(|d| (class[0]..class[1]).contains(&d)))
            .flatten()
            .copied()
            .collect();
        let what = if class[1].is_finite() {
            format!("detected, d' {} to {}", class[0], class[1])
        } else {
            format!("detected, d' from {} on", class[0])
        };
        share(&what, own.iter().map(|t| t.outcome != Outcome::Missed));
    }
    let due: Vec<&Trial> = cases
        .values()
        .filter(|c| mean_d_prime(c).is_some_and(|d| d >= PLAIN))
        .flatten()
        .copied()
        .filter(|t| t.outcome != Outcome::Missed)
        .collect();
    share("right single name, detected, d' from 7 on", due.iter().map(|t| t.outcome == Outcome::Right));
    println!("| the same with names permuted among the rooms | {:.0} % | |", 100.0 * by_permuted_names(&due));
    let right_or_set = |t: &&Trial| matches!(t.outcome, Outcome::Right | Outcome::Set);
    share("right name or a set that holds it, likewise", due.iter().map(right_or_set));
    let wrong = |t: &&Trial| t.outcome == Outcome::Wrong;
    share("wrong name, of all rooms with one effect", single.iter().map(wrong));
    let extra = |t: &&Trial| t.outcome == Outcome::Extra;
    share("a name too many, of all rooms with one effect", single.iter().map(extra));
    let pairs: Vec<&Trial> = plain.iter().copied().filter(|t| t.hidden.contains('+')).collect();
    share("two effects, both named", pairs.iter().map(|t| t.outcome == Outcome::Right));
    share("two effects, something wrong named", pairs.iter().map(wrong));
    let foreign: Vec<&Trial> = plain.iter().copied().filter(|t| outside(t)).collect();
    share("outside the catalogue: unexplained", foreign.iter().map(|t| t.outcome == Outcome::Right));
    share("outside the catalogue: a name", foreign.iter().map(wrong));
    let covered = single.iter().flat_map(|t| (0..t.intervals).map(move |i| i < t.covered));
    share("coverage of 90 % intervals", covered);
    let named: Vec<&&Trial> = single.iter().filter(|t| t.outcome == Outcome::Right).collect();
    share(
        "gain at positions not seen above zero, rightly named",
        named.iter().map(|t| t.gain_low > Some(0.0)),
    );
    share("a set: the measurement asked for decides", plain.iter().filter_map(|t| t.asked_decides));
    share("a set: another measurement decides", plain.iter().filter_map(|t| t.other_decides));
    let ratios = named.iter().map(|t| t.absorption_after / t.absorption_before.max(1e-9)).collect();
    println!(
        "| error of fitted absorption, after / before, rightly named (median) | {:.2} | |",
        median(ratios)
    );
    println!("| seconds for a diagnosis (median) | {} | |", seconds(&plain));
}

/// Root of the mean square: of the squares the mean is unbiased.
fn mean_d_prime(trials: &[&Trial]) -> Option<f64> {
    let squares: Vec<f64> = trials.iter().filter_map(|t| t.d_prime).map(|d| d * d).collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Median of the rooms that have a time.
fn seconds(trials: &[&Trial]) -> String {
    let known: Vec<f64> = trials.iter().filter_map(|t| t.seconds).collect();
    if known.is_empty() { "-".into() } else { format!("{:.0}", median(known)) }
}

fn share(what: &str, hits: impl Iterator<Item = bool>) {
    let hits: Vec<bool> = hits.collect();
    if hits.is_empty() {
        println!("| {what} | not run | |");
        return;
    }
    let count = hits.iter().filter(|h| **h).count();
    let (low, high) = wilson(count, hits.len());
    println!(
        "| {what} | {count} of {} ({:.0} %) | {:.0}-{:.0} % |",
        hits.len(),
        100.0 * count as f64 / hits.len() as f64,
        100.0 * low,
        100.0 * high
    );
}

/// 95 % interval of a share (Wilson, JASA 22, 1927).
fn wilson(hits: usize, count: usize) -> (f64, f64) {
    let (z, n) = (1.96f64, count as f64);
    let p = hits as f64 / n;
    let middle = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    // Rounding may leave the lower end of none a little below zero.
    (((middle - half) / (1.0 + z * z / n)).max(0.0), (middle + half) / (1.0 + z * z / n))
}
