//! Rooms with a screen, by finite differences.

use super::random_room::{GAIN_SD_DB, PLACE_SD_M, normal, unit};
use super::stream::{Purpose, stream};
use crate::box_modes::BoxModes;
use crate::geometry::Vec3;
use crate::own_air::speed_of_sound_m_s;
use crate::phonons::{PhononConfig, Phonons};
use crate::wave_grid::{ThinScreen, WaveGrid};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Air, Bands, Error, ImpulseResponse, Material, OutOfRange, PerBand};
use sabine_scene::{
    Levels, MaterialPrior, MeasuredRoom, Measurement, NamedMaterial, NewResponse, NewRoom, PositionSd,
    Receiver, Scene, Source, TimeZero, Triangle,
};
use std::path::Path;

/// Side of the cells in metres, by and large.
const CELL_M: f64 = 0.031;
/// Sample rate of the responses, and what is kept of them, in Hz.
const RATE_HZ: u32 = 6000;
const PASS_HZ: [f64; 4] = [60.0, 130.0, 1800.0, 2600.0];
/// Octaves of the material tables.
const OCTAVES_HZ: (f64, f64) = (250.0, 1000.0);
/// Names of the walls' materials, in the order of the faces of the box, and of the screen's.
const NAMES: [&str; 7] = ["birch", "chalk", "jute", "kapok", "marl", "reed", "tin"];
/// The ceiling among the faces, and the absorption of diffuse sound by it and by the others.
const CEILING: usize = 5;
const CEILING_ABSORPTION: (f64, f64) = (0.65, 0.85);
const ABSORPTION: (f64, f64) = (0.35, 0.65);
/// Standard deviation of the stated absorption.
const ABSORPTION_SD: f64 = 0.03;
/// Distance of places from surfaces, from each other, and by which a line clears the screen or meets it, in metres.
const FROM_WALLS_M: f64 = 0.5;
const APART_M: f64 = 0.45;
const CLEAR_M: f64 = 0.12;
/// Source and shadowed receivers are at most this far from the screen, in metres.
const NEAR_M: f64 = 1.5;
/// Places tried before a room is given up, and rooms.
const TRIES: usize = 20_000;
/// How far responses fall before they end (by Eyring), in dB.
const FALL_DB: f64 = 55.0;
/// Particles in each octave for each receiver, and the radius of the sphere about it in metres.
const PARTICLES: u32 = 60_000;
const PARTICLE_RADIUS_M: f64 = 0.12;
/// Energy of the recorder's noise relative to the response's own, in dB.
const FLOOR_DB: f64 = -60.0;

/// What is asked of a [`ScreenedRoom`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScreenedConfig {
    /// Seed of everything random, below 2^63.
    pub seed: u64,
    /// Number of receivers, 2 to 16; half of them (the smaller half) have no line of sight to the source.
    pub receivers: usize,
    /// Whether the screen is there. Without it, all else is the same.
    pub screen: bool,
}

/// A random box with a thin screen that stands on its floor, measured by finite differences of the wave equation
/// ([`WaveGrid`]): with standing waves, and with what bends around the screen.
///
/// Sides of 4.6 to 5.4 m, 3.4 to 4.2 m, height 2.5 to 2.9 m; walls locally reacting, the same at all frequencies, with a random-incidence
/// absorption of 0.35 to 0.65, of the ceiling 0.65 to 0.85, as where screens are of use. The screen is rigid, 1.4 to 1.8 m high, and leaves 0.5 to 0.9 m free on either side; it is in the
/// mesh. The source and the receivers in its shadow are within 1.5 m of it. Octaves of 250 Hz to 1 kHz at 6 kHz; air of 18 to 24 C that loses nothing.
///
/// Not told, as in [`Laboratory`](crate::Laboratory): microphones differ by 0.3 dB, receivers are 5 mm from where they are said to
/// be, tables are 0.03 from the truth in each octave, white noise at -60 dB.
///
/// What it does **not** do: walls that change with frequency, or whose reaction is not local.
#[derive(Clone, Debug)]
pub struct ScreenedRoom {
    seed: u64,
    grid: WaveGrid,
    duration_s: f64,
    source: [usize; 3],
    receivers: Vec<[usize; 3]>,
    hidden: usize,
    declared: Declared,
}

/// What the room file says.
#[derive(Clone, Debug)]
struct Declared {
    scene: Scene,
    priors: Vec<MaterialPrior>,
    air: Air,
    source: Source,
    receivers: Vec<Receiver>,
}

impl ScreenedRoom {
    /// Draws a room.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a configuration outside what [`ScreenedConfig`] says, or for which no room can be found.
    pub fn new(config: ScreenedConfig) -> Result<Self, Error> {
        OutOfRange::check("seed", config.seed as f64, 0.0, i64::MAX as f64, "below 2^63")?;
        OutOfRange::check("receivers", config.receivers as f64, 2.0, 16.0, "between 2 and 16")?;
        let mut random = stream(config.seed, Purpose::Room, 0);
        let air = Air::new(18.0 + 6.0 * unit(&mut random), 40.0 + 30.0 * unit(&mut random), 101.325)?;
        let cell_m = CELL_M * (0.97 + 0.03 * unit(&mut random));
        let mut draw = |low_m: f64, high_m: f64| {
            ((low_m + (high_m - low_m) * unit(&mut random)) / cell_m).round() as usize
        };
        let cells = [draw(4.6, 5.4), draw(3.4, 4.2), draw(2.5, 2.9)];
        let screen = ThinScreen {
            axis: 0,
            after: cells[0] / 2 + draw(0.0, 0.4) - draw(0.0, 0.4),
            from: [draw(0.5, 0.9), 0],
            to: [cells[1] - draw(0.5, 0.9), draw(1.4, 1.8)],
            admittance: 0.0,
        };
        let absorption: [f64; 6] = std::array::from_fn(|face| {
            let (low, high) = if face == CEILING { CEILING_ABSORPTION } else { ABSORPTION };
            low + (high - low) * unit(&mut random)
        });
        let plain =
            WaveGrid::new(cells, cell_m, absorption.map(BoxModes::admittance), speed_of_sound_m_s(&air));
        let places = Places { grid: &plain, cells, screen };
        let Some((source, receivers)) = places.draw(config.receivers, config.seed) else {
            let range = "with places on both sides of its screen";
            return Err(OutOfRange { field: "seed", value: config.seed as f64, range }.into());
        };
        let declared = Declared {
            scene: scene(&plain, &screen, config, &absorption)?,
            priors: priors(config, &absorption)?,
            air,
            source: Source::omni("s1", plain.centre_m(source))?,
            receivers: receivers
                .iter()
                .enumerate()
                .map(|(i, &cell)| {
                    let mut random = stream(config.seed, Purpose::Jitter, i);
                    let said = plain.centre_m(cell).map(|x| x + PLACE_SD_M * normal(&mut random));
                    Receiver::omni(format!("r{}", i + 1), said)
                })
                .collect::<Result<_, _>>()?,
        };
        let duration_s = fallen_s(plain.size_m(), &absorption, speed_of_sound_m_s(&air));
        let grid = if config.screen { plain.with_screen(&screen) } else { plain };
        let hidden = config.receivers / 2;
        Ok(Self { seed: config.seed, grid, duration_s, source, receivers, hidden, declared })
    }

    /// Mesh and materials as declared.
    pub fn scene(&self) -> &Scene {
        &self.declared.scene
    }

    /// Names of the receivers from which the screen hides the source, or would.
    pub fn shadowed(&self) -> Vec<String> {
        self.declared.receivers[..self.hidden].iter().map(|r| r.id.clone()).collect()
    }

    /// The responses, receiver by receiver. The same on any number of threads.
    ///
    /// # Errors
    /// What [`ImpulseResponse::new`] gives.
    pub fn responses(&self) -> Result<Vec<ImpulseResponse>, Error> {
        let sounds = self.grid.respond(self.source, &self.receivers, self.duration_s);
        let samples = (self.duration_s * f64::from(RATE_HZ)) as usize;
        let common_db = -10.0 + 20.0 * unit(&mut stream(self.seed, Purpose::Level, 0));
        sounds
            .iter()
            .enumerate()
            .map(|(i, sound)| {
                let mut response = sound.impulse_response(RATE_HZ, samples, PASS_HZ);
                let energy: f64 = response.iter().map(|s| s * s).sum();
                let noise = (energy / samples as f64 * 10f64.powf(0.1 * FLOOR_DB)).sqrt();
                let mut random = stream(self.seed, Purpose::Floor, i);
                response.iter_mut().for_each(|s| *s += noise * normal(&mut random));
                let gain_db = common_db + GAIN_SD_DB * normal(&mut stream(self.seed, Purpose::Gain, i));
                let gain = 10f64.powf(0.05 * gain_db);
                ImpulseResponse::new(response.iter().map(|s| (gain * s) as f32).collect(), RATE_HZ)
            })
            .collect()
    }

    /// What particles would measure in the same room, that fly straight and bend nowhere.
    ///
    /// # Errors
    /// What [`Phonons`] give.
    pub fn straight_responses(&self) -> Result<Vec<ImpulseResponse>, Error> {
        let declared = &self.declared;
        let config = PhononConfig {
            particles: PARTICLES,
            detector_radius_m: PARTICLE_RADIUS_M,
            duration_s: self.duration_s,
            seed: self.seed,
        };
        let particles = Phonons::new(&declared.scene, config)?;
        let respond = |receiver: &Receiver| {
            particles.impulse_response(&declared.source, receiver, &declared.air, RATE_HZ)
        };
        declared.receivers.iter().map(respond).collect()
    }

    /// Writes the room measured in this way, receiver by receiver, into a new folder.
    ///
    /// # Errors
    /// As [`NewRoom::write`].
    pub fn write(
        &self,
        responses: Vec<ImpulseResponse>,
        folder: &Path,
    ) -> Result<MeasuredRoom, sabine_scene::Error> {
        let declared = &self.declared;
        let entry = |(samples, receiver): (ImpulseResponse, &Receiver)| NewResponse {
            source: declared.source.id.clone(),
            receiver: receiver.id.clone(),
            name: format!("{}_{}", declared.source.id, receiver.id),
            air: None,
            session: None,
            recorded_at: None,
            samples,
        };
        NewRoom {
            scene: declared.scene.clone(),
            priors: declared.priors.clone(),
            air: Some(declared.air),
            measurement: Measurement { time_zero: TimeZero::Emission, levels: Levels::Common },
            position_sd: PositionSd::default(),
            sources: vec![declared.source.clone()],
            receivers: declared.receivers.clone(),
            responses: responses.into_iter().zip(&declared.receivers).map(entry).collect(),
        }
        .write(folder)
    }
}

/// Where source and receivers may be.
struct Places<'a> {
    grid: &'a WaveGrid,
    cells: [usize; 3],
    screen: ThinScreen,
}

impl Places<'_> {
    /// The source, and receivers: first those that do not see it.
    fn draw(&self, count: usize, seed: u64) -> Option<([usize; 3], Vec<[usize; 3]>)> {
        let mut random = stream(seed, Purpose::Places, 0);
        for _ in 0..TRIES {
            let source = self.place(&mut random);
            let below_m = self.screen.to[1] as f64 * self.grid.cell_m() - self.grid.centre_m(source)[2];
            if !self.is_free(source, &[]) || !self.is_near(source) || below_m < 2.0 * CLEAR_M {
                continue;
            }
            let mut found = Vec::new();
            for _ in 0..TRIES / 10 {
                let cell = self.place(&mut random);
                let others: Vec<[usize; 3]> = found.iter().copied().chain([source]).collect();
                let past_m = self.past_m(source, cell);
                let wanted = if found.len() < count / 2 {
                    past_m < -CLEAR_M && self.is_near(cell)
                } else {
                    past_m > CLEAR_M
                };
                if self.is_free(cell, &others) && wanted {
                    found.push(cell);
                }
                if found.len() == count {
                    return Some((source, found));
                }
            }
        }
        None
    }

    fn place(&self, random: &mut Pcg64Mcg) -> [usize; 3] {
        self.cells.map(|n| (n as f64 * unit(random)) as usize)
    }

    fn is_free(&self, cell: [usize; 3], others: &[[usize; 3]]) -> bool {
        let (at, size) = (self.grid.centre_m(cell), self.grid.size_m());
        let screen_m = self.screen.after as f64 * self.grid.cell_m();
        let apart_m = |other: &[usize; 3]| {
            let other = self.grid.centre_m(*other);
            (0..3).map(|k| (at[k] - other[k]).powi(2)).sum::<f64>().sqrt()
        };
        (0..3).all(|k| at[k] > FROM_WALLS_M && size[k] - at[k] > FROM_WALLS_M)
            && (at[0] - screen_m).abs() > FROM_WALLS_M
            && others.iter().all(|other| apart_m(other) > APART_M)
    }

    fn is_near(&self, cell: [usize; 3]) -> bool {
        (self.grid.centre_m(cell)[0] - self.screen.after as f64 * self.grid.cell_m()).abs() < NEAR_M
    }

    /// By how much the straight line between two places passes the screen; below zero where it meets the screen, that far from
    /// its free edges.
    fn past_m(&self, source: [usize; 3], cell: [usize; 3]) -> f64 {
        let (a, b) = (self.grid.centre_m(source), self.grid.centre_m(cell));
        let side = self.grid.cell_m();
        let share = (self.screen.after as f64 * side - a[0]) / (b[0] - a[0]);
        if !(0.0..=1.0).contains(&share) {
            return f64::INFINITY;
        }
        let [y, z] = [1, 2].map(|k| a[k] + share * (b[k] - a[k]));
        let edge_m = |cells: usize| cells as f64 * side;
        (edge_m(self.screen.from[0]) - y)
            .max(y - edge_m(self.screen.to[0]))
            .max(z - edge_m(self.screen.to[1]))
    }
}

/// The box, and in it the screen of a material of its own.
fn scene(
    grid: &WaveGrid,
    screen: &ThinScreen,
    config: ScreenedConfig,
    absorption: &[f64; 6],
) -> Result<Scene, Error> {
    let bands = Bands::octaves(OCTAVES_HZ.0, OCTAVES_HZ.1)?;
    let named = tables(config, absorption)
        .into_iter()
        .zip(NAMES)
        .map(|(table, name)| {
            let material = Material::new(PerBand::new(bands, table)?, PerBand::uniform(bands, 0.0))?;
            Ok(NamedMaterial { name: name.to_owned(), material })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let of_face = std::array::from_fn(|face| named[face].material.clone());
    let walls = Scene::shoebox(grid.size_m(), of_face)?;
    let (mut vertices, mut triangles) = (walls.vertices().to_vec(), walls.triangles().to_vec());
    if config.screen {
        let first = vertices.len() as u32;
        let [x, low, high, top] =
            [screen.after, screen.from[0], screen.to[0], screen.to[1]].map(|n| n as f64 * grid.cell_m());
        vertices.extend([[x, low, 0.0], [x, high, 0.0], [x, high, top], [x, low, top]]);
        for corners in [[0, 1, 2], [0, 2, 3]] {
            triangles.push(Triangle { vertices: corners.map(|c| first + c), material: 6 });
        }
    }
    Scene::new(vertices, triangles, named)
}

/// Absorption as stated, of the walls and the screen if there is one.
fn tables(config: ScreenedConfig, absorption: &[f64; 6]) -> Vec<Vec<f64>> {
    let stated = |(face, &truth): (usize, &f64)| {
        let mut random = stream(config.seed, Purpose::Room, 1 + face);
        (0..3).map(|_| (truth + ABSORPTION_SD * normal(&mut random)).clamp(0.02, 0.95)).collect()
    };
    let walls = absorption.iter().enumerate().map(stated);
    walls.chain(config.screen.then(|| vec![0.02; 3])).collect()
}

fn priors(config: ScreenedConfig, absorption: &[f64; 6]) -> Result<Vec<MaterialPrior>, Error> {
    let bands = Bands::octaves(OCTAVES_HZ.0, OCTAVES_HZ.1)?;
    let prior = |table: Vec<f64>| {
        Ok(MaterialPrior {
            absorption: Some(PerBand::new(bands, table)?),
            absorption_sd: PerBand::uniform(bands, ABSORPTION_SD),
        })
    };
    tables(config, absorption).into_iter().map(prior).collect()
}

/// When the room has fallen silent, by Eyring.
fn fallen_s(size: Vec3, absorption: &[f64; 6], speed_m_s: f64) -> f64 {
    let area = |face: usize| size[(face / 2 + 1) % 3] * size[(face / 2 + 2) % 3];
    let surface: f64 = (0..6).map(area).sum();
    let mean = (0..6).map(|f| area(f) * absorption[f]).sum::<f64>() / surface;
    let volume: f64 = size.iter().product();
    let energy_per_s = speed_m_s * surface * -(1.0 - mean).ln() / (4.0 * volume);
    0.02 + FALL_DB * std::f64::consts::LN_10 / 10.0 / energy_per_s
}
