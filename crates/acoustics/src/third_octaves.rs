//! Third-octave bands as a value.

use crate::Error;

/// Nominal third-octave centres of IEC 61260-1 (Annex E), from 25 Hz to 20 kHz.
const NOMINAL_HZ: [f64; 30] = [
    25.0, 31.5, 40.0, 50.0, 63.0, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0, 315.0, 400.0, 500.0, 630.0, 800.0,
    1000.0, 1250.0, 1600.0, 2000.0, 2500.0, 3150.0, 4000.0, 5000.0, 6300.0, 8000.0, 10000.0, 12500.0,
    16000.0, 20000.0,
];
/// Position of 1 kHz in [`NOMINAL_HZ`].
const REFERENCE: i32 = 16;

/// A contiguous run of third-octave bands, named by their nominal centres (62.5 Hz stands for 63 Hz).
/// ```
/// use sabine_acoustics::ThirdOctaveBands;
/// let bands = ThirdOctaveBands::new(800.0, 1250.0)?;
/// assert_eq!(bands.len(), 3);
/// let (low, high) = bands.edges_hz(1);
/// assert!((high / low - 10f64.powf(0.1)).abs() < 1e-12); // base 10: ten to a decade
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ThirdOctaveBands {
    first: u8,
    count: u8,
}

impl ThirdOctaveBands {
    /// The run from one nominal centre to another, both included.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] if either is not a nominal third-octave centre from 25 Hz to 20 kHz, [`Error::BandOrder`] if
    /// `last_hz < first_hz`.
    pub fn new(first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        let index = |centre_hz: f64| {
            NOMINAL_HZ
                .iter()
                .position(|hz| (hz / centre_hz - 1.0).abs() < 0.01)
                .ok_or(Error::UnknownBand { centre_hz })
        };
        let (first, last) = (index(first_hz)?, index(last_hz)?);
        if last < first {
            return Err(Error::BandOrder { first_hz, last_hz });
        }
        Ok(Self { first: first as u8, count: (last - first + 1) as u8 })
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

    /// Exact mid-band frequency of band `index` in Hz (IEC 61260-1, 5.2, base ten: tenths of a decade about 1 kHz).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn exact_hz(&self, index: usize) -> f64 {
        assert!(index < self.len(), "band {index} of {}", self.len());
        1000.0 * 10f64.powf(0.1 * f64::from(i32::from(self.first) + index as i32 - REFERENCE))
    }

    /// Lower and upper band-edge frequencies of band `index` in Hz (IEC 61260-1, 5.4).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn edges_hz(&self, index: usize) -> (f64, f64) {
        let half = 10f64.powf(0.05);
        (self.exact_hz(index) / half, self.exact_hz(index) * half)
    }

    /// Nominal centres in Hz, rising.
    pub fn iter_hz(&self) -> impl ExactSizeIterator<Item = f64> + Clone + use<> {
        NOMINAL_HZ[usize::from(self.first)..][..self.len()].iter().copied()
    }

    /// Index of the band with this nominal centre, if it belongs to the run.
    pub fn index_of(&self, centre_hz: f64) -> Option<usize> {
        self.iter_hz().position(|hz| (hz / centre_hz - 1.0).abs() < 0.01)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OctaveBands;

    #[test]
    fn three_thirds_make_an_octave() {
        let (octaves, thirds) = (OctaveBands::T60, ThirdOctaveBands::new(100.0, 10000.0).unwrap());
        assert_eq!(thirds.len(), 3 * octaves.len());
        for i in 0..octaves.len() {
            assert!((thirds.edges_hz(3 * i).0 / octaves.edges_hz(i).0 - 1.0).abs() < 1e-12);
            assert!((thirds.edges_hz(3 * i + 2).1 / octaves.edges_hz(i).1 - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn nominal_and_exact_centres_agree_within_two_percent() {
        let bands = ThirdOctaveBands::new(25.0, 20000.0).unwrap();
        for i in 0..bands.len() {
            assert!((bands.nominal_hz(i) / bands.exact_hz(i) - 1.0).abs() < 0.02);
        }
        assert!(matches!(ThirdOctaveBands::new(101.5, 200.0), Err(Error::UnknownBand { .. })));
        assert!(matches!(ThirdOctaveBands::new(200.0, 100.0), Err(Error::BandOrder { .. })));
    }
}
