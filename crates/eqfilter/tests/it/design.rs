//! What a designed filter does, measured by code that shares nothing with the design.

use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use sabine_acoustics::{Bands, OutOfRange, PerBand, Signal};
use sabine_eqfilter::{AboveBand, EqDesigner, EqFilter, EqFilterConfig, Error, Phase};
use std::f64::consts::{PI, TAU};

/// Power response by the plain Fourier sum, the phase turned on from tap to tap.
fn power(taps: &[f32], hz: f64, rate_hz: u32) -> f64 {
    let (turn_im, turn_re) = (TAU * hz / f64::from(rate_hz)).sin_cos();
    let (mut re, mut im, mut phase_re, mut phase_im) = (0.0, 0.0, 1.0, 0.0);
    for &tap in taps {
        re += f64::from(tap) * phase_re;
        im += f64::from(tap) * phase_im;
        (phase_re, phase_im) =
            (phase_re * turn_re - phase_im * turn_im, phase_re * turn_im + phase_im * turn_re);
    }
    re * re + im * im
}

/// Mean power response in dB over the octave about `centre_hz`, whose gain crosses over to its neighbours' between the centres
/// like cos(pi/2 s), s the quintic step over the logarithm of frequency: a sum of 600 points equally spaced in frequency.
fn octave_gain_db(taps: &[f32], centre_hz: f64, rate_hz: u32) -> f64 {
    let octave = 10_f64.powf(0.3);
    let (low, high) = (centre_hz / octave, (centre_hz * octave).min(f64::from(rate_hz) / 2.0));
    let (mut sum, mut total) = (0.0, 0.0);
    for i in 0..600 {
        let hz = low + (high - low) * (f64::from(i) + 0.5) / 600.0;
        let u = 1.0 - ((hz / centre_hz).ln() / octave.ln()).abs();
        let s = 6.0 * u.powi(5) - 15.0 * u.powi(4) + 10.0 * u.powi(3);
        let weight = (PI / 2.0 * s).sin().powi(2);
        sum += weight * power(taps, hz, rate_hz);
        total += weight;
    }
    10.0 * (sum / total).log10()
}

fn gains(bands: Bands, values: &[f64]) -> PerBand<f64> {
    PerBand::new(bands, values[..bands.len()].to_vec()).expect("one value for each band")
}

#[test]
fn alternating_15_db_is_met_in_every_octave_at_every_rate() {
    let bands = Bands::SIMULATION;
    for rate_hz in [16_000, 44_100, 48_000, 96_000] {
        for sign in [15.0, -15.0] {
            let wanted = PerBand::from_fn(bands, |b| if b % 2 == 0 { sign } else { -sign });
            let filter = EqFilter::design(&wanted, rate_hz, EqFilterConfig::default()).unwrap();
            for (b, (_, wanted_db)) in wanted.iter().enumerate() {
                let found = octave_gain_db(filter.taps(), bands.exact_hz(b), rate_hz);
                let hz = bands.nominal_hz(b);
                assert!(
                    (found - wanted_db).abs() < 0.1,
                    "{rate_hz} Hz, {hz} Hz: {found} != {wanted_db}, {:?}",
                    filter.realised_db().values()[b]
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..Default::default()
    })]

    #[test]
    fn gains_within_15_db_are_met(
        values in prop::collection::vec(-15.0..15.0_f64, 8),
        rate_hz in prop::sample::select(vec![16_000_u32, 44_100, 48_000]),
    ) {
        let bands = Bands::SIMULATION;
        let filter = EqFilter::design(&gains(bands, &values), rate_hz, EqFilterConfig::default()).unwrap();
        for (b, wanted) in values.iter().enumerate() {
            let found = octave_gain_db(filter.taps(), bands.exact_hz(b), rate_hz);
            prop_assert!((found - wanted).abs() < 0.1, "{} Hz: {} != {}", bands.nominal_hz(b), found, wanted);
            let claimed = filter.realised_db().values()[b].unwrap();
            prop_assert!((found - claimed).abs() < 0.1, "{} claimed, {} found", claimed, found);
        }
    }

    #[test]
    fn linear_phase_filters_are_symmetric_about_the_delay(
        values in prop::collection::vec(-20.0..20.0_f64, 8),
        rate_hz in prop::sample::select(vec![8_000_u32, 16_000, 22_050, 96_000]),
        delay_s in 0.004..0.05_f64,
        window_method: bool,
    ) {
        let config = EqFilterConfig { delay_s, above: None };
        let wanted = gains(Bands::EQ, &values);
        let filter = if window_method {
            EqFilter::window_method(&wanted, rate_hz, config).unwrap()
        } else {
            EqFilter::design(&wanted, rate_hz, config).unwrap()
        };
        let taps = filter.taps();
        prop_assert_eq!(taps.len() % 2, 1);
        prop_assert_eq!(taps.len() / 2, (delay_s * f64::from(rate_hz)).round() as usize);
        prop_assert_eq!(filter.delay_samples(), taps.len() / 2);
        prop_assert!(taps.iter().zip(taps.iter().rev()).all(|(a, b)| a.to_bits() == b.to_bits()));
    }

    #[test]
    fn minimum_phase_keeps_the_magnitude_and_comes_first(values in prop::collection::vec(-12.0..12.0_f64, 8)) {
        let wanted = gains(Bands::EQ, &values);
        let linear = EqFilter::design(&wanted, 16_000, EqFilterConfig::default()).unwrap();
        let minimum = EqFilter::minimum_phase(&wanted, 16_000, EqFilterConfig::default()).unwrap();
        prop_assert_eq!((minimum.phase(), minimum.delay_samples()), (Phase::Minimum, 0));
        for (b, value) in values.iter().enumerate().take(7) {
            let hz = Bands::EQ.exact_hz(b);
            let found = octave_gain_db(minimum.taps(), hz, 16_000);
            prop_assert!((found - value).abs() < 0.1, "{} Hz: {} != {}", hz, found, value);
        }
        // Of all filters of this magnitude it has the most energy in any number of first taps (Oppenheim and Schafer, 5.6.3).
        let energy = |taps: &[f32]| taps.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>();
        let total = energy(linear.taps());
        for n in [1, 4, 16, 64, 256, 512] {
            prop_assert!(energy(&minimum.taps()[..n]) > energy(&linear.taps()[..n]) - 1e-6 * total);
        }
    }
}

#[test]
fn equal_gains_give_a_scaled_delay() {
    let wanted = PerBand::uniform(Bands::EQ, 6.0);
    let filter = EqFilter::design(&wanted, 16_000, EqFilterConfig::default()).unwrap();
    for (n, &tap) in filter.taps().iter().enumerate() {
        let expected = if n == 512 { 10_f64.powf(0.3) } else { 0.0 };
        assert!((f64::from(tap) - expected).abs() < 1e-4, "tap {n}: {tap}");
    }
}

#[test]
fn the_papers_setting_is_50_db_down_above_and_exact_below() {
    let wanted = PerBand::new(Bands::EQ, vec![4.0, -3.0, 2.0, -1.0, 0.0, 3.0, -6.0]).unwrap();
    for rate_hz in [16_000, 48_000] {
        let filter = EqFilter::design(&wanted, rate_hz, EqFilterConfig::PAPER).unwrap();
        for (b, (_, wanted_db)) in wanted.iter().enumerate() {
            let found = octave_gain_db(filter.taps(), Bands::EQ.exact_hz(b), rate_hz);
            assert!((found - wanted_db).abs() < 0.1, "{rate_hz} Hz, band {b}: {found} != {wanted_db}");
        }
        let mut hz = 6_500.0;
        while hz < f64::from(rate_hz) / 2.0 {
            let level = 10.0 * power(filter.taps(), hz, rate_hz).log10();
            assert!((level + 50.0).abs() < 3.0, "{rate_hz} Hz sampling, {hz} Hz: {level} dB");
            hz += 25.0;
        }
    }
}

#[test]
fn bands_above_nyquist_have_no_gain_and_no_effect() {
    let bands = Bands::octaves(125.0, 16_000.0).unwrap();
    let with = |top: f64| {
        let wanted = PerBand::from_fn(bands, |b| if b == 7 { top } else { b as f64 });
        EqFilter::design(&wanted, 16_000, EqFilterConfig::default()).unwrap()
    };
    let filter = with(3.0);
    assert_eq!(filter.taps(), with(-40.0).taps());
    let realised = filter.realised_db();
    assert_eq!(realised.at_hz(16_000.0), Some(&None));
    // 8 kHz is half the sample rate, the exact centre 7943 Hz lies below it: the lower half of the octave counts.
    assert!((realised.at_hz(8_000.0).unwrap().unwrap() - 6.0).abs() < 0.01);
}

#[test]
fn window_method_says_by_how_much_it_misses() {
    let wanted = PerBand::from_fn(Bands::EQ, |b| if b % 2 == 0 { 10.0 } else { -10.0 });
    let filter = EqFilter::window_method(&wanted, 16_000, EqFilterConfig::default()).unwrap();
    let mut worst: f64 = 0.0;
    for b in 0..7 {
        let found = octave_gain_db(filter.taps(), Bands::EQ.exact_hz(b), 16_000);
        let claimed = filter.realised_db().values()[b].unwrap();
        assert!((found - claimed).abs() < 0.1, "band {b}: {found} != {claimed}");
        worst = worst.max((found - wanted.values()[b]).abs());
    }
    assert!(worst > 1.0, "without correction an alternating pattern cannot be met: {worst}");
}

#[test]
fn the_delay_is_taken_out_or_kept_as_asked() {
    let wanted = PerBand::new(Bands::EQ, vec![0.0, 1.0, 0.0, -1.0, 0.0, 2.0, -3.0]).unwrap();
    let filter = EqFilter::design(&wanted, 16_000, EqFilterConfig::default()).unwrap();
    let mut samples = vec![0.0; 3000];
    samples[1000] = 1.0;
    let signal = Signal::new(samples, 16_000).unwrap();
    let aligned = filter.apply(&signal).unwrap();
    assert_eq!(aligned.samples().len(), 3000);
    let late = filter.apply_with_delay(&signal).unwrap();
    assert_eq!(late.samples().len(), 3000 + 1024);
    for (n, &tap) in filter.taps().iter().enumerate() {
        assert!((aligned.samples()[1000 - 512 + n] - tap).abs() < 1e-6);
        assert!((late.samples()[1000 + n] - tap).abs() < 1e-6);
    }
    let other_rate = Signal::new(vec![1.0], 48_000).unwrap();
    assert!(matches!(
        filter.apply(&other_rate),
        Err(Error::SampleRate { filter_hz: 16_000, signal_hz: 48_000 })
    ));
}

#[test]
fn a_short_delay_comes_near_and_says_how_near() {
    // 4 ms resolve 250 Hz: the octave at 62.5 Hz cannot differ from its neighbours by 15 dB, and the filter says so.
    let wanted = PerBand::new(Bands::EQ, vec![15.0, -15.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
    let config = EqFilterConfig { delay_s: 0.004, above: None };
    let filter = EqFilter::design(&wanted, 16_000, config).unwrap();
    let misses: Vec<f64> =
        (0..7).map(|b| filter.realised_db().values()[b].unwrap() - wanted.values()[b]).collect();
    assert!(misses[0].abs().max(misses[1].abs()) > 1.0, "{misses:?}");
    for b in 0..7 {
        let found = octave_gain_db(filter.taps(), Bands::EQ.exact_hz(b), 16_000);
        assert!((found - filter.realised_db().values()[b].unwrap()).abs() < 0.2, "band {b}");
    }
}

#[test]
fn the_same_gains_give_the_same_bits_from_any_plan() {
    let wanted = PerBand::from_fn(Bands::T60, |b| (b as f64).sin() * 9.0);
    let once = EqFilter::design(&wanted, 44_100, EqFilterConfig::default()).unwrap();
    let planner = EqDesigner::new(Bands::T60, 44_100, EqFilterConfig::default()).unwrap();
    assert_eq!(planner.design(&wanted).unwrap(), once);
    assert_eq!(EqFilter::design(&wanted, 44_100, EqFilterConfig::default()).unwrap(), once);
    assert_eq!(planner.taps(), once.taps().len());
}

#[test]
fn wrong_settings_and_gains_are_named() {
    let flat = PerBand::uniform(Bands::EQ, 0.0);
    let design = |rate_hz, config| EqFilter::design(&flat, rate_hz, config);
    let good = EqFilterConfig::default();
    let out_of_range = |result| match result {
        Err(Error::OutOfRange(OutOfRange { field, .. })) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(out_of_range(design(0, good)), "sample_rate_hz");
    assert_eq!(out_of_range(design(16_000, EqFilterConfig { delay_s: f64::NAN, ..good })), "delay_s");
    let above =
        |from_band_hz, gain_db| EqFilterConfig { above: Some(AboveBand { from_band_hz, gain_db }), ..good };
    assert_eq!(out_of_range(design(16_000, above(8000.0, f64::INFINITY))), "above.gain_db");
    assert!(matches!(design(16_000, above(4000.0, 0.0)), Err(Error::AboveOverlaps { .. })));
    assert!(design(16_000, above(8000.0, 0.0)).is_ok());
    assert!(matches!(design(16_000, above(9000.0, 0.0)), Err(Error::Acoustics(_))));
    let high = PerBand::uniform(Bands::octaves(8000.0, 16_000.0).unwrap(), 0.0);
    assert!(matches!(EqFilter::design(&high, 8_000, good), Err(Error::NothingBelowNyquist { .. })));
    for bad in [f64::NAN, 121.0] {
        let wanted = PerBand::from_fn(Bands::EQ, |b| if b == 2 { bad } else { 0.0 });
        for result in
            [EqFilter::design(&wanted, 16_000, good), EqFilter::window_method(&wanted, 16_000, good)]
        {
            assert!(matches!(result, Err(Error::Gain { band_hz: 250.0, .. })));
        }
    }
    let designer = EqDesigner::new(Bands::T60, 16_000, good).unwrap();
    assert!(matches!(designer.design(&flat), Err(Error::Bands { planned: 7, given: 7, .. })));
}
