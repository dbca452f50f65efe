//! Causes that the positions of this measurement cannot tell apart.

use super::findings::Findings;
use super::words::{effect, sentence};
use crate::page::{Page, escape};
use sabine::diagnose::Isolability;

/// The section on them.
pub fn section(page: &mut Page, findings: &Findings) {
    let mut alike: Vec<&Isolability> = findings.isolability.iter().filter(|i| !i.separable).collect();
    alike.sort_by(|a, b| b.cosine.total_cmp(&a.cosine));
    page.heading("What these positions cannot tell apart");
    if alike.is_empty() {
        page.paragraph("Any two of the causes that were tried leave different marks at these positions.");
        return;
    }
    page.paragraph(
        "Known from where the microphones stood alone, before the recordings were looked at. Where two causes leave the same marks, one found here may be the other.",
    );
    let concerns = |i: &&Isolability| {
        i.effects
            .iter()
            .any(|id| findings.causes.iter().any(|c| c.effect == *id) || findings.alternatives.contains(id))
    };
    let item = |i: &Isolability| {
        let decide = if i.would_decide.is_empty() {
            String::new()
        } else {
            format!(" To tell them apart: {}", sentence(&i.would_decide))
        };
        format!(
            "<li><strong>{}</strong> and <strong>{}</strong> (alike to {:.1} %).{}</li>",
            escape(&effect(&i.effects[0])),
            escape(&effect(&i.effects[1])),
            100.0 * i.cosine,
            escape(&decide)
        )
    };
    let (here, others): (Vec<&Isolability>, Vec<&Isolability>) = alike.into_iter().partition(concerns);
    let list = |all: &[&Isolability]| all.iter().map(|i| item(i)).collect::<String>();
    if !here.is_empty() {
        page.markup(&format!("<ul>{}</ul>", list(&here)));
    }
    if !others.is_empty() {
        page.markup(&format!(
            "<details{}><summary>{} pair{} that {} no part in this verdict</summary><ul>{}</ul></details>",
            if here.is_empty() { " open" } else { "" },
            others.len(),
            if others.len() == 1 { "" } else { "s" },
            if others.len() == 1 { "has" } else { "have" },
            list(&others)
        ));
    }
}
