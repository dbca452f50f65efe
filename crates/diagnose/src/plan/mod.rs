//! The next measurement: which one decides, and by how much, before anything is measured.
//!
//! For each measurement that could be made (a microphone or the source at another place, the source turned, other air) the
//! hypothetical responses are traced, and the predictions of the decays and of the arrival times are expanded to first order, with
//! the very likelihood of the diagnosis. What the other parameters may make up for (absorption within what is known of it, gains, places) is
//! projected out. Predictions are then linear and errors normal, and expected evidence has a closed form
//! ([`gaussian`]).

pub(crate) mod campaign;
pub(crate) mod candidates;
pub(crate) mod composition;
pub(crate) mod config;
pub(crate) mod contest;
pub(crate) mod cost;
pub(crate) mod error;
pub(crate) mod gaussian;
pub(crate) mod greedy;
pub(crate) mod hypothesis;
pub(crate) mod measurement;
pub(crate) mod open_question;
pub(crate) mod outcome;
pub(crate) mod places;
pub(crate) mod planner;
pub(crate) mod prospect;
pub(crate) mod scales;
