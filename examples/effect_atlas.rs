//! How well hidden effects are found: laboratory rooms, each with an effect of some strength or none, diagnosed blind.
//!
//! Prints a confusion table, detection by strength, false alarms and coverage with 95 % intervals.

use clap::Parser;
use sabine::diagnose::{DiagnoseConfig, Diagnoser, Verdict};
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use std::collections::BTreeMap;
use std::process::ExitCode;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Hide effects in laboratory rooms and count what is found of them.
#[derive(Parser)]
struct Arguments {
    /// Effects [default: the whole catalogue, what is outside it, and none]
    #[arg(long, value_delimiter = ',', value_name = "ID")]
    effects: Vec<String>,
    /// Strengths: 1 is plain, 0.3 slight
    #[arg(long, value_delimiter = ',', value_name = "X", default_value = "1")]
    strengths: Vec<f64>,
    /// Rooms for each effect and strength
    #[arg(long, default_value_t = 3)]
    rooms: u64,
    /// Seed of the first room; nothing was tuned on seeds from 1000 on
    #[arg(long, default_value_t = 1000)]
    seed: u64,
    /// Receivers in each room
    #[arg(long, default_value_t = 12)]
    receivers: usize,
    /// Rays for each pair
    #[arg(long, default_value_t = DiagnoseConfig::default().rays)]
    rays: usize,
}

/// What came out of one room.
struct Outcome {
    hidden: String,
    strength: f64,
    answer: String,
    right: bool,
    gain_low: Option<f64>,
    seconds: f64,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let all = Hidden::CATALOGUE.iter().chain(Hidden::OUTSIDE.iter()).map(ToString::to_string);
    let effects: Vec<String> = if arguments.effects.is_empty() {
        all.chain(["none".to_owned()]).collect()
    } else {
        arguments.effects.clone()
    };
    let folder = std::env::temp_dir().join(format!("sabine_effect_atlas_{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let mut outcomes = Vec::new();
    for effect in &effects {
        for &strength in &arguments.strengths {
            for room in 0..arguments.rooms {
                let outcome = one(arguments, effect, strength, arguments.seed + room, &folder);
                outcomes.push(outcome.inspect_err(|_| {
                    // The error that counts is the first.
                    let _ = std::fs::remove_dir_all(&folder);
                })?);
                if let Some(o) = outcomes.last() {
                    eprintln!(
                        "{:22} {:4.2} room {room}: {:40} {:5.1} s{}",
                        o.hidden,
                        o.strength,
                        o.answer,
                        o.seconds,
                        o.gain_low
                            .map_or(String::new(), |g| format!(", held-out gain above {g:.4} nats a bin"))
                    );
                }
            }
        }
    }
    std::fs::remove_dir_all(&folder)?;
    print_tables(&outcomes);
    Ok(())
}

fn one(
    arguments: &Arguments,
    effect: &str,
    strength: f64,
    seed: u64,
    folder: &std::path::Path,
) -> Result<Outcome, AnyError> {
    let lab = Laboratory::new(LabConfig { seed, receivers: arguments.receivers, ..LabConfig::default() })?;
    let hidden =
        if effect == "none" { Vec::new() } else { vec![Hidden::random(effect, strength, &lab, seed)?] };
    let place = folder.join(format!("{effect}_{strength}_{seed}"));
    let room = lab.write(&hidden, &place, None)?;
    let started = std::time::Instant::now();
    let config = DiagnoseConfig { rays: arguments.rays, seed, ..DiagnoseConfig::default() };
    let found = Diagnoser::new(config)?.diagnose(&room, &[], &())?;
    std::fs::remove_dir_all(&place)?;
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    let answer = match found.verdict {
        Verdict::Ambiguous => format!("one of {}", found.alternatives.join(" or ")),
        Verdict::Explained => named.join(" + "),
        other => other.to_string(),
    };
    let id = hidden.first().map_or("none", Hidden::id);
    let right = match id {
        "none" => found.verdict == Verdict::Adequate,
        "outside" => found.verdict == Verdict::Unexplained,
        id => {
            (found.verdict == Verdict::Explained && named == [id])
                || (found.verdict == Verdict::Ambiguous && found.alternatives.iter().any(|a| a == id))
        }
    };
    let gain_low = found.causes.first().and_then(|c| c.held_out_gain.as_ref()).map(|g| g.low);
    let seconds = started.elapsed().as_secs_f64();
    Ok(Outcome { hidden: effect.to_owned(), strength, answer, right, gain_low, seconds })
}

fn print_tables(outcomes: &[Outcome]) {
    let mut answers: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for o in outcomes {
        *answers.entry((&o.hidden, &o.answer)).or_default() += 1;
    }
    println!("\n| hidden | answer | rooms |\n|---|---|---|");
    for ((hidden, answer), count) in &answers {
        println!("| {hidden} | {answer} | {count} |");
    }
    let mut right: BTreeMap<(&str, String), (usize, usize)> = BTreeMap::new();
    for o in outcomes {
        let entry = right.entry((&o.hidden, format!("{:.2}", o.strength))).or_default();
        entry.0 += usize::from(o.right);
        entry.1 += 1;
    }
    println!("\n| hidden | strength | right | 95 % interval |\n|---|---|---|---|");
    for ((hidden, strength), (hits, count)) in &right {
        let (low, high) = wilson(*hits, *count);
        println!("| {hidden} | {strength} | {hits} of {count} | {:.0}-{:.0} % |", 100.0 * low, 100.0 * high);
    }
    let hits = outcomes.iter().filter(|o| o.right).count();
    let (low, high) = wilson(hits, outcomes.len());
    println!(
        "\nall: {hits} of {} right ({:.0}-{:.0} %), {:.0} s each",
        outcomes.len(),
        100.0 * low,
        100.0 * high,
        outcomes.iter().map(|o| o.seconds).sum::<f64>() / outcomes.len().max(1) as f64
    );
}

/// 95 % interval of a share (Wilson, JASA 22, 1927).
fn wilson(hits: usize, count: usize) -> (f64, f64) {
    if count == 0 {
        return (0.0, 1.0);
    }
    let (z, n) = (1.96f64, count as f64);
    let p = hits as f64 / n;
    let middle = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    ((middle - half) / (1.0 + z * z / n), (middle + half) / (1.0 + z * z / n))
}
