//! What a box that the mesh lacks does to the early sound: it stands in the way of the direct sound and of reflections, and reflects itself.
//!
//! Three kinds of data: the level of the direct sound, the energy of first-order reflections in their gates, and peaks. All are compared with
//! what they would be without the box; a shadow is that of [`barrier`].

mod barrier;
pub(crate) mod floor_map;
pub(crate) mod mirror_ways;
pub(crate) mod sampler;

use crate::extend::standing_box::Solid;
use crate::likelihood::arrivals::peak_partners::{PeakPartners, TimeAxis};
use crate::likelihood::arrivals::{HEIGHT_SD_DB, REFLECTION_SD_S, SEEN_SHARE, normal};
use crate::likelihood::reflection_gates::{AttenuatedGate, STEPS_DB};
use crate::observe::observed_response::{PEAK_FLOOR_DB, PEAKS_S};
use barrier::attenuation_db;
use floor_map::FloorMap;
use mirror_ways::MirrorWay;
use sabine_paths::RayScene;
use sampler::Sample;
use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Seed of the boxes that are drawn: the same early sound, the same boxes.
const SEED: u64 = 0x0062_6f78_6573;
/// Share of direct sounds whose level is of another make, over a range in dB.
const ODD_SHARE: f64 = 0.02;
const ODD_RANGE_DB: f64 = 60.0;
/// How well the level of a direct sound behind a box is known, in dB: around edges it goes several ways.
const SHADOW_SD_DB: f64 = 5.0;
/// Faces are not known to reflect from where they are to better than this, in seconds.
const FACE_SD_S: f64 = 3e-5;
/// A peak that many reflections may claim is still one of these shares.
const LEAST_REST: f64 = 0.2;

/// The level of a direct sound beside that of the others, distances counted, and its scatter, in dB.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DirectLevel {
    pub beside_db: f64,
    pub sd_db: f64,
}

/// A predicted path that a measured peak may belong to.
#[derive(Clone, Debug)]
pub(crate) struct PeakPath {
    /// Where it leaves, meets surfaces and arrives, in metres.
    pub stops_m: Vec<[f64; 3]>,
    /// Its share of the amplitudes of all predicted paths.
    pub share: f64,
}

/// A predicted reflection whose energy was measured.
#[derive(Clone, Debug)]
pub(crate) struct GatedPath {
    /// Where it leaves, meets surfaces and arrives, in metres.
    pub stops_m: Vec<[f64; 3]>,
    pub gate: AttenuatedGate,
}

/// The early sound of one response.
#[derive(Clone, Debug)]
pub(crate) struct EarlyResponse {
    /// Source and receiver as the arrival times have them, in metres.
    pub ends_m: [[f64; 3]; 2],
    /// None where the mesh blocks the direct line, or levels are not known.
    pub direct: Option<DirectLevel>,
    pub gates: Vec<GatedPath>,
    /// Partners of the peaks: they refer to these.
    pub paths: Vec<PeakPath>,
    pub peaks: Vec<PeakPartners>,
    pub axis: TimeAxis,
    /// What heights of peaks lack to be over the direct sound as it should be, in dB.
    pub height_lacks_db: f64,
    /// Pairs of places between which one face reflects.
    pub ways: Vec<MirrorWay>,
}

/// The early sound of all responses beside what the model predicts, and where a box can stand.
pub struct EarlySound {
    responses: Vec<EarlyResponse>,
    mesh: Box<dyn RayScene>,
    floor: FloorMap,
    box_m: [[f64; 3]; 2],
    /// Directions of the walls in plan, in degrees from 0 to 90.
    walls_deg: Vec<f64>,
    /// Sources and receivers: no box holds one.
    places_m: Vec<[f64; 3]>,
    /// That of the octaves in which levels are compared, in metres.
    wave_length_m: f64,
    /// Boxes drawn before, by the responses that counted.
    drawn: Mutex<HashMap<Vec<bool>, Option<Arc<Sample>>>>,
}

impl EarlySound {
    /// Early sound in a mesh within a box, with the directions of walls in plan and the places of sources and receivers.
    pub(crate) fn new(
        responses: Vec<EarlyResponse>,
        mesh: Box<dyn RayScene>,
        floor: FloorMap,
        box_m: [[f64; 3]; 2],
        (walls_deg, places_m): (Vec<f64>, Vec<[f64; 3]>),
        wave_length_m: f64,
    ) -> Self {
        let drawn = Mutex::default();
        Self { responses, mesh, floor, box_m, walls_deg, places_m, wave_length_m, drawn }
    }

    /// Boxes drawn given the responses that count (a flag for each); none where no box can stand.
    pub(crate) fn boxes(&self, used: &[bool]) -> Option<Arc<Sample>> {
        let known = || self.drawn.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().get(used) {
            return found.clone();
        }
        // Nobody waits for a lock meanwhile: whoever asks for the same at the same time draws the same.
        let found = sampler::draw(self, used, SEED).map(Arc::new);
        known().insert(used.to_vec(), found.clone());
        found
    }

    /// How much more probable (logarithm, in nats) a response's early sound is with a box, whose faces leave so much of a reflection, in dB.
    /// Times of its reflections count with so much more than their own width.
    pub(crate) fn gain(&self, response: usize, solid: &Solid, reflectance_db: f64, width_s: f64) -> f64 {
        let own = &self.responses[response];
        let shadow = |from: [f64; 3], to: [f64; 3]| attenuation_db(solid, from, to, self.wave_length_m);
        let [source, receiver] = own.ends_m;
        let mut nats = 0.0;
        if let Some(direct) = own.direct {
            nats += direct.gain(shadow(source, receiver));
        }
        for gate in &own.gates {
            let by_db: f64 = gate.stops_m.windows(2).map(|leg| shadow(leg[0], leg[1])).sum();
            if by_db > 0.0 {
                nats += gate.gate.nats_at(by_db) - gate.gate.nats[0];
            }
        }
        nats + self.gain_of_peaks(own, solid, reflectance_db, width_s)
    }

    fn gain_of_peaks(&self, own: &EarlyResponse, solid: &Solid, reflectance_db: f64, width_s: f64) -> f64 {
        if own.peaks.is_empty() {
            return 0.0;
        }
        let left = |path: &PeakPath| -> f64 {
            let by_db: f64 = path
                .stops_m
                .windows(2)
                .map(|leg| attenuation_db(solid, leg[0], leg[1], self.wave_length_m))
                .sum();
            10f64.powf(-by_db / 20.0)
        };
        let left: Vec<f64> = own.paths.iter().map(left).collect();
        let gone: f64 = own.paths.iter().zip(&left).map(|(path, left)| path.share * (1.0 - left)).sum();
        let mut added: Vec<(f64, f64)> = Vec::new();
        for way in &own.ways {
            way.reflected(solid, &*self.mesh, |found| {
                let time_s = own.axis.at_s(found.length_m, found.departure, found.arrival);
                added.push((time_s, found.level_db + reflectance_db));
            });
        }
        if gone == 0.0 && added.is_empty() {
            return 0.0;
        }
        let sd = REFLECTION_SD_S.hypot(FACE_SD_S).hypot(width_s);
        let each = SEEN_SHARE / own.peaks.len() as f64;
        let rest = (1.0 - each * added.len() as f64).max(LEAST_REST);
        let more = 1.0 / (1.0 - gone).max(0.05);
        let one = |peak: &PeakPartners| {
            let before: f64 = peak.partners.iter().map(|(_, density)| density).sum();
            let kept: f64 = peak.partners.iter().map(|&(path, density)| density * left[path] * more).sum();
            let height_db = peak.height_db + own.height_lacks_db;
            let reflected: f64 = added
                .iter()
                .map(|(time_s, level_db)| {
                    normal(peak.time_s - time_s, sd) * normal(height_db - level_db, HEIGHT_SD_DB)
                })
                .sum();
            let now = rest * (kept + peak.other) + each * PEAK_FLOOR_DB * reflected;
            (now / (before + peak.other)).ln()
        };
        own.peaks.iter().map(one).sum()
    }
}

impl fmt::Debug for EarlySound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EarlySound").field("responses", &self.responses.len()).finish_non_exhaustive()
    }
}

impl DirectLevel {
    /// How much more probable the level is behind a shadow than without, in nats.
    fn gain(self, by_db: f64) -> f64 {
        let density = |mean_db: f64, sd_db: f64| {
            (1.0 - ODD_SHARE) * normal(self.beside_db - mean_db, sd_db) + ODD_SHARE / ODD_RANGE_DB
        };
        if by_db == 0.0 {
            return 0.0;
        }
        (density(-by_db, self.sd_db.hypot(SHADOW_SD_DB)) / density(0.0, self.sd_db)).ln()
    }
}

impl AttenuatedGate {
    /// Nats at an attenuation, straight between those that are tabulated.
    fn nats_at(&self, by_db: f64) -> f64 {
        let next = STEPS_DB.partition_point(|step| *step <= by_db);
        if next == STEPS_DB.len() {
            return self.nats[next - 1];
        }
        let (low, high) = (STEPS_DB[next - 1], STEPS_DB[next]);
        let share = (by_db - low) / (high - low);
        self.nats[next - 1] * (1.0 - share) + self.nats[next] * share
    }
}

/// How long after the direct sound reflections of a box count, in seconds: as peaks are looked for.
pub(crate) const WITHIN_S: f64 = PEAKS_S;
