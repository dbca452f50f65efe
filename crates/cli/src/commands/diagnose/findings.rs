//! What a diagnosis found, as the report shows it and as JSON.

use sabine::diagnose::{
    CandidateScore, Cause, DecayCurves, Diagnosis, FittedMaterial, HeldOut, Isolability, LackOfFit,
    ResidualCell, Verdict,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

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
    pub alternatives: Vec<String>,
    pub would_decide: Vec<String>,
    pub candidates: Vec<CandidateScore>,
    pub isolability: Vec<Isolability>,
    pub materials: Vec<(String, FittedMaterial)>,
    pub held_out: Option<HeldOut>,
    pub residuals: Vec<ResidualCell>,
    pub decays: Vec<DecayCurves>,
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
            alternatives: diagnosis.alternatives,
            would_decide: diagnosis.would_decide,
            candidates: diagnosis.candidates,
            isolability: diagnosis.isolability,
            materials: diagnosis.materials,
            held_out: diagnosis.held_out,
            residuals: diagnosis.residuals,
            decays: diagnosis.decays,
            common_gain_db: diagnosis.common_gain_db,
            notes: diagnosis.notes,
            seconds: diagnosis.seconds,
        }
    }

    /// Seconds of all stages; wave solutions are made within others.
    pub fn total_s(&self) -> f64 {
        self.seconds.iter().filter(|(stage, _)| stage != "waves").map(|(_, s)| s).sum()
    }

    /// The contents of `diagnosis.json`: parameters and materials by name, residuals as the mean over all positions.
    pub fn json(&self) -> serde_json::Result<String> {
        let mut value = serde_json::to_value(self)?;
        let by_name =
            |pairs: &mut dyn Iterator<Item = (String, Value)>| Value::Object(pairs.collect::<Map<_, _>>());
        let causes = self.causes.iter().map(|cause| {
            let parameters = cause.parameters.iter().map(|p| {
                let told = json!({ "value": p.value, "low": p.low, "high": p.high, "unit": p.unit });
                (p.name.clone(), told)
            });
            let mut told = serde_json::to_value(cause)?;
            told["parameters"] = by_name(&mut parameters.into_iter());
            Ok(told)
        });
        value["causes"] = causes.collect::<serde_json::Result<Value>>()?;
        let materials = self.materials.iter().map(|(name, m)| Ok((name.clone(), serde_json::to_value(m)?)));
        let materials = materials.collect::<serde_json::Result<Vec<_>>>()?;
        value["materials"] = by_name(&mut materials.into_iter());
        value["seconds"] = by_name(&mut self.seconds.iter().map(|(stage, s)| (stage.clone(), json!(s))));
        let mean: Vec<&ResidualCell> = self.residuals.iter().filter(|c| c.response.is_none()).collect();
        value["residuals"] = serde_json::to_value(mean)?;
        if let Some(told) = value.as_object_mut() {
            told.remove("decays");
        }
        serde_json::to_string_pretty(&value)
    }
}
