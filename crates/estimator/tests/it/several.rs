//! Several recordings of one room, and sounds that are no speech.

use crate::bursts::bursts;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Channel, Signal, read_audio, resample};
use sabine_estimator::{Error, Estimator, Model, Warning, WeightsFault};

fn speech() -> Signal {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/speech/recording.wav");
    read_audio(path, Channel::Mono).unwrap()
}

#[test]
fn recordings_of_a_room_are_surer_together_and_in_any_order() {
    let estimator = Estimator::pretrained().unwrap();
    let heard: Vec<_> =
        (1..4).map(|seed| estimator.estimate_detailed(&bursts(6.0, 0.6, 16_000, seed)).unwrap()).collect();
    let together = estimator.combine(&heard).unwrap();
    let backwards = estimator.combine(&heard.iter().rev().cloned().collect::<Vec<_>>()).unwrap();
    let one = estimator.combine(&heard[..1]).unwrap();
    let values = |t: &sabine_acoustics::RoomTargets| {
        t.t60_s().values().iter().chain(t.eq_db().values()).copied().collect::<Vec<_>>()
    };
    let all = values(&together).into_iter().zip(values(&backwards)).zip(values(&one));
    for (k, ((together, backwards), one)) in all.enumerate() {
        assert!((together.value - backwards.value).abs() < 1e-9, "{k}");
        // 1 kHz is the reference of the equalisation: 0 dB without error.
        assert!(
            together.standard_error < one.standard_error || one.standard_error == 0.0,
            "{k}: {together:?} {one:?}"
        );
    }
    // A reverberation time from one recording is what that recording says.
    assert!((one.t60_s().values()[3].value / heard[0].targets.t60_s().values()[3].value - 1.0).abs() < 1e-12);
}

#[test]
fn weights_without_a_combination_hear_and_do_not_combine() {
    let mut model = Estimator::pretrained().unwrap().model().clone();
    model.combination = None;
    model.detectors = None;
    let bytes = model.to_safetensors(true).unwrap();
    let estimator = Estimator::from_safetensors(&bytes).unwrap();
    assert!(estimator.model().combination.is_none() && estimator.model().detectors.is_none());
    let heard = estimator.estimate_detailed(&bursts(5.0, 0.5, 16_000, 1)).unwrap();
    assert!(matches!(estimator.combine(&[heard]), Err(Error::NoCombination)));
    assert!(matches!(Estimator::pretrained().unwrap().combine(&[]), Err(Error::NoRecordings)));
}

#[test]
fn combination_and_detectors_go_through_a_file_and_a_broken_one_is_named() {
    let model = Estimator::pretrained().unwrap().model().clone();
    let again = Model::from_safetensors("again", &model.to_safetensors(true).unwrap()).unwrap();
    assert_eq!(model, again);
    let mut broken = model;
    broken.combination.as_mut().unwrap().prior_covariance[0] = -1.0;
    let Err(Error::Weights { fault, .. }) =
        Model::from_safetensors("broken", &broken.to_safetensors(true).unwrap())
    else {
        panic!("a covariance that is none was read");
    };
    assert!(matches!(*fault, WeightsFault::Layout { field: "combination.prior_covariance", .. }), "{fault}");
}

#[test]
fn speech_is_let_pass_and_noise_and_a_telephone_are_said() {
    let estimator = Estimator::pretrained().unwrap();
    let found = |signal: &Signal| estimator.estimate_detailed(signal).unwrap().warnings;
    let speech = resample(&speech(), 16_000).unwrap();
    let sounds = |w: &Warning| {
        matches!(
            w,
            Warning::NoiseAlone
                | Warning::Music
                | Warning::BandLimited
                | Warning::LongDecay { .. }
                | Warning::Dry
        )
    };
    assert!(!found(&speech).iter().any(sounds), "{:?}", found(&speech));
    let narrow = resample(&resample(&speech, 8_000).unwrap(), 16_000).unwrap();
    assert!(found(&narrow).contains(&Warning::BandLimited), "{:?}", found(&narrow));
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let noise = Signal::new((0..96_000).map(|_| rng.random_range(-0.1f32..0.1)).collect(), 16_000).unwrap();
    assert!(found(&noise).contains(&Warning::NoiseAlone), "{:?}", found(&noise));
}
