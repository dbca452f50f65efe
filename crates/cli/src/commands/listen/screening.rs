//! Whose ratings count: post-screening by ITU-R BS.1534-3, 4.1.2.

use super::ratings::{Ratings, Trial};
use serde::Serialize;
use std::collections::BTreeMap;

/// Ratings below this of the hidden reference, and above this of the mid-range anchor, tell of somebody who does not hear
/// the difference.
const LIMIT: f64 = 90.0;
/// Share of an assessor's items in which that may happen.
const SHARE: f64 = 0.15;

/// Which stimuli are not under test.
pub struct Roles {
    /// The hidden reference.
    pub reference: String,
    /// The low anchor.
    pub low_anchor: String,
    /// The mid-range anchor.
    pub mid_anchor: String,
}

/// An assessor who is left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Excluded {
    /// Who.
    pub assessor: String,
    /// Number of items rated.
    pub items: usize,
    /// Items in which the hidden reference got less than 90.
    pub reference_below_90: usize,
    /// Items in which the mid-range anchor got more than 90.
    pub mid_anchor_above_90: usize,
}

/// Assessors that stay, with their items, and those that do not.
pub type Screened<'a> = (BTreeMap<&'a str, &'a BTreeMap<String, Trial>>, Vec<Excluded>);

/// Leaves out who rated the hidden reference below 90, or the mid-range anchor above 90, in more than 15 % of the items.
pub fn screen<'a>(ratings: &'a Ratings, roles: &Roles) -> Screened<'a> {
    let mut kept = BTreeMap::new();
    let mut excluded = Vec::new();
    for (assessor, trials) in &ratings.assessors {
        let count = |name: &str, off: fn(f64) -> bool| {
            trials.values().filter(|trial| trial.get(name).copied().is_some_and(off)).count()
        };
        let reference_below_90 = count(&roles.reference, |score| score < LIMIT);
        let mid_anchor_above_90 = count(&roles.mid_anchor, |score| score > LIMIT);
        let most = SHARE * trials.len() as f64;
        if reference_below_90 as f64 > most || mid_anchor_above_90 as f64 > most {
            excluded.push(Excluded {
                assessor: assessor.clone(),
                items: trials.len(),
                reference_below_90,
                mid_anchor_above_90,
            });
        } else {
            kept.insert(assessor.as_str(), trials);
        }
    }
    (kept, excluded)
}
