//! Rooms, materials and places that nobody would choose.

use super::box_decay::BoxDecay;
use super::config::LabConfig;
use super::stream::{Purpose, stream};
use super::truth::{TrueMaterial, TrueMicrophone, TrueSession, TrueSource, Truth};
use super::warming::recording_order;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Bands, Error, OutOfRange};
use sabine_scene::{Levels, TimeZero};

/// Names of materials; nothing follows from them.
const NAMES: [&str; 10] =
    ["ash", "basalt", "cork", "felt", "gypsum", "heather", "larch", "loam", "slate", "willow"];
/// Rooms drawn before a configuration is given up.
const TRIES: usize = 20_000;
/// Distance of places from walls, and from each other, in metres.
const FROM_WALLS_M: f64 = 0.6;
const APART_M: f64 = 0.8;
/// Eyring's reverberation time in every octave, in seconds.
const T60_S: (f64, f64) = (0.25, 0.9);
/// Longest time in which the box may take to fall by [`FALL_DB`].
const LONGEST_S: f64 = 1.35;
/// Longest response to a box alone, in seconds.
const AT_MOST_S: f64 = 2.0;
/// How far responses fall before they end, in dB.
const FALL_DB: f64 = 65.0;
/// Margin after that, in seconds.
pub(crate) const MARGIN_S: f64 = 0.06;
/// Standard deviation of a microphone's gain in dB, and of a receiver's place along each axis in metres.
pub(crate) const GAIN_SD_DB: f64 = 0.3;
pub(crate) const PLACE_SD_M: f64 = 0.005;

/// By how much each session is warmer than the first, in K, and damper or drier, in percent of relative humidity.
const SESSIONS: [[f64; 2]; 4] = [[0.0, 0.0], [6.0, 30.0], [-4.0, 15.0], [3.0, -20.0]];

/// What is said about the room.
pub(crate) struct Declared {
    pub absorption: Vec<Vec<f64>>,
    pub absorption_sd: Vec<Vec<f64>>,
    pub sources_m: Vec<[f64; 3]>,
    pub receivers_m: Vec<[f64; 3]>,
}

/// Draws a room, as declared and as it is.
pub(crate) fn draw(config: &LabConfig) -> Result<(Declared, Truth), Error> {
    let mut random = stream(config.seed, Purpose::Room, 0);
    for _ in 0..TRIES {
        let size_m =
            [3.0 + 6.0 * unit(&mut random), 3.0 + 6.0 * unit(&mut random), 2.4 + 1.6 * unit(&mut random)];
        let volume_m3: f64 = size_m.iter().product();
        if !(35.0..=200.0).contains(&volume_m3) {
            continue;
        }
        let faces = draw_faces(&mut random);
        let count = faces.iter().max().map_or(0, |m| m + 1);
        let declared: Vec<Vec<f64>> = (0..count).map(|_| draw_table(&mut random, config.bands)).collect();
        let temperature_c = 5.0 + 28.0 * unit(&mut random);
        let relative_humidity_percent = 15.0 + 70.0 * unit(&mut random);
        let sd: Vec<Vec<f64>> = (0..count)
            .map(|_| vec![if unit(&mut random) < 0.8 { 0.03 } else { 0.06 }; config.bands.len()])
            .collect();
        let mut names = NAMES;
        names.shuffle(&mut random);
        let place_seed: u64 = random.random();
        let real = |(table, sd): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            let one = |(a, sd): (&f64, &f64)| (a + sd * normal(&mut random)).clamp(0.01, 0.95);
            table.iter().zip(sd).map(one).collect()
        };
        let absorption: Vec<Vec<f64>> = declared.iter().zip(&sd).map(real).collect();
        let materials = |tables: &[Vec<f64>]| -> Vec<TrueMaterial> {
            let one = |(name, table): (&&str, &Vec<f64>)| TrueMaterial {
                name: (*name).to_owned(),
                absorption: table.clone(),
                scattering: vec![0.0; table.len()],
            };
            names.iter().zip(tables).map(one).collect()
        };
        let mut truth = Truth {
            seed: config.seed,
            positive_reflections: config.positive_reflections,
            bands_hz: config.bands.iter_hz().collect(),
            size_m,
            origin_m: [0.0; 3],
            faces,
            temperature_c,
            relative_humidity_percent,
            pressure_kpa: 101.325,
            receivers_m: Vec::new(),
            microphones: Vec::new(),
            source_gains_db: vec![0.0; config.bands.len()],
            clock_ppm: 0.0,
            duration_s: 0.0,
            latencies_s: Vec::new(),
            gains_db: Vec::new(),
            channel_gains_db: Vec::new(),
            inverted: Vec::new(),
            recorded_at: Vec::new(),
            materials: materials(&declared),
            sources: Vec::new(),
            sessions: Vec::new(),
            effects: Vec::new(),
        };
        let fits = |truth: &Truth| -> Result<bool, Error> {
            Ok(eyring_s(truth)?.into_iter().all(|t| (T60_S.0..=T60_S.1).contains(&t)))
        };
        if !fits(&truth)? {
            continue;
        }
        truth.materials = materials(&absorption);
        if !fits(&truth)? {
            continue;
        }
        let fallen_s = fallen_s(&truth)?;
        if fallen_s > LONGEST_S {
            continue;
        }
        let Some(mut places) = draw_places(config, place_seed, size_m) else { continue };
        let receivers_m = places.split_off(config.sources);
        if config.turned {
            places.extend_from_within(..);
        }
        truth.duration_s = fallen_s + MARGIN_S;
        measure(config, &mut truth, &places, &receivers_m);
        return Ok((
            Declared { absorption: declared, absorption_sd: sd, sources_m: places, receivers_m },
            truth,
        ));
    }
    let (field, range) = ("rooms drawn in vain", "fewer than 20000");
    Err(OutOfRange { field, value: TRIES as f64, range }.into())
}

/// When the slowest octave has fallen far enough for a recording to end, if no wall scatters (which rarely makes it longer).
pub(crate) fn fallen_s(truth: &Truth) -> Result<f64, Error> {
    let mut mirrors = truth.clone();
    mirrors.materials.iter_mut().flat_map(|m| &mut m.scattering).for_each(|s| *s = 0.0);
    let medium = truth.medium()?;
    Ok(BoxDecay::new(&mirrors, &medium, AT_MOST_S).all_fallen_s(&medium, FALL_DB))
}

/// Places as they are, channels and time zero.
fn measure(config: &LabConfig, truth: &mut Truth, sources_m: &[[f64; 3]], receivers_m: &[[f64; 3]]) {
    let mut random = stream(config.seed, Purpose::Jitter, 0);
    truth.receivers_m = receivers_m.iter().map(|p| p.map(|c| c + PLACE_SD_M * normal(&mut random))).collect();
    let mut random = stream(config.seed, Purpose::Axes, 0);
    truth.microphones = receivers_m
        .iter()
        .map(|_| {
            // Anywhere.
            let axis: [f64; 3] = std::array::from_fn(|_| normal(&mut random));
            let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-9);
            TrueMicrophone { axis: axis.map(|c| c / length), omni_share: vec![1.0; truth.bands_hz.len()] }
        })
        .collect();
    let mut random = stream(config.seed, Purpose::Places, 1);
    let centre = truth.size_m.map(|l| 0.5 * l);
    truth.sources = sources_m
        .iter()
        .map(|&position_m| {
            // Into the room, more or less, as loudspeakers stand.
            let towards: [f64; 3] = std::array::from_fn(|k| {
                let spread = if k == 2 { 0.3 } else { 1.0 };
                centre[k] - position_m[k] + spread * normal(&mut random)
            });
            let length = towards.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-9);
            let omni_share = vec![1.0; truth.bands_hz.len()];
            TrueSource { position_m, axis: towards.map(|c| c / length), omni_share }
        })
        .collect();
    if config.turned {
        let (first, again) = truth.sources.split_at_mut(config.sources);
        for (turned, source) in again.iter_mut().zip(first) {
            turned.axis = [-source.axis[1], source.axis[0], source.axis[2]];
        }
    }
    truth.sessions = SESSIONS[..config.sessions].iter().map(|&s| session(truth, s)).collect();
    let responses = sources_m.len() * receivers_m.len();
    truth.inverted = vec![false; responses];
    truth.recorded_at = recording_order(config.seed, responses);
    truth.channel_gains_db = vec![vec![0.0; truth.bands_hz.len()]; responses];
    let mut random = stream(config.seed, Purpose::Gain, 0);
    truth.gains_db = (0..responses).map(|_| GAIN_SD_DB * normal(&mut random)).collect();
    let mut random = stream(config.seed, Purpose::Level, 0);
    let levels: Vec<f64> = (0..responses).map(|_| -10.0 + 20.0 * unit(&mut random)).collect();
    for (i, gain_db) in truth.gains_db.iter_mut().enumerate() {
        *gain_db += match config.levels {
            Levels::PerResponse => levels[i],
            Levels::Common => levels[0],
            // Absolute, and whatever the vocabulary may come to hold.
            _ => 0.0,
        };
    }
    let mut random = stream(config.seed, Purpose::Latency, 0);
    let latencies: Vec<f64> = (0..responses).map(|_| 1e-3 + 19e-3 * unit(&mut random)).collect();
    truth.latencies_s = (0..responses)
        .map(|i| match config.time_zero {
            TimeZero::PerResponse => latencies[i],
            TimeZero::Common => latencies[0],
            _ => 0.0,
        })
        .collect();
}

/// The air of a session, on whichever side of the first one's humidity there is room.
fn session(truth: &Truth, [warmer_k, damper_percent]: [f64; 2]) -> TrueSession {
    let up = truth.relative_humidity_percent < 50.0;
    TrueSession { warmer_k, damper_percent: if up { damper_percent } else { -damper_percent } }
}

/// Three to five materials over six faces, numbered as they first appear.
fn draw_faces(random: &mut Pcg64Mcg) -> [usize; 6] {
    let count = random.random_range(3..=5);
    let mut faces: [usize; 6] =
        std::array::from_fn(|i| if i < count { i } else { random.random_range(0..count) });
    faces.shuffle(random);
    let mut order = Vec::new();
    faces.map(|m| {
        order.iter().position(|&o| o == m).unwrap_or_else(|| {
            order.push(m);
            order.len() - 1
        })
    })
}

/// A table that rises, falls or has a bump.
fn draw_table(random: &mut Pcg64Mcg, bands: Bands) -> Vec<f64> {
    let level = (0.05f64.ln() + (0.45f64 / 0.05).ln() * unit(random)).exp();
    let tilt = 0.25 * normal(random);
    let octaves = bands.len() as f64 / bands.per_octave() as f64;
    let (bump, centre) = (0.5 * normal(random), octaves * unit(random));
    (0..bands.len())
        .map(|b| {
            let place = b as f64 / bands.per_octave() as f64;
            let from_middle = place - 0.5 * (octaves - 1.0 / bands.per_octave() as f64);
            let hill = bump * (-0.5 * (place - centre).powi(2)).exp();
            let value = level * (tilt * from_middle + hill + 0.1 * normal(random)).exp();
            // Tables have three decimals.
            (value.clamp(0.03, 0.6) * 1e3).round() / 1e3
        })
        .collect()
}

/// Sources, then receivers, to the millimetre; `None` if they do not fit.
fn draw_places(config: &LabConfig, seed: u64, size_m: [f64; 3]) -> Option<Vec<[f64; 3]>> {
    let mut random = stream(seed, Purpose::Places, 0);
    let mut places: Vec<[f64; 3]> = Vec::new();
    for _ in 0..5000 {
        if places.len() == config.sources + config.receivers {
            return Some(places);
        }
        let place = size_m.map(|l| {
            let c = FROM_WALLS_M + 0.02 + (l - 2.0 * FROM_WALLS_M - 0.04) * unit(&mut random);
            (c * 1e3).round() / 1e3
        });
        let far =
            |other: &[f64; 3]| (0..3).map(|k| (place[k] - other[k]).powi(2)).sum::<f64>() > APART_M * APART_M;
        if places.iter().all(far) {
            places.push(place);
        }
    }
    None
}

/// Eyring's reverberation time of each octave, air included.
fn eyring_s(truth: &Truth) -> Result<Vec<f64>, Error> {
    let medium = truth.medium()?;
    let areas = face_areas_m2(truth.size_m);
    let surface: f64 = areas.iter().sum();
    Ok((0..truth.bands_hz.len())
        .map(|b| {
            let absorbed: f64 =
                areas.iter().zip(truth.faces).map(|(s, m)| s * truth.materials[m].absorption[b]).sum();
            let area = -surface * (1.0 - absorbed / surface).ln()
                + 4.0 * medium.exponents_per_m[b] * truth.volume_m3();
            24.0 * std::f64::consts::LN_10 / medium.speed_m_s * truth.volume_m3() / area
        })
        .collect())
}

/// Areas of the faces, in their order.
pub(crate) fn face_areas_m2([x, y, z]: [f64; 3]) -> [f64; 6] {
    [y * z, y * z, x * z, x * z, x * y, x * y]
}

pub(crate) fn unit(random: &mut Pcg64Mcg) -> f64 {
    random.random()
}

pub(crate) fn normal(random: &mut Pcg64Mcg) -> f64 {
    random.sample(StandardNormal)
}
