//! Any bytes as a file of weights: a network that hears without breaking down, or an error.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sabine_acoustics::Signal;
use sabine_estimator::{Estimator, add_checksum};

fuzz_target!(|bytes: &[u8]| {
    // No change of the fuzzer's would pass the checksum: files without one get it.
    let sealed = add_checksum(bytes);
    let bytes = sealed.as_deref().unwrap_or(bytes);
    let Ok(estimator) = Estimator::from_safetensors(bytes) else { return };
    let rate = estimator.sample_rate_hz();
    let layout = &estimator.model().layout;
    // Large layouts are slow, not wrong.
    if rate > 48_000 || layout.mels * layout.frames > 100_000 || layout.hop < 16 {
        return;
    }
    let noise = |n: u32| 0.3 * ((n.wrapping_mul(n) % 9973) as f32 * 0.7).sin();
    let Ok(sound) = Signal::new((0..rate * 11 / 10).map(noise).collect(), rate) else { return };
    if let Ok(estimate) = estimator.estimate_detailed(&sound) {
        for value in estimate.targets.t60_s().values().iter().chain(estimate.targets.eq_db().values()) {
            assert!(value.value.is_finite() && value.standard_error >= 0.0, "{value:?}");
        }
    }
});
