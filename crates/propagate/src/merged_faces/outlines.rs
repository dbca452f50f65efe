//! Where flat patches end.

use super::flat_patches::FlatPatches;
use super::half_edges::HalfEdges;
use crate::vector::{Vec3, dot, norm, scale, sub};

/// No vertex.
const NONE: u32 = u32::MAX;
/// Where an outline is not shared by exactly two patches, a vertex must lie in line with its neighbours to this share of the
/// size of the scene to be left out: a few times the rounding of double precision. What lies beside such an outline may
/// have a vertex at this place, and a gap must not open.
const STRAIGHT: f64 = 1e-12;

/// The edges at which patches end. A vertex that only two of these meet in, in a straight line, is left out by all patches that have it.
pub(super) struct Outlines<'a> {
    edges: &'a HalfEdges,
    patches: &'a FlatPatches,
    /// Whether outlines keep a vertex.
    kept: Vec<bool>,
    /// The ends of the two edges at each vertex that has two.
    links: Vec<[u32; 2]>,
}

/// Directed segments around a patch, which lies to their left.
pub(super) struct Outline {
    pub segments: Vec<[u32; 2]>,
    /// Length of all of it.
    pub length_m: f64,
}

impl<'a> Outlines<'a> {
    /// Draws the outlines of all patches. Frozen ones keep all their vertices.
    pub fn draw(
        edges: &'a HalfEdges,
        patches: &'a FlatPatches,
        frozen: &[bool],
        size_m: f64,
        flat_m: f64,
    ) -> Self {
        let count = edges.points.len();
        let mut links = vec![[NONE; 2]; count];
        let mut kept = vec![false; count];
        let mut tolerance_m = vec![flat_m; count];
        let borders: Vec<u32> = (0..edges.len() as u32).filter(|&h| patches.is_border(h)).collect();
        for &half_edge in &borders {
            let [from, to] = edges.ends(half_edge);
            let shared = edges.between([from, to]).count() == 1 && edges.between([to, from]).count() == 1;
            for (here, there) in [(from, to), (to, from)] {
                // The third edge at a vertex makes it a corner.
                match links[here as usize] {
                    [a, b] if a == there || b == there => {}
                    [NONE, _] => links[here as usize][0] = there,
                    [_, NONE] => links[here as usize][1] = there,
                    _ => kept[here as usize] = true,
                }
                if !shared {
                    tolerance_m[here as usize] = STRAIGHT * size_m;
                }
            }
        }
        for (vertex, [_, second]) in links.iter().enumerate() {
            // An edge that ends here.
            kept[vertex] |= *second == NONE && links[vertex][0] != NONE;
        }
        for (patch, _) in frozen.iter().enumerate().filter(|(_, frozen)| **frozen) {
            for &t in patches.members(patch) {
                for &vertex in &edges.corners[t as usize] {
                    kept[vertex as usize] = true;
                }
            }
        }
        let mut outlines = Self { edges, patches, kept, links };
        outlines.straighten(&borders, &tolerance_m);
        outlines
    }

    /// Whether outlines keep a vertex. Vertices inside a patch are on none.
    pub fn keeps(&self, vertex: u32) -> bool {
        self.kept[vertex as usize]
    }

    /// Follows each line of vertices from corner to corner, and keeps those in between that it needs.
    fn straighten(&mut self, borders: &[u32], tolerance_m: &[f64]) {
        let corner = self.kept.clone();
        let mut seen = vec![false; corner.len()];
        let mut line = Vec::new();
        for &half_edge in borders {
            let [from, to] = self.edges.ends(half_edge);
            for (start, mut at) in [(from, to), (to, from)] {
                if !corner[start as usize] || seen[at as usize] {
                    continue;
                }
                line.clear();
                line.push(start);
                while !corner[at as usize] {
                    seen[at as usize] = true;
                    let next = self.beyond(at, line[line.len() - 1]);
                    line.push(at);
                    at = next;
                }
                line.push(at);
                self.keep_bends(&line, tolerance_m);
            }
        }
        // Rings without a corner: the two points of one that are farthest apart, roughly, are corners.
        for vertex in 0..corner.len() as u32 {
            if corner[vertex as usize] || seen[vertex as usize] || self.links[vertex as usize][0] == NONE {
                continue;
            }
            line.clear();
            let (mut before, mut at) = (self.links[vertex as usize][0], vertex);
            while !seen[at as usize] {
                seen[at as usize] = true;
                line.push(at);
                (before, at) = (at, self.beyond(at, before));
            }
            let first = self.farthest(&line, line[0]);
            line.rotate_left(first);
            let second = self.farthest(&line, line[0]);
            self.kept[line[0] as usize] = true;
            self.kept[line[second] as usize] = true;
            self.keep_bends(&line[..=second], tolerance_m);
            line.push(line[0]);
            self.keep_bends(&line[second..], tolerance_m);
        }
    }

    fn farthest(&self, line: &[u32], from: u32) -> usize {
        let distance = |&v: &u32| norm(sub(self.point(v), self.point(from)));
        let far = |best: (usize, f64), (i, d)| if d > best.1 { (i, d) } else { best };
        line.iter().map(distance).enumerate().fold((0, 0.0), far).0
    }

    /// Keeps the vertices without which a line would be off by more than they allow (Douglas and Peucker 1973).
    fn keep_bends(&mut self, line: &[u32], tolerance_m: &[f64]) {
        let mut waiting = vec![(0, line.len() - 1)];
        while let Some((start, end)) = waiting.pop() {
            let [a, b] = [start, end].map(|i| self.point(line[i]));
            let mut worst = (1.0, start);
            for (i, &vertex) in line.iter().enumerate().take(end).skip(start + 1) {
                let off = distance_m(self.point(vertex), a, b) / tolerance_m[vertex as usize];
                if off > worst.0 {
                    worst = (off, i);
                }
            }
            if worst.1 != start {
                self.kept[line[worst.1] as usize] = true;
                waiting.extend([(start, worst.1), (worst.1, end)]);
            }
        }
    }

    /// The end of the other edge at a vertex that has two.
    fn beyond(&self, vertex: u32, before: u32) -> u32 {
        let [a, b] = self.links[vertex as usize];
        if a == before { b } else { a }
    }

    fn point(&self, vertex: u32) -> Vec3 {
        self.edges.points[vertex as usize]
    }

    /// The outline of a patch; `None` if it is none: it runs twice along the same way, or shrinks to a line.
    pub fn of(&self, patch: usize) -> Option<Outline> {
        let own = self.patches.members(patch).iter().flat_map(|&t| 3 * t..3 * t + 3);
        let borders: Vec<[u32; 2]> =
            own.filter(|&h| self.patches.is_border(h)).map(|h| self.edges.ends(h)).collect();
        let length_m = borders.iter().map(|&[a, b]| norm(sub(self.point(a), self.point(b)))).sum();
        let (mut segments, mut passed) = (Vec::new(), 0);
        for &[start, end] in borders.iter().filter(|[start, _]| self.keeps(*start)) {
            let (mut before, mut at) = (start, end);
            passed += 1;
            while !self.keeps(at) {
                (before, at) = (at, self.beyond(at, before));
                passed += 1;
            }
            if at == start {
                return None;
            }
            segments.push([start, at]);
        }
        // A slit: the patch lies on both sides, and nothing ends there.
        segments.sort_unstable();
        let has = |segment: [u32; 2]| segments.binary_search(&segment).is_ok();
        let twice = segments.windows(2).any(|pair| pair[0] == pair[1]);
        let segments: Vec<[u32; 2]> = segments.iter().copied().filter(|&[a, b]| !has([b, a])).collect();
        (passed == borders.len() && !twice && segments.len() > 2).then_some(Outline { segments, length_m })
    }
}

/// Distance from a point to a segment.
fn distance_m(point: Vec3, a: Vec3, b: Vec3) -> f64 {
    let (line, to) = (sub(b, a), sub(point, a));
    let length2 = dot(line, line);
    let t = if length2 > 0.0 { (dot(to, line) / length2).clamp(0.0, 1.0) } else { 0.0 };
    norm(sub(to, scale(line, t)))
}
