//! The seam between sound from a direction and the channels that carry it.

use std::ops::Range;

/// Says how sound from a direction enters the channels of a reproduction: one for a monophonic response, the spherical harmonics
/// for ambisonics, gains of loudspeakers for panning.
///
/// `sabine-propagate` renders paths with any of them (`Renderer`); two methods make one:
/// ```
/// use sabine_paths::Encoder;
/// /// A pair of coincident figure-of-eight microphones (Blumlein), to the left and to the right of the front by 45 degrees.
/// struct Blumlein;
/// impl Encoder for Blumlein {
///     fn channels(&self) -> usize {
///         2
///     }
///     fn gains(&self, [x, y, _]: [f64; 3], gains: &mut [f64]) {
///         gains.copy_from_slice(&[0.5f64.sqrt() * (x + y), 0.5f64.sqrt() * (x - y)]);
///     }
/// }
/// let mut gains = [0.0; 2];
/// Blumlein.gains([1.0, 0.0, 0.0], &mut gains);
/// assert!((gains[0] - 0.5f64.sqrt()).abs() < 1e-12 && gains[0] == gains[1]); // ahead: both, 3 dB down
/// ```
pub trait Encoder: Send + Sync {
    /// Number of channels, at least one.
    fn channels(&self) -> usize;

    /// Writes the gain of the pressure in each channel for sound that comes from a unit `direction` in the listener's frame: x
    /// forward, y to the left, z up.
    fn gains(&self, direction: [f64; 3], gains: &mut [f64]);

    /// Highest ambisonic order of which the channels show any detail, 0 to 3: it decides into how many directions a diffuse field
    /// is cut.
    fn order(&self) -> usize {
        3
    }

    /// The channel that hears every direction with gain 1, where there is one.
    fn omnidirectional(&self) -> Option<usize> {
        None
    }

    /// Channels whose energies add up to that of an omnidirectional one, whatever the direction: each degree of ambisonics in
    /// SN3D, or all loudspeakers of a panning law of constant power. Their noise is then levelled together.
    fn power_groups(&self) -> Vec<Range<usize>> {
        Vec::new()
    }
}
