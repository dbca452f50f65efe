//! The room as it really is.

use super::fog;
use super::hidden::Hidden;
use crate::own_air::{energy_exponent_per_m, speed_of_sound_m_s};
use sabine_acoustics::{Air, Bands, Error, write_atomically};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

/// All that decides the responses. Lists per band begin with the lowest octave; responses are counted source by source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Seed of the laboratory.
    pub seed: u64,
    /// Whether reflections keep the sign of the sound.
    #[serde(default)]
    pub positive_reflections: bool,
    /// Nominal centres of the octaves in Hz.
    pub bands_hz: Vec<f64>,
    /// Length, width and height in metres, one corner at the origin of all coordinates here.
    pub size_m: [f64; 3],
    /// Where that corner is in the coordinates of the declared room, in metres: elsewhere than at its origin where a face was displaced.
    #[serde(default)]
    pub origin_m: [f64; 3],
    /// Material of each face: x = 0, x = length, y = 0, y = width, floor, ceiling.
    pub faces: [usize; 6],
    /// Temperature in degrees Celsius.
    pub temperature_c: f64,
    /// Relative humidity in percent.
    pub relative_humidity_percent: f64,
    /// Pressure in kPa.
    pub pressure_kpa: f64,
    /// Receivers in metres.
    pub receivers_m: Vec<[f64; 3]>,
    /// The microphone of each receiver.
    pub microphones: Vec<TrueMicrophone>,
    /// Gain of each octave in dB, whatever the path.
    pub source_gains_db: Vec<f64>,
    /// Samples taken too many, in parts per million.
    pub clock_ppm: f64,
    /// Length of the responses in seconds.
    pub duration_s: f64,
    /// Latency of each response in seconds.
    pub latencies_s: Vec<f64>,
    /// Gain of each response in dB.
    pub gains_db: Vec<f64>,
    /// Gain of each response's channel in each octave, in dB.
    pub channel_gains_db: Vec<Vec<f64>>,
    /// Whether each response is turned over.
    pub inverted: Vec<bool>,
    /// When each response is recorded: places in the order of recording, from 0.
    #[serde(default)]
    pub recorded_at: Vec<f64>,
    /// Materials, in the order of the scene.
    pub materials: Vec<TrueMaterial>,
    /// Sources.
    pub sources: Vec<TrueSource>,
    /// Sessions, the first being that of the stated air.
    pub sessions: Vec<TrueSession>,
    /// The hidden effects, in the order in which they were asked for.
    pub effects: Vec<Hidden>,
}

/// The air of a session, as it differs from that of the first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueSession {
    /// Kelvin.
    pub warmer_k: f64,
    /// Percent of relative humidity.
    pub damper_percent: f64,
}

/// A surface as it really is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueMaterial {
    /// Name in the mesh.
    pub name: String,
    /// Absorption of each octave.
    pub absorption: Vec<f64>,
    /// Scattering of each octave.
    pub scattering: Vec<f64>,
}

/// A source as it really is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueSource {
    /// Position in metres.
    pub position_m: [f64; 3],
    /// Unit vector along the axis.
    pub axis: [f64; 3],
    /// Omnidirectional share of each octave.
    pub omni_share: Vec<f64>,
}

/// A microphone as it really is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueMicrophone {
    /// Unit vector in which it looks.
    pub axis: [f64; 3],
    /// Omnidirectional share of each octave.
    pub omni_share: Vec<f64>,
}

/// Gain of the pressure by the cosine of the angle to the axis; its mean square over the sphere is 1.
fn first_order(q: f64, cosine: f64) -> f64 {
    (q + (1.0 - q) * cosine) / (q * q + (1.0 - q).powi(2) / 3.0).sqrt()
}

impl TrueSource {
    /// Gain of the pressure in a band, by the cosine of the angle to the axis; its mean square over the sphere is 1.
    pub(crate) fn gain(&self, band: usize, cosine: f64) -> f64 {
        first_order(self.omni_share[band], cosine)
    }
}

impl TrueMicrophone {
    /// Gain of the pressure in a band, by the cosine of the angle between the axis and where sound comes from; its mean square over the
    /// sphere is 1.
    pub(crate) fn gain(&self, band: usize, cosine: f64) -> f64 {
        first_order(self.omni_share[band], cosine)
    }
}

impl Truth {
    /// Reads what [`Laboratory::write`](crate::Laboratory::write) wrote.
    ///
    /// # Errors
    /// [`Error::Io`] and [`sabine_scene::Error::Toml`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, sabine_scene::Error> {
        let path = path.as_ref();
        let text =
            std::fs::read_to_string(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
        toml::from_str(&text).map_err(|source| sabine_scene::Error::toml(path, &text, source))
    }

    pub(crate) fn write(&self, path: &Path) -> Result<(), Error> {
        let text = toml::to_string(self).map_err(|error| Error::implementation("the truth's file", error))?;
        write_atomically(path, |file| file.write_all(text.as_bytes()))
    }

    /// The bands.
    ///
    /// # Errors
    /// As [`Bands::from_centres_hz`].
    pub fn bands(&self) -> Result<Bands, Error> {
        Bands::from_centres_hz(&self.bands_hz)
    }

    /// The air.
    ///
    /// # Errors
    /// As [`Air::new`].
    pub fn air(&self) -> Result<Air, Error> {
        Air::new(self.temperature_c, self.relative_humidity_percent, self.pressure_kpa)
    }

    /// Session of a receiver.
    pub fn session(&self, receiver: usize) -> usize {
        receiver % self.sessions.len()
    }

    /// The same room in the air of a session.
    pub(crate) fn in_session(&self, session: usize) -> Self {
        let TrueSession { warmer_k, damper_percent } = self.sessions[session];
        let damp = (self.relative_humidity_percent + damper_percent).clamp(2.0, 98.0);
        Self { temperature_c: self.temperature_c + warmer_k, relative_humidity_percent: damp, ..self.clone() }
    }

    /// Number of responses.
    pub fn responses(&self) -> usize {
        self.sources.len() * self.receivers_m.len()
    }

    /// Volume in cubic metres.
    pub fn volume_m3(&self) -> f64 {
        self.size_m.iter().product()
    }

    pub(crate) fn medium(&self) -> Result<Medium, Error> {
        let (bands, air) = (self.bands()?, self.air()?);
        let speed_m_s = speed_of_sound_m_s(&air);
        let exponent =
            |hz: f64| energy_exponent_per_m(&air, hz) + fog::energy_exponent_per_m(self, speed_m_s, hz);
        let exponents_per_m = (0..bands.len()).map(|b| exponent(bands.exact_hz(b))).collect();
        Ok(Medium { speed_m_s, exponents_per_m })
    }

    /// Logarithm of the energy that each face reflects like a mirror, `[band][face]`.
    pub(crate) fn log_mirrored(&self) -> Vec<[f64; 6]> {
        let face = |band: usize, face: usize| {
            let material = &self.materials[self.faces[face]];
            (1.0 - material.absorption[band]).ln() + (1.0 - material.scattering[band]).max(1e-12).ln()
        };
        (0..self.bands_hz.len()).map(|b| std::array::from_fn(|f| face(b, f))).collect()
    }

    /// Whatever effects moved, places stay within the room: a position is worth little inside a wall.
    pub(crate) fn keep_inside(&mut self) {
        const MARGIN_M: f64 = 0.05;
        let places = self.sources.iter_mut().map(|s| &mut s.position_m).chain(&mut self.receivers_m);
        for place in places {
            for (c, side) in place.iter_mut().zip(self.size_m) {
                *c = c.clamp(MARGIN_M, side - MARGIN_M);
            }
        }
    }
}

/// What the air does.
pub(crate) struct Medium {
    pub speed_m_s: f64,
    /// Energy attenuation of each octave in 1/m.
    pub exponents_per_m: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_radiates_as_much_as_a_sphere() {
        for q in [0.0, 0.3, 0.5, 0.8, 1.0] {
            let source = TrueSource { position_m: [0.0; 3], axis: [1.0, 0.0, 0.0], omni_share: vec![q] };
            // Rings of equal area are equally wide in the cosine.
            let ring = |i: i32| source.gain(0, (f64::from(i) + 0.5) / 500.0 - 1.0).powi(2);
            let mean = (0..1000).map(ring).sum::<f64>() / 1000.0;
            assert!((mean - 1.0).abs() < 1e-5, "{q}: {mean}");
        }
    }
}
