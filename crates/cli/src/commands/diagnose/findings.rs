//! What a diagnosis found, as the report shows it and as JSON.

use sabine::diagnose::{
    CandidateScore, Cause, DecayCurves, Diagnosis, FittedMaterial, FoundLaw, HeldOut, Isolability, LackOfFit,
    LawSearch, MovedReflection, ResidualCell, Verdict,
};
use serde::{Deserialize, Serialize};

/// Everything that is told: the parts of a [`Diagnosis`], and what the program knows besides.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Findings {
    /// The room, as given.
    pub room: String,
    pub responses: usize,
    pub receivers: usize,
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
    pub moved_reflections: Vec<MovedReflection>,
    pub common_gain_db: Option<f64>,
    pub notes: Vec<String>,
    pub seconds: Vec<(String, f64)>,
}

impl Findings {
    pub fn new(
        diagnosis: Diagnosis,
        room: String,
        responses: usize,
        receivers: usize,
        threshold_nats: f64,
    ) -> Self {
        Self {
            room,
            responses,
            receivers,
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
    responses: usize,
    receivers: usize,
    threshold_nats: f64,
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
}

/// The contents of `diagnosis.json`.
pub fn json(
    diagnosis: &Diagnosis,
    room: &str,
    responses: usize,
    receivers: usize,
    threshold_nats: f64,
) -> serde_json::Result<String> {
    let document = Document { room, responses, receivers, threshold_nats, diagnosis };
    // By way of a value: its keys are in alphabetical order.
    serde_json::to_string_pretty(&serde_json::to_value(document)?)
}
