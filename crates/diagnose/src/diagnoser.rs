//! The whole diagnosis: observe, simulate, infer, confirm, report.

use crate::config::DiagnoseConfig;
use crate::effect::Effect;
use crate::effects::{LawEffect, UnknownLaw, catalogue};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::candidates;
use crate::infer::confirmation::confirm;
use crate::infer::ray_dependence::more_with_half;
use crate::infer::search::Search;
use crate::infer::selection::select;
use crate::report::composition::compose;
use crate::report::diagnosis::Diagnosis;
use crate::simulate::scene_tracer::{Rays, SceneTracer};
use sabine_acoustics::Observer;
use sabine_paths::laws::Law;
use sabine_scene::MeasuredRoom;
use std::sync::Arc;
use std::time::Instant;

/// Says what is wrong with a simulated room, given what was measured in it.
///
/// 1. Traces every measured pair and fits the baseline: absorption within its stated uncertainty, gains and latencies as
///    `[measurement]` says, places within their tolerance.
/// 2. Fits every case of every effect beside all of these, and the smooth discrepancy that has no name; the evidence of each is its
///    likelihood with all parameters integrated out (Laplace's approximation), which charges for every parameter that is not needed.
/// 3. Names the strongest if its odds, corrected for the number tried, reach [`DiagnoseConfig::naming_nats`]; and so on up to
///    [`DiagnoseConfig::most_causes`]; drops those that later ones made superfluous.
/// 4. Predicts positions that it leaves out.
///
/// Same seed, same diagnosis, on any number of threads.
pub struct Diagnoser {
    pub(crate) config: DiagnoseConfig,
    pub(crate) effects: Vec<Box<dyn Effect>>,
    tracer: Arc<dyn SceneTracer>,
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
        Ok(Self { config, effects: catalogue(), tracer })
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
            if self.effects.iter().any(|e| e.id() == law.id()) {
                let reason = "an effect, or another law, has this identifier".to_owned();
                return Err(Error::LawNotWeighed { id: law.id().to_owned(), reason });
            }
            self.effects.push(Box::new(LawEffect::new(law)?));
        }
        Ok(self)
    }

    /// With [`UnknownLaw`] beside its effects: what the misfit goes with, where no listed cause explains it.
    #[must_use]
    pub fn discovering(mut self) -> Self {
        self.effects.push(Box::new(UnknownLaw));
        self
    }

    /// With another tracer than that of `sabine-propagate`; [`EachScene`](crate::EachScene) makes one of any
    /// [`Propagator`](sabine_paths::Propagator). [`DiagnoseConfig::rays`], `image_order` and `allow_leaks` then mean nothing.
    #[must_use]
    pub fn with_tracer(self, tracer: impl SceneTracer + 'static) -> Self {
        Self { tracer: Arc::new(tracer), ..self }
    }

    /// With those effects of its catalogue that have these identifiers.
    ///
    /// # Errors
    /// [`Error::UnknownEffect`] for an identifier that none has.
    pub fn with_only(mut self, ids: &[String]) -> Result<Self, Error> {
        if let Some(id) = ids.iter().find(|id| self.effects.iter().all(|e| e.id() != id.as_str())) {
            return Err(Error::UnknownEffect { id: id.clone() });
        }
        self.effects.retain(|e| ids.iter().any(|id| *id == e.id()));
        Ok(self)
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
        let mut baseline = Baseline::new(room, &held, &self.config, &self.tracer, observer)?;
        let used = baseline.observations.fitted.clone();
        let mut cases = candidates::cases(&self.effects, baseline.survey());
        // What cannot be prepared takes no part.
        let started = Instant::now();
        let mut refused = baseline.prepare(&cases)?.into_iter();
        cases.retain(|_| !refused.next().unwrap_or(false));
        *baseline.seconds.entry("baseline").or_default() += started.elapsed().as_secs_f64();

        let started = Instant::now();
        baseline.calibrate_scatter(&[], &used)?;
        let arrival_fits = Arc::default();
        let first_dispersion = baseline.dispersion.clone();
        let mut found = select(&mut baseline, &cases, self.effects.len(), (&used, &arrival_fits), observer)?;
        let other_rays = (&*self.tracer, observer);
        found.more_with_half = more_with_half(&mut baseline, &cases, &found.chosen, &used, other_rays)?;
        baseline.seconds.insert("search", started.elapsed().as_secs_f64());

        let search = Search::new(&baseline, &cases, self.effects.len(), used).knowing(&arrival_fits);
        let confirmed = confirm(&search, &mut found, &held, observer)?;
        compose(&self.effects, &search, &found, confirmed, &first_dispersion, observer)
    }
}

/// Receivers (indices) to be held out.
fn held_receivers(room: &MeasuredRoom, hold_out: &[String]) -> Result<Vec<usize>, Error> {
    let mut held: Vec<usize> = Vec::new();
    for id in hold_out {
        let index = room.receivers().iter().position(|r| r.id == *id);
        let index = index.filter(|&i| room.responses().iter().any(|r| r.receiver == i));
        held.push(index.ok_or_else(|| Error::UnknownHoldOut { id: id.clone() })?);
    }
    if !room.responses().is_empty() && room.responses().iter().all(|r| held.contains(&r.receiver)) {
        return Err(Error::AllHeldOut);
    }
    Ok(held)
}
