//! Rooms with a screen: what is hidden behind it is so in the responses too.

use sabine_testkit::{ScreenedConfig, ScreenedRoom};

#[test]
fn a_screen_weakens_and_delays_the_first_sound_behind_it_and_none_before_it() {
    let config = ScreenedConfig { seed: 5, receivers: 8, screen: true };
    let started = std::time::Instant::now();
    let screened = ScreenedRoom::new(config).unwrap();
    let responses = screened.responses().unwrap();
    eprintln!("{:.1} s, {} samples", started.elapsed().as_secs_f64(), responses[0].samples().len());
    let open = ScreenedRoom::new(ScreenedConfig { screen: false, ..config }).unwrap();
    let without = open.responses().unwrap();
    let shadowed = screened.shadowed();
    assert_eq!(shadowed, ["r1", "r2", "r3", "r4"]);
    for (i, (with, without)) in responses.iter().zip(&without).enumerate() {
        // The first millisecond of what arrives without the screen.
        let peak = without.samples().iter().map(|s| s.abs()).fold(0.0f32, f32::max);
        let first = without.samples().iter().position(|s| s.abs() > 0.3 * peak).unwrap();
        let energy =
            |samples: &[f32]| samples[first..first + 8].iter().map(|s| f64::from(s * s)).sum::<f64>();
        let change_db = 10.0 * (energy(with.samples()) / energy(without.samples())).log10();
        eprintln!("r{}: {change_db:.1} dB", i + 1);
        if i < shadowed.len() {
            assert!(change_db < -5.0, "r{}: {change_db}", i + 1);
        } else {
            assert!(change_db.abs() < 2.0, "r{}: {change_db}", i + 1);
        }
    }
}
