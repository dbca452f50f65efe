//! The wave equation in time steps.

use super::room::WaveRoom;
use rayon::prelude::*;

/// Time step over the longest that is stable: at the limit itself rounding would grow.
const OF_LONGEST_STEP: f64 = 0.999;

/// A voxel with walls, ready for time steps.
struct Walled {
    voxel: u32,
    own: f64,
    links: [f64; 6],
    /// (1 - loss) and 1 / (1 + loss).
    kept: f64,
    implicit: f64,
}

/// The pressure in a room, from step to step: the leapfrog scheme with seven points (Botteldooren 1995), in its form with
/// finite volumes (Bilbao, Hamilton, Botts and Savioja 2016, IEEE/ACM TASLP 24(1)):
///
/// ```text
/// (1 + g) p+ = 2 p + (c k)^2 sum_j A_j / (h_j V) (p_j - p) - (1 - g) p-,   g = c k / 2 sum_walls beta A / V
/// ```
///
/// V is the volume of a voxel, A_j its area towards neighbour j, h_j the distance to there, beta the specific admittance
/// of a wall, k the time step. The energy
///
/// ```text
/// E = sum V ((p+ - p) / k)^2 / (2 c^2) + sum_links A / (2 h) (p+_i - p+_j)(p_i - p_j)
/// ```
///
/// falls by what the walls take and by nothing else; it is positive, and the scheme stable, up to c k = 1 / sqrt(sum 1 / h^2)
/// (a Courant number of 1 / sqrt 3 on cubes).
pub(crate) struct Leapfrog<'a> {
    room: &'a WaveRoom,
    /// Weights of the neighbours along each axis.
    weights: [f64; 3],
    /// Voxels with walls, and where those of each layer begin; the same for the runs.
    walled: Vec<Walled>,
    walled_of: Vec<usize>,
    runs_of: Vec<usize>,
    pub now: Vec<f64>,
    pub before: Vec<f64>,
}

impl<'a> Leapfrog<'a> {
    /// The longest time step times the speed of sound, in metres.
    pub fn step_m(room: &WaveRoom) -> f64 {
        let squares: f64 = room.spacing_m().iter().map(|h| 1.0 / (h * h)).sum();
        OF_LONGEST_STEP / squares.sqrt()
    }

    /// Silence. `admittances` are those of the materials.
    pub fn new(room: &'a WaveRoom, admittances: &[f64]) -> Self {
        let step_m = Self::step_m(room);
        let spacing_m = room.spacing_m();
        let weights = spacing_m.map(|h| (step_m / h).powi(2));
        let walled: Vec<Walled> = room
            .edges
            .iter()
            .map(|edge| {
                let links: [f64; 6] = std::array::from_fn(|i| edge.links[i] * weights[i / 2]);
                let face = |face: &super::room::Face| {
                    let axis = face.axis as usize;
                    let over_volume = face.slant / (spacing_m[axis] * edge.extent[axis]);
                    0.5 * step_m * admittances[face.material as usize] * over_volume
                };
                let loss: f64 = edge.faces.iter().map(face).sum();
                let own = 2.0 - links.iter().sum::<f64>();
                Walled { voxel: edge.voxel, own, links, kept: 1.0 - loss, implicit: 1.0 / (1.0 + loss) }
            })
            .collect();
        let layer = room.axes.strides()[2];
        let layers = room.axes.count[2];
        let begins = |z: usize| walled.partition_point(|edge| (edge.voxel as usize) < z * layer);
        let walled_of = (0..=layers).map(begins).collect();
        let begins = |z: usize| room.runs.partition_point(|run| (run.0 as usize) < z * layer);
        let runs_of = (0..=layers).map(begins).collect();
        let silence = vec![0.0; room.axes.voxels()];
        Self { room, weights, walled, walled_of, runs_of, now: silence.clone(), before: silence }
    }

    /// One step onward.
    pub fn step(&mut self) {
        let [_, row, layer] = self.room.axes.strides();
        let [x, y, z] = self.weights;
        let own = 2.0 - 2.0 * (x + y + z);
        let now = &self.now[..];
        let (walled, runs) = (&self.walled[..], &self.room.runs[..]);
        let (walled_of, runs_of) = (&self.walled_of[..], &self.runs_of[..]);
        // Each layer is written by one thread and depends on the last step alone: the same on any number of threads.
        self.before.par_chunks_mut(layer).enumerate().for_each(|(k, next)| {
            let base = k * layer;
            for &(first, length) in &runs[runs_of[k]..runs_of[k + 1]] {
                let (at, n) = (first as usize, length as usize);
                let next = &mut next[at - base..][..n];
                let here = &now[at..][..n];
                let (west, east) = (&now[at - 1..][..n], &now[at + 1..][..n]);
                let (south, north) = (&now[at - row..][..n], &now[at + row..][..n]);
                let (down, up) = (&now[at - layer..][..n], &now[at + layer..][..n]);
                for i in 0..n {
                    let across = x * (west[i] + east[i]) + y * (south[i] + north[i]) + z * (down[i] + up[i]);
                    next[i] = own * here[i] + across - next[i];
                }
            }
            for edge in &walled[walled_of[k]..walled_of[k + 1]] {
                let at = edge.voxel as usize;
                let [west, east, south, north, down, up] = edge.links;
                let across = west * now[at - 1]
                    + east * now[at + 1]
                    + south * now[at - row]
                    + north * now[at + row]
                    + down * now[at - layer]
                    + up * now[at + layer];
                let old = &mut next[at - base];
                *old = (edge.own * now[at] + across - edge.kept * *old) * edge.implicit;
            }
        });
        std::mem::swap(&mut self.now, &mut self.before);
    }

    /// Adds to the pressure of a voxel what a step's sound does there: `amount` is (c k)^2 times what the right-hand side of the
    /// wave equation holds, times its volume.
    pub fn inject(&mut self, voxel: usize, amount: f64) {
        let voxel_m3: f64 = self.room.spacing_m().iter().product();
        let scale = match self.room.edges.binary_search_by_key(&voxel, |edge| edge.voxel as usize) {
            Ok(i) => self.walled[i].implicit / self.room.edges[i].extent.iter().product::<f64>(),
            Err(_) => 1.0,
        };
        self.now[voxel] += amount * scale / voxel_m3;
    }
}

#[cfg(test)]
mod tests {
    use super::super::solver::{WaveConfig, WaveSolver};
    use super::*;
    use crate::random::generator;
    use rand::Rng;
    use sabine_acoustics::{Air, Bands, Material};
    use sabine_scene::{NamedMaterial, Scene, Source, Triangle};

    /// A wedge-shaped room with slanted walls, and a screen in it.
    fn room() -> WaveRoom {
        let wall = Material::uniform(Bands::SIMULATION, 0.1, 0.0).unwrap();
        let (a, b) = ([0.0, 0.0], [3.1, 0.4]);
        let (c, d) = ([3.7, 2.9], [-0.3, 2.2]);
        let lift = |p: [f64; 2], z: f64| [p[0], p[1], z];
        let mut vertices: Vec<[f64; 3]> = [a, b, c, d].map(|p| lift(p, 0.0)).to_vec();
        vertices.extend([a, b, c, d].map(|p| lift(p, 2.3)));
        vertices.extend([[1.6, 0.8, 0.0], [1.6, 1.9, 0.0], [1.7, 1.9, 1.4], [1.7, 0.8, 1.4]]);
        let quads = [
            [0, 1, 2, 3],
            [4, 7, 6, 5],
            [0, 4, 5, 1],
            [1, 5, 6, 2],
            [2, 6, 7, 3],
            [3, 7, 4, 0],
            [8, 9, 10, 11],
        ];
        let triangles = quads
            .iter()
            .flat_map(|&[p, q, r, s]| [[p, q, r], [p, r, s]])
            .map(|vertices| Triangle { vertices, material: 0 })
            .collect();
        let scene =
            Scene::new(vertices, triangles, vec![NamedMaterial { name: "wall".into(), material: wall }])
                .unwrap();
        let config = WaveConfig { limit_hz: 250.0, points_per_wavelength: 12.0, ..Default::default() };
        let source = Source::omni("s", [0.8, 1.2, 1.1]).unwrap();
        WaveSolver::new(config).unwrap().prepare(&scene, &source, &Air::default()).unwrap()
    }

    /// The energy between two steps, by the formula above.
    fn energy(waves: &Leapfrog) -> f64 {
        let (room, now, before) = (waves.room, &waves.now, &waves.before);
        let (step_m, h) = (Leapfrog::step_m(room), room.spacing_m());
        let voxel_m3: f64 = h.iter().product();
        let strides = room.axes.strides();
        let mut total = 0.0;
        let mut add = |voxel: usize, volume: f64, links: [f64; 6]| {
            total += 0.5 * volume * voxel_m3 * ((now[voxel] - before[voxel]) / step_m).powi(2);
            for (i, link) in links.into_iter().enumerate() {
                let stride = strides[i / 2];
                let there = if i % 2 == 0 { voxel - stride } else { voxel + stride };
                // Half of each link, for the other end has it too.
                let area_over_h = link * volume * voxel_m3 / h[i / 2].powi(2);
                total += 0.25 * area_over_h * (now[voxel] - now[there]) * (before[voxel] - before[there]);
            }
        };
        for &(first, length) in &room.runs {
            (first..first + length).for_each(|voxel| add(voxel as usize, 1.0, [1.0; 6]));
        }
        for edge in &room.edges {
            add(edge.voxel as usize, edge.extent.iter().product(), edge.links);
        }
        total
    }

    fn shaken(room: &WaveRoom, admittance: f64) -> Leapfrog<'_> {
        let mut waves = Leapfrog::new(room, &[admittance]);
        let mut random = generator(7, 7);
        let voxels: Vec<usize> = room.edges.iter().map(|edge| edge.voxel as usize).collect();
        for voxel in voxels {
            waves.now[voxel] = random.random::<f64>() - 0.5;
        }
        let runs = room.runs.clone();
        for (first, length) in runs {
            for voxel in first..first + length {
                waves.now[voxel as usize] = random.random::<f64>() - 0.5;
            }
        }
        // At rest, so that the mean pressure does not grow on its own.
        waves.before = waves.now.clone();
        waves
    }

    #[test]
    fn rigid_walls_keep_the_energy() {
        let room = room();
        let mut waves = shaken(&room, 0.0);
        let first = energy(&waves);
        for _ in 0..5000 {
            waves.step();
        }
        let last = energy(&waves);
        assert!(first > 0.0 && (last / first - 1.0).abs() < 1e-9, "{first} became {last}");
    }

    #[test]
    fn soft_walls_take_energy_at_every_step() {
        let room = room();
        for admittance in [1e-3, 0.1, 0.638] {
            let mut waves = shaken(&room, admittance);
            let first = energy(&waves);
            let mut last = first;
            for step in 0..5000 {
                waves.step();
                let here = energy(&waves);
                assert!(here >= 0.0 && here <= last + 1e-13 * first, "step {step}: {last} became {here}");
                last = here;
            }
            assert!(last < 0.9 * first, "{first} became {last}");
        }
    }

    #[test]
    fn slanted_walls_have_their_area_and_the_room_its_volume() {
        let room = room();
        // By hand: shoelace formula times height, perimeter times height, twice the floor, both sides of the screen.
        let corners = [[0.0, 0.0], [3.1, 0.4], [3.7, 2.9], [-0.3f64, 2.2]];
        let (mut floor, mut perimeter) = (0.0, 0.0);
        for i in 0..4 {
            let (p, q): ([f64; 2], [f64; 2]) = (corners[i], corners[(i + 1) % 4]);
            floor += 0.5 * (p[0] * q[1] - p[1] * q[0]);
            perimeter += (q[0] - p[0]).hypot(q[1] - p[1]);
        }
        let screen = 1.1 * (0.1f64.hypot(1.4));
        let surface = 2.0 * floor + 2.3 * perimeter + 2.0 * screen;
        let (found_m3, found_m2) = (room.volume_m3(), room.material_areas_m2()[0]);
        assert!((found_m3 / (2.3 * floor) - 1.0).abs() < 0.01, "{found_m3} m3, {}", 2.3 * floor);
        assert!((found_m2 / surface - 1.0).abs() < 0.03, "{found_m2} m2, {surface}");
    }
}
