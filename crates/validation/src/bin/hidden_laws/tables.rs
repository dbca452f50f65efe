//! What a record comes to.

use crate::judge::Outcome;
use crate::kinds::KINDS;
use crate::trial::{Discover, Trial};
use crate::worlds::Null;
use clap::ValueEnum;
use sabine_validation::{exact_interval, median, print_share as share};

/// Classes of how visible laws are beforehand: the least d' of each.
const VISIBLE: [f64; 4] = [0.0, 6.0, 8.0, 10.0];

/// Prints all tables as Markdown, those of rooms in which a law was always looked for after the others.
pub fn print(trials: &[Trial]) {
    for discover in [Discover::IfNeeded, Discover::Always] {
        let own: Vec<&Trial> = trials.iter().filter(|t| t.discover == discover).collect();
        if !own.is_empty() {
            let value = discover.to_possible_value();
            println!("\n`--discover={}`\n", value.as_ref().map_or("", |value| value.get_name()));
            print_tables(&own);
        }
    }
}

/// Tables of rooms that were diagnosed in the same way.
fn print_tables(trials: &[&Trial]) {
    let laws: Vec<&Trial> = trials.iter().copied().filter(|t| t.size.is_some()).collect();
    let nulls: Vec<&Trial> = trials.iter().copied().filter(|t| t.size.is_none()).collect();
    by_kind_and_size(&laws);
    by_visibility(&laws);
    agreement(&laws);
    outside(&laws);
    shares_of_laws(&laws);
    without_a_law(&nulls);
    let seconds = median(trials.iter().map(|t| t.seconds).collect());
    println!("\n{} rooms; {seconds:.0} s for a room (median)", trials.len());
}

/// Prints by how much laws change levels: number of the kind, size, and dB.
pub fn print_changes(changes: &[(usize, f64, f64)]) {
    let mut sizes: Vec<f64> = changes.iter().map(|(_, size, _)| *size).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    let columns: String = sizes.iter().map(|size| format!(" size {size} |")).collect();
    println!("| law |{columns}\n|---|{}", "---|".repeat(sizes.len()));
    for (number, kind) in KINDS.iter().enumerate() {
        let cell = |size: &f64| {
            let own: Vec<f64> =
                changes.iter().filter(|c| c.0 == number && c.1 == *size).map(|c| c.2).collect();
            if own.is_empty() { " - |".to_owned() } else { format!(" {:.2} |", median(own)) }
        };
        println!("| {} |{}", kind.id, sizes.iter().map(cell).collect::<String>());
    }
}

/// A count, and its exact 95 % interval in percent.
fn counted(hits: usize, all: usize) -> String {
    if all == 0 {
        return "-".to_owned();
    }
    let (low, high) = exact_interval(hits, all);
    format!("{hits} ({:.0}-{:.0} %)", 100.0 * low, 100.0 * high)
}

fn sizes_of(own: &[&Trial]) -> Vec<f64> {
    let mut sizes: Vec<f64> = own.iter().filter_map(|t| t.size).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    sizes
}

/// Median of what is known, to two decimals.
fn middle(own: &[&Trial], value: fn(&Trial) -> Option<f64>) -> String {
    let known: Vec<f64> = own.iter().filter_map(|t| value(t)).collect();
    if known.is_empty() { "-".to_owned() } else { format!("{:.2}", median(known)) }
}

fn by_kind_and_size(laws: &[&Trial]) {
    if laws.is_empty() {
        return;
    }
    println!(
        "| law | size | rooms | it changes levels by (dB rms, median) | right law | named by the catalogue | `unexplained` | `adequate` | wrong law | wrong name | not named right, but a test of the misfit speaks of it | right, with a false name or law beside it |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for kind in &KINDS {
        let own: Vec<&Trial> = laws.iter().copied().filter(|t| t.kind == kind.id).collect();
        for size in sizes_of(&own) {
            let own: Vec<&Trial> = own.iter().copied().filter(|t| t.size == Some(size)).collect();
            let cell =
                |outcome: Outcome| counted(own.iter().filter(|t| t.outcome == outcome).count(), own.len());
            let not_named = own
                .iter()
                .filter(|t| !matches!(t.outcome, Outcome::RightLaw | Outcome::Catalogue))
                .filter(|t| t.misfit_is_right == Some(true));
            let beside = own
                .iter()
                .filter(|t| matches!(t.outcome, Outcome::RightLaw | Outcome::Catalogue))
                .filter(|t| t.false_laws + t.false_names > 0);
            println!(
                "| {} | {size} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                kind.id,
                own.len(),
                middle(&own, |t| t.change_db),
                cell(Outcome::RightLaw),
                cell(Outcome::Catalogue),
                cell(Outcome::Unexplained),
                cell(Outcome::Adequate),
                cell(Outcome::WrongLaw),
                cell(Outcome::WrongName),
                not_named.count(),
                beside.count()
            );
        }
    }
}

/// What comes of laws that are as visible as each other.
fn by_visibility(laws: &[&Trial]) {
    let known: Vec<(f64, &Trial)> = laws.iter().filter_map(|t| Some((t.d_prime?, *t))).collect();
    if known.is_empty() {
        return;
    }
    println!(
        "\n| d' beforehand | rooms | right law, or named by the catalogue | something true is said | wrong law or name |"
    );
    println!("|---|---|---|---|---|");
    for (place, &low) in VISIBLE.iter().enumerate() {
        let high = VISIBLE.get(place + 1).copied().unwrap_or(f64::INFINITY);
        let own: Vec<&Trial> =
            known.iter().filter(|(d, _)| (low..high).contains(d)).map(|(_, t)| *t).collect();
        let count = |is: fn(&Trial) -> bool| counted(own.iter().filter(|t| is(t)).count(), own.len());
        let range = if high.is_finite() { format!("{low} to {high}") } else { format!("{low} and more") };
        let wrong = |t: &Trial| matches!(t.outcome, Outcome::WrongLaw | Outcome::WrongName);
        println!(
            "| {range} | {} | {} | {} | {} |",
            own.len(),
            count(is_named),
            count(says_something_true),
            count(wrong)
        );
    }
}

/// Whether the law is named, as a law or as an effect of the catalogue.
fn is_named(trial: &Trial) -> bool {
    matches!(trial.outcome, Outcome::RightLaw | Outcome::Catalogue)
}

/// Whether what is said is true: the law, or that something is wrong, or what the misfit goes with.
fn says_something_true(trial: &Trial) -> bool {
    is_named(trial)
        || matches!(trial.outcome, Outcome::Unexplained | Outcome::InSet)
        || trial.outcome == Outcome::Adequate && trial.misfit_is_right == Some(true)
}

/// How far off the model found is where nothing was fitted.
fn outside(laws: &[&Trial]) {
    if laws.iter().all(|t| t.outside_nats.is_none()) {
        return;
    }
    println!(
        "\n| outside the fitted range | rooms | curves as stated, dB (median) | curves as found, dB (median) | nearer | nats for each level (median) |"
    );
    println!("|---|---|---|---|---|---|");
    let classes = [
        ("right law", vec![Outcome::RightLaw]),
        ("named by the catalogue", vec![Outcome::Catalogue]),
        ("something else named", vec![Outcome::WrongLaw, Outcome::WrongName]),
    ];
    for (name, outcomes) in classes {
        let is = |t: &&Trial| outcomes.contains(&t.outcome) && t.outside_nats.is_some();
        let own: Vec<&Trial> = laws.iter().copied().filter(is).collect();
        let nearer = own.iter().filter(|t| t.outside_found_db < t.outside_stated_db).count();
        println!(
            "| {name} | {} | {} | {} | {} | {} |",
            own.len(),
            middle(&own, |t| t.outside_stated_db),
            middle(&own, |t| t.outside_found_db),
            counted(nearer, own.len()),
            middle(&own, |t| t.outside_nats)
        );
    }
}

/// Sign, edge and level of right laws.
fn agreement(laws: &[&Trial]) {
    if laws.iter().all(|t| t.outcome != Outcome::RightLaw) {
        return;
    }
    println!(
        "\n| right laws | rooms | sign right | edge within an octave | off by (dB rms, median) | hidden (dB rms, median) |"
    );
    println!("|---|---|---|---|---|---|");
    for kind in &KINDS {
        let own: Vec<&Trial> =
            laws.iter().copied().filter(|t| t.kind == kind.id && t.outcome == Outcome::RightLaw).collect();
        if own.is_empty() {
            continue;
        }
        let of = |value: fn(&Trial) -> Option<bool>| {
            let known: Vec<bool> = own.iter().filter_map(|t| value(t)).collect();
            let right = known.iter().filter(|right| **right).count();
            if known.is_empty() { "-".to_owned() } else { format!("{right} of {}", known.len()) }
        };
        println!(
            "| {} | {} | {} | {} | {} | {} |",
            kind.id,
            own.len(),
            of(|t| t.sign_right),
            of(|t| t.edge_right),
            middle(&own, |t| t.rms_db),
            middle(&own, |t| t.hidden_rms_db)
        );
    }
}

fn shares_of_laws(laws: &[&Trial]) {
    if laws.is_empty() {
        return;
    }
    println!("\n| rooms with a law | found | 95 % interval |\n|---|---|---|");
    let is = |outcome: Outcome| laws.iter().map(move |t| t.outcome == outcome);
    share("right law", is(Outcome::RightLaw));
    share("named by the catalogue", is(Outcome::Catalogue));
    if is(Outcome::InSet).any(|found| found) {
        share("a set of a cause and the right law", is(Outcome::InSet));
    }
    share("`unexplained`", is(Outcome::Unexplained));
    share("one of these: something true is said", laws.iter().map(|t| says_something_true(t)));
    share("wrong law", is(Outcome::WrongLaw));
    share("wrong name", is(Outcome::WrongName));
    share("`adequate`", is(Outcome::Adequate));
    for size in sizes_of(laws) {
        let own = laws.iter().filter(|t| t.size == Some(size));
        share(&format!("size {size}: right law"), own.map(|t| t.outcome == Outcome::RightLaw));
    }
    share("right laws: sign", laws.iter().filter_map(|t| t.sign_right));
    share("right laws: edge within an octave", laws.iter().filter_map(|t| t.edge_right));
    let named = laws.iter().filter(|t| is_named(t));
    let ratio = |t: &&Trial| Some(t.absorption_after? / t.absorption_before?.max(1e-9));
    let ratios: Vec<f64> = named.filter_map(ratio).collect();
    if !ratios.is_empty() {
        println!("| error of fitted absorption, after / before, named (median) | {:.2} | |", median(ratios));
    }
}

fn without_a_law(nulls: &[&Trial]) {
    if nulls.is_empty() {
        return;
    }
    println!("\n| rooms without a law | found | 95 % interval |\n|---|---|---|");
    let all = [Null::Nothing, Null::Cause, Null::Nuisances, Null::Both];
    for null in all {
        let own = || nulls.iter().filter(move |t| t.null == Some(null));
        let what = format!("{null:?}").to_lowercase();
        share(&format!("{what}: false law"), own().map(|t| t.false_laws > 0));
        share(&format!("{what}: false name of the catalogue"), own().map(|t| t.false_names > 0));
        share(&format!("{what}: `unexplained`"), own().map(|t| t.outcome == Outcome::Unexplained));
        if matches!(null, Null::Cause | Null::Both) {
            share(&format!("{what}: the cause is named"), own().map(|t| t.outcome == Outcome::Catalogue));
        }
    }
    share("all: false law", nulls.iter().map(|t| t.false_laws > 0));
    println!(
        "\n| rooms of the kind, without a law | rooms | false law | false name | `unexplained` |\n|---|---|---|---|---|"
    );
    for kind in &KINDS {
        let own: Vec<&&Trial> = nulls.iter().filter(|t| t.kind == kind.id).collect();
        if own.is_empty() {
            continue;
        }
        let count = |is: fn(&Trial) -> bool| counted(own.iter().filter(|t| is(t)).count(), own.len());
        println!(
            "| {} | {} | {} | {} | {} |",
            kind.id,
            own.len(),
            count(|t| t.false_laws > 0),
            count(|t| t.false_names > 0),
            count(|t| t.outcome == Outcome::Unexplained)
        );
    }
}
