//! Effects hidden in laboratory rooms, and what a diagnosis calls them.

use sabine::diagnose::{Diagnosis, Verdict};
use sabine::scene::TimeZero;
use sabine_testkit::{Hidden, Laboratory};

/// Seeds of two effects in one room lie so far apart.
const SEED_STEP: u64 = 7919;

/// Identifiers of effects as a list on the command line has them: `a+b` for two, `none` for nothing.
#[must_use]
pub fn effects(text: &str) -> Vec<String> {
    text.split('+').filter(|effect| *effect != "none").map(str::to_owned).collect()
}

/// Name of what is hidden, as a record has it.
#[must_use]
pub fn name(hidden: &[String]) -> String {
    if hidden.is_empty() { "none".to_owned() } else { hidden.join("+") }
}

/// What the room file has to say of the first sample where these effects are hidden: a recording that begins before the emission must say so.
#[must_use]
pub fn time_zero(hidden: &[String]) -> TimeZero {
    let early = hidden.iter().any(|id| id == "nonlinear_distortion");
    if early { TimeZero::Common } else { TimeZero::Emission }
}

/// Effects of a strength, each drawn from a seed of its own.
///
/// # Errors
/// As [`Hidden::random`].
pub fn hide(
    ids: &[String],
    strength: f64,
    lab: &Laboratory,
    seed: u64,
) -> Result<Vec<Hidden>, sabine::acoustics::Error> {
    ids.iter().zip(0..).map(|(id, k)| Hidden::random(id, strength, lab, seed + SEED_STEP * k)).collect()
}

/// Names of the causes found, each once, in alphabetical order.
#[must_use]
pub fn named(found: &Diagnosis) -> Vec<&str> {
    let mut named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    named.sort_unstable();
    named.dedup();
    named
}

/// The answer of a diagnosis as a record has it: the names, or the verdict where there are none.
#[must_use]
pub fn answer(found: &Diagnosis) -> String {
    match found.verdict {
        Verdict::Explained | Verdict::Incomplete | Verdict::Unconfirmed | Verdict::Law => {
            named(found).join(" + ")
        }
        Verdict::Ambiguous => {
            // The last cause stands for the set.
            let sure = found.causes.iter().rev().skip(1).map(|c| c.effect.clone());
            sure.chain([found.alternatives.join(" or ")]).collect::<Vec<_>>().join(" + ")
        }
        other => other.to_string(),
    }
}
