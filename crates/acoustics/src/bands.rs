//! Octave bands as a value, and quantities that know which bands they belong to.

use crate::Error;

/// Nominal octave centres of IEC 61260-1 (Annex E), from 31.5 Hz to 16 kHz.
const NOMINAL_HZ: [f64; 10] = [31.5, 62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0];
/// Position of 1 kHz in [`NOMINAL_HZ`].
const REFERENCE: i32 = 5;
/// Octave ratio G of IEC 61260-1, base ten: 10^(3/10).
const OCTAVE_RATIO: f64 = 1.995_262_314_968_88;

/// A contiguous run of octave bands, named by their nominal centres (62.5 Hz stands for the nominal 63 Hz).
///
/// ```
/// use sabine_acoustics::OctaveBands;
/// let bands = OctaveBands::new(125.0, 8000.0)?;
/// assert_eq!(bands.len(), 7);
/// assert_eq!(bands.nominal_hz(2), 500.0);
/// // IEC 61260-1: exact centres are powers of 10^(3/10) about 1 kHz.
/// assert!((bands.exact_hz(0) - 125.89).abs() < 0.01);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct OctaveBands {
    first: u8,
    count: u8,
}

impl OctaveBands {
    /// 125 Hz to 8 kHz: the seven bands of the reverberation-time targets (Tang et al. 2020, section 3.3).
    pub const T60: Self = Self { first: 2, count: 7 };
    /// 62.5 Hz to 4 kHz: the bands of the equalisation targets; the value at 1 kHz is 0 dB by definition.
    pub const EQ: Self = Self { first: 1, count: 7 };
    /// 62.5 Hz to 8 kHz: the eight bands that are traced and rendered.
    pub const SIMULATION: Self = Self { first: 1, count: 8 };

    /// The run from one nominal centre to another, both included.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] if either is not a nominal octave centre, [`Error::BandOrder`] if `last_hz < first_hz`.
    pub fn new(first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        let (first, last) = (nominal_index(first_hz)?, nominal_index(last_hz)?);
        if last < first {
            return Err(Error::BandOrder { first_hz, last_hz });
        }
        Ok(Self { first: first as u8, count: (last - first + 1) as u8 })
    }

    /// The run with exactly these nominal centres.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] for a centre that is not nominal, [`Error::BandOrder`] if they do not rise octave by octave
    /// or there are none.
    pub fn from_centres_hz(centres_hz: &[f64]) -> Result<Self, Error> {
        let (Some(&first_hz), Some(&last_hz)) = (centres_hz.first(), centres_hz.last()) else {
            return Err(Error::BandOrder { first_hz: f64::NAN, last_hz: f64::NAN });
        };
        for &centre in centres_hz {
            nominal_index(centre)?;
        }
        let bands = Self::new(first_hz, last_hz)?;
        let same = bands.len() == centres_hz.len()
            && centres_hz.iter().zip(bands.iter_hz()).all(|(&a, b)| same_centre(a, b));
        if same { Ok(bands) } else { Err(Error::BandOrder { first_hz, last_hz }) }
    }

    /// Number of bands, at least one.
    #[allow(clippy::len_without_is_empty)] // never empty by construction
    pub fn len(&self) -> usize {
        usize::from(self.count)
    }

    /// Nominal centre of band `index` in Hz.
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn nominal_hz(&self, index: usize) -> f64 {
        assert!(index < self.len(), "band {index} of {}", self.len());
        NOMINAL_HZ[usize::from(self.first) + index]
    }

    /// Exact mid-band frequency of band `index` in Hz (IEC 61260-1, 5.2, base ten).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn exact_hz(&self, index: usize) -> f64 {
        assert!(index < self.len(), "band {index} of {}", self.len());
        1000.0 * OCTAVE_RATIO.powi(i32::from(self.first) + index as i32 - REFERENCE)
    }

    /// Lower and upper band-edge frequencies of band `index` in Hz (IEC 61260-1, 5.4).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn edges_hz(&self, index: usize) -> (f64, f64) {
        let centre = self.exact_hz(index);
        (centre / OCTAVE_RATIO.sqrt(), centre * OCTAVE_RATIO.sqrt())
    }

    /// Nominal centres in Hz, rising.
    pub fn iter_hz(&self) -> impl ExactSizeIterator<Item = f64> + Clone + use<> {
        NOMINAL_HZ[usize::from(self.first)..][..self.len()].iter().copied()
    }

    /// Index of the band with this nominal centre, if it belongs to the run.
    pub fn index_of(&self, centre_hz: f64) -> Option<usize> {
        self.iter_hz().position(|hz| same_centre(hz, centre_hz))
    }
}

/// 62.5 and 63 Hz name the same band, as do 31.5 and 31.25 Hz.
fn same_centre(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 0.01
}

fn nominal_index(centre_hz: f64) -> Result<usize, Error> {
    NOMINAL_HZ.iter().position(|&hz| same_centre(hz, centre_hz)).ok_or(Error::UnknownBand { centre_hz })
}

/// One value for each band of a run of octaves.
///
/// Combining values of different runs is an error, never a silent truncation.
/// ```
/// use sabine_acoustics::{OctaveBands, PerBand};
/// let t60_s = PerBand::from_fn(OctaveBands::T60, |band| 0.8 - 0.05 * band as f64);
/// assert_eq!(t60_s.at_hz(125.0), Some(&0.8));
/// assert_eq!(t60_s.at_hz(62.5), None);
/// let other = PerBand::uniform(OctaveBands::EQ, 0.0);
/// assert!(t60_s.zip_with(&other, |a, b| a + b).is_err());
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PerBand<T> {
    bands: OctaveBands,
    values: Vec<T>,
}

impl<T> PerBand<T> {
    /// Binds `values`, one for each band, lowest first.
    ///
    /// # Errors
    /// [`Error::BandCount`] if the number of values is not the number of bands.
    pub fn new(bands: OctaveBands, values: Vec<T>) -> Result<Self, Error> {
        if values.len() != bands.len() {
            return Err(Error::BandCount { expected: bands.len(), found: values.len() });
        }
        Ok(Self { bands, values })
    }

    /// The value that `value_at` gives for each band index.
    pub fn from_fn(bands: OctaveBands, value_at: impl FnMut(usize) -> T) -> Self {
        Self { bands, values: (0..bands.len()).map(value_at).collect() }
    }

    /// The bands.
    pub fn bands(&self) -> OctaveBands {
        self.bands
    }

    /// The values, lowest band first.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The value at a nominal centre, if the run holds it.
    pub fn at_hz(&self, centre_hz: f64) -> Option<&T> {
        self.bands.index_of(centre_hz).map(|i| &self.values[i])
    }

    /// Nominal centre and value of each band.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (f64, &T)> {
        self.bands.iter_hz().zip(&self.values)
    }

    /// The same bands with every value mapped.
    pub fn map<U>(&self, map: impl FnMut(&T) -> U) -> PerBand<U> {
        PerBand { bands: self.bands, values: self.values.iter().map(map).collect() }
    }

    /// Two quantities combined band by band.
    ///
    /// # Errors
    /// [`Error::BandMismatch`] if they belong to different runs.
    pub fn zip_with<U, V>(
        &self,
        other: &PerBand<U>,
        mut combine: impl FnMut(&T, &U) -> V,
    ) -> Result<PerBand<V>, Error> {
        if self.bands != other.bands {
            return Err(Error::BandMismatch { left: self.bands, right: other.bands });
        }
        let values = self.values.iter().zip(&other.values).map(|(a, b)| combine(a, b)).collect();
        Ok(PerBand { bands: self.bands, values })
    }
}

impl<T: Clone> PerBand<T> {
    /// The same value in every band.
    pub fn uniform(bands: OctaveBands, value: T) -> Self {
        Self { bands, values: vec![value; bands.len()] }
    }

    /// The quantity on another run of bands: a band that this run lacks takes the value of its nearest band.
    pub fn resampled(&self, bands: OctaveBands) -> Self {
        let last = self.values.len() as i32 - 1;
        Self::from_fn(bands, |i| {
            let nearest = (i32::from(bands.first) + i as i32 - i32::from(self.bands.first)).clamp(0, last);
            self.values[nearest as usize].clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nominal_run_accepts_both_names_of_the_63_hz_band() {
        assert_eq!(
            OctaveBands::from_centres_hz(&[63.0, 125.0]).unwrap(),
            OctaveBands::new(62.5, 125.0).unwrap()
        );
    }

    #[test]
    fn gaps_and_falling_centres_are_refused() {
        assert!(matches!(OctaveBands::from_centres_hz(&[125.0, 500.0]), Err(Error::BandOrder { .. })));
        assert!(matches!(OctaveBands::from_centres_hz(&[500.0, 250.0]), Err(Error::BandOrder { .. })));
        assert!(matches!(OctaveBands::from_centres_hz(&[130.0]), Err(Error::UnknownBand { .. })));
        assert!(matches!(OctaveBands::from_centres_hz(&[]), Err(Error::BandOrder { .. })));
    }

    #[test]
    fn adjacent_bands_share_an_edge() {
        let bands = OctaveBands::SIMULATION;
        for i in 1..bands.len() {
            assert!((bands.edges_hz(i - 1).1 / bands.edges_hz(i).0 - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn mixing_runs_is_an_error_and_resampling_extends_the_ends() {
        let t60 = PerBand::uniform(OctaveBands::T60, 1.0);
        let eq = PerBand::uniform(OctaveBands::EQ, 1.0);
        assert!(matches!(t60.zip_with(&eq, |a, b| a + b), Err(Error::BandMismatch { .. })));
        let rising = PerBand::new(OctaveBands::T60, vec![1., 2., 3., 4., 5., 6., 7.]).unwrap();
        assert_eq!(rising.resampled(OctaveBands::SIMULATION).values(), &[1., 1., 2., 3., 4., 5., 6., 7.]);
        assert_eq!(rising.resampled(OctaveBands::EQ).values(), &[1., 1., 2., 3., 4., 5., 6.]);
    }
}
