//! The catalogue's identifiers in plain words.

use super::findings::Findings;
use sabine::diagnose::{Cause, FoundParameter, HeldOutGain, Verdict, catalogue, on_request};
use std::borrow::Cow;

/// Below this probability chance is not believed, as by default in the diagnosis.
const UNLIKELY: f64 = 0.01;

/// The title of an effect; one that is not in the catalogue is called by its identifier.
pub fn effect(id: &str) -> String {
    let all = catalogue().into_iter().chain(on_request());
    let title = all.map(|e| e.info()).find(|info| info.id == id).map(|info| info.title);
    title.map_or_else(|| id.replace('_', " "), Cow::into_owned)
}

/// An effect and what it concerns.
pub fn effect_of(id: &str, subject: Option<&str>) -> String {
    subject.map_or_else(|| effect(id), |subject| format!("{} ({subject})", effect(id)))
}

/// What a parameter is called: `gain_500_hz` is "gain at 500 Hz".
pub fn parameter(name: &str) -> String {
    match in_band(name) {
        Some((stem, hz)) => format!("{} at {}", stem.replace('_', " "), hertz(hz)),
        None => name.replace("_1_khz", " at 1 kHz").replace('_', " "),
    }
}

/// Stem and octave of a parameter that belongs to one.
pub fn in_band(name: &str) -> Option<(&str, f64)> {
    let rest = name.strip_suffix("_hz")?;
    let (stem, hz) = rest.rsplit_once('_')?;
    Some((stem, hz.parse().ok()?))
}

/// A frequency as people say it.
pub fn hertz(hz: f64) -> String {
    if hz < 1000.0 { format!("{hz} Hz") } else { format!("{} kHz", hz / 1000.0) }
}

/// The command that says where to measure next, and what that would decide; `file` is the diagnosis.
pub fn plan_command(findings: &Findings, file: &std::path::Path) -> String {
    // The demo is what a command takes that is given no room.
    let room = match findings.room.as_str() {
        demo if demo.starts_with("demo/") => String::new(),
        folder => format!(" --room {folder}"),
    };
    format!("sabine plan{room} --diagnosis {}", file.display())
}

/// What one place cannot say.
const ONE_PLACE: &str = "One place was measured: causes that bear on the decay everywhere fit it, and nothing confirms them. A response at a \
                         second place would.";

/// The verdict in a few words.
pub fn headline(findings: &Findings) -> String {
    let names: Vec<String> = findings.causes.iter().map(named).collect();
    match findings.verdict {
        Verdict::Adequate => "The simulation explains this measurement.".to_owned(),
        Verdict::Explained => format!("Found: {}.", names.join("; ")),
        Verdict::Incomplete => format!("Found, but not everything is explained: {}.", names.join("; ")),
        Verdict::Unconfirmed => {
            format!("Found at the one place measured, not confirmed: {}.", names.join("; "))
        }
        Verdict::Law => format!("A law that no catalogue lists: {}.", names.join("; ")),
        Verdict::Ambiguous => {
            format!(
                "Something is wrong, and this measurement cannot say which of {} causes it is.",
                set(findings).len()
            )
        }
        _ => "Something is wrong that none of the known causes explains.".to_owned(),
    }
}

/// The causes of which an ambiguous verdict cannot tell which one is at work.
fn set(findings: &Findings) -> Vec<&str> {
    let last = findings.causes.last().map(|cause| cause.effect.as_str());
    let others = findings.alternatives.iter().map(String::as_str).filter(|id| Some(*id) != last);
    last.into_iter().chain(others).collect()
}

/// A cause and what it concerns, or may concern.
pub fn named(cause: &Cause) -> String {
    let subjects: Vec<&str> = cause.subject.iter().chain(&cause.other_subjects).map(String::as_str).collect();
    effect_of(&cause.effect, (!subjects.is_empty()).then(|| subjects.join(" or ")).as_deref())
}

/// What the verdict means, sentence by sentence.
pub fn meaning(findings: &Findings) -> Vec<String> {
    let fit = &findings.lack_of_fit;
    let mut told = Vec::new();
    match findings.verdict {
        Verdict::Adequate => told.push(format!(
            "What is left between simulation and measurement is no more than chance leaves in such a measurement ({}). Nothing needs to be added.",
            p_value(fit.p_value)
        )),
        Verdict::Explained | Verdict::Incomplete | Verdict::Unconfirmed | Verdict::Law => {
            told.push(if fit.p_value < UNLIKELY {
                format!("Chance does not explain what was measured ({}).", p_value(fit.p_value))
            } else {
                format!(
                    "As a whole the misfit could be chance ({}), but with the following in the model the measurement becomes far more probable.",
                    p_value(fit.p_value)
                )
            });
            told.extend(findings.causes.iter().map(|c| c.explanation.clone()));
            told.extend(findings.laws.iter().map(|law| law.words.clone()));
            told.push(if fit.p_value_explained >= UNLIKELY {
                "With that in the model, what is left is no more than chance.".to_owned()
            } else {
                let doubt = if findings.verdict == Verdict::Explained {
                    ""
                } else {
                    ": what is named may stand in for what is missing"
                };
                format!(
                    "With that in the model the fit is better, but not everything is explained ({}){doubt}.",
                    p_value(fit.p_value_explained)
                )
            });
            if findings.verdict == Verdict::Unconfirmed {
                told.push(ONE_PLACE.to_owned());
            }
        }
        Verdict::Ambiguous => {
            if let Some((last, sure)) = findings.causes.split_last() {
                if !sure.is_empty() {
                    let names: Vec<String> = sure.iter().map(named).collect();
                    let known = if findings.held_out.is_none() { "Found" } else { "Sure" };
                    told.push(format!("{known}: {}.", names.join("; ")));
                }
                told.push(format!("Most likely, but not for sure: {}.", named(last)));
            }
            let names: Vec<String> = set(findings).into_iter().map(effect).collect();
            told.push(format!("Each of these would look the same here: {}.", names.join("; ")));
            if findings.held_out.is_none() && findings.causes.len() > 1 {
                told.push(ONE_PLACE.to_owned());
            }
        }
        _ => {
            told.push(if fit.p_value_explained < UNLIKELY {
                let chance = p_value(fit.p_value_explained);
                format!("Chance does not explain what was measured ({chance}).")
            } else {
                "A correction without a name explains it far better than any cause that was tried.".to_owned()
            });
            if !findings.causes.is_empty() {
                let names: Vec<String> = findings.causes.iter().map(named).collect();
                told.push(format!("This was found, and does not suffice: {}.", names.join("; ")));
            }
            // Formulas are weighed by bins, which tables do not have.
            if findings.measured.tables == 0 {
                told.push(
                    if findings.law_search.is_some() {
                        "A formula beyond the list of causes was looked for, and none stands; the report says how strong one would have to be."
                    } else {
                        "The option --discover looks for a formula that no list of causes has."
                    }
                    .to_owned(),
                );
            }
        }
    }
    let slight: Vec<String> = findings.causes.iter().filter(|c| c.slight).map(named).collect();
    if !slight.is_empty() {
        told.push(format!(
            "Slight: {}. Decays at positions not seen come less than 3 % and 1 dB nearer; simulations by different programs differ by more.",
            slight.join("; ")
        ));
    }
    let failed: Vec<String> = fit
        .tests
        .iter()
        .filter(|t| t.p_value < UNLIKELY)
        .map(|t| t.subject.as_ref().map_or_else(|| t.name.clone(), |at| format!("{} (most: {at})", t.name)))
        .collect();
    if !failed.is_empty() && fit.p_value_explained < UNLIKELY {
        told.push(format!("What chance does not explain: {}.", failed.join("; ")));
    }
    if findings.verdict != Verdict::Adequate {
        told.extend(worst_place(findings, findings.verdict == Verdict::Unexplained));
    }
    told
}

fn p_value(p: f64) -> String {
    if p < 1e-3 {
        "less than 1 chance in 1000".to_owned()
    } else {
        let digits = if p < UNLIKELY { 3 } else { 2 };
        format!("a misfit as large comes by chance with probability {p:.digits$}")
    }
}

/// Where the mean residual stands out most.
fn worst_place(findings: &Findings, after: bool) -> Option<String> {
    let mean = findings.residuals.iter().filter(|c| c.response.is_none() && c.expected_sd_db > 0.0);
    let value = |c: &sabine::diagnose::ResidualCell| if after { c.after_db } else { c.before_db };
    let strength = |c: &sabine::diagnose::ResidualCell| (value(c) / c.expected_sd_db).abs();
    let worst =
        mean.filter(|c| strength(c).is_finite()).max_by(|a, b| strength(a).total_cmp(&strength(b)))?;
    let louder = if value(worst) > 0.0 { "louder" } else { "quieter" };
    Some(format!(
        "It shows most at {}, {:.0} ms after the direct sound: the measurement is {:.1} dB {louder} there than the simulation{}.",
        hertz(worst.band_hz),
        1e3 * worst.time_s,
        value(worst).abs(),
        if after { "" } else { " without it" },
    ))
}

/// How far a cause brings what was measured at positions that no fit has seen.
pub struct Off {
    pub what: &'static str,
    pub unit: &'static str,
    pub before: f64,
    pub after: f64,
}

/// Of decay curves in dB, of the values of tables in just-noticeable differences.
pub fn off(gain: &HeldOutGain) -> Off {
    match gain.values_jnd {
        Some([before, after]) => Off { what: "values of the tables", unit: "JND", before, after },
        None => {
            let (before, after) = (gain.db_rmse_before, gain.db_rmse_after);
            Off { what: "decay curves", unit: "dB", before, after }
        }
    }
}

/// As many figures as an interval of such a width warrants; to a thousandth where there is none.
pub fn number(value: f64, width: f64) -> String {
    let size = if width > 1e-9 { 0.5 * width } else { 0.01 };
    let decimals = (1.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

/// The 90 % interval of a parameter in words: a coordinate that the room file states has none.
pub fn interval(p: &FoundParameter, between: &str) -> String {
    let width = p.high - p.low;
    if width > 1e-9 {
        format!("{} {between} {}", number(p.low, width), number(p.high, width))
    } else {
        "as stated".to_owned()
    }
}

/// With a capital at its beginning and a full stop at its end.
pub fn sentence(text: &str) -> String {
    let text = capital(text.trim());
    if text.ends_with(['.', '!', '?']) { text } else { text + "." }
}

/// With a capital at its beginning.
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_told_with_their_octave() {
        assert_eq!(parameter("gain_62.5_hz"), "gain at 62.5 Hz");
        assert_eq!(parameter("level_4000_hz"), "level at 4 kHz");
        assert_eq!(parameter("level_1_khz"), "level at 1 kHz");
        assert_eq!(parameter("temperature"), "temperature");
        assert_eq!(effect_of("some_new_effect", Some("r1")), "some new effect (r1)");
    }

    #[test]
    fn figures_follow_the_interval() {
        assert_eq!(number(2.5271, 1.2), "2.53");
        assert_eq!(number(-0.6, 1.2), "-0.60");
        assert_eq!(number(1234.5, 300.0), "1234");
        assert_eq!(number(0.01234, 0.002), "0.0123");
        assert_eq!(number(5.965, 0.0), "5.965");
    }
}
