//! Where an unknown plane mirrors the sound: image places from the distances of peaks that nothing predicted explains.
//!
//! Every peak that comes at the end of a way d puts the image of the source on a sphere of radius d about its receiver. Three
//! receivers leave two places; the place counts that most other receivers confirm (Fischler and Bolles 1981).

use crate::survey::Survey;

/// Tolerance of a distance while images are sought, in metres; or twice the deviation of the receiver's place, if that is more.
const TOLERANCE_M: f64 = 0.05;
/// What a confirming peak counts for, as odds against a stray one.
const ODDS: f64 = 30.0;
/// Peaks of a response that are tried in threes, the surest strays first.
const PEAKS: usize = 7;
/// Threes of receivers.
const THREES: usize = 60;
/// Places that are handed on, and their least distance from each other in metres.
const PLACES: usize = 4;
const APART_M: f64 = 0.3;
/// A plane nearer to the source than this would be seen, in metres.
const MIN_M: f64 = 0.2;
/// Receivers that must confirm a place.
const MIN_CONFIRMED: usize = 4;

/// A peak that may belong to a surface that is not in the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnassignedPeak {
    /// Length of its path in metres.
    pub length_m: f64,
    /// Probability that no predicted reflection explains it.
    pub stray: f64,
}

/// A predicted path, and what is known of whether it is there.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PredictedPath {
    /// The places in metres from each of which to the next it goes straight on: source, reflections, receiver.
    pub stops: Vec<[f64; 3]>,
    /// What the peaks say for its being hidden, in nats: far below zero where one lies where it should come, above zero where none does.
    pub hidden_nats: f64,
}

/// What peaks the mesh leaves unexplained.
#[derive(Clone, Debug)]
pub struct UnassignedPeaks<'a> {
    pub(crate) survey: &'a Survey,
    /// By response; empty for one that is not fitted.
    pub(crate) peaks: Vec<Vec<UnassignedPeak>>,
    pub(crate) paths: Vec<PredictedPath>,
}

/// How one plane reflects from a source to a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mirrored {
    pub length_m: f64,
    pub departure: [f64; 3],
    pub arrival: [f64; 3],
    pub place_m: [f64; 3],
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = dot(a, a).sqrt().max(1e-12);
    a.map(|c| c / length)
}

/// The reflection at the plane that mirrors `first` into `image`, from `source` to `receiver`; none if both are not on one side of it or
/// it would reflect outside the box.
pub(crate) fn mirrored(
    first: [f64; 3],
    image: [f64; 3],
    source: [f64; 3],
    receiver: [f64; 3],
    box_m: [[f64; 3]; 2],
) -> Option<Mirrored> {
    let normal = unit(sub(image, first));
    let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (first[k] + image[k]));
    let (from, to) = (dot(sub(source, middle), normal), dot(sub(receiver, middle), normal));
    if from.abs() < MIN_M || from * to <= 0.0 {
        return None;
    }
    let own: [f64; 3] = std::array::from_fn(|k| source[k] - 2.0 * from * normal[k]);
    let share = to / (to + from);
    let place_m: [f64; 3] = std::array::from_fn(|k| receiver[k] + share * (own[k] - receiver[k]));
    let inside = (0..3).all(|k| (box_m[0][k]..=box_m[1][k]).contains(&place_m[k]));
    let way = sub(own, receiver);
    inside.then(|| Mirrored {
        length_m: dot(way, way).sqrt(),
        departure: unit(sub(place_m, source)),
        arrival: unit(way),
        place_m,
    })
}

/// Unit vectors in the plane that mirrors one place into another: the first level, where the plane is not.
pub(crate) fn panel_axes(first: [f64; 3], image: [f64; 3]) -> [[f64; 3]; 2] {
    let normal = unit(sub(image, first));
    let level = normal[0].hypot(normal[1]);
    let along = if level > 1e-6 { [-normal[1] / level, normal[0] / level, 0.0] } else { [1.0, 0.0, 0.0] };
    [along, unit(cross(normal, along))]
}

/// The two places at these distances from three points.
fn trilaterate(points: [[f64; 3]; 3], distances: [f64; 3]) -> Option<[[f64; 3]; 2]> {
    let x_axis = unit(sub(points[1], points[0]));
    let (d, to_third) = (dot(sub(points[1], points[0]), x_axis), sub(points[2], points[0]));
    let i = dot(to_third, x_axis);
    let beside: [f64; 3] = std::array::from_fn(|k| to_third[k] - i * x_axis[k]);
    let j = dot(beside, beside).sqrt();
    if d < 0.2 || j < 0.2 {
        return None;
    }
    let y_axis = beside.map(|c| c / j);
    let z_axis = cross(x_axis, y_axis);
    let [a, b, c] = distances.map(|r| r * r);
    let x = (a - b + d * d) / (2.0 * d);
    let y = (a - c + i * i + j * j - 2.0 * i * x) / (2.0 * j);
    let square = a - x * x - y * y;
    // A little below zero is an image in the plane of the three, misread.
    if square < -0.1 {
        return None;
    }
    let z = square.max(0.0).sqrt();
    Some(
        [z, -z]
            .map(|z| std::array::from_fn(|k| points[0][k] + x * x_axis[k] + y * y_axis[k] + z * z_axis[k])),
    )
}

impl UnassignedPeaks<'_> {
    /// What was measured.
    pub fn survey(&self) -> &Survey {
        self.survey
    }

    /// Peaks by response (index), empty for one that is not fitted.
    pub fn by_response(&self) -> &[Vec<UnassignedPeak>] {
        &self.peaks
    }

    /// Predicted paths of all responses that are fitted, as far as they can be followed.
    pub fn paths(&self) -> &[PredictedPath] {
        &self.paths
    }

    /// Places at which a plane may mirror the first source, in metres, the best confirmed first.
    pub fn images(&self) -> Vec<[f64; 3]> {
        let survey = self.survey;
        let mut found: Vec<(f64, [f64; 3])> = Vec::new();
        let Some(first) = survey.responses.first().map(|r| survey.sources[r.source].position_m) else {
            return Vec::new();
        };
        for source in 0..survey.sources.len() {
            let place = survey.sources[source].position_m;
            let own: Vec<usize> = (0..survey.responses.len())
                .filter(|&p| survey.responses[p].source == source && !self.peaks[p].is_empty())
                .collect();
            for three in threes(&own, |p| survey.receivers[survey.responses[p].receiver].position_m) {
                let points = three.map(|p| survey.receivers[survey.responses[p].receiver].position_m);
                let surest = three.map(|p| surest(&self.peaks[p]));
                for a in &surest[0] {
                    for b in &surest[1] {
                        for c in &surest[2] {
                            let lengths = [a.length_m, b.length_m, c.length_m];
                            for image in trilaterate(points, lengths).into_iter().flatten() {
                                let image = rebased(first, place, image);
                                if let Some(score) = self.score(first, image) {
                                    found.push((score, image));
                                }
                            }
                        }
                    }
                }
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut kept: Vec<[f64; 3]> = Vec::new();
        for (_, image) in found {
            let far = |other: &[f64; 3]| dot(sub(image, *other), sub(image, *other)) > APART_M * APART_M;
            if kept.len() < PLACES && kept.iter().all(far) {
                kept.push(image);
            }
        }
        kept
    }

    /// How well an image of the first source is confirmed; none if by too few.
    fn score(&self, first: [f64; 3], image: [f64; 3]) -> Option<f64> {
        let survey = self.survey;
        let mut confirmed = 0;
        let mut sum = 0.0;
        for (response, peaks) in survey.responses.iter().zip(&self.peaks) {
            let source = survey.sources[response.source].position_m;
            let receiver = survey.receivers[response.receiver].position_m;
            let Some(way) = mirrored(first, image, source, receiver, survey.box_m) else { continue };
            let tolerance_m = TOLERANCE_M.max(2.0 * survey.receivers[response.receiver].position_sd_m);
            let worth = peaks
                .iter()
                .map(|p| p.stray * (-0.5 * ((p.length_m - way.length_m) / tolerance_m).powi(2)).exp())
                .fold(0.0, f64::max);
            sum += (1.0 + ODDS * worth).ln();
            confirmed += usize::from(worth > 0.2);
        }
        (confirmed >= MIN_CONFIRMED).then_some(sum)
    }
}

/// The image of the first source in the plane that mirrors another into `image`.
fn rebased(first: [f64; 3], source: [f64; 3], image: [f64; 3]) -> [f64; 3] {
    let normal = unit(sub(image, source));
    let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (source[k] + image[k]));
    let far = dot(sub(first, middle), normal);
    std::array::from_fn(|k| first[k] - 2.0 * far * normal[k])
}

fn surest(peaks: &[UnassignedPeak]) -> Vec<UnassignedPeak> {
    let mut all = peaks.to_vec();
    all.sort_by(|a, b| b.stray.total_cmp(&a.stray));
    all.truncate(PEAKS);
    all
}

/// Threes of responses whose receivers span the largest triangles, no receiver in much more than its share of them.
fn threes(own: &[usize], place: impl Fn(usize) -> [f64; 3]) -> Vec<[usize; 3]> {
    let mut all: Vec<(f64, [usize; 3])> = Vec::new();
    for (i, &a) in own.iter().enumerate() {
        for (j, &b) in own.iter().enumerate().skip(i + 1) {
            for &c in &own[j + 1..] {
                let area = cross(sub(place(b), place(a)), sub(place(c), place(a)));
                all.push((dot(area, area), [a, b, c]));
            }
        }
    }
    all.sort_by(|x, y| y.0.total_cmp(&x.0));
    // Of the larger half, evenly: the largest alone would all share the same outer receivers.
    let half = all.len().div_ceil(2);
    let step = (half / THREES).max(1);
    all.into_iter().take(half).step_by(step).take(THREES).map(|(_, three)| three).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_distances_give_the_place_and_its_mirror_image() {
        let points = [[0.3, 0.2, 1.0], [4.0, 0.5, 1.4], [1.0, 3.5, 2.0]];
        let place = [5.0, -2.0, 3.0];
        let distances = points.map(|p| dot(sub(place, p), sub(place, p)).sqrt());
        let Some(found) = trilaterate(points, distances) else { panic!("no place") };
        let off = found.map(|f| dot(sub(f, place), sub(f, place)).sqrt());
        assert!(off[0].min(off[1]) < 1e-9, "{off:?}");
    }

    #[test]
    fn angles_are_equal_at_the_plane_and_the_way_is_as_long_as_to_the_image() {
        let box_m = [[0.0; 3], [6.0, 5.0, 3.0]];
        let (source, receiver, image) = ([1.0, 1.0, 1.2], [2.0, 3.0, 1.5], [5.0, 2.0, 1.4]);
        let Some(way) = mirrored(source, image, source, receiver, box_m) else { panic!("no reflection") };
        let straight = dot(sub(image, receiver), sub(image, receiver)).sqrt();
        assert!((way.length_m - straight).abs() < 1e-12);
        let legs: f64 =
            [source, receiver].map(|p| dot(sub(p, way.place_m), sub(p, way.place_m)).sqrt()).iter().sum();
        assert!((legs - straight).abs() < 1e-9);
        let normal = unit(sub(image, source));
        assert!((dot(way.departure, normal) - dot(way.arrival, normal)).abs() < 1e-9);
        // Beyond the plane nothing is reflected.
        assert!(mirrored(source, image, source, [5.5, 2.0, 1.4], box_m).is_none());
    }
}
