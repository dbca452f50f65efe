//! Where the straight line from a receiver to an image of the source meets walls: the path that it stands for, unfolded.

use super::truth::Truth;

/// One meeting of a path with a wall, counted from the receiver.
pub(crate) struct Meeting {
    /// Share of the path's length between the receiver and here.
    pub share: f64,
    /// Face of the box: x = 0, x = length, y = 0 ...
    pub face: usize,
    /// Where, in metres.
    pub place_m: [f64; 3],
}

/// A coordinate beyond the walls, folded back between them.
fn folded(coordinate: f64, side: f64) -> f64 {
    // Not `rem_euclid`: its exact remainder takes many times as long.
    let within = coordinate - 2.0 * side * (coordinate / (2.0 * side)).floor();
    if within > side { 2.0 * side - within } else { within }
}

/// Point of the line at a share of its length, folded into the box.
pub(crate) fn point(truth: &Truth, receiver: [f64; 3], offset: [f64; 3], share: f64) -> [f64; 3] {
    std::array::from_fn(|k| folded(receiver[k] + share * offset[k], truth.size_m[k]))
}

/// All meetings with walls, the nearest to the receiver first.
pub(crate) fn meetings(truth: &Truth, receiver: [f64; 3], offset: [f64; 3]) -> Vec<Meeting> {
    let mut found = Vec::new();
    for axis in 0..3 {
        let side = truth.size_m[axis];
        let (from, to) = (receiver[axis] / side, (receiver[axis] + offset[axis]) / side);
        let (low, high) = if from < to { (from, to) } else { (to, from) };
        for wall in low.ceil() as i64..=high.floor() as i64 {
            let share = (wall as f64 - from) / (to - from);
            // Every second copy of a wall is the far one.
            let face = 2 * axis + wall.rem_euclid(2) as usize;
            found.push(Meeting { share, face, place_m: point(truth, receiver, offset, share) });
        }
    }
    found.sort_by(|a, b| a.share.total_cmp(&b.share));
    found
}

/// Energy that the walls leave to an image, from the logarithms of what each face mirrors.
pub(crate) fn wall_energy(log_mirrored: &[f64; 6], index: [i64; 3]) -> f64 {
    let one = |axis: usize| {
        let [low, high] = times_met(index[axis]);
        low * log_mirrored[2 * axis] + high * log_mirrored[2 * axis + 1]
    };
    (0..3).map(one).sum::<f64>().exp()
}

/// How often an image along one axis has met the lower wall and the upper one.
pub(crate) fn times_met(index: i64) -> [f64; 2] {
    // Beyond the upper wall an odd image has met that wall once more, and beyond the lower wall the lower.
    let (more, fewer) = (index.unsigned_abs().div_ceil(2) as f64, (index.unsigned_abs() / 2) as f64);
    if index > 0 { [fewer, more] } else { [more, fewer] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabConfig, Laboratory};

    #[test]
    fn a_path_meets_as_many_walls_as_its_image_has_order_and_reflects_like_a_mirror() {
        let Ok(lab) = Laboratory::new(LabConfig { seed: 4, receivers: 1, ..LabConfig::default() }) else {
            panic!("no room")
        };
        let truth = lab.null();
        let (source, receiver) = (truth.sources[0].position_m, truth.receivers_m[0]);
        for index in [[1i64, 0, 0], [-1, 2, 0], [3, -2, 1]] {
            let offset = std::array::from_fn(|k| {
                let own = if index[k] % 2 == 0 { source[k] } else { truth.size_m[k] - source[k] };
                index[k] as f64 * truth.size_m[k] + own - receiver[k]
            });
            let all = meetings(truth, receiver, offset);
            assert_eq!(all.len() as i64, index.iter().map(|i| i.abs()).sum::<i64>());
            // Legs between meetings add up to the image's distance, and the last one ends at the source.
            let mut stops = vec![receiver];
            stops.extend(all.iter().map(|m| m.place_m));
            stops.push(source);
            let legs: f64 = stops
                .windows(2)
                .map(|p| (0..3).map(|k| (p[1][k] - p[0][k]).powi(2)).sum::<f64>().sqrt())
                .sum();
            let straight = offset.iter().map(|c: &f64| c * c).sum::<f64>().sqrt();
            assert!((legs - straight).abs() < 1e-9, "{legs} {straight}");
            for m in &all {
                let wall = if m.face % 2 == 0 { 0.0 } else { truth.size_m[m.face / 2] };
                assert!((m.place_m[m.face / 2] - wall).abs() < 1e-9);
            }
        }
    }
}
