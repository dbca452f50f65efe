//! The way of the walk: its corners, its speed, and what is in the way.

use crate::failure::Failure;
use sabine::acoustics::Orientation;
use sabine::paths::RayScene;
use sabine::propagate::MeshScene;
use sabine::scene::Scene;
use std::fmt;
use std::path::Path;

/// Samples of all channels that are kept in memory (1 GB).
const MAX_SAMPLES: f64 = 2.5e8;

/// A surface that the straight line between two corners goes through.
#[derive(Debug, PartialEq)]
pub struct WallInTheWay {
    /// Number of the leg, from 1.
    leg: usize,
    from_m: [f64; 3],
    to_m: [f64; 3],
    at_m: [f64; 3],
    material: String,
}

impl fmt::Display for WallInTheWay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { leg, from_m, to_m, at_m, material } = self;
        write!(
            f,
            "leg {leg} of the walk, from {from_m:?} to {to_m:?} m, goes through `{material}` at {at_m:.2?} m"
        )
    }
}

/// A time in words.
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{s:.1} s"),
        s if s < 6000.0 => format!("{:.1} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// A polygon walked at an even speed, face forward.
pub struct Walk {
    corners_m: Vec<[f64; 3]>,
    speed_m_s: f64,
}

impl Walk {
    pub fn new(corners_m: Vec<[f64; 3]>, speed_m_s: f64) -> Result<Self, Failure> {
        if !(0.01..=20.0).contains(&speed_m_s) {
            return Err(format!("--speed is {speed_m_s}; it must be between 0.01 and 20 m/s").into());
        }
        let mut walk = Self { corners_m, speed_m_s };
        walk.corners_m.dedup();
        if walk.corners_m.len() < 2 {
            return Err("the walk needs two different corners at least".into());
        }
        Ok(walk)
    }

    /// What the walk is, in one line.
    pub fn line(&self) -> String {
        let (legs, length_m) = (self.corners_m.len() - 1, self.duration_s() * self.speed_m_s);
        let plural = if legs == 1 { "" } else { "s" };
        format!("walk: {legs} leg{plural}, {length_m:.1} m, {}", time(self.duration_s()))
    }

    /// Refuses a walk whose sound would not fit into memory.
    pub fn check_size(&self, rate_hz: u32, channels: usize) -> Result<(), Failure> {
        let samples = self.duration_s() * f64::from(rate_hz) * channels as f64;
        if samples <= MAX_SAMPLES {
            return Ok(());
        }
        let (lasts, millions) = (time(self.duration_s()), samples / 1e6);
        Err(format!(
            "the walk takes {lasts} at {} m/s: {millions:.0} million samples in {channels} channels; at most {:.0} million are \
             kept in memory: shorten it, raise --speed or lower --rate",
            self.speed_m_s,
            MAX_SAMPLES / 1e6
        )
        .into())
    }

    /// The walls on the straight lines between corners, the first of each leg.
    pub fn walls_in_the_way(&self, scene: &Scene) -> Result<Vec<WallInTheWay>, Failure> {
        let mesh = MeshScene::new(scene)?;
        let wall = |(index, leg): (usize, &[[f64; 3]])| {
            let (from_m, to_m) = (leg[0], leg[1]);
            let length_m = distance_m(from_m, to_m);
            let direction: [f64; 3] = std::array::from_fn(|i| (to_m[i] - from_m[i]) / length_m);
            let hit = mesh.closest_hit(from_m, direction, length_m)?;
            let material = scene.triangles()[hit.triangle as usize].material as usize;
            Some(WallInTheWay {
                leg: index + 1,
                from_m,
                to_m,
                at_m: std::array::from_fn(|i| from_m[i] + hit.distance * direction[i]),
                material: scene.materials()[material].name.clone(),
            })
        };
        Ok(self.corners_m.windows(2).enumerate().filter_map(wall).collect())
    }

    pub fn duration_s(&self) -> f64 {
        self.corners_m.windows(2).map(|leg| distance_m(leg[0], leg[1])).sum::<f64>() / self.speed_m_s
    }

    /// The leg of a time, and the share of it that is done.
    fn leg(&self, time_s: f64) -> ([f64; 3], [f64; 3], f64) {
        let mut left_m = time_s * self.speed_m_s;
        let last = self.corners_m.len() - 2;
        for (i, leg) in self.corners_m.windows(2).enumerate() {
            let length_m = distance_m(leg[0], leg[1]);
            if left_m <= length_m || i == last {
                return (leg[0], leg[1], (left_m / length_m).min(1.0));
            }
            left_m -= length_m;
        }
        (self.corners_m[last], self.corners_m[last + 1], 1.0)
    }

    pub fn place_m(&self, time_s: f64) -> [f64; 3] {
        let (from, to, share) = self.leg(time_s);
        std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
    }

    pub fn facing(&self, time_s: f64) -> Result<Orientation, Failure> {
        let (from, to, _) = self.leg(time_s);
        Ok(Orientation::towards(std::array::from_fn(|i| to[i] - from[i]))?)
    }
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

pub fn read_corners(path: &Path) -> Result<Vec<[f64; 3]>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    text.lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(number, line)| {
            let finite = |word: &str| word.parse().ok().filter(|number: &f64| number.is_finite());
            let numbers: Option<Vec<f64>> = line.split_whitespace().map(finite).collect();
            let corner = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
            corner.ok_or_else(|| {
                format!("{}: line {}: `{line}` is not x y z in metres", path.display(), number + 1).into()
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine::acoustics::{Bands, Material};

    fn room() -> Scene {
        let wall = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        Scene::shoebox([6.0, 5.0, 3.0], std::array::from_fn(|_| wall.clone())).unwrap()
    }

    #[test]
    fn a_wall_in_the_way_is_named_with_leg_point_and_material() {
        let corners = vec![[1.0, 1.0, 1.5], [5.0, 1.0, 1.5], [5.0, 9.0, 1.5], [5.0, 4.0, 1.5]];
        let found = Walk::new(corners, 1.0).unwrap().walls_in_the_way(&room()).unwrap();
        let at = |leg, from_m, to_m| WallInTheWay {
            leg,
            from_m,
            to_m,
            at_m: [5.0, 5.0, 1.5],
            material: "y1".into(),
        };
        let (a, b, c) = ([5.0, 1.0, 1.5], [5.0, 9.0, 1.5], [5.0, 4.0, 1.5]);
        assert_eq!(found, [at(2, a, b), at(3, b, c)]);
        assert_eq!(
            found[0].to_string(),
            "leg 2 of the walk, from [5.0, 1.0, 1.5] to [5.0, 9.0, 1.5] m, goes through `y1` at [5.00, 5.00, 1.50] m"
        );
        let free = Walk::new(vec![[1.0, 1.0, 1.5], [5.0, 1.0, 1.5], [5.0, 4.0, 1.5]], 1.0).unwrap();
        assert_eq!(free.walls_in_the_way(&room()).unwrap(), []);
    }

    #[test]
    fn a_walk_of_hours_is_refused_before_it_begins() {
        let corners = (0..4000).map(|i| [1.0 + 4.0 * f64::from(i % 2), 1.0, 1.5]).collect();
        let walk = Walk::new(corners, 1.2).unwrap();
        assert_eq!(walk.line(), "walk: 3999 legs, 15996.0 m, 3.7 h");
        let message = walk.check_size(24_000, 1).unwrap_err().to_string();
        assert!(message.contains("takes 3.7 h at 1.2 m/s: 320 million samples in 1 channels"), "{message}");
        walk.check_size(16_000, 1).unwrap();
        assert!(walk.check_size(16_000, 16).is_err());
    }
}
