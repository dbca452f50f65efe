//! Sending rays where sound stays.
//!
//! Between two walls that keep most of what they meet, a ray that sets out along their normal goes to and fro until something scatters it,
//! while others lose to the rest of the room what they carry. Such directions are rare, and late sound hangs on them: a few rays of
//! thousands carry most of it. A weight window comes too late, for when such a ray has become important it is one ray. So a share of the
//! directions is drawn by what they promise, and a ray stands for more or fewer by the ratio of the densities: every sum stays right on
//! average, with any absorption (importance sampling; for light, path guiding: Vorba et al., ACM Transactions on Graphics 33, 2014).

use crate::event_mixture::EventProbabilities;
use crate::mesh_scene::MeshScene;
use crate::random::{direction, generator, lambert};
use crate::vector::{Vec3, dot, mirror, norm, scale};
use crate::walk::{before_hit, next_hit};
use crate::weight_window::{KeptEnergy, MAX_BANDS};
use rand::Rng;
use std::f64::consts::PI;

/// Cells along each side of a face of the cube onto which directions are projected: odd, so that an axis is the middle of a cell.
const SIDE: usize = 41;
/// Opposite directions count as one: three faces of the cube hold all.
const CELLS: usize = 3 * SIDE * SIDE;
/// Area of a cell on its face.
const CELL_AREA: f64 = (2.0 / SIDE as f64) * (2.0 / SIDE as f64);
/// A direction that promises more than this, in units of the mean, is drawn more often.
const USUAL: f64 = 2.0;
/// Share of directions that are drawn by what they promise: at most, and the smallest that is worth it. No ray stands for more than one
/// over the rest.
const SHARE: (f64, f64) = (0.25, 0.02);
/// A ray that is followed to see what its direction promises is left when it promises less than this ...
const LITTLE: f64 = 0.02;
/// ... and is taken to carry no more: what the room as a whole loses meanwhile is known to some tens of percent.
const MUCH: f64 = 30.0;
/// Turns a seed into that of the guide.
const GUIDE: u64 = 0x6775_6964_6500;

/// A scene as the guide sees it.
#[derive(Clone, Copy)]
pub(crate) struct GuidedScene<'a> {
    pub mesh: &'a MeshScene,
    /// By material.
    pub ln_kept: &'a KeptEnergy,
    /// Octaves, or the first [`MAX_BANDS`] of more.
    pub bands: usize,
    pub probabilities: &'a EventProbabilities,
}

/// Which directions keep their energy for long, averaged over the surfaces.
#[derive(Debug)]
pub(crate) struct Guide {
    /// Share of directions that are drawn from the cells.
    share: f64,
    /// Where the count of an even share begins, between 0 and 1 by chance.
    offset: f64,
    /// Chance of all cells up to each.
    cumulative: Vec<f64>,
    /// Chance of each over its area on the face of the cube.
    density: Vec<f64>,
}

impl Guide {
    /// A guide for each class of octaves. Follows a mirrored ray in each direction, from `from` and from surfaces that a ray from there comes
    /// to. `loss_per_m` is what the room as a whole loses, in nepers of energy by octave. None where hardly any direction stands out.
    pub fn learn(
        scene: GuidedScene<'_>,
        loss_per_m: &[f64; MAX_BANDS],
        from: Vec3,
        max_length_m: f64,
        seed: u64,
    ) -> Vec<Option<Self>> {
        let mut random = generator(seed ^ GUIDE, 0);
        let (mut origin, mut normal) = (from, None);
        let classes = scene.probabilities.classes();
        let mut promises = vec![vec![0.0; CELLS]; classes];
        for cell in 0..CELLS {
            let mut heading = in_cell(cell, &mut random);
            let turned = match normal {
                Some(normal) => dot(heading, normal) < 0.0,
                None => random.random::<f64>() < 0.5,
            };
            if turned {
                heading = scale(heading, -1.0);
            }
            let brought = brought(scene, loss_per_m, (origin, heading), max_length_m, &mut random);
            promises.iter_mut().zip(brought).for_each(|(promises, brought)| promises[cell] = brought);
            // On to the next surface.
            let mut onward = match normal {
                Some(normal) => lambert(&mut random, normal),
                None => direction(&mut random),
            };
            if let Some(hit) = next_hit(scene.mesh, origin, &mut onward, &mut random) {
                origin = before_hit(origin, onward, hit.distance);
                normal = Some(scene.mesh.surfaces.triangles[hit.triangle as usize].normal_against(onward));
            }
        }
        let offset = random.random();
        promises.iter().map(|promises| Self::of_promises(promises, offset)).collect()
    }

    /// Draws each cell as it exceeds what is usual.
    fn of_promises(promises: &[f64], offset: f64) -> Option<Self> {
        let sum: f64 = promises.iter().sum();
        let usual = USUAL * sum / promises.len() as f64;
        let excess: Vec<f64> = promises.iter().map(|promise| (promise - usual).max(0.0)).collect();
        let all: f64 = excess.iter().sum();
        let share = if sum > 0.0 { (all / sum).min(SHARE.0) } else { 0.0 };
        (share >= SHARE.1).then(|| {
            let cumulative = excess.iter().scan(0.0, |until, excess| {
                *until += excess / all;
                Some(*until)
            });
            Self {
                share,
                offset,
                cumulative: cumulative.collect(),
                density: excess.iter().map(|excess| excess / all / CELL_AREA).collect(),
            }
        })
    }

    /// A direction into the half space about a unit normal, and the logarithm of the number of rays by Lambert's law that it stands for.
    pub fn scattered(&self, normal: Vec3, random: &mut impl Rng) -> (Vec3, f64) {
        let guided = random.random::<f64>() < self.share;
        let heading = match guided.then(|| self.draw(random)) {
            None => lambert(random, normal),
            Some(drawn) if dot(drawn, normal) < 0.0 => scale(drawn, -1.0),
            Some(drawn) => drawn,
        };
        // Of a direction and its opposite one is on this side, and has the chance of both.
        (heading, self.log_rays(dot(heading, normal) / PI, self.density(heading)))
    }

    /// A direction into the whole space, and the logarithm of the number of uniformly distributed rays that it stands for. `turn` counts
    /// rays of which an even share is drawn from the cells; without it chance decides, as it must for rays that are joined to such ones: else
    /// both rays of a pair would be guided together.
    pub fn emitted(&self, turn: Option<usize>, random: &mut impl Rng) -> (Vec3, f64) {
        let guided = match turn {
            Some(turn) => {
                let drawn_before = |turn: usize| (turn as f64 * self.share + self.offset).floor();
                drawn_before(turn + 1) > drawn_before(turn)
            }
            None => random.random::<f64>() < self.share,
        };
        let heading = match guided.then(|| self.draw(random)) {
            None => direction(random),
            Some(drawn) if random.random::<f64>() < 0.5 => scale(drawn, -1.0),
            Some(drawn) => drawn,
        };
        (heading, self.log_rays(0.25 / PI, 0.5 * self.density(heading)))
    }

    /// A direction by what it promises, or its opposite.
    fn draw(&self, random: &mut impl Rng) -> Vec3 {
        let mark = random.random::<f64>() * self.cumulative[CELLS - 1];
        in_cell(self.cumulative.partition_point(|&until| until <= mark).min(CELLS - 1), random)
    }

    /// Chance per steradian of a direction and its opposite together.
    fn density(&self, heading: Vec3) -> f64 {
        let (cell, area_per_sr) = cell_of(heading);
        self.density[cell] * area_per_sr
    }

    /// Of densities per steradian without the guide, and by it alone.
    fn log_rays(&self, plain: f64, guided: f64) -> f64 {
        -((1.0 - self.share) + self.share * guided / plain.max(f64::MIN_POSITIVE)).ln()
    }
}

/// Energy that a ray brings to the surfaces that scatter it next, in units of what the room as a whole keeps until then: over all mirrors,
/// mean over the octaves, for each class of octaves by its scattering.
fn brought(
    scene: GuidedScene<'_>,
    loss_per_m: &[f64; MAX_BANDS],
    (mut origin, mut heading): (Vec3, Vec3),
    max_length_m: f64,
    random: &mut impl Rng,
) -> Vec<f64> {
    let classes = scene.probabilities.classes();
    let (mut carried, mut travelled_m) = ([1.0f64; MAX_BANDS], 0.0);
    let (mut mirrored, mut brought) = (vec![1.0f64; classes], vec![0.0; classes]);
    while travelled_m < max_length_m {
        let Some(hit) = next_hit(scene.mesh, origin, &mut heading, random) else { break };
        travelled_m += hit.distance;
        let surface = &scene.mesh.surfaces.triangles[hit.triangle as usize];
        let ln_kept = &scene.ln_kept[surface.material as usize];
        for ((carried, ln_kept), loss_per_m) in carried.iter_mut().zip(ln_kept).zip(loss_per_m) {
            *carried = (*carried * (ln_kept + loss_per_m * hit.distance).exp()).min(MUCH);
        }
        let left = carried[..scene.bands].iter().sum::<f64>() / scene.bands as f64;
        for (class, (mirrored, brought)) in mirrored.iter_mut().zip(&mut brought).enumerate() {
            let scattering = scene.probabilities.scattering(surface.material, class);
            *brought += scattering * left * *mirrored;
            *mirrored *= 1.0 - scattering;
        }
        if left * mirrored.iter().copied().fold(0.0, f64::max) < LITTLE {
            break;
        }
        origin = before_hit(origin, heading, hit.distance);
        heading = mirror(heading, surface.normal);
    }
    brought
}

/// A direction in a cell, drawn evenly over its area on the face of the cube.
fn in_cell(cell: usize, random: &mut impl Rng) -> Vec3 {
    let (face, row, column) = (cell / (SIDE * SIDE), cell / SIDE % SIDE, cell % SIDE);
    let mut place = |index: usize| 2.0 * (index as f64 + random.random::<f64>()) / SIDE as f64 - 1.0;
    let mut point = [0.0; 3];
    point[face] = 1.0;
    point[(face + 1) % 3] = place(row);
    point[(face + 2) % 3] = place(column);
    scale(point, 1.0 / norm(point))
}

/// The cell of a direction or its opposite, and area on the face of the cube for each steradian there.
fn cell_of(heading: Vec3) -> (usize, f64) {
    let size = heading.map(f64::abs);
    let face = (0..3).fold(0, |largest, axis| if size[axis] > size[largest] { axis } else { largest });
    let index = |axis: usize| {
        let place = heading[(face + axis) % 3] / heading[face];
        (((place + 1.0) * 0.5 * SIDE as f64) as usize).min(SIDE - 1)
    };
    (face * SIDE * SIDE + index(1) * SIDE + index(2), size[face].powi(-3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::unit;
    use crate::weight_window::ln_kept;
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::Scene;

    /// Of 6 m x 5 m x 3 m: four walls, floor and ceiling.
    fn learnt(walls: f64, floor_and_ceiling: f64, scattering: f64) -> Option<Guide> {
        let of = |absorption: f64| Material::uniform(Bands::T60, absorption, scattering).unwrap();
        let faces = std::array::from_fn(|face| of(if face < 4 { walls } else { floor_and_ceiling }));
        let scene = Scene::shoebox([6.0, 5.0, 3.0], faces).unwrap();
        let kept: KeptEnergy = ln_kept(scene.materials().iter().map(|m| &m.material));
        let mesh = MeshScene::new(&scene).unwrap();
        let probabilities = EventProbabilities::new(scene.materials().iter().map(|m| &m.material));
        let guided = GuidedScene { mesh: &mesh, ln_kept: &kept, bands: 1, probabilities: &probabilities };
        // Half of what Eyring's formula gives, as where late sound lives long.
        let (area_m2, volume_m3) = (126.0, 90.0);
        let mean = (66.0 * walls + 60.0 * floor_and_ceiling) / area_m2;
        let loss_per_m = -0.5 * area_m2 * f64::ln(1.0 - mean) / (4.0 * volume_m3);
        Guide::learn(guided, &[loss_per_m; MAX_BANDS], [2.0, 1.5, 1.2], 150.0, 3).remove(0)
    }

    #[test]
    fn each_direction_lies_in_the_cell_from_which_it_was_drawn() {
        let mut random = generator(1, 0);
        let mut sphere_sr = 0.0;
        for cell in 0..CELLS {
            let drawn = in_cell(cell, &mut random);
            assert!((norm(drawn) - 1.0).abs() < 1e-12);
            let (found, area_per_sr) = cell_of(drawn);
            assert_eq!((found, cell_of(scale(drawn, -1.0)).0), (cell, cell));
            sphere_sr += CELL_AREA / area_per_sr;
        }
        // Three faces hold half of all directions.
        assert!((sphere_sr / (2.0 * PI) - 1.0).abs() < 2e-3, "{sphere_sr}");
    }

    #[test]
    fn means_over_weighted_rays_are_those_of_plain_ones() {
        let guide = learnt(0.6, 0.02, 0.1).unwrap();
        let count = 400_000;
        for normal in [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], unit([1.0, 2.0, -0.5])] {
            let mut random = generator(7, 0);
            let mut sums = [0.0; 3];
            for _ in 0..count {
                let (heading, log_rays) = guide.scattered(normal, &mut random);
                let (rays, cosine) = (log_rays.exp(), dot(heading, normal));
                assert!(cosine >= 0.0 && rays <= 1.0 / (1.0 - SHARE.0) + 1e-9);
                let within = f64::from(u8::from(cosine > 0.95));
                sums.iter_mut().zip([1.0, cosine, within]).for_each(|(sum, value)| *sum += rays * value);
            }
            // Lambert's law: mean cosine 2/3, and 1 - 0.95^2 of all within 18 degrees of the normal.
            for (sum, expected) in sums.into_iter().zip([1.0, 2.0 / 3.0, 0.0975]) {
                let found = sum / f64::from(count);
                assert!((found - expected).abs() < 4e-3, "{normal:?}: {found} for {expected}");
            }
        }
        for in_turn in [true, false] {
            let mut random = generator(8, 0);
            let mut sums = [0.0; 3];
            for number in 0..count as usize {
                let (heading, log_rays) = guide.emitted(in_turn.then_some(number), &mut random);
                let values = [1.0, heading[2], heading[2] * heading[2]];
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += log_rays.exp() * value);
            }
            for (sum, expected) in sums.into_iter().zip([1.0, 0.0, 1.0 / 3.0]) {
                let found = sum / f64::from(count);
                assert!((found - expected).abs() < 4e-3, "emitted: {found} for {expected}");
            }
        }
    }

    #[test]
    fn rays_are_sent_along_the_normal_of_hard_walls() {
        let guide = learnt(0.6, 0.02, 0.1).unwrap();
        let upright = guide.density(unit([0.03, 0.02, 1.0]));
        assert!(upright > 10.0 / (2.0 * PI), "{upright}");
        for aside in [[1.0, 0.05, 0.02], [0.05, 1.0, 0.02], [1.0, 1.0, 1.0]] {
            assert!(guide.density(unit(aside)) < 0.1 * upright, "{aside:?}");
        }
    }

    #[test]
    fn a_room_without_favoured_directions_has_no_guide() {
        assert!(learnt(0.2, 0.2, 0.6).is_none());
        assert!(learnt(0.3, 0.3, 1.0).is_none());
        // Nothing is ever scattered, so that nothing could be sent.
        assert!(learnt(0.6, 0.02, 0.0).is_none());
    }
}
