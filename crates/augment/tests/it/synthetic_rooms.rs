//! Are the synthetic rooms plausible?

use sabine_augment::{Error, Labels, SyntheticRoomConfig, SyntheticRooms};

#[test]
fn the_seed_decides_and_the_labels_can_be_read() {
    let rooms = SyntheticRooms::new(SyntheticRoomConfig::default()).unwrap();
    assert_eq!(rooms.draw(1).unwrap(), rooms.draw(1).unwrap());
    assert_ne!(rooms.draw(1).unwrap(), rooms.draw(2).unwrap());
    let (mut readings, mut possible, mut mid) = (0, 0, Vec::new());
    for seed in 0..60 {
        let response = rooms.draw(seed).unwrap();
        assert!((response.peak() - 1.0).abs() < 1e-4);
        let labels = Labels::measure(&response).unwrap();
        possible += 7;
        readings += labels.t60_s().values().iter().filter(|r| r.is_ok()).count();
        if let Some(Ok(t)) = labels.t60_s().at_hz(1000.0) {
            mid.push(t.value);
        }
    }
    assert!(readings as f64 > 0.95 * f64::from(possible), "{readings} of {possible}");
    // Drawn from 0.1 to 1.5 s, with 15 % up to 2.5 s: mean about 0.97 s, standard error of 60 draws 0.07 s.
    let mean = mid.iter().sum::<f64>() / mid.len() as f64;
    assert!((mean - 0.97).abs() < 0.28, "{mean} s");
}

#[test]
fn a_plain_room_decays_as_drawn() {
    // No second slope, no floor, no loudspeaker: what is measured is what a diffuse field of that time has. The shape of
    // the octaves is drawn about the value at 1 kHz with a spread of 5 %, and air shortens it a little.
    let rooms = SyntheticRooms::new(SyntheticRoomConfig {
        t60_s: (0.6, 0.6),
        long_fraction: 0.0,
        double_slope_fraction: 0.0,
        noise_floor_fraction: 0.0,
        eq_inflation: 0.0,
        ..SyntheticRoomConfig::default()
    })
    .unwrap();
    let mut ratios: Vec<f64> = (0..40)
        .filter_map(|seed| {
            let labels = Labels::measure(&rooms.draw(seed).unwrap()).unwrap();
            labels.t60_s().at_hz(1000.0).and_then(|r| r.as_ref().ok().map(|e| e.value / 0.6))
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    assert!(ratios.len() >= 38);
    let median = ratios[ratios.len() / 2];
    // Spread of one draw about 8 % (shape 5 %, reading 5 %, cross-over to the neighbours): standard error 1.6 %.
    assert!((median - 0.97).abs() < 0.07, "median {median}");
}

#[test]
fn settings_are_checked() {
    for config in [
        SyntheticRoomConfig { sample_rate_hz: 100, ..SyntheticRoomConfig::default() },
        SyntheticRoomConfig { t60_s: (1.0, 0.5), ..SyntheticRoomConfig::default() },
        SyntheticRoomConfig { long_fraction: 1.5, ..SyntheticRoomConfig::default() },
        SyntheticRoomConfig { longest_s: f64::NAN, ..SyntheticRoomConfig::default() },
    ] {
        assert!(matches!(SyntheticRooms::new(config), Err(Error::Setting { .. })));
    }
}
