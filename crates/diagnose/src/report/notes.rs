//! What must be said beside the verdict.

use crate::infer::baseline::Baseline;
use crate::infer::confirmation::Doubt;
use crate::report::diagnosis::Verdict;

/// What the words depend on.
pub(crate) struct Circumstances<'a> {
    pub baseline: &'a Baseline,
    pub verdict: Verdict,
    /// Whether positions could be held out.
    pub held_out: bool,
    /// Whether all fits came to rest.
    pub converged: bool,
    /// Whether chance does not explain what the causes leave.
    pub misfit_left: bool,
    pub hopeless: bool,
    /// Whether decays are predicted without the sound that a cause adds.
    pub without_added: bool,
    /// Whether bins scatter far more than they should.
    pub scattered: bool,
    /// Causes that a discrepancy without a name beats.
    pub unseated: &'a [String],
    /// Causes for which the data speak and that are not named, and why.
    pub dropped: &'a [(&'a str, &'a Doubt)],
    /// Whether as many causes are named as may be, and the effects that the data speak for beside them, or else beside a set.
    pub not_sought: (bool, &'a [&'a str]),
    /// How far single responses drift along their decay where it is much, in dB, and in which octave.
    pub drift: Option<(f64, f64)>,
    /// The responses' own levels by octave, where they scatter farther than chance lets them: root mean square in dB, and the response
    /// and octave of the largest.
    pub levels: Option<(f64, String)>,
    /// Selection causes, and their parameters that stand at the end of their range.
    pub at_bounds: &'a [(&'a str, Vec<String>)],
}

/// What tables do not hold.
const OF_TABLES: &str = "Tables of parameters were compared: they hold no arrival times and no levels, so that wrong positions, moved walls, \
                         gains and noise cannot show, and no law beyond the catalogue is looked for. Responses tell more.";

pub(crate) fn notes(about: &Circumstances<'_>) -> Vec<String> {
    let mut notes = about.baseline.observations.notes.clone();
    if about.baseline.survey().air_assumed {
        notes.push("The room file states no climate: 20 degrees and 50 % humidity were assumed.".into());
    }
    let are_tables = about.baseline.observations.are_tables();
    if about.baseline.survey().responses.len() == 1 {
        let one = if are_tables { "pair" } else { "response" };
        notes.push(format!(
            "One {one} only: what is the same at every position cannot be told from what is not."
        ));
    }
    if !about.held_out {
        notes.push("Too few receivers to hold any out: no gain at new positions can be given.".into());
    }
    if about.hopeless {
        notes.push(
                "The simulation could not be fitted to these responses at all: stated materials, places or mesh may be far off. No \
                 cause is named."
                    .into(),
            );
    } else if !about.unseated.is_empty() {
        notes.push(format!(
                "{} would help, but a smooth discrepancy without a name explains more: the cause is not in the catalogue.",
                about.unseated.join(" and ")
            ));
    }
    if !about.converged {
        notes.push("A fit had not come to rest after its last step: take its figures with caution.".into());
    }
    if matches!(about.verdict, Verdict::Incomplete | Verdict::Unconfirmed) && about.misfit_left {
        notes.push("A significant misfit is left that none of the named causes explains: one of them may stand in for what is missing.".into());
    }
    if about.misfit_left && about.without_added {
        notes.push(
            "Decays are predicted without the sound that the surface which was found adds: what chance does not explain of them may be that."
                .into(),
        );
    }
    if let Some((rms_db, largest)) = &about.levels {
        notes.push(format!(
            "Levels of single responses by octave lie {rms_db:.1} dB from the prediction (root mean square), farther than chance \
             moves them; farthest in {largest}."
        ));
    }
    for (effect, parameters) in about.at_bounds {
        notes.push(format!(
            "{effect}: the end of the range that is allowed is reached by {}. More than this effect may be at work.",
            parameters.join(" and ")
        ));
    }
    if are_tables {
        notes.push(OF_TABLES.into());
    }
    if !are_tables && about.baseline.simulation.arrivals.iter().any(Vec::is_empty) {
        notes.push("Where the direct line is blocked, arrival times are not compared.".into());
    }
    if about.scattered && about.verdict == Verdict::Unexplained {
        notes.push("The responses scatter far more than this room would: are they of another room?".into());
    }
    for (id, doubt) in about.dropped {
        notes.push(format!("{id} {}: it is not named.", why_not(doubt)));
    }
    let (most, more) = about.not_sought;
    if !more.is_empty() {
        let ended = if most {
            format!(
                "No more than {0} causes of decays and {0} others are named",
                about.baseline.config.most_causes
            )
        } else {
            "The search ended at causes that cannot be told apart".to_owned()
        };
        notes.push(format!("{ended}; beside them the data speak for {}, too.", more.join(", ")));
    }
    if let Some((db, hz)) = about.drift {
        notes.push(format!(
            "Single responses run above and below the simulation along their decay, each in its own way, most at {hz} Hz ({db:.1} dB, \
             standard deviation). Reflections that keep their phase do so, between parallel walls above all: no cause is sought for it."
        ));
    }
    notes
}

/// Why a cause for which the data speak is not named, to follow its name.
fn why_not(doubt: &Doubt) -> String {
    match doubt {
        Doubt::Elsewhere => {
            "fits the positions that it was fitted to, but does not help to predict those left out".to_owned()
        }
        Doubt::Decays => "brings decays nearer by more than it takes off the tables, so that something else may be at work".into(),
        Doubt::Modes => "would explain the lowest octaves alone, where few room modes decide and no simulation is that exact".into(),
        Doubt::Rays(rays) => {
            let quarters: Vec<String> =
                rays.decay_nats_of_quarters.iter().map(|nats| format!("{nats:.0}")).collect();
            format!(
                "owes too much of its evidence to the rays that happened to be drawn ({:.0} nats by all of them, {} by each quarter: up to \
                 {:.0} may be theirs), and so many rays do not settle it, try more (`rays`)",
                rays.decay_nats,
                quarters.join(", "),
                rays.owed_nats
            )
        }
        Doubt::Misfit => {
            "makes the simulation fail less, but more speaks against what is left than for it (`lack_of_fit`)".into()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::diagnosis::RayDependence;

    #[test]
    fn a_name_that_rays_do_not_confirm_falls_with_its_figures() {
        let rays =
            RayDependence { owed_nats: 38.4, ..RayDependence::new(43.2, vec![85.0, 34.1, 0.4, 53.0], 0.01) };
        let why = why_not(&Doubt::Rays(rays));
        assert!(
            why.contains("(43 nats by all of them, 85, 34, 0, 53 by each quarter: up to 38 may be theirs)"),
            "{why}"
        );
    }
}
