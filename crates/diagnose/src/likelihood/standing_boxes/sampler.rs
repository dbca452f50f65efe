//! Boxes drawn from what is known of furniture to what the early sound says: a sequential Monte-Carlo sampler.
//!
//! A few thousand boxes are drawn from the prior. The data then count more and more, first with wide reflections, which lead to the narrow
//! ones: at each step boxes are weighed, drawn anew by their weights, and moved by Markov chains that leave the present distribution as it is.
//! The product of the mean weights is the evidence, every parameter integrated out (P. Del Moral, A. Doucet, A. Jasra, Sequential Monte Carlo
//! samplers, J. R. Statist. Soc. B 68, 2006).

use super::EarlySound;
use crate::extend::standing_box::{Solid, StandingBox};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Boxes drawn from the prior, and boxes that go on.
const FIRST: usize = 6000;
const PARTICLES: usize = 1000;
/// Share of the boxes that a step may leave alive, as an effective number.
const ALIVE: f64 = 0.4;
/// What reflections are wide by more than they are, in seconds: while the data come to count, and then step by step.
const WIDTHS_S: [f64; 7] = [4e-4, 2.5e-4, 1.6e-4, 1e-4, 6e-5, 3e-5, 0.0];
/// Moves of each box after each step.
const MOVES: usize = 5;
/// Most steps in which the data come to count.
const MAX_STEPS: usize = 40;
/// Places that are tried for a box.
const TRIES: usize = 60;
/// Sides of furniture: medians in metres (length and width alike, height), spread of their logarithms, and limits.
const SIDE_M: f64 = 1.0;
const HEIGHT_M: f64 = 1.0;
const SIDES_LN_SD: f64 = 0.5;
const LIMITS_M: (f64, f64) = (0.25, 4.0);
/// Share of furniture that stands along a wall's direction.
const ALONG_WALLS: f64 = 0.8;
/// What is left of a reflection at a face: mean, spread and limits, in dB.
const REFLECTANCE_DB: (f64, f64) = (-2.0, 1.5);
const REFLECTANCE_LIMITS_DB: (f64, f64) = (-12.0, -0.02);
/// Sources and receivers are no nearer to a box than this, in metres.
const CLEAR_M: f64 = 0.1;
/// Longest and shortest step of a move, in metres.
const STEPS_M: (f64, f64) = (0.005, 0.5);

/// A box that is tried.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tried {
    base: [f64; 3],
    sides: [f64; 3],
    yaw_deg: f64,
    is_along: bool,
    reflectance_db: f64,
    /// Logarithm of how much more probable the data are with it, at the present width.
    nats: f64,
}

/// Boxes drawn from the posterior, and the evidence.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub boxes: Vec<Tried>,
    /// Logarithm of how much more probable the data are with a box than without, whatever box it is.
    pub nats: f64,
}

impl Tried {
    /// The box, its length not less than its width, turned by -90 to 90 degrees.
    pub fn standing_box(&self) -> StandingBox {
        let [a, b, height] = self.sides;
        let (length, width, yaw) = if a >= b { (a, b, self.yaw_deg) } else { (b, a, self.yaw_deg + 90.0) };
        let yaw = (yaw + 90.0).rem_euclid(180.0) - 90.0;
        let absorption = 1.0 - 10f64.powf(0.1 * self.reflectance_db);
        StandingBox::new(self.base, [length, width, height], yaw, absorption)
    }

    /// Logarithm of the prior density, but for a constant, plus that of the data.
    fn posterior(&self) -> f64 {
        self.nats + self.ln_prior()
    }

    fn ln_prior(&self) -> f64 {
        let side = |side: f64, median: f64| -> f64 {
            let z = (side / median).ln() / SIDES_LN_SD;
            -0.5 * z * z - side.ln()
        };
        let z = (self.reflectance_db - REFLECTANCE_DB.0) / REFLECTANCE_DB.1;
        side(self.sides[0], SIDE_M) + side(self.sides[1], SIDE_M) + side(self.sides[2], HEIGHT_M)
            - 0.5 * z * z
    }

    fn solid(&self) -> Solid {
        Solid::of(&StandingBox::new(self.base, self.sides, self.yaw_deg, 0.0))
    }
}

/// The box with the highest posterior density.
pub(crate) fn best(sample: &Sample) -> Option<&Tried> {
    sample.boxes.iter().max_by(|a, b| a.posterior().total_cmp(&b.posterior()))
}

/// Draws boxes given the responses that count (a flag for each). None where no box can stand. Same seed, same boxes.
pub(crate) fn draw(early: &EarlySound, used: &[bool], seed: u64) -> Option<Sample> {
    if early.floor.is_empty() {
        return None;
    }
    let sampler = Sampler { early, used, seed };
    let mut boxes: Vec<Tried> = (0..FIRST).into_par_iter().filter_map(|index| sampler.first(index)).collect();
    if boxes.len() < FIRST / 2 {
        return None;
    }
    let (mut nats, mut counts, mut step) = (0.0, 0.0, 0u64);
    while counts < 1.0 && step < MAX_STEPS as u64 {
        let least = if step == 0 { ALIVE * PARTICLES as f64 } else { ALIVE * boxes.len() as f64 };
        let next = next_count(&boxes, counts, least);
        let next = if step + 1 == MAX_STEPS as u64 { 1.0 } else { next };
        let gains: Vec<f64> = boxes.iter().map(|b| (next - counts) * b.nats).collect();
        counts = next;
        nats += sampler.resample(&mut boxes, &gains, step);
        sampler.move_all(&mut boxes, (counts, WIDTHS_S[0]), step);
        step += 1;
    }
    for &width_s in &WIDTHS_S[1..] {
        let before: Vec<f64> = boxes.iter().map(|b| b.nats).collect();
        boxes.par_iter_mut().for_each(|b| b.nats = sampler.nats(b, width_s));
        let gains: Vec<f64> = boxes.iter().zip(before).map(|(b, before)| b.nats - before).collect();
        nats += sampler.resample(&mut boxes, &gains, step);
        sampler.move_all(&mut boxes, (1.0, width_s), step);
        step += 1;
    }
    Some(Sample { boxes, nats })
}

/// How much the data may count next so that an effective number of boxes stays alive.
fn next_count(boxes: &[Tried], counts: f64, least: f64) -> f64 {
    let alive = |next: f64| {
        let gains: Vec<f64> = boxes.iter().map(|b| (next - counts) * b.nats).collect();
        let most = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights = gains.iter().map(|g| (g - most).exp());
        let (sum, squares) = weights.fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
        sum * sum / squares
    };
    if alive(1.0) >= least {
        return 1.0;
    }
    let (mut low, mut high) = (counts, 1.0);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if alive(middle) >= least { low = middle } else { high = middle }
    }
    // No step is too small to be one.
    low.max(counts + 1e-3).min(1.0)
}

struct Sampler<'a> {
    early: &'a EarlySound,
    used: &'a [bool],
    seed: u64,
}

impl Sampler<'_> {
    fn random(&self, step: u64, index: usize) -> Pcg64Mcg {
        // Streams of neighbours must not be alike (the finaliser of SplitMix64; Steele, Lea, Flood 2014).
        let mut key = self.seed ^ (step << 40) ^ ((index as u64 + 1) << 8);
        for multiplier in [0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb] {
            key = (key ^ (key >> 30)).wrapping_mul(multiplier);
        }
        Pcg64Mcg::seed_from_u64(key ^ (key >> 31))
    }

    fn nats(&self, tried: &Tried, width_s: f64) -> f64 {
        let solid = tried.solid();
        (0..self.used.len())
            .filter(|&r| self.used[r])
            .map(|r| self.early.gain(r, &solid, tried.reflectance_db, width_s))
            .sum()
    }

    /// A box from the prior, weighed; none where none was found.
    fn first(&self, index: usize) -> Option<Tried> {
        let mut random = self.random(u64::MAX >> 24, index);
        let [low, high] = self.early.box_m;
        for _ in 0..TRIES {
            let mut side = |median: f64| loop {
                let drawn = median * (SIDES_LN_SD * random.sample::<f64, _>(StandardNormal)).exp();
                if (LIMITS_M.0..LIMITS_M.1).contains(&drawn) {
                    return drawn;
                }
            };
            let sides = [side(SIDE_M), side(SIDE_M), side(HEIGHT_M)];
            let [x, y] = [0, 1].map(|k| low[k] + (high[k] - low[k]) * random.random::<f64>());
            let reflectance_db = loop {
                let drawn = REFLECTANCE_DB.0 + REFLECTANCE_DB.1 * random.sample::<f64, _>(StandardNormal);
                if (REFLECTANCE_LIMITS_DB.0..REFLECTANCE_LIMITS_DB.1).contains(&drawn) {
                    break drawn;
                }
            };
            let (yaw_deg, is_along) = self.yaw(&mut random);
            let mut tried = Tried { base: [x, y, 0.0], sides, yaw_deg, is_along, reflectance_db, nats: 0.0 };
            if self.stands(&mut tried) {
                tried.nats = self.nats(&tried, WIDTHS_S[0]);
                return Some(tried);
            }
        }
        None
    }

    /// An angle from the prior, and whether it is that of a wall.
    fn yaw(&self, random: &mut Pcg64Mcg) -> (f64, bool) {
        let walls = &self.early.walls_deg;
        if !walls.is_empty() && random.random::<f64>() < ALONG_WALLS {
            let which = ((random.random::<f64>() * walls.len() as f64) as usize).min(walls.len() - 1);
            return (walls[which], true);
        }
        (90.0 * random.random::<f64>(), false)
    }

    /// Puts a box on the floor; false where it has no room.
    fn stands(&self, tried: &mut Tried) -> bool {
        let Some(floor_m) = self.early.floor.floor_m([tried.base[0], tried.base[1]]) else { return false };
        tried.base[2] = floor_m;
        let solid = tried.solid();
        tried.sides.iter().all(|side| (LIMITS_M.0..LIMITS_M.1).contains(side))
            && (REFLECTANCE_LIMITS_DB.0..REFLECTANCE_LIMITS_DB.1).contains(&tried.reflectance_db)
            && self.early.places_m.iter().all(|place| !solid.holds(*place, CLEAR_M))
            && self.early.floor.has_room_for(&solid)
    }

    /// Draws boxes by their weights (systematically) and gives the logarithm of the mean weight.
    fn resample(&self, boxes: &mut Vec<Tried>, gains: &[f64], step: u64) -> f64 {
        let most = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = gains.iter().map(|g| (g - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let offset: f64 = self.random(step, usize::MAX >> 16).random();
        let mut drawn = Vec::with_capacity(PARTICLES);
        let (mut index, mut until) = (0, weights[0]);
        for i in 0..PARTICLES {
            let at = (i as f64 + offset) / PARTICLES as f64 * sum;
            while at > until && index + 1 < weights.len() {
                index += 1;
                until += weights[index];
            }
            drawn.push(boxes[index]);
        }
        let nats = most + (sum / weights.len() as f64).ln();
        *boxes = drawn;
        nats
    }

    /// Moves every box by Metropolis's rule under the prior and the data that count so much, with reflections so wide.
    fn move_all(&self, boxes: &mut [Tried], (counts, width_s): (f64, f64), step: u64) {
        boxes.par_iter_mut().enumerate().for_each(|(index, tried)| {
            let mut random = self.random((step << 1) | (1 << 20), index);
            for _ in 0..MOVES {
                let mut next = self.proposed(tried, &mut random);
                if !self.stands(&mut next) {
                    continue;
                }
                next.nats = self.nats(&next, width_s);
                let ln = counts * (next.nats - tried.nats) + next.ln_prior() - tried.ln_prior();
                if random.random::<f64>().ln() < ln {
                    *tried = next;
                }
            }
        });
    }

    /// A box near another, proposed as often from there as back.
    fn proposed(&self, tried: &Tried, random: &mut Pcg64Mcg) -> Tried {
        let mut next = *tried;
        let step = STEPS_M.0 * (STEPS_M.1 / STEPS_M.0).powf(random.random::<f64>());
        let by: f64 = step * random.sample::<f64, _>(StandardNormal);
        let (sin, cos) = tried.yaw_deg.to_radians().sin_cos();
        let axes = [[cos, sin], [-sin, cos]];
        let axis = usize::from(random.random::<bool>());
        let mut shift = |by: f64| (0..2).for_each(|k| next.base[k] += by * axes[axis][k]);
        match (random.random::<f64>() * 10.0) as usize {
            // The whole box, along one of its sides.
            0..=2 => shift(by),
            // One face alone.
            3..=6 => {
                shift(if random.random::<bool>() { 0.5 * by } else { -0.5 * by });
                next.sides[axis] += by;
            }
            7 => next.sides[2] += by,
            8 => next.reflectance_db += random.sample::<f64, _>(StandardNormal),
            // Another angle from the prior, or, of those along no wall, one nearby.
            _ if random.random::<bool>() => (next.yaw_deg, next.is_along) = self.yaw(random),
            _ if !tried.is_along => next.yaw_deg += 10.0 * by,
            _ => shift(by),
        }
        next
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::likelihood::arrivals::peak_partners::{PeakPartners, TimeAxis};
    use crate::likelihood::reflection_gates::{AttenuatedGate, STEPS_DB};
    use crate::likelihood::standing_boxes::floor_map::FloorMap;
    use crate::likelihood::standing_boxes::mirror_ways::{Mirror, MirrorWay};
    use crate::likelihood::standing_boxes::{DirectLevel, EarlyResponse, GatedPath};
    use sabine_acoustics::{Bands, Material};
    use sabine_propagate::MeshScene;
    use sabine_scene::Scene;

    const SPEED_M_S: f64 = 343.0;

    /// A bare room with one source and ten receivers, each with twelve peaks at random; where a box stands, with its reflections among them and
    /// with what it hides of the direct sound and of the floor's reflections.
    fn early_sound(hidden: Option<&StandingBox>) -> EarlySound {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let room = Scene::shoebox([6.0, 5.0, 2.8], std::array::from_fn(|_| hard.clone())).unwrap();
        let mesh = MeshScene::new(&room).unwrap();
        let box_m = room.bounds_m();
        let floor = FloorMap::of(&mesh, box_m);
        let planes =
            [([0.0; 3], [0.0, 0.0, 1.0]), ([0.0, 0.0, 2.8], [0.0, 0.0, 1.0]), ([0.0; 3], [0.0, 1.0, 0.0])];
        let mirrors = planes.map(|(point_m, normal)| Mirror { point_m, normal, level_db: -1.0 });
        let source = [1.2, 1.4, 1.5];
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let solid = hidden.map(Solid::of);
        let mut places_m = vec![source];
        while places_m.len() < 11 {
            let sides: [f64; 3] = [6.0, 5.0, 0.8];
            let place: [f64; 3] =
                std::array::from_fn(|k| 0.15 * sides[k] + 0.7 * sides[k] * random.random::<f64>());
            let place = [place[0], place[1], 0.9 + place[2]];
            if solid.is_none_or(|s| !s.holds(place, 0.4)) {
                places_m.push(place);
            }
        }
        let responses = places_m[1..]
            .iter()
            .map(|&receiver| {
                let ends_m = [source, receiver];
                let ways = MirrorWay::all(ends_m, &mirrors, 16.0);
                let mut peaks: Vec<PeakPartners> = Vec::new();
                let mut peak = |time_s: f64, height_db: f64| {
                    peaks.push(PeakPartners { time_s, height_db, partners: Vec::new(), other: 10.0 });
                };
                for _ in 0..12 {
                    peak(0.045 * random.random::<f64>(), -20.0 * random.random::<f64>());
                }
                let is_hidden = |a: [f64; 3], b: [f64; 3]| solid.is_some_and(|s| s.crossed(a, b).is_some());
                if let Some(solid) = &solid {
                    for way in &ways {
                        way.reflected(solid, &mesh, |r| peak(r.length_m / SPEED_M_S, r.level_db - 2.0));
                    }
                }
                let share = source[2] / (source[2] + receiver[2]);
                let foot: [f64; 3] = [
                    source[0] + share * (receiver[0] - source[0]),
                    source[1] + share * (receiver[1] - source[1]),
                    0.0,
                ];
                let gone = is_hidden(source, foot) || is_hidden(foot, receiver);
                let nats = STEPS_DB.map(|db| if gone { 0.1 * db } else { -0.2 * db });
                let gate = AttenuatedGate { reflection: 0, plane: Some(0), nats };
                let beside_db = if is_hidden(source, receiver) { -16.0 } else { 0.3 };
                EarlyResponse {
                    ends_m,
                    direct: Some(DirectLevel { beside_db, sd_db: 1.5 }),
                    gates: vec![GatedPath { stops_m: vec![source, foot, receiver], gate }],
                    paths: Vec::new(),
                    peaks,
                    axis: TimeAxis {
                        zero_s: 0.0,
                        per_m_s: 1.0 / SPEED_M_S,
                        source_s: [0.0; 3],
                        receiver_s: [0.0; 3],
                    },
                    height_lacks_db: 0.0,
                    ways,
                }
            })
            .collect();
        EarlySound::new(responses, Box::new(mesh), floor, box_m, (vec![0.0], places_m), 0.12)
    }

    #[test]
    fn a_box_is_found_where_it_stands_and_none_where_none_does() {
        let hidden = StandingBox::new([3.4, 2.6, 0.0], [1.8, 0.7, 1.4], 0.0, 0.4);
        let early = early_sound(Some(&hidden));
        let found = draw(&early, &[true; 10], 1).unwrap();
        // No better box is known than the true one, and so many numbers cost what is left of it.
        let truly: f64 = (0..10).map(|r| early.gain(r, &Solid::of(&hidden), -2.0, 0.0)).sum();
        let most = best(&found).unwrap();
        assert!(most.nats > truly - 2.0, "{} {truly}", most.nats);
        assert!(found.nats > 6.0 && found.nats < most.nats, "{}", found.nats);
        let most = most.standing_box();
        // How long it is hardly any reflection says: its middle is known to half of that.
        let off = [0, 1].map(|k| most.base_m[k] - hidden.base_m[k]);
        assert!(off[0].hypot(off[1]) < 0.5, "{most:?}");
        assert!((most.sides_m[2] - 1.4).abs() < 0.1, "{most:?}");
        // Whoever asks again, and on however many threads, gets the same.
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = alone.install(|| draw(&early, &[true; 10], 1)).unwrap();
        assert_eq!(again.nats, found.nats);
        assert_eq!(best(&again).unwrap().standing_box(), most);
        let nothing = draw(&early_sound(None), &[true; 10], 1).unwrap();
        assert!(nothing.nats < 3.0, "{}", nothing.nats);
    }

    /// Without data the boxes are those of the prior, and the evidence is none.
    #[test]
    fn without_data_boxes_are_those_of_the_prior() {
        let early = early_sound(None);
        let found = draw(&early, &[false; 10], 3).unwrap();
        assert!(found.nats.abs() < 1e-9);
        let along = found.boxes.iter().filter(|b| b.is_along).count() as f64 / found.boxes.len() as f64;
        // Those along the walls, four of five; by the binomial within four standard deviations of a thousand draws, and a room that favours none.
        assert!((along - ALONG_WALLS).abs() < 0.06, "{along}");
        for tried in &found.boxes {
            let solid = tried.solid();
            assert!(early.floor.has_room_for(&solid));
            assert!(early.places_m.iter().all(|place| !solid.holds(*place, CLEAR_M)));
        }
    }
}
