//! Which causes the data speak for.

use crate::effect::AuxiliaryEvidence;
use crate::effect::{Case, ChannelChange, Nuisance, Observable};
use crate::error::Error;
use crate::infer::arrival_fits::{ArrivalFit, ArrivalFits};
use crate::infer::baseline::Baseline;
use crate::infer::candidates::{
    Candidate, CatalogueCase, EffectScore, Score, by_effect, candidates, cases_of, price,
};
use crate::infer::direct_evidence;
use crate::infer::direct_evidence::Fitted;
use crate::likelihood::decay::WarmStart;
use crate::likelihood::laplace::LaplaceFit;
use crate::likelihood::polarity;
use rayon::prelude::*;
use sabine_acoustics::{Observer, report};
use std::sync::Arc;

/// Causes whose evidence differs by less are not told apart, in nats: odds of 20 to 1.
pub(crate) const RIVAL_NATS: f64 = 3.0;
/// Cases of one effect whose evidence comes so near to that of the best are compared more closely, in nats ...
const NEAR_NATS: f64 = 10.0;
/// ... so many of them.
const MOST_NEAR: usize = 6;
/// Exchanges that are looked at in full: those that help the direct sounds most.
const MAX_EXCHANGES: usize = 3;
/// What an exchange must gain in the direct sounds to be looked at, in nats.
const EXCHANGE_NATS: f64 = 6.0;

/// The present state: chosen candidates and the evidence of each part.
#[derive(Clone)]
pub(crate) struct State {
    pub chosen: Vec<usize>,
    pub energy: LaplaceFit,
    pub arrivals: LaplaceFit,
    pub polarity: f64,
    /// What single reflections say for chosen candidates.
    pub own: Vec<(usize, AuxiliaryEvidence)>,
    /// Where the parameters of each chosen case that bears on decays start, and of each that bears on arrivals.
    pub energy_firsts: Vec<usize>,
    pub arrival_firsts: Vec<usize>,
}

impl State {
    /// The fit of the decays as a start for one with more cases.
    pub fn before(&self) -> WarmStart<'_> {
        WarmStart { values: &self.energy.values, firsts: &self.energy_firsts }
    }

    pub fn log_evidence(&self) -> f64 {
        self.energy.log_evidence
            + self.arrivals.log_evidence
            + self.polarity
            + direct_evidence::sum(&self.own)
    }
}

pub(crate) struct Search<'a> {
    pub baseline: &'a Baseline,
    pub candidates: Vec<Candidate<'a>>,
    /// Number of effects, for the correction for how many were tried.
    pub effects: usize,
    pub used: Vec<bool>,
    arrival_fits: Arc<ArrivalFits>,
}

impl<'a> Search<'a> {
    pub fn new(baseline: &'a Baseline, cases: &'a [CatalogueCase], effects: usize, used: Vec<bool>) -> Self {
        let candidates = candidates(cases);
        Self { baseline, candidates, effects, used, arrival_fits: Arc::default() }
    }

    /// With fits that another search over the same cases has made.
    pub fn knowing(self, arrival_fits: &Arc<ArrivalFits>) -> Self {
        Self { arrival_fits: Arc::clone(arrival_fits), ..self }
    }

    /// Fits the arrival times of some responses under the chosen candidates that bear on them.
    pub fn fit_arrivals(&self, chosen: &[usize], used: &[bool]) -> Result<ArrivalFit, Error> {
        let bears = |c: &usize| self.candidates[*c].case.observable().concerns(Observable::Arrivals);
        let bear: Vec<usize> = chosen.iter().copied().filter(bears).collect();
        let cases = self.cases_of(&bear, Observable::Arrivals);
        self.arrival_fits.of(bear, used, || self.baseline.fit_arrivals(&cases, used))
    }

    pub fn cases_of(&self, chosen: &[usize], part: Observable) -> Vec<&'a Case> {
        cases_of(&self.candidates, chosen, part)
    }

    pub fn state(&self, chosen: &[usize], near: Option<&State>) -> Result<State, Error> {
        let before = near.map(|s| WarmStart { values: &s.energy.values, firsts: &[] });
        let cases = self.cases_of(chosen, Observable::Decay);
        let (energy, energy_firsts) = self.baseline.fit_energy(&cases, &self.used, before)?;
        let (arrivals, arrival_firsts) = self.fit_arrivals(chosen, &self.used)?;
        let polarity = polarity::log_likelihood(
            &self.baseline.observations.measured,
            &self.all_cases(chosen),
            &self.used,
        );
        let fitted = Fitted { energy: &energy, energy_firsts: &energy_firsts, arrivals: &arrivals };
        let own =
            direct_evidence::own(self.baseline, (&self.candidates, &self.used), chosen, fitted, &self.used);
        Ok(State { chosen: chosen.to_vec(), energy, arrivals, polarity, own, energy_firsts, arrival_firsts })
    }

    pub fn all_cases(&self, chosen: &[usize]) -> Vec<&'a Case> {
        chosen.iter().map(|&c| self.candidates[c].case).collect()
    }

    /// The state with one candidate more; parts on which it has no bearing are taken over.
    pub fn with(&self, state: &State, candidate: usize) -> Result<State, Error> {
        let mut chosen = state.chosen.clone();
        chosen.push(candidate);
        let case = self.candidates[candidate].case;
        let mut next = State { chosen, ..state.clone() };
        let evidence = case.observable();
        let inverts = matches!(case.channel_change(), Some(ChannelChange::Inverted(_)));
        if evidence.concerns(Observable::Decay) && !inverts {
            let cases = self.cases_of(&next.chosen, Observable::Decay);
            (next.energy, next.energy_firsts) =
                self.baseline.fit_energy(&cases, &self.used, Some(state.before()))?;
        }
        if evidence.concerns(Observable::Arrivals) && !inverts {
            (next.arrivals, next.arrival_firsts) = self.fit_arrivals(&next.chosen, &self.used)?;
        }
        if inverts {
            next.polarity = polarity::log_likelihood(
                &self.baseline.observations.measured,
                &self.all_cases(&next.chosen),
                &self.used,
            );
        }
        let fitted =
            Fitted { energy: &next.energy, energy_firsts: &next.energy_firsts, arrivals: &next.arrivals };
        next.own = direct_evidence::own(
            self.baseline,
            (&self.candidates, &self.used),
            &next.chosen,
            fitted,
            &self.used,
        );
        Ok(next)
    }

    /// Candidates worth a full fit: all but the many exchanges that do not even help the direct sounds.
    fn worthwhile(&self, state: &State) -> Result<Vec<usize>, Error> {
        let data = self.baseline.arrival_data();
        let by_pair = |chosen: &[usize], values: &[f64]| -> f64 {
            let cases = self.cases_of(chosen, Observable::Arrivals);
            crate::likelihood::arrivals::at_fit(&data, &cases, &self.used)
                .by_pair(values)
                .iter()
                .zip(&self.used)
                .filter(|(_, used)| **used)
                .map(|(l, _)| l)
                .sum()
        };
        let now = by_pair(&state.chosen, &state.arrivals.values);
        let mut exchanges: Vec<(f64, usize)> = Vec::new();
        let mut kept = Vec::new();
        for (i, candidate) in self.candidates.iter().enumerate() {
            if state.chosen.contains(&i) {
                continue;
            }
            match candidate.case.channel_change() {
                Some(ChannelChange::Exchanged(..)) => {
                    let mut chosen = state.chosen.clone();
                    chosen.push(i);
                    let gain = by_pair(&chosen, &state.arrivals.values) - now;
                    if gain > EXCHANGE_NATS {
                        exchanges.push((gain, i));
                    }
                }
                _ => kept.push(i),
            }
        }
        exchanges.sort_by(|a, b| b.0.total_cmp(&a.0));
        kept.extend(exchanges.into_iter().take(MAX_EXCHANGES).map(|(_, i)| i));
        Ok(kept)
    }

    /// Evidence that every candidate adds.
    pub fn scores(&self, state: &State, observer: &dyn Observer) -> Result<Vec<Score>, Error> {
        let worthwhile = self.worthwhile(state)?;
        let done = std::sync::atomic::AtomicU64::new(0);
        let total = worthwhile.len() as u64;
        worthwhile
            .par_iter()
            .map(|&candidate| {
                let next = self.with(state, candidate)?;
                let behind = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                report(observer, "candidates", behind, total)?;
                Ok(Score {
                    candidate,
                    nats: next.log_evidence() - state.log_evidence(),
                    d_prime: self.d_prime(state, &next, candidate),
                })
            })
            .collect()
    }

    /// Twice the gain in likelihood is noncentral chi-squared: its mean is the squared size of the effect in standard deviations,
    /// and one for each free parameter (Wilks 1938; Wald 1943). What is known of materials and places beforehand counts as data: without
    /// the effect they are strained.
    fn d_prime(&self, state: &State, next: &State, candidate: usize) -> f64 {
        let likelihood = |s: &State| {
            s.energy.log_posterior + s.arrivals.log_posterior + s.polarity + direct_evidence::sum(&s.own)
        };
        let case = self.candidates[candidate].case;
        let widened: usize = case
            .relaxes
            .iter()
            .map(|(nuisance, _)| match nuisance {
                Nuisance::Absorption(_) => self.baseline.survey().bands.len(),
                Nuisance::SourcePosition(_) | Nuisance::ReceiverPosition(_) => 3,
                Nuisance::ResponseGain(_) => 1,
            })
            .sum();
        let free = case.parameters.len() + widened;
        (2.0 * (likelihood(next) - likelihood(state)) - free as f64).max(0.0).sqrt()
    }

    /// [`by_effect`] of all candidates.
    pub fn by_effect(&self, scores: &[Score]) -> Vec<EffectScore> {
        by_effect(&self.candidates, self.effects, scores)
    }

    /// What must be reached for a name.
    pub fn threshold(&self) -> f64 {
        self.baseline.config.naming_nats + (self.effects.max(1) as f64).ln()
    }

    /// What a candidate pays for the number of cases of its effect, or for its formula, in nats.
    pub fn price(&self, candidate: usize) -> f64 {
        price(&self.candidates, candidate)
    }

    /// Others that explain the same as well: those near in evidence that add nothing beside the best, as the best adds
    /// nothing beside them. One that says what the best says less precisely is none.
    pub fn rivals(&self, state: &State, ranked: &[EffectScore]) -> Result<Vec<EffectScore>, Error> {
        let Some(best) = ranked.first() else { return Ok(Vec::new()) };
        let with_best = self.with(state, best.best)?;
        let near = ranked[1..].iter().filter(|r| {
            best.nats - r.nats < RIVAL_NATS
                && r.nats > self.threshold() - RIVAL_NATS
                && !self.candidates[best.best].case.is_part_of(self.candidates[r.best].case)
        });
        let mut rivals = Vec::new();
        for rival in near {
            let with_rival = self.with(state, rival.best)?;
            let both = self.with(&with_best, rival.best)?.log_evidence();
            let beside_best = both - with_best.log_evidence() - self.price(rival.best);
            let best_beside = both - with_rival.log_evidence() - self.price(best.best);
            if beside_best < self.threshold() && best_beside < self.threshold() {
                rivals.push(rival.clone());
            }
        }
        Ok(rivals)
    }

    /// An effect in the case for which the data speak most, and the cases that explain as much: another material, say, or another receiver.
    /// Octaves below the Schroeder frequency have no say in it: what speaks there for one wall rather than another are its modes.
    pub fn best_case(
        &self,
        state: &State,
        scores: &[Score],
        effect: &EffectScore,
    ) -> Result<(EffectScore, Vec<usize>), Error> {
        let own = |s: &&Score| self.candidates[s.candidate].effect == effect.effect;
        let top = scores.iter().filter(own).map(|s| s.nats).fold(f64::NEG_INFINITY, f64::max);
        let least = (top - NEAR_NATS).max(self.threshold() + self.price(effect.best));
        let mut near: Vec<&Score> = scores.iter().filter(own).filter(|s| s.nats > least).collect();
        near.sort_by(|a, b| b.nats.total_cmp(&a.nats));
        near.truncate(MOST_NEAR);
        if near.len() < 2 {
            return Ok((effect.clone(), Vec::new()));
        }
        let of_decays =
            near.iter().all(|s| self.candidates[s.candidate].case.observable() == Observable::Decay);
        let evidence = |added: &[usize]| -> Result<f64, Error> {
            let chosen = [&state.chosen, added].concat();
            if of_decays && self.baseline.survey().bands_of_modes > 0 {
                let cases = self.cases_of(&chosen, Observable::Decay);
                if let Some(above) = self.baseline.evidence_above_modes(&cases, &self.used, state.before())? {
                    return Ok(above);
                }
            }
            Ok(self.state(&chosen, Some(state))?.log_evidence())
        };
        let mut found: Vec<(&Score, f64)> = Vec::new();
        for score in near {
            found.push((score, evidence(&[score.candidate])?));
        }
        // Cases of one price, or formulas, the longer of which pay more.
        let paid = |(score, nats): &(&Score, f64)| nats - self.price(score.candidate);
        found.sort_by(|a, b| paid(b).total_cmp(&paid(a)));
        let (&Score { candidate: best, d_prime, .. }, most) = found[0];
        let worth_a_name = self.threshold() + self.price(best);
        let mut as_good = Vec::new();
        let top = paid(&found[0]);
        for (other, nats) in found[1..].iter().filter(|one| top - paid(one) < RIVAL_NATS) {
            let both = evidence(&[best, other.candidate])?;
            if both - most < worth_a_name && both - nats < worth_a_name {
                as_good.push(other.candidate);
            }
        }
        Ok((EffectScore { best, d_prime, ..effect.clone() }, as_good))
    }

    /// Drops chosen candidates that the others have made superfluous.
    pub fn backward(&self, mut state: State) -> Result<State, Error> {
        loop {
            let mut weakest: Option<(f64, State)> = None;
            if state.chosen.len() < 2 {
                return Ok(state);
            }
            for &candidate in &state.chosen {
                let rest: Vec<usize> = state.chosen.iter().copied().filter(|&c| c != candidate).collect();
                let without = self.state(&rest, Some(&state))?;
                let nats = state.log_evidence() - without.log_evidence() - self.price(candidate);
                if weakest.as_ref().is_none_or(|w| nats < w.0) {
                    weakest = Some((nats, without));
                }
            }
            match weakest {
                Some((nats, without)) if nats < self.threshold() => state = without,
                _ => return Ok(state),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::SurfaceAbsorption;
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

    /// The better case for wrong absorption of carpet or plaster, and what explains as much, if each hit on the material takes so many
    /// nepers more: in the octave below the Schroeder frequency, and in that above it.
    fn better(below: (usize, f64), above: (usize, f64)) -> (Option<String>, Vec<String>) {
        let mut tables = Tables::new(Levels::Absolute, TimeZero::Emission);
        for (measured, states) in tables.measured.iter_mut().zip(&tables.states) {
            for ((energies, state), (material, nepers)) in
                measured.energies.iter_mut().zip(states).zip([below, above])
            {
                let group =
                    |g: usize| state.group_energy[g] * (-nepers * state.group_hits[material][g]).exp();
                let bin = |k: usize| (state.groups[k]..state.groups[k + 1]).map(group).sum();
                *energies = Some((0..state.ln_energy.len()).map(bin).collect());
            }
        }
        let baseline = tables.baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(SurfaceAbsorption)];
        let cases = cases(&effects, baseline.survey());
        let search = Search::new(&baseline, &cases, 1, vec![true; 3]);
        let state = search.state(&[], None).expect("a fit");
        let scores = search.scores(&state, &()).expect("fits");
        let effect = search.by_effect(&scores).remove(0);
        let (best, others) = search.best_case(&state, &scores, &effect).expect("fits");
        let subject = |c: usize| search.candidates[c].case.subject.clone();
        (subject(best.best), others.into_iter().filter_map(subject).collect())
    }

    #[test]
    fn modes_do_not_decide_which_wall_it_is() {
        let (carpet, plaster) = (0, 1);
        let subject = |s: &str| Some(s.to_owned());
        // In all octaves together plaster leads by 8 nats.
        assert_eq!(better((plaster, 1.5), (carpet, 2.0)), (subject("carpet"), Vec::new()));
        // Carpet leads by 9 nats; above the modes so little speaks for plaster that it may be either.
        assert_eq!(better((carpet, 1.5), (plaster, 0.6)), (subject("plaster"), vec!["carpet".to_owned()]));
        assert_eq!(better((carpet, 1.5), (carpet, 1.0)), (subject("carpet"), Vec::new()));
    }
}
