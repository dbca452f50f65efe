//! A line of the record.

use crate::true_model::Statement;
use sabine_validation::comparison::Gain;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Share of what the true model gains that the model found must reach.
pub const LEAST_SHARE: f64 = 0.8;
/// The true model says something of fresh positions if its gain is so many standard errors above zero.
const TELLING_ERRORS: f64 = 2.0;
/// Nor is a gain below this of interest, in nats for each level or arrival.
const LEAST_NATS: f64 = 0.005;

/// What models are judged by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JudgedBy {
    /// Levels of decays at fresh positions.
    Decays,
    /// Arrivals of the direct sound at fresh positions.
    Arrivals,
    /// Both of them.
    Both,
    /// Fresh positions tell nothing: the numbers of the changes against the true ones.
    Changes,
    /// Nothing: the true model cannot be stated, or gains nothing and has no numbers to compare.
    Nothing,
}

/// A room.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trial {
    pub hidden: String,
    pub strength: f64,
    pub seed: u64,
    pub rays: usize,
    /// What the diagnosis of eight positions says.
    pub answer: String,
    /// Whether just what is hidden is named.
    pub right: bool,
    pub statement: Statement,
    /// What of the true model cannot be stated, and why.
    pub left_out: String,
    /// Levels compared at twelve fresh positions.
    pub levels: usize,
    /// Gain over the room as stated, in nats for each level: of the model found and of the true one, with their standard errors.
    pub decay_nats_found: f64,
    pub decay_nats_true: f64,
    pub decay_nats_found_error: f64,
    pub decay_nats_true_error: f64,
    /// The same of arrivals, in nats for each.
    pub arrival_nats_found: f64,
    pub arrival_nats_true: f64,
    pub arrival_nats_found_error: f64,
    pub arrival_nats_true_error: f64,
    /// Root mean square error of decay curves at fresh positions in dB: as stated, as found, true.
    pub curve_db_stated: f64,
    pub curve_db_found: f64,
    pub curve_db_true: f64,
    /// The same of arrivals, in microseconds.
    pub arrival_us_stated: f64,
    pub arrival_us_found: f64,
    pub arrival_us_true: f64,
    /// One less the distance of the changes found from the true ones, relative to that of none; where they can be compared.
    pub captured: Option<f64>,
    pub judged_by: JudgedBy,
    /// Whether the model found does as well as the true one within a fifth; none where there is nothing to judge by.
    pub passed: Option<bool>,
    pub seconds: f64,
}

/// How the model found is judged, and whether it does.
pub fn judged(
    statement: Statement,
    decays: [Gain; 2],
    arrivals: [Gain; 2],
    captured: Option<f64>,
) -> (JudgedBy, Option<bool>) {
    if statement == Statement::NotStated {
        return (JudgedBy::Nothing, None);
    }
    let tells = |[_, truth]: [Gain; 2]| truth.nats > (TELLING_ERRORS * truth.standard_error).max(LEAST_NATS);
    let does = |[found, truth]: [Gain; 2]| found.nats >= LEAST_SHARE * truth.nats;
    match (tells(decays), tells(arrivals)) {
        (true, true) => (JudgedBy::Both, Some(does(decays) && does(arrivals))),
        (true, false) => (JudgedBy::Decays, Some(does(decays))),
        (false, true) => (JudgedBy::Arrivals, Some(does(arrivals))),
        (false, false) => match captured {
            Some(captured) => (JudgedBy::Changes, Some(captured >= LEAST_SHARE)),
            None => (JudgedBy::Nothing, None),
        },
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let passed = match self.passed {
            Some(true) => "as well as the true model",
            Some(false) => "NOT as well as the true model",
            None => "not judged",
        };
        write!(
            f,
            "{} seed {}: {}; decays {:.3} of {:.3} nats, {:.2} / {:.2} / {:.2} dB; arrivals {:.2} of {:.2} nats, {:.0} / {:.0} / {:.0} us; captured {:.2}; by {:?}: {passed}; {:.0} s",
            self.hidden,
            self.seed,
            self.answer,
            self.decay_nats_found,
            self.decay_nats_true,
            self.curve_db_stated,
            self.curve_db_found,
            self.curve_db_true,
            self.arrival_nats_found,
            self.arrival_nats_true,
            self.arrival_us_stated,
            self.arrival_us_found,
            self.arrival_us_true,
            self.captured.unwrap_or(f64::NAN),
            self.judged_by,
            self.seconds
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fresh_positions_tell_is_judged_by_a_fifth() {
        let gain = |nats: f64| Gain { nats, standard_error: 0.01 };
        let by = |found: f64, late: f64, captured| {
            judged(Statement::Exact, [gain(found), gain(0.1)], [gain(late), gain(late)], captured)
        };
        assert_eq!(by(0.081, 0.0, None), (JudgedBy::Decays, Some(true)));
        assert_eq!(by(0.079, 0.0, None), (JudgedBy::Decays, Some(false)));
        assert_eq!(by(0.079, 0.3, None), (JudgedBy::Both, Some(false)));
        let silent = |captured| judged(Statement::Nearest, [gain(0.0); 2], [gain(0.015); 2], captured);
        assert_eq!(silent(None), (JudgedBy::Nothing, None));
        assert_eq!(silent(Some(0.79)), (JudgedBy::Changes, Some(false)));
        assert_eq!(judged(Statement::NotStated, [gain(1.0); 2], [gain(1.0); 2], None).1, None);
    }
}
