//! How a bounding volume hierarchy is built: top down, by the surface area heuristic.

use crate::triangle_pack::TrianglePack;
use crate::vector::{Vec3, add};
use crate::wide_node::{Bounds, Child, WideNode};

/// Planes that may split a box are tried at so many equal steps along each axis.
const BINS: usize = 16;
/// Splits on the way to any pack: beyond what this leaves room for, boxes are halved by count, not by area. It bounds the
/// recursion, whatever the triangles.
pub(crate) const MAX_SPLITS: u32 = 60;

/// A triangle on its way into the hierarchy.
#[derive(Clone, Copy)]
struct Item {
    bounds: Bounds,
    /// Position in the list that was passed in.
    position: u32,
}

impl Item {
    /// Twice the middle of the box.
    fn centre(&self, axis: usize) -> f32 {
        self.bounds.low[axis] + self.bounds.high[axis]
    }
}

/// Items that go behind one child.
#[derive(Clone, Copy)]
struct Part {
    first: usize,
    end: usize,
    bounds: Bounds,
    splits: u32,
}

impl Part {
    fn len(&self) -> usize {
        self.end - self.first
    }
}

/// Indices of the triangles that are tested at once.
type Pack = [u32; TrianglePack::LANES];

/// Gathers nodes and packs, each child behind its parent.
pub(crate) struct Builder<'a> {
    triangles: &'a [(u32, [Vec3; 3])],
    items: Vec<Item>,
    nodes: Vec<WideNode>,
    /// Indices of the triangles in each; `u32::MAX` for a lane without one.
    packs: Vec<Pack>,
}

impl<'a> Builder<'a> {
    /// Takes triangles as index, first corner and the two edges from it; boxes are widened by `margin_m` on all sides.
    pub fn new(triangles: &'a [(u32, [Vec3; 3])], margin_m: f64) -> Self {
        let items = triangles.iter().zip(0..).map(|(&(_, [a, edge1, edge2]), position)| {
            let corners = [a, add(a, edge1), add(a, edge2)];
            let bound = |axis: usize, pick: fn(f64, f64) -> f64| {
                pick(pick(corners[0][axis], corners[1][axis]), corners[2][axis])
            };
            let low = std::array::from_fn(|axis| (bound(axis, f64::min) - margin_m) as f32);
            let high = std::array::from_fn(|axis| (bound(axis, f64::max) + margin_m) as f32);
            Item { bounds: Bounds { low, high }, position }
        });
        Self { triangles, items: items.collect(), nodes: Vec::new(), packs: Vec::new() }
    }

    /// Nodes, packs, and the number of nodes on the longest way down.
    pub fn build(mut self) -> (Vec<WideNode>, Vec<Pack>, usize) {
        let bounds = self.items.iter().fold(Bounds::EMPTY, |b, item| b.joined(item.bounds));
        let levels = self.node(Part { first: 0, end: self.items.len(), bounds, splits: 0 });
        (self.nodes, self.packs, levels)
    }

    /// Adds the node of a part with all that stands behind it, and returns how many nodes that is deep.
    fn node(&mut self, part: Part) -> usize {
        let mut parts = vec![part];
        while parts.len() < WideNode::WIDTH {
            // The largest box is the one that rays meet most often.
            let size = |i: usize| (parts[i].bounds.half_area(), parts[i].len());
            let largest =
                (0..parts.len()).filter(|&i| parts[i].len() > TrianglePack::LANES).max_by(|&i, &j| {
                    let ((area, count), (other_area, other_count)) = (size(i), size(j));
                    area.total_cmp(&other_area).then(count.cmp(&other_count))
                });
            let Some(largest) = largest else { break };
            let halves = self.split(parts[largest]);
            parts.splice(largest..=largest, halves);
        }
        let index = self.nodes.len();
        self.nodes.push(WideNode::new(&[]));
        let mut levels = 1;
        let children: Vec<(Bounds, Child)> = parts
            .into_iter()
            .map(|part| {
                if part.len() <= TrianglePack::LANES {
                    let items = &self.items[part.first..part.end];
                    let mut pack = [u32::MAX; TrianglePack::LANES];
                    for (lane, item) in pack.iter_mut().zip(items) {
                        *lane = self.triangles[item.position as usize].0;
                    }
                    self.packs.push(pack);
                    return (part.bounds, Child::Pack(self.packs.len() as u32 - 1));
                }
                let child = self.nodes.len() as u32;
                levels = levels.max(1 + self.node(part));
                (part.bounds, Child::Node(child))
            })
            .collect();
        self.nodes[index] = WideNode::new(&children);
        levels
    }

    fn split(&mut self, part: Part) -> [Part; 2] {
        let rounds_to_halve = part.len().ilog2() + 1;
        let plane = if part.splits + rounds_to_halve < MAX_SPLITS { self.best_plane(part) } else { None };
        let items = &mut self.items[part.first..part.end];
        let mut middle = 0;
        if let Some(plane) = plane {
            for i in 0..items.len() {
                if plane.bin(&items[i]) <= plane.last_below {
                    items.swap(i, middle);
                    middle += 1;
                }
            }
        }
        // No plane, or none that divides: as many to either side, in whole packs.
        if middle == 0 || middle == items.len() {
            middle = (items.len() / 2).next_multiple_of(TrianglePack::LANES);
        }
        let bounds_of =
            |items: &[Item]| items.iter().fold(Bounds::EMPTY, |bounds, item| bounds.joined(item.bounds));
        let (below, above) = (bounds_of(&items[..middle]), bounds_of(&items[middle..]));
        let (cut, splits) = (part.first + middle, part.splits + 1);
        [
            Part { first: part.first, end: cut, bounds: below, splits },
            Part { first: cut, end: part.end, bounds: above, splits },
        ]
    }

    /// The plane between bins that makes rays cheapest; `None` if all triangles have the same centre.
    fn best_plane(&self, part: Part) -> Option<Plane> {
        let items = &self.items[part.first..part.end];
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for item in items {
            for axis in 0..3 {
                let centre = item.centre(axis);
                low[axis] = if centre < low[axis] { centre } else { low[axis] };
                high[axis] = if centre > high[axis] { centre } else { high[axis] };
            }
        }
        let mut best: Option<(f32, Plane)> = None;
        for axis in (0..3).filter(|&axis| high[axis] > low[axis]) {
            let scale = BINS as f32 / (high[axis] - low[axis]);
            if !scale.is_finite() {
                continue;
            }
            let plane = Plane { axis, low: low[axis], scale, last_below: 0 };
            let mut bins = [(Bounds::EMPTY, 0usize); BINS];
            for item in items {
                let (bounds, count) = &mut bins[plane.bin(item)];
                *bounds = bounds.joined(item.bounds);
                *count += 1;
            }
            // Cost of what lies above each plane, then of what lies below.
            let mut above = [0.0f32; BINS];
            let (mut bounds, mut count) = (Bounds::EMPTY, 0);
            for i in (1..BINS).rev() {
                bounds = bounds.joined(bins[i].0);
                count += bins[i].1;
                above[i] = cost(&bounds, count);
            }
            (bounds, count) = (Bounds::EMPTY, 0);
            for i in 0..BINS - 1 {
                bounds = bounds.joined(bins[i].0);
                count += bins[i].1;
                let total = cost(&bounds, count) + above[i + 1];
                if count > 0 && count < items.len() && best.is_none_or(|(least, _)| total < least) {
                    best = Some((total, Plane { last_below: i, ..plane }));
                }
            }
        }
        best.map(|(_, plane)| plane)
    }
}

/// A plane across an axis, between two bins.
#[derive(Clone, Copy)]
struct Plane {
    axis: usize,
    /// Twice the least centre.
    low: f32,
    scale: f32,
    last_below: usize,
}

impl Plane {
    fn bin(&self, item: &Item) -> usize {
        (((item.centre(self.axis) - self.low) * self.scale) as usize).min(BINS - 1)
    }
}

/// Chance to be met times packs to be tested.
fn cost(bounds: &Bounds, count: usize) -> f32 {
    if count == 0 { 0.0 } else { bounds.half_area() * count.div_ceil(TrianglePack::LANES) as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{direction, generator};
    use crate::vector::scale;

    type Listed = (u32, [Vec3; 3]);

    /// Every triangle is in one pack, and no way down is longer than the stack of a ray allows.
    fn check(triangles: &[Listed]) -> (usize, usize) {
        let (nodes, packs, levels) = Builder::new(triangles, 1e-5).build();
        let mut found: Vec<u32> = packs.as_flattened().iter().copied().filter(|&i| i != u32::MAX).collect();
        found.sort_unstable();
        assert_eq!(found, triangles.iter().map(|t| t.0).collect::<Vec<_>>());
        assert!(levels <= MAX_SPLITS as usize + 1, "{levels} levels");
        assert!(nodes.len() <= packs.len() + 1);
        (packs.len(), levels)
    }

    #[test]
    fn packs_are_full_and_ways_short() {
        let mut random = generator(1, 1);
        let scattered: Vec<Listed> = (0..20_000)
            .map(|i| {
                let mut point = |size: f64| scale(direction(&mut random), size);
                (i, [point(5.0), point(0.1), point(0.1)])
            })
            .collect();
        let (packs, levels) = check(&scattered);
        assert!(packs < 7_500, "{packs}"); // 5,000 if all were full
        assert!(levels <= 10, "{levels}");
    }

    #[test]
    fn triangles_that_no_plane_divides_are_halved() {
        let (packs, levels) = check(&vec_of(10_000, |_| ([1.0; 3], 1.0)));
        assert_eq!((packs, levels), (2_500, 4)); // 8^4 packs hold 16,384
    }

    /// Sizes and places in geometric progression: a plane cuts off a few at a time.
    #[test]
    fn unbalanced_trees_stay_shallow_enough() {
        for ratio in [0.5f64, 0.9, 0.99] {
            check(&vec_of(5_000, |i| {
                let size = ratio.powi(i).max(1e-30);
                ([size, 0.0, 0.0], size)
            }));
        }
    }

    fn vec_of(count: u32, place: impl Fn(i32) -> (Vec3, f64)) -> Vec<Listed> {
        (0..count)
            .map(|i| {
                let (corner, size) = place(i as i32);
                (i, [corner, [0.0, size, 0.0], [0.0, 0.0, size]])
            })
            .collect()
    }
}
