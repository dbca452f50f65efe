//! Does the ratio, or the equalisation, become what was asked for, and does nothing else change?

use crate::material::response;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use sabine_acoustics::{BandParameters, Bands, PerBand, equalisation};
use sabine_augment::{AugmentedResponse, Chain, DrrAugment, DrrConfig, EqAugment, EqConfig, Error};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Either the ratio measured by `acoustics` is within 0.2 dB of the target, or the change is refused because the direct
    /// peak would be buried; the late part is the same to the bit.
    #[test]
    fn the_ratio_is_met_or_refused(t60_s in 0.1..1.5_f64, target_db in -12.0..24.0_f64, seed in 0..1000_u64) {
        let recorded = response(t60_s, 1.0, 80.0, 16_000, seed);
        match DrrAugment::new(DrrConfig::default()).unwrap().to_db(&recorded, target_db) {
            Ok(changed) => {
                let found = BandParameters::full_band(&changed).drr_db.unwrap().value;
                prop_assert!((found - target_db).abs() < 0.2, "{found} dB for {target_db} dB");
                prop_assert_eq!(&changed.samples()[141..], &recorded.samples()[141..]);
                prop_assert_eq!(&changed.samples()[..60], &recorded.samples()[..60]);
            }
            Err(error) => {
                prop_assert!(matches!(error, Error::DrrUnreachable { .. }), "{error}");
                // A refusal needs a reason: with the direct peak (sample 100, 2.5 ms of Hann window either side) lowered to the
                // largest late sample, the ratio is still above the target.
                let late = &recorded.samples()[141..];
                let energy: f64 = late.iter().map(|&s| f64::from(s).powi(2)).sum();
                let peak = late.iter().fold(0.0_f32, |p, s| p.max(s.abs()));
                let alpha = f64::from(peak / recorded.samples()[100].abs());
                let early: f64 = (60..141)
                    .map(|i| {
                        let w = (std::f64::consts::PI * (i as f64 - 100.0) / 80.0).cos().powi(2);
                        ((alpha * w + 1.0 - w) * f64::from(recorded.samples()[i])).powi(2)
                    })
                    .sum();
                let least_db = 10.0 * (early / energy).log10();
                prop_assert!(least_db > target_db - 1e-6, "refused though {least_db} dB are within reach");
            }
        }
    }
}

#[test]
fn the_equalisation_is_met_within_half_a_decibel() {
    // Targets drawn as training sets draw them, from responses of many colours.
    let augment = EqAugment::new(EqConfig::default(), 16_000).unwrap();
    let mut rng = Pcg64::seed_from_u64(1);
    let (mut met, mut refused) = (0, 0);
    for seed in 0..30 {
        let recorded = response(rng.random_range(0.2..1.2), 0.9, 80.0, 16_000, seed);
        let mut levels: Vec<f64> = (0..7).map(|_| rng.random_range(-9.0..9.0)).collect();
        levels[4] = 0.0;
        let target = PerBand::new(Bands::EQ, levels).unwrap();
        match augment.to_db(&recorded, &target) {
            Ok(changed) => {
                met += 1;
                assert_eq!(changed.samples().len(), recorded.samples().len());
                let found = equalisation(&changed, Bands::EQ).unwrap();
                for ((hz, found), wanted) in found.iter().zip(target.values()) {
                    let found = found.as_ref().unwrap().value;
                    assert!((found - wanted).abs() < 0.5, "{hz} Hz: {found} dB for {wanted} dB");
                }
            }
            Err(error) => {
                refused += 1;
                assert!(matches!(error, Error::EqUnreachable { .. } | Error::Setting { .. }), "{error}");
            }
        }
    }
    eprintln!("{met} targets met, {refused} refused");
    assert!(met >= 24, "{met} of 30");
}

#[test]
fn a_change_of_more_than_40_db_is_refused() {
    let recorded = response(0.5, 0.8, 80.0, 16_000, 1);
    let target = PerBand::new(Bands::EQ, vec![60.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
    let refused = EqAugment::new(EqConfig::default(), 16_000).unwrap().to_db(&recorded, &target);
    assert!(matches!(refused, Err(Error::Setting { .. })), "{refused:?}");
    assert!(EqAugment::new(EqConfig { inflation: f64::NAN, ..EqConfig::default() }, 16_000).is_err());
}

#[test]
fn a_chain_is_measured_afterwards_and_the_seed_decides() {
    let recorded = response(0.5, 0.8, 70.0, 16_000, 2);
    let chain = Chain::for_training(16_000).unwrap();
    let made: Vec<_> =
        (0..8).filter_map(|seed| AugmentedResponse::new(&chain, &recorded, seed).ok()).collect();
    assert!(made.len() >= 5, "{} of 8 drawn", made.len());
    let labels = sabine_augment::Labels::measure(&made[0].response).unwrap();
    assert_eq!(labels, made[0].labels);
    let again = (0..8).filter_map(|seed| AugmentedResponse::new(&chain, &recorded, seed).ok());
    assert!(again.eq(made.iter().cloned()));
    assert!(made.windows(2).any(|pair| pair[0].response != pair[1].response));
    assert!(Chain::new().then(1.5, DrrAugment::new(DrrConfig::default()).unwrap()).is_err());
}
