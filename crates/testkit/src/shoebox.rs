//! Image sources in a box: exact for flat walls, and easy to get right.

use crate::filter::{Complement, add_pulse, join_bands};
use crate::geometry::Vec3;
use crate::own_air::{energy_exponent_per_m, speed_of_sound_m_s};
use sabine_acoustics::{Air, EnergyResponse, Error, ImpulseResponse, Observer, OutOfRange, report};
use sabine_paths::{Contribution, PathSet, Propagator, Reflection};
use sabine_scene::{Receiver, Scene, Source};
use std::fmt;

/// All image sources of a box up to a duration (Allen and Berkley 1979), each wall reflecting the share (1 - absorption)
/// (1 - scattering) of the energy like a mirror. What walls scatter is left out: set scattering to 0 for the whole truth.
#[derive(Clone, Copy, Debug)]
pub struct ShoeboxImages {
    duration_s: f64,
}

/// One image source as the receiver sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// Distance to the receiver in metres.
    pub length_m: f64,
    /// Reflections at x = low, x = high, y = low, y = high, z = low, z = high.
    pub hits: [u32; 6],
    /// Unit vector in which the path leaves the source.
    pub departure: Vec3,
    /// Unit vector from the receiver towards the image.
    pub arrival: Vec3,
}

/// Why a scene has no image sources of this kind.
#[derive(Clone, Copy, Debug, PartialEq)]
enum NotABox {
    Triangle(usize),
    TwoMaterials,
    BareFace,
    Outside,
}

impl fmt::Display for NotABox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Triangle(i) => write!(f, "triangle {i} lies in no face of an axis-parallel box"),
            Self::TwoMaterials => f.write_str("a face of the box has two materials"),
            Self::BareFace => f.write_str("a face of the box has no triangles"),
            Self::Outside => f.write_str("source or receiver is outside the box"),
        }
    }
}

impl std::error::Error for NotABox {}

/// The box behind a scene: two corners and the material of each face.
struct Box6 {
    low: Vec3,
    high: Vec3,
    materials: [u32; 6],
}

impl ShoeboxImages {
    /// Image sources up to a duration, 0.001 to 20 s.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] outside these bounds.
    pub fn new(duration_s: f64) -> Result<Self, Error> {
        if (1e-3..=20.0).contains(&duration_s) {
            Ok(Self { duration_s })
        } else {
            let range = "between 0.001 and 20 s";
            Err(OutOfRange { field: "duration (s)", value: duration_s, range }.into())
        }
    }

    /// Visits every image source within a length, in no particular order.
    fn visit(
        room: &Box6,
        source: Vec3,
        receiver: Vec3,
        max_length_m: f64,
        mut seen: impl FnMut([i32; 3], Image) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let side: Vec3 = std::array::from_fn(|k| room.high[k] - room.low[k]);
        let reach: [i32; 3] = std::array::from_fn(|k| (max_length_m / side[k]).ceil() as i32 + 1);
        // Offset of image m along an axis: even images are shifted copies, odd ones mirrored.
        let offset = |k: usize, m: i32| {
            let inside = source[k] - room.low[k];
            let mirrored = if m % 2 == 0 { inside } else { side[k] - inside };
            room.low[k] + f64::from(m) * side[k] + mirrored - receiver[k]
        };
        for i in -reach[0]..=reach[0] {
            let x = offset(0, i);
            for j in -reach[1]..=reach[1] {
                let y = offset(1, j);
                if x * x + y * y > max_length_m * max_length_m {
                    continue;
                }
                for k in -reach[2]..=reach[2] {
                    let z = offset(2, k);
                    let length_m = (x * x + y * y + z * z).sqrt();
                    if length_m > max_length_m {
                        continue;
                    }
                    let order = [i, j, k];
                    let arrival = [x, y, z].map(|c| c / length_m);
                    // The path runs against the arrival; each reflection turns one component around.
                    let departure =
                        std::array::from_fn(|a| if order[a] % 2 == 0 { -arrival[a] } else { arrival[a] });
                    let mut hits = [0; 6];
                    for (a, m) in order.into_iter().enumerate() {
                        let (more, fewer) = (m.unsigned_abs().div_ceil(2), m.unsigned_abs() / 2);
                        // An image beyond the high wall has met that wall first.
                        (hits[2 * a], hits[2 * a + 1]) = if m > 0 { (fewer, more) } else { (more, fewer) };
                    }
                    seen(order, Image { length_m, hits, departure, arrival })?;
                }
            }
        }
        Ok(())
    }

    /// Every image source up to the duration, nearest first.
    ///
    /// # Errors
    /// [`Error::Implementation`] if the scene is no axis-parallel box of one material per face, or a place is outside.
    pub fn images(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
    ) -> Result<Vec<Image>, Error> {
        let room = box_of(scene, source, receiver)?;
        let mut images = Vec::new();
        let max_length_m = self.duration_s * speed_of_sound_m_s(air);
        Self::visit(&room, source.position_m, receiver.position_m, max_length_m, |_, image| {
            images.push(image);
            Ok(())
        })?;
        images.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
        Ok(images)
    }

    /// Energy in time bins, without Monte-Carlo error. `None` for air means 20 C and no attenuation.
    ///
    /// # Errors
    /// As [`ShoeboxImages::images`]; [`Error::OutOfRange`] for a bin width that is not positive.
    pub fn energy_response(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: Option<&Air>,
        bin_s: f64,
    ) -> Result<EnergyResponse, Error> {
        let room = box_of(scene, source, receiver)?;
        let speed = speed_of_sound_m_s(air.unwrap_or(&Air::default()));
        let bands = scene.materials()[0].material.bands();
        let bins = (self.duration_s / bin_s).ceil() as usize;
        let mut energy = vec![0.0; bins * bands.len()];
        let reflected = reflectances(scene, &room, bands.len());
        let exponents: Vec<f64> = (0..bands.len())
            .map(|b| air.map_or(0.0, |air| energy_exponent_per_m(air, bands.exact_hz(b))))
            .collect();
        Self::visit(&room, source.position_m, receiver.position_m, self.duration_s * speed, |_, image| {
            let bin = (image.length_m / speed / bin_s) as usize;
            for band in 0..bands.len() {
                if bin < bins {
                    energy[band * bins + bin] += image_energy(&image, &reflected[band], exponents[band]);
                }
            }
            Ok(())
        })?;
        let none = vec![0.0; energy.len()];
        EnergyResponse::new(bands, bin_s, energy, none)
    }

    /// Pressure: every image a pulse of amplitude sqrt(energy) in each band, at its exact instant.
    ///
    /// # Errors
    /// As [`ShoeboxImages::images`]; [`Error::OutOfRange`] for a sample rate outside 1 kHz to 768 kHz.
    pub fn impulse_response(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        sample_rate_hz: u32,
    ) -> Result<ImpulseResponse, Error> {
        let room = box_of(scene, source, receiver)?;
        let speed = speed_of_sound_m_s(air);
        let bands = scene.materials()[0].material.bands();
        let reflected = reflectances(scene, &room, bands.len());
        let rate = f64::from(sample_rate_hz);
        let mut columns = vec![vec![0.0; (self.duration_s * rate).ceil() as usize]; bands.len()];
        let exponents: Vec<f64> =
            (0..bands.len()).map(|b| energy_exponent_per_m(air, bands.exact_hz(b))).collect();
        Self::visit(&room, source.position_m, receiver.position_m, self.duration_s * speed, |_, image| {
            for (band, column) in columns.iter_mut().enumerate() {
                let amplitude = image_energy(&image, &reflected[band], exponents[band]).sqrt();
                add_pulse(column, image.length_m / speed * rate, amplitude);
            }
            Ok(())
        })?;
        let samples = join_bands(bands, columns, sample_rate_hz, Complement::Amplitude);
        ImpulseResponse::new(samples.into_iter().map(|s| s as f32).collect(), sample_rate_hz)
    }
}

impl Propagator for ShoeboxImages {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, Error> {
        let room = box_of(scene, source, receiver)?;
        let max_length_m = self.duration_s * speed_of_sound_m_s(air);
        let mut paths = PathSet::new(scene.materials().len(), max_length_m);
        // Chain of every set of hits: one reflection more than that of the image one step nearer along the last axis.
        let mut chains = std::collections::HashMap::from([([0; 6], PathSet::DIRECT)]);
        Self::visit(&room, source.position_m, receiver.position_m, max_length_m, |_, image| {
            let chain = chain_of(&mut paths, &mut chains, &room.materials, image.hits);
            paths.push(Contribution {
                length_m: image.length_m,
                log_weight: -2.0 * image.length_m.ln(),
                chain,
                tail: PathSet::DIRECT,
                departure: image.departure,
                arrival: image.arrival,
                batch: None,
            });
            if paths.len().is_multiple_of(1 << 16) {
                report(observer, "image sources", paths.len() as u64, 0)?;
            }
            Ok(())
        })?;
        Ok(paths)
    }
}

fn chain_of(
    paths: &mut PathSet,
    chains: &mut std::collections::HashMap<[u32; 6], u32>,
    materials: &[u32; 6],
    hits: [u32; 6],
) -> u32 {
    let mut missing = Vec::new();
    let mut known = hits;
    let mut chain = loop {
        if let Some(&chain) = chains.get(&known) {
            break chain;
        }
        // The order of reflections has no bearing on the energy. Of the last axis the face with more hits goes first, so that
        // what remains are the hits of a nearer image.
        let axis = (0..3).rev().find(|&a| known[2 * a] + known[2 * a + 1] > 0).unwrap_or(0);
        let face = 2 * axis + usize::from(known[2 * axis + 1] >= known[2 * axis]);
        missing.push(face);
        known[face] -= 1;
    };
    for face in missing.into_iter().rev() {
        chain = paths.reflect(chain, materials[face], Reflection::Specular);
        known[face] += 1;
        chains.insert(known, chain);
    }
    chain
}

/// Logarithm of the share that each face reflects like a mirror, by band.
fn reflectances(scene: &Scene, room: &Box6, bands: usize) -> Vec<[f64; 6]> {
    let face = |band: usize, face: usize| {
        let material = &scene.materials()[room.materials[face] as usize].material;
        let (absorbed, scattered) =
            (material.absorption().values()[band], material.scattering().values()[band]);
        ((1.0 - absorbed) * (1.0 - scattered)).ln()
    };
    (0..bands).map(|band| std::array::from_fn(|f| face(band, f))).collect()
}

fn image_energy(image: &Image, log_reflected: &[f64; 6], exponent: f64) -> f64 {
    let walls: f64 =
        image.hits.iter().zip(log_reflected).filter(|(n, _)| **n > 0).map(|(&n, l)| f64::from(n) * l).sum();
    (walls - exponent * image.length_m).exp() / (image.length_m * image.length_m)
}

fn box_of(scene: &Scene, source: &Source, receiver: &Receiver) -> Result<Box6, Error> {
    find_box(scene, source, receiver).map_err(|error| Error::implementation("shoebox image sources", error))
}

fn find_box(scene: &Scene, source: &Source, receiver: &Receiver) -> Result<Box6, NotABox> {
    let vertices = scene.vertices();
    let low: Vec3 = std::array::from_fn(|k| vertices.iter().map(|v| v[k]).fold(f64::INFINITY, f64::min));
    let high: Vec3 = std::array::from_fn(|k| vertices.iter().map(|v| v[k]).fold(f64::NEG_INFINITY, f64::max));
    let mut found = [None; 6];
    for (i, triangle) in scene.triangles().iter().enumerate() {
        let corners = scene.corners_m(i);
        let lies_in = |face: usize| {
            let (axis, level) = (face / 2, if face.is_multiple_of(2) { low } else { high });
            corners.iter().all(|c| (c[axis] - level[axis]).abs() < 1e-9)
        };
        let face = (0..6).find(|&face| lies_in(face)).ok_or(NotABox::Triangle(i))?;
        if *found[face].get_or_insert(triangle.material) != triangle.material {
            return Err(NotABox::TwoMaterials);
        }
    }
    let mut materials = [0; 6];
    for (material, found) in materials.iter_mut().zip(found) {
        *material = found.ok_or(NotABox::BareFace)?;
    }
    let inside = |p: Vec3| (0..3).all(|k| p[k] > low[k] && p[k] < high[k]);
    if inside(source.position_m) && inside(receiver.position_m) {
        Ok(Box6 { low, high, materials })
    } else {
        Err(NotABox::Outside)
    }
}
