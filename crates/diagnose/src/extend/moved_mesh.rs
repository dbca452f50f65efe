//! The mesh of a room some of whose surfaces stand elsewhere.

use crate::extend::displaced_surface::DisplacedSurface;
use crate::survey::Survey;
use crate::survey::planes::{STEP_M, TILT, dot};
use crate::survey::surfaces::{
    Bounds, Corners, Surface, Surfaces, WELD_M, are_near, bounds_of, corners, largest, lies_on, minus,
    nearest_on, normal_of, unit,
};
use nalgebra::{DMatrix, DVector};
use sabine_propagate::{Error as Misplaced, MeshScene, check_placement};
use sabine_scene::{Receiver, Scene, Source};

/// Why surfaces cannot stand where they are said to stand.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DisplacementError {
    /// No surface of the mesh holds the point and has the normal.
    #[error("no surface of the mesh holds the point {point_m:?} with that normal")]
    NoSurface {
        /// The point, in metres.
        point_m: [f64; 3],
    },
    /// Two displacements are of one surface.
    #[error("the surface about {point_m:?} is displaced twice")]
    Twice {
        /// The point of the second, in metres.
        point_m: [f64; 3],
    },
    /// More than three planes meet at a corner, and no place is in all of them once one has moved.
    #[error("the surfaces that meet at {corner_m:?} cannot all stay flat and joined")]
    Torn {
        /// The corner, in metres.
        corner_m: [f64; 3],
    },
    /// A face turns over or vanishes.
    #[error("the face {triangle} of the mesh turns over or vanishes")]
    TurnedOver {
        /// Its index.
        triangle: usize,
    },
    /// A surface is pushed through another.
    #[error("the face {triangle} of the mesh is pushed through another")]
    Pierced {
        /// Its index.
        triangle: usize,
    },
    /// A source or receiver is not in the room any more.
    #[error("{id:?} is not in the room any more")]
    Outside {
        /// Its name.
        id: String,
    },
    /// The moved mesh is none.
    #[error(transparent)]
    Mesh(#[from] sabine_acoustics::Error),
}

/// Planes at a corner count as one below this share of the greatest singular value: half a degree between them.
const SAME_PLANE: f64 = 5e-3;
/// Way of a corner that is none, in metres.
const ROUNDING_M: f64 = 1e-12;
/// A face that is turned by more than this (one less the cosine) without being displaced was not kept flat.
const BENT: f64 = 1e-5;
/// A face that is left with less than this share of its area has vanished.
const MIN_SHARE: f64 = 1e-6;
/// How far within its ends, as a share, an edge must meet a face to go through it.
const WITHIN: f64 = 1e-6;

/// The scene with these surfaces displaced, all at once. Corners move along the surfaces that stay, so that the room stays closed: where
/// three planes meet, a corner is where they meet afterwards; where there are fewer, it moves no farther than it must. Faces need not
/// share corners: equal positions move alike, and so does what lies on a displaced surface.
pub(crate) fn displaced(scene: &Scene, all: &[DisplacedSurface]) -> Result<Scene, DisplacementError> {
    if all.is_empty() {
        return Ok(scene.clone());
    }
    displaced_among(scene, &Surfaces::of(scene), all)
}

/// The same, its surfaces being known.
pub(crate) fn displaced_among(
    scene: &Scene,
    surfaces: &Surfaces,
    all: &[DisplacedSurface],
) -> Result<Scene, DisplacementError> {
    let mut moved: Vec<Option<&DisplacedSurface>> = vec![None; surfaces.planes.len()];
    for one in all {
        let surface =
            surface_at(scene, surfaces, one).ok_or(DisplacementError::NoSurface { point_m: one.point_m })?;
        if moved[surface].replace(one).is_some() {
            return Err(DisplacementError::Twice { point_m: one.point_m });
        }
    }
    let vertices = moved_vertices(scene, surfaces, &moved)?;
    let found = Scene::new(vertices, scene.triangles().to_vec(), scene.materials().to_vec())?;
    check_faces(scene, &found, surfaces, &moved)?;
    check_crossings(scene, &found, surfaces)?;
    Ok(found)
}

/// The surface that holds the point of a displacement.
fn surface_at(scene: &Scene, surfaces: &Surfaces, one: &DisplacedSurface) -> Option<usize> {
    let normal = unit(one.normal);
    let far = |surface: usize| {
        surfaces
            .triangles(surface)
            .map(|t| {
                let off = minus(nearest_on(corners(scene, t), one.point_m), one.point_m);
                dot(off, off).sqrt()
            })
            .fold(f64::INFINITY, f64::min)
    };
    (0..surfaces.planes.len())
        .filter(|&s| dot(surfaces.planes[s].0, normal).abs() > 1.0 - TILT)
        .map(|s| (far(s), s))
        .filter(|(far, _)| *far < STEP_M)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, s)| s)
}

/// Where the vertices are once the surfaces stand elsewhere.
fn moved_vertices(
    scene: &Scene,
    surfaces: &Surfaces,
    moved: &[Option<&DisplacedSurface>],
) -> Result<Vec<[f64; 3]>, DisplacementError> {
    let all_moved = (0..moved.len()).filter(|&s| moved[s].is_some());
    let of_moved: Vec<Corners> =
        all_moved.flat_map(|s| surfaces.triangles(s)).map(|t| corners(scene, t)).collect();
    let around = bounds_of(of_moved.iter().flatten().copied());
    let bounds = surfaces.bounds(scene);
    // Vertices in one place are moved once.
    let mut done: Vec<([f64; 3], [f64; 3])> = Vec::new();
    let mut found = scene.vertices().to_vec();
    for vertex in &mut found {
        let place = *vertex;
        if !are_near(&around, &at(place)) || !of_moved.iter().any(|own| lies_on(*own, place)) {
            continue;
        }
        let is_here = |(at, _): &&([f64; 3], [f64; 3])| {
            let off = minus(*at, place);
            dot(off, off) <= WELD_M * WELD_M
        };
        let way = match done.iter().find(is_here) {
            Some((_, way)) => *way,
            None => {
                let way = way_of(scene, (surfaces, &bounds), moved, place)?;
                done.push((place, way));
                way
            }
        };
        *vertex = std::array::from_fn(|k| place[k] + way[k]);
    }
    Ok(found)
}

/// A box that is a point.
fn at(place: [f64; 3]) -> Bounds {
    place.map(|c| [c, c])
}

/// The shortest way that keeps a corner in all planes that meet there.
fn way_of(
    scene: &Scene,
    (surfaces, bounds): (&Surfaces, &[Bounds]),
    moved: &[Option<&DisplacedSurface>],
    place: [f64; 3],
) -> Result<[f64; 3], DisplacementError> {
    let is_on = |surface: usize| surfaces.triangles(surface).any(|t| lies_on(corners(scene, t), place));
    let here: Vec<usize> =
        (0..bounds.len()).filter(|&s| are_near(&bounds[s], &at(place)) && is_on(s)).collect();
    let mut normals = DMatrix::zeros(here.len(), 3);
    let mut shifts = DVector::zeros(here.len());
    for (row, &surface) in here.iter().enumerate() {
        let (stated, centre) = surfaces.planes[surface];
        let normal = match moved[surface] {
            None => stated,
            Some(one) => {
                let (normal, point) = one.plane();
                // What a vertex is off its plane as stated, it stays off.
                let off = dot(unit(one.normal), minus(place, centre));
                shifts[row] = off - dot(normal, minus(place, point));
                normal
            }
        };
        (0..3).for_each(|k| normals[(row, k)] = normal[k]);
    }
    let torn = || DisplacementError::Torn { corner_m: place };
    let decomposed = normals.clone().svd(true, true);
    let greatest = decomposed.singular_values.max();
    let way = decomposed.solve(&shifts, SAME_PLANE * greatest).map_err(|_| torn())?;
    if (&normals * &way - &shifts).amax() > WELD_M {
        return Err(torn());
    }
    // A box stays one to the last bit.
    Ok([way[0], way[1], way[2]].map(|c| if c.abs() < ROUNDING_M { 0.0 } else { c }))
}

/// Refuses faces that have turned over, or are flat no more.
fn check_faces(
    stated: &Scene,
    found: &Scene,
    surfaces: &Surfaces,
    moved: &[Option<&DisplacedSurface>],
) -> Result<(), DisplacementError> {
    for (triangle, surface) in surfaces.of_triangle.iter().enumerate() {
        let Some(surface) = *surface else { continue };
        let (before, after) = (normal_of(corners(stated, triangle)), normal_of(corners(found, triangle)));
        let (was, is) = (dot(before, before).sqrt(), dot(after, after).sqrt());
        if is < MIN_SHARE * was || dot(before, after) <= 0.0 {
            return Err(DisplacementError::TurnedOver { triangle });
        }
        let off = |normal: [f64; 3], face: [f64; 3]| 1.0 - dot(unit(normal), unit(face)).abs();
        let (was_off, is_off) = match moved[surface] {
            Some(one) => (off(one.normal, before), off(one.plane().0, after)),
            None => (0.0, off(before, after)),
        };
        if is_off > BENT + 4.0 * was_off && corners_moved(stated, found, triangle) {
            return Err(DisplacementError::Torn { corner_m: corners(stated, triangle)[0] });
        }
    }
    Ok(())
}

fn corners_moved(stated: &Scene, found: &Scene, triangle: usize) -> bool {
    corners(stated, triangle) != corners(found, triangle)
}

/// Refuses faces of which an edge goes through another face, or through which another's edge goes, where none did.
fn check_crossings(stated: &Scene, found: &Scene, surfaces: &Surfaces) -> Result<(), DisplacementError> {
    let bounds = surfaces.bounds(found);
    for one in (0..surfaces.of_triangle.len()).filter(|&t| corners_moved(stated, found, t)) {
        let own = corners(found, one);
        let around = bounds_of(own.into_iter());
        let near = (0..bounds.len()).filter(|&s| are_near(&bounds[s], &around));
        for other in near.flat_map(|s| surfaces.triangles(s)).filter(|&other| other != one) {
            let theirs = corners(found, other);
            if !are_near(&bounds_of(theirs.into_iter()), &around) {
                continue;
            }
            let crosses = |a: Corners, b: Corners| goes_through(a, b) || goes_through(b, a);
            if crosses(own, theirs) && !crosses(corners(stated, one), corners(stated, other)) {
                return Err(DisplacementError::Pierced { triangle: one });
            }
        }
    }
    Ok(())
}

/// Farthest that a surface is moved along its normal, in metres, either way.
pub(crate) const FARTHEST_M: f64 = 0.8;
/// Smaller ranges are tried by halves, so often.
const HALVES: usize = 4;
/// Surfaces whose ranges are looked for: those that most early reflections meet.
const MAX_RANGES: usize = 24;
/// Sources and receivers stay this far before a surface, in metres.
const BEFORE_M: f64 = 0.1;

/// Finds how far each surface that early reflections meet can be moved along its normal. Nothing is moved farther than [`FARTHEST_M`].
pub(crate) fn find_ranges(scene: &Scene, surfaces: &Surfaces, survey: &mut Survey) {
    let mut order: Vec<usize> =
        (0..survey.surfaces.len()).filter(|&s| survey.surfaces[s].reflections > 0).collect();
    order.sort_by_key(|&s| std::cmp::Reverse(survey.surfaces[s].reflections));
    order.truncate(MAX_RANGES);
    for number in order {
        let Surface { axes: [normal, along, across], centre_m, .. } = survey.surfaces[number];
        let own: Vec<Corners> = surfaces.triangles(number).map(|t| corners(scene, t)).collect();
        let extent = |axis: [f64; 3]| {
            let at = own.iter().flatten().map(|c| dot(axis, *c));
            at.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
        };
        let [(u_low, u_high), (v_low, v_high)] = [extent(along), extent(across)];
        // Places before the surface.
        let mut inwards_m = FARTHEST_M;
        for place in survey.sources.iter().chain(&survey.receivers).map(|p| p.position_m) {
            let before_m = dot(normal, minus(centre_m, place));
            let within = (u_low..=u_high).contains(&dot(along, place))
                && (v_low..=v_high).contains(&dot(across, place));
            if within && before_m > 0.0 {
                inwards_m = inwards_m.min((before_m - BEFORE_M).max(0.0));
            }
        }
        let feasible = |far_m: f64, sign: f64| {
            let mut far_m = far_m;
            for _ in 0..HALVES {
                let one = DisplacedSurface::new(centre_m, normal, sign * far_m, [0.0; 2]);
                if displaced_among(scene, surfaces, &[one]).is_ok() {
                    return far_m;
                }
                far_m *= 0.5;
            }
            0.0
        };
        survey.surfaces[number].range_m = [-feasible(inwards_m, -1.0), feasible(FARTHEST_M, 1.0)];
    }
}

/// Whether an edge of one triangle goes through the inside of another.
fn goes_through(edges: Corners, face: Corners) -> bool {
    let normal = unit(normal_of(face));
    let drop = largest(normal);
    let flat = |p: [f64; 3]| [p[(drop + 1) % 3], p[(drop + 2) % 3]];
    (0..3).any(|i| {
        let (from, to) = (edges[i], edges[(i + 1) % 3]);
        let (a, b) = (dot(normal, minus(from, face[0])), dot(normal, minus(to, face[0])));
        // Edges that end on the face, or lie in it, only touch it.
        if a * b >= 0.0 || a.abs() < WELD_M || b.abs() < WELD_M {
            return false;
        }
        let share = a / (a - b);
        let place = flat(std::array::from_fn(|k| from[k] + share * (to[k] - from[k])));
        let [p, q, r] = face.map(flat);
        let area = |u: [f64; 2], v: [f64; 2], w: [f64; 2]| {
            (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0])
        };
        let whole = area(p, q, r);
        [area(place, q, r), area(p, place, r), area(p, q, place)].iter().all(|part| part / whole > WITHIN)
    })
}

/// Refuses a mesh that leaves a source or receiver outside, or inside a body, that was in the room before.
pub(crate) fn check_places(
    stated: &Scene,
    found: &Scene,
    sources: &[Source],
    receivers: &[Receiver],
) -> Result<(), DisplacementError> {
    let (Some(first_source), Some(first_receiver)) = (sources.first(), receivers.first()) else {
        return Ok(());
    };
    let outside = |id: &str| DisplacementError::Outside { id: id.to_owned() };
    let mesh = |scene: &Scene| MeshScene::new(scene).ok();
    let (Some(before), Some(after)) = (mesh(stated), mesh(found)) else {
        return Err(outside(&first_source.id));
    };
    let pairs = sources
        .iter()
        .map(|source| (source, first_receiver))
        .chain(receivers.iter().map(|receiver| (first_source, receiver)));
    for (source, receiver) in pairs {
        // Two places that are one are not the mesh's fault.
        let misplaced = |mesh: &MeshScene| match check_placement(mesh, source, receiver) {
            Err(Misplaced::OnSurface { id, .. } | Misplaced::Outside { id, .. })
            | Err(Misplaced::InsideBody { id, .. }) => Some(id),
            _ => None,
        };
        if let Some(id) = misplaced(&after).filter(|_| misplaced(&before).is_none()) {
            return Err(outside(&id));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
