//! A flat panel in the room that the mesh does not have.
//!
//! It reflects a share of the energy that meets it on either side and lets the rest through. Followed are paths with one
//! reflection at the panel and up to two at walls; and the images of up to two walls (and the direct sound) lose what the panel takes where they cross it.
//! Later images stay as they are: what the panel takes from them it sends elsewhere in the room, the mean being the same.

use super::columns::Columns;
use super::hidden::Hidden;
use super::stream::{Purpose, key, mix};
use super::truth::{Medium, Truth};
use super::unfolded::{meetings, point, wall_energy};
use sabine_acoustics::{Error, OutOfRange};

/// Walls on the way to the panel and from it, at most.
const MOST_WALLS: i64 = 2;

/// A rectangle and what it reflects.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    centre_m: [f64; 3],
    /// Unit normal, and unit vectors along the sides.
    axes: [[f64; 3]; 3],
    half_m: [f64; 2],
    /// Share of energy reflected, by band.
    reflectance: Vec<f64>,
}

impl Panel {
    /// All panels that are hidden in a room.
    pub(crate) fn all(truth: &Truth) -> Vec<Self> {
        truth
            .effects
            .iter()
            .filter_map(|effect| match effect {
                Hidden::ExtraReflector { centre_m, normal, size_m, reflectance } => {
                    Some(Self::new(*centre_m, *normal, *size_m, reflectance.clone()))
                }
                _ => None,
            })
            .collect()
    }

    pub(crate) fn new(centre_m: [f64; 3], normal: [f64; 3], size_m: [f64; 2], reflectance: Vec<f64>) -> Self {
        // One side is level, unless the whole panel is.
        let level = normal[0].hypot(normal[1]);
        let first = if level > 1e-6 { [-normal[1] / level, normal[0] / level, 0.0] } else { [1.0, 0.0, 0.0] };
        let second = [
            normal[1] * first[2] - normal[2] * first[1],
            normal[2] * first[0] - normal[0] * first[2],
            normal[0] * first[1] - normal[1] * first[0],
        ];
        Self { centre_m, axes: [normal, first, second], half_m: size_m.map(|s| 0.5 * s), reflectance }
    }

    /// Coordinates about the centre, along the normal and the sides.
    fn local(&self, place: [f64; 3]) -> [f64; 3] {
        self.axes.map(|axis| (0..3).map(|k| axis[k] * (place[k] - self.centre_m[k])).sum())
    }

    fn holds(&self, local: [f64; 3]) -> bool {
        local[1].abs() <= self.half_m[0] && local[2].abs() <= self.half_m[1]
    }

    /// Whether the straight way between two places crosses the panel.
    pub(crate) fn crosses(&self, from: [f64; 3], to: [f64; 3]) -> bool {
        let (a, b) = (self.local(from), self.local(to));
        if a[0] * b[0] >= 0.0 {
            return false;
        }
        let share = a[0] / (a[0] - b[0]);
        self.holds(std::array::from_fn(|k| a[k] + share * (b[k] - a[k])))
    }

    /// Where the panel reflects from one place to another; none if it does not.
    pub(crate) fn mirror_point(&self, from: [f64; 3], to: [f64; 3]) -> Option<[f64; 3]> {
        let (a, b) = (self.local(from), self.local(to));
        if a[0] * b[0] <= 0.0 {
            return None;
        }
        let share = a[0] / (a[0] + b[0]);
        let local: [f64; 3] =
            std::array::from_fn(|k| if k == 0 { 0.0 } else { a[k] + share * (b[k] - a[k]) });
        self.holds(local).then(|| {
            std::array::from_fn(|k| {
                self.centre_m[k] + local[1] * self.axes[1][k] + local[2] * self.axes[2][k]
            })
        })
    }

    /// The corners, for a check that they lie in the room.
    pub(crate) fn corners(&self) -> [[f64; 3]; 4] {
        [[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]].map(|[a, b]| {
            std::array::from_fn(|k| {
                self.centre_m[k] + a * self.half_m[0] * self.axes[1][k] + b * self.half_m[1] * self.axes[2][k]
            })
        })
    }
}

/// Refuses a panel that is none.
pub(crate) fn check(truth: &Truth, panel: &Panel) -> Result<(), Error> {
    let square: f64 = panel.axes[0].iter().map(|c| c * c).sum();
    OutOfRange::check("squared length of the normal", square, 0.999_999, 1.000_001, "1")?;
    for half in panel.half_m {
        OutOfRange::check("side of the panel (m)", 2.0 * half, 0.0, 20.0, "between 0 and 20 m")?;
    }
    for corner in panel.corners() {
        for (c, side) in corner.into_iter().zip(truth.size_m) {
            OutOfRange::check("corner of the panel (m)", c, 0.0, side, "within the room")?;
        }
    }
    Ok(())
}

/// Takes from the amplitudes of an image what panels in its way take. `offset` leads from the receiver to the image.
pub(crate) fn shade(
    truth: &Truth,
    panels: &[Panel],
    receiver: [f64; 3],
    offset: [f64; 3],
    amplitudes: &mut [f64],
) {
    let mut stops = vec![receiver];
    stops.extend(meetings(truth, receiver, offset).into_iter().map(|m| m.place_m));
    stops.push(point(truth, receiver, offset, 1.0));
    for panel in panels {
        for _ in stops.windows(2).filter(|leg| panel.crosses(leg[0], leg[1])) {
            amplitudes.iter_mut().zip(&panel.reflectance).for_each(|(a, r)| *a *= (1.0 - r).sqrt());
        }
    }
}

/// Whether the panels are asked about an image of this order.
pub(crate) fn concerns(index: [i64; 3]) -> bool {
    index.iter().map(|i| i.abs()).sum::<i64>() <= MOST_WALLS
}

/// An image of a place in the walls.
struct Mirrored {
    index: [i64; 3],
    place_m: [f64; 3],
}

fn mirrored(truth: &Truth, place: [f64; 3]) -> Vec<Mirrored> {
    let all = -MOST_WALLS..=MOST_WALLS;
    let triples = all
        .clone()
        .flat_map(|x| all.clone().flat_map(move |y| (-MOST_WALLS..=MOST_WALLS).map(move |z| [x, y, z])));
    triples
        .filter(|index| concerns(*index))
        .map(|index| {
            let place_m = std::array::from_fn(|k| {
                let own = if index[k] % 2 == 0 { place[k] } else { truth.size_m[k] - place[k] };
                index[k] as f64 * truth.size_m[k] + own
            });
            Mirrored { index, place_m }
        })
        .collect()
}

/// Adds what the panels reflect between a source and a receiver, with random signs as all reflections have.
pub(crate) fn add_reflections(
    truth: &Truth,
    medium: &Medium,
    panels: &[Panel],
    pair: (usize, usize),
    columns: &mut Columns,
) {
    let (source, receiver) = (&truth.sources[pair.0], truth.receivers_m[pair.1]);
    let (microphone, bands) = (&truth.microphones[pair.1], truth.bands_hz.len());
    let mut seed = key(truth.seed, Purpose::Panel, pair.0 * truth.receivers_m.len() + pair.1);
    let walls = truth.log_mirrored();
    for panel in panels {
        for from in mirrored(truth, source.position_m) {
            for to in mirrored(truth, receiver) {
                seed = mix(seed);
                let order = from.index.iter().chain(&to.index).map(|i| i.abs()).sum::<i64>();
                let Some(at) = panel.mirror_point(from.place_m, to.place_m).filter(|_| order <= MOST_WALLS)
                else {
                    continue;
                };
                let legs = [from.place_m, to.place_m]
                    .map(|p| (0..3).map(|k| (p[k] - at[k]).powi(2)).sum::<f64>().sqrt());
                let length_m = legs[0] + legs[1];
                // Seen from the source itself, an odd image's axis is turned.
                let cosine: f64 = (0..3)
                    .map(|k| {
                        let turned = if from.index[k] % 2 == 0 { 1.0 } else { -1.0 };
                        turned * (at[k] - from.place_m[k]) / legs[0] * source.axis[k]
                    })
                    .sum();
                // So is where it comes from, at an odd image of the receiver.
                let heard: f64 = (0..3)
                    .map(|k| {
                        let turned = if to.index[k] % 2 == 0 { 1.0 } else { -1.0 };
                        turned * (at[k] - to.place_m[k]) / legs[1] * microphone.axis[k]
                    })
                    .sum();
                let sign = if seed & 1 == 0 { 1.0 } else { -1.0 };
                let amplitudes: Vec<f64> = (0..bands)
                    .map(|b| {
                        let left = wall_energy(&walls[b], from.index) * wall_energy(&walls[b], to.index);
                        let energy = left
                            * panel.reflectance[b]
                            * (-medium.exponents_per_m[b] * length_m).exp()
                            * 10f64.powf(truth.source_gains_db[b] / 10.0);
                        let gain = source.gain(b, cosine) * microphone.gain(b, heard);
                        sign * energy.sqrt() * gain / length_m
                    })
                    .collect();
                columns.add_exactly(length_m / medium.speed_m_s, &amplitudes);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_mirrors_where_angles_are_equal_and_is_crossed_where_it_stands() {
        let panel = Panel::new([2.0, 2.0, 1.0], [1.0, 0.0, 0.0], [2.0, 1.0], vec![1.0]);
        let Some(at) = panel.mirror_point([0.0, 1.5, 1.0], [1.0, 2.4, 1.0]) else { panic!("no reflection") };
        // Distances to the plane are 2 and 1: two thirds of the way.
        assert!((at[0] - 2.0).abs() < 1e-12 && (at[1] - 2.1).abs() < 1e-12 && (at[2] - 1.0).abs() < 1e-12);
        assert!(panel.mirror_point([0.0, 1.5, 1.0], [3.0, 2.4, 1.0]).is_none());
        assert!(panel.mirror_point([0.0, 4.5, 1.0], [1.0, 4.4, 1.0]).is_none());
        assert!(panel.crosses([0.0, 1.5, 1.0], [3.0, 2.4, 1.0]));
        assert!(!panel.crosses([0.0, 1.5, 1.0], [3.0, 2.4, 4.0]));
    }
}
