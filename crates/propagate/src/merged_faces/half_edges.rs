//! Which triangles meet in an edge.

use crate::surfaces::Surface;
use crate::vector::Vec3;
use sabine_scene::Scene;
use std::collections::HashMap;

/// The triangles that have an area, by vertices and directed edges. Vertices at one place are one, to the bit.
///
/// Half-edge 3 t + k leads from corner k of triangle t to the next one.
pub(super) struct HalfEdges {
    pub points: Vec<Vec3>,
    /// Vertices of each triangle.
    pub corners: Vec<[u32; 3]>,
    /// Index of each triangle in the scene.
    pub triangles: Vec<u32>,
    /// Where the half-edges from each vertex begin in `outgoing`, and where the last ones end.
    first: Vec<u32>,
    /// End and number of half-edges, sorted for each vertex.
    outgoing: Vec<(u32, u32)>,
}

impl HalfEdges {
    pub fn new(scene: &Scene, surfaces: &[Surface]) -> Self {
        let mut points: Vec<Vec3> = Vec::new();
        let mut at: HashMap<[u64; 3], u32> = HashMap::with_capacity(scene.vertices().len());
        let place: Vec<u32> = scene
            .vertices()
            .iter()
            .map(|&point| {
                // Adding zero makes one of the two zeros.
                *at.entry(point.map(|c| (c + 0.0).to_bits())).or_insert_with(|| {
                    points.push(point);
                    points.len() as u32 - 1
                })
            })
            .collect();
        let triangles: Vec<u32> =
            (0..surfaces.len() as u32).filter(|&i| !surfaces[i as usize].is_degenerate()).collect();
        let corners: Vec<[u32; 3]> = triangles
            .iter()
            .map(|&i| scene.triangles()[i as usize].vertices.map(|v| place[v as usize]))
            .collect();
        let mut first = vec![0u32; points.len() + 1];
        for &vertex in corners.as_flattened() {
            first[vertex as usize + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut next = first.clone();
        let mut outgoing = vec![(0, 0); 3 * corners.len()];
        for half_edge in 0..outgoing.len() as u32 {
            let [from, to] = ends(&corners, half_edge);
            outgoing[next[from as usize] as usize] = (to, half_edge);
            next[from as usize] += 1;
        }
        for range in first.windows(2) {
            outgoing[range[0] as usize..range[1] as usize].sort_unstable();
        }
        Self { points, corners, triangles, first, outgoing }
    }

    /// Number of half-edges.
    pub fn len(&self) -> usize {
        self.outgoing.len()
    }

    /// Vertices at the beginning and the end of a half-edge.
    pub fn ends(&self, half_edge: u32) -> [u32; 2] {
        ends(&self.corners, half_edge)
    }

    /// All half-edges from one vertex to another.
    pub fn between(&self, [from, to]: [u32; 2]) -> impl Iterator<Item = u32> {
        let [start, end] = [0, 1].map(|k| self.first[from as usize + k] as usize);
        let all = &self.outgoing[start..end];
        all[all.partition_point(|&(end, _)| end < to)..]
            .iter()
            .take_while(move |&&(end, _)| end == to)
            .map(|&(_, half_edge)| half_edge)
    }
}

fn ends(corners: &[[u32; 3]], half_edge: u32) -> [u32; 2] {
    let (triangle, k) = (&corners[half_edge as usize / 3], half_edge as usize % 3);
    [triangle[k], triangle[(k + 1) % 3]]
}
