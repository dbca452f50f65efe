//! Recordings whose crests are cut off.

use crate::sweep_error::SweepError;

/// Samples in a row at full scale that mean clipping.
const IN_A_ROW: usize = 3;
/// What counts as full scale: the largest code of 16 bits is a part in 32,768 below 1.
const FULL_SCALE: f32 = 0.9999;
/// Shares of the largest magnitude below it between which the samples are counted.
const NARROW: f32 = 0.005;
const WIDE: f32 = 4.0 * NARROW;
/// Share of the samples within the wide margin that lie within the narrow one: 1/2 for the crest of a sine, less for crests of
/// different heights, 1 for crests that are all cut off.
const LARGEST_SHARE: f64 = 0.68;
/// Fewest samples at the top that say anything: the share's standard error is below 0.05 then.
const LEAST_SAMPLES: usize = 100;

/// # Errors
/// [`SweepError::Clipped`].
pub(super) fn check(channel: usize, samples: &[f32]) -> Result<(), SweepError> {
    let peak = samples.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    if peak <= 0.0 {
        return Ok(());
    }
    let clipped =
        |level: f32, samples: usize| SweepError::Clipped { channel, level: f64::from(level), samples };
    let at_full_scale = |x: &f32| x.abs() >= FULL_SCALE;
    let is_integer_scale = peak <= 1.0;
    if is_integer_scale && samples.windows(IN_A_ROW).any(|row| row.iter().all(at_full_scale)) {
        return Err(clipped(1.0, samples.iter().filter(|x| at_full_scale(x)).count()));
    }
    let within = |margin: f32| samples.iter().filter(|x| x.abs() >= peak * (1.0 - margin)).count();
    let (narrow, wide) = (within(NARROW), within(WIDE));
    if narrow >= LEAST_SAMPLES && narrow as f64 > LARGEST_SHARE * wide as f64 {
        return Err(clipped(peak, narrow));
    }
    Ok(())
}
