//! Laws that were searched for: what they say, how they were tried, and what is left without them against their covariate.

use super::findings::Findings;
use super::words::{interval, number};
use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use crate::page::{Page, escape};
use sabine::diagnose::{FoundLaw, LawPoint, VisibleLaw};

/// The section on them, where there was a search.
pub fn section(page: &mut Page, findings: &Findings) -> Result<(), Failure> {
    let Some(search) = &findings.law_search else { return Ok(()) };
    page.heading("The search for a law");
    if findings.laws.is_empty() {
        page.paragraph("No law is named beside the catalogue.");
    }
    for law in &findings.laws {
        let target = law.surface.as_ref().map_or(law.target.clone(), |s| format!("{} at {s}", law.target));
        page.markup(&format!(
            "<p>{}</p><p>In dB, on each {}: <code>{}</code></p>",
            escape(&law.words),
            escape(&target),
            escape(&law.formula)
        ));
        if let Some(chart) = chart(law) {
            let svg = chart.svg()?;
            page.markup(&format!("<div style=\"max-width:34rem\">{svg}</div><p class=\"key\">Mean over bins of like values, in the octaves in which the law is at least half as strong as at its strongest; with 90 % intervals.</p>"));
        }
        page.table(&rows(law));
        if !law.not_told_from.is_empty() {
            let items: String = law.not_told_from.iter().map(|l| format!("<li>{}</li>", escape(l))).collect();
            page.markup(&format!(
                "<details><summary>Formulas that do as well at these positions: {}</summary><ul>{items}</ul></details>",
                law.not_told_from.len()
            ));
        }
    }
    for fallen in &search.fallen {
        page.markup(&format!(
            "<p>Found, and not named: {}. {}.</p>",
            escape(&super::words::capital(&fallen.goes_with)),
            escape(&super::words::capital(&fallen.reason))
        ));
    }
    if findings.laws.is_empty() && !search.visible.is_empty() {
        page.paragraph(
            "What these positions would have shown: a law that is the same in all octaves and moves the decays by ten standard deviations, \
             everything taken out that a fit leaves open. In dB where its quantity is 1.",
        );
        page.table(&visible(&search.visible));
    }
    page.paragraph(&if search.vault.is_empty() {
        "Too few positions were measured to set any aside: six are needed.".to_owned()
    } else {
        format!("Set aside from the search, to confirm what it finds: {}.", search.vault.join(", "))
    });
    Ok(())
}

/// From which size on laws are visible.
fn visible(laws: &[VisibleLaw]) -> Vec<Vec<String>> {
    let row = |law: &VisibleLaw| {
        let db = law.from_db.map_or("not at all".to_owned(), |db| format!("from {db:.1} dB on"));
        vec![super::words::capital(&law.goes_with), db]
    };
    let head = vec!["A law by which".to_owned(), "is visible".to_owned()];
    std::iter::once(head).chain(laws.iter().map(row)).collect()
}

/// What is known of a law, as a table.
fn rows(law: &FoundLaw) -> Vec<Vec<String>> {
    let row = |name: &str, value: String| vec![name.to_owned(), value];
    let mut rows = vec![row("", String::new())];
    rows.extend(law.parameters.iter().filter(|p| p.high > p.low).map(|p| {
        let value = number(p.value, p.high - p.low);
        row(&p.name, format!("{value} {} (90 %: {})", p.unit, interval(p, "to")))
    }));
    rows.push(row("Evidence", format!("{:.1} nats", law.evidence_nats)));
    rows.push(row("Paid for being one formula of many", format!("{:.1} nats", law.prior_nats)));
    rows.push(row("As good by chance, any formula", format!("probability {:.4} at most", law.family_p)));
    if let Some(gain) = law.vault_gain_nats {
        rows.push(row("Gain at positions set aside", format!("{gain:.1} nats")));
    }
    if let Some(nats) = law.sham_nats {
        rows.push(row("Ahead of the best sham by", format!("{nats:.1} nats")));
    }
    rows
}

/// What is on the axis.
fn goes_with(law: &FoundLaw) -> &'static str {
    if law.formula.contains("recording_order") {
        "Number in the order of the recordings, from 0"
    } else if law.formula.contains("sin(w * file_time_s") {
        "Time since the emission (s)"
    } else {
        "What the law goes with (mean over the paths of a bin)"
    }
}

/// What is left without the law, and the law through it; the vault in another colour.
fn chart(law: &FoundLaw) -> Option<Chart> {
    let of = |vault: bool| law.points.iter().filter(move |p| p.vault == vault);
    let mut line: Vec<(f64, f64)> = law.points.iter().map(|p| (p.covariate, p.law_db)).collect();
    line.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (first, last) = (line.first()?.0, line.last()?.0);
    if last <= first {
        return None;
    }
    // Dots without a line between them: each is a series broken off.
    let dots = |name: &str, colour: usize, points: Vec<&LawPoint>| {
        let gap = (f64::NAN, f64::NAN);
        let mut series = Series::new(
            name,
            Look::Dots,
            colour,
            points.iter().flat_map(|p| [(p.covariate, p.left_db), gap]).collect(),
        );
        series.half_widths =
            points.iter().flat_map(|p| [(p.half_width_db, p.half_width_db), (0.0, 0.0)]).collect();
        series
    };
    let mut series = vec![Series::new("the law", Look::Line, 2, line)];
    series.push(dots("fitted positions", 0, of(false).collect()));
    if of(true).next().is_some() {
        series.push(dots("positions set aside", 1, of(true).collect()));
    }
    let margin = 0.03 * (last - first);
    Some(Chart {
        x_label: goes_with(law).into(),
        y_label: "Measured less simulated (dB)".into(),
        x: Scale::Linear(first - margin, last + margin),
        y: None,
        series,
        small: false,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use serde_json::json;

    #[test]
    fn the_axis_says_what_a_law_goes_with() {
        let label = |formula: &str| {
            let point = |covariate: f64| json!({"covariate": covariate, "left_db": 1.0, "half_width_db": 0.5, "law_db": 1.0, "vault": false});
            let law: FoundLaw = serde_json::from_value(json!({
                "id": "law", "target": "path", "formula": formula, "words": "", "parameters": [],
                "evidence_nats": 20.0, "prior_nats": 7.0, "family_p": 0.01, "points": [point(0.0), point(1.0)],
            }))
            .unwrap();
            chart(&law).unwrap().x_label
        };
        assert!(label("a * log2(1 + recording_order)").contains("order of the recordings"));
        assert!(label("-a * sin(w * file_time_s + p)").contains("Time"));
        assert!(label("a * length_m").contains("mean over the paths"));
    }
}
