//! A plan: what each measurement is expected to say.

use crate::plan::hypothesis::OpenQuestion;
use crate::plan::measurement::PlannedMeasurement;
use serde::{Deserialize, Serialize};

/// A measurement, and what is to be expected of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Weighing {
    /// The measurement.
    pub measurement: PlannedMeasurement,
    /// Responses that it is made of.
    pub responses: usize,
    /// What it takes, in minutes.
    pub minutes: f64,
    /// Expected nats. After a diagnosis: of evidence between the leading hypotheses, the mean over their pairs; before: what is learned of
    /// the size of each effect by itself, added up.
    pub nats: f64,
    /// The same per minute.
    pub nats_per_minute: f64,
    /// What is learned of the absorption of all materials, in nats (Lindley 1956; a D-optimal design has the most).
    pub material_nats: f64,
    /// What it decides, the most first: pairs of hypotheses, or effects, with the nats of each.
    pub decides: Vec<Decision>,
}

/// What a measurement says of one thing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Decision {
    /// One effect or two hypotheses, in words.
    pub what: String,
    /// Expected nats.
    pub nats: f64,
}

/// A measurement of the set that is recommended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Chosen {
    /// Its place among [`Plan::candidates`].
    pub candidate: usize,
    /// What it adds to those before it, in nats.
    pub adds_nats: f64,
    /// What it decides beyond those before it, the most first.
    pub decides: Vec<Decision>,
}

/// How large an effect must be to be named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct EffectSize {
    /// Identifier of the effect.
    pub effect: String,
    /// What it concerns, where it has several cases.
    pub subject: Option<String>,
    /// Its first parameter, or what its prior leaves open.
    pub parameter: String,
    /// Unit of the sizes; empty for a pure number.
    pub unit: String,
    /// A size at which it is plain to see.
    pub typical: f64,
    /// The typical size in standard deviations of what is found of it: with the positions of the room file, and with those chosen as well.
    pub d_prime: [f64; 2],
    /// The size from which its evidence is expected to reach a name, likewise; infinite, and null in JSON, where no size that the parameter can
    /// have does.
    #[serde(deserialize_with = "infinite")]
    pub named_from: [f64; 2],
}

fn infinite<'de, D: serde::Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    <[Option<f64>; 2]>::deserialize(from).map(|sizes| sizes.map(|size| size.unwrap_or(f64::INFINITY)))
}

/// Two effects, and how alike they look.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LookAlikes {
    /// Identifiers.
    pub effects: [String; 2],
    /// Cosine of the angle between their signatures, all else refitted, at the positions of the room file: 1 for twins. `None` where one does not
    /// show.
    pub cosine: Option<f64>,
    /// The same with the chosen measurements as well.
    pub cosine_planned: Option<f64>,
}

/// Which measurement decides, and by how much.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Plan {
    /// Between which hypotheses; `None` before a diagnosis.
    pub question: Option<OpenQuestion>,
    /// All measurements that were weighed, the most nats first.
    pub candidates: Vec<Weighing>,
    /// Those that together decide most.
    pub chosen: Vec<Chosen>,
    /// Distance between neighbouring places for a microphone, in metres.
    pub spacing_m: f64,
    /// How large effects must be, in the order of the catalogue; after a diagnosis those of its question alone.
    pub effects: Vec<EffectSize>,
    /// Effects that look alike (cosine above 0.95) at the positions of the room file or with those chosen.
    pub look_alikes: Vec<LookAlikes>,
    /// Effects that no place or air shows: they are found in single channels, in unexplained peaks, in waves or before the direct sound.
    pub not_planned: Vec<String>,
    /// Responses that the room file has or that its places would give.
    pub stated_responses: usize,
    /// Seconds spent, by stage.
    pub seconds: Vec<(String, f64)>,
}

impl Plan {
    /// The measurement with the most nats for each minute; `None` if there is none.
    pub fn most_per_minute(&self) -> Option<&Weighing> {
        self.candidates.iter().max_by(|a, b| a.nats_per_minute.total_cmp(&b.nats_per_minute))
    }
}
