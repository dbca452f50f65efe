//! How much each way of finding a path counts, where there are several.
//!
//! A path that is scattered at points x1 ... xm leaves the source along stretch 0, reaches the receiver along stretch m, and
//! mirror reflections may lie on any stretch; a plane mirror unfolds, so that a stretch has one length d, as the crow flies
//! among the images, and nothing else of the mirrors enters. With Lambert's law at every point the energy of the path is
//! 16 pi F G B, where F = cos1 / (4 pi d0^2), G the product of g = cos cos' / (pi d^2) over the inner stretches, and
//! B = cosm / (4 pi dm^2). M rays from each end find it
//!
//! | by | if | with density, for each pair of rays |
//! |---|---|---|
//! | a line from the source to x1, the rest being a ray from the receiver | no mirror on stretch 0 | G B |
//! | a line from xm to the receiver, the rest being a ray from the source | no mirror on stretch m | F G |
//! | a line between two rays of a pair along an inner stretch | no mirror there | t F G B / g |
//! | two rays that meet on a patch of wall of area A about one of the points | | u M A F G B |
//! | a ray from the source through the receiver's sphere of radius r | a mirror on stretch m | 4 pi r^2 F G B |
//! | a ray from the receiver through the source's sphere | a mirror on stretch 0 | 4 pi r^2 F G B |
//!
//! (The mean of chord over volume is 1 / (pi r^2), hence the last two; only the shares t of the possible lines and u of the
//! possible meetings are used.) The balance heuristic (Veach 1997, 9.2.2) counts a path found in one way by that way's share
//! of the sum of all densities: no path counts twice, and the singularities of 1 / g in the corners of a room are tamed by
//! what else finds the path. F G B cancels; each way is left with a number that depends on one stretch or one point alone,
//! so that the sum can be kept along the way (as in Georgiev et al. 2012, who unite connections and meetings for light).

use std::f64::consts::PI;

/// What the ways of finding a path add up to on the part of it that one ray has walked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ways {
    /// The way that ends at this ray's beginning: a line to its first scattering, or its sphere.
    beginning: f64,
    /// Lines along inner stretches, were all of them drawn.
    lines: f64,
    /// Meetings at points, were there one ray from each end and all used: areas of patches (m2).
    meetings: f64,
}

/// How many of the possible lines and meetings are used for paths of a given number of reflections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Use {
    /// Share of the lines between two rays.
    pub lines: f64,
    /// Share of the meetings, times the number of rays from each end.
    pub meetings: f64,
}

impl Ways {
    /// A ray that begins at a point with a sphere of this radius.
    pub fn new(radius_m: f64) -> Self {
        Self { beginning: through_sphere(radius_m), lines: 0.0, meetings: 0.0 }
    }

    /// The first point of scattering was reached without a mirror.
    pub fn first_stretch(&mut self, distance_m: f64, cosine: f64) {
        self.beginning = to_point(distance_m, cosine);
    }

    /// A later point of scattering was reached without a mirror.
    pub fn inner_stretch(&mut self, distance_m: f64, cosines: f64) {
        self.lines += between(distance_m, cosines);
    }

    /// The ray was scattered on a patch.
    pub fn scattered_on(&mut self, area_m2: f64) {
        self.meetings += area_m2;
    }

    fn sum(&self, used: Use) -> f64 {
        self.beginning + used.lines * self.lines + used.meetings * self.meetings
    }

    /// Share of a line to the opposite end.
    pub fn share_of_line(&self, distance_m: f64, cosine: f64, used: Use) -> f64 {
        let own = to_point(distance_m, cosine);
        own / (own + self.sum(used))
    }

    /// Share of the passage of this ray through the sphere of the opposite end.
    pub fn share_of_sphere(&self, radius_m: f64, used: Use) -> f64 {
        let own = through_sphere(radius_m);
        own / (own + self.sum(used))
    }

    /// Share of a line between this ray and the one from the opposite end.
    pub fn share_of_joint(&self, other: &Self, distance_m: f64, cosines: f64, used: Use) -> f64 {
        let own = used.lines * between(distance_m, cosines);
        own / (own + self.sum(used) + other.sum(used))
    }

    /// Share of the meeting of this ray, scattered on a patch, with one from the opposite end that has come to the patch.
    pub fn share_of_meeting(&self, other: &Self, area_m2: f64, used: Use) -> f64 {
        used.meetings * area_m2 / (self.sum(used) + other.sum(used))
    }
}

fn to_point(distance_m: f64, cosine: f64) -> f64 {
    4.0 * PI * distance_m * distance_m / cosine
}

fn between(distance_m: f64, cosines: f64) -> f64 {
    PI * distance_m * distance_m / cosines
}

fn through_sphere(radius_m: f64) -> f64 {
    4.0 * PI * radius_m * radius_m
}

#[cfg(test)]
mod tests {
    use super::*;

    const USED: Use = Use { lines: 0.4, meetings: 90.0 };
    const AREAS_M2: [f64; 3] = [0.1, 0.02, 0.3];

    /// Walks over `points` of three scatterings without mirrors; the last one is `open`: not yet known to scatter.
    fn walked(from_source: bool, points: usize, open: bool) -> Ways {
        let (d, cos) = ([2.0, 3.0, 1.5, 4.0], [0.3, 0.8, 0.5]);
        let mut ways = Ways::new(0.5);
        for point in 0..points {
            let (stretch, at) = if from_source { (point, point) } else { (3 - point, 2 - point) };
            if point == 0 {
                ways.first_stretch(d[stretch], cos[at]);
            } else {
                let before = if from_source { at - 1 } else { at + 1 };
                ways.inner_stretch(d[stretch], cos[at] * cos[before]);
            }
            if point + 1 < points || !open {
                ways.scattered_on(AREAS_M2[at]);
            }
        }
        ways
    }

    #[test]
    fn shares_of_a_path_add_up_to_one() {
        let to_receiver = walked(true, 3, false).share_of_line(4.0, 0.5, USED);
        let to_source = walked(false, 3, false).share_of_line(2.0, 0.3, USED);
        let joint = |left: usize, distance_m: f64, cosines: f64| {
            let back = walked(false, 3 - left, false);
            walked(true, left, false).share_of_joint(&back, distance_m, cosines, USED)
        };
        let meeting = |at: usize| {
            walked(true, at + 1, false).share_of_meeting(&walked(false, 3 - at, true), AREAS_M2[at], USED)
        };
        let meetings: f64 = (0..3).map(meeting).sum();
        let sum = to_receiver + to_source + joint(1, 3.0, 0.24) + joint(2, 1.5, 0.4) + meetings;
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        assert!(meetings > 0.01 && meetings < 0.9);
    }

    #[test]
    fn spheres_take_the_place_of_lines_behind_mirrors() {
        // One scattering, mirrors on both stretches: two spheres, and a meeting.
        let (mut through, mut back) = (Ways::new(0.4), Ways::new(0.7));
        let open = back;
        through.scattered_on(0.2);
        back.scattered_on(0.2);
        let sum = through.share_of_sphere(0.7, USED)
            + back.share_of_sphere(0.4, USED)
            + through.share_of_meeting(&open, 0.2, USED);
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }
}
