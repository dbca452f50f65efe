//! What the changes of a model make of a room, taken together.

use crate::extend::box_object::BoxObject;
use crate::extend::displaced_surface::DisplacedSurface;
use crate::extend::rigid_motion::RigidMotion;
use sabine_paths::laws::Law;
use sabine_scene::Scene;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// All changes of a model at work together: what it makes of the room and the recording. Absent parts leave the room as it is.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AppliedChanges {
    /// Nominal octave centres of everything given by octave, in Hz.
    pub centres_hz: Vec<f64>,
    /// Absorption by material and octave.
    pub absorption: BTreeMap<String, Vec<f64>>,
    /// Scattering by material and octave.
    pub scattering: BTreeMap<String, Vec<f64>>,
    /// Relative humidity in percent, for attenuation.
    pub relative_humidity_percent: Option<f64>,
    /// Temperature in degrees Celsius, for the speed of sound.
    pub temperature_c: Option<f64>,
    /// Gain of loudspeaker and microphone by octave, in dB.
    pub gain_db: Vec<f64>,
    /// First-order pattern of the sources: directed share by octave (0: omnidirectional, 0.5: cardioid), radiated power as without.
    pub directed_share: Vec<f64>,
    /// Axis of each source.
    pub axis: BTreeMap<String, [f64; 3]>,
    /// First-order pattern of receivers: directed share by octave, sensitivity in a diffuse field as without; absent ones are
    /// omnidirectional.
    pub receiver_directed_share: BTreeMap<String, Vec<f64>>,
    /// Axis of receivers that have a pattern; the room file's where there is none.
    pub receiver_axis: BTreeMap<String, [f64; 3]>,
    /// Noise by octave: energy per second relative to that of the direct sound at 1 m.
    pub noise_per_s: Vec<f64>,
    /// The decay of a coupled volume.
    pub coupled: Option<CoupledDecay>,
    /// Below this frequency in Hz responses are those of the wave equation; [`ExtendedRoom::finish`](crate::ExtendedRoom::finish) takes
    /// them as they come: whoever renders joins them ([`Crossover`](sabine_propagate::wave::Crossover)).
    pub wave_below_hz: Option<f64>,
    /// End of the response and length of its fade, in seconds from the first sample.
    pub truncation: Option<[f64; 2]>,
    /// Gain of all responses over the time of the file.
    pub gain_over_time: Option<GainOverTime>,
    /// Deviation of the sampling clock in parts per million.
    pub clock_ppm: Option<f64>,
    /// Scale of the room along each axis about the middle of its box, and shift in metres.
    pub dimensions: Option<Dimensions>,
    /// Surfaces of the mesh that stand elsewhere; each at most once. They are moved before the room is scaled.
    pub surfaces: Vec<DisplacedSurface>,
    /// Where sources and receivers stand that are not where the room file says, by name, in metres, in its coordinates.
    pub position_m: BTreeMap<String, [f64; 3]>,
    /// From the coordinates of the room file to those of the mesh: all places move, and the axes that the room file states.
    pub coordinate_shift: Option<RigidMotion>,
    /// Latency of all responses in seconds.
    pub latency_s: Option<f64>,
    /// Responses (SOURCE-RECEIVER) whose sign is turned.
    pub inverted: Vec<String>,
    /// Gain of single responses in dB.
    pub response_gain_db: BTreeMap<String, f64>,
    /// Gain of single responses by octave, in dB.
    pub response_band_gain_db: BTreeMap<String, Vec<f64>>,
    /// Responses that were exchanged.
    pub exchanged: Vec<[String; 2]>,
    /// Sound bends around the edges of the mesh, as theory has it.
    pub diffraction: bool,
    /// Specular reflections add as pressures, to any order: image sources in a cuboid.
    pub coherent_reflections: bool,
    /// By which share all walls react locally.
    pub locally_reacting_share: Option<f64>,
    /// Flat surfaces that the mesh lacks.
    pub sheets: Vec<ThinPanel>,
    /// Box-shaped obstacles that the mesh lacks, as they stand in the room: neither its size nor displaced surfaces move them.
    pub objects: Vec<BoxObject>,
    /// Formulas that change what paths carry, with the 90 % intervals of their parameters.
    pub laws: Vec<Law>,
}

/// A flat rectangle that reflects on both sides: a panel, or (just before its wall, absorbing all) a hole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ThinPanel {
    /// Its corners in order, in metres.
    pub corners_m: [[f64; 3]; 4],
    /// Absorption, the same in all octaves, 0 to 1; it does not scatter.
    pub absorption: f64,
}

impl ThinPanel {
    /// A rectangle about a centre, half as long along two unit vectors as given.
    pub fn rectangle(centre_m: [f64; 3], axes: [[f64; 3]; 2], half_m: [f64; 2], absorption: f64) -> Self {
        let corner = |[a, b]: [f64; 2]| {
            std::array::from_fn(|k| centre_m[k] + a * half_m[0] * axes[0][k] + b * half_m[1] * axes[1][k])
        };
        Self { corners_m: [[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]].map(corner), absorption }
    }
}

/// Gain of a recorder that changes while it records: straight lines in dB between the given instants, constant before the first and after
/// the last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GainOverTime {
    /// Instants in seconds from the first sample, rising.
    pub time_s: Vec<f64>,
    /// Gain at each of them, in dB.
    pub gain_db: Vec<f64>,
}

impl GainOverTime {
    /// Gains in dB at instants in seconds from the first sample, which rise.
    pub fn new(time_s: Vec<f64>, gain_db: Vec<f64>) -> Self {
        Self { time_s, gain_db }
    }

    /// The gain at an instant, in dB.
    pub(crate) fn at(&self, time_s: f64) -> f64 {
        let next = self.time_s.partition_point(|t| *t <= time_s);
        if next == 0 || next == self.time_s.len() {
            return self.gain_db.get(next.saturating_sub(1)).copied().unwrap_or(0.0);
        }
        let (from, to) = (self.time_s[next - 1], self.time_s[next]);
        let share = (time_s - from) / (to - from);
        self.gain_db[next - 1] * (1.0 - share) + self.gain_db[next] * share
    }
}

/// A coupled volume fills within this time, in seconds.
pub(crate) const BUILD_UP_S: f64 = 0.02;

/// The second decay of a coupled volume.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CoupledDecay {
    /// Energy per second at the beginning, by octave, relative to that of the direct sound at 1 m.
    pub energy_per_s: Vec<f64>,
    /// Decay time (60 dB) by octave, in seconds.
    pub decay_time_s: Vec<f64>,
    /// Change of level with the receiver's position, in dB/m along each axis, about `centre_m`.
    pub gradient_db_per_m: [f64; 3],
    /// Where the level is as stated.
    pub centre_m: [f64; 3],
}

/// How the room differs from its mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Dimensions {
    /// Factor along each axis.
    pub scale: [f64; 3],
    /// Shift along each axis in metres.
    pub shift_m: [f64; 3],
}

impl Dimensions {
    /// Factors along the axes about the middle of the mesh's box, then a shift in metres.
    pub fn new(scale: [f64; 3], shift_m: [f64; 3]) -> Self {
        Self { scale, shift_m }
    }

    /// A scene of this size: scaled about the middle of the box of the room as stated.
    pub(crate) fn applied(&self, stated: &Scene, scene: &Scene) -> Result<Scene, sabine_acoustics::Error> {
        let corner = |fold: fn(f64, f64) -> f64, from: f64, k: usize| {
            stated.vertices().iter().map(|v| v[k]).fold(from, fold)
        };
        let middle: [f64; 3] = std::array::from_fn(|k| {
            0.5 * (corner(f64::min, f64::INFINITY, k) + corner(f64::max, f64::NEG_INFINITY, k))
        });
        let vertices = scene.vertices().iter().map(|v| {
            std::array::from_fn(|k| middle[k] + (v[k] - middle[k]) * self.scale[k] + self.shift_m[k])
        });
        Scene::new(vertices.collect(), scene.triangles().to_vec(), scene.materials().to_vec())
    }
}
