//! Finite differences in a box, against standing waves in closed form and against the half plane of Sommerfeld and Macdonald.

use crate::wedge_oracles::half_plane;
use sabine_testkit::{BoxModes, ThinScreen, WaveGrid};
use std::f64::consts::TAU;

const SPEED_M_S: f64 = 343.2;

fn db(energy: f64) -> f64 {
    10.0 * energy.log10()
}

fn level_db((re, im): (f64, f64)) -> f64 {
    db(re * re + im * im)
}

/// The highest point of the spectrum about a frequency, between its neighbours.
fn peak_hz(level_db: impl Fn(f64) -> f64, about_hz: f64, within_hz: f64) -> f64 {
    let steps = 40;
    let step_hz = within_hz / f64::from(steps);
    let at = |i: i32| about_hz + f64::from(i) * step_hz;
    let top = (-steps..=steps).max_by(|&a, &b| level_db(at(a)).total_cmp(&level_db(at(b)))).unwrap();
    let [a, b, c] = [-1, 0, 1].map(|d| level_db(at(top + d)));
    at(top) + 0.5 * step_hz * (a - c) / (a - 2.0 * b + c)
}

#[test]
fn a_rigid_box_rings_at_its_frequencies() {
    // In the mean over directions dispersion is taken out; what is left is largest along the axes, (k h)^2 / 60.
    let grid = WaveGrid::new([31, 26, 21], 0.04, [0.0; 6], SPEED_M_S);
    let response = &grid.respond([1, 2, 1], &[[28, 24, 18]], 1.5)[0];
    let size = grid.size_m();
    let modes: Vec<f64> =
        BoxModes::new(size, [0.0; 6], SPEED_M_S).rigid_modes_hz(520.0).iter().map(|m| m.0).collect();
    let mut seen = 0;
    let mut worst = 0.0f64;
    for (i, &hz) in modes.iter().enumerate() {
        let gap = |j: Option<usize>| j.and_then(|j| modes.get(j)).map_or(100.0, |other| (other - hz).abs());
        let alone = gap(i.checked_sub(1)).min(gap(Some(i + 1))) > 8.0;
        if !alone {
            continue;
        }
        let found = peak_hz(|hz| level_db(response.pressure(hz)), hz, 4.0);
        let phase = TAU * hz / SPEED_M_S * 0.04;
        assert!((found / hz - 1.0).abs() < phase * phase / 55.0 + 3e-4, "{hz} Hz: {found}");
        worst = worst.max((found / hz - 1.0).abs());
        seen += 1;
    }
    assert!(seen >= 12, "{seen} modes of {}", modes.len());
    eprintln!("{seen} of {} modes, worst {:.3} %", modes.len(), 100.0 * worst);
}

#[test]
fn a_box_with_absorbing_walls_sounds_as_its_modes() {
    let admittances = [0.02, 0.1, 0.05, 0.3, 0.15, 0.08];
    let grid = WaveGrid::new([52, 41, 37], 0.04, admittances, SPEED_M_S);
    let (source, receiver) = ([11, 30, 9], [41, 8, 25]);
    let response = &grid.respond(source, &[receiver], 0.7)[0];
    let exact = BoxModes::new(grid.size_m(), admittances, SPEED_M_S);
    let (mut off, mut sum) = ([0.0; 2], [0.0; 2]);
    for i in 0..60 {
        // 75 to 700 Hz: down to twelve cells in a wave.
        let hz = 75.0 * (700.0f64 / 75.0).powf(f64::from(i) / 59.0);
        let (re, im) = response.pressure(hz);
        let (re_exact, im_exact) = exact.pressure(grid.centre_m(source), grid.centre_m(receiver), hz);
        let half = usize::from(hz > 250.0);
        off[half] += (re - re_exact).powi(2) + (im - im_exact).powi(2);
        sum[half] += re_exact.powi(2) + im_exact.powi(2);
    }
    let error = [0, 1].map(|half| (off[half] / sum[half]).sqrt());
    eprintln!(
        "relative error of the pressure: {:.2} % below 250 Hz, {:.2} % above",
        100.0 * error[0],
        100.0 * error[1]
    );
    assert!(error[0] < 0.01 && error[1] < 0.07, "{error:?}");
}

/// The field about a screen that reaches from wall to wall and from the floor to half the height, until anything comes back from a
/// wall: in the shadow, at its border and in the light.
#[test]
fn a_screen_is_the_half_plane_of_macdonald() {
    let cells = [130, 150, 140];
    let grid = WaveGrid::new(cells, 0.04, [0.0; 6], SPEED_M_S);
    let screen = ThinScreen { axis: 0, after: 65, from: [0, 0], to: [150, 70], admittance: 0.0 };
    let source = [45, 75, 60];
    let receivers = [[85, 75, 40], [85, 75, 60], [85, 78, 75], [85, 75, 79], [88, 70, 95], [75, 75, 55]];
    // The shortest way by a wall is 5.2 m long: 15.1 ms.
    let responses = grid.with_screen(&screen).respond(source, &receivers, 0.0148);
    let edge = [65.0 * 0.04, 70.0 * 0.04];
    let mut worst = 0.0f64;
    for (response, cell) in responses.iter().zip(receivers) {
        let about = |cell: [usize; 3]| {
            let [x, y, z] = cell.map(|i| (i as f64 + 0.5) * 0.04);
            // From the face towards the source, over the edge, to that behind.
            let (away, below) = (edge[0] - x, edge[1] - z);
            [away.hypot(below), away.atan2(below).rem_euclid(TAU), y]
        };
        let (from, to) = (about(source), about(cell));
        let over_m = (from[0] + to[0]).hypot(from[2] - to[2]);
        for hz in [200.0, 315.0, 500.0, 710.0, 1000.0] {
            let expected = db(half_plane(TAU * hz / SPEED_M_S, from, to) / (over_m * over_m));
            let found = level_db(response.pressure(hz));
            eprintln!("{cell:?} {hz} Hz: {found:.2} {expected:.2}");
            worst = worst.max((found - expected).abs());
        }
    }
    eprintln!("worst difference from Macdonald's solution: {worst:.2} dB");
    assert!(worst < 0.8, "{worst} dB");
}

#[test]
fn a_response_is_that_of_the_free_field_until_the_first_wall_and_the_same_on_any_number_of_threads() {
    let cells = [60, 50, 46];
    let grid = WaveGrid::new(cells, 0.04, [0.05; 6], SPEED_M_S);
    let (source, receiver) = ([20, 25, 23], [44, 27, 22]);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| grid.respond(source, &[receiver], 0.3).remove(0))
    };
    let response = run(1);
    assert_eq!(response, run(3));
    let samples = response.impulse_response(8000, 2400, [30.0, 60.0, 1400.0, 1900.0]);
    let [a, b] = [source, receiver].map(|c| grid.centre_m(c));
    let distance_m = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    // The first reflection comes after 48 samples.
    let largest = (0..36).max_by(|&i, &j| samples[i].total_cmp(&samples[j])).unwrap();
    assert!((largest as f64 / 8000.0 - distance_m / SPEED_M_S).abs() < 1.0 / 8000.0, "{largest}");
    // Well above the lower edge, whose ringing goes on before the beginning, the spectrum of the samples is the pressure.
    for hz in [340.0, 770.0, 1300.0] {
        let turn = |(i, s): (usize, &f64)| {
            let (im, re) = (-TAU * hz * i as f64 / 8000.0).sin_cos();
            [s * re, s * im]
        };
        let [re, im] = samples.iter().enumerate().map(turn).fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let (re_grid, im_grid) = response.pressure(hz);
        let off = (re - re_grid).hypot(im - im_grid) / re_grid.hypot(im_grid);
        assert!(off < 0.03, "{hz} Hz: {off}");
    }
}
