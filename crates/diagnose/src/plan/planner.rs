//! The whole plan: candidates, prospects, expected nats, the choice, the report.

use crate::effect::{Case, Effect, Nuisance};
use crate::effects::{LawEffect, catalogue};
use crate::infer::baseline::Baseline;
use crate::infer::candidates::{CatalogueCase, cases as all_cases};
use crate::plan::campaign::Campaign;
use crate::plan::candidates::{Candidates, candidates, stated};
use crate::plan::composition::{Names, Parts, composed};
use crate::plan::config::PlanConfig;
use crate::plan::contest::Contest;
use crate::plan::error::PlanError;
use crate::plan::hypothesis::{Fit, Hypothesis, OpenQuestion, fit_all, keep_used};
use crate::plan::measurement::Kind;
use crate::plan::outcome::Plan;
use crate::plan::places::{grid, microphone_height_m};
use crate::plan::prospect::{Fitted, Setting};
use crate::plan::scales::Scales;
use crate::simulate::scene_tracer::{Rays, SceneTracer};
use sabine_acoustics::Observer;
use sabine_paths::laws::Law;
use sabine_propagate::MeshScene;
use sabine_scene::{MeasuredRoom, Receiver};
use std::sync::Arc;
use web_time::Instant;

/// Sample rate of responses that nobody has recorded yet, in Hz.
const RATE_HZ: u32 = 48_000;

/// Says which measurement decides, and by how much, before it is made.
///
/// Before a diagnosis it needs no response, and not even a receiver: how large effects must be to be named with the positions of the room
/// file, and where more microphones and sources should stand. After one ([`OpenQuestion`]) the leading hypotheses are fitted to the measured
/// responses, and each candidate gets the evidence that it is expected to bring between them (Box and Hill 1967).
///
/// Same seed, same plan, on any number of threads.
pub struct Planner {
    config: PlanConfig,
    effects: Vec<Box<dyn Effect>>,
    tracer: Arc<dyn SceneTracer>,
}

impl std::fmt::Debug for Planner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let effects: Vec<_> = self.effects.iter().map(|e| e.id()).collect();
        f.debug_struct("Planner").field("config", &self.config).field("effects", &effects).finish()
    }
}

impl Planner {
    /// With the whole [`catalogue`].
    ///
    /// # Errors
    /// [`PlanError::OutOfRange`] or [`PlanError::Diagnose`] for a setting outside its range.
    pub fn new(mut config: PlanConfig) -> Result<Self, PlanError> {
        config.check()?;
        config.diagnose.wave_solutions = false;
        let tracer = Arc::new(Rays { config: config.diagnose.tracer() });
        Ok(Self { config, effects: catalogue(), tracer })
    }

    /// With these effects instead.
    #[must_use]
    pub fn with_effects(self, effects: Vec<Box<dyn Effect>>) -> Self {
        Self { effects, ..self }
    }

    /// With laws beside its effects: each is a cause of its own ([`LawEffect`]), its edges of bands where they are written.
    ///
    /// # Errors
    /// [`crate::Error::LawNotWeighed`] in [`PlanError::Diagnose`] for a law that is none of [`LawEffect`], or whose identifier an effect or
    /// another law has. A law that does not fit the room is an error of [`Planner::plan`].
    pub fn with_laws(mut self, laws: Vec<Law>) -> Result<Self, PlanError> {
        for law in laws {
            LawEffect::check_name(&law, &self.effects)?;
            self.effects.push(Box::new(LawEffect::with_edges_as_written(&law)?));
        }
        Ok(self)
    }

    /// Whether an effect or a law has this identifier.
    #[must_use]
    pub fn knows(&self, id: &str) -> bool {
        self.effects.iter().any(|effect| effect.id() == id)
    }

    /// With another tracer than that of `sabine-propagate`.
    #[must_use]
    pub fn with_tracer(self, tracer: impl SceneTracer + 'static) -> Self {
        Self { tracer: Arc::new(tracer), ..self }
    }

    /// Plans the next measurements of a room: between the hypotheses of `question`, fitted to its responses, or for all effects of the
    /// catalogue.
    ///
    /// # Errors
    /// [`PlanError`]; [`sabine_acoustics::Error::Cancelled`] in it if the observer asks to stop.
    pub fn plan(
        &self,
        room: &MeasuredRoom,
        question: Option<&OpenQuestion>,
        observer: &dyn Observer,
    ) -> Result<Plan, PlanError> {
        if room.sources().is_empty() {
            return Err(PlanError::NoSource);
        }
        let is_planned = room.receivers().is_empty();
        if is_planned && self.config.sources > 0 {
            return Err(PlanError::NoReceiver);
        }
        let mut clock = Clock::default();
        let with_microphone = is_planned.then(|| self.with_microphone(room)).transpose()?;
        let room = with_microphone.as_ref().unwrap_or(room);
        let candidates = candidates(room, is_planned, &self.config)?;
        self.enough(&candidates)?;
        let rate_hz = room.responses().iter().map(|r| r.sample_rate_hz).max().unwrap_or(RATE_HZ);
        let mut setting = Setting::new(room, &self.config.diagnose, &self.tracer, rate_hz)?;
        clock.lap("places");
        let fitted = question.map(|question| self.fitted(room, question, observer)).transpose()?;
        let (fitted_cases, fits, planned) = match fitted {
            Some(FittedQuestion { planned, cases, fits, fitted }) => {
                setting = setting.about(fitted);
                (Some(cases), fits, Some(planned))
            }
            None => (None, Vec::new(), None),
        };
        clock.lap("fits");
        let mut base = setting.trace(&stated(room), &[])?;
        let mut cases = fitted_cases.unwrap_or_else(|| self.cases(&base, is_planned));
        let refused = base.prepare(&cases)?;
        if fits.is_empty() {
            let mut refused = refused.into_iter();
            cases.retain(|_| !refused.next().unwrap_or(false));
        }
        let contest = (!fits.is_empty()).then_some(Contest { fits: &fits, cases: &cases });
        let campaign = Campaign::new(&base, &cases);
        let stated = if is_planned { campaign.nothing() } else { campaign.shown(&base, None, &setting) };
        let scales = Scales { campaign, contest, stated };
        let prospects = scales.prospects(&candidates, &setting, observer)?;
        clock.lap("candidates");
        let names = Names {
            question: planned.as_ref(),
            effects: &self.effects,
            naming_nats: self.config.diagnose.naming_nats,
        };
        let asked = [(Kind::Microphone, self.config.microphones), (Kind::Source, self.config.sources)];
        let stated_responses = if is_planned { 0 } else { base.pairs() };
        let parts = Parts { scales: &scales, prospects: &prospects, names: &names, cost: &self.config.cost };
        let mut plan = composed(&parts, asked, candidates.grid.spacing_m, stated_responses);
        if let (Some(asked), Some(planned)) = (question, &planned) {
            let kept = |h: &Hypothesis| planned.sure.contains(h) || planned.leading.contains(h);
            for left_out in asked.sure.iter().chain(&asked.leading).filter(|h| !kept(h)) {
                if !plan.not_planned.contains(&left_out.effect) {
                    plan.not_planned.push(left_out.effect.clone());
                }
            }
        }
        clock.lap("choice");
        plan.seconds = clock.laps;
        Ok(plan)
    }

    /// Logarithm of the probability of all that was measured under each of the leading hypotheses, in nats: with responses more, differences
    /// between hypotheses change by what these have decided.
    ///
    /// # Errors
    /// As [`Planner::plan`].
    pub fn log_evidence(
        &self,
        room: &MeasuredRoom,
        question: &OpenQuestion,
        observer: &dyn Observer,
    ) -> Result<Vec<f64>, PlanError> {
        let FittedQuestion { fits, .. } = self.fitted(room, question, observer)?;
        Ok(fits.iter().map(|fit| fit.log_evidence).collect())
    }

    fn enough(&self, candidates: &Candidates) -> Result<(), PlanError> {
        for (kind, asked, what) in [
            (Kind::Microphone, self.config.microphones, "microphones"),
            (Kind::Source, self.config.sources, "source places"),
        ] {
            let found = candidates.all.iter().filter(|(m, _)| m.kind() == kind).count();
            if asked > found {
                return Err(PlanError::FewPlaces { what, asked, found });
            }
        }
        Ok(())
    }

    /// The room with a microphone at some free place: where it stands means nothing, for every candidate moves it.
    fn with_microphone(&self, room: &MeasuredRoom) -> Result<MeasuredRoom, PlanError> {
        let mesh = MeshScene::new(room.scene())?;
        let taken_m: Vec<[f64; 3]> = room.sources().iter().map(|s| s.position_m).collect();
        let height_m = microphone_height_m(room);
        let free = grid((room, &mesh), &taken_m, height_m, self.config.clearance_m, 4)?;
        Ok(room.unmeasured_at(vec![Receiver::omni("microphone", free.places_m[0])?]))
    }

    /// All cases of the catalogue; none of a microphone that is not there yet.
    fn cases(&self, base: &Baseline, is_planned: bool) -> Vec<CatalogueCase> {
        let of_receiver = |case: &Case| {
            case.parameters.iter().any(|p| p.receiver.is_some())
                || case.relaxes.iter().any(|(n, _)| matches!(n, Nuisance::ReceiverPosition(_)))
        };
        let mut cases = all_cases(&self.effects, base.survey());
        cases.retain(|c| !(is_planned && of_receiver(&c.case)));
        cases
    }

    /// The leading hypotheses, fitted, with their cases and what the fit says of materials and scatter.
    fn fitted(
        &self,
        room: &MeasuredRoom,
        question: &OpenQuestion,
        observer: &dyn Observer,
    ) -> Result<FittedQuestion, PlanError> {
        let mut baseline = Baseline::new(room, &[], &self.config.diagnose, &self.tracer, observer)?;
        let mut cases = all_cases(&self.effects, baseline.survey());
        // Tables of the others would only take time.
        let asked = || question.sure.iter().chain(&question.leading);
        cases.retain(|c| asked().any(|h| h.effect == c.id));
        let mut refused = baseline.prepare(&cases)?.into_iter();
        cases.retain(|_| !refused.next().unwrap_or(false));
        let planned = self.planned(question, &cases)?;
        let used = vec![true; baseline.pairs()];
        baseline.calibrate_scatter(&[], &used)?;
        let mut fits = fit_all(&baseline, &cases, self.effects.len(), &planned)?;
        keep_used(&mut cases, &mut fits, &planned);
        let fitted = Fitted::of(&baseline);
        Ok(FittedQuestion { planned, cases, fits, fitted })
    }

    /// A question without effects that it knows and that have no case here: for a plan no waves are solved, and some need what this room has not.
    fn planned(&self, question: &OpenQuestion, cases: &[CatalogueCase]) -> Result<OpenQuestion, PlanError> {
        let is_planned = |h: &Hypothesis| !self.knows(&h.effect) || cases.iter().any(|c| c.id == h.effect);
        let kept = |all: &[Hypothesis]| all.iter().filter(|h| is_planned(h)).cloned().collect();
        let planned = OpenQuestion { sure: kept(&question.sure), leading: kept(&question.leading) };
        if planned.leading.len() < 2 && question.leading.len() > 1 {
            let missing = question.leading.iter().filter(|h| !is_planned(h)).map(ToString::to_string);
            return Err(PlanError::NotPlanned { names: missing.collect::<Vec<_>>().join(", ") });
        }
        Ok(planned)
    }
}

/// A question as it can be planned, and its hypotheses as fitted to what was measured.
struct FittedQuestion {
    planned: OpenQuestion,
    cases: Vec<CatalogueCase>,
    fits: Vec<Fit>,
    fitted: Fitted,
}

/// Seconds by stage.
struct Clock {
    started: Instant,
    laps: Vec<(String, f64)>,
}

impl Default for Clock {
    fn default() -> Self {
        Self { started: Instant::now(), laps: Vec::new() }
    }
}

impl Clock {
    fn lap(&mut self, stage: &str) {
        self.laps.push((stage.to_owned(), self.started.elapsed().as_secs_f64()));
        self.started = Instant::now();
    }
}
