//! What a plan says, from what sets of measurements are worth.

use crate::effect::{Case, Effect, Nuisance};
use crate::plan::campaign::{Shown, Sizes, is_predicted, prior_variance};
use crate::plan::cost::CostTable;
use crate::plan::gaussian::size_that_reaches;
use crate::plan::greedy::choose;
use crate::plan::hypothesis::OpenQuestion;
use crate::plan::measurement::Kind;
use crate::plan::outcome::{Chosen, Decision, EffectSize, LookAlikes, Plan, Weighing};
use crate::plan::scales::{Prospect, Scales};

/// Signatures closer than this cannot be told apart.
const INDISTINGUISHABLE_COSINE: f64 = 0.95;
/// What a decision must be worth to be told, in nats.
const WORTH_SAYING_NATS: f64 = 0.05;
/// Most decisions told of a measurement.
const MAX_DECISIONS: usize = 5;

/// What things are called.
pub(crate) struct Names<'a> {
    pub question: Option<&'a OpenQuestion>,
    pub effects: &'a [Box<dyn Effect>],
    pub naming_nats: f64,
}

/// What a plan is made of.
pub(crate) struct Parts<'a> {
    pub scales: &'a Scales<'a>,
    pub prospects: &'a [Prospect],
    pub names: &'a Names<'a>,
    pub cost: &'a CostTable,
}

/// The plan, with so many of each kind chosen.
pub(crate) fn composed(
    parts: &Parts<'_>,
    asked: [(Kind, usize); 2],
    spacing_m: f64,
    stated_responses: usize,
) -> Plan {
    let mut order: Vec<(usize, Weighing)> =
        (0..parts.prospects.len()).map(|c| (c, parts.weighing(c))).collect();
    order.sort_by(|a, b| b.1.nats.total_cmp(&a.1.nats).then(a.0.cmp(&b.0)));
    let mut set = Vec::new();
    for (kind, count) in asked {
        let own: Vec<usize> =
            (0..parts.prospects.len()).filter(|&c| parts.prospects[c].measurement.kind() == kind).collect();
        choose(&own, count, &mut set, &|set| {
            parts.scales.nats(parts.prospects, set).map(|nats| parts.scales.worth(&nats))
        });
    }
    let places: Vec<usize> = order.iter().map(|(c, _)| *c).collect();
    let planned = parts.scales.shown(parts.prospects, &set);
    Plan {
        question: parts.names.question.cloned(),
        chosen: parts.chosen(&set, &places),
        candidates: order.into_iter().map(|(_, weighing)| weighing).collect(),
        spacing_m,
        effects: parts.effect_sizes(&planned),
        look_alikes: parts.look_alikes(&planned),
        not_planned: parts.not_planned(),
        stated_responses,
        seconds: Vec::new(),
    }
}

impl Parts<'_> {
    /// What nats are of, in words.
    fn subjects(&self) -> Vec<String> {
        match (&self.scales.contest, self.names.question) {
            (Some(contest), Some(question)) => {
                let name = |k: usize| question.leading[k].to_string();
                contest.pairs().into_iter().map(|(a, b)| format!("{} or {}", name(a), name(b))).collect()
            }
            _ => self.scales.effects().into_iter().map(|(id, _)| id.to_owned()).collect(),
        }
    }

    fn decisions(&self, nats: &[f64], before: &[f64]) -> Vec<Decision> {
        let gains = nats.iter().zip(before).map(|(now, before)| now - before);
        let mut found: Vec<Decision> = self
            .subjects()
            .into_iter()
            .zip(gains)
            .filter(|(_, nats)| *nats > WORTH_SAYING_NATS)
            .map(|(what, nats)| Decision { what, nats })
            .collect();
        found.sort_by(|a, b| b.nats.total_cmp(&a.nats));
        found.truncate(MAX_DECISIONS);
        found
    }

    fn nats(&self, set: &[usize]) -> Vec<f64> {
        let none = || vec![0.0; self.subjects().len()];
        self.scales.nats(self.prospects, set).unwrap_or_else(none)
    }

    fn weighing(&self, c: usize) -> Weighing {
        let Prospect { measurement, responses, .. } = &self.prospects[c];
        let (nats, none) = (self.nats(&[c]), self.nats(&[]));
        let (worth, minutes) = (self.scales.worth(&nats), self.cost.minutes(measurement));
        Weighing {
            measurement: measurement.clone(),
            responses: *responses,
            minutes,
            nats: worth,
            nats_per_minute: worth / minutes,
            material_nats: self.scales.material_nats(self.prospects, c),
            decides: self.decisions(&nats, &none),
        }
    }

    /// Those of a set, in the order in which they were chosen; `places` are the candidates in the order of the plan.
    fn chosen(&self, set: &[usize], places: &[usize]) -> Vec<Chosen> {
        let mut before = self.nats(&[]);
        let one = |(k, c): (usize, &usize)| {
            let now = self.nats(&set[..=k]);
            let found = Chosen {
                candidate: places.iter().position(|p| p == c).unwrap_or(0),
                adds_nats: self.scales.worth(&now) - self.scales.worth(&before),
                decides: self.decisions(&now, &before),
            };
            before = now;
            found
        };
        set.iter().enumerate().map(one).collect()
    }

    /// How large an effect must be, by case.
    fn effect_sizes(&self, planned: &Shown) -> Vec<EffectSize> {
        let sizes = [&self.scales.stated, planned].map(|shown| self.scales.campaign.sizes(shown));
        let threshold = self.names.naming_nats + (self.names.effects.len().max(1) as f64).ln();
        let mut found = Vec::new();
        for (id, own) in self.scales.effects() {
            // A case pays for the number of cases.
            let nats = threshold + (own.len() as f64).ln();
            for place in own {
                let case = &self.scales.campaign.cases[place].case;
                let information =
                    |sizes: &Option<Sizes>| sizes.as_ref().map_or(0.0, |s| s.information[place]);
                let information = [information(&sizes[0]), information(&sizes[1])];
                let (parameter, unit, typical, most) = typical(case);
                let reaches = |i: f64| typical * size_that_reaches(nats, i, prior_variance(case));
                // A size that the parameter cannot have is none.
                let named_from = information
                    .map(|i| Some(reaches(i)).filter(|size| *size <= most).unwrap_or(f64::INFINITY));
                found.push(EffectSize {
                    effect: id.to_owned(),
                    subject: case.subject.clone(),
                    parameter,
                    unit,
                    typical,
                    d_prime: information.map(f64::sqrt),
                    named_from,
                });
            }
        }
        found
    }

    /// Effects whose first cases look alike.
    fn look_alikes(&self, planned: &Shown) -> Vec<LookAlikes> {
        let sizes = [&self.scales.stated, planned].map(|shown| self.scales.campaign.sizes(shown));
        let effects = self.scales.effects();
        let mut found = Vec::new();
        for (i, (a, of_a)) in effects.iter().enumerate() {
            for (b, of_b) in &effects[i + 1..] {
                let cosine = |sizes: &Option<Sizes>| sizes.as_ref().and_then(|s| s.cosine(of_a[0], of_b[0]));
                let [cosine, cosine_planned] = [cosine(&sizes[0]), cosine(&sizes[1])];
                if [cosine, cosine_planned].into_iter().flatten().any(|c| c > INDISTINGUISHABLE_COSINE) {
                    let effects = [(*a).to_owned(), (*b).to_owned()];
                    found.push(LookAlikes { effects, cosine, cosine_planned });
                }
            }
        }
        found
    }

    fn not_planned(&self) -> Vec<String> {
        let cases = self.scales.campaign.cases;
        let predicted = |id: &str| cases.iter().any(|c| c.id == id && is_predicted(&c.case));
        let ids: Vec<String> = match self.names.question {
            Some(question) => question.leading.iter().map(|h| h.effect.clone()).collect(),
            None => self.names.effects.iter().map(|e| e.id().into_owned()).collect(),
        };
        ids.into_iter().filter(|id| !predicted(id)).collect()
    }
}

/// Name, unit, typical and largest size of what a case is measured by: its first parameter that is not neutral, or what its prior opens.
fn typical(case: &Case) -> (String, String, f64, f64) {
    let own = case.parameters.iter().find(|p| p.typical != p.neutral);
    if let Some(p) = own {
        let most = (p.neutral - p.bounds.0).max(p.bounds.1 - p.neutral);
        return (p.name.clone(), p.unit.to_string(), (p.typical - p.neutral).abs(), most);
    }
    match case.relaxes.first() {
        Some((Nuisance::Absorption(_), sd)) => ("absorption".to_owned(), String::new(), *sd, 1.0),
        Some((_, sd)) => ("distance".to_owned(), "m".to_owned(), *sd, f64::INFINITY),
        None => ("size".to_owned(), String::new(), 1.0, f64::INFINITY),
    }
}
