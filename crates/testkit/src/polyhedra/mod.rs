//! A second laboratory, as different from the first as can be: rooms that are no box.
//!
//! Physics: image sources to the third order in any mesh, found by mirroring and tracing back; beyond them, and for all that scatters,
//! particles (Lambert) that are counted in spheres about the receivers, their energy filled with Gaussian noise. As many particles fly as
//! it takes ([`PolyhedralConfig::most_particles`]), and those that carry much are copied. One scattering
//! coefficient for each material, the same in all octaves, and stated. Air by ISO 9613-1 (Bass et al.). It shares no code with the tracer,
//! with what fits or diagnoses, nor any physics but the air with [`Laboratory`](crate::Laboratory).
//!
//! Always there, and not told: microphones differ by 0.3 dB, receivers are 5 mm (standard deviation along each axis) from where they are
//! said to be, tables are off by the stated 0.03 in each octave, white noise at -63 dB of a response's energy.
//! With [`PolyhedralConfig::nuisances`] the world is less kind: the errors of a table go together over its octaves, absorption
//! changes from third to third of an octave, microphones have a smooth octave response of 1 dB each, places are off by the 1 cm that the
//! file states, and early reflections keep their sign (else each has a random one).
//!
//! What it does **not** do: phase at walls (nor angle), standing waves, diffraction. Particles' passages are blurred by the 3 ms
//! that sound takes across a sphere of 1 m: the larger it is, the less they scatter.

mod draw;
mod images;
mod particles;
mod planted;
mod shape;

pub use planted::Planted;
pub use shape::Polyhedron;

use crate::geometry::Vec3;
use crate::laboratory::random_room::{normal, unit};
use crate::laboratory::steep_bands::{colour, join_steeply};
use crate::laboratory::stream::{Purpose, key, stream, unit as unit_of};
use crate::own_air::{energy_exponent_per_m, speed_of_sound_m_s};
use draw::{Draw, draw_tables};
use particles::{BIN_S, Flight};
use rand::Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use sabine_acoustics::{Air, Bands, Error, ImpulseResponse, Material, OutOfRange, PerBand};
use sabine_scene::{
    Levels, MaterialPrior, MeasuredRoom, Measurement, NamedMaterial, NewResponse, NewRoom, PositionSd,
    Receiver, Scene, Source, TimeZero,
};
use shape::{Shape, places, planes};
use std::path::Path;

/// Names of the materials, in the order of [`shape::WALLS`] and so on.
const NAMES: [&str; 5] = ["brick", "plaster", "carpet", "tiles", "wood"];
const RATE_HZ: u32 = 16_000;
/// Octaves of the material tables, and the thirds within them, in Hz.
const OCTAVES_HZ: (f64, f64) = (125.0, 4000.0);
const THIRDS_HZ: (f64, f64) = (100.0, 5000.0);
/// Specular paths with so many reflections are images.
const ORDER: usize = 3;
/// How far tables are off, and are said to be.
const TABLE_SD: f64 = 0.03;
/// Rooms, walls or objects drawn before a seed is given up.
const TRIES: usize = 2000;
/// Energy of the recorder's noise relative to the mean energy of the responses, in dB.
const FLOOR_DB: f64 = -63.0;
/// Energies are averaged over this share of their age: late bins hold few passages.
const SMOOTHING: f64 = 0.02;
/// Standard deviations where nuisances are on: of a channel's response in dB, and of places along each axis in metres.
const CHANNEL_SD_DB: f64 = 1.0;
const PLACE_SD_M: (f64, f64) = (0.005, 0.01);

/// What is asked of a [`PolyhedralRoom`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PolyhedralConfig {
    /// Seed of everything random, below 2^63. With the same seed and shape all rooms are the same but for what is planted.
    pub seed: u64,
    /// Kind of room.
    pub shape: Polyhedron,
    /// What is hidden.
    pub planted: Planted,
    /// Whether the world is less kind: see the module's head.
    pub nuisances: bool,
    /// Number of receivers, 1 to 40.
    pub receivers: usize,
    /// Particles of one round, 1,000 to 10,000,000.
    pub particles: usize,
    /// Rounds fly, each with other particles, until the energy that all receivers hear together is known to a twentieth (standard error) in every
    /// band and span of 50 ms down to -45 dB, or so many particles have flown, 1,000 to 100,000,000. Receivers hear the same
    /// particles: what these miss is missing in all responses, and looks like an effect.
    pub most_particles: usize,
}

impl Default for PolyhedralConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            shape: Polyhedron::L,
            planted: Planted::Nothing,
            nuisances: false,
            receivers: 12,
            particles: 300_000,
            most_particles: 3_000_000,
        }
    }
}

/// What a surface does in the bands that are simulated.
struct Surface {
    /// Share of the energy that is not absorbed.
    kept: Vec<f64>,
    scattering: f64,
}

/// A random room of no box, with an effect hidden in it or none.
///
/// Volume 40 to 250 m3, four or five materials, Eyring's reverberation time 0.3 to 0.85 s in every octave, one source, places at least
/// 0.65 m from surfaces and 0.8 m from each other, at least half of the receivers in sight. Octaves of 125 Hz to 4 kHz at 16 kHz.
pub struct PolyhedralRoom {
    config: PolyhedralConfig,
    bands: Bands,
    /// Bands that are simulated: the octaves, or their thirds.
    fine: Bands,
    scene: Scene,
    priors: Vec<MaterialPrior>,
    air: Air,
    source: Source,
    receivers: Vec<Receiver>,
    truth: Truth,
}

/// The room as it is.
struct Truth {
    air: Air,
    triangles: Vec<[Vec3; 3]>,
    /// Material of each triangle.
    materials: Vec<usize>,
    surfaces: Vec<Surface>,
    /// Absorption by octave of each material.
    absorption: Vec<Vec<f64>>,
    source: Vec3,
    receivers: Vec<Vec3>,
    latency_s: f64,
    /// Of each receiver, whatever the frequency.
    gains_db: Vec<f64>,
    /// Of each receiver, by octave, the loudspeaker's included.
    responses_db: Vec<Vec<f64>>,
    duration_s: f64,
    /// Receiver or material that is not as stated.
    subject: Option<String>,
    wall: Option<MovedWall>,
    /// Least and greatest coordinates of the object that the mesh lacks.
    object: Option<[Vec3; 2]>,
}

/// A wall that stands elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovedWall {
    /// Outward normal.
    pub normal: [f64; 3],
    /// A point of the wall as stated, in metres.
    pub point_m: [f64; 3],
    /// How much farther out it stands, in metres.
    pub offset_m: f64,
}

impl PolyhedralRoom {
    /// Width of a bin of [`PolyhedralRoom::energies`] in seconds.
    pub const BIN_S: f64 = BIN_S;

    /// Draws a room.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a configuration outside what [`PolyhedralConfig`] says, or a seed for which no room can be found.
    pub fn new(config: PolyhedralConfig) -> Result<Self, Error> {
        OutOfRange::check("seed", config.seed as f64, 0.0, i64::MAX as f64, "below 2^63")?;
        OutOfRange::check("receivers", config.receivers as f64, 1.0, 40.0, "between 1 and 40")?;
        OutOfRange::check("particles", config.particles as f64, 1e3, 1e7, "between 1,000 and 10,000,000")?;
        let most = config.most_particles as f64;
        OutOfRange::check("most_particles", most, 1e3, 1e8, "between 1,000 and 100,000,000")?;
        let bands = Bands::octaves(OCTAVES_HZ.0, OCTAVES_HZ.1)?;
        let fine = if config.nuisances { Bands::third_octaves(THIRDS_HZ.0, THIRDS_HZ.1)? } else { bands };
        let none = || OutOfRange {
            field: "seed",
            value: config.seed as f64,
            range: "one for which a room, and places in it, can be found",
        };
        let mut random = stream(config.seed, Purpose::Room, config.shape as usize);
        let air = Air::new(12.0 + 14.0 * unit(&mut random), 25.0 + 50.0 * unit(&mut random), 101.325)?;
        let (shape, tables) = (0..TRIES)
            .find_map(|_| {
                let shape = Shape::draw(config.shape, &mut random);
                let tables = draw_tables(&shape, &air, config.nuisances, &mut random)?;
                Some((shape, tables))
            })
            .ok_or_else(none)?;
        let named = |absorption: &[Vec<f64>]| -> Result<Vec<NamedMaterial>, Error> {
            let one = |((table, &scattering), name): ((&Vec<f64>, &f64), &str)| {
                let absorption = PerBand::new(bands, table.clone())?;
                let material = Material::new(absorption, PerBand::uniform(bands, scattering))?;
                Ok(NamedMaterial { name: name.to_owned(), material })
            };
            absorption.iter().zip(&tables.scattering).zip(NAMES).map(one).collect()
        };
        let scene = shape.scene(named(&tables.stated)?)?;
        let triangles = crate::brute_force::corners(&scene);
        let mut random = stream(config.seed, Purpose::Places, config.shape as usize);
        let truly = places(&triangles, shape.extent(), config.receivers, &mut random).ok_or_else(none)?;
        let priors = tables
            .stated
            .iter()
            .map(|table| {
                let absorption = Some(PerBand::new(bands, table.clone())?);
                Ok(MaterialPrior { absorption, absorption_sd: PerBand::uniform(bands, TABLE_SD) })
            })
            .collect::<Result<_, Error>>()?;
        let place_sd_m = if config.nuisances { PLACE_SD_M.1 } else { PLACE_SD_M.0 };
        let receivers = truly[1..]
            .iter()
            .enumerate()
            .map(|(i, place)| {
                let mut random = stream(config.seed, Purpose::Jitter, i);
                Receiver::omni(format!("r{}", i + 1), place.map(|x| x + place_sd_m * normal(&mut random)))
            })
            .collect::<Result<_, _>>()?;
        let draw = Draw { config, shape: &shape, tables: &tables, bands, fine, air, truly: &truly };
        Ok(Self {
            truth: draw.truth(named(&tables.truth)?, triangles)?.ok_or_else(none)?,
            source: Source::omni("s1", truly[0])?,
            config,
            bands,
            fine,
            scene,
            priors,
            air,
            receivers,
        })
    }

    /// The mesh and materials as stated.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The air as stated.
    pub fn air(&self) -> Air {
        self.air
    }

    /// The source as stated.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The receivers as stated.
    pub fn receivers(&self) -> &[Receiver] {
        &self.receivers
    }

    /// The receiver or the material that is not as stated.
    pub fn subject(&self) -> Option<&str> {
        self.truth.subject.as_deref()
    }

    /// The wall that stands elsewhere.
    pub fn moved_wall(&self) -> Option<MovedWall> {
        self.truth.wall
    }

    /// Least and greatest coordinates in metres of the object that the mesh lacks; its sides lie along the axes.
    pub fn missing_object(&self) -> Option<[[f64; 3]; 2]> {
        self.truth.object
    }

    /// True absorption by octave of each material of [`PolyhedralRoom::scene`].
    pub fn true_absorption(&self) -> &[Vec<f64>] {
        &self.truth.absorption
    }

    /// Materials with their true absorption, in the order of those of [`PolyhedralRoom::scene`].
    ///
    /// # Errors
    /// As [`Material::new`].
    pub fn true_materials(&self) -> Result<Vec<Material>, Error> {
        let one = |(named, table): (&NamedMaterial, &Vec<f64>)| {
            let absorption = PerBand::new(self.bands, table.clone())?;
            Material::new(absorption, named.material.scattering().clone())
        };
        self.scene.materials().iter().zip(&self.truth.absorption).map(one).collect()
    }

    /// Writes the room as a new folder.
    ///
    /// # Errors
    /// As [`NewRoom::write`].
    pub fn write(&self, folder: &Path) -> Result<MeasuredRoom, sabine_scene::Error> {
        let responses = self
            .responses()?
            .into_iter()
            .zip(&self.receivers)
            .map(|(samples, receiver)| NewResponse {
                source: self.source.id.clone(),
                receiver: receiver.id.clone(),
                name: format!("{}_{}", self.source.id, receiver.id),
                air: None,
                session: None,
                recorded_at: None,
                samples,
            })
            .collect();
        let stated_m = self.config.nuisances.then_some(PLACE_SD_M.1);
        NewRoom {
            scene: self.scene.clone(),
            priors: self.priors.clone(),
            air: Some(self.air),
            measurement: Measurement { time_zero: TimeZero::Emission, levels: Levels::Common },
            position_sd: PositionSd { all_m: stated_m, ..PositionSd::default() },
            sources: vec![self.source.clone()],
            receivers: self.receivers.clone(),
            responses,
        }
        .write(folder)
    }

    /// The responses, one for each receiver. The same on any number of threads.
    ///
    /// # Errors
    /// As [`ImpulseResponse::new`].
    pub fn responses(&self) -> Result<Vec<ImpulseResponse>, Error> {
        let exponents = self.exponents_per_m();
        let surfaces = self.surfaces();
        let flight = self.flight(&surfaces, &exponents);
        let energies = flight.energies();
        let mut all: Vec<Vec<f64>> = energies
            .into_par_iter()
            .enumerate()
            .map(|(index, energy)| self.response(index, &flight, &energy))
            .collect();
        let mean = all.iter().flatten().map(|s| s * s).sum::<f64>() / all.len() as f64;
        let samples = all.first().map_or(1, Vec::len) as f64;
        let floor = (mean * 10f64.powf(0.1 * FLOOR_DB) / samples).sqrt();
        for (index, response) in all.iter_mut().enumerate() {
            let mut random = stream(self.config.seed, Purpose::Floor, index);
            response.iter_mut().for_each(|s| *s += floor * random.sample::<f64, _>(StandardNormal));
        }
        let one = |r: Vec<f64>| ImpulseResponse::new(r.into_iter().map(|s| s as f32).collect(), RATE_HZ);
        all.into_iter().map(one).collect()
    }

    /// Attenuation in air of each simulated band.
    fn exponents_per_m(&self) -> Vec<f64> {
        let air = &self.truth.air;
        (0..self.fine.len()).map(|b| energy_exponent_per_m(air, self.fine.exact_hz(b))).collect()
    }

    /// Of each triangle.
    fn surfaces(&self) -> Vec<&Surface> {
        self.truth.materials.iter().map(|&m| &self.truth.surfaces[m]).collect()
    }

    fn flight<'a>(&'a self, surfaces: &'a [&'a Surface], exponents_per_m: &'a [f64]) -> Flight<'a> {
        let truth = &self.truth;
        Flight {
            seed: self.config.seed,
            particles: self.config.particles,
            most_particles: self.config.most_particles,
            triangles: &truth.triangles,
            surfaces,
            source: truth.source,
            receivers: &truth.receivers,
            speed_m_s: speed_of_sound_m_s(&truth.air),
            exponents_per_m,
            duration_s: truth.duration_s,
            without_order: ORDER,
        }
    }

    /// What the responses hold on average over signs and noise, `[receiver][band][bin]`: energy in bins of [`PolyhedralRoom::BIN_S`] from the
    /// emission on, that of the direct sound at 1 m being 1, of microphones without a gain. Bands are octaves, thirds of octaves
    /// where nuisances are on. The same on any number of threads.
    pub fn energies(&self) -> Vec<Vec<Vec<f64>>> {
        let exponents = self.exponents_per_m();
        let surfaces = self.surfaces();
        let flight = self.flight(&surfaces, &exponents);
        let mut energies = flight.energies();
        for (of_receiver, &receiver) in energies.iter_mut().zip(flight.receivers) {
            let ends = [flight.source, receiver];
            for image in images::images(&self.truth.triangles, &planes(&self.truth.triangles), ends, ORDER) {
                let bin = (image.length_m / flight.speed_m_s / BIN_S) as usize;
                for (band, of_band) in of_receiver.iter_mut().enumerate() {
                    let energy = flight.image_energy(&image, band);
                    of_band.get_mut(bin).into_iter().for_each(|e| *e += energy);
                }
            }
        }
        energies
    }

    fn response(&self, index: usize, flight: &Flight<'_>, energy: &[Vec<f64>]) -> Vec<f64> {
        let (truth, rate) = (&self.truth, f64::from(RATE_HZ));
        let samples = ((truth.duration_s + truth.latency_s) * rate).ceil() as usize;
        let mut columns = vec![vec![0.0; samples]; self.fine.len()];
        let ends = [truth.source, truth.receivers[index]];
        let found = images::images(&truth.triangles, &planes(&truth.triangles), ends, ORDER);
        for (number, image) in found.iter().enumerate() {
            let at = (image.length_m / flight.speed_m_s + truth.latency_s) * rate;
            let direct = image.met.is_empty() || self.config.nuisances;
            let chance = unit_of(key(self.config.seed, Purpose::Signs, (index << 32) | number));
            let sign = if direct || chance < 0.5 { 1.0 } else { -1.0 };
            for (band, column) in columns.iter_mut().enumerate() {
                crate::filter::add_pulse(column, at, sign * flight.image_energy(image, band).sqrt());
            }
        }
        let mut random = stream(self.config.seed, Purpose::Scattered, index);
        let smoothed: Vec<Vec<f64>> = energy.iter().map(|e| smooth(e)).collect();
        for i in 0..samples {
            let noise: f64 = random.sample(StandardNormal);
            let bin = (i as f64 / rate - truth.latency_s) / BIN_S;
            if bin < 0.0 {
                continue;
            }
            for (column, energy) in columns.iter_mut().zip(&smoothed) {
                let here = energy.get(bin as usize).copied().unwrap_or(0.0);
                column[i] += noise * (here / (BIN_S * rate)).sqrt();
            }
        }
        let joined = join_steeply(self.fine, columns, RATE_HZ);
        let amplitude = |db: &f64| 10f64.powf((db + truth.gains_db[index]) / 20.0);
        let amplitudes: Vec<f64> = truth.responses_db[index].iter().map(amplitude).collect();
        colour(self.bands, joined, &amplitudes, RATE_HZ)
    }
}

/// Means over a share of the age on either side.
fn smooth(energy: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    energy.iter().for_each(|e| sums.push(sums[sums.len() - 1] + e));
    (0..energy.len())
        .map(|i| {
            let reach = (SMOOTHING * i as f64) as usize;
            let (from, to) = (i - reach, (i + reach + 1).min(energy.len()));
            (sums[to] - sums[from]) / (to - from) as f64
        })
        .collect()
}
