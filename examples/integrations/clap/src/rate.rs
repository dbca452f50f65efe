//! Sample rates that a host may ask for.

use crate::room::Failure;

/// The sample rate as the reverb counts it, in Hz. Hosts give a number that need not be whole: 48 kHz pulled down to the speed of
/// NTSC video is 47952.05 Hz. Rounded, a response sounds by a hundred-thousandth too high.
///
/// # Errors
/// What is not a number between 1000 and 768,000 Hz.
pub fn whole_rate_hz(rate_hz: f64) -> Result<u32, Failure> {
    // NaN is in no range.
    if !(1e3..=768e3).contains(&rate_hz) {
        return Err(format!("the sample rate is {rate_hz} Hz; it must be between 1000 and 768,000 Hz").into());
    }
    Ok(rate_hz.round() as u32)
}

#[cfg(test)]
mod tests {
    use super::whole_rate_hz;

    #[test]
    fn rates_of_hosts_are_rounded_and_others_are_refused() {
        for (given, taken) in [(44_100.0, 44_100), (47_952.047, 47_952), (1e3, 1000), (768e3, 768_000)] {
            assert_eq!(whole_rate_hz(given).unwrap(), taken);
        }
        for given in [0.0, -48e3, 999.0, 1e9, f64::NAN, f64::INFINITY] {
            assert!(whole_rate_hz(given).unwrap_err().to_string().contains("sample rate"), "{given}");
        }
    }
}
