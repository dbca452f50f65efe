//! The page: the floor with the places chosen, what each measurement would decide, and how large effects must be.

use super::{decided, floor, size};
use crate::commands::diagnose::words;
use crate::page::{Page, escape};
use sabine::diagnose::{Decision, Plan};
use sabine::scene::MeasuredRoom;

/// Measurements in the table.
const MAX_ROWS: usize = 25;

/// The plan as one HTML file.
pub fn html(room: &MeasuredRoom, name: &str, plan: &Plan) -> String {
    let mut page = Page::new("Which measurement decides");
    let name =
        std::path::Path::new(name).file_name().map_or(name.to_owned(), |n| n.to_string_lossy().into_owned());
    page.paragraph(&format!("The room \"{name}\". {}", asked(plan)));
    page.paragraph(if plan.question.is_some() {
        "A nat is a unit of evidence: three nats are odds of 20 to 1. What is expected is the mean over whichever of the causes is true, everything else (absorption, gains, places) being fitted again. It is a mean: chance adds or takes a few nats."
    } else {
        "Nats say how much is learned of the size of each cause by itself, everything else (absorption, gains, places) being fitted, added up over all causes of the catalogue."
    });
    page.heading("Where to measure");
    page.markup(&format!("<div style=\"max-width:48rem\">{}</div>", floor::svg(room, plan)));
    chosen(&mut page, plan);
    weighed(&mut page, plan);
    sizes(&mut page, plan);
    look_alikes(&mut page, plan);
    if !plan.not_planned.is_empty() {
        let names: Vec<String> = plan.not_planned.iter().map(|id| words::effect(id)).collect();
        page.heading("What no plan shows");
        page.paragraph(&format!(
            "These are found in single channels, in peaks that nothing predicted explains, in waves or before the direct sound; their sizes are not predicted here: {}.",
            names.join("; ")
        ));
    }
    page.heading("Time taken");
    let mut times = vec![vec!["Stage".to_owned(), "Seconds".to_owned()]];
    times.extend(plan.seconds.iter().map(|(stage, s)| vec![stage.clone(), format!("{s:.2}")]));
    page.table(&times);
    page.html()
}

fn asked(plan: &Plan) -> String {
    match &plan.question {
        Some(question) => {
            let names: Vec<String> = question.leading.iter().map(|h| decided(&h.to_string())).collect();
            format!("After its diagnosis the question is which of these is the cause: {}.", names.join("; "))
        }
        None if plan.stated_responses == 0 => "Nothing stands in it yet but the sources.".to_owned(),
        None => format!(
            "No diagnosis is given: the plan is for all causes of the catalogue, beside the {} responses that the room file has or its places give.",
            plan.stated_responses
        ),
    }
}

fn told(decides: &[Decision]) -> String {
    let one = |d: &Decision| format!("{} ({:.1})", decided(&d.what), d.nats);
    decides.iter().map(one).collect::<Vec<_>>().join("; ")
}

fn chosen(page: &mut Page, plan: &Plan) {
    if plan.chosen.is_empty() {
        return;
    }
    page.paragraph("Chosen one after the other, each for what it adds to those before:");
    let items: String = plan
        .chosen
        .iter()
        .map(|c| {
            format!(
                "<li><strong>{}</strong>: {:.1} nats more. {}</li>",
                escape(&plan.candidates[c.candidate].measurement.to_string()),
                c.adds_nats,
                escape(&told(&c.decides))
            )
        })
        .collect();
    page.markup(&format!("<ol>{items}</ol>"));
}

fn weighed(page: &mut Page, plan: &Plan) {
    page.heading("One measurement more");
    let mut rows = vec![
        ["Measurement", "Nats", "Minutes", "Nats per minute", "On materials (nats)", "Decides most"]
            .map(str::to_owned)
            .to_vec(),
    ];
    rows.extend(plan.candidates.iter().take(MAX_ROWS).map(|c| {
        vec![
            c.measurement.to_string(),
            format!("{:.2}", c.nats),
            format!("{:.1}", c.minutes),
            format!("{:.3}", c.nats_per_minute),
            format!("{:.2}", c.material_nats),
            told(&c.decides[..c.decides.len().min(2)]),
        ]
    }));
    page.table(&rows);
    if plan.candidates.len() > MAX_ROWS {
        let left = plan.candidates.len() - MAX_ROWS;
        page.paragraph(&format!("{left} more, with fewer nats, are in plan.json."));
    }
}

fn sizes(page: &mut Page, plan: &Plan) {
    page.heading("How large a cause must be to be named");
    page.paragraph(
        "From this size on its evidence is expected to reach a name: as the room file stands, and with the chosen measurements as well. d' is a plain size in standard deviations of what is found of it.",
    );
    let mut rows = vec![
        [
            "Cause",
            "Parameter",
            "Named from, as stated",
            "with those chosen",
            "Plain size",
            "its d' as stated",
            "with those chosen",
        ]
        .map(str::to_owned)
        .to_vec(),
    ];
    rows.extend(plan.effects.iter().map(|e| {
        vec![
            words::effect_of(&e.effect, e.subject.as_deref()),
            words::parameter(&e.parameter),
            size(e, e.named_from[0]),
            size(e, e.named_from[1]),
            size(e, e.typical),
            format!("{:.1}", e.d_prime[0]),
            format!("{:.1}", e.d_prime[1]),
        ]
    }));
    page.table(&rows);
}

fn look_alikes(page: &mut Page, plan: &Plan) {
    if plan.look_alikes.is_empty() {
        return;
    }
    page.heading("Causes that look alike");
    page.paragraph(
        "The cosine of the angle between what two causes do to the data, all else refitted: 1 for twins. Above 0.95 they are hard to tell apart.",
    );
    let cosine = |c: Option<f64>| c.map_or_else(|| "-".to_owned(), |c| format!("{c:.3}"));
    let mut rows = vec![["Causes", "As stated", "With those chosen"].map(str::to_owned).to_vec()];
    rows.extend(plan.look_alikes.iter().map(|l| {
        let names = l.effects.iter().map(|id| words::effect(id)).collect::<Vec<_>>();
        vec![names.join(" / "), cosine(l.cosine), cosine(l.cosine_planned)]
    }));
    page.table(&rows);
}
