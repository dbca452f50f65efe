//! What the file states, what is, and what is planted.

use super::planted::Planted;
use super::shape::{self, Shape, is_free};
use super::{CHANNEL_SD_DB, MovedWall, NAMES, OCTAVES_HZ, PolyhedralConfig, Surface, TABLE_SD, TRIES, Truth};
use crate::geometry::{Vec3, cross, norm, sub};
use crate::laboratory::random_room::{GAIN_SD_DB, normal, unit};
use crate::laboratory::stream::{Purpose, stream};
use crate::own_air::{energy_exponent_per_m, speed_of_sound_m_s};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Air, Bands, Error, Material};
use sabine_scene::NamedMaterial;

/// Eyring's reverberation time in every octave, in seconds.
const T60_S: (f64, f64) = (0.3, 0.85);
/// Places stay so far from walls that stand elsewhere and from objects, in metres.
const FROM_HIDDEN_M: f64 = 0.55;

/// Materials as stated, and as they are: absorption by octave, and scattering.
pub(super) struct Tables {
    pub stated: Vec<Vec<f64>>,
    pub truth: Vec<Vec<f64>>,
    pub scattering: Vec<f64>,
    pub slowest_s: f64,
}

/// Draws what the file states and what is, for a shape. `None` where the room would be too live or too dead.
pub(super) fn draw_tables(
    shape: &Shape,
    air: &Air,
    nuisances: bool,
    random: &mut Pcg64Mcg,
) -> Option<Tables> {
    let volume_m3 = shape.volume_m3();
    if !(40.0..=250.0).contains(&volume_m3) {
        return None;
    }
    let bands = Bands::octaves(OCTAVES_HZ.0, OCTAVES_HZ.1).ok()?;
    let plain = Material::uniform(bands, 0.1, 0.0).ok()?;
    let named = NAMES.map(|n| NamedMaterial { name: n.to_owned(), material: plain.clone() }).to_vec();
    let scene = shape.scene(named).ok()?;
    let count = 1 + scene.triangles().iter().map(|t| t.material).max()? as usize;
    let mut stated = Vec::new();
    for _ in 0..count {
        let (middle, slope) = (0.04 + 0.36 * unit(random).powi(2), 0.35 * (2.0 * unit(random) - 1.0));
        let one = |b: usize| {
            let octaves = b as f64 - 2.5;
            (middle * (slope * octaves).exp() * (1.0 + 0.15 * normal(random))).clamp(0.02, 0.7)
        };
        stated.push((0..bands.len()).map(one).collect::<Vec<f64>>());
    }
    let scattering = (0..count).map(|_| 0.05 + 0.35 * unit(random)).collect();
    let off = |table: &Vec<f64>, random: &mut Pcg64Mcg| -> Vec<f64> {
        let (common, slope) = (normal(random), normal(random));
        let one = |(b, a): (usize, &f64)| {
            let own = normal(random);
            let together = 0.6 * common + 0.5 * slope * (b as f64 - 2.5) / 1.7 + 0.62 * own;
            (a + TABLE_SD * if nuisances { together } else { own }).clamp(0.01, 0.95)
        };
        table.iter().enumerate().map(one).collect()
    };
    let truth: Vec<Vec<f64>> = stated.iter().map(|t| off(t, random)).collect();
    let area = |i: usize| {
        let [a, b, c] = scene.corners_m(i);
        0.5 * norm(cross(sub(b, a), sub(c, a)))
    };
    let areas: Vec<(usize, f64)> =
        scene.triangles().iter().enumerate().map(|(i, t)| (t.material as usize, area(i))).collect();
    let whole: f64 = areas.iter().map(|(_, area)| area).sum();
    let eyring_s = |band: usize| {
        let lost: f64 = areas.iter().map(|&(material, area)| area * truth[material][band]).sum();
        let m = energy_exponent_per_m(air, bands.exact_hz(band));
        let walls = whole * -(1.0 - lost / whole).ln() / (4.0 * volume_m3);
        6.0 * std::f64::consts::LN_10 / (speed_of_sound_m_s(air) * (walls + m))
    };
    let t60_s: Vec<f64> = (0..bands.len()).map(eyring_s).collect();
    if !t60_s.iter().all(|t| (T60_S.0..=T60_S.1).contains(t)) {
        return None;
    }
    let slowest_s = t60_s.into_iter().fold(0.0, f64::max);
    Some(Tables { stated, truth, scattering, slowest_s })
}

/// All from which the truth follows.
pub(super) struct Draw<'a> {
    pub config: PolyhedralConfig,
    pub shape: &'a Shape,
    pub tables: &'a Tables,
    pub bands: Bands,
    pub fine: Bands,
    pub air: Air,
    /// Source and receivers where they are, but for what is planted.
    pub truly: &'a [Vec3],
}

impl Draw<'_> {
    pub fn truth(
        &self,
        named: Vec<NamedMaterial>,
        triangles: Vec<[Vec3; 3]>,
    ) -> Result<Option<Truth>, Error> {
        let Self { config, tables, truly, .. } = self;
        let mut random = stream(config.seed, Purpose::Effect, config.planted as usize);
        let receivers = truly[1..].to_vec();
        let stated = self.shape.scene(named.clone())?;
        let channel = |index: usize| -> Vec<f64> {
            let mut random = stream(config.seed, Purpose::Level, index);
            let (level, slope, bend) = (normal(&mut random), normal(&mut random), normal(&mut random));
            let one = |b: usize| {
                let x = (b as f64 - 2.5) / 1.7;
                0.58 * CHANNEL_SD_DB * (level + slope * x + bend * (x * x - 1.0))
            };
            (0..self.bands.len()).map(|b| if config.nuisances { one(b) } else { 0.0 }).collect()
        };
        let mut gains = stream(config.seed, Purpose::Gain, 0);
        let mut truth = Truth {
            air: self.air,
            triangles,
            materials: stated.triangles().iter().map(|t| t.material as usize).collect(),
            surfaces: Vec::new(),
            absorption: tables.truth.clone(),
            source: truly[0],
            gains_db: receivers.iter().map(|_| GAIN_SD_DB * normal(&mut gains)).collect(),
            responses_db: (0..receivers.len()).map(channel).collect(),
            receivers,
            latency_s: 0.0,
            duration_s: 1.15 * tables.slowest_s + 0.06,
            subject: None,
            wall: None,
            object: None,
        };
        let mut more_scattering = 0.0;
        if !self.plant(&mut truth, &mut more_scattering, named, &mut random)? {
            return Ok(None);
        }
        truth.surfaces = truth
            .absorption
            .iter()
            .zip(&tables.scattering)
            .map(|(table, s)| Surface {
                kept: (0..self.fine.len()).map(|b| 1.0 - self.between_octaves(table, b)).collect(),
                scattering: (s + more_scattering).min(1.0),
            })
            .collect();
        Ok(Some(truth))
    }

    /// A table's value in one of the bands that are simulated, straight between octaves.
    fn between_octaves(&self, table: &[f64], fine: usize) -> f64 {
        let octaves = (self.fine.exact_hz(fine) / self.bands.exact_hz(0)).log2();
        let at = octaves.clamp(0.0, (table.len() - 1) as f64);
        let below = (at as usize).min(table.len().saturating_sub(2));
        table[below] + (at - below as f64) * (table[below + 1] - table[below])
    }

    /// Hides the effect; false where no place for it was found.
    fn plant(
        &self,
        truth: &mut Truth,
        more_scattering: &mut f64,
        named: Vec<NamedMaterial>,
        random: &mut Pcg64Mcg,
    ) -> Result<bool, Error> {
        let sign = |random: &mut Pcg64Mcg| if unit(random) < 0.5 { -1.0 } else { 1.0 };
        let one_of =
            |random: &mut Pcg64Mcg, count: usize| ((unit(random) * count as f64) as usize).min(count - 1);
        match self.config.planted {
            Planted::Nothing => {}
            Planted::Position => {
                let receiver = one_of(random, truth.receivers.len());
                let far_m = 0.15 + 0.15 * unit(random);
                let Some(place) = (0..TRIES).find_map(|_| {
                    let way: Vec3 = std::array::from_fn(|_| normal(random));
                    let from = truth.receivers[receiver];
                    let place = std::array::from_fn(|k| from[k] + far_m * way[k] / norm(way));
                    is_free(&truth.triangles, place, FROM_HIDDEN_M).then_some(place)
                }) else {
                    return Ok(false);
                };
                truth.receivers[receiver] = place;
                truth.subject = Some(format!("r{}", receiver + 1));
            }
            Planted::Surface => {
                // One with a surface that is worth the name: walls, floor or ceiling.
                let material = one_of(random, 4.min(truth.absorption.len()));
                let more = 0.2 + 0.1 * unit(random);
                truth.absorption[material].iter_mut().for_each(|a| *a = (*a + more).min(0.95));
                truth.subject = Some(NAMES[material].to_owned());
            }
            Planted::Temperature => {
                let warmer_k = sign(random) * (6.0 + 4.0 * unit(random));
                let humidity = self.air.relative_humidity_percent();
                truth.air = Air::new(self.air.temperature_c() + warmer_k, humidity, self.air.pressure_kpa())?;
            }
            Planted::Latency => truth.latency_s = 0.002 + 0.003 * unit(random),
            Planted::Gain => {
                let receiver = one_of(random, truth.receivers.len());
                truth.gains_db[receiver] += 4.0 + 2.0 * unit(random);
                truth.subject = Some(format!("r{}", receiver + 1));
            }
            Planted::Scattering => *more_scattering = 0.3 + 0.15 * unit(random),
            Planted::Response => {
                let gains: Vec<f64> = (0..self.bands.len()).map(|_| 2.5 * normal(random)).collect();
                for response in &mut truth.responses_db {
                    response.iter_mut().zip(&gains).for_each(|(r, g)| *r += g);
                }
            }
            Planted::Wall | Planted::Object => return self.build(truth, named, random),
        }
        Ok(true)
    }

    /// Moves a wall or puts an object into the room where no place is in the way.
    fn build(
        &self,
        truth: &mut Truth,
        named: Vec<NamedMaterial>,
        random: &mut Pcg64Mcg,
    ) -> Result<bool, Error> {
        // A room without furniture has no wood: an object there is of what the floor is made of.
        let object = if named.len() > shape::FURNITURE { shape::FURNITURE } else { shape::FLOOR };
        let mut materials = named;
        while materials.len() <= shape::FURNITURE {
            let name = NAMES[materials.len()].to_owned();
            materials.push(NamedMaterial { name, ..materials[object].clone() });
        }
        for _ in 0..TRIES {
            let mut shape = self.shape.clone();
            let mut wall = None;
            let mut object_m = None;
            if self.config.planted == Planted::Wall {
                let index = ((unit(random) * shape.walls() as f64) as usize).min(shape.walls() - 1);
                let sign = if unit(random) < 0.5 { -1.0 } else { 1.0 };
                let offset_m = sign * (0.2 + 0.25 * unit(random));
                let (normal, point_m) = shape.wall(index);
                wall = Some(MovedWall { normal, point_m, offset_m });
                shape = shape.with_wall_moved(index, offset_m);
            } else {
                let extent = shape.extent();
                let sides = [1.6 + 0.6 * unit(random), 0.7 + 0.3 * unit(random), 0.8 + 0.5 * unit(random)];
                let sides = if unit(random) < 0.5 { sides } else { [sides[1], sides[0], sides[2]] };
                let corner: [f64; 2] = std::array::from_fn(|k| extent[k] * unit(random));
                let ends = [corner, std::array::from_fn(|k| corner[k] + sides[k])];
                // All four corners stand free in the room as it is, at half its height.
                let free = [[0, 0], [0, 1], [1, 0], [1, 1]]
                    .into_iter()
                    .all(|[i, j]| is_free(&truth.triangles, [ends[i][0], ends[j][1], 0.5 * sides[2]], 0.1));
                if !free {
                    continue;
                }
                shape.stand(corner, sides);
                object_m = Some([[corner[0], corner[1], 0.0], [ends[1][0], ends[1][1], sides[2]]]);
            }
            let triangles = crate::brute_force::corners(&shape.scene(materials.clone())?);
            let places = truth.receivers.iter().chain([&truth.source]);
            if !places.clone().all(|place| is_free(&triangles, *place, FROM_HIDDEN_M)) {
                continue;
            }
            let more = triangles.len() - truth.triangles.len();
            truth.materials.extend(std::iter::repeat_n(object, more));
            truth.triangles = triangles;
            truth.wall = wall;
            truth.object = object_m;
            return Ok(true);
        }
        Ok(false)
    }
}
