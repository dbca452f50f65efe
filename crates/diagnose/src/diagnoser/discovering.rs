//! A diagnosis that looks for laws beside the catalogue.

use super::{Diagnoser, Prepared, Task, Weighed};
use crate::effect::Effect;
use crate::effects::UnknownLaw;
use crate::error::Error;
use crate::infer::candidates::CatalogueCase;
use crate::infer::confirmation::{Confirmation, Doubt, confirm};
use crate::infer::law_search::rival::closest;
use crate::infer::law_search::shortlist::shortlist;
use crate::infer::law_search::trial::{Fault, Trial, trials};
use crate::infer::law_search::vault;
use crate::infer::law_search::visible::visible_from;
use crate::infer::naming::select;
use crate::infer::search::Search;
use crate::report::composition::words_that_decide;
use crate::report::diagnosis::{Cause, Diagnosis, FallenLaw, LawSearch, Verdict, VisibleLaw};
use crate::report::found_laws::{found_law, reason};
use sabine_acoustics::Observer;
use sabine_scene::MeasuredRoom;

/// Whether a candidate is a law that was searched for.
fn is_law(id: &str) -> bool {
    id == UnknownLaw.id()
}

/// Whether causes are named, each by one name that positions left out confirm.
fn is_named(verdict: Verdict) -> bool {
    matches!(verdict, Verdict::Explained | Verdict::Incomplete)
}

impl Diagnoser {
    /// Whether it looks for laws.
    pub(super) fn looks_for_laws(&self) -> bool {
        self.law_effect().is_some()
    }

    /// Number of effects but that which stands for laws.
    pub(super) fn without_laws(&self) -> usize {
        self.effects.len() - usize::from(self.looks_for_laws())
    }

    /// Receivers that are set aside.
    pub(super) fn vault(&self, room: &MeasuredRoom, held: &[usize]) -> Vec<usize> {
        let measured = room.responses().iter().map(|r| r.receiver).filter(|r| !held.contains(r));
        vault::draw(measured, self.config.seed)
    }

    /// Looks for laws beside the catalogue with the vault left out of everything, and opens it for those that were named. Where none stands,
    /// the answer is that of a diagnosis of all positions that looks for none: `plain`, where that is known.
    pub(super) fn discovered(
        &self,
        room: &MeasuredRoom,
        held: &[usize],
        plain: Option<Diagnosis>,
        observer: &dyn Observer,
    ) -> Result<Diagnosis, Error> {
        let vault = self.vault(room, held);
        let names = |receivers: &[usize]| receivers.iter().map(|&r| room.receivers()[r].id.clone()).collect();
        let mut told = LawSearch { vault: names(&vault), ..LawSearch::default() };
        // Where every effect has been weighed in vain, what is beyond them all is as probable as all together were.
        let in_vain = plain.as_ref().is_some_and(|plain| plain.causes.is_empty());
        let inherited_nats = if in_vain { (self.effects.len() as f64).ln() } else { 0.0 };
        let effects = self.effects.len();
        let task = Task { room, held, vault: &vault, laws: Some(inherited_nats), effects };
        let (mut weighed, mut confirmed) = self.found(&task, observer)?;
        let laws: Vec<usize> = laws_among(&weighed, &confirmed.state.chosen);
        let tried = trials(&weighed.search(effects), &confirmed.state, &laws, &vault, observer)?;
        let (standing, fallen): (Vec<Trial>, Vec<Trial>) =
            tried.into_iter().partition(|trial| trial.fault().is_none());
        if !fallen.is_empty() {
            let told_of = |trial: &Trial| FallenLaw {
                goes_with: weighed.goes_with(trial.candidate),
                reason: reason(trial),
            };
            told.fallen.extend(fallen.iter().map(told_of));
            confirmed = weighed.confirmed_without(&fallen, confirmed, (held, effects), observer)?;
        }
        told.fallen.extend(doubted(&weighed, &confirmed));
        let elsewhere = confirmed.dropped.iter().filter(|(_, doubt)| matches!(doubt, Doubt::Elsewhere));
        // What chance makes as good, or other rays do not confirm, is no rival of a name.
        let as_probable: Vec<usize> = fallen
            .iter()
            .filter(|trial| trial.fault() != Some(Fault::Chance))
            .map(|trial| trial.candidate)
            .chain(elsewhere.map(|(candidate, _)| *candidate).filter(|&c| is_law(&weighed.cases[c].id)))
            .collect();
        let still = laws_among(&weighed, &confirmed.state.chosen);
        if still.is_empty() {
            let visible = visible_from(&weighed.search(effects), &confirmed.state)?;
            let one = |(goes_with, from_db)| VisibleLaw { goes_with, from_db };
            told.visible = visible.into_iter().map(one).collect();
        }
        let mut diagnosis = if still.is_empty() && !vault.is_empty() {
            let plain = match plain {
                Some(plain) => plain,
                None => {
                    let task = self.without_search(room, held);
                    let (weighed, confirmed) = self.found(&task, observer)?;
                    self.composed(&weighed, confirmed, task.effects, observer)?
                }
            };
            weighed.beside_fallen(plain, &as_probable, &self.effects)?
        } else {
            let state = confirmed.state.clone();
            let mut diagnosis = self.composed(&weighed, confirmed, effects, observer)?;
            let search = weighed.search(effects);
            for trial in standing.iter().filter(|trial| state.chosen.contains(&trial.candidate)) {
                let rest: Vec<usize> =
                    state.chosen.iter().copied().filter(|&c| c != trial.candidate).collect();
                let without = search.state(&rest, Some(&state))?;
                let nats = state.log_evidence() - without.log_evidence();
                diagnosis.laws.extend(found_law(&search, &state, trial, nats, &vault)?);
            }
            diagnosis
        };
        if !diagnosis.laws.is_empty() && is_named(diagnosis.verdict) {
            diagnosis.verdict = Verdict::Law;
        }
        diagnosis.notes.extend(notes(&told, !diagnosis.laws.is_empty()));
        diagnosis.law_search = Some(told);
        Ok(diagnosis)
    }

    /// The number of the effect that stands for laws.
    fn law_effect(&self) -> Option<usize> {
        self.effects.iter().position(|effect| is_law(&effect.id()))
    }

    /// Adds the most promising laws beside the baseline to the cases.
    pub(super) fn shortlist_laws(&self, prepared: &mut Prepared, task: &Task<'_>) -> Result<(), Error> {
        let (Some(effect), Some(inherited_nats)) = (self.law_effect(), task.laws) else { return Ok(()) };
        let Prepared { baseline, cases, used, .. } = prepared;
        let state = Search::new(baseline, cases, task.effects, used.clone()).state(&[], None)?;
        let slot = baseline.simulation.tables.len();
        let own = (effect, &UnknownLaw.id(), slot, inherited_nats);
        let more = shortlist(baseline, cases, &state, used, own)?;
        baseline.add_slots(more.len());
        cases.extend(more);
        baseline.prepare_rest(cases)
    }

    /// Looks for laws again beside what was found, for those that it had in its shadow.
    pub(super) fn searched_beside(
        &self,
        mut weighed: Weighed,
        task: &Task<'_>,
        observer: &dyn Observer,
    ) -> Result<Weighed, Error> {
        let (Some(effect), Some(inherited_nats)) = (self.law_effect(), task.laws) else { return Ok(weighed) };
        let chosen = weighed.found.chosen.clone();
        let open = weighed.found.open(&weighed.cases, self.config.most_causes);
        if chosen.is_empty() || !open.decays || !weighed.found.rivals.is_empty() {
            return Ok(weighed);
        }
        let state = weighed.search(task.effects).state(&chosen, None)?;
        let Weighed { baseline, cases, used, found, arrival_fits, .. } = &mut weighed;
        let slot = baseline.simulation.tables.len();
        let own = (effect, &UnknownLaw.id(), slot, inherited_nats);
        let more = shortlist(baseline, cases, &state, used, own)?;
        if more.is_empty() {
            return Ok(weighed);
        }
        baseline.add_slots(more.len());
        cases.extend(more);
        let named = std::mem::take(found);
        weighed.found = select(baseline, cases, task.effects, (&used[..], arrival_fits), named, observer)?;
        Ok(weighed)
    }
}

/// Laws that were chosen and that did not stand as causes, before any trial as laws.
fn doubted(weighed: &Weighed, confirmed: &Confirmation) -> Vec<FallenLaw> {
    let laws = confirmed.dropped.iter().filter(|(candidate, _)| is_law(&weighed.cases[*candidate].id));
    let one = |(candidate, doubt): &(usize, Doubt)| FallenLaw {
        goes_with: weighed.goes_with(*candidate),
        reason: match doubt {
            Doubt::Modes => "octaves below the Schroeder frequency alone speak for it",
            Doubt::Rays(_) => "other rays do not confirm it",
            Doubt::Decays => "decays speak for it, not the tables",
            Doubt::Misfit => "more speaks against what is left than for it",
            Doubt::Elsewhere => "it does not help to predict positions that are left out in turn",
        }
        .to_owned(),
    };
    laws.map(one).collect()
}

/// The laws among chosen candidates.
fn laws_among(weighed: &Weighed, chosen: &[usize]) -> Vec<usize> {
    chosen.iter().copied().filter(|&c| is_law(&weighed.cases[c].id)).collect()
}

impl Weighed {
    /// What decays go with under a law among the candidates, in words.
    fn goes_with(&self, candidate: usize) -> String {
        self.cases[candidate].case.subject.clone().unwrap_or_default()
    }

    /// An answer without laws, ambiguous where one of these laws, which did not stand, explains as much in the place of a cause of decays that was
    /// named: the same data do not say more for the name.
    fn beside_fallen(
        &mut self,
        mut plain: Diagnosis,
        laws: &[usize],
        effects: &[Box<dyn Effect>],
    ) -> Result<Diagnosis, Error> {
        let is_of = |own: &CatalogueCase, cause: &Cause| {
            own.formula.is_none() && own.id == cause.effect && own.case.subject == cause.subject
        };
        let place = |cause: &Cause| self.cases.iter().position(|own| is_of(own, cause));
        let named: Option<Vec<usize>> = plain.causes.iter().map(place).collect();
        let Some(named) = named.filter(|_| !laws.is_empty() && is_named(plain.verdict)) else {
            return Ok(plain);
        };
        self.baseline.prepare_rest(&self.cases)?;
        if let Some(rival) = closest(&self.search(effects.len()), &named, laws)? {
            // The last cause stands for the set.
            let cause = plain.causes.remove(rival.place);
            plain.verdict = Verdict::Ambiguous;
            plain.alternatives = vec![cause.effect.clone(), UnknownLaw.id().into_owned()];
            plain.would_decide = words_that_decide(effects, &plain.alternatives);
            let about = cause.subject.as_ref().map_or_else(String::new, |subject| format!(" ({subject})"));
            plain.notes.push(format!(
                "{}{about} is not the only explanation: in its place a law that did not stand has {:.1} nats {} ({}).",
                cause.effect,
                rival.nats.abs(),
                if rival.nats < 0.0 { "less" } else { "more" },
                self.goes_with(rival.law),
            ));
            plain.causes.push(cause);
        }
        Ok(plain)
    }

    /// What stands without some laws.
    fn confirmed_without(
        &mut self,
        fallen: &[Trial],
        before: Confirmation,
        (held, effects): (&[usize], usize),
        observer: &dyn Observer,
    ) -> Result<Confirmation, Error> {
        let mut found = std::mem::take(&mut self.found);
        fallen.iter().for_each(|trial| found.drop(trial.candidate));
        let confirmed = confirm(&self.search(effects), &mut found, held, observer);
        self.found = found;
        let mut confirmed = confirmed?;
        confirmed.dropped.splice(0..0, before.dropped);
        Ok(confirmed)
    }
}

/// What must be said of the search.
fn notes(told: &LawSearch, named: bool) -> Vec<String> {
    let mut notes: Vec<String> = told
        .fallen
        .iter()
        .map(|law| format!("A law was found and is not named, for {}: {}.", law.reason, law.goes_with))
        .collect();
    if told.vault.is_empty() {
        notes.push(
            "Fewer than six receivers: none could be set aside from the search for laws, and no law is confirmed at positions that had no \
             say in its choice."
                .to_owned(),
        );
    } else if named {
        notes.push(format!(
            "No fit has seen the responses at {}: they were set aside to confirm the law. Figures of everything else are without them, too.",
            told.vault.join(", ")
        ));
    }
    notes
}
