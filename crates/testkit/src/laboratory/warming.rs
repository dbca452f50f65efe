//! A loudspeaker that warms up while the responses are recorded.
//!
//! D. J. Button, JAES 40 (1992) 32 (power compression): the voice coil warms towards its final temperature as 1 - exp(-t / tau), its resistance
//! rises in proportion, and the sound pressure of an amplifier of constant voltage falls as one over the resistance.

use super::stream::{Purpose, stream};
use super::truth::Truth;
use rand::seq::SliceRandom;
use sabine_acoustics::{Error, OutOfRange};

/// When each response is recorded, counted from 0: drawn, so that it goes with no place.
pub(crate) fn recording_order(seed: u64, responses: usize) -> Vec<f64> {
    let mut order: Vec<usize> = (0..responses).collect();
    order.shuffle(&mut stream(seed, Purpose::Order, 0));
    order.into_iter().map(|place| place as f64).collect()
}

/// Level in dB of a response that is recorded so late, re the first.
pub(crate) fn level_db(final_db: f64, time_constant: f64, recorded_at: f64) -> f64 {
    let warmer = 1.0 - (-recorded_at / time_constant).exp();
    let more_resistance = 10f64.powf(final_db / 20.0) - 1.0;
    -20.0 * (1.0 + more_resistance * warmer).log10()
}

/// Lowers the levels of all responses.
pub(crate) fn apply(truth: &mut Truth, final_db: f64, time_constant: f64) -> Result<(), Error> {
    OutOfRange::check("power compression (dB)", final_db, 0.0, 20.0, "between 0 and 20 dB")?;
    OutOfRange::check("time constant (responses)", time_constant, 0.1, 1e3, "between 0.1 and 1000")?;
    for (gain_db, at) in truth.gains_db.iter_mut().zip(&truth.recorded_at) {
        *gain_db += level_db(final_db, time_constant, *at);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_falls_to_its_end_and_halfway_in_resistance_after_the_half_life() {
        assert!(level_db(6.0, 4.0, 0.0).abs() < 1e-12);
        assert!((level_db(6.0, 4.0, 400.0) + 6.0).abs() < 1e-9);
        // Twice the resistance at last: 1.5 times after ln 2 time constants.
        let double_db = 20.0 * 2f64.log10();
        assert!((level_db(double_db, 4.0, 4.0 * 2f64.ln()) + 20.0 * 1.5f64.log10()).abs() < 1e-9);
    }

    #[test]
    fn each_response_has_a_turn_of_its_own() {
        let mut order = recording_order(3, 12);
        assert_ne!(order, (0..12).map(f64::from).collect::<Vec<_>>());
        order.sort_by(f64::total_cmp);
        assert_eq!(order, (0..12).map(f64::from).collect::<Vec<_>>());
    }
}
