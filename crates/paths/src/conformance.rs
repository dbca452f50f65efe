//! What any tracer must get right, as checks that its author can run.

use crate::conditions::Conditions;
use crate::path_set::{PathSet, Reflection};
use crate::propagator::Propagator;
use sabine_acoustics::{Air, Bands, Error, Material};
use sabine_scene::{Receiver, Scene, Source};
use std::f64::consts::{LN_10, PI};
use std::fmt;
use std::ops::ControlFlow;

/// Sides of the room in metres: no side is a multiple of another, and it is near enough to a cube to mix.
const ROOM_M: [f64; 3] = [5.3, 4.1, 3.2];
/// Sound is followed for so long, in metres, at least: the room's decay falls by 30 dB within half of it.
const MIN_LENGTH_M: f64 = 60.0;
/// Relative variance of the free paths in a rectangular room that scatters diffusely (Kuttruff, 5.4).
const PATH_VARIANCE: f64 = 0.4;
/// Share of energy that every surface absorbs.
const ABSORPTION: f64 = 0.3;
const SOURCE_M: [f64; 3] = [1.1, 0.9, 1.0];
const RECEIVER_M: [f64; 3] = [3.4, 2.6, 1.9];

/// One property that was checked.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Check {
    /// The property: "direct sound", "reciprocity", ...
    pub name: &'static str,
    /// What was compared.
    pub what: String,
    /// What the tracer gives.
    pub found: f64,
    /// What physics gives.
    pub expected: f64,
    /// Largest difference that is accepted: rounding, Monte-Carlo error or the error of the theory.
    pub tolerance: f64,
}

impl Check {
    /// Whether the difference is within the tolerance.
    pub fn passed(&self) -> bool {
        (self.found - self.expected).abs() <= self.tolerance
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = if self.passed() { "ok" } else { "FAILED" };
        let Self { name, what, found, expected, tolerance } = self;
        write!(f, "{verdict:6} {name}: {what}: {found:.4}, expected {expected:.4} within {tolerance:.4}")
    }
}

/// Traces a cuboid room and checks what does not depend on how a tracer works:
///
/// - **direct sound**: one path of the distance's length and of weight 1/d2, with the right directions, at three distances;
/// - **first reflections**: the six mirror images of a room without scattering, their lengths and weights by the law of images;
/// - **energy**: with `scatters`, the decay of a room that scatters everything within 5 % of Eyring's formula with Kuttruff's correction
///   for the spread of free paths, a'' = -ln(1 - a) (1 + g ln(1 - a) / 2) with g = 0.4 (Room Acoustics, 5.4), and all its sound within 10 %
///   of direct and diffuse sound, 1 / d2 + 16 pi (1 - a) / (S a'');
/// - **reciprocity**: source and receiver exchanged, the same energy within five standard errors and 1 %;
/// - **seed**: the same call gives the same paths;
/// - **stop**: an observer that asks to stop gets [`Error::Cancelled`].
///
/// A tracer whose settings follow sound for less than 60 m is checked for what comes before. `scatters` is false for
/// tracers of mirror reflections alone. Each check is returned, passed or not; print them, and assert that all passed:
///
/// ```no_run
/// # fn check(my_tracer: &dyn sabine_paths::Propagator) -> Result<(), sabine_acoustics::Error> {
/// let checks = sabine_paths::conformance::check(my_tracer, true)?;
/// checks.iter().for_each(|check| println!("{check}"));
/// assert!(checks.iter().all(|check| check.passed()));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Those of the tracer.
pub fn check(tracer: &dyn Propagator, scatters: bool) -> Result<Vec<Check>, Error> {
    let mut checks = Vec::new();
    let mirrors = Room::new(0.0)?;
    mirrors.direct_sound(tracer, &mut checks)?;
    mirrors.first_reflections(tracer, &mut checks)?;
    let other = if scatters { Room::new(1.0)? } else { mirrors };
    if scatters {
        other.diffuse_field(tracer, &mut checks)?;
    }
    other.reciprocity(tracer, &mut checks)?;
    other.same_again(tracer, &mut checks)?;
    other.stop(tracer, &mut checks)?;
    Ok(checks)
}

struct Room {
    scene: Scene,
    materials: [Material; 6],
    air: Air,
}

impl Room {
    fn new(scattering: f64) -> Result<Self, Error> {
        let bands = Bands::octaves(250.0, 250.0)?;
        let material = Material::uniform(bands, ABSORPTION, scattering)?;
        let scene = Scene::shoebox(ROOM_M, std::array::from_fn(|_| material.clone()))?;
        Ok(Self { scene, materials: std::array::from_fn(|_| material.clone()), air: Air::default() })
    }

    fn trace(
        &self,
        tracer: &dyn Propagator,
        source_m: [f64; 3],
        receiver_m: [f64; 3],
    ) -> Result<PathSet, Error> {
        let (source, receiver) = (Source::omni("source", source_m)?, Receiver::omni("receiver", receiver_m)?);
        tracer.trace(&self.scene, &source, &receiver, &self.air, &())
    }

    fn direct_sound(&self, tracer: &dyn Propagator, checks: &mut Vec<Check>) -> Result<(), Error> {
        for receiver_m in [[2.0, 1.2, 1.1], RECEIVER_M, [4.6, 3.5, 2.7]] {
            let source_m = SOURCE_M;
            let distance_m = distance(source_m, receiver_m);
            let paths = self.trace(tracer, source_m, receiver_m)?;
            let direct: Vec<usize> = (0..paths.len()).filter(|&i| paths.is_direct(i)).collect();
            let mut add = |what: &str, found: f64, expected: f64, tolerance: f64| {
                let what = format!("{what} at {distance_m:.2} m");
                checks.push(Check { name: "direct sound", what, found, expected, tolerance });
            };
            add("number of direct paths", direct.len() as f64, 1.0, 0.0);
            let Some(&path) = direct.first() else { continue };
            add("length in metres", f64::from(paths.lengths_m()[path]), distance_m, 1e-3);
            let weight = f64::from(paths.log_weights()[path]).exp() * distance_m * distance_m;
            add("weight times squared distance", weight, 1.0, 1e-3);
            for (name, direction, towards) in [
                ("departure", paths.departure(path), sub(receiver_m, source_m)),
                ("arrival", paths.arrival(path), sub(source_m, receiver_m)),
            ] {
                let cosine = dot(direction, towards) / distance_m;
                add(&format!("cosine between {name} and line of sight"), cosine, 1.0, 1e-4);
            }
        }
        Ok(())
    }

    /// Sums over all paths of one mirror reflection: exact tracers have six, sampling ones many that add up to them.
    fn first_reflections(&self, tracer: &dyn Propagator, checks: &mut Vec<Check>) -> Result<(), Error> {
        let (source_m, receiver_m) = (SOURCE_M, RECEIVER_M);
        let paths = self.trace(tracer, source_m, receiver_m)?;
        let images = (0..3).flat_map(|axis| {
            [0.0, ROOM_M[axis]].map(|wall| {
                let mut image = source_m;
                image[axis] = 2.0 * wall - image[axis];
                distance(image, receiver_m)
            })
        });
        let expected: Vec<f64> = images.map(|length_m| length_m.powi(-2)).collect();
        let single = |path: &usize| {
            let hits = |chain: u32| match paths.last_reflection(chain) {
                None => Some(0),
                Some((PathSet::DIRECT, _, Reflection::Specular)) => Some(1),
                Some(_) => None,
            };
            matches!(
                (hits(paths.chains()[*path]), hits(paths.tails()[*path])),
                (Some(1), Some(0)) | (Some(0), Some(1))
            ) && paths.diffractions().iter().all(|(index, _)| index != path)
        };
        let found: Vec<usize> = (0..paths.len()).filter(single).collect();
        let weight = |path: &usize| f64::from(paths.log_weights()[*path]).exp();
        let sum: f64 = expected.iter().sum();
        let exact = found.iter().all(|&path| paths.is_exact(path));
        checks.push(Check {
            name: "first reflections",
            what: "sum of the weights of six images (1/m2)".into(),
            found: found.iter().map(weight).sum(),
            expected: sum,
            tolerance: if exact { 1e-3 * sum } else { 0.05 * sum },
        });
        Ok(())
    }

    fn diffuse_field(&self, tracer: &dyn Propagator, checks: &mut Vec<Check>) -> Result<(), Error> {
        let (source_m, receiver_m) = (SOURCE_M, RECEIVER_M);
        let paths = self.trace(tracer, source_m, receiver_m)?;
        if paths.max_length_m() < MIN_LENGTH_M {
            return Ok(());
        }
        let energy = paths.energy_response(&Conditions::new(&self.materials, &self.air), 1e-3)?;
        let bands = self.materials[0].bands();
        let log_reflected = (1.0 - ABSORPTION).ln();
        let exponent = -log_reflected * (1.0 + 0.5 * PATH_VARIANCE * log_reflected);
        // The air takes little at 250 Hz: its share is added to that of the walls.
        let in_air = 4.0 * self.scene.volume_m3() * self.air.energy_exponent_per_m(bands).values()[0];
        let area_m2 = self.scene.surface_m2() * exponent + in_air;
        let direct = distance(source_m, receiver_m).powi(-2);
        let expected = direct + 16.0 * PI * (1.0 - ABSORPTION) / area_m2;
        checks.push(Check {
            name: "energy",
            what: "all sound, relative to the direct sound at 1 m".into(),
            found: energy.band(0).iter().sum(),
            expected,
            tolerance: 0.1 * expected,
        });
        let t60_s = 24.0 * LN_10 * self.scene.volume_m3() / (self.air.speed_of_sound_m_s() * area_m2);
        checks.push(Check {
            name: "energy",
            what: "T20 in seconds, rooms that scatter everything".into(),
            found: energy.decay_curve(0).decay_time_s(-5.0, -25.0).unwrap_or(f64::NAN),
            expected: t60_s,
            tolerance: 0.05 * t60_s,
        });
        Ok(())
    }

    fn reciprocity(&self, tracer: &dyn Propagator, checks: &mut Vec<Check>) -> Result<(), Error> {
        let total = |from, to| -> Result<(f64, f64), Error> {
            let paths = self.trace(tracer, from, to)?;
            let response = paths.energy_response(&Conditions::new(&self.materials, &self.air), 1.0)?;
            let variance: f64 = response.band_standard_error(0).iter().map(|error| error * error).sum();
            Ok((response.band(0).iter().sum(), variance))
        };
        let ((forth, a), (back, b)) = (total(SOURCE_M, RECEIVER_M)?, total(RECEIVER_M, SOURCE_M)?);
        checks.push(Check {
            name: "reciprocity",
            what: "energy with source and receiver exchanged".into(),
            found: back,
            expected: forth,
            tolerance: 5.0 * (a + b).sqrt() + 0.01 * forth,
        });
        Ok(())
    }

    fn same_again(&self, tracer: &dyn Propagator, checks: &mut Vec<Check>) -> Result<(), Error> {
        let (source_m, receiver_m) = (SOURCE_M, RECEIVER_M);
        let same = self.trace(tracer, source_m, receiver_m)? == self.trace(tracer, source_m, receiver_m)?;
        checks.push(Check {
            name: "seed",
            what: "the same call twice gives the same paths (1: yes)".into(),
            found: f64::from(u8::from(same)),
            expected: 1.0,
            tolerance: 0.0,
        });
        Ok(())
    }

    fn stop(&self, tracer: &dyn Propagator, checks: &mut Vec<Check>) -> Result<(), Error> {
        let (source, receiver) = (Source::omni("source", SOURCE_M)?, Receiver::omni("receiver", RECEIVER_M)?);
        let asked = std::sync::atomic::AtomicBool::new(false);
        let observer = |_: &str, _: u64, _: u64| -> ControlFlow<()> {
            asked.store(true, std::sync::atomic::Ordering::Relaxed);
            ControlFlow::Break(())
        };
        let stopped = match tracer.trace(&self.scene, &source, &receiver, &self.air, &observer) {
            Err(Error::Cancelled { .. }) => true,
            Err(error) => return Err(error),
            // Work so short that nobody is told need not stop.
            Ok(_) => !asked.into_inner(),
        };
        checks.push(Check {
            name: "stop",
            what: "an observer that asks to stop is heard (1: yes)".into(),
            found: f64::from(u8::from(stopped)),
            expected: 1.0,
            tolerance: 0.0,
        });
        Ok(())
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = sub(a, b);
    dot(d, d).sqrt()
}
