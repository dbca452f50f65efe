//! What a record comes to.

use crate::trial::{Outcome, Trial, shape_name};
use sabine_testkit::{Planted, Polyhedron};
use sabine_validation::{median, print_share as share};

/// Prints all tables as Markdown. Intervals are exact, over rooms.
pub fn print(trials: &[Trial]) {
    println!("| hidden | world | rooms | right | set | extra | wrong | unexplained | missed |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for planted in Planted::ALL {
        for nuisances in [false, true] {
            let own: Vec<&Trial> = trials
                .iter()
                .filter(|t| t.task.planted == planted && t.task.nuisances == nuisances)
                .collect();
            if own.is_empty() {
                continue;
            }
            let count = |o: Outcome| own.iter().filter(|t| t.outcome == o).count();
            println!(
                "| {planted} | {} | {} | {} | {} | {} | {} | {} | {} |",
                world(nuisances),
                own.len(),
                count(Outcome::Right),
                count(Outcome::Set),
                count(Outcome::Extra),
                count(Outcome::Wrong),
                count(Outcome::Unexplained),
                count(Outcome::Missed),
            );
        }
    }
    println!("\n| figure | found | 95 % interval |\n|---|---|---|");
    for nuisances in [false, true] {
        let own: Vec<&Trial> = trials.iter().filter(|t| t.task.nuisances == nuisances).collect();
        let of = |wanted: fn(&Trial) -> bool| own.iter().copied().filter(move |t| wanted(t));
        let null = |t: &Trial| t.task.planted == Planted::Nothing;
        let due = |t: &Trial| t.task.planted.effect().is_some();
        let named_it = |t: &&Trial| matches!(t.outcome, Outcome::Right | Outcome::Extra);
        let says = |what: &str| format!("{what}, {}", world(nuisances));
        share(&says("a false name where nothing is hidden"), of(null).map(|t| !t.false_names.is_empty()));
        share(&says("`adequate` where nothing is hidden"), of(null).map(|t| t.answer == "adequate"));
        let is_told = |t: &Trial| t.task.planted == Planted::Nothing && t.verdict.is_some();
        let misfit = |t: &Trial| {
            t.false_names.is_empty() && matches!(t.verdict.as_deref(), Some("incomplete" | "unexplained"))
        };
        share(&says("a misfit and no false name where nothing is hidden"), of(is_told).map(misfit));
        share(&says("right and nothing else, of one effect"), of(due).map(|t| t.outcome == Outcome::Right));
        share(&says("what is hidden is named"), of(due).map(|t| named_it(&t)));
        share(&says("a false name, of one effect"), of(due).map(|t| !t.false_names.is_empty()));
    }
    let seconds: Vec<f64> = trials.iter().map(|t| t.seconds).collect();
    println!("| seconds for a diagnosis (median) | {:.0} | |", median(seconds));
    println!("\n| shape | null rooms with a false name | rooms with an effect: right |\n|---|---|---|");
    for shape in Polyhedron::ALL {
        let own: Vec<&Trial> = trials.iter().filter(|t| t.task.shape == shape).collect();
        let (null, rest): (Vec<&Trial>, Vec<&Trial>) =
            own.into_iter().partition(|t| t.task.planted == Planted::Nothing);
        println!(
            "| {} | {} of {} | {} of {} |",
            shape_name(shape),
            null.iter().filter(|t| !t.false_names.is_empty()).count(),
            null.len(),
            rest.iter().filter(|t| t.outcome == Outcome::Right).count(),
            rest.len()
        );
    }
    println!("\n| hidden | shape | world | seed | answer | p without a cause | decays left out (dB) |");
    println!("|---|---|---|---|---|---|---|");
    for t in trials.iter().filter(|t| t.outcome != Outcome::Right) {
        println!(
            "| {} | {} | {} | {} | {} | {:.2} | {} |",
            t.task.planted,
            shape_name(t.task.shape),
            world(t.task.nuisances),
            t.task.seed,
            t.answer,
            t.p_value,
            t.decay_db.map_or("-".into(), |[before, after]| format!("{before:.2} to {after:.2}")),
        );
    }
}

fn world(nuisances: bool) -> &'static str {
    if nuisances { "nuisances" } else { "plain" }
}
