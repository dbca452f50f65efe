//! Where a box may stand: from the peaks that nothing predicted explains, and from the paths that are there.
//!
//! A peak puts a face of a known direction at one distance from its ends, and says where on that face it was reflected. Distances on which peaks of
//! several responses agree are faces (a Hough transform); faces at right angles make a box; the box that explains most peaks, stands in the way of
//! no path that is there and in that of some that are missing, counts.

use super::{HEIGHT_M, HEIGHTS_M, MAX_TURN_DEG, SIDE_M, SIDES_M, TURN_SD_DEG};
use crate::extend::box_object::BoxShape;
use crate::likelihood::multilateration::{PredictedPath, UnassignedPeaks};

/// Place, sides, height and turn of a box, as the parameters of the effect.
type Values = [f64; 6];

/// Turns that are tried are so far apart, in degrees.
const TURN_STEP_DEG: f64 = 5.0;
/// Distances of a face that peaks give agree within this, in metres ...
const SAME_FACE_M: f64 = 0.05;
/// ... and the places where they were reflected lie no farther from each other than this.
const REACH_M: f64 = 1.2;
/// Nearest face to a source or receiver, in metres.
const MIN_BEFORE_M: f64 = 0.1;
/// A peak that is no stray with at least this probability points nowhere.
const MIN_STRAY: f64 = 0.3;
/// Faces of one direction that are tried, tops, and boxes that are improved and handed on.
const FACES: usize = 4;
const TOPS: usize = 5;
const IMPROVED: usize = 10;
const KEPT: usize = 3;
/// A face reaches so far beyond the outermost places where it was seen to reflect, in metres.
const MARGIN_M: f64 = 0.15;
/// A side that nothing shows is as long as this, in metres.
const UNSEEN_M: f64 = 0.7;
/// What a peak where one should be counts for, as odds against a stray one, and how near it must be, in metres.
const ODDS: f64 = 20.0;
const NEAR_M: f64 = 0.04;
/// What a face costs, in nats, that should be seen in a response.
const SEEN_NATS: f64 = 0.65;
/// Steps of the improvement: in metres and degrees at first, halved so many times.
const FIRST_STEP: (f64, f64) = (0.12, 3.0);
const HALVINGS: usize = 5;

/// What a peak says of a face of one direction.
#[derive(Clone, Copy)]
struct Vote {
    response: usize,
    /// Where the face lies along its normal.
    along_m: f64,
    /// Where on it the peak was reflected: along the face (both horizontal coordinates for a top), and its height above the floor.
    across_m: [f64; 2],
    stray: f64,
}

/// A face that several peaks agree on.
#[derive(Clone, Copy)]
struct Face {
    score: f64,
    along_m: f64,
    /// Least and greatest place along it.
    across_m: [[f64; 2]; 2],
}

/// Boxes to start from, the most promising first.
pub(super) fn starts(peaks: &UnassignedPeaks<'_>, floor_m: f64) -> Vec<Values> {
    let room = Room::of(peaks, floor_m);
    let tops = faces(&room.votes([0.0, 0.0, 1.0]), TOPS);
    let mut found: Vec<(f64, Values)> = Vec::new();
    let turns = (2.0 * 45.0 / TURN_STEP_DEG) as usize;
    for turn in 0..turns {
        let turn_deg = -45.0 + TURN_STEP_DEG * turn as f64;
        // Faces of the four upright directions.
        let upright: [Vec<Face>; 4] = std::array::from_fn(|side| {
            let (sin, cos) = (turn_deg + 90.0 * side as f64).to_radians().sin_cos();
            faces(&room.votes([cos, sin, 0.0]), FACES)
        });
        for side in 0..4 {
            for own in &upright[side] {
                for values in boxes(own, (side, turn_deg), &upright, &tops) {
                    if room.holds([values[0], values[1], floor_m]) {
                        found.push((room.score(&values), values));
                    }
                }
            }
        }
    }
    let mut best = apart(found, IMPROVED);
    best.iter_mut().for_each(|(score, values)| room.improve(score, values));
    apart(best, KEPT).into_iter().map(|(_, values)| values).collect()
}

/// The best that differ from each other.
fn apart(mut all: Vec<(f64, Values)>, count: usize) -> Vec<(f64, Values)> {
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<(f64, Values)> = Vec::new();
    for one in all {
        let is_new = |other: &(f64, Values)| (0..5).any(|k| (one.1[k] - other.1[k]).abs() > 0.1);
        if kept.len() < count && kept.iter().all(is_new) {
            kept.push(one);
        }
    }
    kept
}

/// Faces that most peaks of different responses agree on.
fn faces(votes: &[Vote], count: usize) -> Vec<Face> {
    let mut found: Vec<Face> = Vec::new();
    for seed in votes {
        let agrees = |v: &&Vote| {
            (v.along_m - seed.along_m).abs() < SAME_FACE_M
                && (0..2).all(|k| (v.across_m[k] - seed.across_m[k]).abs() < REACH_M)
        };
        let mut own: Vec<&Vote> = votes.iter().filter(agrees).collect();
        own.sort_by(|a, b| a.response.cmp(&b.response).then(b.stray.total_cmp(&a.stray)));
        own.dedup_by_key(|v| v.response);
        let score = own.iter().map(|v| v.stray).sum::<f64>();
        let along_m = own.iter().map(|v| v.stray * v.along_m).sum::<f64>() / score;
        let reach = |k: usize| {
            let all = own.iter().map(|v| v.across_m[k]);
            [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)]
        };
        found.push(Face { score, along_m, across_m: [reach(0), reach(1)] });
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<Face> = Vec::new();
    for face in found {
        let is_new = |other: &Face| {
            (face.along_m - other.along_m).abs() > SAME_FACE_M
                || (face.across_m[0][0] - other.across_m[0][0]).abs() > 0.5 * REACH_M
        };
        if kept.len() < count && kept.iter().all(is_new) {
            kept.push(face);
        }
    }
    kept
}

/// Boxes of a turn with this face on one of their four sides, and with others of that turn or without.
fn boxes(own: &Face, (side, turn_deg): (usize, f64), upright: &[Vec<Face>; 4], tops: &[Face]) -> Vec<Values> {
    let none = || std::iter::once(None);
    let with = |turned: usize| upright[(side + turned) % 4].iter().map(Some).chain(none());
    let (sin, cos) = (turn_deg + 90.0 * side as f64).to_radians().sin_cos();
    let (normal, along) = ([cos, sin], [-sin, cos]);
    let mut found = Vec::new();
    for left in with(1) {
        for right in with(3) {
            let [seen_low, seen_high] = own.across_m[0];
            let low = right.map(|f| -f.along_m);
            let high = left.map(|f| f.along_m);
            let (low, high) = match (low, high) {
                (Some(low), Some(high)) => (low, high),
                (Some(low), None) => (low, (seen_high + MARGIN_M).max(low + UNSEEN_M)),
                (None, Some(high)) => ((seen_low - MARGIN_M).min(high - UNSEEN_M), high),
                (None, None) => {
                    let more = (0.5 * (UNSEEN_M - seen_high + seen_low)).max(MARGIN_M);
                    (seen_low - more, seen_high + more)
                }
            };
            let width = high - low;
            if low > seen_low || high < seen_high || !(SIDES_M.0..=SIDES_M.1).contains(&width) {
                continue;
            }
            for opposite in with(2) {
                let depth = opposite.map_or(UNSEEN_M, |f| own.along_m + f.along_m);
                if !(SIDES_M.0..=SIDES_M.1).contains(&depth) {
                    continue;
                }
                let (out, beside) = (own.along_m - 0.5 * depth, 0.5 * (low + high));
                let [x, y]: [f64; 2] = std::array::from_fn(|k| out * normal[k] + beside * along[k]);
                let sides = if side % 2 == 0 { [depth, width] } else { [width, depth] };
                let is_over = |top: &&Face| {
                    let middle = top.across_m.map(|[low, high]| 0.5 * (low + high));
                    (middle[0] - x).hypot(middle[1] - y) < 0.5 * depth.hypot(width)
                };
                let seen = (own.across_m[1][1] + MARGIN_M).max(UNSEEN_M);
                let heights = tops.iter().filter(is_over).map(|top| top.along_m).chain([seen]);
                let heights = heights.filter(|h| (own.across_m[1][1]..=HEIGHTS_M.1).contains(h));
                found.extend(heights.map(|h| [x, y, sides[0], sides[1], h, turn_deg]));
            }
        }
    }
    found
}

/// Responses that have peaks, and predicted paths that say something.
struct Room<'a> {
    responses: Vec<Heard>,
    paths: Vec<&'a PredictedPath>,
    floor_m: f64,
    box_m: [[f64; 3]; 2],
}

struct Heard {
    source: [f64; 3],
    receiver: [f64; 3],
    /// Lengths of the ways of peaks, and the probabilities that they are strays.
    peaks: Vec<(f64, f64)>,
}

impl<'a> Room<'a> {
    fn of(peaks: &'a UnassignedPeaks<'_>, floor_m: f64) -> Self {
        let survey = peaks.survey();
        let heard = |(response, own): (usize, &Vec<crate::UnassignedPeak>)| {
            let pair = &survey.responses()[response];
            Heard {
                source: survey.sources()[pair.source].position_m,
                receiver: survey.receivers()[pair.receiver].position_m,
                peaks: own.iter().filter(|p| p.stray > MIN_STRAY).map(|p| (p.length_m, p.stray)).collect(),
            }
        };
        let responses =
            peaks.by_response().iter().enumerate().filter(|(_, own)| !own.is_empty()).map(heard).collect();
        let paths = peaks.paths().iter().filter(|p| p.hidden_nats.abs() > 0.1).collect();
        Self { responses, paths, floor_m, box_m: survey.box_m() }
    }

    /// What all peaks say of faces with this normal.
    fn votes(&self, normal: [f64; 3]) -> Vec<Vote> {
        let floor_m = self.floor_m;
        let along = |place: [f64; 3]| (0..3).map(|k| normal[k] * place[k]).sum::<f64>();
        let is_top = normal[2] > 0.5;
        let mut votes = Vec::new();
        for (response, heard) in self.responses.iter().enumerate() {
            let (a, b) = (along(heard.source), along(heard.receiver));
            let [x, y, z] = heard.source;
            // The source, and its image in the floor.
            let sources = [heard.source, [x, y, 2.0 * floor_m - z]];
            let sources = if is_top { &sources[..1] } else { &sources };
            let both = sources.iter().flat_map(|s| heard.peaks.iter().map(move |peak| (s, peak)));
            for (source, &(length_m, stray)) in both {
                let direct_m2: f64 = (0..3).map(|k| (source[k] - heard.receiver[k]).powi(2)).sum();
                // (a - c) (b - c) is a quarter of what the squares of the lengths differ by.
                let quarter = 0.25 * (length_m * length_m - direct_m2);
                let face = 0.5 * (a + b - ((a - b).powi(2) + 4.0 * quarter).sqrt());
                let (from, to) = (a - face, b - face);
                if quarter <= 0.0 || from < MIN_BEFORE_M || to < MIN_BEFORE_M {
                    continue;
                }
                let share = to / (from + to);
                let place: [f64; 3] = std::array::from_fn(|k| {
                    heard.receiver[k] + share * (source[k] - 2.0 * from * normal[k] - heard.receiver[k])
                });
                let height = if is_top { face - floor_m } else { (place[2] - floor_m).abs() };
                if !(0.0..=HEIGHTS_M.1).contains(&height) || !self.holds(place) {
                    continue;
                }
                let (along_m, across_m) = if is_top {
                    (height, [place[0], place[1]])
                } else {
                    (face, [-normal[1] * place[0] + normal[0] * place[1], height])
                };
                votes.push(Vote { response, along_m, across_m, stray });
            }
        }
        votes
    }

    /// Whether a place is in the room, as far as the room's own box says.
    fn holds(&self, [x, y, _]: [f64; 3]) -> bool {
        let [low, high] = self.box_m;
        (low[0]..=high[0]).contains(&x) && (low[1]..=high[1]).contains(&y)
    }

    /// What peaks and paths say for a box, and how usual it is.
    fn score(&self, values: &Values) -> f64 {
        let [x, y, length, depth, height, turn_deg] = *values;
        let shape = BoxShape::new([x, y, self.floor_m], [length, depth, height], turn_deg);
        let unusual = |value: f64, (mean, sd): (f64, f64)| 0.5 * ((value - mean) / sd).powi(2);
        let mut score = -unusual(length, SIDE_M)
            - unusual(depth, SIDE_M)
            - unusual(height, HEIGHT_M)
            - unusual(turn_deg, (0.0, TURN_SD_DEG));
        for heard in &self.responses {
            for face in 0..BoxShape::WAYS {
                let Some(way) = shape.reflection(face, heard.source, heard.receiver) else { continue };
                let near = |&(length_m, stray): &(f64, f64)| {
                    stray * (-0.5 * ((length_m - way.length_m) / NEAR_M).powi(2)).exp()
                };
                let best = heard.peaks.iter().map(near).fold(0.0, f64::max);
                score += (1.0 + ODDS * best).ln() - SEEN_NATS;
            }
        }
        let hidden = self.paths.iter().filter(|path| shape.blocks(&path.stops));
        score + hidden.map(|path| path.hidden_nats).sum::<f64>()
    }

    /// Moves, widens, lowers and turns a box as long as that helps, by ever smaller steps.
    fn improve(&self, score: &mut f64, values: &mut Values) {
        let (mut step_m, mut step_deg) = FIRST_STEP;
        for _ in 0..HALVINGS {
            for _ in 0..4 {
                let before = *score;
                for moved in neighbours(values, step_m, step_deg)
                    .into_iter()
                    .filter(|v| self.holds([v[0], v[1], self.floor_m]))
                {
                    let found = self.score(&moved);
                    if found > *score {
                        (*score, *values) = (found, moved);
                    }
                }
                if *score <= before {
                    break;
                }
            }
            step_m *= 0.5;
            step_deg *= 0.5;
        }
    }
}

/// Boxes that a step makes of one: each upright face moved out or in, the whole moved, its height, its turn.
fn neighbours(values: &Values, step_m: f64, step_deg: f64) -> Vec<Values> {
    let (sin, cos) = values[5].to_radians().sin_cos();
    let axes = [[cos, sin], [-sin, cos]];
    let mut found = Vec::new();
    for sign in [1.0, -1.0] {
        for (axis, [x, y]) in axes.into_iter().enumerate() {
            // Both ends of an axis, and both together.
            for (grows, moves) in [(1.0, 0.5), (1.0, -0.5), (0.0, 1.0)] {
                let mut one = *values;
                one[2 + axis] += sign * grows * step_m;
                one[0] += sign * moves * step_m * x;
                one[1] += sign * moves * step_m * y;
                found.push(one);
            }
        }
        let mut higher = *values;
        higher[4] += sign * step_m;
        let mut turned = *values;
        turned[5] += sign * step_deg;
        found.extend([higher, turned]);
    }
    found.retain(|v| {
        (SIDES_M.0..=SIDES_M.1).contains(&v[2])
            && (SIDES_M.0..=SIDES_M.1).contains(&v[3])
            && (HEIGHTS_M.0..=HEIGHTS_M.1).contains(&v[4])
            && v[5].abs() <= MAX_TURN_DEG
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made;
    use crate::likelihood::multilateration::UnassignedPeak;
    use crate::survey::Survey;
    use sabine_scene::{Levels, TimeZero};

    /// Least and greatest coordinates of a box whose sides lie along the axes.
    const BOX_M: [[f64; 2]; 3] = [[1.8, 4.0], [2.3, 3.0], [0.0, 1.0]];

    /// Ten receivers about the box.
    fn survey() -> Survey {
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let (receiver, response) = (survey.receivers[0].clone(), survey.responses[0].clone());
        survey.sources[0].position_m = [1.3, 0.9, 1.1];
        let at = |i: usize| {
            let t = i as f64;
            [1.9 + 0.3 * t, 1.0 + 0.7 * (1.7 * t).sin(), 0.7 + 0.08 * t]
        };
        survey.receivers = (0..10)
            .map(|i| crate::survey::Place { id: format!("r{i}"), position_m: at(i), ..receiver.clone() })
            .collect();
        survey.responses = (0..10)
            .map(|i| crate::survey::SurveyedResponse {
                receiver: i,
                name: format!("s0-r{i}"),
                ..response.clone()
            })
            .collect();
        survey
    }

    /// Lengths of the reflections at the box, each by its own formula: a face at right angles to an axis, the other two coordinates where the line to
    /// the image meets it.
    fn lengths(source: [f64; 3], receiver: [f64; 3]) -> Vec<f64> {
        let mut found = Vec::new();
        for floor in [1.0, -1.0] {
            let from = [source[0], source[1], floor * source[2]];
            for axis in 0..3 {
                for (side, out) in [(0, -1.0), (1, 1.0)] {
                    let face = BOX_M[axis][side];
                    let (a, b) = (out * (source[axis] - face), out * (receiver[axis] - face));
                    if a <= 0.0 || b <= 0.0 || (axis == 2 && (side == 0 || floor < 0.0)) {
                        continue;
                    }
                    let inside = (0..3).filter(|k| *k != axis).all(|k| {
                        let at = from[k] + (receiver[k] - from[k]) * a / (a + b);
                        let at = if k == 2 { at.abs() } else { at };
                        (BOX_M[k][0]..=BOX_M[k][1]).contains(&at)
                    });
                    let rest: f64 =
                        (0..3).filter(|k| *k != axis).map(|k| (from[k] - receiver[k]).powi(2)).sum();
                    if inside {
                        found.push((rest + (a + b).powi(2)).sqrt());
                    }
                }
            }
        }
        found
    }

    fn peaks(survey: &Survey, with_box: bool) -> UnassignedPeaks<'_> {
        let source = survey.sources[0].position_m;
        let of = |(i, place): (usize, &crate::survey::Place)| {
            let own = if with_box { lengths(source, place.position_m) } else { Vec::new() };
            // Late strays that mean nothing.
            let strays = (0..6).map(|k| 7.0 + 1.3 * f64::from(k) + (2.3 * i as f64 + f64::from(k)).sin());
            own.into_iter().chain(strays).map(|length_m| UnassignedPeak { length_m, stray: 1.0 }).collect()
        };
        let peaks: Vec<Vec<UnassignedPeak>> = survey.receivers.iter().enumerate().map(of).collect();
        // Two paths over the floor are there, and say where the box is not.
        let there = |i: usize| {
            let to = survey.receivers[i].position_m;
            let share = source[2] / (source[2] + to[2]);
            let floor =
                [source[0] + share * (to[0] - source[0]), source[1] + share * (to[1] - source[1]), 0.0];
            PredictedPath { stops: vec![source, floor, to], hidden_nats: -5.0 }
        };
        let shape = BoxShape::new([2.9, 2.65, 0.0], [2.2, 0.7, 1.0], 0.0);
        let paths = (0..10).map(there).filter(|path| !shape.blocks(&path.stops)).collect();
        UnassignedPeaks { survey, peaks, paths }
    }

    #[test]
    fn a_box_is_found_where_its_faces_reflect() {
        let survey = survey();
        let peaks = peaks(&survey, true);
        let seen: usize = peaks.by_response().iter().map(|own| own.len() - 6).sum();
        assert!(seen > 8, "{seen}");
        let found = starts(&peaks, 0.0);
        let [x, y, length, depth, height, turn_deg] = found[0];
        // Faces that were seen: the front, one end, and the top.
        assert!((y - 0.5 * depth - 2.3).abs() < 0.05, "{found:?}");
        assert!((x - 2.9).abs() < 0.5 && (length - 2.2).abs() < 1.0, "{found:?}");
        assert!((0.6..1.3).contains(&height) && turn_deg.abs() < 3.0, "{found:?}");
    }

    #[test]
    fn strays_alone_are_worth_less_than_the_box() {
        let survey = survey();
        let score = |peaks: &UnassignedPeaks<'_>| {
            let room = Room::of(peaks, 0.0);
            starts(peaks, 0.0).first().map_or(f64::NEG_INFINITY, |best| room.score(best))
        };
        let (with, without) = (score(&peaks(&survey, true)), score(&peaks(&survey, false)));
        assert!(with > 8.0 && without < 0.4 * with, "{with} {without}");
    }
}
