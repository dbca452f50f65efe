//! What a diagnosis found, as the report shows it and as JSON.

use sabine::diagnose::{
    CandidateScore, Cause, ComparedValue, DecayCurves, Diagnosis, FittedMaterial, FoundLaw, HeldOut,
    Isolability, LackOfFit, LawSearch, MovedReflection, ResidualCell, Verdict,
};
use sabine::scene::MeasuredRoom;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// What was measured in a room.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Measured {
    /// Responses; none where tables of parameters take their place.
    pub responses: usize,
    /// Pairs of source and receiver with such a table, where there are no responses.
    #[serde(default)]
    pub tables: usize,
    /// Receivers at which anything was measured.
    pub receivers: usize,
}

impl Measured {
    pub fn of(room: &MeasuredRoom) -> Self {
        let responses = room.responses().len();
        let of_tables = room.parameters().iter().filter(|_| responses == 0).map(|p| (p.source, p.receiver));
        let tables: BTreeSet<(usize, usize)> = of_tables.collect();
        let of_responses = room.responses().iter().map(|r| r.receiver);
        let receivers: BTreeSet<usize> = of_responses.chain(tables.iter().map(|(_, r)| *r)).collect();
        Self { responses, tables: tables.len(), receivers: receivers.len() }
    }
}

/// Everything that is told: the parts of a [`Diagnosis`], and what the program knows besides.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Findings {
    /// The room, as given.
    pub room: String,
    #[serde(flatten)]
    pub measured: Measured,
    pub bands_hz: Vec<f64>,
    /// Evidence at which a cause is named, in nats.
    pub threshold_nats: f64,
    pub verdict: Verdict,
    pub lack_of_fit: LackOfFit,
    pub causes: Vec<Cause>,
    #[serde(default)]
    pub laws: Vec<FoundLaw>,
    #[serde(default)]
    pub law_search: Option<LawSearch>,
    pub alternatives: Vec<String>,
    pub would_decide: Vec<String>,
    pub candidates: Vec<CandidateScore>,
    pub isolability: Vec<Isolability>,
    pub materials: Vec<(String, FittedMaterial)>,
    pub held_out: Option<HeldOut>,
    pub residuals: Vec<ResidualCell>,
    pub decays: Vec<DecayCurves>,
    #[serde(default)]
    pub values: Vec<ComparedValue>,
    #[serde(default)]
    pub moved_reflections: Vec<MovedReflection>,
    pub common_gain_db: Option<f64>,
    pub notes: Vec<String>,
    pub seconds: Vec<(String, f64)>,
}

impl Findings {
    pub fn new(diagnosis: Diagnosis, room: String, measured: Measured, threshold_nats: f64) -> Self {
        Self {
            room,
            measured,
            bands_hz: diagnosis.bands.iter_hz().collect(),
            threshold_nats,
            verdict: diagnosis.verdict,
            lack_of_fit: diagnosis.lack_of_fit,
            causes: diagnosis.causes,
            laws: diagnosis.laws,
            law_search: diagnosis.law_search,
            alternatives: diagnosis.alternatives,
            would_decide: diagnosis.would_decide,
            candidates: diagnosis.candidates,
            isolability: diagnosis.isolability,
            materials: diagnosis.materials,
            held_out: diagnosis.held_out,
            residuals: diagnosis.residuals,
            decays: diagnosis.decays,
            values: diagnosis.values,
            moved_reflections: diagnosis.moved_reflections,
            common_gain_db: diagnosis.common_gain_db,
            notes: diagnosis.notes,
            seconds: diagnosis.seconds,
        }
    }

    /// Seconds of all stages; tables of effects are made within others.
    pub fn total_s(&self) -> f64 {
        self.seconds.iter().filter(|(stage, _)| stage != "tables").map(|(_, s)| s).sum()
    }
}

/// What the program adds to a diagnosis in `diagnosis.json`.
#[derive(Serialize)]
struct Document<'a> {
    room: &'a str,
    #[serde(flatten)]
    measured: Measured,
    threshold_nats: f64,
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
}

/// The contents of `diagnosis.json`.
pub fn json(
    diagnosis: &Diagnosis,
    room: &str,
    measured: Measured,
    threshold_nats: f64,
) -> serde_json::Result<String> {
    let document = Document { room, measured, threshold_nats, diagnosis };
    // By way of a value: its keys are in alphabetical order.
    serde_json::to_string_pretty(&serde_json::to_value(document)?)
}
