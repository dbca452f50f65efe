//! What a record comes to.

use crate::trial::Trial;
use sabine_validation::{median, print_share as share};

/// Prints all tables as Markdown: medians over rooms.
pub fn print(trials: &[Trial]) {
    println!(
        "| hidden | rooms | named right | true model | decays: nats per level found / true | curves stated / found / true (dB) | arrivals: nats found / true | stated / found / true (us) | changes captured | judged by | as well as the true model |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut names: Vec<&str> = Vec::new();
    trials.iter().for_each(|t| {
        if !names.contains(&&*t.hidden) {
            names.push(&t.hidden);
        }
    });
    for name in &names {
        let own: Vec<&Trial> = trials.iter().filter(|t| t.hidden == *name).collect();
        row(name, &own);
    }
    println!("\n| figure | found | 95 % interval |\n|---|---|---|");
    let of = |pairs: bool| trials.iter().filter(move |t| t.hidden.contains('+') == pairs);
    for (what, pairs) in [("one effect", false), ("two at once", true)] {
        share(&format!("{what}: just what is hidden is named"), of(pairs).map(|t| t.right));
        share(
            &format!(
                "{what}: predicts fresh positions as well as the true model within 20 %, of rooms that can be judged"
            ),
            of(pairs).filter_map(|t| t.passed),
        );
        share(
            &format!("{what}: the same, of rooms whose effects are named right"),
            of(pairs).filter(|t| t.right).filter_map(|t| t.passed),
        );
    }
    println!("| seconds for a room (median) | {:.0} | |", median(trials.iter().map(|t| t.seconds).collect()));
    let mut left_out: Vec<(&str, &str)> = trials
        .iter()
        .filter(|t| !t.left_out.is_empty())
        .map(|t| (t.hidden.as_str(), t.left_out.as_str()))
        .collect();
    left_out.sort_unstable();
    left_out.dedup();
    if !left_out.is_empty() {
        println!("\n| hidden | what no change of the model says |\n|---|---|");
        left_out.iter().for_each(|(hidden, reason)| println!("| {hidden} | {reason} |"));
    }
}

fn row(name: &str, own: &[&Trial]) {
    let mid = |value: fn(&Trial) -> f64| median(own.iter().map(|t| value(t)).collect());
    let words = |mut all: Vec<String>| {
        all.sort_unstable();
        all.dedup();
        all.join(", ")
    };
    let in_words = |value: String| value.replace('"', "").replace('_', " ");
    let judged = own.iter().filter(|t| t.passed.is_some()).count();
    let captured: Vec<f64> = own.iter().filter_map(|t| t.captured).collect();
    println!(
        "| {name} | {} | {} | {} | {:.3} / {:.3} | {:.2} / {:.2} / {:.2} | {:.2} / {:.2} | {:.0} / {:.0} / {:.0} | {} | {} | {} of {judged} |",
        own.len(),
        own.iter().filter(|t| t.right).count(),
        words(own.iter().map(|t| in_words(serde_name(&t.statement))).collect()),
        mid(|t| t.decay_nats_found),
        mid(|t| t.decay_nats_true),
        mid(|t| t.curve_db_stated),
        mid(|t| t.curve_db_found),
        mid(|t| t.curve_db_true),
        mid(|t| t.arrival_nats_found),
        mid(|t| t.arrival_nats_true),
        mid(|t| t.arrival_us_stated),
        mid(|t| t.arrival_us_found),
        mid(|t| t.arrival_us_true),
        if captured.is_empty() { "-".to_owned() } else { format!("{:.2}", median(captured)) },
        words(own.iter().map(|t| in_words(serde_name(&t.judged_by))).collect()),
        own.iter().filter(|t| t.passed == Some(true)).count(),
    );
}

/// The name that a value has in the record.
fn serde_name(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}
