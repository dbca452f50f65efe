//! The whole diagnosis: observe, simulate, infer, confirm, report.

mod discovering;
mod held_out;
mod parts_of_rays;

use crate::config::DiagnoseConfig;
use crate::effect::Effect;
use crate::effects::{LawEffect, MissingDiffraction, UnknownLaw, catalogue, on_request};
use crate::error::Error;
use crate::extend::extended_model::ExtendedModel;
use crate::extend::extension::extended_model;
use crate::infer::arrival_fits::ArrivalFits;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::{self, CatalogueCase};
use crate::infer::confirmation::{Confirmation, Doubt, confirm};
use crate::infer::naming::{give, select};
use crate::infer::search::Search;
use crate::infer::selection::Selection;
use crate::infer::visibility::d_prime;
use crate::report::composition::compose;
use crate::report::diagnosis::Diagnosis;
use crate::simulate::scene_tracer::{Rays, SceneTracer};
use held_out::held_receivers;
use sabine_acoustics::Observer;
use sabine_paths::laws::{BoundLaws, Law, LawSite};
use sabine_scene::MeasuredRoom;
use std::sync::Arc;
use web_time::Instant;

/// Names that fall before the search for others in their absence ends.
const MOST_FALLEN: usize = 3;

/// Says what is wrong with a simulated room, given what was measured in it.
///
/// 1. Traces every measured pair and fits the baseline: absorption within its stated uncertainty, gains and latencies as
///    `[measurement]` says, places within their tolerance.
/// 2. Fits every case of every effect beside all of these, and the smooth discrepancy that has no name; the evidence of each is its
///    likelihood with all parameters integrated out (Laplace's approximation), which charges for every parameter that is not needed.
/// 3. Names the strongest if its odds, corrected for the number tried, reach [`DiagnoseConfig::naming_nats`]; and so on up to
///    [`DiagnoseConfig::most_causes`] of decays and as many others; drops those that later ones made superfluous.
/// 4. Where a cause of decays could owe its evidence to the rays that were drawn, and quarters of them do not bear it out, starts again with
///    four times as many.
/// 5. Predicts positions that it leaves out.
///
/// Same seed, same diagnosis, on any number of threads.
pub struct Diagnoser {
    pub(crate) config: DiagnoseConfig,
    pub(crate) effects: Vec<Box<dyn Effect>>,
    tracer: Arc<dyn SceneTracer>,
    /// The laws among the effects.
    laws: Vec<Law>,
    /// Causes that are at work from the beginning.
    given: Vec<GivenCause>,
    /// Whether laws are looked for only where the rest of the diagnosis asks for it.
    only_if_needed: bool,
}

/// A cause of a model from which a diagnosis starts.
struct GivenCause {
    id: String,
    subject: Option<String>,
    /// As it is called in the model.
    name: String,
}

impl std::fmt::Debug for Diagnoser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let effects: Vec<_> = self.effects.iter().map(|e| e.id()).collect();
        f.debug_struct("Diagnoser").field("config", &self.config).field("effects", &effects).finish()
    }
}

impl Diagnoser {
    /// With the whole [`catalogue`].
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside its range.
    pub fn new(config: DiagnoseConfig) -> Result<Self, Error> {
        config.check()?;
        let tracer = Arc::new(Rays { config: config.tracer() });
        Ok(Self {
            config,
            effects: catalogue(),
            tracer,
            laws: Vec::new(),
            given: Vec::new(),
            only_if_needed: false,
        })
    }

    /// With these effects instead.
    #[must_use]
    pub fn with_effects(self, effects: Vec<Box<dyn Effect>>) -> Self {
        Self { effects, ..self }
    }

    /// With laws beside its effects: each competes as a cause of its own ([`LawEffect`]).
    ///
    /// # Errors
    /// [`Error::LawNotWeighed`] for a law that is none of [`LawEffect`], or whose identifier an effect or another law has. A law that does not
    /// fit the room is an error of [`Diagnoser::diagnose`].
    pub fn with_laws(mut self, laws: Vec<Law>) -> Result<Self, Error> {
        for law in laws {
            LawEffect::check_name(&law, &self.effects)?;
            self.push_law(LawEffect::new(law)?);
        }
        Ok(self)
    }

    fn push_law(&mut self, effect: LawEffect) {
        self.laws.push(effect.law().clone());
        self.effects.push(Box::new(effect));
    }

    /// That all edges of bands of laws can be weighed, and that the names of all laws are found between every source and receiver of a room: those of delay and of added sound are not applied to
    /// traced paths, where they would be.
    fn check_laws(&self, room: &MeasuredRoom) -> Result<(), Error> {
        self.laws.iter().try_for_each(|law| LawEffect::check_edges(law, room.bands()))?;
        for response in room.responses() {
            let (source, receiver) = (&room.sources()[response.source], &room.receivers()[response.receiver]);
            let site = LawSite::new(room.scene(), source, receiver, &room.air());
            let site =
                site.with_recording_order(response.recorded_at).among(room.sources(), room.receivers());
            for law in &self.laws {
                BoundLaws::new(std::slice::from_ref(law), &site).map_err(sabine_acoustics::Error::from)?;
            }
        }
        Ok(())
    }

    /// With [`UnknownLaw`] beside its effects: what the misfit goes with, where no listed cause explains it. From six measured receivers on a
    /// quarter of them, two at least, is set aside first, with all their responses (drawn by [`DiagnoseConfig::seed`]): no fit sees them, and a
    /// law is only named if it makes them more probable. Where none is named, all of them are diagnosed without the search.
    #[must_use]
    pub fn discovering(mut self) -> Self {
        self.effects.push(Box::new(UnknownLaw));
        self
    }

    /// As [`discovering`](Self::discovering), but only where the rest of the diagnosis asks for it, and six or more receivers are measured: where
    /// it ends [`Verdict::Unexplained`](crate::Verdict::Unexplained) without a name or [`Verdict::Incomplete`](crate::Verdict::Incomplete) with
    /// one, and where one formula would explain the decays as well as all causes that it names, or what they leave, and by chance none would.
    /// Where a named surface adds sound without which decays are predicted (`extra_reflector`), no law is looked for. Everywhere else the answer
    /// is that of a diagnosis that looks for no law, and so it is where none stands; what a name must reach is the same, too
    /// ([`threshold_nats`](Self::threshold_nats)).
    #[must_use]
    pub fn discovering_if_needed(self) -> Self {
        Self { only_if_needed: true, ..self.discovering() }
    }

    /// Starting from an extended model: its causes are at work from the beginning, their parameters and the absorption fitted anew to the data
    /// at hand, and the search goes on beside them. One for which these data do not speak is dropped, and a note says so. What is known of the
    /// parameters beforehand is what the catalogue knows, not what the model found: data that it was fitted to may be given again.
    ///
    /// # Errors
    /// [`Error::LawNotWeighed`] for a law of the model that is none of [`LawEffect`]. A cause without a case in the room is
    /// [`Error::UnknownCause`] of [`Diagnoser::diagnose`].
    pub fn starting_from(mut self, model: &ExtendedModel) -> Result<Self, Error> {
        for cause in &model.causes {
            let name = cause.name();
            let knows = |effects: &[Box<dyn Effect>], id: &str| effects.iter().any(|e| e.id() == id);
            // A law is that law wherever it came from.
            if let Some(law) = cause.law() {
                let known = knows(&self.effects, law.id());
                if !known {
                    self.push_law(LawEffect::with_edges_as_written(law)?);
                }
                let subject = cause.subject.clone().filter(|_| known);
                self.given.push(GivenCause { id: law.id().to_owned(), subject, name });
                continue;
            }
            if !knows(&self.effects, &cause.id) {
                let all = catalogue().into_iter().chain(on_request());
                self.effects.extend(all.filter(|effect| effect.id() == cause.id));
            }
            self.given.push(GivenCause { id: cause.id.clone(), subject: cause.subject.clone(), name });
        }
        Ok(self)
    }

    /// With another tracer than that of `sabine-propagate`; [`EachScene`](crate::EachScene) makes one of any
    /// [`Propagator`](sabine_paths::Propagator). [`DiagnoseConfig::rays`], `image_order` and `allow_leaks` then mean nothing.
    #[must_use]
    pub fn with_tracer(self, tracer: impl SceneTracer + 'static) -> Self {
        Self { tracer: Arc::new(tracer), ..self }
    }

    /// With effects that are weighed on request alone ([`on_request`](crate::on_request)), by their identifiers.
    ///
    /// # Errors
    /// [`Error::UnknownEffect`] for an identifier that none has.
    pub fn with_also(mut self, ids: &[String]) -> Result<Self, Error> {
        for id in ids {
            if self.effects.iter().any(|e| e.id() == id.as_str()) {
                continue;
            }
            let asked = on_request().into_iter().find(|e| e.id() == id.as_str());
            self.effects.push(asked.ok_or_else(|| Error::UnknownEffect { id: id.clone() })?);
        }
        Ok(self)
    }

    /// With those effects of its catalogue, and of those on request, that have these identifiers.
    ///
    /// # Errors
    /// [`Error::UnknownEffect`] for an identifier that none has.
    pub fn with_only(mut self, ids: &[String]) -> Result<Self, Error> {
        let is_known = |e: &dyn Effect| self.effects.iter().any(|known| known.id() == e.id());
        let asked: Vec<_> = on_request().into_iter().filter(|e| !is_known(&**e)).collect();
        self.effects.extend(asked);
        if let Some(id) = ids.iter().find(|id| self.effects.iter().all(|e| e.id() != id.as_str())) {
            return Err(Error::UnknownEffect { id: id.clone() });
        }
        self.effects.retain(|e| ids.iter().any(|id| *id == e.id()));
        Ok(self)
    }

    /// What a name must reach, in nats: the odds that are asked for, and the number of effects that are tried.
    pub fn threshold_nats(&self) -> f64 {
        let tried = if self.only_if_needed { self.without_laws() } else { self.effects.len() };
        self.config.naming_nats + (tried.max(1) as f64).ln()
    }

    /// Diagnoses a measured room. Receivers in `hold_out` are never fitted and only predicted; without any, each group of
    /// receivers is left out in turn for that.
    ///
    /// # Errors
    /// [`Error::NoResponses`], [`Error::NothingToCompare`], [`Error::UnknownHoldOut`], [`Error::AllHeldOut`]; what reading
    /// responses and tracing give; [`sabine_acoustics::Error::Cancelled`] if the observer asks to stop.
    pub fn diagnose(
        &self,
        room: &MeasuredRoom,
        hold_out: &[String],
        observer: &dyn Observer,
    ) -> Result<Diagnosis, Error> {
        let held = held_receivers(room, hold_out)?;
        // Formulas are weighed by bins, which tables do not have.
        let has_bins = !room.responses().is_empty();
        if has_bins && self.looks_for_laws() && !self.only_if_needed {
            return self.discovered(room, &held, None, observer);
        }
        let task = self.without_search(room, &held);
        let (weighed, confirmed) = self.found(&task, observer)?;
        let (significance, naming_nats) = (self.config.significance, self.config.naming_nats);
        let calls_for_laws =
            has_bins && self.only_if_needed && confirmed.calls_for_laws(significance, naming_nats);
        let plain = self.composed(&weighed, confirmed, task.effects, observer)?;
        if calls_for_laws && !self.vault(room, &held).is_empty() {
            return self.discovered(room, &held, Some(plain), observer);
        }
        Ok(plain)
    }

    /// The diagnosis of all positions by the effects alone.
    fn without_search<'a>(&self, room: &'a MeasuredRoom, held: &'a [usize]) -> Task<'a> {
        Task { room, held, vault: &[], laws: None, effects: self.without_laws() }
    }

    /// Searches for causes, and says which of them stand.
    fn found(&self, task: &Task<'_>, observer: &dyn Observer) -> Result<(Weighed, Confirmation), Error> {
        let &Task { effects, held, .. } = task;
        let started = Instant::now();
        let mut weighed = self.weigh(task, &self.tracer, observer)?;
        // Where sound is found to bend around an edge, a second look takes the wrong `scattering` away that stands beside it, and leaves the
        // gain at positions left out no interval above zero: half of them hear nothing of the edge. The first answer stays.
        let bends = |&c: &usize| weighed.cases[c].id == MissingDiffraction.id();
        let again = !weighed.found.chosen.iter().any(bends) && weighed.owes_a_name(effects, observer)?;
        if let Some(more) = self.tracer.with_more_rays().filter(|_| again) {
            let first_s = started.elapsed().as_secs_f64();
            weighed = self.weigh(task, &more, observer)?;
            weighed.baseline.seconds.insert("with fewer rays first", first_s);
        }
        let mut dropped: Vec<(usize, Doubt)> = Vec::new();
        loop {
            let mut confirmed = weighed.confirmed(held, effects, observer)?;
            let fallen: Vec<usize> = confirmed.dropped.iter().map(|(candidate, _)| *candidate).collect();
            dropped.append(&mut confirmed.dropped);
            let nothing_stands = confirmed.state.chosen.is_empty() && weighed.given.is_empty();
            if fallen.is_empty() || !nothing_stands || dropped.len() > MOST_FALLEN {
                confirmed.dropped = dropped;
                return Ok((weighed, confirmed));
            }
            // What stood in the shadow of names that have fallen is looked for in their absence.
            let mut without = std::mem::take(&mut weighed.found.without);
            without.extend(fallen);
            weighed.baseline.expand_towards((&confirmed.base.energy.values, 1.0), &weighed.cases, &[])?;
            weighed.baseline.calibrate_scatter(&[], &weighed.used)?;
            weighed = weighed.searched(effects, without, observer)?;
        }
    }

    /// The answer.
    fn composed(
        &self,
        weighed: &Weighed,
        confirmed: Confirmation,
        effects: usize,
        observer: &dyn Observer,
    ) -> Result<Diagnosis, Error> {
        let stands = |candidate: &usize| confirmed.state.chosen.contains(candidate);
        let gone = weighed.given.iter().zip(&self.given).filter(|(candidate, _)| !stands(candidate));
        let notes: Vec<String> = gone
            .map(|(_, cause)| {
                format!("The model's {} is not at work here: these data do not need it.", cause.name)
            })
            .collect();
        let search = weighed.search(effects);
        let (found, dispersion) = (&weighed.found, &weighed.first_dispersion);
        let mut diagnosis = compose(&self.effects, &search, found, confirmed, dispersion, observer)?;
        diagnosis.notes.extend(notes);
        Ok(diagnosis)
    }

    /// Traces the room with a tracer and searches for causes.
    fn weigh(
        &self,
        task: &Task<'_>,
        tracer: &Arc<dyn SceneTracer>,
        observer: &dyn Observer,
    ) -> Result<Weighed, Error> {
        let Prepared { baseline, cases, given, used } = self.prepare(task, tracer, observer)?;
        let weighed = Weighed {
            first_dispersion: baseline.dispersion.clone(),
            baseline,
            cases,
            given,
            used,
            found: Selection::default(),
            arrival_fits: Arc::default(),
        };
        let weighed = weighed.searched(task.effects, Vec::new(), observer)?;
        if task.laws.is_some() { self.searched_beside(weighed, task, observer) } else { Ok(weighed) }
    }

    /// The model from which the diagnosis starts, its parameters and the absorption fitted anew to a room's responses: nothing is looked for,
    /// nothing is dropped. For the same room on another day, or with other positions.
    ///
    /// # Errors
    /// As [`Diagnoser::diagnose`].
    pub fn refit(&self, room: &MeasuredRoom, observer: &dyn Observer) -> Result<ExtendedModel, Error> {
        let task = self.without_search(room, &[]);
        let effects = task.effects;
        let Prepared { mut baseline, cases, given, used } = self.prepare(&task, &self.tracer, observer)?;
        let arrival_fits = Arc::default();
        give(&mut baseline, &cases, effects, (&used, &arrival_fits), &given)?;
        let search = Search::new(&baseline, &cases, effects, used).knowing(&arrival_fits);
        let base = search.state(&[], None)?;
        Ok(extended_model(&search, &search.state(&given, Some(&base))?))
    }

    /// How visible a law would be in the decays of a room, d': how far it moves them as it is written, in standard deviations, once everything
    /// is taken out that a diagnosis leaves open (absorption within its tables, gains, levels, drift, the chance of the rays). A fit of the right
    /// cause gains d'^2 / 2 nats of likelihood on average; below 4 or so nothing can be named. A law of delay moves no decay.
    ///
    /// # Errors
    /// As [`Diagnoser::diagnose`]; [`Error::LawNotWeighed`] for a law that is none of [`LawEffect`].
    pub fn d_prime_of_law(
        &self,
        room: &MeasuredRoom,
        law: &Law,
        observer: &dyn Observer,
    ) -> Result<f64, Error> {
        let mut baseline = Baseline::new(room, &[], &self.config, &self.tracer, observer)?;
        let used = baseline.observations.fitted.clone();
        d_prime(&mut baseline, law, &used)
    }

    /// Traces and fits the baseline, and prepares the cases.
    fn prepare(
        &self,
        task: &Task<'_>,
        tracer: &Arc<dyn SceneTracer>,
        observer: &dyn Observer,
    ) -> Result<Prepared, Error> {
        self.check_laws(task.room)?;
        let held = [task.held, task.vault].concat();
        let mut baseline = Baseline::new(task.room, &held, &self.config, tracer, observer)?;
        let used = baseline.observations.fitted.clone();
        let mut cases = candidates::cases(&self.effects, baseline.survey());
        if baseline.observations.are_tables() {
            cases.retain(|own| own.case.bears_on_tables());
        }
        // What cannot be prepared takes no part.
        let started = Instant::now();
        let mut refused = baseline.prepare(&cases)?.into_iter();
        cases.retain(|_| !refused.next().unwrap_or(false));
        *baseline.seconds.entry("baseline").or_default() += started.elapsed().as_secs_f64();
        let place = |cause: &GivenCause| {
            let is_it = |own: &CatalogueCase| own.id == cause.id && own.case.subject == cause.subject;
            let unknown = || Error::UnknownCause { cause: cause.name.clone() };
            cases.iter().position(is_it).ok_or_else(unknown)
        };
        let given = self.given.iter().map(place).collect::<Result<_, Error>>()?;
        baseline.calibrate_scatter(&[], &used)?;
        let mut prepared = Prepared { baseline, cases, given, used };
        if task.laws.is_some() {
            self.shortlist_laws(&mut prepared, task)?;
        }
        Ok(prepared)
    }
}

/// What a diagnosis is of.
#[derive(Clone, Copy)]
struct Task<'a> {
    room: &'a MeasuredRoom,
    /// Receivers (indices) that the user holds out.
    held: &'a [usize],
    /// Those that the search for laws leaves out.
    vault: &'a [usize],
    /// What laws inherit, in nats; none where they are not looked for.
    laws: Option<f64>,
    /// Number of effects, for the correction for how many were tried.
    effects: usize,
}

/// What a search starts from.
struct Prepared {
    baseline: Baseline,
    cases: Vec<CatalogueCase>,
    /// The given causes among the cases.
    given: Vec<usize>,
    used: Vec<bool>,
}

/// What a search found.
struct Weighed {
    baseline: Baseline,
    cases: Vec<CatalogueCase>,
    given: Vec<usize>,
    used: Vec<bool>,
    found: Selection,
    /// Dispersion before anything was named.
    first_dispersion: Vec<f64>,
    arrival_fits: Arc<ArrivalFits>,
}

impl Weighed {
    fn search(&self, effects: usize) -> Search<'_> {
        Search::new(&self.baseline, &self.cases, effects, self.used.clone()).knowing(&self.arrival_fits)
    }

    /// The causes that are found beside those given, some effects (by one of their candidates) left out.
    fn searched(
        mut self,
        effects: usize,
        without: Vec<usize>,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let started = Instant::now();
        let fits = (&self.used[..], &self.arrival_fits);
        let mut named = give(&mut self.baseline, &self.cases, effects, fits, &self.given)?;
        named.without = without;
        self.found = select(&mut self.baseline, &self.cases, effects, fits, named, observer)?;
        *self.baseline.seconds.entry("search").or_default() += started.elapsed().as_secs_f64();
        Ok(self)
    }

    /// Which of them stand.
    fn confirmed(
        &mut self,
        held: &[usize],
        effects: usize,
        observer: &dyn Observer,
    ) -> Result<Confirmation, Error> {
        let started = Instant::now();
        let fallen = self.drop_owing(effects, observer)?;
        *self.baseline.seconds.entry("search").or_default() += started.elapsed().as_secs_f64();
        let mut found = std::mem::take(&mut self.found);
        let confirmed = confirm(&self.search(effects), &mut found, held, observer);
        self.found = found;
        let mut confirmed = confirmed?;
        confirmed
            .dropped
            .splice(0..0, fallen.into_iter().map(|(candidate, rays)| (candidate, Doubt::Rays(rays))));
        Ok(confirmed)
    }
}
