//! Rooms with slanted walls, corners, screens and furniture.

use crate::error::Error;
use crate::floor_plan::FloorPlan;
use crate::seed::{derive, generator};
use rand::Rng;
use rand::seq::IndexedRandom;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use sabine_acoustics::{Air, Bands, Material, PerBand, library_material};
use sabine_scene::{DiffuseRoom, NamedMaterial, Receiver, Scene, Source, Triangle};

/// Distance of source and receiver from walls, furniture and ceiling, m.
const CLEARANCE_M: f64 = 0.3;
/// Least distance of the source from the receiver, m.
const LEAST_DISTANCE_M: f64 = 0.5;
/// Furniture stands on feet of this height, so that it is closed and touches nothing, m.
const FEET_M: f64 = 0.05;
/// Places tried before a room is drawn anew, and rooms tried before that is an error.
const PLACES: usize = 60;
const ROOMS: u64 = 40;
/// Draws of the surfaces, of which the one nearest to the wanted reverberation time is kept.
const FURNISHINGS: usize = 16;
/// Standard deviation of the logarithm of absorption about the library's value: laboratories differ by as much.
const ABSORPTION_SPREAD: f64 = 0.25;

const FLOORS: [&str; 7] = [
    "marble_floor",
    "parquet_on_concrete",
    "linoleum_on_concrete",
    "stage_floor",
    "concrete_smooth",
    "carpet_thin",
    "carpet_on_felt",
];
const CEILINGS: [&str; 7] = [
    "plasterboard_ceiling",
    "concrete_rough",
    "plaster_on_lath",
    "wood_lining",
    "acoustic_plaster",
    "perforated_gypsum",
    "ceiling_tiles",
];
const WALLS: [&str; 16] = [
    "rendered_brick",
    "brick_painted",
    "brick_open_joints",
    "stucco_rough",
    "concrete_block_coarse",
    "limestone",
    "ceramic_tiles",
    "plasterboard",
    "glass_window",
    "double_glazing",
    "wood_16mm",
    "plywood_thin",
    "wooden_door",
    "curtain_light",
    "curtain_heavy",
    "mineral_wool_50mm",
];
const FURNITURE: [&str; 4] = ["wood_16mm", "plywood_thin", "seats_wooden", "seats_upholstered"];
const SCREENS: [&str; 4] = ["mineral_wool_50mm", "curtain_heavy", "plywood_thin", "glass_3mm"];

/// What rooms to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct PolyhedralRoomConfig {
    /// Range of volumes in m3, within 10 to 20,000; uniform in the logarithm. Default 20 to 600.
    pub volume_m3: (f64, f64),
    /// Range of heights in metres, within 2.1 to 20. Default 2.3 to 5.
    pub height_m: (f64, f64),
    /// Range of the reverberation times (Eyring, mean of 500 Hz and 1 kHz, in seconds, within 0.05 to 10) for which the
    /// surfaces are chosen. Default 0.15 to 1.5. What a room becomes is to be measured on its response.
    pub t60_s: (f64, f64),
    /// Share of rooms with a screen, 0 to 1. Default 0.25.
    pub screen_fraction: f64,
    /// Most pieces of furniture, 0 to 8. Default 3.
    pub most_furniture: usize,
}

impl Default for PolyhedralRoomConfig {
    fn default() -> Self {
        Self {
            volume_m3: (20.0, 600.0),
            height_m: (2.3, 5.0),
            t60_s: (0.15, 1.5),
            screen_fraction: 0.25,
            most_furniture: 3,
        }
    }
}

impl PolyhedralRoomConfig {
    pub(crate) fn check(&self) -> Result<(), Error> {
        use crate::error::{check, check_span};
        check_span("volume_m3", self.volume_m3, 10.0, 2e4, "a rising range within 10 to 20,000 m3")?;
        check_span("height_m", self.height_m, 2.1, 20.0, "a rising range within 2.1 to 20 m")?;
        check_span("t60_s", self.t60_s, 0.05, 10.0, "a rising range within 0.05 to 10 s")?;
        check("screen_fraction", self.screen_fraction, 0.0, 1.0, "between 0 and 1")?;
        check("most_furniture", self.most_furniture as f64, 0.0, 8.0, "at most 8")
    }
}

/// A room that never was, ready to be traced.
#[derive(Clone, Debug, PartialEq)]
pub struct PolyhedralRoom {
    /// Closed mesh, faces turned towards the air, a material for each surface on [`Bands::SIMULATION`].
    pub scene: Scene,
    /// Where it sounds.
    pub source: Source,
    /// Where it is heard.
    pub receiver: Receiver,
    /// What is between.
    pub air: Air,
}

impl PolyhedralRoom {
    /// The room that belongs to this seed: an oblique prism over four to eight walls or an L, its ceiling level or
    /// inclined; a screen and furniture; surfaces from [`sabine_acoustics::material_library`], each varied by about a
    /// quarter; source and receiver at the height of ears and mouths; air of 15 to 27 C and 25 to 65 %.
    ///
    /// # Errors
    /// [`Error::Setting`]; [`Error::NoPlace`] if forty rooms had no room for a source and a receiver.
    pub fn draw(config: &PolyhedralRoomConfig, seed: u64) -> Result<Self, Error> {
        config.check()?;
        for attempt in 0..ROOMS {
            if let Some(room) = Self::try_draw(config, &mut generator(derive(seed, attempt)))? {
                return Ok(room);
            }
        }
        Err(Error::NoPlace { rooms: ROOMS })
    }

    fn try_draw(config: &PolyhedralRoomConfig, rng: &mut Pcg64) -> Result<Option<Self>, Error> {
        let (low, high) = config.volume_m3;
        let volume_m3 = rng.random_range(low.ln()..=high.ln()).exp();
        // Small rooms are low, large ones rise with the cube root: about 2.6 m at 50 m3, 5 m at 400 m3.
        let height_m = (0.7 * volume_m3.cbrt() * rng.random_range(0.85..1.15))
            .clamp(config.height_m.0, config.height_m.1);
        let plan = FloorPlan::draw(rng, volume_m3 / height_m);
        let slope: [f64; 2] = if rng.random::<bool>() {
            [0.0, 0.0]
        } else {
            std::array::from_fn(|_| rng.random_range(-0.08..0.08))
        };
        let shell = Shell { plan, height_m, slope };
        if shell.plan.corners_m().iter().any(|&c| shell.ceiling_m(c) < 2.0) {
            return Ok(None);
        }
        let mut bodies = Vec::new();
        if rng.random::<f64>() < config.screen_fraction {
            bodies.extend(shell.place_body(rng, &bodies, true));
        }
        for _ in 0..rng.random_range(0..=config.most_furniture) {
            bodies.extend(shell.place_body(rng, &bodies, false));
        }
        let Some(source_m) = shell.place_point(rng, &bodies, None) else { return Ok(None) };
        let Some(receiver_m) = shell.place_point(rng, &bodies, Some(source_m)) else { return Ok(None) };
        let air = Air::new(rng.random_range(15.0..27.0), rng.random_range(25.0..65.0), 101.325)?;

        let (vertices, triangles) = shell.mesh(&bodies);
        let wanted_s = rng.random_range(config.t60_s.0..=config.t60_s.1);
        let mut best: Option<(f64, Scene)> = None;
        for _ in 0..FURNISHINGS {
            let materials = shell.materials(rng, &bodies)?;
            let scene = Scene::new(vertices.clone(), triangles.clone(), materials)?;
            let rooms = DiffuseRoom::of_scene(&scene, &air, Bands::SIMULATION)?;
            let mid_s: f64 = [500.0, 1000.0]
                .iter()
                .filter_map(|&hz| rooms.at_hz(hz))
                .map(|r| 0.5 * r.eyring_t60_s())
                .sum();
            let off = (mid_s / wanted_s).ln().abs();
            if best.as_ref().is_none_or(|(least, _)| off < *least) {
                best = Some((off, scene));
            }
        }
        let Some((_, scene)) = best else { return Ok(None) };
        let (source, receiver) = (Source::omni("source", source_m)?, Receiver::omni("receiver", receiver_m)?);
        Ok(Some(Self { scene, source, receiver, air }))
    }
}

/// Floor, walls and ceiling.
struct Shell {
    plan: FloorPlan,
    height_m: f64,
    /// Rise of the ceiling per metre along x and y, about the origin of the plan's corners' mean.
    slope: [f64; 2],
}

/// A box that stands in the room.
struct Body {
    centre_m: [f64; 2],
    half_m: [f64; 2],
    height_m: f64,
    angle: f64,
    screen: bool,
}

impl Body {
    /// Radius of the circle about it.
    fn radius_m(&self) -> f64 {
        self.half_m[0].hypot(self.half_m[1])
    }
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

impl Shell {
    fn ceiling_m(&self, point: [f64; 2]) -> f64 {
        let n = self.plan.corners_m().len() as f64;
        let middle: [f64; 2] =
            std::array::from_fn(|axis| self.plan.corners_m().iter().map(|c| c[axis]).sum::<f64>() / n);
        self.height_m + self.slope[0] * (point[0] - middle[0]) + self.slope[1] * (point[1] - middle[1])
    }

    /// A box somewhere clear of walls and other boxes, if there is space.
    fn place_body(&self, rng: &mut Pcg64, others: &[Body], screen: bool) -> Option<Body> {
        let (half_m, height_m) = if screen {
            ([rng.random_range(0.4..0.9), 0.03], rng.random_range(1.2..1.8))
        } else {
            ([rng.random_range(0.2..0.8), rng.random_range(0.2..0.5)], rng.random_range(0.4..1.6))
        };
        let angle = rng.random_range(0.0..std::f64::consts::PI);
        (0..PLACES).find_map(|_| {
            let body = Body { centre_m: self.plan.point_about(rng), half_m, height_m, angle, screen };
            let radius_m = body.radius_m();
            let clear = self.plan.clearance_m(body.centre_m) > radius_m + 0.1
                && self.ceiling_m(body.centre_m) > FEET_M + height_m + 0.3
                && others
                    .iter()
                    .all(|o| distance_m(o.centre_m, body.centre_m) > o.radius_m() + radius_m + 0.1);
            clear.then_some(body)
        })
    }

    /// A point clear of everything, if there is space.
    fn place_point(&self, rng: &mut Pcg64, bodies: &[Body], far_from: Option<[f64; 3]>) -> Option<[f64; 3]> {
        (0..PLACES).find_map(|_| {
            let [x, y] = self.plan.point_about(rng);
            let z = rng.random_range(1.0..1.8);
            let clear = self.plan.clearance_m([x, y]) > CLEARANCE_M
                && self.ceiling_m([x, y]) > z + CLEARANCE_M
                && bodies.iter().all(|b| distance_m(b.centre_m, [x, y]) > b.radius_m() + CLEARANCE_M)
                && far_from.is_none_or(|p| distance_m([p[0], p[1]], [x, y]) > LEAST_DISTANCE_M);
            clear.then_some([x, y, z])
        })
    }

    /// Vertices and triangles, normals towards the air. Materials: floor, ceiling, walls in order, bodies in order.
    fn mesh(&self, bodies: &[Body]) -> (Vec<[f64; 3]>, Vec<Triangle>) {
        let corners = self.plan.corners_m();
        let n = corners.len();
        let mut vertices: Vec<[f64; 3]> = corners.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        vertices.extend(corners.iter().map(|&[x, y]| [x, y, self.ceiling_m([x, y])]));
        let mut triangles = Vec::new();
        let mut add = |corners: [usize; 3], material: usize| {
            triangles.push(Triangle { vertices: corners.map(|v| v as u32), material: material as u32 });
        };
        for [a, b, c] in self.plan.triangles() {
            add([a, b, c], 0);
            add([n + a, n + c, n + b], 1);
        }
        for a in 0..n {
            let b = (a + 1) % n;
            add([b, a, n + a], 2 + a);
            add([b, n + a, n + b], 2 + a);
        }
        for (i, body) in bodies.iter().enumerate() {
            let first = vertices.len();
            let (sin, cos) = body.angle.sin_cos();
            let [u, v] = body.half_m;
            for z in [FEET_M, FEET_M + body.height_m] {
                for [x, y] in [[-u, -v], [u, -v], [u, v], [-u, v]] {
                    let [cx, cy] = body.centre_m;
                    vertices.push([cx + cos * x - sin * y, cy + sin * x + cos * y, z]);
                }
            }
            // Below, above, and the four sides, seen from outside counter-clockwise.
            for face in [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]] {
                let [a, b, c, d] = face.map(|k| first + k);
                add([a, b, c], 2 + n + i);
                add([a, c, d], 2 + n + i);
            }
        }
        (vertices, triangles)
    }

    /// Surfaces from the library, in the order of [`Shell::mesh`]. Most walls are of one kind.
    fn materials(&self, rng: &mut Pcg64, bodies: &[Body]) -> Result<Vec<NamedMaterial>, Error> {
        let common = pick(rng, &WALLS);
        let mut chosen = vec![pick(rng, &FLOORS), pick(rng, &CEILINGS)];
        for _ in self.plan.corners_m() {
            chosen.push(if rng.random::<f64>() < 0.6 { common } else { pick(rng, &WALLS) });
        }
        for body in bodies {
            chosen.push(if body.screen { pick(rng, &SCREENS) } else { pick(rng, &FURNITURE) });
        }
        chosen
            .into_iter()
            .map(|name| Ok(NamedMaterial { name: name.to_owned(), material: varied(rng, name)? }))
            .collect()
    }
}

fn pick(rng: &mut Pcg64, names: &[&'static str]) -> &'static str {
    names.choose(rng).copied().unwrap_or("rendered_brick")
}

/// A surface of the library, a little harder or softer than its table.
fn varied(rng: &mut Pcg64, name: &str) -> Result<Material, Error> {
    let table = library_material(name)?.material(Bands::SIMULATION)?;
    let normal: f64 = StandardNormal.sample(rng);
    let factor = (ABSORPTION_SPREAD * normal).exp();
    let absorption =
        PerBand::from_fn(Bands::SIMULATION, |i| (factor * table.absorption().values()[i]).clamp(0.01, 0.99));
    Ok(Material::new(absorption, table.scattering().clone())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn meshes_are_closed_and_turned_towards_the_air() {
        let mut bodies = 0;
        for seed in 0..150 {
            let room = PolyhedralRoom::draw(&PolyhedralRoomConfig::default(), seed).unwrap();
            // Every edge belongs to two triangles that run along it in opposite directions.
            let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
            for t in room.scene.triangles() {
                for k in 0..3 {
                    let (a, b) = (t.vertices[k], t.vertices[(k + 1) % 3]);
                    *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
                }
            }
            assert!(edges.values().all(|&sum| sum == 0), "seed {seed}");
            // Euler: V - E + F = 2 for each closed body.
            let (v, e, f) = (room.scene.vertices().len(), edges.len(), room.scene.triangles().len());
            assert_eq!((v + f - e) % 2, 0);
            bodies += (v + f - e) / 2 - 1;
            // The floor lies lowest and its triangles look up.
            let [a, b, c] = room.scene.corners_m(0);
            assert!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0);
            let volume = room.scene.volume_m3();
            assert!((15.0..700.0).contains(&volume), "seed {seed}: {volume} m3");
        }
        assert!(bodies > 100, "{bodies} screens and pieces of furniture in 150 rooms");
    }

    #[test]
    fn the_reverberation_times_spread_over_the_range_asked_for() {
        let mut times: Vec<f64> = (0..200)
            .map(|seed| {
                let room = PolyhedralRoom::draw(&PolyhedralRoomConfig::default(), seed).unwrap();
                let rooms = DiffuseRoom::of_scene(&room.scene, &room.air, Bands::SIMULATION).unwrap();
                rooms.at_hz(1000.0).unwrap().eyring_t60_s()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        assert!(times[10] < 0.4 && times[190] > 1.1, "{} to {} s", times[10], times[190]);
        assert!(times[199] < 4.0, "{} s", times[199]);
    }

    #[test]
    fn the_seed_decides_and_settings_are_checked() {
        let config = PolyhedralRoomConfig::default();
        assert_eq!(PolyhedralRoom::draw(&config, 4).unwrap(), PolyhedralRoom::draw(&config, 4).unwrap());
        assert_ne!(PolyhedralRoom::draw(&config, 4).unwrap(), PolyhedralRoom::draw(&config, 5).unwrap());
        for wrong in [
            PolyhedralRoomConfig { volume_m3: (5.0, 50.0), ..config.clone() },
            PolyhedralRoomConfig { t60_s: (f64::NAN, 1.0), ..config.clone() },
            PolyhedralRoomConfig { most_furniture: 9, ..config.clone() },
        ] {
            assert!(matches!(PolyhedralRoom::draw(&wrong, 1), Err(Error::Setting { .. })));
        }
    }
}
