//! The standing waves of a box, against image sources summed one by one and against first-order theory.

use sabine_testkit::BoxModes;
use std::f64::consts::{PI, TAU};

const SPEED_M_S: f64 = 343.2;

/// Image sources of a rigid box in lossy air, exp(-loss r).
fn images(size: [f64; 3], source: [f64; 3], receiver: [f64; 3], hz: f64, loss: f64) -> (f64, f64) {
    let k = TAU * hz / SPEED_M_S;
    let reach = 64i32;
    let (mut re, mut im) = (0.0, 0.0);
    let offsets = |a: usize| -> Vec<f64> {
        let both = |m: i32| [1.0, -1.0].map(|s| s * source[a] + 2.0 * f64::from(m) * size[a] - receiver[a]);
        (-reach..=reach).flat_map(both).collect()
    };
    let [xs, ys, zs] = [0, 1, 2].map(offsets);
    for x in &xs {
        for y in &ys {
            for z in &zs {
                let r = (x * x + y * y + z * z).sqrt();
                let amplitude = (-loss * r).exp() / r;
                re += amplitude * (k * r).cos();
                im -= amplitude * (k * r).sin();
            }
        }
    }
    (re, im)
}

#[test]
fn absorption_and_admittance_belong_together() {
    for absorption in [0.0, 0.01, 0.1, 0.3, 0.7, 0.9] {
        let admittance = BoxModes::admittance(absorption);
        assert!((BoxModes::absorption(admittance) - absorption).abs() < 1e-10, "{absorption}");
    }
    // Kuttruff, Room Acoustics, section 2.5: at most 0.951, where the impedance is 1.57.
    assert!((BoxModes::absorption(1.0 / 1.567) - 0.951).abs() < 5e-4);
}

#[test]
fn a_rigid_box_sounds_as_its_images() {
    let size = [1.7, 1.3, 1.1];
    let (source, receiver) = ([0.3, 0.4, 0.25], [1.2, 0.9, 0.8]);
    let loss_per_m = 0.12;
    let walls = BoxModes::new(size, [0.0; 6], SPEED_M_S).with_air_loss(loss_per_m);
    for hz in [60.0, 115.0, 132.0, 180.0] {
        let (re, im) = walls.pressure(source, receiver, hz);
        let (re_images, im_images) = images(size, source, receiver, hz, loss_per_m);
        let off = (re - re_images).hypot(im - im_images) / re_images.hypot(im_images);
        assert!(off < 1e-6, "{hz} Hz: {re} {im}, images {re_images} {im_images}");
    }
}

#[test]
fn decay_follows_first_order_theory_where_admittances_are_small() {
    let size = [4.1, 3.3, 2.6];
    let admittances = [0.001, 0.002, 0.0005, 0.001, 0.003, 0.001];
    let walls = BoxModes::new(size, admittances, SPEED_M_S);
    for n in [[1, 0, 0], [0, 2, 0], [1, 1, 0], [2, 1, 3]] {
        let (hz, decay_per_s) = walls.mode(n);
        // Kuttruff, Room Acoustics, equation 3.29: each wall counts twice for modes that run against it.
        let wall = |a: usize| {
            let factor = if n[a] == 0 { 1.0 } else { 2.0 };
            factor * (admittances[2 * a] + admittances[2 * a + 1]) / size[a]
        };
        let expected = 0.5 * SPEED_M_S * (0..3).map(wall).sum::<f64>();
        assert!((decay_per_s / expected - 1.0).abs() < 0.01, "{n:?}: {decay_per_s} per s, {expected}");
        let rigid = 0.5 * SPEED_M_S * (0..3).map(|a| (f64::from(n[a]) / size[a]).powi(2)).sum::<f64>().sqrt();
        assert!((hz / rigid - 1.0).abs() < 1e-3, "{n:?}: {hz} Hz, {rigid}");
    }
}

#[test]
fn pressure_peaks_at_the_modes_and_is_reciprocal() {
    let walls = BoxModes::new([4.1, 3.3, 2.6], [0.02; 6], SPEED_M_S);
    let (a, b) = ([0.5, 0.6, 0.4], [3.4, 2.2, 1.9]);
    let level = |hz: f64| {
        let (re, im) = walls.pressure(a, b, hz);
        re.hypot(im)
    };
    let (hz, decay_per_s) = walls.mode([1, 0, 0]);
    // Half a width away the energy has halved.
    let half_width_hz = decay_per_s / (2.0 * PI);
    let ratio = (level(hz + half_width_hz) + level(hz - half_width_hz)) / (2.0 * level(hz));
    assert!((ratio - 0.5f64.sqrt()).abs() < 0.05, "{ratio}");
    let (there, back) = (walls.pressure(a, b, 97.0), walls.pressure(b, a, 97.0));
    assert!((there.0 - back.0).abs() < 1e-9 && (there.1 - back.1).abs() < 1e-9);
}
