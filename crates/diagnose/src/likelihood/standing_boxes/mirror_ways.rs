//! Reflections at the faces of a box: alone, and before or after one surface of the mesh.
//!
//! A face mirrors the source; the reflection is there if the line from the image to the receiver crosses the face, and every leg of the way
//! is free (J. Borish, Extension of the image model to arbitrary polyhedra, JASA 75, 1984).

use crate::extend::standing_box::Solid;
use crate::survey::planes::dot;
use crate::survey::surfaces::{minus, mirrored_in, unit};
use sabine_paths::RayScene;

/// A leg ends so far before the surface that it meets, in metres.
const BEFORE_M: f64 = 5e-3;
/// A place nearer to a face than this is not told from one in it, in metres.
const LEAST_M: f64 = 0.02;

/// A surface of the mesh that reflects before or after the box: a point, its normal, and what is lost there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mirror {
    pub point_m: [f64; 3],
    pub normal: [f64; 3],
    pub level_db: f64,
}

/// Where the mesh reflects a way that a face of the box reflects, too.
#[derive(Clone, Copy, Debug)]
pub(crate) enum MeshStop {
    Never,
    Before(Mirror),
    After(Mirror),
}

/// Two places between which a face may reflect: source and receiver, or one of them and the image of the other in a surface of the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MirrorWay {
    pub ends_m: [[f64; 3]; 2],
    /// Source and receiver themselves.
    pub places_m: [[f64; 3]; 2],
    pub stop: MeshStop,
    pub direct_m: f64,
    /// Ways longer than this are not looked for.
    pub longest_m: f64,
}

/// A reflection that a box adds; its face is taken to reflect everything.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reflected {
    pub length_m: f64,
    pub departure: [f64; 3],
    pub arrival: [f64; 3],
    /// Over the direct sound, in dB.
    pub level_db: f64,
}

impl MirrorWay {
    /// All ways between a source and a receiver over a box and at most one of some mirrors.
    pub fn all(places_m: [[f64; 3]; 2], mirrors: &[Mirror], longest_m: f64) -> Vec<Self> {
        let [source, receiver] = places_m;
        let way = minus(receiver, source);
        let direct_m = dot(way, way).sqrt();
        let one = |ends_m, stop| Self { ends_m, places_m, stop, direct_m, longest_m };
        let mut all = vec![one(places_m, MeshStop::Never)];
        for mirror in mirrors {
            let image = |place| mirrored_in(place, mirror.normal, mirror.point_m);
            all.push(one([image(source), receiver], MeshStop::Before(*mirror)));
            all.push(one([source, image(receiver)], MeshStop::After(*mirror)));
        }
        all
    }

    /// Calls `found` with every reflection at a face that is seen from both ends and free on all legs.
    pub fn reflected(&self, solid: &Solid, mesh: &dyn RayScene, mut found: impl FnMut(Reflected)) {
        let [from, to] = self.ends_m.map(|place| solid.local(place));
        // Upper face, then the four upright ones.
        let heights = [from[2] - solid.height, to[2] - solid.height];
        let mut at = |heights: [f64; 2], place: [f64; 3]| {
            if let Some(one) = self.followed(solid, mesh, heights, solid.place(place)) {
                found(one);
            }
        };
        if let Some(place) = crossing(from, to, heights)
            && place[0].abs() < solid.half[0]
            && place[1].abs() < solid.half[1]
        {
            at(heights, [place[0], place[1], solid.height]);
        }
        for axis in 0..2 {
            for sign in [1.0, -1.0] {
                let heights = [from, to].map(|p| sign * p[axis] - solid.half[axis]);
                let Some(place) = crossing(from, to, heights) else { continue };
                let other = 1 - axis;
                if place[other].abs() < solid.half[other] && (0.0..solid.height).contains(&place[2]) {
                    let mut on_face = place;
                    on_face[axis] = sign * solid.half[axis];
                    at(heights, on_face);
                }
            }
        }
    }

    /// The reflection at a place of a face over which both ends have these heights, if every leg is free.
    fn followed(
        &self,
        solid: &Solid,
        mesh: &dyn RayScene,
        heights: [f64; 2],
        face: [f64; 3],
    ) -> Option<Reflected> {
        let [from, to] = self.ends_m;
        let straight = minus(to, from);
        // The image in the face is farther by both heights, one after the other.
        let length_m = (dot(straight, straight) + 4.0 * heights[0] * heights[1]).sqrt();
        if length_m > self.longest_m {
            return None;
        }
        let [source, receiver] = self.places_m;
        let (first, last, lost_db) = match self.stop {
            MeshStop::Never => {
                let free = is_free(mesh, source, face, BEFORE_M) && is_free(mesh, face, receiver, BEFORE_M);
                free.then_some((face, face, 0.0))?
            }
            MeshStop::Before(mirror) => {
                let stop = meets(mesh, solid, (source, face), from, &mirror)?;
                is_free(mesh, face, receiver, BEFORE_M).then_some((stop, face, mirror.level_db))?
            }
            MeshStop::After(mirror) => {
                let stop = meets(mesh, solid, (receiver, face), to, &mirror)?;
                is_free(mesh, face, source, BEFORE_M).then_some((face, stop, mirror.level_db))?
            }
        };
        Some(Reflected {
            length_m,
            departure: unit(minus(first, source)),
            arrival: unit(minus(last, receiver)),
            level_db: 20.0 * (self.direct_m / length_m).log10() + lost_db,
        })
    }
}

/// Where a face reflects between two places of these heights over it, in the coordinates of the places; none if one is behind it.
fn crossing(from: [f64; 3], to: [f64; 3], [a, b]: [f64; 2]) -> Option<[f64; 3]> {
    if a < LEAST_M || b < LEAST_M {
        return None;
    }
    let share = a / (a + b);
    Some(std::array::from_fn(|k| from[k] + share * (to[k] - from[k])))
}

/// Whether nothing is between two places, up to so much before each of them.
fn is_free(mesh: &dyn RayScene, from: [f64; 3], to: [f64; 3], before_m: f64) -> bool {
    let way = minus(to, from);
    let length = dot(way, way).sqrt();
    if length < 2.0 * before_m {
        return true;
    }
    let direction = way.map(|c| c / length);
    let begin = std::array::from_fn(|k| from[k] + before_m * direction[k]);
    !mesh.any_hit(begin, direction, length - 2.0 * before_m)
}

/// Where the mesh reflects the way from a place to a face, given the place's image in the mirror; none unless it does.
fn meets(
    mesh: &dyn RayScene,
    solid: &Solid,
    (place, face): ([f64; 3], [f64; 3]),
    image: [f64; 3],
    mirror: &Mirror,
) -> Option<[f64; 3]> {
    let height = |p: [f64; 3]| dot(mirror.normal, minus(p, mirror.point_m));
    let (below, above) = (height(image), height(face));
    if below * above >= 0.0 {
        return None;
    }
    let share = below / (below - above);
    let stop: [f64; 3] = std::array::from_fn(|k| image[k] + share * (face[k] - image[k]));
    let way = minus(stop, place);
    let length = dot(way, way).sqrt();
    if length < LEAST_M {
        return None;
    }
    let hit = mesh.closest_hit(place, way.map(|c| c / length), length + BEFORE_M)?;
    ((hit.distance - length).abs() < BEFORE_M
        && is_free(mesh, stop, face, BEFORE_M)
        && solid.crossed(place, stop).is_none())
    .then_some(stop)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::extend::standing_box::StandingBox;
    use sabine_acoustics::{Bands, Material};
    use sabine_propagate::{MeshScene, PathTracer, TracerConfig};
    use sabine_scene::{Receiver, Scene, Source};

    /// Exact paths of the tracer in a mesh with the box: those that the room alone does not have, over the box and at most one wall.
    #[test]
    fn reflections_are_those_that_the_tracer_finds_in_a_mesh_with_the_box() {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let room = Scene::shoebox([6.0, 5.0, 2.8], std::array::from_fn(|_| hard.clone())).unwrap();
        let one = StandingBox::new([2.6, 2.3, 0.0], [1.9, 0.8, 1.5], 20.0, 0.1);
        let with = one.added_to(&room, 0).unwrap();
        let walls = [
            ([0.0; 3], [1.0, 0.0, 0.0]),
            ([0.0; 3], [0.0, 1.0, 0.0]),
            ([0.0; 3], [0.0, 0.0, 1.0]),
            ([6.0, 5.0, 2.8], [1.0, 0.0, 0.0]),
            ([6.0, 5.0, 2.8], [0.0, 1.0, 0.0]),
            ([6.0, 5.0, 2.8], [0.0, 0.0, 1.0]),
        ];
        let mirrors = walls.map(|(point_m, normal)| Mirror { point_m, normal, level_db: 0.0 });
        // In the mesh the box stands two millimetres higher.
        let solid = Solid::of(&StandingBox { base_m: [2.6, 2.3, 2e-3], ..one });
        let mesh = MeshScene::new(&room).unwrap();
        let config = TracerConfig { rays: 1000, image_order: 2, ..TracerConfig::default() };
        let tracer = PathTracer::new(config).unwrap();
        let mut seen = 0;
        // Places over the room, none in the box nor near a wall.
        let place = |i: usize| -> [f64; 3] {
            let share = |k: usize| 0.1 + 0.8 * ((i as f64 * [0.618, 0.755, 0.569][k]) % 1.0);
            [6.0 * share(0), 5.0 * share(1), 2.8 * share(2)]
        };
        let free: Vec<[f64; 3]> = (1..40).map(place).filter(|p| !solid.holds(*p, 0.2)).collect();
        for ends in free.chunks_exact(2).take(12) {
            let [source, receiver] = [ends[0], ends[1]];
            let lengths = |scene: &Scene| -> Vec<f64> {
                let places = (Source::omni("s", source).unwrap(), Receiver::omni("r", receiver).unwrap());
                let prepared = tracer.prepare(scene).unwrap();
                let air = sabine_acoustics::Air::default();
                let paths = tracer.trace_prepared(&prepared, &places.0, &places.1, &air, &()).unwrap();
                (0..paths.len())
                    .filter(|&i| paths.is_exact(i))
                    .map(|i| f64::from(paths.lengths_m()[i]))
                    .filter(|length| *length < 16.0)
                    .collect()
            };
            let (before, after) = (lengths(&room), lengths(&with));
            let mut expected: Vec<f64> =
                after.into_iter().filter(|l| before.iter().all(|b| (b - l).abs() > 1e-4)).collect();
            let mut found = Vec::new();
            for way in MirrorWay::all([source, receiver], &mirrors, 16.0) {
                way.reflected(&solid, &mesh, |r| found.push(r.length_m));
            }
            expected.sort_by(f64::total_cmp);
            found.sort_by(f64::total_cmp);
            seen += found.len();
            assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} {expected:?}");
        }
        assert!(seen > 8, "{seen}");
    }
}
