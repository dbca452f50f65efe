//! A room that is a cuboid: its specular paths have a closed form, to any order.

use crate::random::generator;
use crate::surfaces::Surfaces;
use crate::vector::{Vec3, dot, scale};
use rand::Rng;
use sabine_paths::{Contribution, Incidence, PathSet, Reflection};
use sabine_scene::NamedMaterial;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Two directions are parallel or at right angles if the sine or cosine between them is below this.
const STRAIGHT: f64 = 1e-6;
/// A face is whole if its area is that of the cuboid's to this share.
const WHOLE: f64 = 1e-6;

/// One image of a source in a cuboid: a specular path of any order.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ImageSource {
    /// Length of the path in metres.
    pub length_m: f64,
    /// Unit vector in which it leaves the source.
    pub departure: [f64; 3],
    /// Unit vector from the receiver towards where it comes from.
    pub arrival: [f64; 3],
    /// Reflections at each of the six faces, in the order of [`PreparedScene::cuboid_faces`](crate::PreparedScene::cuboid_faces).
    pub reflections: [u32; 6],
}

/// Six whole faces at right angles, each of one material, and nothing else.
#[derive(Clone, Debug)]
pub(crate) struct Cuboid {
    axes: [Vec3; 3],
    low_m: [f64; 3],
    high_m: [f64; 3],
    /// Of the faces low x, high x, low y, high y, low z, high z.
    pub materials: [u32; 6],
}

impl Cuboid {
    /// The cuboid that these triangles make, if they do.
    pub fn find(surfaces: &Surfaces) -> Option<Self> {
        if surfaces.planes.len() != 6 {
            return None;
        }
        let mut axes: Vec<Vec3> = Vec::new();
        // Axis and level of each plane.
        let mut levels: Vec<(usize, f64)> = Vec::new();
        for plane in &surfaces.planes {
            let parallel =
                axes.iter().position(|a| dot(*a, plane.normal).abs() > 1.0 - STRAIGHT * STRAIGHT * 0.5);
            let axis = match parallel {
                Some(axis) => axis,
                None if axes.iter().all(|a| dot(*a, plane.normal).abs() < STRAIGHT) => {
                    axes.push(plane.normal);
                    axes.len() - 1
                }
                None => return None,
            };
            levels.push((axis, plane.offset_m * dot(axes[axis], plane.normal).signum()));
        }
        let axes: [Vec3; 3] = axes.try_into().ok()?;
        let (mut low_m, mut high_m) = ([0.0; 3], [0.0; 3]);
        let mut faces = [0usize; 6];
        for axis in 0..3 {
            let mut own: Vec<(f64, usize)> =
                levels.iter().enumerate().filter(|(_, l)| l.0 == axis).map(|(p, l)| (l.1, p)).collect();
            own.sort_by(|a, b| a.0.total_cmp(&b.0));
            let [(low, first), (high, second)] = own[..] else { return None };
            (low_m[axis], high_m[axis]) = (low, high);
            (faces[2 * axis], faces[2 * axis + 1]) = (first, second);
        }
        let side = |k: usize| high_m[k] - low_m[k];
        let mut materials = [0; 6];
        for (face, &plane) in faces.iter().enumerate() {
            let own =
                || surfaces.triangles.iter().filter(move |t| !t.is_degenerate() && t.plane as usize == plane);
            materials[face] = own().next()?.material;
            if own().any(|t| t.material != materials[face]) {
                return None;
            }
            let wanted = side((face / 2 + 1) % 3) * side((face / 2 + 2) % 3);
            if (own().map(|t| t.area_m2).sum::<f64>() / wanted - 1.0).abs() > WHOLE {
                return None;
            }
        }
        Some(Self { axes, low_m, high_m, materials })
    }

    /// Shows every image source that is no farther away than this, the source itself among them.
    pub fn for_each_image(
        &self,
        source: Vec3,
        receiver: Vec3,
        max_length_m: f64,
        mut visit: impl FnMut(&ImageSource),
    ) {
        let lattice = Lattice::new(self, source, receiver);
        let reach = lattice.reach(max_length_m);
        for i in -reach[0]..=reach[0] {
            let x = lattice.along(0, i);
            for j in -reach[1]..=reach[1] {
                let flat = x * x + lattice.along(1, j).powi(2);
                if flat > max_length_m * max_length_m {
                    continue;
                }
                for k in -reach[2]..=reach[2] {
                    let numbers = [i, j, k];
                    let length_m = (flat + lattice.along(2, k).powi(2)).sqrt();
                    if length_m <= max_length_m {
                        let [departure, arrival] = lattice.directions(numbers).map(|v| self.in_room(v));
                        let reflections = faces_of(numbers);
                        visit(&ImageSource { length_m, departure, arrival, reflections });
                    }
                }
            }
        }
    }

    /// From coordinates along the axes to those of the room.
    fn in_room(&self, v: Vec3) -> Vec3 {
        std::array::from_fn(|i| (0..3).map(|k| v[k] * self.axes[k][i]).sum())
    }

    /// Adds the direct path and specular paths of any order, none longer than the set looks for (Allen and Berkley, JASA 65,
    /// 1979): all of them if there are not more than about `most`, else a random choice that favours those that carry much energy in
    /// the octave in which they carry most, each with the weight of those that it stands for.
    pub fn add_paths(
        &self,
        paths: &mut PathSet,
        source: Vec3,
        receiver: Vec3,
        most: usize,
        materials: &[NamedMaterial],
        seed: u64,
    ) {
        paths.set_axes(self.axes);
        let max_length_m = paths.max_length_m();
        let lattice = Lattice::new(self, source, receiver);
        let reach = lattice.reach(max_length_m);
        let left = self.ln_left(materials);
        // What the faces across an axis leave of each image along it, by octave: `[image * octaves + octave]`.
        let octaves = left.len();
        let left_along: [Vec<f64>; 3] = std::array::from_fn(|axis| {
            let of_image = |n: i64| {
                let (low, high) = hits(n);
                let (low, high) = (f64::from(low), f64::from(high));
                left.iter().map(move |l| low * l[2 * axis] + high * l[2 * axis + 1])
            };
            (-reach[axis]..=reach[axis]).flat_map(of_image).collect()
        });
        let image =
            |axis: usize, n: i64| &left_along[axis][(n + reach[axis]) as usize * octaves..][..octaves];
        let squared_z: Vec<f64> = (-reach[2]..=reach[2]).map(|k| lattice.along(2, k).powi(2)).collect();
        let mut in_plane = vec![0.0; octaves];
        let mut found: Vec<(f32, [i64; 3])> = Vec::new();
        for i in -reach[0]..=reach[0] {
            let x = lattice.along(0, i);
            for j in -reach[1]..=reach[1] {
                let flat = x * x + lattice.along(1, j).powi(2);
                if flat > max_length_m * max_length_m {
                    continue;
                }
                let along = image(0, i).iter().zip(image(1, j));
                in_plane.iter_mut().zip(along).for_each(|(xy, (x, y))| *xy = x + y);
                for (k, squared_z) in (-reach[2]..).zip(&squared_z) {
                    let squared = flat + squared_z;
                    if squared > max_length_m * max_length_m {
                        continue;
                    }
                    let kept = in_plane.iter().zip(image(2, k)).map(|(xy, z)| xy + z);
                    // No octave keeps what is not a number: a comparison is enough.
                    let most = kept.fold(f64::NEG_INFINITY, |most, x| if x > most { x } else { most });
                    found.push(((most - squared.ln()) as f32, [i, j, k]));
                }
            }
        }
        // Chances in proportion to amplitude, so that late arrivals, many and weak, keep some: one over the chance makes up for
        // those that are dropped, and sums of energy stay right in the mean.
        let chance = chance_unit(&found, most);
        let kept = |ln_energy: f32| ((0.5 * f64::from(ln_energy)).exp() * chance).min(1.0);
        found.retain(|&(ln_energy, numbers)| {
            let kept = kept(ln_energy);
            let place = numbers.map(|n| n as u64).iter().fold(seed, |sum, n| {
                (sum ^ n.wrapping_mul(0x9E37_79B9_7F4A_7C15))
                    .rotate_left(23)
                    .wrapping_mul(0xD6E8_FEB8_6659_FD93)
            });
            kept >= 1.0 || generator(seed, place).random::<f64>() < kept
        });
        found.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut chains = KnownChains::from_iter([([0; 6], PathSet::DIRECT)]);
        for (ln_energy, numbers) in found {
            let length_m = lattice.length_m(numbers);
            let [departure, arrival] = lattice.directions(numbers);
            let chain = self.chain(paths, &mut chains, faces_of(numbers));
            paths.push(Contribution {
                length_m,
                log_weight: -2.0 * length_m.ln() - kept(ln_energy).ln(),
                chain,
                tail: PathSet::DIRECT,
                departure: self.in_room(departure),
                arrival: self.in_room(arrival),
                batch: None,
            });
        }
    }

    /// Logarithm of what each face leaves of the specular energy, by octave; a black face leaves next to nothing.
    fn ln_left(&self, materials: &[NamedMaterial]) -> Vec<[f64; 6]> {
        let bands = materials.first().map_or(0, |m| m.material.bands().len());
        let of_band = |band: usize| {
            self.materials.map(|m| {
                let m = &materials[m as usize].material;
                let (a, s) = (m.absorption().values()[band], m.scattering().values()[band]);
                ((1.0 - a) * (1.0 - s)).max(1e-9).ln()
            })
        };
        (0..bands).map(of_band).collect()
    }

    /// The chain with so many reflections at each face. Their order has no bearing on energy: that with one reflection less at
    /// the last face that has any goes before.
    fn chain(&self, paths: &mut PathSet, known: &mut KnownChains, faces: [u32; 6]) -> u32 {
        let mut missing: Vec<usize> = Vec::new();
        let mut shorter = faces;
        let mut chain = loop {
            if let Some(&chain) = known.get(&shorter) {
                break chain;
            }
            let last = (0..6).rfind(|&f| shorter[f] > 0).unwrap_or(0);
            missing.push(last);
            shorter[last] -= 1;
        };
        for face in missing.into_iter().rev() {
            chain = paths.reflect_at(
                chain,
                self.materials[face],
                Reflection::Specular,
                Incidence::Axis((face / 2) as u8),
            );
            shorter[face] += 1;
            known.insert(shorter, chain);
        }
        chain
    }
}

/// Chains by their reflections at each face.
type KnownChains = HashMap<[u32; 6], u32, BuildHasherDefault<FaceHasher>>;

/// A hash of a few small numbers, in a tenth of the time of the standard library's: these keys come from nobody who means harm.
#[derive(Default)]
struct FaceHasher(u64);

impl Hasher for FaceHasher {
    fn write(&mut self, bytes: &[u8]) {
        for eight in bytes.chunks(8) {
            let mut padded = [0; 8];
            padded[..eight.len()].copy_from_slice(eight);
            // Multiplied by the golden ratio (Knuth 1998, 6.4).
            self.0 =
                (self.0.rotate_left(11) ^ u64::from_le_bytes(padded)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        }
    }

    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 32)
    }
}

/// The images of a source in a cuboid as its axes number them: n along an axis has gone through |n| faces across it.
struct Lattice {
    low_m: [f64; 3],
    side_m: [f64; 3],
    from: Vec3,
    to: Vec3,
}

impl Lattice {
    fn new(cuboid: &Cuboid, source: Vec3, receiver: Vec3) -> Self {
        let local = |p: Vec3| -> Vec3 { std::array::from_fn(|k| dot(cuboid.axes[k], p)) };
        let side_m = std::array::from_fn(|k| cuboid.high_m[k] - cuboid.low_m[k]);
        Self { low_m: cuboid.low_m, side_m, from: local(source), to: local(receiver) }
    }

    /// Largest number along each axis of an image that is no farther away than this.
    fn reach(&self, max_length_m: f64) -> [i64; 3] {
        self.side_m.map(|side| (max_length_m / side).ceil() as i64 + 1)
    }

    /// From the receiver to an image, along one axis.
    fn along(&self, axis: usize, n: i64) -> f64 {
        let side = self.side_m[axis];
        let inside = self.from[axis] - self.low_m[axis];
        let seen = if n.rem_euclid(2) == 0 { inside } else { side - inside };
        self.low_m[axis] + n as f64 * side + seen - self.to[axis]
    }

    fn to_image(&self, numbers: [i64; 3]) -> Vec3 {
        std::array::from_fn(|k| self.along(k, numbers[k]))
    }

    fn length_m(&self, numbers: [i64; 3]) -> f64 {
        let to_image = self.to_image(numbers);
        dot(to_image, to_image).sqrt()
    }

    /// Unit vectors in which the path leaves the source, and from the receiver towards the image.
    fn directions(&self, numbers: [i64; 3]) -> [Vec3; 2] {
        let arrival = scale(self.to_image(numbers), 1.0 / self.length_m(numbers));
        // Each reflection turns one component around.
        let turned = |a: usize| if numbers[a].rem_euclid(2) == 0 { -arrival[a] } else { arrival[a] };
        [std::array::from_fn(turned), arrival]
    }
}

/// Reflections at the low and the high face across each axis.
fn faces_of(numbers: [i64; 3]) -> [u32; 6] {
    let mut faces = [0u32; 6];
    for (a, n) in numbers.into_iter().enumerate() {
        (faces[2 * a], faces[2 * a + 1]) = hits(n);
    }
    faces
}

/// Reflections of image number n at the low and high faces across its axis.
fn hits(n: i64) -> (u32, u32) {
    let (more, fewer) = (n.unsigned_abs().div_ceil(2) as u32, n.unsigned_abs() as u32 / 2);
    if n > 0 { (fewer, more) } else { (more, fewer) }
}

/// The factor by which amplitudes become chances of which about `most` come true, 1 being the largest chance.
fn chance_unit(found: &[(f32, [i64; 3])], most: usize) -> f64 {
    if found.len() <= most {
        return f64::INFINITY;
    }
    let amplitudes: Vec<f64> = found.iter().map(|f| (0.5 * f64::from(f.0)).exp()).collect();
    // Four sums at once: one alone waits for itself.
    let (fours, rest) = amplitudes.as_chunks::<4>();
    let expected = |unit: f64| {
        let mut sums = [0.0; 4];
        for four in fours {
            sums.iter_mut().zip(four).for_each(|(sum, a)| *sum += (a * unit).min(1.0));
        }
        sums.iter().sum::<f64>() + rest.iter().map(|a| (a * unit).min(1.0)).sum::<f64>()
    };
    let mut low = most as f64 / amplitudes.iter().sum::<f64>();
    let mut high = low;
    while expected(high) < most as f64 {
        high *= 2.0;
    }
    for _ in 0..20 {
        let middle = (low * high).sqrt();
        if expected(middle) < most as f64 { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::vector::sub;
    use sabine_acoustics::{Air, Bands, Material};
    use sabine_paths::Conditions;
    use sabine_scene::Scene;

    fn bands() -> Bands {
        Bands::octaves(1000.0, 1000.0).unwrap()
    }

    fn scene(turn: f64) -> Scene {
        let material = |a: f64| Material::uniform(bands(), a, 0.0).unwrap();
        let upright =
            Scene::shoebox([4.0, 5.0, 3.0], [0.1, 0.2, 0.3, 0.15, 0.05, 0.4].map(material)).unwrap();
        let (s, c) = turn.sin_cos();
        let vertices =
            upright.vertices().iter().map(|v| [c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]]).collect();
        Scene::new(vertices, upright.triangles().to_vec(), upright.materials().to_vec()).unwrap()
    }

    #[test]
    fn a_turned_box_has_the_paths_of_the_upright_one() {
        let ends = [[1.0, 2.0, 1.2], [2.5, 3.5, 1.7]];
        let energies = |turn: f64| {
            let scene = scene(turn);
            let (s, c) = turn.sin_cos();
            let turned = ends.map(|v: Vec3| [c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]]);
            let cuboid = Cuboid::find(&Surfaces::new(&scene).unwrap()).unwrap();
            let mut paths = PathSet::new(6, 60.0);
            cuboid.add_paths(&mut paths, turned[0], turned[1], 5000, scene.materials(), 1);
            let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
            let mut all: Vec<f32> =
                paths.energies(&Conditions::new(&materials, &Air::default())).unwrap().remove(0);
            all.sort_by(f32::total_cmp);
            all
        };
        let (upright, turned) = (energies(0.0), energies(0.7));
        assert_eq!(upright.len(), turned.len());
        for (a, b) in upright.iter().zip(&turned) {
            assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
        }
    }

    #[test]
    fn images_are_the_specular_paths() {
        let scene = scene(0.3);
        let cuboid = Cuboid::find(&Surfaces::new(&scene).unwrap()).unwrap();
        let (from, to) = ([0.4, 2.0, 1.2], [0.9, 3.5, 1.7]);
        let mut paths = PathSet::new(6, 40.0);
        cuboid.add_paths(&mut paths, from, to, 100_000, scene.materials(), 1);
        let hits = paths.hit_counts();
        let mut expected: Vec<(i64, Vec<u32>)> = (0..paths.len())
            .map(|i| {
                let own = &hits[paths.chains()[i] as usize * 6..][..6];
                let millimetres = (f64::from(paths.lengths_m()[i]) * 1e3).round() as i64;
                (millimetres, own.iter().map(|&n| u32::from(n)).collect())
            })
            .collect();
        let mut found = Vec::new();
        cuboid.for_each_image(from, to, 40.0, |image| {
            let mut own = vec![0; 6];
            image.reflections.iter().zip(cuboid.materials).for_each(|(n, m)| own[m as usize] += n);
            found.push(((image.length_m * 1e3).round() as i64, own));
        });
        expected.sort();
        found.sort();
        assert_eq!(found.len(), expected.len());
        for (a, b) in found.iter().zip(&expected) {
            assert!((a.0 - b.0).abs() <= 1, "{a:?} {b:?}");
        }
        let reflections = |all: &[(i64, Vec<u32>)]| all.iter().map(|x| x.1.iter().sum::<u32>()).sum::<u32>();
        assert_eq!(reflections(&found), reflections(&expected));
    }

    #[test]
    fn what_is_no_cuboid_is_left_alone() {
        let whole = scene(0.0);
        let part = Scene::new(
            whole.vertices().to_vec(),
            whole.triangles()[1..].to_vec(),
            whole.materials().to_vec(),
        )
        .unwrap();
        assert!(Cuboid::find(&Surfaces::new(&part).unwrap()).is_none());
        let mut vertices = whole.vertices().to_vec();
        vertices[0][0] += 0.1;
        let skew = Scene::new(vertices, whole.triangles().to_vec(), whole.materials().to_vec()).unwrap();
        assert!(Cuboid::find(&Surfaces::new(&skew).unwrap()).is_none());
    }

    #[test]
    fn turning_back_is_part_of_a_path() {
        // Two reflections at opposite faces: the path leaves towards the first.
        let scene = scene(0.0);
        let cuboid = Cuboid::find(&Surfaces::new(&scene).unwrap()).unwrap();
        let mut paths = PathSet::new(6, 60.0);
        let (from, to) = ([1.0, 2.0, 1.5], [3.0, 2.0, 1.5]);
        cuboid.add_paths(&mut paths, from, to, 100_000, scene.materials(), 1);
        let low_x = (0..paths.len())
            .find(|&i| (f64::from(paths.lengths_m()[i]) - 4.0).abs() < 1e-6 && paths.departure(i)[0] < -0.99);
        let behind = low_x.unwrap();
        // Off the wall behind the source and back past it.
        assert!(paths.arrival(behind)[0] < -0.99, "{:?}", paths.arrival(behind));
        assert!(sub(paths.departure(behind), [-1.0, 0.0, 0.0]).iter().all(|x| x.abs() < 1e-3));
    }

    #[test]
    fn a_choice_of_paths_keeps_the_energy_over_time() {
        let scene = scene(0.0);
        let cuboid = Cuboid::find(&Surfaces::new(&scene).unwrap()).unwrap();
        let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
        let by_time = |most: usize, seed: u64| -> Vec<f64> {
            let mut paths = PathSet::new(6, 120.0);
            cuboid.add_paths(&mut paths, [1.0, 2.0, 1.2], [2.5, 3.5, 1.7], most, scene.materials(), seed);
            assert!(paths.len() < 2 * most);
            let energies = paths.energies(&Conditions::new(&materials, &Air::default())).unwrap().remove(0);
            let mut sums = vec![0.0; 8];
            for (e, length) in energies.iter().zip(paths.lengths_m()) {
                sums[(length / 15.001) as usize] += f64::from(*e);
            }
            sums
        };
        let all = by_time(1_000_000, 0);
        let mut mean = vec![0.0; 8];
        for seed in 0..10 {
            by_time(8000, seed).iter().zip(&mut mean).for_each(|(e, m)| *m += 0.1 * e);
        }
        for (slot, (mean, all)) in mean.iter().zip(&all).enumerate() {
            assert!((mean / all - 1.0).abs() < 0.03, "slot {slot}: {mean} {all}");
        }
    }
}
