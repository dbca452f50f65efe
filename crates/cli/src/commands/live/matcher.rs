//! From an estimate to a response that meets it.

use crate::failure::Failure;
use crate::modelled::{PairModel, PathModel};
use sabine::acoustics::{Air, Bands, ImpulseResponse, Material, PerBand, RoomTargets, Signal, equalisation};
use sabine::eqfilter::{AboveBand, EqDesigner, EqFilterConfig};
use sabine::optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFitter};
use sabine::paths::{PathSet, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::{DiffuseRoom, MeasuredRoom, Receiver, Scene, Source};
use std::time::Instant;

/// Sample rate of the responses in Hz.
pub const SAMPLE_RATE_HZ: u32 = 48_000;
/// Lengths of traces in seconds: the least that holds 1.25 times the longest target is taken, so that the same targets give
/// the same response whatever came before them.
const TRACES_S: [f64; 4] = [0.75, 1.5, 3.0, 6.0];
const DURATION_FACTOR: f64 = 1.25;
/// Greatest correction by the equalisation, in dB.
const LARGEST_EQ_DB: f64 = 20.0;

/// Everything that a refit needs; the room is traced again only where a trace is too short.
pub struct Matcher {
    scene: Scene,
    source: Source,
    receiver: Receiver,
    air: Air,
    materials: Vec<Material>,
    model: PairModel,
    priors: Vec<AbsorptionPrior>,
    tracer: TracerConfig,
    fitter: MaterialFitter,
    renderer: PressureRenderer,
    designer: EqDesigner,
    /// Newest trace and its length in seconds.
    paths: (f64, PathSet),
    first: ImpulseResponse,
    start_s: f64,
}

/// What a refit gives.
pub struct Matched {
    /// The targets that it was made for.
    pub targets: RoomTargets,
    /// Response with the fitted materials.
    pub response: ImpulseResponse,
    /// The same through the equalisation filter, whose delay is taken out.
    pub equalised: ImpulseResponse,
    /// Octaves in which the fit has not converged, in Hz.
    pub unconverged_hz: Vec<f64>,
    /// Seconds that it took.
    pub seconds: f64,
}

impl Matcher {
    /// Traces the room with the materials of its file.
    pub fn new(
        room: &MeasuredRoom,
        source: &Source,
        receiver: &Receiver,
        model: &PathModel,
        (rays, seed): (usize, u64),
    ) -> Result<Self, Failure> {
        let start = Instant::now();
        let bands = Bands::SIMULATION;
        let materials: Vec<Material> =
            room.scene().materials().iter().map(|named| named.material.resampled(bands)).collect();
        let priors = AbsorptionPrior::of_room(room, bands);
        let scene = room.scene().with_materials(materials.clone())?;
        let air = room.air();
        let diffuse = DiffuseRoom::of_scene(&scene, &air, bands)?;
        let longest_s = diffuse.values().iter().map(DiffuseRoom::eyring_t60_s).fold(0.0, f64::max);
        let tracer = model.tracer(TracerConfig { rays, seed, ..TracerConfig::default() });
        let own = model.between(&scene, (source, receiver), &air)?;
        let render = RenderConfig { sample_rate_hz: SAMPLE_RATE_HZ, seed, ..RenderConfig::default() };
        let renderer = PressureRenderer::new(render)?;
        let duration_s = trace_s(longest_s);
        let paths = trace(&tracer, duration_s, &scene, source, receiver, &air)?;
        if paths.is_empty() {
            let (from, to) = (source.id.clone(), receiver.id.clone());
            return Err(sabine::Error::NoPath { source_id: from, receiver: to }.into());
        }
        let first = renderer.render(&paths, &own.conditions(&materials, &air))?;
        let above = Some(AboveBand { from_band_hz: 8000.0, gain_db: -50.0 });
        let config = EqFilterConfig { above, ..EqFilterConfig::default() };
        Ok(Self {
            scene,
            source: source.clone(),
            receiver: receiver.clone(),
            air,
            materials,
            model: own,
            priors,
            tracer,
            fitter: MaterialFitter::new(FitConfig::default())?,
            renderer,
            designer: EqDesigner::new(Bands::EQ, SAMPLE_RATE_HZ, config)?,
            paths: (duration_s, paths),
            first,
            start_s: start.elapsed().as_secs_f64(),
        })
    }

    /// Response with the materials of the room file: what is heard before the first estimate.
    pub fn first(&self) -> &ImpulseResponse {
        &self.first
    }

    /// Seconds that it took to be ready.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// Longest response that can come, in samples.
    pub fn longest_response(&self) -> usize {
        // Twice the filter: it lengthens the response by its taps.
        (TRACES_S[TRACES_S.len() - 1] * f64::from(SAMPLE_RATE_HZ)) as usize + 2 * self.designer.taps() + 4800
    }

    /// Fits the materials to the reverberation times, renders, and lets a filter do what is left.
    pub fn update(&mut self, targets: RoomTargets) -> Result<Matched, Failure> {
        let start = Instant::now();
        let longest_s = targets.t60_s().values().iter().map(|t| t.value).fold(0.0, f64::max);
        let duration_s = trace_s(longest_s);
        if duration_s != self.paths.0 {
            let paths =
                trace(&self.tracer, duration_s, &self.scene, &self.source, &self.receiver, &self.air)?;
            self.paths = (duration_s, paths);
        }
        let paths = &self.paths.1;
        let stated = self.model.conditions(&self.materials, &self.air);
        let under = if self.model.is_plain() { Vec::new() } else { vec![stated] };
        let problem = FitProblem::new(&self.materials, &self.priors, &self.air).under(&under);
        let fit = self.fitter.fit_t60(&[paths], &problem, targets.t60_s(), &())?;
        let response = self.renderer.render(paths, &self.model.conditions(&fit.materials, &self.air))?;
        let simulated = equalisation(&response, Bands::EQ)?;
        let gains_db = PerBand::from_fn(Bands::EQ, |band| {
            // An octave in which the simulation cannot be read is left as it is.
            let simulated = simulated.values()[band].as_ref().ok();
            let gain = simulated.map_or(0.0, |s| targets.eq_db().values()[band].value - s.value);
            gain.clamp(-LARGEST_EQ_DB, LARGEST_EQ_DB)
        });
        let filter = self.designer.design(&gains_db)?;
        let equalised = filter.apply(&Signal::from(response.clone()))?;
        Ok(Matched {
            targets,
            response,
            equalised: equalised.into(),
            unconverged_hz: fit.unconverged_hz(),
            seconds: start.elapsed().as_secs_f64(),
        })
    }
}

fn trace_s(longest_s: f64) -> f64 {
    let needed_s = DURATION_FACTOR * longest_s;
    TRACES_S.into_iter().find(|&s| s >= needed_s).unwrap_or(TRACES_S[TRACES_S.len() - 1])
}

fn trace(
    tracer: &TracerConfig,
    duration_s: f64,
    scene: &Scene,
    source: &Source,
    receiver: &Receiver,
    air: &Air,
) -> Result<PathSet, Failure> {
    let config = TracerConfig { duration_s, ..tracer.clone() };
    Ok(PathTracer::new(config)?.trace(scene, source, receiver, air, &())?)
}
