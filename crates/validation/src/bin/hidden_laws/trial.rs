//! A line of the record.

use crate::judge::Outcome;
use crate::worlds::Null;
use serde::{Deserialize, Serialize};
use std::fmt;

/// When a law is searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Discover {
    /// Beside the catalogue, in each room.
    Always,
    /// Where the catalogue leaves a room unexplained, or one formula would do as well as what it names.
    IfNeeded,
}

/// A room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    pub kind: String,
    /// What the room holds instead of a law.
    pub null: Option<Null>,
    /// Size of the law.
    pub size: Option<f64>,
    pub seed: u64,
    pub rays: usize,
    pub receivers: usize,
    pub nuisances: bool,
    pub discover: Discover,
    /// The law, or the other cause, with its numbers.
    pub hidden: String,
    /// By how much the law changes levels, in dB: the root mean square over responses, octaves and stretches of 20 ms, less the mean.
    #[serde(default)]
    pub change_db: Option<f64>,
    /// How visible the law is in the decays beforehand, in standard deviations; none for laws of delay.
    #[serde(default)]
    pub d_prime: Option<f64>,
    /// Root mean square error of decay curves at places nearer to the source or farther from it than all that were fitted, in dB: of the room
    /// as stated and of the model found; and what that gains over the other, in nats for each level. Where a law is hidden and there is a model.
    #[serde(default)]
    pub outside_stated_db: Option<f64>,
    #[serde(default)]
    pub outside_found_db: Option<f64>,
    #[serde(default)]
    pub outside_nats: Option<f64>,
    /// Mean error of fitted absorption over materials and octaves, under the baseline and beside what is named.
    #[serde(default)]
    pub absorption_before: Option<f64>,
    #[serde(default)]
    pub absorption_after: Option<f64>,
    /// Its material.
    pub surface: Option<String>,
    pub verdict: String,
    /// Causes with their subjects.
    pub answer: String,
    /// Laws with target and surface.
    pub laws: String,
    pub outcome: Outcome,
    pub false_laws: usize,
    pub false_names: usize,
    pub sign_right: Option<bool>,
    pub edge_right: Option<bool>,
    /// Difference of the right law from the hidden one at random points, and the hidden one's own level, both as a root mean square.
    pub rms_db: Option<f64>,
    pub hidden_rms_db: Option<f64>,
    /// Probability of as good a law by chance, of the first.
    pub family_p: Option<f64>,
    pub vault_gain_nats: Option<f64>,
    /// Laws that were chosen and did not stand, with the reasons.
    pub fallen: String,
    /// Probability of the misfit under what is named.
    pub misfit_p: f64,
    /// The most improbable test of the lack of fit.
    pub misfit: String,
    /// Whether such a test speaks of the right covariate and surface.
    pub misfit_is_right: Option<bool>,
    pub seconds: f64,
}

impl Trial {
    /// Whether another line is of the same room, asked for in the same way.
    pub fn is_of_same_room(&self, other: &Self) -> bool {
        let asked = |t: &Self| (t.seed, t.rays, t.receivers, t.nuisances, t.discover);
        (&self.kind, self.null, self.size) == (&other.kind, other.null, other.size)
            && asked(self) == asked(other)
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let world = match (self.size, self.null) {
            (Some(size), _) => format!("size {size}"),
            (None, null) => {
                format!("no law, {}", null.map_or_else(String::new, |n| format!("{n:?}").to_lowercase()))
            }
        };
        write!(
            f,
            "{} {world} seed {}: {:?}: {} [{}]",
            self.kind, self.seed, self.outcome, self.verdict, self.answer
        )?;
        if let Some(d_prime) = self.d_prime {
            write!(f, " d' {d_prime:.1}")?;
        }
        if !self.laws.is_empty() {
            write!(f, " laws [{}]", self.laws)?;
        }
        if let (Some(off), Some(own)) = (self.rms_db, self.hidden_rms_db) {
            write!(
                f,
                " {off:.2} dB off, hidden {own:.2} dB, sign {:?}, edge {:?}",
                self.sign_right, self.edge_right
            )?;
        }
        if let (Some(before), Some(after)) = (self.outside_stated_db, self.outside_found_db) {
            write!(f, " outside {before:.2} to {after:.2} dB")?;
        }
        if !self.fallen.is_empty() {
            write!(f, " fallen [{}]", self.fallen)?;
        }
        write!(
            f,
            "; p {:.1e} ({}); hidden {}; {:.0} s",
            self.misfit_p, self.misfit, self.hidden, self.seconds
        )
    }
}
