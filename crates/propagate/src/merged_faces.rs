//! The triangles that rays are tested against, where flat walls of many triangles are cut into few.

mod flat_patches;
mod half_edges;
mod outlines;
mod triangulation;

use crate::surfaces::{Surface, Surfaces};
use crate::vector::{norm, sub};
use flat_patches::FlatPatches;
use half_edges::HalfEdges;
use outlines::Outlines;
use sabine_scene::Scene;
use triangulation::triangulated;

/// Triangles of a patch lie in one plane to this share of the size of the scene: what the rounding of coordinates to single
/// precision, as in glTF, leaves of a flat wall.
const FLAT: f64 = 1e-7;
/// Area of a patch may change by rounding in this proportion.
const SAME_AREA: f64 = 1e-9;
/// No patch gets a triangle narrower than this (height over longest side) that had none so narrow: where a ray meets a sliver
/// is uncertain.
const SLIVER: f64 = 1e-5;
/// A patch that cannot be triangulated again keeps its triangles, and with them the vertices of its outline, which its neighbours then
/// keep too: outlines are drawn so many times at most.
const MAX_ROUNDS: usize = 8;

/// What becomes of a patch.
enum Cut {
    /// It keeps its triangles: there is nothing to merge.
    Same,
    /// Vertices of the new triangles.
    Anew(Vec<[u32; 3]>),
}

/// Merges the triangles of each flat patch of one material and cuts the patch into as few as its outline allows; `None` if there is
/// nothing to merge.
///
/// The union of the triangles stays the same: vertices inside a patch go, and vertices on a straight part of an outline go
/// from all patches that share it, so that neighbours still meet in common edges. A face reports the largest triangle of its
/// patch as the one that is hit ([`Surface::triangle`]): material, plane and normal are those of all its triangles.
pub(crate) fn merged(scene: &Scene, surfaces: &Surfaces) -> Option<Vec<Surface>> {
    let edges = HalfEdges::new(scene, &surfaces.triangles);
    let flat_m = FLAT * surfaces.size_m;
    let patches = FlatPatches::find(&edges, &surfaces.triangles, flat_m);
    if patches.len() == edges.corners.len() {
        return None;
    }
    let mut frozen = vec![false; patches.len()];
    for _ in 0..MAX_ROUNDS {
        let outlines = Outlines::draw(&edges, &patches, &frozen, surfaces.size_m, flat_m);
        let mut sound = true;
        let mut cuts = Vec::with_capacity(patches.len());
        for (patch, frozen) in frozen.iter_mut().enumerate() {
            let cut = if *frozen {
                Some(Cut::Same)
            } else {
                cut(patch, &edges, &patches, &outlines, &surfaces.triangles, flat_m)
            };
            *frozen |= cut.is_none();
            sound &= cut.is_some();
            cuts.push(cut.unwrap_or(Cut::Same));
        }
        if sound {
            let faces = faces(&cuts, &edges, &patches, &surfaces.triangles);
            return (faces.len() < edges.corners.len()).then_some(faces);
        }
    }
    None
}

/// Triangulates a patch again; `None` if that cannot be done without loss.
fn cut(
    patch: usize,
    edges: &HalfEdges,
    patches: &FlatPatches,
    outlines: &Outlines,
    surfaces: &[Surface],
    flat_m: f64,
) -> Option<Cut> {
    let members = patches.members(patch);
    let all_kept = |&t: &u32| edges.corners[t as usize].iter().all(|&v| outlines.keeps(v));
    if members.iter().all(all_kept) {
        return Some(Cut::Same);
    }
    let outline = outlines.of(patch)?;
    let old = || members.iter().map(|&t| &surfaces[edges.triangles[t as usize] as usize]);
    let normal = surfaces[patches.representative(patch, edges, surfaces)].normal;
    let triangles = triangulated(&edges.points, &outline.segments, normal)?;
    let new: Vec<Surface> = triangles.iter().map(|&corners| face(corners, edges)).collect();
    let area_m2: f64 = old().map(|s| s.area_m2).sum();
    let new_m2: f64 = new.iter().map(|s| s.area_m2).sum();
    let narrowest = |least: f64, s: &Surface| least.min(slenderness(s));
    let (new_least, old_least) = (new.iter().fold(SLIVER, narrowest), old().fold(SLIVER, narrowest));
    let same_area = (new_m2 - area_m2).abs() <= SAME_AREA * area_m2 + flat_m * outline.length_m;
    (same_area && new_least >= old_least).then_some(Cut::Anew(triangles))
}

fn face(corners: [u32; 3], edges: &HalfEdges) -> Surface {
    Surface::new(corners.map(|v| edges.points[v as usize]), 0)
}

/// Height over the longest side.
fn slenderness(surface: &Surface) -> f64 {
    let third = sub(surface.edge2, surface.edge1);
    let longest = norm(surface.edge1).max(norm(surface.edge2)).max(norm(third));
    2.0 * surface.area_m2 / (longest * longest)
}

/// All faces, patch by patch.
fn faces(cuts: &[Cut], edges: &HalfEdges, patches: &FlatPatches, surfaces: &[Surface]) -> Vec<Surface> {
    let mut faces = Vec::new();
    for (patch, cut) in cuts.iter().enumerate() {
        match cut {
            Cut::Same => {
                let own = patches.members(patch).iter().map(|&t| edges.triangles[t as usize] as usize);
                faces.extend(own.map(|i| surfaces[i].clone()));
            }
            Cut::Anew(triangles) => {
                let like = &surfaces[patches.representative(patch, edges, surfaces)];
                faces.extend(triangles.iter().map(|&corners| Surface {
                    material: like.material,
                    plane: like.plane,
                    agreement_m: like.agreement_m,
                    triangle: like.triangle,
                    ..face(corners, edges)
                }));
            }
        }
    }
    // Slivers of no area along a line that is not quite straight: nothing would hit them.
    faces.retain(|face| !face.is_degenerate());
    faces
}
