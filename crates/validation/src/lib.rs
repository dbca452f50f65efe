//! The programs behind the tables of `docs/validation`: how often hidden effects are found, how well materials are fitted, what is
//! rendered from speech in real rooms, whether memory stays flat. Not published; run them with `cargo run --release -p sabine-validation --bin NAME`.

pub mod absorption;
pub mod comparison;
pub mod heard;
pub mod hiding;
pub mod models;
pub mod record;
pub mod room_tasks;

use std::fmt::Display;
use std::process::ExitCode;

/// Any error; what it says is printed.
pub type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// How a program ends; an error is printed.
#[must_use]
pub fn exit_code(ended: Result<(), impl Display>) -> ExitCode {
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// `K/N`, K from 1 to N: which part of the work a process does.
///
/// # Errors
/// A sentence, for what is no such text.
pub fn part(text: &str) -> Result<(usize, usize), String> {
    let (first, each) = text.split_once('/').ok_or("a part is written 1/4")?;
    let parse = |number: &str| number.parse::<usize>().map_err(|error| format!("{number}: {error}"));
    match (parse(first)?, parse(each)?) {
        (first, each) if (1..=each).contains(&first) => Ok((first, each)),
        (first, each) => Err(format!("part {first} of {each} does not exist")),
    }
}

/// The median; the upper of two in the middle.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Prints a row of a table: how many of all, and their exact 95 % interval; nothing where there are none.
pub fn print_share(what: &str, hits: impl Iterator<Item = bool>) {
    let hits: Vec<bool> = hits.collect();
    if hits.is_empty() {
        return;
    }
    let count = hits.iter().filter(|h| **h).count();
    let (low, high) = exact_interval(count, hits.len());
    let percent = 100.0 * count as f64 / hits.len() as f64;
    let (low, high) = (100.0 * low, 100.0 * high);
    println!("| {what} | {count} of {} ({percent:.0} %) | {low:.0}-{high:.0} % |", hits.len());
}

/// Exact 95 % interval of a share (Clopper and Pearson, Biometrika 26, 1934): no smaller and no larger true share would leave so many, or so
/// few, hits to chance.
#[must_use]
pub fn exact_interval(hits: usize, count: usize) -> (f64, f64) {
    // Probability of at least `least` hits.
    let tail = |share: f64, least: usize| -> f64 {
        let mut ln_choose = 0.0;
        let mut sum = 0.0;
        for k in 0..=count {
            if k > 0 {
                ln_choose += ((count - k + 1) as f64 / k as f64).ln();
            }
            if k >= least {
                let (more, less) = (k as f64 * share.ln(), (count - k) as f64 * (1.0 - share).ln());
                sum += (ln_choose + more + less).exp();
            }
        }
        sum
    };
    let bisect = |above: &dyn Fn(f64) -> bool| {
        let (mut low, mut high) = (1e-12, 1.0 - 1e-12);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if above(middle) { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    };
    let low = if hits == 0 { 0.0 } else { bisect(&|share| tail(share, hits) > 0.025) };
    let high = if hits == count { 1.0 } else { bisect(&|share| 1.0 - tail(share, hits + 1) < 0.025) };
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_the_tables() {
        // 1 - 0.025^(1/n) for none of n; the others from tables of the beta distribution.
        for (hits, count, low, high) in
            [(0, 8, 0.0, 0.3694), (16, 16, 0.7941, 1.0), (13, 16, 0.5435, 0.9595), (1, 20, 0.0013, 0.2487)]
        {
            let found = exact_interval(hits, count);
            assert!(
                (found.0 - low).abs() < 1e-3 && (found.1 - high).abs() < 1e-3,
                "{hits}/{count}: {found:?}"
            );
        }
    }
}
