//! Any bytes as a file of weights: a network that can hear, or an error.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sabine_estimator::Estimator;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(estimator) = Estimator::from_safetensors(bytes) {
        assert!(estimator.sample_rate_hz() > 0);
    }
});
