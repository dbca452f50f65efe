//! How decay and colour vary over the octaves of a room that is drawn.

use crate::eq_statistics::EqStatistics;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use sabine_acoustics::{Air, Bands};

/// Octaves of a synthetic room, 62.5 Hz to 8 kHz.
const BANDS: usize = 8;
/// Position of 1 kHz among them.
const REFERENCE: usize = 4;

/// Absorption of kinds of surface at 62.5 Hz to 8 kHz, from the run of published tables (Vorlander 2008, appendix; the
/// values are rounded and stand for a kind, not for a product).
const SURFACES: [[f64; BANDS]; 8] = [
    [0.010, 0.010, 0.015, 0.020, 0.025, 0.030, 0.040, 0.045], // concrete, rendered brick
    [0.25, 0.22, 0.12, 0.07, 0.05, 0.04, 0.04, 0.04],         // window panes
    [0.35, 0.30, 0.15, 0.10, 0.08, 0.08, 0.08, 0.08],         // plasterboard on studs
    [0.30, 0.28, 0.22, 0.17, 0.10, 0.10, 0.10, 0.09],         // wood panelling before a cavity
    [0.02, 0.03, 0.07, 0.16, 0.32, 0.50, 0.62, 0.66],         // carpet
    [0.06, 0.10, 0.25, 0.45, 0.62, 0.66, 0.62, 0.60],         // curtains, upholstery
    [0.25, 0.40, 0.62, 0.78, 0.85, 0.86, 0.84, 0.82],         // suspended porous ceiling
    [0.08, 0.16, 0.30, 0.50, 0.68, 0.78, 0.80, 0.78],         // people and furniture
];

/// Share of the spread between the mixtures that rooms keep: furniture, leaks and people level them out, and measured rooms
/// vary less than tables suggest.
const MIXING: f64 = 0.6;

/// T60 over the octaves relative to about 1 kHz: half of the rooms a random mixture of surfaces, half a smooth random curve.
pub(crate) fn t60_shape(rng: &mut Pcg64) -> Vec<f64> {
    let mut log_shape = if rng.random::<bool>() {
        // Few surfaces dominate a room: weights spread over more than an order of magnitude.
        let weights: [f64; SURFACES.len()] = std::array::from_fn(|_| {
            let spread: f64 = StandardNormal.sample(rng);
            (1.3 * spread).exp()
        });
        let absorption = |band: usize| SURFACES.iter().zip(weights).map(|(s, w)| w * s[band]).sum::<f64>();
        (0..BANDS).map(|band| MIXING * (absorption(REFERENCE) / absorption(band)).ln()).collect::<Vec<_>>()
    } else {
        let curve = walk(rng, -0.03, 0.09, 0.15);
        curve.to_vec()
    };
    for (band, log) in log_shape.iter_mut().enumerate() {
        // Few modes: the lowest octaves scatter on their own.
        let scatter = [0.30, 0.20, 0.12, 0.07, 0.05, 0.05, 0.05, 0.06][band];
        let noise: f64 = StandardNormal.sample(rng);
        *log = log.clamp(-1.6, 1.1) + scatter * noise;
    }
    log_shape.into_iter().map(f64::exp).collect()
}

/// The colour of loudspeaker, microphone and room in dB re 1 kHz, drawn per octave from the statistics of real responses.
pub(crate) fn eq_curve_db(rng: &mut Pcg64, inflation: f64) -> Vec<f64> {
    let statistics = EqStatistics::measured();
    let targets = statistics.draw_db(rng, inflation);
    // 62.5 Hz to 4 kHz as drawn; 8 kHz goes on from 4 kHz.
    let mut curve = targets.values().to_vec();
    let noise: f64 = StandardNormal.sample(rng);
    curve.push(curve[BANDS - 2] - 2.5 + 3.5 * inflation * noise);
    // Half of them smoothed: neighbouring octaves of one loudspeaker resemble each other.
    if rng.random::<bool>() {
        let rough = curve.clone();
        for band in 1..BANDS - 1 {
            curve[band] = 0.25 * rough[band - 1] + 0.5 * rough[band] + 0.25 * rough[band + 1];
        }
    }
    let reference = curve[REFERENCE];
    curve.iter_mut().for_each(|c| *c -= reference);
    curve
}

/// A smooth random curve in dB through 0 at 1 kHz: `tilt_db` per octave and a random walk of `step_db`, both standard
/// deviations.
pub(crate) fn drawn_curve_db(rng: &mut Pcg64, tilt_db: f64, step_db: f64) -> [f64; BANDS] {
    walk(rng, 0.0, tilt_db, step_db)
}

fn walk(rng: &mut Pcg64, mean_tilt: f64, tilt_sd: f64, step_sd: f64) -> [f64; BANDS] {
    let normal: f64 = StandardNormal.sample(rng);
    let tilt = mean_tilt + tilt_sd * normal;
    let mut curve = [0.0; BANDS];
    for band in 1..BANDS {
        let step: f64 = StandardNormal.sample(rng);
        curve[band] = curve[band - 1] + tilt + step_sd * step;
    }
    let reference = curve[REFERENCE];
    curve.map(|c| c - reference)
}

/// The reverberation time that air alone permits in each band, in seconds (20 C, 50 %).
pub(crate) fn air_limits_s(bands: Bands) -> Vec<f64> {
    let air = Air::default();
    (0..bands.len()).map(|band| air.t60_limit_s(bands.exact_hz(band))).collect()
}
