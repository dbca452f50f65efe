//! Splitting sound into octave or third-octave bands without shifting it in time.

use crate::bands::Bands;
use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::per_band::PerBand;
use crate::spectrum::Spectrum;

/// Ring-down that the padding leaves room for, in units of one over the bandwidth of the narrowest band.
const PADDING_BANDWIDTH_TIMES: f64 = 16.0;

/// One band of a bank: crossovers to its neighbours, each spread over a whole band width in log-frequency.
///
/// At a crossover the gain of the lower band is cos(pi/2 s) and that of the upper band sin(pi/2 s), where s rises smoothly
/// from 0 at the lower band's centre to 1 at the upper band's centre. The squares of the two add up to one, each band is at
/// -3 dB at its edges, and with the widest crossover that still leaves the neighbour's centre untouched the impulse
/// response is as short as it can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BandMask {
    /// Lower edge in Hz; `None` lets everything below pass.
    lower_hz: Option<f64>,
    /// Upper edge in Hz; `None` lets everything above pass.
    upper_hz: Option<f64>,
    /// Natural logarithm of the ratio of a band's edges.
    log_ratio: f64,
}

impl BandMask {
    pub(crate) fn between(edges_hz: (f64, f64)) -> Self {
        let (lower_hz, upper_hz) = edges_hz;
        Self { lower_hz: Some(lower_hz), upper_hz: Some(upper_hz), log_ratio: (upper_hz / lower_hz).ln() }
    }

    /// Amplitude gain at a frequency, 0 to 1.
    pub(crate) fn gain(&self, frequency_hz: f64) -> f64 {
        let rise = self.lower_hz.map_or(1.0, |edge| self.angle(frequency_hz, edge).sin());
        let fall = self.upper_hz.map_or(1.0, |edge| self.angle(frequency_hz, edge).cos());
        rise * fall
    }

    /// Frequencies between which the gain is not zero, in Hz.
    pub(crate) fn support_hz(&self) -> (f64, f64) {
        let half = (0.5 * self.log_ratio).exp();
        (
            self.lower_hz.map_or(0.0, |edge| edge / half),
            self.upper_hz.map_or(f64::INFINITY, |edge| edge * half),
        )
    }

    /// Bandwidth of the energy that passes, the integral of g^2, in Hz; frequencies above `limit_hz` do not count.
    pub(crate) fn energy_bandwidth_hz(&self, limit_hz: f64) -> f64 {
        self.integral(limit_hz, 2)
    }

    /// Statistical bandwidth (integral of g^2)^2 / (integral of g^4), in Hz: in a time dt the power of filtered Gaussian noise
    /// takes about this times dt independent values.
    pub(crate) fn statistical_bandwidth_hz(&self, limit_hz: f64) -> f64 {
        self.integral(limit_hz, 2).powi(2) / self.integral(limit_hz, 4)
    }

    /// Integral of a power of the gain over frequency.
    fn integral(&self, limit_hz: f64, power: i32) -> f64 {
        self.integral_between((0.0, limit_hz), power)
    }

    /// The same between two frequencies, by the midpoint rule on a logarithmic scale.
    fn integral_between(&self, range_hz: (f64, f64), power: i32) -> f64 {
        const STEPS: u32 = 96;
        let (low, high) = self.support_hz();
        let (low, high) = (low.max(range_hz.0).max(1.0), high.min(range_hz.1));
        if low >= high {
            return 0.0;
        }
        let step = (high / low).ln() / f64::from(STEPS);
        (0..STEPS)
            .map(|i| {
                let hz = low * ((f64::from(i) + 0.5) * step).exp();
                self.gain(hz).powi(power) * hz * step
            })
            .sum()
    }

    /// pi/2 s(u), with u running from 0 to 1 across the crossover at `edge_hz`.
    fn angle(&self, frequency_hz: f64, edge_hz: f64) -> f64 {
        let u = ((frequency_hz / edge_hz).ln() / self.log_ratio + 0.5).clamp(0.0, 1.0);
        // Two derivatives vanish at both ends: the ringing falls with the fourth power of time.
        let s = u * u * u * (10.0 - u * (15.0 - 6.0 * u));
        std::f64::consts::FRAC_PI_2 * s
    }
}

/// A zero-phase bank of adjacent octave or third-octave bands (IEC 61260-1 centres and edges, base ten).
///
/// The gains g of adjacent bands are complementary in **power**, sum g^2 = 1. Two ways to use them:
///
/// - [`FilterBank::split`] filters by g^2 (g once for analysis and once for synthesis), so that the bands **add up to the
///   input**. The lowest band keeps everything below it and the highest everything above.
/// - [`FilterBank::analyse`] filters by g, so that the **energies** of the bands add up to the energy of the input between
///   the outermost centres. Every band is limited on both sides. This is what measurements use.
///
/// Either way the bands have the length and the time axis of the input. The filters ring on both sides of an impulse, for
/// about one over the bandwidth; what rings out beyond the ends is cut off and does not come back at the other end.
///
/// ```
/// use sabine_acoustics::{Bands, FilterBank};
/// let bank = FilterBank::new(Bands::SIMULATION, 48000)?;
/// let input: Vec<f32> = (0..4800).map(|i| ((i * i) as f32 * 1e-3).sin()).collect();
/// let bands = bank.split(&input);
/// let worst = (0..input.len())
///     .map(|n| (bands.values().iter().map(|band| band[n]).sum::<f32>() - input[n]).abs())
///     .fold(0.0, f32::max);
/// assert!(worst < 1e-5); // -100 dB of full scale
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FilterBank {
    bands: Bands,
    sample_rate_hz: u32,
}

impl FilterBank {
    /// A bank for signals at a sample rate.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a sample rate outside 1 kHz to 768 kHz.
    pub fn new(bands: Bands, sample_rate_hz: u32) -> Result<Self, Error> {
        check_sample_rate(sample_rate_hz)?;
        Ok(Self { bands, sample_rate_hz })
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
        self.bands
    }

    /// Samples per second of the signals that it filters.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// True if the whole band lies below half the sample rate. A band that does not is still split off, as far as it goes.
    ///
    /// # Panics
    /// If there is no such band.
    pub fn is_complete(&self, band: usize) -> bool {
        self.bands.edges_hz(band).1 <= 0.5 * f64::from(self.sample_rate_hz)
    }

    /// Bands that add up to the input, each as long as the input.
    pub fn split(&self, samples: &[f32]) -> PerBand<Vec<f32>> {
        let spectrum = self.spectrum(samples);
        let last = self.bands.len() - 1;
        PerBand::from_fn(self.bands, |i| {
            let mut mask = BandMask::between(self.bands.edges_hz(i));
            if i == 0 {
                mask.lower_hz = None;
            }
            if i == last {
                mask.upper_hz = None;
            }
            let band = spectrum.filtered(mask.support_hz(), |hz| mask.gain(hz).powi(2));
            band.into_iter().map(|x| x as f32).collect()
        })
    }

    /// Bands limited on both sides, each as long as the input, whose energies add up.
    pub fn analyse(&self, samples: &[f32]) -> PerBand<Vec<f32>> {
        let spectrum = self.spectrum(samples);
        PerBand::from_fn(self.bands, |i| {
            let mask = BandMask::between(self.bands.edges_hz(i));
            let band = spectrum.filtered(mask.support_hz(), |hz| mask.gain(hz));
            band.into_iter().map(|x| x as f32).collect()
        })
    }

    /// Share of the energy that [`analyse`](Self::analyse) passes in a band which comes from each band of the bank, its own among them,
    /// for sound of a flat spectrum up to half the sample rate. The shares add up to 1; what lies beyond the outer bands counts as theirs.
    /// Of an octave 3 % come from the octave below and 8 % from that above: where a neighbour rings longer, that is most of the late decay.
    ///
    /// # Panics
    /// If there is no such band.
    pub fn shares(&self, band: usize) -> PerBand<f64> {
        let mask = BandMask::between(self.bands.edges_hz(band));
        let limit_hz = 0.5 * f64::from(self.sample_rate_hz);
        let last = self.bands.len() - 1;
        let passed = PerBand::from_fn(self.bands, |i| {
            let (lower_hz, upper_hz) = self.bands.edges_hz(i);
            let from_hz = if i == 0 { 0.0 } else { lower_hz };
            let to_hz = if i == last { limit_hz } else { upper_hz.min(limit_hz) };
            mask.integral_between((from_hz, to_hz), 2)
        });
        let whole: f64 = passed.values().iter().sum();
        // A band that lies above half the sample rate altogether passes nothing, of whatever origin.
        PerBand::from_fn(self.bands, |i| {
            if whole > 0.0 { passed.values()[i] / whole } else { f64::from(u8::from(i == band)) }
        })
    }

    fn spectrum(&self, samples: &[f32]) -> Spectrum {
        let samples: Vec<f64> = samples.iter().copied().map(f64::from).collect();
        Spectrum::new(&samples, self.sample_rate_hz, padding_s(self.bands.edges_hz(0)))
    }
}

/// Silence that must follow a signal so that a band's ringing does not wrap around, in seconds.
pub(crate) fn padding_s(narrowest_edges_hz: (f64, f64)) -> f64 {
    PADDING_BANDWIDTH_TIMES / (narrowest_edges_hz.1 - narrowest_edges_hz.0)
}

fn check_sample_rate(sample_rate_hz: u32) -> Result<(), Error> {
    Ok(OutOfRange::check(
        "sample rate (Hz)",
        f64::from(sample_rate_hz),
        1e3,
        768e3,
        "between 1 kHz and 768 kHz",
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// IEC 61260-1:2014, table 1, class 1, octave filters: frequency as a power of G, least and greatest attenuation in dB.
    #[test]
    fn gains_lie_within_the_limits_of_class_1() {
        let limits = [
            (0.0, -0.4, 0.4),
            (0.125, -0.4, 0.5),
            (0.25, -0.4, 0.7),
            (0.375, -0.4, 1.4),
            (0.4999, -0.4, 5.3),
            (0.5001, 1.6, f64::INFINITY),
            (1.0, 16.6, f64::INFINITY),
            (2.0, 40.5, f64::INFINITY),
            (3.0, 60.0, f64::INFINITY),
            (4.0, 70.0, f64::INFINITY),
        ];
        let octaves = Bands::SIMULATION;
        let mask = BandMask::between(octaves.edges_hz(4));
        let ratio = octaves.edges_hz(4).1 / octaves.edges_hz(4).0;
        for (power, least, greatest) in limits {
            for sign in [-1.0, 1.0] {
                let found = -20.0 * mask.gain(octaves.exact_hz(4) * ratio.powf(sign * power)).log10();
                assert!((least..=greatest).contains(&found), "G^{power}: {found} dB");
            }
        }
    }

    #[test]
    fn energies_of_the_bands_add_up_between_the_outer_centres() {
        let bands = Bands::SIMULATION;
        for step in 0..200 {
            let hz =
                bands.exact_hz(0) * (bands.exact_hz(7) / bands.exact_hz(0)).powf(f64::from(step) / 199.0);
            let sum: f64 =
                (0..bands.len()).map(|i| BandMask::between(bands.edges_hz(i)).gain(hz).powi(2)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{hz} Hz: {sum}");
        }
    }

    #[test]
    fn a_band_keeps_the_time_of_an_impulse() {
        let mut input = vec![0.0; 4000];
        input[1234] = 1.0;
        let bands = FilterBank::new(Bands::T60, 16000).unwrap().analyse(&input);
        for (hz, band) in bands.iter() {
            let peak = (0..band.len()).max_by(|&a, &b| band[a].abs().total_cmp(&band[b].abs())).unwrap();
            assert_eq!(peak, 1234, "{hz} Hz");
            for lag in 1..200 {
                assert!((band[1234 - lag] - band[1234 + lag]).abs() < 1e-6, "{hz} Hz, lag {lag}");
            }
        }
    }

    /// By Parseval's theorem, from the filtered impulse: a plain sum over its discrete spectrum, line by line.
    #[test]
    fn shares_of_the_bands_are_those_of_a_filtered_impulse() {
        const RATE_HZ: f64 = 16_000.0;
        const LENGTH: usize = 2048;
        for bands in [Bands::octaves(500.0, 4000.0).unwrap(), Bands::third_octaves(1000.0, 2000.0).unwrap()] {
            let bank = FilterBank::new(bands, RATE_HZ as u32).unwrap();
            let mut input = vec![0.0; LENGTH];
            input[LENGTH / 2] = 1.0;
            for (band, filtered) in bank.analyse(&input).values().iter().enumerate() {
                let mut expected = vec![0.0; bands.len()];
                for line in 0..LENGTH / 2 {
                    let hz = (line as f64 + 0.5) * RATE_HZ / LENGTH as f64;
                    let (mut re, mut im) = (0.0, 0.0);
                    for (n, x) in filtered.iter().enumerate() {
                        let (sin, cos) = (std::f64::consts::TAU * hz / RATE_HZ * n as f64).sin_cos();
                        re += f64::from(*x) * cos;
                        im += f64::from(*x) * sin;
                    }
                    let own = (1..bands.len()).take_while(|&i| bands.edges_hz(i).0 <= hz).count();
                    expected[own] += re * re + im * im;
                }
                let whole: f64 = expected.iter().sum();
                for (found, expected) in bank.shares(band).values().iter().zip(&expected) {
                    // A line of the spectrum that lies across an edge counts on one side: 4 Hz of some hundred at half power.
                    assert!((found - expected / whole).abs() < 0.01, "{band}: {found} {}", expected / whole);
                }
            }
        }
        // Nothing of an octave above half the sample rate is there to be shared out.
        let bank = FilterBank::new(Bands::octaves(2000.0, 16_000.0).unwrap(), 8000).unwrap();
        assert_eq!(bank.shares(3).values(), [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn ringing_does_not_come_back_at_the_other_end() {
        let mut input = vec![0.0; 16000];
        input[15999] = 1.0;
        let bands = FilterBank::new(Bands::SIMULATION, 16000).unwrap().analyse(&input);
        for (hz, band) in bands.iter() {
            let start = band[..4000].iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
            assert!(start < 1e-5 * band[15999].abs(), "{hz} Hz: {start}"); // -100 dB
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn bands_add_up_to_the_input(
            samples in proptest::collection::vec(-1.0f32..1.0, 1..3000),
            rate in prop::sample::select(vec![8000u32, 16000, 44100, 48000]),
        ) {
            let octaves = FilterBank::new(Bands::SIMULATION, rate).unwrap().split(&samples);
            let thirds = FilterBank::new(Bands::third_octaves(50.0, 5000.0).unwrap(), rate)
                .unwrap()
                .split(&samples);
            for n in 0..samples.len() {
                let sum: f32 = octaves.values().iter().map(|band| band[n]).sum();
                prop_assert!((sum - samples[n]).abs() < 1e-5);
                let sum: f32 = thirds.values().iter().map(|band| band[n]).sum();
                prop_assert!((sum - samples[n]).abs() < 1e-5);
            }
        }
    }
}
