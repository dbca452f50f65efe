//! The late decay of a second room, heard through an aperture.

use super::columns::Columns;
use super::hidden::Hidden;
use super::stream::{Purpose, stream};
use super::truth::{Medium, Truth};
use rand::Rng;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

/// Level below which a tail may be cut off, in dB below the early field.
const CUT_DB: f64 = 70.0;

/// Adds the tails of all coupled volumes: Gaussian noise, the same in all bands, under exponential decays.
pub(crate) fn add_tails(truth: &Truth, medium: &Medium, pair: (usize, usize), columns: &mut Columns) {
    let index = pair.0 * truth.receivers_m.len() + pair.1;
    let mut random = stream(truth.seed, Purpose::Tail, index);
    let (from, to) = (truth.sources[pair.0].position_m, truth.receivers_m[pair.1]);
    let direct_s = distance(from, to) / medium.speed_m_s;
    // The diffuse field of the room's volume at the emission: images of energy 1 / (c t)^2 in the number 4 pi c^3 t^2 / V a second.
    let diffuse = 4.0 * PI * medium.speed_m_s / truth.volume_m3();
    for effect in &truth.effects {
        let Hidden::CoupledVolume { level_db, decay_s, aperture_m, critical_distance_m, rise_s } = effect
        else {
            continue;
        };
        // Nobody sits nearer to an aperture than this.
        let away_m = distance(*aperture_m, to).max(0.3);
        let near = 1.0 + (critical_distance_m / away_m).powi(2);
        let level = diffuse * near * 10f64.powf(0.1 * level_db) / columns.rate_hz;
        let starts: Vec<f64> =
            truth.source_gains_db.iter().map(|db| (level * 10f64.powf(0.1 * db)).sqrt()).collect();
        for i in 0..columns.samples[0].len() {
            let noise: f64 = random.sample(StandardNormal);
            let late_s = columns.start_s + i as f64 / columns.rate_hz - direct_s;
            if late_s <= 0.0 {
                continue;
            }
            let risen = (1.0 - (-late_s / rise_s).exp()).sqrt();
            for ((column, start), decay_s) in columns.samples.iter_mut().zip(&starts).zip(decay_s) {
                column[i] += noise * start * risen * 10f64.powf(-3.0 * late_s / decay_s);
            }
        }
    }
}

/// Until when the tails matter, in seconds.
pub(crate) fn tails_end_s(effects: &[Hidden]) -> f64 {
    let end = |effect: &Hidden| match effect {
        Hidden::CoupledVolume { level_db, decay_s, .. } => {
            decay_s.iter().copied().fold(0.0, f64::max) * (CUT_DB + level_db).max(0.0) / 60.0
        }
        _ => 0.0,
    };
    effects.iter().map(end).fold(0.0, f64::max)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}
