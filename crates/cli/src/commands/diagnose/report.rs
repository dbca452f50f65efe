//! The page: what is wrong, how sure that is, what mending it gains, and what to measure next.

use super::bars::{self, Bar};
use super::findings::{Findings, Measured};
use super::residual_map::{self, ResidualMap};
use super::words::{
    Off, capital, effect, effect_of, headline, hertz, in_band, interval, meaning, named, number, off,
    parameter, plan_command, sentence,
};
use super::{held_out, laws, look_alikes, values};
use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use crate::page::{Page, escape};
use sabine::diagnose::{CandidateScore, Cause, DecayCurves, FitTest, FittedMaterial, ResidualCell};

type Result<T> = std::result::Result<T, Failure>;

/// Most positions whose decays are drawn: the page should stay below a few megabytes.
const MOST_POSITIONS: usize = 6;
/// Points of a drawn decay.
const DECAY_POINTS: usize = 60;
/// Lowest level of a drawn decay.
const DECAY_FLOOR_DB: f64 = -50.0;
/// Evidence that is owed to the chance of the rays is told from here on, in nats.
const WORTH_SAYING_NATS: f64 = 0.5;
/// 1.645 standard errors either side: a 90 % interval.
const NORMAL_90: f64 = 1.645;

/// Rows of the table of reflections, at most.
const MOST_ROWS: usize = 12;

/// The report as one HTML file, with a drawing of the room where what was found has a place.
pub fn html(findings: &Findings, drawing: Option<&str>) -> Result<String> {
    let mut page = Page::new("What the simulation gets wrong");
    page.markup(bars::STYLE);
    let Measured { responses, tables, receivers } = findings.measured;
    let counted = |count: usize, of: &str| format!("{count} {of}{}", if count == 1 { "" } else { "s" });
    page.paragraph(&format!(
        "The room \"{}\", simulated and compared with {} at {}.",
        std::path::Path::new(&findings.room)
            .file_name()
            .map_or(findings.room.clone(), |n| n.to_string_lossy().into_owned()),
        if tables == 0 {
            counted(responses, "measured response")
        } else {
            format!("tables of {}", counted(tables, "source-receiver pair"))
        },
        counted(receivers, "microphone position"),
    ));
    let told: String = meaning(findings).iter().map(|s| format!("<p>{}</p>", escape(s))).collect();
    page.markup(&format!(
        "<div class=\"verdict {}\"><strong>{}</strong>{told}</div>",
        findings.verdict,
        escape(&headline(findings))
    ));
    page.warnings(&findings.notes);
    next_measurements(&mut page, findings);
    parameters(&mut page, findings)?;
    laws::section(&mut page, findings)?;
    if let Some(drawing) = drawing {
        page.heading("Where to look in the room");
        page.markup(drawing);
        page.paragraph("The mesh as found is in extended_mesh.obj, in metres and z up, and with its materials in extended_mesh.glb (glTF).");
    }
    reflections(&mut page, findings);
    held_out::section(&mut page, findings);
    residuals(&mut page, findings)?;
    evidence(&mut page, findings);
    decays(&mut page, findings)?;
    values::section(&mut page, findings)?;
    materials(&mut page, findings)?;
    look_alikes::section(&mut page, findings);
    page.heading("Time taken");
    let mut times = vec![vec!["Stage".to_owned(), "Seconds".to_owned()]];
    times.extend(findings.seconds.iter().map(|(stage, s)| vec![stage.clone(), format!("{s:.2}")]));
    page.table(&times);
    Ok(page.html())
}

/// Reflections that came where the causes put them, as a person finds them in the files.
fn reflections(page: &mut Page, findings: &Findings) {
    let all = &findings.moved_reflections;
    if all.is_empty() {
        return;
    }
    page.heading("Reflections that tell it");
    page.paragraph(
        "At these times the files have a peak to which no reflection of the room as stated comes, and one of the room as found does. Places and latency are fitted in both; the farthest moved come first.",
    );
    let mut rows = vec![
        ["Response", "Reflections", "As stated, ms", "As found, ms", "Measured, ms"]
            .map(str::to_owned)
            .to_vec(),
    ];
    rows.extend(all.iter().take(MOST_ROWS).map(|one| {
        let order = if one.order > 0 { one.order.to_string() } else { "not known".to_owned() };
        let times = [one.stated_ms, one.found_ms, one.measured_ms].map(|ms| format!("{ms:.2}"));
        [one.response.clone(), order].into_iter().chain(times).collect()
    }));
    page.table(&rows);
    if all.len() > MOST_ROWS {
        page.paragraph(&format!("{} more are in diagnosis.json.", all.len() - MOST_ROWS));
    }
}

fn next_measurements(page: &mut Page, findings: &Findings) {
    if findings.would_decide.is_empty() {
        return;
    }
    page.heading("What to measure next");
    page.paragraph("This would decide between causes that look alike here:");
    let items: String =
        findings.would_decide.iter().map(|w| format!("<li>{}</li>", escape(&sentence(w)))).collect();
    page.markup(&format!("<ul>{items}</ul>"));
    let command = plan_command(findings, std::path::Path::new("diagnosis.json"));
    page.markup(&format!(
        "<p>Where microphones and sources should stand for that, and by how many nats each would decide: <code>{}</code>, in the folder of this page.</p>",
        escape(&command)
    ));
}

fn parameters(page: &mut Page, findings: &Findings) -> Result<()> {
    if findings.causes.is_empty() {
        return Ok(());
    }
    page.heading("What was found");
    for cause in &findings.causes {
        let sure = if cause.probability > 0.999 {
            "more than 99.9 %".to_owned()
        } else {
            format!("{:.1} %", 100.0 * cause.probability)
        };
        page.markup(&format!(
            "<p><strong>{}</strong>. {} Probability among everything that was tried: {sure}.{}{}</p>",
            escape(&named(cause)),
            escape(&cause.explanation),
            escape(&gain_sentence(cause)),
            escape(&rays_sentence(cause)),
        ));
        if let Some(chart) = band_chart(cause)? {
            page.markup(&format!("<div style=\"max-width:34rem\">{chart}</div>"));
        }
        if !cause.parameters.is_empty() {
            let mut rows = vec![["", "Most likely", "90 % between"].map(str::to_owned).to_vec()];
            rows.extend(cause.parameters.iter().map(|p| {
                let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
                vec![parameter(&p.name), number(p.value, p.high - p.low) + &unit, interval(p, "and")]
            }));
            page.table(&rows);
        }
    }
    if let Some(gain_db) = findings.common_gain_db {
        let side = if gain_db < 0.0 { "below" } else { "above" };
        page.paragraph(&format!(
            "The recording is {:.1} dB {side} the simulation throughout; the room file leaves that gain open, so it is no error.",
            gain_db.abs()
        ));
    }
    Ok(())
}

fn rays_sentence(cause: &Cause) -> String {
    let owed = cause.rays.as_ref().map(|rays| rays.owed_nats).filter(|owed| *owed > WORTH_SAYING_NATS);
    owed.map_or(String::new(), |owed| {
        format!(
            " Of its {:.0} nats of evidence up to {owed:.0} may come from the rays that happened to be drawn.",
            cause.nats
        )
    })
}

fn gain_sentence(cause: &Cause) -> String {
    let Some(gain) = &cause.held_out_gain else { return String::new() };
    let Off { what, unit, before, after } = off(gain);
    // What bears on times alone leaves decays as they are.
    let verdict = if (after - before).abs() < 0.005 {
        "are the same with and without it, which says nothing about it"
    } else if after < before {
        "come closer"
    } else {
        "do not come closer, which speaks against it"
    };
    format!(
        " At positions that the fit had not seen, {what} {verdict}: {before:.2} {unit} off before, {after:.2} {unit} after."
    )
}

/// Parameters that are one for each octave, as a curve.
fn band_chart(cause: &Cause) -> Result<Option<String>> {
    let found: Vec<_> = cause.parameters.iter().filter_map(|p| Some((in_band(&p.name)?, p))).collect();
    let Some(((stem, _), first)) = found.first() else { return Ok(None) };
    if found.len() < 3 || found.iter().any(|((other, _), _)| other != stem) {
        return Ok(None);
    }
    let points = found.iter().map(|((_, hz), p)| (*hz, p.value)).collect();
    let mut series = vec![Series::new("found (90 %)", Look::Dots, 1, points)];
    // Intervals at a bound are not symmetric about the value.
    series.extend(found.iter().map(|((_, hz), p)| {
        let mut interval = Series::new("", Look::Line, 1, vec![(*hz, p.low), (*hz, p.high)]);
        interval.in_legend = false;
        interval
    }));
    let unit = if first.unit.is_empty() { String::new() } else { format!(" ({})", first.unit) };
    let chart = Chart {
        x_label: "Band (Hz)".into(),
        y_label: capital(&stem.replace('_', " ")) + &unit,
        x: Scale::Octaves(found.iter().map(|((_, hz), _)| *hz).collect()),
        y: None,
        series,
        small: false,
    };
    chart.svg().map(Some)
}

fn residuals(page: &mut Page, findings: &Findings) -> Result<()> {
    if findings.residuals.is_empty() {
        return Ok(());
    }
    page.heading("Where it is wrong");
    let (full_db, end_s) = residual_map::scale(&findings.residuals);
    let of = |name: Option<&str>| -> Vec<&ResidualCell> {
        findings.residuals.iter().filter(|c| c.response.as_deref() == name).collect()
    };
    let map = |name: Option<&str>, after: bool, title: &str| {
        let cells = of(name);
        ResidualMap { cells, bands_hz: &findings.bands_hz, full_db, end_s, after }.svg(title)
    };
    page.markup(&format!(
        "<p>Measured less simulated level by band (upwards, in Hz) and time after the direct sound (to the right).</p><p class=\"key\">{full_db:.0} dB less<span class=\"scale\"></span>{full_db:.0} dB more measured than simulated; grey: not compared.</p>"
    ));
    let mean = of(None);
    if !mean.is_empty() {
        page.markup("<div class=\"grid\">");
        let maps = [(false, "Before: materials refitted only"), (true, "After: with what was found")];
        // Without a cause nothing comes after.
        for (after, name) in maps.into_iter().take(if findings.causes.is_empty() { 1 } else { 2 }) {
            let svg = map(None, after, name)?;
            let beyond = mean
                .iter()
                .filter(|c| if after { c.after_db } else { c.before_db }.abs() > 2.0 * c.expected_sd_db)
                .count();
            page.markup(&format!(
                "<section><figure><figcaption>{name}. Mean over positions; {:.0} % of the cells are off by more than twice what chance leaves (5 % would be).</figcaption>{svg}</figure></section>",
                100.0 * beyond as f64 / mean.len() as f64
            ));
        }
        page.markup("</div>");
    }
    let mut names: Vec<&str> = Vec::new();
    for name in findings.residuals.iter().filter_map(|c| c.response.as_deref()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    if names.is_empty() {
        return Ok(());
    }
    page.markup("<details><summary>Position by position</summary><div class=\"small\">");
    for name in names {
        let before = map(Some(name), false, name)?;
        let (told, after) = if findings.causes.is_empty() {
            ("", String::new())
        } else {
            (": before, after", map(Some(name), true, name)?)
        };
        page.markup(&format!(
            "<figure><figcaption>{}{told}</figcaption>{before}{after}</figure>",
            escape(name)
        ));
    }
    page.markup("</div></details>");
    Ok(())
}

fn evidence(page: &mut Page, findings: &Findings) {
    page.heading("What speaks for each cause");
    let fit = &findings.lack_of_fit;
    let threshold = findings.threshold_nats;
    let most = findings
        .candidates
        .iter()
        .flat_map(|c| [c.nats, c.nats_beside_causes.unwrap_or(0.0)])
        .chain([fit.discrepancy_nats, fit.discrepancy_nats_explained])
        .filter(|n| n.is_finite())
        .fold(2.0 * threshold, f64::max);
    // Evidence spans from a few nats to thousands.
    let share = |nats: f64| (1.0 + nats.max(0.0)).ln() / (1.0 + most).ln();
    page.markup(&format!(
        "<p>Evidence in nats (natural logarithm of the odds), long bars compressed. A cause is named beyond the upright line at {threshold:.1}, which allows for the number that was tried. <span class=\"key\"><i class=\"c0\"></i>on its own<i class=\"c1\"></i>beside what was found</span></p>"
    ));
    let bar = |colour: usize, nats: f64| Bar {
        colour,
        share: share(nats),
        interval: None,
        text: format!("{nats:.1}"),
    };
    let mut html = String::from("<div class=\"bars\">");
    let found: Vec<&str> = findings.causes.iter().map(|c| c.effect.as_str()).collect();
    let speaks = |c: &CandidateScore| c.nats > 0.0 || c.nats_beside_causes.is_some_and(|n| n > 0.0);
    let (some, none): (Vec<&CandidateScore>, Vec<_>) = findings.candidates.iter().partition(|c| speaks(c));
    for candidate in some {
        let is_named = found.contains(&candidate.effect.as_str());
        let name = effect_of(&candidate.effect, candidate.subject.as_deref());
        let label = if is_named { format!("✓ {name}") } else { name };
        let mut both = vec![bar(0, candidate.nats)];
        if !found.is_empty() {
            both.extend(candidate.nats_beside_causes.map(|nats| bar(1, nats)));
        }
        html += &bars::group(&label, &both, Some(share(threshold)));
    }
    let mut free = vec![bar(0, fit.discrepancy_nats)];
    if !found.is_empty() {
        free.push(bar(1, fit.discrepancy_nats_explained));
    }
    html += &bars::group("A smooth correction without a name, for comparison", &free, Some(share(threshold)));
    page.markup(&(html + "</div>"));
    if !none.is_empty() {
        let names: Vec<String> = none.iter().map(|c| effect(&c.effect)).collect();
        page.paragraph(&format!("Tried, and nothing speaks for: {}.", names.join("; ")));
    }
    tests(page, findings);
}

/// What the fit was tested for, the least probable first.
fn tests(page: &mut Page, findings: &Findings) {
    let mut tests: Vec<&FitTest> = findings.lack_of_fit.tests.iter().collect();
    tests.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    if tests.is_empty() {
        return;
    }
    let header = ["Tested for", "Most in", "Probability by chance"].map(str::to_owned).to_vec();
    let row = |test: &&FitTest| {
        let probability =
            if test.p_value < 1e-3 { "below 0.001".to_owned() } else { format!("{:.3}", test.p_value) };
        vec![capital(&test.name), test.subject.clone().unwrap_or_default(), probability]
    };
    let rows: Vec<Vec<String>> = std::iter::once(header).chain(tests.iter().map(row)).collect();
    page.markup("<details><summary>What the fit was tested for</summary>");
    page.paragraph(
        "Each way in which what is left could be more than chance. The smallest probability, times the number of tests, decides.",
    );
    page.table(&rows);
    page.markup("</details>");
}

fn decays(page: &mut Page, findings: &Findings) -> Result<()> {
    if findings.decays.is_empty() {
        return Ok(());
    }
    let mut names: Vec<&str> = Vec::new();
    for curves in &findings.decays {
        if !names.contains(&curves.response.as_str()) {
            names.push(&curves.response);
        }
    }
    let held = findings.decays.iter().any(|d| d.held_out);
    page.heading(if held { "Decays at positions that were predicted" } else { "Decays" });
    if names.len() > MOST_POSITIONS {
        page.paragraph(&format!("The first {MOST_POSITIONS} of {} are drawn.", names.len()));
        names.truncate(MOST_POSITIONS);
    }
    for (i, name) in names.iter().enumerate() {
        let open = if i == 0 { " open" } else { "" };
        page.markup(&format!("<details{open}><summary>{}</summary><div class=\"small\">", escape(name)));
        for curves in findings.decays.iter().filter(|d| d.response == *name) {
            let chart = decay_chart(curves).svg()?;
            page.markup(&format!(
                "<figure><figcaption>{}</figcaption>{chart}</figure>",
                hertz(curves.band_hz)
            ));
        }
        page.markup("</div></details>");
    }
    Ok(())
}

fn decay_chart(curves: &DecayCurves) -> Chart {
    let step = curves.time_s.len().div_ceil(DECAY_POINTS).max(1);
    let series = |name: &str, look, colour, level_db: &[f64]| {
        let points = curves.time_s.iter().copied().zip(level_db.iter().copied()).step_by(step);
        Series::new(name, look, colour, points.take_while(|p| p.1 > DECAY_FLOOR_DB).collect())
    };
    let all = vec![
        series("measured", Look::Line, 2, &curves.measured_db),
        series("before", Look::Dashed, 0, &curves.before_db),
        series("after", Look::Dashed, 1, &curves.after_db),
    ];
    let points = || all.iter().flat_map(|s| s.points.iter());
    let end_s = points().map(|p| p.0).fold(0.05, f64::max);
    let top_db = points().map(|p| p.1).fold(2.0, f64::max);
    Chart {
        x_label: "Time (s)".into(),
        y_label: "Level (dB)".into(),
        x: Scale::Linear(0.0, end_s),
        y: Some((DECAY_FLOOR_DB, top_db)),
        series: all,
        small: true,
    }
}

fn materials(page: &mut Page, findings: &Findings) -> Result<()> {
    if findings.materials.is_empty() {
        return Ok(());
    }
    page.heading("Absorption of each material");
    page.paragraph(
        "As the room file states it, as fitted without any cause, and as fitted with what was found. Left out, a cause ends up in the materials.",
    );
    let all = findings.materials.iter().flat_map(|(_, m)| [&m.stated, &m.absorption_before, &m.absorption]);
    let greatest = all.flatten().copied().filter(|a| a.is_finite()).fold(0.0, f64::max);
    let top = (5.0 * greatest).ceil().clamp(1.0, 5.0) / 5.0;
    page.markup("<div class=\"small\">");
    for (name, material) in &findings.materials {
        let chart = absorption_chart(&findings.bands_hz, material, top).svg()?;
        page.markup(&format!("<figure><figcaption>{}</figcaption>{chart}</figure>", escape(name)));
    }
    page.markup("</div>");
    Ok(())
}

fn absorption_chart(bands_hz: &[f64], material: &FittedMaterial, top: f64) -> Chart {
    let pairs = |values: &[f64]| bands_hz.iter().copied().zip(values.iter().copied()).collect();
    let mut after = Series::new("after", Look::Dots, 1, pairs(&material.absorption));
    after.half_widths = material.absorption_sd.iter().map(|sd| [NORMAL_90 * sd; 2].into()).collect();
    Chart {
        x_label: String::new(),
        y_label: String::new(),
        x: Scale::Octaves(bands_hz.to_vec()),
        y: Some((0.0, top)),
        series: vec![
            Series::new("stated", Look::Dashed, 2, pairs(&material.stated)),
            Series::new("before", Look::Line, 0, pairs(&material.absorption_before)),
            after,
        ],
        small: true,
    }
}
