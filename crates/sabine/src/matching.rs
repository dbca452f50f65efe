//! The main job: from speech and a rough room to sound that belongs there.

mod warnings;

use crate::clock::Clock;
use crate::low_end::{JoinedWaves, LowEnd};
use crate::room_renderer::RoomRenderer;
use crate::{Error, Recording, Warning};
use sabine_acoustics::{
    Air, Bands, EnergyDecayCurve, Estimate, FilterBank, ImpulseResponse, Material, Observer, PerBand,
    Reading, RoomEstimator, RoomParameters, RoomTargets, Signal, equalisation, report, resample,
};
use sabine_eqfilter::{AboveBand, EqFilter, EqFilterConfig};
use sabine_estimator::Estimator;
use sabine_optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFit, MaterialFitter};
use sabine_paths::laws::{BoundLaws, Law, LawSite};
use sabine_paths::{Conditions, Propagator};
use sabine_propagate::{MeshReport, PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine_scene::MeasuredRoom;
use warnings::{warn_of_eq, warn_of_fit, warn_of_misses, warn_of_uncertain_eq};

/// What to match: a recording, the room it was made in, and the sound to place there.
#[derive(Clone, Copy, Debug)]
pub struct MatchInput<'a> {
    /// Reverberant speech, at least one second.
    pub speech: Recording<'a>,
    /// Sound without reverberation.
    pub dry: Recording<'a>,
    /// The room's model.
    pub room: &'a MeasuredRoom,
    /// Where the dry sound comes from: an identifier of the room file.
    pub source: &'a str,
    /// Where it is heard: an identifier of the room file.
    pub receiver: &'a str,
}

/// Settings of [`match_room`].
#[derive(Clone, Debug)]
pub struct MatchConfig {
    /// Seed of rays and noise: the same seed gives the same sound.
    pub seed: u64,
    /// The tracer; its duration and seed are set by the match.
    pub tracer: TracerConfig,
    /// The material fit.
    pub fit: FitConfig,
    /// The room is traced for this many times the longest target, so that the decay is complete where it is read.
    pub duration_factor: f64,
    /// Greatest correction by the equalisation filter in either direction, in dB; beyond it lies noise rather than sound.
    pub largest_eq_db: f64,
    /// Level of the bands from 8 kHz on, in dB: the speech that was listened to holds nothing there (Tang et al. 2020,
    /// section 3.3). `None` leaves them as the simulation has them.
    pub above_8_khz_db: Option<f64>,
    /// Below this frequency in Hz (20 to 3,500) the response is a solution of the wave equation
    /// ([`WaveSolver`](sabine_propagate::wave::WaveSolver)) with the fitted materials, from an omnidirectional source; its time grows with
    /// the fourth power of the frequency. The fit is to the paths.
    pub wave_below_hz: Option<f64>,
    /// Formulas that change what paths carry, those of an extended model for instance: materials are fitted and the response is rendered
    /// under them. None that adds sound.
    pub laws: Vec<Law>,
    /// By which share walls react locally (-0.5 to 1.5; [`Conditions::with_local_reaction`]), as an extended model may have it; 0 is absorption
    /// that is the same at all angles. Impedances are those of the stated materials while absorption is fitted.
    pub locally_reacting_share: f64,
}

impl Default for MatchConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            // Enough that the decay of a living room is uncertain by less than 3 % in every octave.
            tracer: TracerConfig { rays: 40_000, ..TracerConfig::default() },
            fit: FitConfig::default(),
            duration_factor: 1.25,
            largest_eq_db: 20.0,
            above_8_khz_db: Some(-50.0),
            wave_below_hz: None,
            laws: Vec::new(),
            locally_reacting_share: 0.0,
        }
    }
}

/// The matched room.
#[derive(Clone, Debug)]
pub struct RoomMatch {
    /// What the recording sounds like, per octave.
    pub targets: RoomTargets,
    /// Air of the room.
    pub air: Air,
    /// The fitted materials, and what stood in the way.
    pub fit: MaterialFit,
    /// Names of the materials, in the order of the fit.
    pub material_names: Vec<String>,
    /// The materials of the room file, on the bands of the simulation.
    pub materials_before: Vec<Material>,
    /// T30 read from the rendered response, per octave of the targets, in seconds.
    pub t60_reached_s: PerBand<Reading>,
    /// Energy decay of the rendered response in each octave of the targets, in steps of [`DECAY_STEP_S`].
    pub decay: PerBand<EnergyDecayCurve>,
    /// Equalisation of the rendered response before the filter, in dB relative to 1 kHz.
    pub eq_simulated_db: PerBand<f64>,
    /// Equalisation of the rendered response behind the filter, in dB relative to 1 kHz: what is heard in `matched`.
    pub eq_reached_db: PerBand<f64>,
    /// Pressure response of the simulation with the fitted materials; the equalisation filter is not applied to it.
    pub response: ImpulseResponse,
    /// The same with the materials of the room file: the simulation before it was matched. Waves are not joined to it.
    pub response_before: ImpulseResponse,
    /// What joining it to waves at low frequencies found, where that was asked for.
    pub waves: Option<JoinedWaves>,
    /// What the decay slopes cannot give.
    pub eq_filter: EqFilter,
    /// The dry sound in the room, aligned with the dry sound (the filter's own delay is taken out).
    pub matched: Signal,
    /// By how much `matched` was scaled to fit full scale, in dB, 0 or below: 0 for a source of the level of the dry sound at 1 m.
    pub matched_gain_db: f64,
    /// Stages with the seconds that they took, in order.
    pub seconds: Vec<(&'static str, f64)>,
    /// What a user should know before trusting the result.
    pub warnings: Vec<Warning>,
}

/// Time step of [`RoomMatch::decay`], in seconds.
pub const DECAY_STEP_S: f64 = 0.005;

/// How often the fit is corrected by what the rendered response shows.
const CORRECTIONS: usize = 3;
/// The rendered response is close enough to its target when every reachable octave is this near.
const CLOSE: f64 = 0.02;
/// Lowest rate of the matched sound in Hz: the 8 kHz octave ends at 11.2 kHz.
const LOWEST_RATE_HZ: u32 = 32_000;
/// Rate that replaces lower ones, in Hz.
const STANDARD_RATE_HZ: u32 = 48_000;
/// Shortest and longest duration that is traced, in seconds.
const DURATION_S: (f64, f64) = (0.3, 6.0);

/// Matches a room with the pretrained estimator and the path tracer.
///
/// # Errors
/// For a recording that is too short, silent or clipped, an unknown source or receiver, a room that cannot be traced, and
/// [`sabine_acoustics::Error::Cancelled`].
pub fn match_room(
    input: &MatchInput<'_>,
    config: &MatchConfig,
    observer: &dyn Observer,
) -> Result<RoomMatch, Error> {
    let mut clock = Clock::start();
    let mut warnings = input.check()?;
    report(observer, "listening", 0, 1)?;
    let estimator = Estimator::pretrained()?;
    let (from_hz, to_hz) = (input.speech.signal.sample_rate_hz(), estimator.sample_rate_hz());
    if from_hz != to_hz {
        warnings.push(Warning::SpeechResampled { from_hz, to_hz });
    }
    let heard = estimator.estimate_detailed(&resample(input.speech.signal, to_hz)?)?;
    warnings.extend(heard.warnings.into_iter().map(Warning::Speech));
    report(observer, "listening", 1, 1)?;
    clock.lap("estimate");
    let place = input.place();
    warn_of_mesh(&place, &mut warnings)?;
    let tracer = path_tracer(config);
    input.match_targets(heard.targets, warnings, clock, &tracer, config, observer)
}

/// The tracer of the workspace, for paths of up to the given duration in seconds.
pub(crate) fn path_tracer(config: &MatchConfig) -> impl Fn(f64) -> Result<Box<dyn Propagator>, Error> {
    |duration_s| {
        let settings = TracerConfig { duration_s, seed: config.seed, ..config.tracer.clone() };
        Ok(Box::new(PathTracer::new(settings)?))
    }
}

pub(crate) fn warn_of_mesh(place: &Place<'_>, warnings: &mut Vec<Warning>) -> Result<(), Error> {
    let mesh = MeshReport::inspect(place.room.scene(), place.room.source(place.source)?.position_m)?;
    warnings.extend(mesh.warnings().into_iter().map(Warning::Mesh));
    Ok(())
}

/// Matches a room with an estimator and a tracer of one's own; the estimator hears the recording at its own sample rate,
/// and `tracer` is asked for one that looks for paths of up to the given duration in seconds.
///
/// # Errors
/// As [`match_room`], and those of the estimator and the tracer.
pub fn match_room_with(
    estimator: &dyn RoomEstimator,
    tracer: &dyn Fn(f64) -> Result<Box<dyn Propagator>, Error>,
    input: &MatchInput<'_>,
    config: &MatchConfig,
    observer: &dyn Observer,
) -> Result<RoomMatch, Error> {
    let mut clock = Clock::start();
    let warnings = input.check()?;
    report(observer, "listening", 0, 1)?;
    let targets = estimator.estimate(input.speech.signal)?;
    report(observer, "listening", 1, 1)?;
    clock.lap("estimate");
    input.match_targets(targets, warnings, clock, tracer, config, observer)
}

impl MatchInput<'_> {
    /// Refuses what cannot be judged and collects what should be known.
    fn check(&self) -> Result<Vec<Warning>, Error> {
        let mut warnings = Vec::new();
        let clipped = self.speech.check()?;
        if clipped > 0.0 {
            warnings.push(Warning::SlightlyClipped { percent: 100.0 * clipped });
        }
        self.dry.check_not_silent()?;
        warnings.extend(self.place().check()?);
        Ok(warnings)
    }

    fn place(&self) -> Place<'_> {
        Place { room: self.room, source: self.source, receiver: self.receiver }
    }

    fn match_targets(
        &self,
        targets: RoomTargets,
        warnings: Vec<Warning>,
        clock: Clock,
        tracer: &dyn Fn(f64) -> Result<Box<dyn Propagator>, Error>,
        config: &MatchConfig,
        observer: &dyn Observer,
    ) -> Result<RoomMatch, Error> {
        let render =
            |renderer: &RoomRenderer| renderer.render(&resample(self.dry.signal, renderer.sample_rate_hz())?);
        let dry = DrySound { sample_rate_hz: self.dry.signal.sample_rate_hz(), render: &render };
        match_targets(targets, warnings, clock, tracer, &self.place(), &dry, config, observer)
    }
}

/// Where the sound comes from and where it is heard.
pub(crate) struct Place<'a> {
    pub room: &'a MeasuredRoom,
    pub source: &'a str,
    pub receiver: &'a str,
}

impl Place<'_> {
    /// That there are such a source and receiver, and what should be known of the room.
    pub(crate) fn check(&self) -> Result<Vec<Warning>, Error> {
        self.room.source(self.source)?;
        self.room.receiver(self.receiver)?;
        let mut warnings: Vec<Warning> = self.room.notes().into_iter().map(Warning::Room).collect();
        if self.room.air_assumed() {
            warnings.push(Warning::AirAssumed);
        }
        Ok(warnings)
    }
}

/// Renders a dry sound; gives the sound in the room and the gain in dB that keeps it within full scale.
type Render<'a> = dyn Fn(&RoomRenderer) -> Result<(Signal, f64), Error> + 'a;

/// What is to be placed in the room: in memory or in a file.
pub(crate) struct DrySound<'a> {
    /// Its sample rate.
    pub sample_rate_hz: u32,
    /// How it is rendered.
    pub render: &'a Render<'a>,
}

/// Everything after listening.
#[allow(clippy::too_many_arguments)] // the state of a match, handed on once
pub(crate) fn match_targets(
    targets: RoomTargets,
    mut warnings: Vec<Warning>,
    mut clock: Clock,
    tracer: &dyn Fn(f64) -> Result<Box<dyn Propagator>, Error>,
    place: &Place<'_>,
    dry: &DrySound<'_>,
    config: &MatchConfig,
    observer: &dyn Observer,
) -> Result<RoomMatch, Error> {
    let room = place.room;
    let (source, receiver) = (room.source(place.source)?, room.receiver(place.receiver)?);
    let bands = Bands::SIMULATION;
    let air = room.air();
    let materials_before: Vec<Material> =
        room.scene().materials().iter().map(|named| named.material.resampled(bands)).collect();
    let priors = AbsorptionPrior::of_room(room, bands);
    let scene = room.scene().with_materials(materials_before.clone())?;
    let longest_s = targets.t60_s().values().iter().map(|t| t.value).fold(0.0, f64::max);
    let duration_s = (config.duration_factor * longest_s).clamp(DURATION_S.0, DURATION_S.1);
    let sample_rate_hz = match dry.sample_rate_hz {
        rate if rate >= LOWEST_RATE_HZ => rate,
        from_hz => {
            warnings.push(Warning::DryResampled { from_hz, to_hz: STANDARD_RATE_HZ });
            STANDARD_RATE_HZ
        }
    };
    // Whatever would be refused is refused before the room is traced.
    let renderer =
        PressureRenderer::new(RenderConfig { sample_rate_hz, seed: config.seed, ..RenderConfig::default() })?;
    let fitter = MaterialFitter::new(config.fit.clone())?;
    fitter.check_t60(targets.t60_s(), bands, &air, duration_s)?;
    let low_end = config.wave_below_hz.map(|hz| LowEnd::new(hz, sample_rate_hz, room, source)).transpose()?;
    let site = LawSite::new(&scene, source, receiver, &air);
    let laws = BoundLaws::new(&config.laws, &site).map_err(sabine_acoustics::Error::from)?;
    let paths = tracer(duration_s)?.trace(&scene, source, receiver, &air, observer)?;
    if paths.is_empty() {
        return Err(Error::NoPath { source_id: source.id.clone(), receiver: receiver.id.clone() });
    }
    clock.lap("trace");

    let plain = Conditions::new(&materials_before, &air);
    let mut before = if laws.is_empty() { plain } else { plain.with_laws(&laws) };
    if config.locally_reacting_share != 0.0 {
        before = before.with_local_reaction(config.locally_reacting_share, &materials_before);
    }
    let is_plain = laws.is_empty() && config.locally_reacting_share == 0.0;
    let under = if is_plain { Vec::new() } else { vec![before] };
    let problem = FitProblem::new(&materials_before, &priors, &air).under(&under);
    let mut aim = targets.t60_s().clone();
    let mut corrections = 0;
    let (fit, mut response, mut parameters) = loop {
        let fit = fitter.fit_t60(&[&paths], &problem, &aim, observer)?;
        clock.lap("fit");
        let response = renderer.render(&paths, &before.with_materials(&fit.materials))?;
        let parameters = RoomParameters::measure(&response, Bands::T60)?;
        clock.lap("render");
        let next = corrected(&aim, targets.t60_s(), &parameters.t30_s, &fit);
        corrections += 1;
        match next {
            Some(next) if corrections <= CORRECTIONS => aim = next,
            _ => break (fit, response, parameters),
        }
    };
    let response_before = renderer.render(&paths, &before)?;
    let mut waves = None;
    if let Some(low_end) = low_end {
        let (joined, found) = low_end.join((source, receiver), &fit.materials, &air, &response, observer)?;
        parameters = RoomParameters::measure(&joined, Bands::T60)?;
        (response, waves) = (joined, Some(found));
        clock.lap("waves");
    }
    warn_of_uncertain_eq(targets.eq_db(), &mut warnings);
    warn_of_misses(targets.t60_s(), &parameters.t30_s, &fit, &mut warnings);
    warn_of_fit(&fit, room, &mut warnings);
    warnings.extend(fit.unreachable.iter().map(|u| Warning::Unreachable(u.clone())));
    let levels = |response: &ImpulseResponse| -> Result<PerBand<f64>, Error> {
        let readings = equalisation(response, Bands::EQ)?;
        Ok(readings.map(|reading| reading.as_ref().map_or(f64::NAN, |estimate| estimate.value)))
    };
    let eq_simulated_db = levels(&response)?;
    let eq_filter = {
        let above = config.above_8_khz_db.map(|gain_db| AboveBand { from_band_hz: 8000.0, gain_db });
        let gains_db = eq_gains(targets.eq_db(), &eq_simulated_db, config.largest_eq_db, &mut warnings)?;
        EqFilter::design(&gains_db, sample_rate_hz, EqFilterConfig { above, ..EqFilterConfig::default() })?
    };
    warn_of_eq(&eq_filter, &mut warnings);
    let filtered = eq_filter.apply(&Signal::from(response.clone()))?;
    let eq_reached_db = levels(&ImpulseResponse::from(filtered))?;
    let (matched, matched_gain_db) = (dry.render)(&RoomRenderer::new(&response, &eq_filter))?;
    clock.lap("filter");
    let decay = decay_curves(&response)?;
    Ok(RoomMatch {
        targets,
        air,
        material_names: room.scene().materials().iter().map(|named| named.name.clone()).collect(),
        materials_before,
        t60_reached_s: parameters.t30_s,
        fit,
        decay,
        eq_simulated_db,
        eq_reached_db,
        response,
        response_before,
        waves,
        eq_filter,
        matched,
        matched_gain_db,
        seconds: clock.stages,
        warnings,
    })
}

/// Aims that make up for what the rendered response still misses, or nothing if it is close enough.
///
/// The fit works on path energies; the rendered response is read through octave filters, which let a slowly decaying band
/// into a faster neighbour. Octaves that cannot reach their target are left alone.
fn corrected(
    aim: &PerBand<Estimate>,
    target: &PerBand<Estimate>,
    reached: &PerBand<Reading>,
    fit: &MaterialFit,
) -> Option<PerBand<Estimate>> {
    let mut off = false;
    let bands = target.bands();
    let next = PerBand::from_fn(bands, |band| {
        let (aim, target) = (aim.values()[band], target.values()[band]);
        let stuck = fit.unreachable.iter().any(|u| u.band_hz == bands.nominal_hz(band));
        match &reached.values()[band] {
            Ok(reached) if !stuck => {
                let miss = target.value / reached.value;
                off |= (miss - 1.0).abs() > CLOSE;
                Estimate::new(aim.value * miss, aim.standard_error)
            }
            _ => aim,
        }
    });
    off.then_some(next)
}

/// What the filter must add to the simulation, kept within what is sensible.
fn eq_gains(
    target_db: &PerBand<Estimate>,
    simulated_db: &PerBand<f64>,
    largest_db: f64,
    warnings: &mut Vec<Warning>,
) -> Result<PerBand<f64>, Error> {
    let bands = target_db.bands();
    let gains = target_db.zip_with(simulated_db, |target, simulated| {
        if simulated.is_finite() { target.value - simulated } else { 0.0 }
    })?;
    Ok(PerBand::from_fn(bands, |band| {
        let gain = gains.values()[band];
        if gain.abs() > largest_db {
            warnings.push(Warning::EqLimited {
                band_hz: bands.nominal_hz(band),
                wanted_db: gain,
                limit_db: largest_db,
            });
        }
        gain.clamp(-largest_db, largest_db)
    }))
}

/// Energy decay of a response in each octave of the targets.
fn decay_curves(response: &ImpulseResponse) -> Result<PerBand<EnergyDecayCurve>, Error> {
    let rate = response.sample_rate_hz();
    let step = (f64::from(rate) * DECAY_STEP_S).round() as usize;
    let bank = FilterBank::new(Bands::T60, rate)?;
    Ok(bank.split(response.samples()).map(|band| {
        let energy: Vec<f64> =
            band.chunks(step).map(|bin| bin.iter().map(|&s| f64::from(s) * f64::from(s)).sum()).collect();
        EnergyDecayCurve::from_energy(&energy, step as f64 / f64::from(rate))
    }))
}
