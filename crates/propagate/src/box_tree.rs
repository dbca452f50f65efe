//! Which boxes overlap a box: the tree behind the search for edges that lie on other faces.

use crate::vector::Vec3;

/// Boxes in a leaf.
const LEAF: usize = 8;

/// An axis-parallel box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    /// Around points, wider by a margin on all sides.
    pub fn around(points: &[Vec3], margin: f64) -> Self {
        let of = |start: f64, pick: fn(f64, f64) -> f64| -> Vec3 {
            std::array::from_fn(|k| points.iter().map(|p| p[k]).fold(start, pick))
        };
        let (low, high) = (of(f64::INFINITY, f64::min), of(f64::NEG_INFINITY, f64::max));
        Self { low: low.map(|c| c - margin), high: high.map(|c| c + margin) }
    }

    fn join(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }

    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }
}

/// A tree over boxes, halved at the median of their centres along the longest axis.
pub(crate) struct BoxTree {
    boxes: Vec<Bounds>,
    /// Indices of the boxes, leaf by leaf.
    order: Vec<u32>,
    nodes: Vec<Node>,
}

struct Node {
    bounds: Bounds,
    /// Range in `order`.
    start: usize,
    end: usize,
    /// The second child; the first follows its parent. Leaves have none.
    second: Option<usize>,
}

impl BoxTree {
    pub fn new(boxes: Vec<Bounds>) -> Self {
        let order = (0..boxes.len() as u32).collect();
        let mut tree = Self { boxes, order, nodes: Vec::new() };
        if !tree.boxes.is_empty() {
            tree.split(0, tree.boxes.len());
        }
        tree
    }

    /// Adds the node for a range and all nodes below it; halving keeps the recursion as deep as the logarithm.
    fn split(&mut self, start: usize, end: usize) {
        let boxes = &self.boxes;
        let part = &mut self.order[start..end];
        let mut bounds = boxes[part[0] as usize];
        for &i in part.iter() {
            bounds = bounds.join(&boxes[i as usize]);
        }
        let node = self.nodes.len();
        self.nodes.push(Node { bounds, start, end, second: None });
        if end - start <= LEAF {
            return;
        }
        let side = |k: usize| bounds.high[k] - bounds.low[k];
        let axis = (1..3).fold(0, |best, k| if side(k) > side(best) { k } else { best });
        let centre = |i: u32| boxes[i as usize].low[axis] + boxes[i as usize].high[axis];
        let middle = (end - start) / 2;
        part.select_nth_unstable_by(middle, |&i, &j| centre(i).total_cmp(&centre(j)));
        self.split(start, start + middle);
        self.nodes[node].second = Some(self.nodes.len());
        self.split(start + middle, end);
    }

    /// Calls `found` with the index of each box that overlaps the given one.
    pub fn overlapping(&self, bounds: &Bounds, mut found: impl FnMut(usize)) {
        let mut waiting = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(index) = waiting.pop() {
            let node = &self.nodes[index];
            if !node.bounds.overlaps(bounds) {
                continue;
            }
            match node.second {
                Some(second) => waiting.extend([second, index + 1]),
                None => {
                    for &i in &self.order[node.start..node.end] {
                        if self.boxes[i as usize].overlaps(bounds) {
                            found(i as usize);
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_tree_finds_what_plain_search_finds(
            places in prop::collection::vec((prop::array::uniform3(-5.0f64..5.0), prop::array::uniform3(-1.0f64..1.0)), 0..120),
            at in prop::array::uniform3(-6.0f64..6.0),
        ) {
            let end = |p: &Vec3, d: &Vec3| -> Vec3 { std::array::from_fn(|k| p[k] + d[k]) };
            let boxes: Vec<Bounds> =
                places.iter().map(|(p, d)| Bounds::around(&[*p, end(p, d)], 0.01)).collect();
            let asked = Bounds::around(&[at], 1.0);
            let expected: Vec<usize> = (0..boxes.len()).filter(|&i| boxes[i].overlaps(&asked)).collect();
            let mut found = Vec::new();
            BoxTree::new(boxes).overlapping(&asked, |i| found.push(i));
            found.sort_unstable();
            prop_assert_eq!(found, expected);
        }
    }
}
