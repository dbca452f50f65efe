//! A diagnosis as a document: the keys that `docs/versioning.md` promises.

use crate::found_parameter::FoundParameter;
use crate::report::diagnosis::{
    Cause, Diagnosis, FittedMaterial, FoundLaw, HeldOutGain, LawPoint, RayDependence, ResidualCell,
};
use serde::ser::{Serialize, SerializeMap, SerializeStruct, Serializer};

/// Pairs as a map, in their order.
struct ByName<'a, T>(Vec<(&'a str, T)>);

impl<T: Serialize> Serialize for ByName<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in &self.0 {
            map.serialize_entry(name, value)?;
        }
        map.end()
    }
}

#[derive(serde::Serialize)]
struct ParameterEntry<'a> {
    value: f64,
    low: f64,
    high: f64,
    unit: &'a str,
}

impl<'a> ParameterEntry<'a> {
    fn of(p: &'a FoundParameter) -> (&'a str, Self) {
        (&p.name, Self { value: p.value, low: p.low, high: p.high, unit: &p.unit })
    }
}

#[derive(serde::Serialize)]
struct CauseEntry<'a> {
    effect: &'a str,
    subject: Option<&'a str>,
    other_subjects: &'a [String],
    explanation: &'a str,
    probability: f64,
    nats: f64,
    rays: Option<&'a RayDependence>,
    parameters: ByName<'a, ParameterEntry<'a>>,
    held_out_gain: Option<&'a HeldOutGain>,
    slight: bool,
}

impl<'a> CauseEntry<'a> {
    fn of(cause: &'a Cause) -> Self {
        Self {
            effect: &cause.effect,
            subject: cause.subject.as_deref(),
            other_subjects: &cause.other_subjects,
            explanation: &cause.explanation,
            probability: cause.probability,
            nats: cause.nats,
            rays: cause.rays.as_ref(),
            parameters: ByName(cause.parameters.iter().map(ParameterEntry::of).collect()),
            held_out_gain: cause.held_out_gain.as_ref(),
            slight: cause.slight,
        }
    }
}

#[derive(serde::Serialize)]
struct LawEntry<'a> {
    id: &'a str,
    target: &'a str,
    surface: Option<&'a str>,
    formula: &'a str,
    words: &'a str,
    parameters: ByName<'a, ParameterEntry<'a>>,
    evidence_nats: f64,
    prior_nats: f64,
    family_p: f64,
    vault_gain_nats: Option<f64>,
    sham_nats: Option<f64>,
    not_told_from: &'a [String],
    points: &'a [LawPoint],
}

impl<'a> LawEntry<'a> {
    fn of(law: &'a FoundLaw) -> Self {
        Self {
            id: &law.id,
            target: &law.target,
            surface: law.surface.as_deref(),
            formula: &law.formula,
            words: &law.words,
            parameters: ByName(law.parameters.iter().map(ParameterEntry::of).collect()),
            evidence_nats: law.evidence_nats,
            prior_nats: law.prior_nats,
            family_p: law.family_p,
            vault_gain_nats: law.vault_gain_nats,
            sham_nats: law.sham_nats,
            not_told_from: &law.not_told_from,
            points: &law.points,
        }
    }
}

/// Parameters, materials and seconds by name, residuals as the mean over all responses. Decay curves are left out, and so is the extended
/// model, which has a file of its own.
impl Serialize for Diagnosis {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let materials: Vec<(&str, &FittedMaterial)> = self.materials.iter().map(|(n, m)| (&**n, m)).collect();
        let seconds: Vec<(&str, f64)> = self.seconds.iter().map(|(stage, s)| (&**stage, *s)).collect();
        let mean: Vec<&ResidualCell> = self.residuals.iter().filter(|c| c.response.is_none()).collect();
        let mut document = serializer.serialize_struct("Diagnosis", 18)?;
        document.serialize_field("bands_hz", &self.bands.iter_hz().collect::<Vec<f64>>())?;
        document.serialize_field("verdict", &self.verdict)?;
        document.serialize_field("lack_of_fit", &self.lack_of_fit)?;
        document.serialize_field("causes", &self.causes.iter().map(CauseEntry::of).collect::<Vec<_>>())?;
        document.serialize_field("laws", &self.laws.iter().map(LawEntry::of).collect::<Vec<_>>())?;
        document.serialize_field("law_search", &self.law_search)?;
        document.serialize_field("alternatives", &self.alternatives)?;
        document.serialize_field("would_decide", &self.would_decide)?;
        document.serialize_field("candidates", &self.candidates)?;
        document.serialize_field("isolability", &self.isolability)?;
        document.serialize_field("materials", &ByName(materials))?;
        document.serialize_field("held_out", &self.held_out)?;
        document.serialize_field("residuals", &mean)?;
        document.serialize_field("values", &self.values)?;
        document.serialize_field("moved_reflections", &self.moved_reflections)?;
        document.serialize_field("common_gain_db", &self.common_gain_db)?;
        document.serialize_field("notes", &self.notes)?;
        document.serialize_field("seconds", &ByName(seconds))?;
        document.end()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::extend::extended_model::ExtendedModel;
    use crate::report::diagnosis::{FitTest, LackOfFit, LawSearch, Verdict};
    use sabine_acoustics::Bands;

    #[test]
    fn parameters_and_materials_are_tables_by_name() {
        let parameter = |name: &str| FoundParameter {
            name: name.into(),
            value: 1.5,
            low: 1.0,
            high: 2.0,
            unit: "ms".into(),
        };
        let cell = |response: Option<&str>| ResidualCell {
            response: response.map(str::to_owned),
            band_hz: 500.0,
            time_s: 0.1,
            before_db: 1.0,
            after_db: 0.5,
            expected_sd_db: 1.0,
        };
        let fitted = FittedMaterial {
            stated: vec![0.1],
            absorption_before: vec![0.2],
            absorption: vec![0.3],
            absorption_sd: vec![0.01],
        };
        let found = Diagnosis {
            verdict: Verdict::Explained,
            lack_of_fit: LackOfFit {
                p_value: 0.1,
                p_value_explained: 0.2,
                discrepancy_nats: 1.0,
                discrepancy_nats_explained: 2.0,
                dispersion: vec![1.0],
                drift_sd_db: vec![0.5],
                tests: vec![FitTest { name: "levels".into(), subject: None, p_value: 0.2 }],
            },
            causes: vec![Cause {
                effect: "time_zero".into(),
                subject: None,
                explanation: "Late.".into(),
                probability: 0.9,
                nats: 20.0,
                rays: Some(RayDependence::new(20.0, vec![19.5, 19.8, 19.2, 19.7], 0.01)),
                parameters: vec![parameter("latency")],
                held_out_gain: None,
                slight: false,
                other_subjects: vec!["r3".into()],
            }],
            laws: vec![FoundLaw {
                id: "grazing_wall".into(),
                target: "reflection".into(),
                surface: Some("wall".into()),
                formula: "-a".into(),
                words: "It takes.".into(),
                parameters: vec![parameter("a")],
                evidence_nats: 12.0,
                prior_nats: 5.0,
                family_p: 0.0025,
                vault_gain_nats: None,
                sham_nats: Some(9.0),
                not_told_from: vec!["-b".into()],
                points: Vec::new(),
            }],
            law_search: Some(LawSearch { vault: vec!["r1".into()], ..LawSearch::default() }),
            alternatives: Vec::new(),
            would_decide: Vec::new(),
            candidates: Vec::new(),
            isolability: Vec::new(),
            materials: vec![("wall".into(), fitted)],
            held_out: None,
            bands: Bands::octaves(500.0, 500.0).unwrap(),
            residuals: vec![cell(Some("s-r")), cell(None)],
            decays: Vec::new(),
            values: Vec::new(),
            moved_reflections: Vec::new(),
            common_gain_db: None,
            notes: Vec::new(),
            model: ExtendedModel::default(),
            seconds: vec![("trace".into(), 0.5)],
        };
        // TOML has no null: what is absent is left out, and all else is as in JSON.
        let table = toml::Table::try_from(&found).unwrap();
        assert_eq!(table["verdict"].as_str(), Some("explained"));
        let cause = table["causes"][0].as_table().unwrap();
        assert_eq!(cause["parameters"]["latency"]["unit"].as_str(), Some("ms"));
        assert_eq!(cause["parameters"]["latency"]["high"].as_float(), Some(2.0));
        let law = table["laws"][0].as_table().unwrap();
        assert_eq!(law["parameters"]["a"]["high"].as_float(), Some(2.0));
        assert!(law["surface"].as_str() == Some("wall") && !law.contains_key("vault_gain_nats"));
        assert_eq!(table["law_search"]["vault"][0].as_str(), Some("r1"));
        assert_eq!(table["materials"]["wall"]["absorption"][0].as_float(), Some(0.3));
        assert_eq!(table["seconds"]["trace"].as_float(), Some(0.5));
        assert_eq!(table["residuals"].as_array().unwrap().len(), 1);
        assert!(!table.contains_key("decays") && !table.contains_key("model"));
    }
}
