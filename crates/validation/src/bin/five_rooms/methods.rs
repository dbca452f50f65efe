//! Ways from a recording or a measured response to a rendered one.

use crate::error::Error;
use crate::judge::{Octave, Truth, judge};
use crate::rooms::{Pair, Room};
use sabine::acoustics::{
    Bands, Error as AcousticsError, ImpulseResponse, Material, PerBand, RoomEstimator, RoomTargets, Signal,
    equalisation,
};
use sabine::eqfilter::{EqFilter, EqFilterConfig};
use sabine::optimize::{
    AbsorptionPrior, FitConfig, FitProblem, MaterialFitter, MeasuredDecay, MeasuredPair, SlopeObjective,
};
use sabine::paths::{Conditions, PathSet, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::{MatchConfig, MatchInput, Recording, RoomMatch, match_room, match_room_with};
use serde::Serialize;

/// How a response was rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// `sabine match`: from speech.
    Blind,
    /// The paper's objective with what was heard in the same speech.
    BlindPaper,
    /// `sabine fit --responses`, and the filter from the response.
    Given,
    /// `sabine match` told the measured T30 and EQ in place of what it hears: the error of everything but the estimator.
    GivenTargets,
    /// Li's objective with the measured T30, and the filter from the response.
    GivenLi2018,
}

impl Method {
    /// In the order of the tables.
    pub const ALL: [Self; 5] =
        [Self::Blind, Self::BlindPaper, Self::Given, Self::GivenTargets, Self::GivenLi2018];
}

/// Settings that all ways share.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Rays of every trace.
    pub rays: usize,
    /// Seed of rays and noise.
    pub seed: u64,
}

/// A rendered response.
pub struct Rendered {
    /// How.
    pub method: Method,
    /// Each octave against the measured response.
    pub octaves: Vec<Octave>,
    /// The response behind the filter.
    pub response: ImpulseResponse,
}

/// Rate of what is rendered, in Hz.
const RATE_HZ: u32 = 48_000;
/// Greatest correction by the filter, in dB: that of the match.
const LARGEST_EQ_DB: f64 = 20.0;
/// Responses are traced as long as this many times the longest reverberation time, within these limits in seconds; those of objectives
/// that may ring too long are given twice the time.
const DURATION_FACTOR: f64 = 1.25;
const DURATION_S: (f64, f64) = (0.3, 6.0);
const BASELINE_FACTOR: f64 = 2.0;

/// A measured response in its room, and a recording made through it.
pub struct Case<'a> {
    /// The room.
    pub room: &'a Room,
    /// The response.
    pub pair: &'a Pair,
    /// What was read from it.
    pub truth: &'a Truth,
    /// Speech in the room.
    pub speech: &'a Signal,
    /// Sound to place there.
    pub dry: &'a Signal,
    /// Rays and seed.
    pub settings: Settings,
}

/// What a measured response says, as an estimator would.
struct Measured(RoomTargets);

impl RoomEstimator for Measured {
    fn estimate(&self, _speech: &Signal) -> Result<RoomTargets, AcousticsError> {
        Ok(self.0.clone())
    }
}

impl Case<'_> {
    /// Renders the response in every way.
    ///
    /// # Errors
    /// What stands in the way of any.
    pub fn render(&self) -> Result<Vec<Rendered>, Error> {
        let measured = self.truth.targets()?;
        let blind = match_room(&self.input(), &self.config(), &())?;
        let told = match_room_with(
            &Measured(measured.clone()),
            &|duration_s| Ok(Box::new(self.tracer(duration_s, 0)?)),
            &self.input(),
            &self.config(),
            &(),
        )?;
        let heard = &blind.targets;
        Ok(vec![
            self.matched(Method::Blind, &blind)?,
            self.slope(Method::BlindPaper, SlopeObjective::Paper, heard, EqFilterConfig::PAPER)?,
            self.responses(&measured)?,
            self.matched(Method::GivenTargets, &told)?,
            self.slope(Method::GivenLi2018, SlopeObjective::Li2018, &measured, EqFilterConfig::default())?,
        ])
    }

    fn input(&self) -> MatchInput<'_> {
        MatchInput {
            speech: Recording { name: "speech", signal: self.speech },
            dry: Recording { name: "dry voice", signal: self.dry },
            room: &self.room.model,
            source: &self.pair.source,
            receiver: &self.pair.receiver,
        }
    }

    fn config(&self) -> MatchConfig {
        let tracer = TracerConfig { rays: self.settings.rays, ..TracerConfig::default() };
        MatchConfig { seed: self.settings.seed, tracer, ..MatchConfig::default() }
    }

    fn matched(&self, method: Method, found: &RoomMatch) -> Result<Rendered, Error> {
        self.filtered(method, &found.targets, &found.response, &found.eq_filter)
    }

    /// One fit of a slope to reverberation times on one trace, without a look at what is rendered: as the objectives are published.
    fn slope(
        &self,
        method: Method,
        objective: SlopeObjective,
        targets: &RoomTargets,
        filter: EqFilterConfig,
    ) -> Result<Rendered, Error> {
        let longest_s = targets.t60_s().values().iter().map(|t| t.value).fold(0.0, f64::max);
        let paths = self.trace(BASELINE_FACTOR * DURATION_FACTOR * longest_s, 0)?;
        let (materials, priors) = (self.materials(), AbsorptionPrior::of_room(&self.room.model, Bands::T60));
        let air = self.room.model.air();
        let fitter = MaterialFitter::new(FitConfig { objective, ..FitConfig::default() })?;
        let problem = FitProblem::new(&materials, &priors, &air);
        let fit = fitter.fit_t60(&[&paths], &problem, targets.t60_s(), &())?;
        self.equalised(method, targets, &paths, &fit.materials, filter)
    }

    /// Materials fitted to the response itself; rendered from rays that the fit has not seen.
    fn responses(&self, targets: &RoomTargets) -> Result<Rendered, Error> {
        let measured = MeasuredDecay::new(&self.pair.response, Bands::T60)?;
        let longest_s = targets.t60_s().values().iter().map(|t| t.value).fold(0.0, f64::max);
        let duration_s = DURATION_FACTOR * longest_s;
        let paths = self.trace(duration_s, 0)?;
        let (materials, priors) = (self.materials(), AbsorptionPrior::of_room(&self.room.model, Bands::T60));
        let air = self.room.model.air();
        let pairs = [MeasuredPair { measured: &measured, paths: &paths }];
        let problem = FitProblem::new(&materials, &priors, &air);
        let measurement = self.room.model.measurement();
        let found =
            MaterialFitter::new(FitConfig::default())?.fit_responses(&pairs, measurement, &problem, &())?;
        let other = self.trace(duration_s, 1)?;
        self.equalised(Method::Given, targets, &other, &found.fit.materials, EqFilterConfig::default())
    }

    fn materials(&self) -> Vec<Material> {
        let named = self.room.model.scene().materials().iter();
        named.map(|named| named.material.resampled(Bands::T60)).collect()
    }

    fn tracer(&self, duration_s: f64, more_seed: u64) -> Result<PathTracer, sabine::propagate::Error> {
        PathTracer::new(TracerConfig {
            rays: self.settings.rays,
            duration_s,
            seed: self.settings.seed.wrapping_add(more_seed),
            ..TracerConfig::default()
        })
    }

    fn trace(&self, duration_s: f64, more_seed: u64) -> Result<PathSet, Error> {
        let model = &self.room.model;
        let tracer = self.tracer(duration_s.clamp(DURATION_S.0, DURATION_S.1), more_seed)?;
        let scene = model.scene().with_materials(self.materials())?;
        let (source, receiver) = (model.source(&self.pair.source)?, model.receiver(&self.pair.receiver)?);
        Ok(tracer.trace(&scene, source, receiver, &model.air(), &())?)
    }

    /// Renders, and filters by what the response still misses of the targets' equalisation.
    fn equalised(
        &self,
        method: Method,
        targets: &RoomTargets,
        paths: &PathSet,
        materials: &[Material],
        config: EqFilterConfig,
    ) -> Result<Rendered, Error> {
        let settings =
            RenderConfig { sample_rate_hz: RATE_HZ, seed: self.settings.seed, ..RenderConfig::default() };
        let air = self.room.model.air();
        let response = PressureRenderer::new(settings)?.render(paths, &Conditions::new(materials, &air))?;
        let simulated = equalisation(&response, Bands::EQ)?;
        let gains = PerBand::from_fn(Bands::EQ, |b| match &simulated.values()[b] {
            Ok(own) => (targets.eq_db().values()[b].value - own.value).clamp(-LARGEST_EQ_DB, LARGEST_EQ_DB),
            Err(_) => 0.0,
        });
        let filter = EqFilter::design(&gains, RATE_HZ, config)?;
        self.filtered(method, targets, &response, &filter)
    }

    fn filtered(
        &self,
        method: Method,
        targets: &RoomTargets,
        response: &ImpulseResponse,
        filter: &EqFilter,
    ) -> Result<Rendered, Error> {
        let filtered = ImpulseResponse::from(filter.apply(&Signal::from(response.clone()))?);
        let octaves = judge(self.truth, targets, response, &filtered)?;
        Ok(Rendered { method, octaves, response: filtered })
    }
}
