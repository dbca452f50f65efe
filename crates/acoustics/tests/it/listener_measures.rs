//! Sound strength, lateral energy and interaural correlation against closed forms: pulses whose energies and products are known,
//! and Gaussian decays whose expectations are.

use crate::synthetic::decay;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use sabine_acoustics::{
    Bands, Error, FreeFieldReference, ImpulseResponse, InterauralCorrelation, LateralEnergy,
    LateralNormalisation, NoReading, PerBand, Reading, SoundStrength, bass_ratio, low_frequency_level,
    low_frequency_mean, mid_frequency_mean,
};

const RATE: u32 = 48_000;

/// Pulses at times in seconds after 0.1 s, in one second.
fn pulses(list: &[(f64, f64)]) -> ImpulseResponse {
    let mut samples = vec![0.0_f32; RATE as usize];
    for (time_s, amplitude) in list {
        samples[((0.1 + time_s) * f64::from(RATE)).round() as usize] += *amplitude as f32;
    }
    ImpulseResponse::new(samples, RATE).unwrap()
}

fn octaves() -> Bands {
    Bands::octaves(125.0, 8000.0).unwrap()
}

fn value(reading: &Reading) -> f64 {
    reading.as_ref().unwrap().value
}

#[test]
fn strength_of_pulses_is_that_of_their_energies() {
    // In octaves from 500 Hz on, whose filters ring for less than what lies between the pulses.
    let bands = Bands::octaves(500.0, 8000.0).unwrap();
    let response = pulses(&[(0.0, 0.2), (0.03, 0.1), (0.2, 0.1)]);
    let reference = FreeFieldReference::unit_source(bands, RATE).unwrap();
    let found = SoundStrength::measure(&response, &reference).unwrap();
    // At 10 m a pulse of 0.1.
    for (hz, g_db) in found.g_db.iter() {
        assert!((value(g_db) - 10.0 * 6f64.log10()).abs() < 0.02, "{hz} Hz: {g_db:?}");
    }
    for (hz, early) in found.early_db.iter() {
        assert!((value(early) - 10.0 * 5f64.log10()).abs() < 0.02, "{hz} Hz: {early:?}");
    }
    for (hz, late) in found.late_db.iter() {
        assert!(value(late).abs() < 0.02, "{hz} Hz: {late:?}");
    }
}

/// A reference at 3 m, one as an exposure level at 10 m, and one over directions say the same of the same source.
#[test]
fn references_agree() {
    let response = pulses(&[(0.0, 0.3)]);
    let at_3_m = pulses(&[(0.0, 1.0 / 3.0)]);
    let by_distance = FreeFieldReference::measured(std::slice::from_ref(&at_3_m), 3.0, octaves()).unwrap();
    // Directions of amplitudes whose squares have the mean of one.
    let directions = [0.5, (2.0f64 - 0.25).sqrt()].map(|a| pulses(&[(0.0, a)]));
    let by_directions = FreeFieldReference::measured(&directions, 1.0, octaves()).unwrap();
    // A pulse of 0.1 passes a band of bandwidth B = f (2^0.5 - 2^-0.5) as 0.01 B / (rate / 2) / rate over time: the
    // crossovers are symmetric in the logarithm, not in frequency, hence the tolerance.
    let level = PerBand::from_fn(octaves(), |i| {
        let (low, high) = octaves().edges_hz(i);
        10.0 * (0.01 * (high - low) / (0.5 * f64::from(RATE)) / f64::from(RATE)).log10()
    });
    let by_level = FreeFieldReference::from_exposure_levels(&level, RATE).unwrap();
    // Of a pulse in the octave at 125 Hz 0.4 % of the energy rings before the first step that counts, 0.02 dB.
    for (reference, tolerance_db) in [(by_distance, 0.025), (by_directions, 0.025), (by_level, 0.3)] {
        let found = SoundStrength::measure(&response, &reference).unwrap();
        for (hz, g_db) in found.g_db.iter() {
            assert!((value(g_db) - 20.0 * 3f64.log10()).abs() < tolerance_db, "{hz} Hz: {g_db:?}");
        }
    }
}

/// Gaussian decays on noise 45 dB below their start: the expected energy is that of the envelope. What one response misses it by
/// is chance; over 24 of them the mean must be within 0.1 dB. Half of them end while they are 25 dB above zero.
#[test]
fn strength_of_noisy_and_truncated_decays_has_no_bias() {
    let bands = Bands::octaves(500.0, 4000.0).unwrap();
    let reference = FreeFieldReference::unit_source(bands, RATE).unwrap();
    let t60_s = 1.2;
    // 0.1^2 sum of 10^(-6 i / (rate T)) over the energy of a pulse of 0.1.
    let expected_db = 10.0 * (1.0 / (1.0 - 10f64.powf(-6.0 / (f64::from(RATE) * t60_s)))).log10();
    for (duration_s, noise_db, what) in [(2.0, -45.0, "noisy"), (0.5, -90.0, "truncated")] {
        let mut errors = vec![0.0; bands.len()];
        for seed in 0..24 {
            let response = decay(RATE, duration_s, &[(t60_s, 0.0)], noise_db, 500 + seed);
            let found = SoundStrength::measure(&response, &reference).unwrap();
            for (sum, g_db) in errors.iter_mut().zip(found.g_db.values()) {
                *sum += (value(g_db) - expected_db) / 24.0;
            }
        }
        println!("G of {what} decays, mean error in dB from 500 Hz on: {errors:.3?}");
        // One reading has 10 / ln 10 / sqrt(B T / 13.8) of chance: 0.75 dB at 500 Hz, 0.15 dB for the mean of 24.
        for (i, error) in errors.iter().enumerate() {
            let bandwidth_hz = bands.edges_hz(i).1 - bands.edges_hz(i).0;
            let chance_db = 4.34 / (bandwidth_hz * 2.0 * t60_s / 13.8).sqrt() / 24f64.sqrt();
            assert!(error.abs() < 3.0 * chance_db, "{what}, {} Hz: {error} dB", bands.nominal_hz(i));
        }
    }
}

#[test]
fn lateral_fractions_of_pulses_are_those_of_their_energies() {
    // Time, amplitude at the omnidirectional microphone, sine of the angle to the median plane.
    let arrivals =
        [(0.0, 1.0, 0.0), (0.003, 0.6, 0.9), (0.015, 0.7, -0.8), (0.06, 0.5, 0.5), (0.12, 0.4, 1.0)];
    let omni = pulses(&arrivals.map(|(t, a, _)| (t, a)));
    let eight = pulses(&arrivals.map(|(t, a, sine)| (t, a * sine)));
    let reference = FreeFieldReference::unit_source(octaves(), RATE).unwrap();
    let found =
        LateralEnergy::measure(&omni, &eight, LateralNormalisation::Equal, octaves(), Some(&reference))
            .unwrap();
    // The definitions: the direct sound and what comes before 5 ms is in the denominator alone.
    let early: f64 = 1.0 + 0.36 + 0.49 + 0.25;
    let fraction = (0.49 * 0.64 + 0.25 * 0.25) / early;
    let cosine = (0.49 * 0.8 + 0.25 * 0.5) / early;
    let late_db = 10.0 * (0.16f64 / 0.01).log10();
    // Arrivals 3 ms apart overlap in octaves below 1 kHz: there the product of both is not nothing.
    for i in 3..octaves().len() {
        let hz = octaves().nominal_hz(i);
        assert!((value(&found.fraction.values()[i]) - fraction).abs() < 0.01, "{hz} Hz");
        assert!((value(&found.cosine_fraction.values()[i]) - cosine).abs() < 0.01, "{hz} Hz");
        let late = &found.late_level_db.as_ref().unwrap().values()[i];
        assert!((value(late) - late_db).abs() < 0.1, "{hz} Hz: {late:?}");
    }
    // What was louder by sqrt(2) or sqrt(3) is the same sound.
    for (normalisation, gain) in
        [(LateralNormalisation::FuMa, 2f64.sqrt()), (LateralNormalisation::N3d, 3f64.sqrt())]
    {
        let louder = pulses(&arrivals.map(|(t, a, sine)| (t, a * sine * gain)));
        let other = LateralEnergy::measure(&omni, &louder, normalisation, octaves(), None).unwrap();
        for (one, two) in found.fraction.values().iter().zip(other.fraction.values()) {
            assert!((value(one) - value(two)).abs() < 1e-5);
        }
    }
}

/// A reflection at 15 ms alone after the direct sound: in every octave down to 125 Hz, whose filter rings for 10 ms.
#[test]
fn low_octaves_part_reflections_at_their_times() {
    let (omni, eight) = (pulses(&[(0.0, 1.0), (0.040, 0.5)]), pulses(&[(0.040, 0.5)]));
    let found = LateralEnergy::measure(&omni, &eight, LateralNormalisation::Equal, octaves(), None).unwrap();
    for (hz, fraction) in found.fraction.iter() {
        assert!((value(fraction) - 0.2).abs() < 0.01, "{hz} Hz: {fraction:?}");
    }
    let silent = ImpulseResponse::new(vec![0.0; RATE as usize], RATE).unwrap();
    let none = LateralEnergy::measure(&omni, &silent, LateralNormalisation::Equal, octaves(), None).unwrap();
    assert!(none.fraction.values().iter().all(|fraction| value(fraction) == 0.0));
}

/// Two ears that share part of a Gaussian decay: the correlation is the share. With B T / 13.8 independent values in an octave,
/// one reading is off by (1 - r^2) over the root of that; the mean of 16 must be within three of its standard errors.
#[test]
fn ears_that_share_part_of_the_sound_correlate_by_that_part() {
    let bands = Bands::octaves(500.0, 4000.0).unwrap();
    for share in [0.9_f64, 0.6] {
        let mut errors = vec![0.0; bands.len()];
        for seed in 0..16 {
            let mut rng = rand_pcg::Pcg64::seed_from_u64(900 + seed);
            let mut gaussian = || -> f64 { StandardNormal.sample(&mut rng) };
            let (mut left, mut right) = (Vec::new(), Vec::new());
            for i in 0..RATE {
                let envelope = 0.1 * 10f64.powf(-3.0 * f64::from(i) / f64::from(RATE));
                let (common, own) = (gaussian(), gaussian());
                left.push((envelope * common) as f32);
                right.push((envelope * (share * common + (1.0 - share * share).sqrt() * own)) as f32);
            }
            let [left, right] = [left, right].map(|ear| ImpulseResponse::new(ear, RATE).unwrap());
            let found = InterauralCorrelation::measure(&left, &right, bands).unwrap();
            for (sum, all) in errors.iter_mut().zip(found.all.values()) {
                *sum += (value(all) - share) / 16.0;
            }
        }
        println!("IACC of {share}: mean error from 500 Hz on {errors:.3?}");
        for (i, error) in errors.iter().enumerate() {
            let bandwidth_hz = bands.edges_hz(i).1 - bands.edges_hz(i).0;
            let chance = (1.0 - share * share) / (2.0 * bandwidth_hz / 13.8).sqrt() / 4.0;
            // The largest of many correlations is above the one at delay zero by a little of that chance.
            assert!(error.abs() < 3.0 * chance + 0.003, "{} Hz: {error}", bands.nominal_hz(i));
        }
    }
}

#[test]
fn early_and_late_correlation_of_pulses() {
    // Equal at the direct sound, opposite and weaker at 30 ms; equal but for sign at 200 ms.
    let left = pulses(&[(0.0, 1.0), (0.03, 1.0), (0.2, 0.5)]);
    let right = pulses(&[(0.0, 1.0), (0.03, -0.5), (0.2, -0.5)]);
    let bands = Bands::octaves(500.0, 4000.0).unwrap();
    let found = InterauralCorrelation::measure(&left, &right, bands).unwrap();
    for i in 0..bands.len() {
        let (early, late) = (value(&found.early.values()[i]), value(&found.late.values()[i]));
        assert!((early - 0.5 / 2.5f64.sqrt()).abs() < 0.005, "{early}");
        assert!((late - 1.0).abs() < 0.005, "{late}");
        let all = (1.0 - 0.5 - 0.25_f64).abs() / (2.25f64 * 1.5).sqrt();
        assert!((value(&found.all.values()[i]) - all).abs() < 0.005);
    }
}

/// Half a sample between the ears at 16 kHz: the octave at 4 kHz has four samples to a period.
#[test]
fn a_delay_between_samples_is_found() {
    let delayed = |delay: f64| {
        let samples = (0..8000).map(|i| {
            let x = std::f64::consts::PI * (f64::from(i) - 1600.0 - delay);
            let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
            (sinc * (-(x / 60.0).powi(2)).exp()) as f32
        });
        ImpulseResponse::new(samples.collect(), 16_000).unwrap()
    };
    let bands = Bands::octaves(500.0, 4000.0).unwrap();
    let found = InterauralCorrelation::measure(&delayed(0.0), &delayed(4.5), bands).unwrap();
    for (hz, all) in found.all.iter() {
        assert!((value(all) - 1.0).abs() < 0.005, "{hz} Hz: {all:?}");
    }
}

#[test]
fn channels_that_do_not_belong_together_are_refused() {
    let one = pulses(&[(0.0, 1.0)]);
    let shorter = ImpulseResponse::new(one.samples()[..40_000].to_vec(), RATE).unwrap();
    let slower = ImpulseResponse::new(one.samples().to_vec(), 44_100).unwrap();
    let bands = octaves();
    let lateral = |other: &ImpulseResponse| {
        LateralEnergy::measure(&one, other, LateralNormalisation::Equal, bands, None).unwrap_err()
    };
    assert!(matches!(lateral(&shorter), Error::Length { expected: 48_000, found: 40_000 }));
    assert!(matches!(lateral(&slower), Error::SampleRates { left_hz: RATE, right_hz: 44_100 }));
    assert!(matches!(InterauralCorrelation::measure(&one, &shorter, bands), Err(Error::Length { .. })));
    let reference = FreeFieldReference::unit_source(bands, RATE).unwrap();
    assert!(matches!(SoundStrength::measure(&slower, &reference), Err(Error::SampleRates { .. })));
    assert!(FreeFieldReference::measured(&[], 1.0, bands).is_err());
    assert!(FreeFieldReference::measured(&[one], 0.0, bands).is_err());
}

#[test]
fn single_numbers_are_those_of_the_standard() {
    let bands = octaves();
    let of = |values: [f64; 7]| PerBand::from_fn(bands, |i| Ok(sabine_acoustics::Estimate::exact(values[i])));
    let t30_s = of([2.6, 2.2, 2.0, 1.8, 1.6, 1.2, 0.8]);
    assert!((value(&mid_frequency_mean(&t30_s)) - 1.9).abs() < 1e-12);
    assert!((value(&bass_ratio(&t30_s)) - 4.8 / 3.8).abs() < 1e-12);
    assert!((value(&low_frequency_mean(&t30_s)) - 2.15).abs() < 1e-12);
    let level = value(&low_frequency_level(&of([0.0, 0.0, 0.0, 10.0, 99.0, 99.0, 99.0])));
    assert!((level - 10.0 * 3.25f64.log10()).abs() < 1e-12);
    let above =
        PerBand::uniform(Bands::octaves(1000.0, 4000.0).unwrap(), Ok(sabine_acoustics::Estimate::exact(1.0)));
    assert!(matches!(mid_frequency_mean(&above), Err(NoReading::NoBand { .. })));
    let thirds = Bands::third_octaves(100.0, 5000.0).unwrap();
    let by_thirds = PerBand::from_fn(thirds, |i| Ok(sabine_acoustics::Estimate::exact(i as f64)));
    // 400 Hz to 1.25 kHz are the seventh to the twelfth.
    assert!((value(&mid_frequency_mean(&by_thirds)) - 8.5).abs() < 1e-12);
}
