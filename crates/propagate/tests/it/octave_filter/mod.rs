//! Octave filters in the time domain.

use sabine_acoustics::{Bands, EnergyDecayCurve};

/// Second-order section.
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

/// Butterworth low pass or high pass of eighth order, by bilinear transform with prewarping.
fn butterworth(edge_hz: f64, rate_hz: f64, high_pass: bool) -> Vec<Section> {
    let k = (std::f64::consts::PI * edge_hz / rate_hz).tan();
    (0..4)
        .map(|i| {
            let damping = 2.0 * (std::f64::consts::PI * (2 * i + 1) as f64 / 16.0).cos();
            let norm = 1.0 / (1.0 + damping * k + k * k);
            let a = [2.0 * (k * k - 1.0) * norm, (1.0 - damping * k + k * k) * norm];
            let b = if high_pass {
                [norm, -2.0 * norm, norm]
            } else {
                [k * k * norm, 2.0 * k * k * norm, k * k * norm]
            };
            Section { b, a }
        })
        .collect()
}

/// Octave-filtered samples; run backwards in time, so that the filter's own decay does not lengthen the room's.
pub fn octave(samples: &[f32], rate_hz: f64, bands: Bands, band: usize) -> Vec<f64> {
    let (low, high) = bands.edges_hz(band);
    let mut sections = butterworth(low, rate_hz, true);
    if high < 0.45 * rate_hz {
        sections.extend(butterworth(high, rate_hz, false));
    }
    let mut signal: Vec<f64> = samples.iter().rev().map(|&s| f64::from(s)).collect();
    signal.resize(samples.len() + (8.0 * rate_hz / low) as usize, 0.0);
    for section in sections {
        let (mut z1, mut z2) = (0.0, 0.0);
        for x in &mut signal {
            let y = section.b[0] * *x + z1;
            z1 = section.b[1] * *x - section.a[0] * y + z2;
            z2 = section.b[2] * *x - section.a[1] * y;
            *x = y;
        }
    }
    signal.truncate(samples.len());
    signal.reverse();
    signal
}

/// Decay time in an octave from -5 dB to `end_db`.
pub fn measured_t_s(samples: &[f32], rate_hz: f64, bands: Bands, band: usize, end_db: f64) -> f64 {
    let energy: Vec<f64> = octave(samples, rate_hz, bands, band).iter().map(|v| v * v).collect();
    EnergyDecayCurve::from_energy(&energy, 1.0 / rate_hz).decay_time_s(-5.0, end_db).unwrap()
}
