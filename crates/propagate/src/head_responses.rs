//! Responses of a head, and what its ears hear of an ambisonic response.

use crate::direction_cells::DirectionCells;
use crate::spectrum::Spectrum;
use crate::spherical_harmonics::{MAX_ORDER, harmonics};
use crate::vector::{Vec3, dot, norm, scale};
use crate::{AmbisonicResponse, Error};
use realfft::num_complex::Complex;
use sabine_acoustics::{ImpulseResponse, OutOfRange, resample_response};

/// Head-related impulse responses: what a pulse from each of many directions becomes at the left and the right ear. With the
/// feature `sofa` they are read from AES69 (SOFA) files; else they come as plain arrays.
///
/// ```
/// use sabine_propagate::{AmbisonicResponse, HeadResponses};
/// // No head at all: two microphones in one place hear the pressure.
/// let ears = vec![vec![1.0]; 6];
/// let axes = [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
/// let head = HeadResponses::new(axes.to_vec(), ears.clone(), ears, 48_000)?;
/// let wave = AmbisonicResponse::new(vec![vec![0.0, 1.0], vec![0.0, 0.5], vec![0.0; 2], vec![0.0; 2]], 48_000)?;
/// let [left, right] = head.binaural(&wave)?;
/// assert!((left.samples()[1] - 1.0).abs() < 1e-6 && left == right);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct HeadResponses {
    directions: Vec<Vec3>,
    /// `[ear][direction]`, left before right.
    ears: [Vec<Vec<f32>>; 2],
    sample_rate_hz: u32,
}

impl HeadResponses {
    /// Takes the directions (x forward, y to the left, z up; of any length) and the responses of both ears for each.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for no directions, lists of unequal length, responses of unequal length, samples that are not
    /// finite, or a sample rate outside 1 kHz to 768 kHz; [`Error::OutOfRange`] for a direction that is none.
    pub fn new(
        directions: Vec<[f64; 3]>,
        left: Vec<Vec<f32>>,
        right: Vec<Vec<f32>>,
        sample_rate_hz: u32,
    ) -> Result<Self, Error> {
        let expected = directions.len();
        let taps =
            left.first().ok_or(sabine_acoustics::Error::Empty { what: "list of head responses" })?.len();
        for ear in [&left, &right] {
            if ear.len() != expected {
                return Err(sabine_acoustics::Error::Length { expected, found: ear.len() }.into());
            }
            for response in ear {
                ImpulseResponse::new(response.clone(), sample_rate_hz)?;
                if response.len() != taps {
                    return Err(
                        sabine_acoustics::Error::Length { expected: taps, found: response.len() }.into()
                    );
                }
            }
        }
        let unit = |direction: Vec3| {
            let length = norm(direction);
            OutOfRange::check("length of a direction", length, 1e-9, 1e9, "finite and not zero")?;
            Ok(scale(direction, 1.0 / length))
        };
        let directions = directions.into_iter().map(unit).collect::<Result<_, Error>>()?;
        Ok(Self { directions, ears: [left, right], sample_rate_hz })
    }

    /// Unit vectors of the directions.
    pub fn directions(&self) -> &[[f64; 3]] {
        &self.directions
    }

    /// Responses of the left and the right ear for a direction.
    ///
    /// # Panics
    /// If there is no such direction.
    pub fn pair(&self, index: usize) -> [&[f32]; 2] {
        [&self.ears[0][index], &self.ears[1][index]]
    }

    /// Samples per second.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// The same head at another sample rate.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for a rate that [`resample_response`] refuses.
    pub fn resampled(&self, sample_rate_hz: u32) -> Result<Self, Error> {
        let [left, right] = &self.ears;
        let resampled = |ear: &Vec<Vec<f32>>| {
            ear.iter()
                .map(|response| {
                    let response = ImpulseResponse::new(response.clone(), self.sample_rate_hz)?;
                    Ok(resample_response(&response, sample_rate_hz)?.into_samples())
                })
                .collect::<Result<Vec<_>, Error>>()
        };
        Self::new(self.directions.clone(), resampled(left)?, resampled(right)?, sample_rate_hz)
    }

    /// Index of the direction nearest to this one.
    pub fn nearest(&self, direction: [f64; 3]) -> usize {
        let nearness = self.directions.iter().map(|&d| dot(d, direction)).enumerate();
        nearness.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
    }

    /// What the ears hear: the response is decoded to plane waves from evenly spread directions (12 up to second order, 24 at
    /// third), each through the nearest head response.
    ///
    /// The pressure of low frequencies is that of the response. Where the head is large against the wavelength (above about
    /// 700 Hz times the order) the waves no longer add up in phase: the level sinks by up to 1.8 dB at third order (1.2 at second,
    /// 4.8 at first), and directions blur. Turn the head by [`AmbisonicResponse::rotated`] before.
    ///
    /// # Errors
    /// [`Error::SampleRates`] if the two were sampled at different rates.
    pub fn binaural(&self, response: &AmbisonicResponse) -> Result<[ImpulseResponse; 2], Error> {
        let sample_rate_hz = response.sample_rate_hz();
        if sample_rate_hz != self.sample_rate_hz {
            return Err(Error::SampleRates { response_hz: sample_rate_hz, head_hz: self.sample_rate_hz });
        }
        let (samples, taps) = (response.channel(0).len(), self.ears[0][0].len());
        let length = samples + taps - 1;
        let spectrum = Spectrum::new(length, sample_rate_hz);
        let filters = self.channel_filters(response.order());
        let lines_of = |samples: &[f32]| spectrum.lines(samples.iter().map(|&s| f64::from(s)).collect());
        let channels: Vec<Vec<Complex<f64>>> = response.channels().iter().map(|c| lines_of(c)).collect();
        let ear = |filters: &[Vec<f64>]| {
            let mut sum = vec![Complex::default(); spectrum.length() / 2 + 1];
            for (channel, filter) in channels.iter().zip(filters) {
                for ((sum, c), f) in sum.iter_mut().zip(channel).zip(spectrum.lines(filter.clone())) {
                    *sum += c * f;
                }
            }
            let mut heard = spectrum.signal(sum);
            heard.truncate(length);
            ImpulseResponse::new(heard.into_iter().map(|s| s as f32).collect(), sample_rate_hz)
        };
        Ok([ear(&filters[0])?, ear(&filters[1])?])
    }

    /// `[ear][channel]`: the response of the ears to each channel of ambisonics, by the decoder whose gains are the harmonics
    /// themselves (exact on a spherical design).
    fn channel_filters(&self, order: usize) -> [Vec<Vec<f64>>; 2] {
        let waves = DirectionCells::for_order(order.min(MAX_ORDER));
        let channels = (order + 1) * (order + 1);
        let decoded: Vec<(usize, _)> =
            waves.centres().iter().map(|&wave| (self.nearest(wave), harmonics(wave))).collect();
        std::array::from_fn(|ear| {
            (0..channels)
                .map(|channel| {
                    let norm = (2 * channel.isqrt() + 1) as f64 / waves.len() as f64;
                    let mut filter = vec![0.0; self.ears[0][0].len()];
                    for (nearest, gains) in &decoded {
                        for (sum, &tap) in filter.iter_mut().zip(&self.ears[ear][*nearest]) {
                            *sum += norm * gains[channel] * f64::from(tap);
                        }
                    }
                    filter
                })
                .collect()
        })
    }
}
