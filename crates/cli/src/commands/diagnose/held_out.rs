//! How well positions are predicted that were not fitted.

use super::bars::{self, Bar};
use super::findings::Findings;
use crate::page::Page;
use sabine::diagnose::HeldOut;

/// An interval over fewer positions says little.
const FEW: usize = 4;
/// What positions are predicted by, in the order of the figures.
const PREDICTIONS: [&str; 3] = ["Materials refitted only", "With what was found", "Free, unnamed correction"];

/// The section on it.
pub fn section(page: &mut Page, findings: &Findings) {
    let is_named = !findings.causes.is_empty();
    page.heading(if is_named { "What mending it gains" } else { "How well new positions are predicted" });
    let Some(held) = &findings.held_out else {
        page.paragraph(
            "There are too few microphone positions to hold any out. What is said here was fitted and judged on the same data, so it says what fits, not yet what predicts. Two or more positions would allow the test.",
        );
        return;
    };
    page.paragraph(&format!(
        "Each microphone position was predicted {}: {}.",
        if held.never_fitted {
            "without ever having been fitted, as you asked"
        } else {
            "from all the others"
        },
        held.receivers.join(", ")
    ));
    if held.receivers.len() < FEW {
        page.paragraph(
            "These are few positions: what is gained at them need not be gained elsewhere, and the intervals below are not to be relied on. Four or more would tell.",
        );
    }
    // Without a cause the second would repeat the first.
    let shown: &[usize] = if findings.causes.is_empty() { &[0, 2] } else { &[0, 1, 2] };
    page.markup(&held_out_bars(held, shown));
    if held.values_jnd.is_none() {
        let told = |x: f64| if x.is_finite() { format!("{x:.1}") } else { "-".to_owned() };
        let [t20, c50] = [held.t20_jnd, held.c50_jnd].map(|v| v.map(told));
        page.markup(
            "<p class=\"key\">Mean error in steps that are just noticeable (5 % of T20, 1 dB of C50)</p>",
        );
        let mut rows = vec![["", "T20", "C50"].map(str::to_owned).to_vec()];
        for &i in shown {
            rows.push(vec![PREDICTIONS[i].to_owned(), t20[i].clone(), c50[i].clone()]);
        }
        page.table(&rows);
    }
    page.paragraph(if !is_named {
        "The free correction may bend every band and time as it likes and explains nothing. Where it does much better than the simulation, something is missing."
    } else {
        "The free correction may bend every band and time as it likes and explains nothing. Named causes that do as well as it have found what is wrong; where it does better, something is missing."
    });
}

fn held_out_bars(held: &HeldOut, shown: &[usize]) -> String {
    let (what, unit, errors) = match held.values_jnd {
        Some(errors) => {
            ("predicted values of the tables, root mean square in just-noticeable differences", "JND", errors)
        }
        None => ("predicted decay curves", "dB", held.db_rmse),
    };
    let most = errors.iter().copied().fold(0.1, f64::max);
    let mut html = format!("<div class=\"bars\"><p class=\"key\">Error of {what} (shorter is better)</p>");
    for &i in shown {
        let text = format!("{:.2} {unit}", errors[i]);
        let bar = Bar { colour: i, share: errors[i] / most, interval: None, text };
        html += &bars::group(PREDICTIONS[i], &[bar], None);
    }
    html += "<p class=\"key\">Gain in predicting them, over materials refitted only (longer is better; line: 90 % interval over positions)</p>";
    let ends = held.nats_interval.iter().flatten().chain(&held.nats_per_bin);
    let most = ends.copied().filter(|end| end.is_finite()).fold(1e-3, f64::max);
    for &i in &shown[1..] {
        let (nats, [low, high]) = (held.nats_per_bin[i - 1], held.nats_interval[i - 1]);
        let known = low.is_finite() && high.is_finite();
        let bar = Bar {
            colour: i,
            share: nats / most,
            interval: known.then_some((low / most, high / most)),
            text: format!("{nats:.3}"),
        };
        let interval =
            if known { format!("{low:.3} to {high:.3}") } else { "one position has no interval".to_owned() };
        html += &bars::group(&format!("{} ({interval})", PREDICTIONS[i]), &[bar], None);
    }
    let each = if held.values_jnd.is_some() { "value of the tables" } else { "compared time bin" };
    html + &format!("<p class=\"key\">In nats for each {each}: 0.7 means twice as probable.</p></div>")
}
