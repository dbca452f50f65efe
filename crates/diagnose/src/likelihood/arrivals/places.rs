//! Ends of a path that are not where they were traced: how much longer it is, and where the search for such a place starts.

use super::{ArrivalModel, WIDTHS_S};
use crate::effect::Nuisance;
use crate::simulate::traced_pair::Arrival;
use crate::survey::planes::apart_m;
use crate::survey::surfaces::axes_of;

/// From so many responses on, their direct sounds alone say where a place is: three distances leave a place and its mirror image.
const ENOUGH_RESPONSES: usize = 4;
/// Places from which the search starts are so far from each other, in metres: less than the second of [`WIDTHS_S`] reaches.
const SPACING_M: f64 = 0.06;
/// They reach so far, in standard deviations of the place.
const REACH_SD: f64 = 2.0;
/// Those that are followed from the widest of [`WIDTHS_S`] on, and from the next one on.
const FOLLOWED: [usize; 2] = [2, 2];

/// By how much a path of this length grows if one end moves, in metres; `direction` points from that end to where the sound seems to come
/// from, or to go to: the image of the other end, which stays. Exact as long as the path meets the same surfaces.
pub(super) fn longer_m(length_m: f64, direction: [f64; 3], offset_m: &[f64]) -> f64 {
    let (along, square) = (0..3).fold((0.0, 0.0), |(along, square), k| {
        (along + direction[k] * offset_m[k], square + offset_m[k] * offset_m[k])
    });
    let moved_m = (length_m * length_m - 2.0 * length_m * along + square).sqrt();
    (square - 2.0 * length_m * along) / (moved_m + length_m).max(1e-9)
}

/// Its slopes with the offset.
pub(super) fn slopes(length_m: f64, direction: [f64; 3], offset_m: &[f64]) -> [f64; 3] {
    let way: [f64; 3] = std::array::from_fn(|k| length_m * direction[k] - offset_m[k]);
    let moved_m = way.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
    way.map(|x| -x / moved_m)
}

/// Where the search for places starts that the cases open, and the width ([`WIDTHS_S`]) with which each start is followed. A direct sound
/// says how far away a place is, and reflections say where about the source it lies; but from a place 30 cm away their peaks find
/// no partners. `direct` are the values at which the direct sounds alone come when they should.
pub(super) fn starts(model: &mut ArrivalModel<'_>, direct: &[f64]) -> Vec<(Vec<f64>, usize)> {
    let opened: Vec<Nuisance> = model.terms.iter().flat_map(|t| &t.case.relaxes).map(|r| r.0).collect();
    let mut found = Vec::new();
    for nuisance in opened {
        let Some(range) = model.layout.nuisance(nuisance) else { continue };
        let pairs = pairs_of(model, nuisance);
        if !(1..ENOUGH_RESPONSES).contains(&pairs.len()) {
            continue;
        }
        let first = &model.data.arrivals[pairs[0]][0];
        let is_source = matches!(nuisance, Nuisance::SourcePosition(_));
        let towards = if is_source { first.departure } else { first.arrival };
        let places = places(first, towards, &direct[range.clone()], model.priors[range.start].sd);
        let at = |place: &[f64; 3]| {
            let mut values = direct.to_vec();
            values[range.clone()].copy_from_slice(place);
            values
        };
        for (width, count) in FOLLOWED.into_iter().enumerate() {
            model.width_s = Some(WIDTHS_S[width]);
            let likelihood = |values: &[f64]| -> f64 {
                let at = model.at(values, false);
                pairs.iter().map(|&pair| model.pair_likelihood(&at, pair, None)).sum()
            };
            let least = likelihood(direct);
            let mut ranked: Vec<(f64, [f64; 3])> = places.iter().map(|p| (likelihood(&at(p)), *p)).collect();
            ranked.retain(|(likelihood, _)| *likelihood > least);
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
            let mut kept: Vec<[f64; 3]> = Vec::new();
            for (_, place) in ranked {
                // A neighbour leads to the same end.
                if kept.len() < count && kept.iter().all(|other| apart_m(place, *other) > 2.5 * SPACING_M) {
                    kept.push(place);
                }
            }
            found.extend(kept.iter().map(|place| (at(place), width)));
        }
        model.width_s = None;
    }
    found
}

/// Responses of a place that are fitted and have a direct sound.
fn pairs_of(model: &ArrivalModel<'_>, nuisance: Nuisance) -> Vec<usize> {
    let has = |pair: &usize| {
        let response = &model.data.survey.responses[*pair];
        let is_its = match nuisance {
            Nuisance::SourcePosition(source) => response.source == source,
            Nuisance::ReceiverPosition(receiver) => response.receiver == receiver,
            Nuisance::Absorption(_) | Nuisance::ResponseGain(_) => false,
        };
        is_its && model.used[*pair] && !model.data.arrivals[*pair].is_empty()
    };
    (0..model.assignment.len()).filter(has).collect()
}

/// Offsets of a place, evenly over the sphere about the other end of a direct sound on which that has it; `towards` points to that end.
fn places(first: &Arrival, towards: [f64; 3], direct_m: &[f64], sd_m: f64) -> Vec<[f64; 3]> {
    let radius_m = first.length_m + longer_m(first.length_m, towards, direct_m);
    let reach_m = (REACH_SD * sd_m).min(0.9 * radius_m);
    let steps = (reach_m / SPACING_M).floor() as i32;
    let [along, u, v] = axes_of(towards);
    let mut found = Vec::new();
    for (i, j) in (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i, j))) {
        let [x, y] = [i, j].map(|steps| SPACING_M * f64::from(steps));
        if x.hypot(y) <= reach_m {
            let nearer_m = first.length_m - (radius_m * radius_m - x * x - y * y).sqrt();
            found.push(std::array::from_fn(|k| nearer_m * along[k] + x * u[k] + y * v[k]));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::fit;
    use super::*;
    use crate::effect::Effect;
    use crate::effects::PositionError;
    use crate::hand_made::Tables;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn a_path_grows_by_what_geometry_says() {
        let (length_m, direction) = (4.0, [0.6, 0.0, 0.8]);
        for offset_m in [[0.3, -0.2, 0.1], [2.4, 0.0, 3.2], [0.0, 0.4, 0.0], [0.0; 3]] {
            let image = direction.map(|d| length_m * d);
            let expected = apart_m(image, offset_m) - length_m;
            assert!((longer_m(length_m, direction, &offset_m) - expected).abs() < 1e-12, "{offset_m:?}");
            for (k, slope) in slopes(length_m, direction, &offset_m).into_iter().enumerate() {
                let at = |step: f64| {
                    let mut moved = offset_m;
                    moved[k] += step;
                    longer_m(length_m, direction, &moved)
                };
                // At the image itself there is no slope.
                if expected > -length_m + 1e-6 {
                    assert!((slope - (at(1e-6) - at(-1e-6)) / 2e-6).abs() < 1e-8, "{offset_m:?} {k}");
                }
            }
        }
    }

    /// From the stated place, and from where the direct sound points, the reflections of most of these find no partners.
    #[test]
    fn a_microphone_is_found_wherever_it_stands_at_the_distance_that_the_direct_sound_says() {
        for receiver in 0..3 {
            for turn in 0..6 {
                let angle = f64::from(turn) * std::f64::consts::FRAC_PI_3;
                let stated = Tables::new(Levels::Common, TimeZero::Emission);
                let towards = stated.arrivals[receiver][0].arrival;
                let [_, u, v] = axes_of(towards);
                let off: [f64; 3] = std::array::from_fn(|k| {
                    0.02 * towards[k] + 0.27 * (angle.cos() * u[k] + angle.sin() * v[k])
                });
                let tables = stated.with_receiver_moved(receiver, off);
                let data = tables.arrival_data();
                let sources = tables.survey.sources.len();
                let case = PositionError.cases(&tables.survey).swap_remove(sources + receiver);
                let model = super::super::at_fit(&data, &[&case], &[true; 3]);
                let range = model.layout.receiver(receiver);
                let (found, _) = fit(&data, &[&case], &[true; 3]).expect("a fit");
                let at: [f64; 3] = std::array::from_fn(|k| found.values[range.start + k]);
                // The peaks made by hand come up to three centimetres of way too late or too early.
                assert!(apart_m(at, off) < 0.06, "r{receiver} {turn}: {at:?} for {off:?}");
            }
        }
    }
}
