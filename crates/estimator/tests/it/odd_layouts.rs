//! Weights with a strange header either do not fit or hear without breaking down: nobody knows where a file has been.

use sabine_acoustics::Signal;
use sabine_estimator::{Error, Estimator, LiveEstimator, WeightsFault, add_checksum};
use serde_json::{Value, json};

const WEIGHTS: &[u8] = include_bytes!("../../weights/room.safetensors");

/// The pretrained file with some fields of its header changed.
fn changed(changes: &[(&str, Value)]) -> Vec<u8> {
    resealed(WEIGHTS, changes)
}

/// A file with some fields of its header changed, and a checksum that fits.
fn resealed(bytes: &[u8], changes: &[(&str, Value)]) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let (header, arrays) = bytes[8..].split_at(length);
    let mut header: Value = serde_json::from_slice(header).unwrap();
    let mut own: Value = serde_json::from_str(header["__metadata__"]["sabine"].as_str().unwrap()).unwrap();
    for (pointer, value) in changes {
        *own.pointer_mut(pointer).unwrap() = value.clone();
    }
    own.as_object_mut().unwrap().remove("sha256");
    header["__metadata__"]["sabine"] = own.to_string().into();
    let header = header.to_string();
    add_checksum(&[&(header.len() as u64).to_le_bytes(), header.as_bytes(), arrays].concat()).unwrap()
}

/// Three seconds of bursts that decay.
fn bursts(sample_rate_hz: u32) -> Signal {
    let sample = |n: usize| {
        let noise = ((n * n % 9973) as f32 * 0.7).sin();
        0.3 * noise * 10f32.powf(-3.0 * (n % sample_rate_hz as usize) as f32 / (0.4 * sample_rate_hz as f32))
    };
    Signal::new((0..3 * sample_rate_hz as usize).map(sample).collect(), sample_rate_hz).unwrap()
}

fn hears(what: &str, estimator: &Estimator) {
    let sound = bursts(estimator.sample_rate_hz());
    let check = |estimate: Result<sabine_estimator::DetailedEstimate, Error>| {
        let Ok(estimate) = estimate else { return };
        for value in estimate.targets.t60_s().values().iter().chain(estimate.targets.eq_db().values()) {
            assert!(value.value.is_finite() && value.standard_error >= 0.0, "{what}: {value:?}");
        }
    };
    check(estimator.estimate_detailed(&sound));
    let mut live = LiveEstimator::with_windows(estimator, 2);
    for block in sound.samples().chunks(1000) {
        live.push(block, check).unwrap();
    }
    check(live.estimate());
}

#[test]
fn strange_layouts_are_refused_or_hear() {
    let mut accepted = 0;
    for frames in [1, 2, 63, 64, 65, 100, 127, 2000] {
        for (n_fft, hop) in [(2, 1), (2, 2), (64, 1), (256, 128), (256, 256), (1000, 7), (4096, 4096)] {
            for rate in [1000, 16_000, 48_000] {
                let changes = [
                    ("/layout/frames", json!(frames)),
                    ("/network/frames", json!(frames)),
                    ("/layout/n_fft", json!(n_fft)),
                    ("/layout/hop", json!(hop)),
                    ("/layout/sample_rate_hz", json!(rate)),
                    ("/layout/high_hz", json!(f64::from(rate) / 2.0)),
                ];
                let what = format!("{frames} frames of {n_fft} every {hop} at {rate} Hz");
                if let Ok(estimator) = Estimator::from_safetensors(&changed(&changes)) {
                    accepted += 1;
                    hears(&what, &estimator);
                }
            }
        }
    }
    assert!(accepted > 20, "{accepted} layouts were accepted: does this test anything?");
}

#[test]
fn numbers_that_cannot_be_are_refused() {
    for (pointer, value) in [
        ("/layout/frames", json!(0)),
        ("/layout/frames", json!(u64::MAX)),
        ("/layout/hop", json!(0)),
        ("/layout/n_fft", json!(1u64 << 40)),
        ("/layout/mels", json!(1_000_000_000)),
        ("/layout/sample_rate_hz", json!(0)),
        ("/layout/high_hz", json!(1e300)),
        ("/network/hidden", json!(1u64 << 40)),
        ("/network/outputs", json!(0)),
        ("/network/blocks/0/channels", json!(u64::MAX)),
        ("/network/blocks/0/kernel", json!([0, 0])),
        ("/novelty_limit", json!(-1.0)),
    ] {
        let result = Estimator::from_safetensors(&changed(&[(pointer, value.clone())]));
        assert!(result.is_err(), "{pointer} = {value} is accepted");
    }
}

/// Finite numbers whose products are not.
#[test]
fn enormous_numbers_are_refused_or_give_finite_estimates() {
    let length = u64::from_le_bytes(WEIGHTS[..8].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&WEIGHTS[8..8 + length]).unwrap();
    let mut accepted = 0;
    for (name, tensor) in header.as_object().unwrap().iter().filter(|(name, _)| *name != "__metadata__") {
        let offset = |end: usize| 8 + length + tensor["data_offsets"][end].as_u64().unwrap() as usize;
        let is_half = tensor["dtype"] == "F16";
        for value in [f32::MAX, -f32::MAX, 1e20, 1e-38] {
            let mut bytes = WEIGHTS.to_vec();
            let piece: Vec<u8> = if is_half {
                half::f16::from_f32(value.clamp(-65504.0, 65504.0)).to_le_bytes().to_vec()
            } else {
                value.to_le_bytes().to_vec()
            };
            bytes[offset(0)..offset(1)].chunks_exact_mut(piece.len()).for_each(|c| c.copy_from_slice(&piece));
            if let Ok(estimator) = Estimator::from_safetensors(&resealed(&bytes, &[])) {
                accepted += 1;
                hears(&format!("{name} = {value}"), &estimator);
            }
        }
    }
    assert!(accepted > 50, "{accepted}");
}

/// One bit anywhere in the numbers or in the header.
#[test]
fn a_flipped_bit_is_found() {
    let length = 8 + u64::from_le_bytes(WEIGHTS[..8].try_into().unwrap()) as usize;
    let text = WEIGHTS.windows(13).position(|bytes| bytes == b"novelty_limit").unwrap();
    for at in [text + 18, length, length + 1_001, WEIGHTS.len() - 1] {
        let mut bytes = WEIGHTS.to_vec();
        bytes[at] ^= 1;
        let Err(Error::Weights { fault, .. }) = Estimator::from_safetensors(&bytes) else { panic!("{at}") };
        assert!(matches!(*fault, WeightsFault::Checksum { .. }), "{at}: {fault}");
        assert!(add_checksum(&bytes).is_err(), "{at}");
    }
    assert_eq!(add_checksum(WEIGHTS).unwrap(), WEIGHTS);
}
