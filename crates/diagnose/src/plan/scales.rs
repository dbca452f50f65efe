//! What a set of measurements is worth.

use crate::infer::candidates::CatalogueCase;
use crate::plan::campaign::{Campaign, Shown, is_predicted, prior_variance};
use crate::plan::candidates::Candidates;
use crate::plan::contest::{Contest, Weighed};
use crate::plan::error::PlanError;
use crate::plan::measurement::PlannedMeasurement;
use crate::plan::prospect::Setting;
use rayon::prelude::*;
use sabine_acoustics::{Observer, report};
use std::sync::atomic::{AtomicU64, Ordering};

/// A candidate, traced and expanded.
pub(crate) struct Prospect {
    pub measurement: PlannedMeasurement,
    pub responses: usize,
    pub shown: Shown,
    pub weighed: Option<Weighed>,
}

/// Everything that sets are weighed with.
pub(crate) struct Scales<'a> {
    pub campaign: Campaign<'a>,
    /// The leading hypotheses, after a diagnosis.
    pub contest: Option<Contest<'a>>,
    /// What the room file's positions show.
    pub stated: Shown,
}

impl Scales<'_> {
    /// Traces and expands all candidates.
    pub fn prospects(
        &self,
        candidates: &Candidates,
        setting: &Setting<'_>,
        observer: &dyn Observer,
    ) -> Result<Vec<Prospect>, PlanError> {
        let (done, total) = (AtomicU64::new(0), candidates.all.len() as u64);
        candidates
            .all
            .par_iter()
            .map(|(measurement, variation)| {
                report(observer, "candidates", done.fetch_add(1, Ordering::Relaxed), total)?;
                let prospect = setting.trace(variation, self.campaign.cases)?;
                let weigh = |contest: &Contest<'_>| {
                    contest.weighed(&prospect, variation.moved, f64::from(setting.rate_hz))
                };
                Ok(Prospect {
                    measurement: measurement.clone(),
                    responses: prospect.pairs(),
                    shown: self.campaign.shown(&prospect, variation.moved, setting),
                    weighed: self.contest.as_ref().map(weigh),
                })
            })
            .collect()
    }

    /// What the room file's positions and a set show.
    pub fn shown(&self, prospects: &[Prospect], set: &[usize]) -> Shown {
        set.iter().fold(self.stated.clone(), |sum, &c| sum.and(&prospects[c].shown))
    }

    /// Nats of a set by pair of hypotheses or, before a diagnosis, by effect; `None` if a figure is none.
    pub fn nats(&self, prospects: &[Prospect], set: &[usize]) -> Option<Vec<f64>> {
        let Some(contest) = &self.contest else { return self.learned(&self.shown(prospects, set)) };
        let weighed = set.iter().filter_map(|&c| prospects[c].weighed.as_ref());
        contest.nats(&weighed.fold(contest.nothing(), |sum, one| sum.and(one)))
    }

    /// What a set is worth in all: the mean over pairs of hypotheses, or the sum over effects.
    pub fn worth(&self, nats: &[f64]) -> f64 {
        let sum: f64 = nats.iter().sum();
        if self.contest.is_some() { sum / nats.len().max(1) as f64 } else { sum }
    }

    /// What is learned of the size of each effect by itself beyond the room file's positions (Lindley 1956), the mean over its cases, in the
    /// order of [`Scales::effects`].
    fn learned(&self, shown: &Shown) -> Option<Vec<f64>> {
        let (now, before) = (self.campaign.sizes(shown)?, self.campaign.sizes(&self.stated)?);
        let learned = |c: usize| {
            let variance = prior_variance(&self.campaign.cases[c].case);
            0.5 * ((variance * now.information[c]).ln_1p() - (variance * before.information[c]).ln_1p())
        };
        let mean = |own: Vec<usize>| own.iter().map(|&c| learned(c)).sum::<f64>() / own.len() as f64;
        Some(self.effects().into_iter().map(|(_, own)| mean(own)).collect())
    }

    /// Effects that are predicted, by identifier, with their cases (places).
    pub fn effects(&self) -> Vec<(&str, Vec<usize>)> {
        let mut found: Vec<(&str, Vec<usize>)> = Vec::new();
        for (place, CatalogueCase { id, case, .. }) in self.campaign.cases.iter().enumerate() {
            if !is_predicted(case) {
                continue;
            }
            match found.last_mut().filter(|(last, _)| last == id) {
                Some((_, own)) => own.push(place),
                None => found.push((id, vec![place])),
            }
        }
        found
    }

    /// Nats of one measurement on the absorption of the materials beyond the room file's positions.
    pub fn material_nats(&self, prospects: &[Prospect], one: usize) -> f64 {
        let nats = |shown: &Shown| self.campaign.material_nats(shown);
        let gain = || Some(nats(&self.shown(prospects, &[one]))? - nats(&self.stated)?);
        gain().unwrap_or(0.0)
    }
}
