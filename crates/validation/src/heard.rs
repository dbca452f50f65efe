//! Responses as they are compared: energy by octave and time, and when the direct sound arrives.

use crate::AnyError;
use rayon::prelude::*;
use sabine::acoustics::{Bands, FilterBank, ImpulseResponse, Material};
use sabine::diagnose::{ExtendedModel, ExtendedRoom};
use sabine::paths::Propagator;
use sabine::propagate::wave::{Crossover, WaveConfig, WaveResponse, WaveSolver};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::MeasuredRoom;

/// Width of the bins in seconds, from the first sample of the file on.
pub const BIN_S: f64 = 1e-3;
/// The direct sound is the strongest of the samples that follow for so long, in seconds, on the first that reaches half of the peak.
const CREST_S: f64 = 2e-4;
/// A model is rendered with so many noises, and its energies are their mean: a single one scatters as much as the measurement.
const NOISES: u64 = 4;
/// Waves last so much longer than the paths to which they are joined, in seconds.
const MORE_WAVES_S: f64 = 0.01;

/// A response.
#[derive(Clone, Debug)]
pub struct Heard {
    /// Energy of each octave in bins of 1 ms from the first sample, `[band][bin]`.
    pub energy: Vec<Vec<f64>>,
    /// When the direct sound arrives, in seconds from the first sample.
    pub arrival_s: f64,
}

impl Heard {
    fn of(response: &ImpulseResponse, bands: Bands) -> Result<Self, AnyError> {
        let rate_hz = response.sample_rate_hz();
        let split = FilterBank::new(bands, rate_hz)?.analyse(response.samples());
        let width = (BIN_S * f64::from(rate_hz)).round() as usize;
        let binned = |samples: &Vec<f32>| -> Vec<f64> {
            samples.chunks(width).map(|bin| bin.iter().map(|&s| f64::from(s).powi(2)).sum()).collect()
        };
        let samples = response.samples();
        let first = samples.iter().position(|s| s.abs() >= 0.5 * response.peak()).unwrap_or(0);
        let last = samples.len().min(first + (CREST_S * f64::from(rate_hz)) as usize);
        let crest = (first..last).max_by(|&a, &b| samples[a].abs().total_cmp(&samples[b].abs()));
        Ok(Self {
            energy: split.values().iter().map(binned).collect(),
            arrival_s: crest.unwrap_or(first) as f64 / f64::from(rate_hz),
        })
    }

    /// The mean of the energies of several; it arrives with the first of them.
    fn mean(all: Vec<Self>) -> Option<Self> {
        let share = 1.0 / all.len() as f64;
        let mut all = all.into_iter();
        let mut sum = all.next()?;
        for one in all {
            for (sum, band) in sum.energy.iter_mut().zip(one.energy) {
                sum.iter_mut().zip(band).for_each(|(sum, energy)| *sum += energy);
            }
        }
        sum.energy.iter_mut().flatten().for_each(|energy| *energy *= share);
        Some(sum)
    }
}

/// The responses of a room as they were measured, in its order.
///
/// # Errors
/// A file that cannot be read.
pub fn measured(room: &MeasuredRoom) -> Result<Vec<Heard>, AnyError> {
    let one = |index: usize| Heard::of(&room.load_response(index)?, room.bands());
    (0..room.responses().len()).into_par_iter().map(one).collect()
}

/// The same responses as a model renders them.
///
/// # Errors
/// A model that does not fit the room.
pub fn rendered(
    model: &ExtendedModel,
    room: &MeasuredRoom,
    rays: usize,
    seed: u64,
) -> Result<Vec<Heard>, AnyError> {
    let extended = model.room(room)?;
    let materials: Vec<Material> =
        extended.scene.materials().iter().map(|named| named.material.clone()).collect();
    let duration_s = room.responses().iter().map(|r| r.duration_s).fold(0.0, f64::max);
    let Some(rate_hz) = room.responses().first().map(|r| r.sample_rate_hz) else { return Ok(Vec::new()) };
    let view = View { extended: &extended, materials: &materials, room, rays, seed, duration_s, rate_hz };
    let waves = extended.wave_below_hz.map(|hz| view.waves(hz)).transpose()?;
    let one = |index: usize| view.response(index, waves.as_ref());
    let mut all: Vec<Heard> =
        (0..room.responses().len()).into_par_iter().map(one).collect::<Result<_, _>>()?;
    // Which recording has which name is no matter of rendering.
    let place = |name: &String| {
        room.responses().iter().position(|r| {
            *name == format!("{}-{}", room.sources()[r.source].id, room.receivers()[r.receiver].id)
        })
    };
    for [a, b] in &model.applied().exchanged {
        if let (Some(a), Some(b)) = (place(a), place(b)) {
            all.swap(a, b);
        }
    }
    Ok(all)
}

/// The low end of all responses, `[source][receiver]`.
struct Waves {
    crossover: Crossover,
    heard: Vec<Vec<WaveResponse>>,
}

struct View<'a> {
    extended: &'a ExtendedRoom,
    materials: &'a [Material],
    room: &'a MeasuredRoom,
    rays: usize,
    seed: u64,
    duration_s: f64,
    rate_hz: u32,
}

impl View<'_> {
    fn waves(&self, below_hz: f64) -> Result<Waves, AnyError> {
        let crossover = Crossover::new(below_hz)?;
        let config = WaveConfig {
            limit_hz: crossover.limit_hz(),
            sample_rate_hz: self.rate_hz,
            duration_s: self.duration_s + MORE_WAVES_S,
            ..WaveConfig::default()
        };
        let solver = WaveSolver::new(config)?;
        let (scene, air) = (&self.extended.scene, &self.extended.air);
        let mut heard = Vec::new();
        for source in &self.extended.sources {
            let room = solver.prepare(scene, source, air)?;
            heard.push(solver.solve(&room, self.materials, source, &self.extended.receivers, air, &())?);
        }
        Ok(Waves { crossover, heard })
    }

    fn response(&self, index: usize, waves: Option<&Waves>) -> Result<Heard, AnyError> {
        let Self { extended, .. } = self;
        let entry = &self.room.responses()[index];
        let (source, receiver) = (&extended.sources[entry.source], &extended.receivers[entry.receiver]);
        let tracer = TracerConfig {
            rays: self.rays,
            seed: self.seed,
            duration_s: self.duration_s,
            diffraction: extended.diffraction,
            cuboid_paths: extended.cuboid_paths,
            ..TracerConfig::default()
        };
        let paths = PathTracer::new(tracer)?.trace(&extended.scene, source, receiver, &extended.air, &())?;
        let conditions = extended.conditions(self.materials, entry.source, entry.receiver);
        let with_noise = |number: u64| -> Result<Heard, AnyError> {
            let seed = self.seed.wrapping_mul(NOISES).wrapping_add(number);
            let config = RenderConfig {
                sample_rate_hz: self.rate_hz,
                seed,
                duration_s: Some(self.duration_s),
                ..RenderConfig::default()
            };
            let mut response = PressureRenderer::new(config)?.render(&paths, &conditions)?;
            if let Some(waves) = waves {
                let low = &waves.heard[entry.source][entry.receiver];
                response = waves.crossover.join(low, &response)?.response;
            }
            let response = extended.finish(&source.id, &receiver.id, response, seed)?;
            Heard::of(&response, self.room.bands())
        };
        let all: Vec<Heard> = (0..NOISES).map(with_noise).collect::<Result<_, _>>()?;
        Heard::mean(all).ok_or_else(|| "no noise to render with".into())
    }
}
