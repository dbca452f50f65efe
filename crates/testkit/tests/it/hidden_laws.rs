//! Laws that no catalogue lists, in the direct sound that the laboratory records: against sums and products written out here.

use sabine_acoustics::{Bands, ImpulseResponse};
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use std::f64::consts::{PI, TAU};

fn lab(seed: u64) -> Laboratory {
    let bands = Bands::octaves(1000.0, 1000.0).unwrap();
    Laboratory::new(LabConfig { seed, receivers: 4, bands, ..LabConfig::default() }).unwrap()
}

/// Peaks of the direct sound, which nothing precedes, with a law over those without.
fn ratios(lab: &Laboratory, hidden: &Hidden) -> Vec<f64> {
    let first = |response: &ImpulseResponse| {
        let samples = response.samples();
        let onset = samples.iter().position(|s| s.abs() > 0.5 * response.peak()).unwrap();
        f64::from(samples[onset..onset + 8].iter().fold(0f32, |most, s| most.max(s.abs())))
    };
    let with = lab.responses(std::slice::from_ref(hidden)).unwrap();
    with.iter().zip(lab.responses(&[]).unwrap()).map(|(w, o)| first(w) / first(&o)).collect()
}

/// From the source to each receiver.
fn ways(lab: &Laboratory) -> Vec<[f64; 3]> {
    let truth = lab.truth(&[]).unwrap();
    let from = truth.sources[0].position_m;
    truth.receivers_m.iter().map(|to| [0, 1, 2].map(|k| to[k] - from[k])).collect()
}

fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

#[test]
fn fog_takes_from_the_direct_sound_by_its_length() {
    let lab = lab(21);
    let found = ratios(&lab, &Hidden::Fog { water_g_m3: 20.0, radius_um: 5.0 });
    // Lags of velocity and temperature at 1 kHz, in thick fog.
    let lag = |load: f64, tau_s: f64| load * TAU * 1000.0 * tau_s / (1.0 + (TAU * 1000.0 * tau_s).powi(2));
    let mass = 0.02 / 1.204;
    let lags = lag(mass, 2.0 * 998.0 * 25e-12 / (9.0 * 1.81e-5))
        + lag(mass * 0.4 * 4184.0 / 1005.0, 998.0 * 4184.0 * 25e-12 / (3.0 * 0.0257));
    let speed_m_s = 331.3 * (1.0 + lab.air().temperature_c() / 273.15).sqrt();
    for (ratio, way) in found.into_iter().zip(ways(&lab)) {
        let expected = (-0.5 * TAU * 1000.0 / speed_m_s * lags * length(way)).exp();
        assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio} for {expected} at {way:?}");
    }
}

#[test]
fn a_column_is_heard_by_the_elevation() {
    let lab = lab(22);
    let found = ratios(&lab, &Hidden::ColumnLoudspeaker { length_m: 0.3 });
    // Energy of a line at a sine of the elevation, in the octave of 1 kHz, and over the sphere.
    let energy = |sine: f64| {
        let of_step = |i: i32| {
            let hz = 1000.0 * 2f64.powf((f64::from(i) + 0.5) / 200.0 - 0.5);
            let x = PI * 0.3 * sine * hz / 343.2;
            if x.abs() < 1e-9 { 1.0 } else { (x.sin() / x).powi(2) }
        };
        (0..200).map(of_step).sum::<f64>() / 200.0
    };
    let mean = (0..500).map(|i| energy((f64::from(i) + 0.5) / 500.0)).sum::<f64>() / 500.0;
    for (ratio, way) in found.into_iter().zip(ways(&lab)) {
        let expected = (energy(way[2] / length(way)) / mean).sqrt();
        assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio} for {expected} at {way:?}");
    }
}

#[test]
fn sound_comes_earlier_through_warm_air_under_the_ceiling() {
    let lab = lab(23);
    let hidden = Hidden::TemperatureGradient { k_per_m: 10.0, stated_at_m: 0.0 };
    let onset = |response: &ImpulseResponse| {
        response.samples().iter().position(|s| s.abs() > 0.5 * response.peak()).unwrap() as f64
    };
    let with = lab.responses(std::slice::from_ref(&hidden)).unwrap();
    let without = lab.responses(&[]).unwrap();
    let from_m = lab.truth(&[]).unwrap().sources[0].position_m[2];
    let kelvin = lab.air().temperature_c() + 273.15;
    for (r, way) in ways(&lab).into_iter().enumerate() {
        let step_s = |i: i32| {
            let height_m = from_m + way[2] * (f64::from(i) + 0.5) / 1000.0;
            length(way) / 1000.0 / (343.2 * ((kelvin + 10.0 * height_m) / 293.15).sqrt())
        };
        let later_s = (0..1000).map(step_s).sum::<f64>() - length(way) / (343.2 * (kelvin / 293.15).sqrt());
        let found = onset(&with[r]) - onset(&without[r]);
        assert!(found < 0.0, "{found}");
        assert!((found - 48_000.0 * later_s).abs() < 1.5, "{found} for {} samples", 48_000.0 * later_s);
    }
}

#[test]
fn walls_that_take_more_leave_less_and_no_more_than_the_law_takes() {
    let lab = lab(24);
    let energy = |hidden: &[Hidden]| -> f64 {
        let all = lab.responses(hidden).unwrap();
        all.iter().flat_map(|r| r.samples().to_vec()).map(|s| f64::from(s).powi(2)).sum()
    };
    let none = energy(&[]);
    let absorber =
        |share: f64| Hidden::HelmholtzAbsorber { material: 0, share, f0_hz: 1000.0, q: 2.0, resistance: 1.0 };
    let wall = |kg_m2: f64| Hidden::LimpWall { material: 0, kg_m2 };
    assert!((energy(&[absorber(0.0)]) / none - 1.0).abs() < 1e-6);
    let [half, most] = [0.4, 0.8].map(|share| energy(&[absorber(share)]));
    assert!(most < half && half < none, "{most} {half} {none}");
    let [heavy, light] = [100.0, 0.5].map(|kg_m2| energy(&[wall(kg_m2)]));
    assert!(light < heavy && heavy < none, "{light} {heavy} {none}");
}

#[test]
fn laws_that_do_not_fit_the_room_are_refused() {
    let lab = lab(25);
    for hidden in [
        Hidden::Fog { water_g_m3: f64::NAN, radius_um: 5.0 },
        Hidden::Fog { water_g_m3: 1.0, radius_um: 0.0 },
        Hidden::TemperatureGradient { k_per_m: 20.0, stated_at_m: 1.0 },
        Hidden::TemperatureGradient { k_per_m: 1.0, stated_at_m: 9.0 },
        Hidden::WarmingLoudspeaker { final_db: -1.0, time_constant: 3.0 },
        Hidden::WarmingLoudspeaker { final_db: 1.0, time_constant: 0.0 },
        Hidden::HelmholtzAbsorber { material: 9, share: 0.5, f0_hz: 500.0, q: 2.0, resistance: 1.0 },
        Hidden::HelmholtzAbsorber { material: 0, share: 1.0, f0_hz: 500.0, q: 2.0, resistance: 1.0 },
        Hidden::LimpWall { material: 9, kg_m2: 1.0 },
        Hidden::LimpWall { material: 0, kg_m2: 0.0 },
        Hidden::ColumnLoudspeaker { length_m: f64::INFINITY },
    ] {
        assert!(lab.truth(std::slice::from_ref(&hidden)).is_err(), "{hidden:?}");
    }
}
