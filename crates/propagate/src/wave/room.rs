//! A room cut into voxels.

use super::axes::Axes;
use super::crossings::{Crossing, crossings};
use super::error::WaveError;
use crate::mesh_scene::MeshScene;
use crate::vector::Vec3;
use crate::walk::visible;
use crate::{Error, MeshReport};
use sabine_scene::{Scene, Source};
use std::collections::HashMap;

/// Walls whose normal is this near to an axis (cosine) are where the mesh has them; others become stairs.
const FACING: f64 = 0.95;
/// Narrowest a voxel between two walls may get, in voxels.
const NARROWEST: f64 = 1e-3;
/// Share of the voxels around a point that must be in the room and in its sight.
const LEAST_SHARE: f64 = 1e-3;
/// The voxel belongs to the room.
const INSIDE: u8 = 8;

/// A wall beside a voxel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    pub axis: u8,
    pub material: u32,
    /// Area of the mesh's surface over that of this face: below 1 for the stairs of a slanted wall.
    pub slant: f64,
}

/// A voxel whose neighbours are not all of full size and open.
#[derive(Clone, Debug)]
pub(crate) struct Edge {
    pub voxel: u32,
    /// Its sides, in voxels.
    pub extent: Vec3,
    /// Areas towards the neighbours (x-, x+, y-, ...) over its volume, in voxels; 0 for a wall.
    pub links: [f64; 6],
    pub faces: Vec<Face>,
}

/// The inside of a mesh as voxels, for [`WaveSolver`](super::WaveSolver): what of it sound from a source can reach.
///
/// Two neighbouring voxels are joined unless the line between their centres meets a triangle, whichever way it is turned, so
/// screens without thickness and double walls need no care; the room is what is joined to the source. Sound cannot get
/// through a closed mesh that way, and what gets out shows that the mesh is not closed.
///
/// A wall that faces an axis (within 18 degrees) is where the mesh has it: the voxel before it is wider or narrower. Slanted
/// walls are stairs; their voxels' faces add up to more than the wall, and their admittance is smaller by as much: by
/// |n_x| + |n_y| + |n_z| for a normal n.
pub struct WaveRoom {
    pub(crate) axes: Axes,
    pub(crate) mesh: MeshScene,
    /// Voxels with full neighbours all around: first voxel and number along x, in order ...
    pub(crate) runs: Vec<(u32, u32)>,
    /// ... and all others, in order.
    pub(crate) edges: Vec<Edge>,
    /// Marks of the voxels: whether inside, and whether the line to the next one along x, y, z is cut.
    marks: Vec<u8>,
    volume_m3: f64,
    material_areas_m2: Vec<f64>,
    inside: usize,
}

impl WaveRoom {
    pub(crate) fn new(
        scene: &Scene,
        source: &Source,
        spacing_m: f64,
        limit_hz: f64,
        budget_bytes: u64,
    ) -> Result<Self, Error> {
        let mesh = MeshScene::new(scene)?;
        let (mut low_m, mut high_m) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in mesh.surfaces.triangles.iter().filter(|s| !s.is_degenerate()).flat_map(|s| s.corners())
        {
            low_m = std::array::from_fn(|a| low_m[a].min(corner[a]));
            high_m = std::array::from_fn(|a| high_m[a].max(corner[a]));
        }
        let axes = Axes::new(low_m, high_m, spacing_m, limit_hz, budget_bytes)?;
        let cuts: [Vec<Crossing>; 3] = std::array::from_fn(|axis| crossings(scene, &axes, axis));
        let mut marks = vec![0u8; axes.voxels()];
        for (axis, cuts) in cuts.iter().enumerate() {
            cuts.iter().for_each(|cut| marks[cut.voxel as usize] |= 1 << axis);
        }
        let mut room = Self {
            axes,
            mesh,
            runs: Vec::new(),
            edges: Vec::new(),
            marks,
            volume_m3: 0.0,
            material_areas_m2: vec![0.0; scene.materials().len()],
            inside: 0,
        };
        room.fill(scene, source)?;
        room.find_edges(&cuts);
        room.find_runs();
        Ok(room)
    }

    /// Sides of a voxel in metres.
    pub fn spacing_m(&self) -> [f64; 3] {
        self.axes.spacing_m
    }

    /// Number of voxels in the room.
    pub fn voxels(&self) -> usize {
        self.inside
    }

    /// Volume of these voxels in cubic metres.
    pub fn volume_m3(&self) -> f64 {
        self.volume_m3
    }

    /// Surface of each material as the waves meet it, in square metres.
    pub fn material_areas_m2(&self) -> &[f64] {
        &self.material_areas_m2
    }

    /// Longest side of the mesh, along an axis, in metres.
    pub fn longest_side_m(&self) -> f64 {
        let side = |a: usize| self.axes.spacing_m[a] * (self.axes.count[a] - 2) as f64;
        (0..3).map(side).fold(0.0, f64::max)
    }

    /// Memory that a solution takes at most, in bytes.
    pub fn bytes(&self) -> u64 {
        self.axes.bytes()
    }

    /// Voxels around a point with their shares in an interpolation: of third degree along each axis on which four voxels
    /// belong to the room and see the point, of first degree along the others. Where not even two are there, those that are
    /// share the whole, for the pressure hardly changes across a wall.
    pub(crate) fn around(&self, point_m: Vec3) -> Vec<(usize, f64)> {
        let in_sight = |&(voxel, _): &(usize, f64)| {
            self.is_inside(voxel) && visible(&self.mesh, point_m, self.axes.centre_m(voxel))
        };
        // Most axes of third degree first.
        for cubic in [7usize, 3, 5, 6, 1, 2, 4] {
            let corners = self.stencil(point_m, std::array::from_fn(|a| cubic >> a & 1 == 1));
            if corners.iter().all(in_sight) {
                return corners;
            }
        }
        let mut corners = self.stencil(point_m, [false; 3]);
        corners.retain(in_sight);
        let sum: f64 = corners.iter().map(|(_, share)| share).sum();
        corners.iter_mut().for_each(|(_, share)| *share /= sum);
        corners.retain(|_| sum > LEAST_SHARE);
        corners
    }

    /// Voxels about a point, with the products of Lagrange's polynomials along the axes.
    fn stencil(&self, point_m: Vec3, cubic: [bool; 3]) -> Vec<(usize, f64)> {
        let along: [Vec<(usize, f64)>; 3] = std::array::from_fn(|a| {
            let last = self.axes.count[a] - 1;
            let at = self.axes.coordinate(a, point_m[a]).clamp(0.0, last as f64 - 1e-9);
            let (first, t) = (at as usize, at.fract());
            if !cubic[a] || first == 0 || first + 2 > last {
                return vec![(first, 1.0 - t), (first + 1, t)];
            }
            let weights = [
                -t * (t - 1.0) * (t - 2.0) / 6.0,
                (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
                -(t + 1.0) * t * (t - 2.0) / 2.0,
                (t + 1.0) * t * (t - 1.0) / 6.0,
            ];
            weights.into_iter().enumerate().map(|(i, weight)| (first + i - 1, weight)).collect()
        });
        let mut shares = Vec::new();
        for &(k, z) in &along[2] {
            for &(j, y) in &along[1] {
                for &(i, x) in &along[0] {
                    if x * y * z != 0.0 {
                        shares.push((self.axes.index([i, j, k]), x * y * z));
                    }
                }
            }
        }
        shares
    }

    /// Marks what is joined to the source.
    fn fill(&mut self, scene: &Scene, source: &Source) -> Result<(), Error> {
        let seen = |&(voxel, _): &(usize, f64)| {
            visible(&self.mesh, source.position_m, self.axes.centre_m(voxel)) && !self.axes.is_outer(voxel)
        };
        let nearest = self.stencil(source.position_m, [false; 3]);
        let first = nearest.into_iter().filter(seen).max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((first, _)) = first else {
            let (id, position_m) = (source.id.clone(), source.position_m);
            let spacing_m = self.axes.spacing_m;
            return Err(WaveError::BetweenVoxels { what: "source", id, position_m, spacing_m }.into());
        };
        let strides = self.axes.strides();
        let mut waiting = vec![first];
        self.marks[first] |= INSIDE;
        while let Some(voxel) = waiting.pop() {
            self.inside += 1;
            for (axis, stride) in strides.into_iter().enumerate() {
                for (next, cut) in [
                    (voxel + stride, self.marks[voxel] >> axis & 1),
                    (voxel - stride, self.marks[voxel - stride] >> axis & 1),
                ] {
                    if cut != 0 || self.marks[next] & INSIDE != 0 {
                        continue;
                    }
                    if self.axes.is_outer(next) {
                        return Err(self.leak(scene, source, voxel)?.into());
                    }
                    self.marks[next] |= INSIDE;
                    waiting.push(next);
                }
            }
        }
        Ok(())
    }

    fn leak(&self, scene: &Scene, source: &Source, voxel: usize) -> Result<WaveError, Error> {
        let report = MeshReport::new(scene, &self.mesh, source.position_m)?;
        Ok(WaveError::WavesLeak {
            at_m: self.axes.centre_m(voxel),
            spacing_m: self.axes.spacing_m,
            open_edges: report.open_edges.len(),
            example_m: report.open_edges.first().map(|edge| edge.ends_m),
        })
    }

    fn is_inside(&self, voxel: usize) -> bool {
        self.marks[voxel] & INSIDE != 0
    }

    fn find_edges(&mut self, cuts: &[Vec<Crossing>; 3]) {
        let strides = self.axes.strides();
        // Voxels with a wall at least at one side.
        let mut walled: Vec<Edge> = Vec::new();
        for voxel in 0..self.marks.len() {
            let cut = |axis: usize| (self.marks[voxel] | self.marks[voxel - strides[axis]]) >> axis & 1 != 0;
            if !self.is_inside(voxel) || !(0..3).any(cut) {
                continue;
            }
            let mut edge = Edge { voxel: voxel as u32, extent: [1.0; 3], links: [0.0; 6], faces: Vec::new() };
            for axis in 0..3 {
                let sides = [voxel - strides[axis], voxel].map(|lower| at_line(&cuts[axis], lower));
                let mut extent = 0.0;
                for (upper, crossings) in sides.into_iter().enumerate() {
                    // The nearest one, as seen from this voxel.
                    let nearest = if upper == 1 { crossings.first() } else { crossings.last() };
                    let Some(cut) = nearest else {
                        extent += 0.5;
                        continue;
                    };
                    let surface = &self.mesh.surfaces.triangles[cut.triangle as usize];
                    let n = surface.normal.map(f64::abs);
                    let distance = if upper == 1 { cut.at } else { 1.0 - cut.at };
                    extent += if n[axis] >= FACING { distance } else { 0.5 };
                    let slant = slant(n, axis);
                    edge.faces.push(Face { axis: axis as u8, material: surface.material, slant });
                }
                edge.extent[axis] = extent.max(NARROWEST);
            }
            if !edge.faces.is_empty() {
                walled.push(edge);
            }
        }
        let extents: HashMap<u32, Vec3> = walled.iter().map(|edge| (edge.voxel, edge.extent)).collect();
        // Neighbours of narrower voxels are as little ordinary as these: what flows out here flows in there.
        let mut others: Vec<u32> = Vec::new();
        for edge in &walled {
            for (axis, stride) in strides.into_iter().enumerate() {
                for (next, cut) in [
                    (edge.voxel as usize + stride, self.marks[edge.voxel as usize] >> axis & 1),
                    (edge.voxel as usize - stride, self.marks[edge.voxel as usize - stride] >> axis & 1),
                ] {
                    let area = side_area(edge.extent, axis).min(1.0);
                    if cut == 0 && area < 1.0 - 1e-12 && !extents.contains_key(&(next as u32)) {
                        others.push(next as u32);
                    }
                }
            }
        }
        others.sort_unstable();
        others.dedup();
        walled.extend(others.into_iter().map(|voxel| Edge {
            voxel,
            extent: [1.0; 3],
            links: [0.0; 6],
            faces: Vec::new(),
        }));
        walled.sort_unstable_by_key(|edge| edge.voxel);
        let voxel_m3: f64 = self.axes.spacing_m.iter().product();
        let mut missing = 0.0;
        for edge in &mut walled {
            let volume: f64 = edge.extent.iter().product();
            missing += 1.0 - volume;
            for (axis, stride) in strides.into_iter().enumerate() {
                let voxel = edge.voxel as usize;
                for (side, next, cut) in [
                    (0, voxel - stride, self.marks[voxel - stride] >> axis & 1),
                    (1, voxel + stride, self.marks[voxel] >> axis & 1),
                ] {
                    if cut == 0 {
                        let there = extents.get(&(next as u32)).copied().unwrap_or([1.0; 3]);
                        // The smaller one: so that no voxel gets more than its time step can bear.
                        let area = side_area(edge.extent, axis).min(side_area(there, axis));
                        edge.links[2 * axis + side] = area / volume;
                    }
                }
            }
            for face in &edge.faces {
                let axis = face.axis as usize;
                let face_m2 = voxel_m3 / self.axes.spacing_m[axis] * side_area(edge.extent, axis);
                self.material_areas_m2[face.material as usize] += face_m2 * face.slant;
            }
        }
        self.volume_m3 = (self.inside as f64 - missing) * voxel_m3;
        self.edges = walled;
    }

    fn find_runs(&mut self) {
        let mut edges = self.edges.iter().map(|edge| edge.voxel as usize).peekable();
        let mut run: Option<(usize, usize)> = None;
        for voxel in 0..self.marks.len() {
            let is_edge = edges.next_if_eq(&voxel).is_some();
            if self.is_inside(voxel) && !is_edge {
                run = Some(run.map_or((voxel, 1), |(first, length)| (first, length + 1)));
            } else if let Some((first, length)) = run.take() {
                self.runs.push((first as u32, length as u32));
            }
        }
    }
}

/// Area of a surface over that of the faces across an axis which stand for it; `normal` without signs.
fn slant(normal: Vec3, axis: usize) -> f64 {
    match (0..3).find(|&a| normal[a] >= FACING) {
        // The steps between its faces count nothing.
        Some(facing) => {
            if facing == axis {
                1.0 / normal[facing]
            } else {
                0.0
            }
        }
        None => 1.0 / normal.iter().sum::<f64>(),
    }
}

/// Area of the sides across an axis, in voxels.
fn side_area(extent: Vec3, axis: usize) -> f64 {
    extent[(axis + 1) % 3] * extent[(axis + 2) % 3]
}

/// Crossings of the line from a voxel on.
fn at_line(cuts: &[Crossing], voxel: usize) -> &[Crossing] {
    let first = cuts.partition_point(|cut| (cut.voxel as usize) < voxel);
    let count = cuts[first..].iter().take_while(|cut| cut.voxel as usize == voxel).count();
    &cuts[first..first + count]
}
