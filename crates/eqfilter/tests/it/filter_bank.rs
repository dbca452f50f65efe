//! The final judge: the gain of a designed filter as the project's own octave filter bank measures it.

use sabine_acoustics::{Bands, FilterBank, PerBand};
use sabine_eqfilter::{EqFilter, EqFilterConfig};

/// Energy of each octave of an impulse through the taps, relative to that of the impulse, in dB.
fn measured_db(taps: &[f32], delay: usize, rate_hz: u32) -> Vec<f64> {
    let bank = FilterBank::new(Bands::SIMULATION, rate_hz).expect("a common rate");
    // A second of room on either side for the bank's own ringing.
    let (middle, length) = (rate_hz as usize, 2 * rate_hz as usize);
    let (mut impulse, mut filtered) = (vec![0.0; length], vec![0.0; length]);
    impulse[middle] = 1.0;
    filtered[middle - delay..][..taps.len()].copy_from_slice(taps);
    let energies = |samples: &[f32]| -> Vec<f64> {
        let bands = bank.analyse(samples);
        bands.values().iter().map(|band| band.iter().map(|&x| f64::from(x).powi(2)).sum()).collect()
    };
    energies(&filtered).iter().zip(energies(&impulse)).map(|(y, x)| 10.0 * (y / x).log10()).collect()
}

#[test]
fn the_filter_bank_measures_the_gains_that_were_wanted() {
    let bands = Bands::SIMULATION;
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) * 30.0 - 15.0
    };
    let mut sets: Vec<PerBand<f64>> = (0..10).map(|_| PerBand::from_fn(bands, |_| uniform())).collect();
    for sign in [15.0, -15.0] {
        sets.push(PerBand::from_fn(bands, |b| if b % 2 == 0 { sign } else { -sign }));
    }
    for rate_hz in [16_000, 48_000] {
        let mut worst = [0.0_f64; 8];
        for wanted in &sets {
            let linear = EqFilter::design(wanted, rate_hz, EqFilterConfig::default()).unwrap();
            let minimum = linear.clone().into_minimum_phase();
            for filter in [&linear, &minimum] {
                let found = measured_db(filter.taps(), filter.delay_samples(), rate_hz);
                for ((worst, found), wanted) in worst.iter_mut().zip(found).zip(wanted.values()) {
                    *worst = worst.max((found - wanted).abs());
                }
            }
        }
        println!("{rate_hz} Hz, worst error in dB: {worst:.3?}");
        assert!(worst.iter().all(|&error| error < 0.2), "{rate_hz} Hz: {worst:?}");
    }
}
