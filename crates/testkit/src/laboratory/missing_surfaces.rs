//! Typical surfaces that a mesh lacks: panels and holes that some of the measured paths meet.

use super::hidden::Hidden;
use super::panel::{self, Panel};
use super::patch::Patch;
use super::truth::Truth;
use super::unfolded::meetings;
use rand::Rng;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Places that are drawn; the one counts that most paths meet.
const TRIES: usize = 300;
/// Distance of a panel's corners from walls, in metres.
const FROM_WALLS_M: f64 = 0.2;
/// A panel this near to a source or receiver would be seen, in metres.
const FROM_PLACES_M: f64 = 0.4;

/// A panel of 1.2 to 2.4 m by 1 to 2 m, upright or leaning a little, in the way of no direct sound and seen by as many
/// pairs as can be. Its reflectance is 0.85 for strength 1 and proportionate in amplitude.
pub(super) fn extra_reflector(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let level = (0.85 * strength * strength).min(1.0);
    let tilt = 0.03 * (2.0 * unit(r) - 1.0);
    let middle = 0.5 * (truth.bands_hz.len() as f64 - 1.0);
    let reflectance: Vec<f64> = (0..truth.bands_hz.len())
        .map(|b| (level * (1.0 + tilt * (b as f64 - middle))).clamp(0.0, 1.0))
        .collect();
    let mut best: Option<(i64, Hidden)> = None;
    for _ in 0..TRIES {
        let azimuth = std::f64::consts::TAU * unit(r);
        let lean = 0.15 * r.sample::<f64, _>(StandardNormal);
        let normal = [azimuth.cos() * lean.cos(), azimuth.sin() * lean.cos(), lean.sin()];
        let size_m = [1.2 + 1.2 * unit(r), 1.0 + unit(r)];
        let centre_m: [f64; 3] = std::array::from_fn(|k| truth.size_m[k] * (0.1 + 0.8 * unit(r)));
        let square = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
        let normal = normal.map(|c| c / square);
        let panel = Panel::new(centre_m, normal, size_m, reflectance.clone());
        let inside = panel.corners().iter().all(|corner| {
            corner.iter().zip(truth.size_m).all(|(c, side)| (FROM_WALLS_M..=side - FROM_WALLS_M).contains(c))
        });
        if !inside || panel::check(truth, &panel).is_err() {
            continue;
        }
        let near = |place: &[f64; 3]| {
            let far: f64 = (0..3).map(|k| normal[k] * (place[k] - centre_m[k])).sum();
            far.abs() < FROM_PLACES_M
        };
        let mut worth = 0;
        for source in &truth.sources {
            for receiver in &truth.receivers_m {
                let seen = panel.mirror_point(source.position_m, *receiver).is_some();
                let hidden = panel.crosses(source.position_m, *receiver);
                worth +=
                    i64::from(seen && !near(receiver) && !near(&source.position_m)) - 4 * i64::from(hidden);
            }
        }
        if best.as_ref().is_none_or(|b| worth > b.0) {
            let effect =
                Hidden::ExtraReflector { centre_m, normal, size_m, reflectance: reflectance.clone() };
            best = Some((worth, effect));
        }
    }
    // A room so small that no panel fits has one of no size.
    best.map_or(
        Hidden::ExtraReflector {
            centre_m: truth.size_m.map(|l| 0.5 * l),
            normal: [1.0, 0.0, 0.0],
            size_m: [0.0; 2],
            reflectance,
        },
        |b| b.1,
    )
}

/// A hole of 3 m2 at strength 1 (its sides in proportion) where first reflections of as many pairs as can be meet the wall.
pub(super) fn open_patch(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let mut best: Option<(usize, Hidden)> = None;
    for _ in 0..TRIES {
        let face = r.random_range(0..6);
        let aspect = 0.7 + 0.7 * unit(r);
        let side = strength * 3f64.sqrt();
        let own: Vec<usize> = (0..3).filter(|&k| k != face / 2).collect();
        let size_m = [
            (side * aspect).min(truth.size_m[own[0]] - 0.2),
            (side / aspect).min(truth.size_m[own[1]] - 0.2),
        ];
        let mut centre_m = [0.0; 3];
        centre_m[face / 2] = if face % 2 == 0 { 0.0 } else { truth.size_m[face / 2] };
        for (&k, s) in own.iter().zip(size_m) {
            centre_m[k] = 0.5 * s + (truth.size_m[k] - s) * unit(r);
        }
        let patch = Patch::new(face, centre_m, size_m);
        let met = first_reflections(truth, face).filter(|place| patch.holds(*place)).count();
        if best.as_ref().is_none_or(|b| met > b.0) {
            best = Some((met, Hidden::OpenPatch { face, centre_m, size_m }));
        }
    }
    let none = Hidden::OpenPatch { face: 0, centre_m: [0.0, 1.0, 1.0], size_m: [0.0; 2] };
    best.map_or(none, |b| b.1)
}

/// Where the first reflections of all pairs meet a face.
fn first_reflections(truth: &Truth, face: usize) -> impl Iterator<Item = [f64; 3]> + '_ {
    let axis = face / 2;
    truth.sources.iter().flat_map(move |source| {
        truth.receivers_m.iter().filter_map(move |receiver| {
            let image = if face.is_multiple_of(2) {
                -source.position_m[axis]
            } else {
                2.0 * truth.size_m[axis] - source.position_m[axis]
            };
            let offset =
                std::array::from_fn(|k| (if k == axis { image } else { source.position_m[k] }) - receiver[k]);
            meetings(truth, *receiver, offset).first().map(|m| m.place_m)
        })
    })
}

fn unit(r: &mut Pcg64Mcg) -> f64 {
    r.random()
}
