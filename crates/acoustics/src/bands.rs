//! Octave and third-octave bands as a value, and quantities that know which bands they belong to.

use crate::Error;
use std::ops::Range;

/// Nominal octave centres of IEC 61260-1 (Annex E), from 31.5 Hz to 16 kHz.
const OCTAVES_HZ: [f64; 10] = [31.5, 62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0];
/// Nominal third-octave centres of IEC 61260-1 (Annex E), from 25 Hz to 20 kHz.
const THIRD_OCTAVES_HZ: [f64; 30] = [
    25.0, 31.5, 40.0, 50.0, 62.5, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0, 315.0, 400.0, 500.0, 630.0, 800.0,
    1000.0, 1250.0, 1600.0, 2000.0, 2500.0, 3150.0, 4000.0, 5000.0, 6300.0, 8000.0, 10000.0, 12500.0,
    16000.0, 20000.0,
];
/// What a nominal centre may be off by, as a share: 62.5 and 63 Hz name the same band, as do 31.5 and 31.25 Hz.
const SAME_CENTRE: f64 = 0.01;

/// How wide the bands of a run are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Width {
    Octave,
    Third,
}

impl Width {
    fn nominal_hz(self) -> &'static [f64] {
        match self {
            Self::Octave => &OCTAVES_HZ,
            Self::Third => &THIRD_OCTAVES_HZ,
        }
    }

    /// Position of 1 kHz among the nominal centres.
    fn reference(self) -> i32 {
        match self {
            Self::Octave => 5,
            Self::Third => 16,
        }
    }

    /// Decades from one centre to the next (IEC 61260-1, 5.2, base ten).
    fn decades(self) -> f64 {
        match self {
            Self::Octave => 0.3,
            Self::Third => 0.1,
        }
    }

    fn index_of(self, centre_hz: f64) -> Result<usize, Error> {
        let same = |hz: &f64| (hz / centre_hz - 1.0).abs() < SAME_CENTRE;
        self.nominal_hz().iter().position(same).ok_or(Error::UnknownBand { centre_hz })
    }
}

/// A contiguous run of octave or third-octave bands, named by their nominal centres (62.5 Hz stands for the nominal 63 Hz).
///
/// ```
/// use sabine_acoustics::Bands;
/// let octaves = Bands::octaves(125.0, 8000.0)?;
/// assert_eq!(octaves.len(), 7);
/// assert_eq!(octaves.nominal_hz(2), 500.0);
/// // IEC 61260-1: exact centres are powers of 10^(3/10) about 1 kHz, or of 10^(1/10).
/// assert!((octaves.exact_hz(0) - 125.89).abs() < 0.01);
/// let thirds = Bands::third_octaves(100.0, 10000.0)?;
/// assert_eq!(thirds.len(), 21);
/// assert!((thirds.edges_hz(0).0 / octaves.edges_hz(0).0 - 1.0).abs() < 1e-12);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bands {
    width: Width,
    first: u8,
    count: u8,
}

impl Bands {
    /// 125 Hz to 8 kHz: the seven octaves of the reverberation-time targets (Tang et al. 2020, section 3.3).
    pub const T60: Self = Self { width: Width::Octave, first: 2, count: 7 };
    /// 62.5 Hz to 4 kHz: the octaves of the equalisation targets; the value at 1 kHz is 0 dB by definition.
    pub const EQ: Self = Self { width: Width::Octave, first: 1, count: 7 };
    /// 62.5 Hz to 8 kHz: the eight octaves that are traced and rendered.
    pub const SIMULATION: Self = Self { width: Width::Octave, first: 1, count: 8 };

    /// The octaves from one nominal centre to another, both included.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] if either is not a nominal octave centre from 31.5 Hz to 16 kHz, [`Error::BandOrder`] if
    /// `last_hz < first_hz`.
    pub fn octaves(first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        Self::new(Width::Octave, first_hz, last_hz)
    }

    /// The third octaves from one nominal centre to another, both included.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] if either is not a nominal third-octave centre from 25 Hz to 20 kHz, [`Error::BandOrder`] if
    /// `last_hz < first_hz`.
    pub fn third_octaves(first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        Self::new(Width::Third, first_hz, last_hz)
    }

    fn new(width: Width, first_hz: f64, last_hz: f64) -> Result<Self, Error> {
        let (first, last) = (width.index_of(first_hz)?, width.index_of(last_hz)?);
        if last < first {
            return Err(Error::BandOrder { first_hz, last_hz });
        }
        Ok(Self { width, first: first as u8, count: (last - first + 1) as u8 })
    }

    /// The run with exactly these nominal centres, octaves or third octaves; a single centre that names both is an octave.
    ///
    /// # Errors
    /// [`Error::UnknownBand`] for a centre that is not nominal, [`Error::BandOrder`] if they do not rise octave by octave
    /// or third by third, [`Error::Empty`] if there are none.
    pub fn from_centres_hz(centres_hz: &[f64]) -> Result<Self, Error> {
        let (Some(&first_hz), Some(&last_hz)) = (centres_hz.first(), centres_hz.last()) else {
            return Err(Error::Empty { what: "the list of centres" });
        };
        for &centre_hz in centres_hz {
            // Every nominal octave centre is one of a third octave, too.
            Width::Third.index_of(centre_hz)?;
        }
        let same = |bands: &Self| {
            bands.len() == centres_hz.len()
                && centres_hz.iter().enumerate().all(|(i, &hz)| bands.index_of(hz) == Some(i))
        };
        [Self::octaves(first_hz, last_hz), Self::third_octaves(first_hz, last_hz)]
            .into_iter()
            .flatten()
            .find(same)
            .ok_or(Error::BandOrder { first_hz, last_hz })
    }

    /// The bands with these indices, as a run of its own.
    ///
    /// # Panics
    /// If there are none, or not all of them exist.
    #[must_use]
    pub fn part(&self, indices: Range<usize>) -> Self {
        assert!(
            indices.start < indices.end && indices.end <= self.len(),
            "bands {indices:?} of {}",
            self.len()
        );
        Self { first: self.first + indices.start as u8, count: indices.len() as u8, ..*self }
    }

    /// Bands in an octave: one or three.
    pub fn per_octave(&self) -> usize {
        match self.width {
            Width::Octave => 1,
            Width::Third => 3,
        }
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
        self.width.nominal_hz()[usize::from(self.first) + index]
    }

    /// Exact mid-band frequency of band `index` in Hz (IEC 61260-1, 5.2, base ten).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn exact_hz(&self, index: usize) -> f64 {
        assert!(index < self.len(), "band {index} of {}", self.len());
        let steps = i32::from(self.first) + index as i32 - self.width.reference();
        1000.0 * 10f64.powf(self.width.decades() * f64::from(steps))
    }

    /// Lower and upper band-edge frequencies of band `index` in Hz (IEC 61260-1, 5.4).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn edges_hz(&self, index: usize) -> (f64, f64) {
        let (centre, half) = (self.exact_hz(index), 10f64.powf(0.5 * self.width.decades()));
        (centre / half, centre * half)
    }

    /// Nominal centres in Hz, rising.
    pub fn iter_hz(&self) -> impl ExactSizeIterator<Item = f64> + Clone + use<> {
        self.width.nominal_hz()[usize::from(self.first)..][..self.len()].iter().copied()
    }

    /// Index of the band with this nominal centre, if it belongs to the run.
    pub fn index_of(&self, centre_hz: f64) -> Option<usize> {
        let index = self.width.index_of(centre_hz).ok()?.checked_sub(usize::from(self.first))?;
        (index < self.len()).then_some(index)
    }

    /// Index of the band whose centre is nearest to a frequency, in the logarithm.
    pub fn nearest(&self, frequency_hz: f64) -> usize {
        let steps = (frequency_hz / self.exact_hz(0)).log10() / self.width.decades();
        // As a float at the ends: no frequency is out of range.
        steps.round().clamp(0.0, (self.len() - 1) as f64) as usize
    }
}

/// One value for each band of a run.
///
/// Combining values of different runs is an error, never a silent truncation.
/// ```
/// use sabine_acoustics::{Bands, PerBand};
/// let t60_s = PerBand::from_fn(Bands::T60, |band| 0.8 - 0.05 * band as f64);
/// assert_eq!(t60_s.at_hz(125.0), Some(&0.8));
/// assert_eq!(t60_s.at_hz(62.5), None);
/// let other = PerBand::uniform(Bands::EQ, 0.0);
/// assert!(t60_s.zip_with(&other, |a, b| a + b).is_err());
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PerBand<T> {
    bands: Bands,
    values: Vec<T>,
}

impl<T> PerBand<T> {
    /// Binds `values`, one for each band, lowest first.
    ///
    /// # Errors
    /// [`Error::BandCount`] if the number of values is not the number of bands.
    pub fn new(bands: Bands, values: Vec<T>) -> Result<Self, Error> {
        if values.len() != bands.len() {
            return Err(Error::BandCount { expected: bands.len(), found: values.len() });
        }
        Ok(Self { bands, values })
    }

    /// The value that `value_at` gives for each band index.
    pub fn from_fn(bands: Bands, value_at: impl FnMut(usize) -> T) -> Self {
        Self { bands, values: (0..bands.len()).map(value_at).collect() }
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
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
    pub fn uniform(bands: Bands, value: T) -> Self {
        Self { bands, values: vec![value; bands.len()] }
    }

    /// The quantity on another run of bands: a band that this run lacks takes the value of its nearest band.
    pub fn resampled(&self, bands: Bands) -> Self {
        Self::from_fn(bands, |i| self.values[self.bands.nearest(bands.exact_hz(i))].clone())
    }
}

impl PerBand<f64> {
    /// As [`PerBand::resampled`], but where this run is finer each new band takes the mean over those that lie in it.
    pub fn averaged(&self, bands: Bands) -> Self {
        let nearest = self.resampled(bands);
        Self::from_fn(bands, |i| {
            let (low_hz, high_hz) = bands.edges_hz(i);
            let within = |b: &usize| (low_hz..high_hz).contains(&self.bands.exact_hz(*b));
            let own: Vec<f64> = (0..self.bands.len()).filter(within).map(|b| self.values[b]).collect();
            if own.is_empty() { nearest.values[i] } else { own.iter().sum::<f64>() / own.len() as f64 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_thirds_make_an_octave() {
        let (octaves, thirds) = (Bands::T60, Bands::third_octaves(100.0, 10000.0).unwrap());
        assert_eq!(thirds.len(), 3 * octaves.len());
        for i in 0..octaves.len() {
            assert!((thirds.edges_hz(3 * i).0 / octaves.edges_hz(i).0 - 1.0).abs() < 1e-12);
            assert!((thirds.edges_hz(3 * i + 2).1 / octaves.edges_hz(i).1 - 1.0).abs() < 1e-12);
        }
        let rising = PerBand::from_fn(thirds, |i| i as f64);
        assert_eq!(rising.averaged(octaves).values(), &[1., 4., 7., 10., 13., 16., 19.]);
        assert_eq!(rising.resampled(octaves), rising.averaged(octaves));
        let back = rising.averaged(octaves).averaged(thirds);
        assert_eq!(back.values()[..6], [1., 1., 1., 4., 4., 4.]);
    }

    #[test]
    fn nominal_and_exact_centres_agree_within_two_percent() {
        for bands in [Bands::octaves(31.5, 16000.0).unwrap(), Bands::third_octaves(25.0, 20000.0).unwrap()] {
            for i in 0..bands.len() {
                assert!((bands.nominal_hz(i) / bands.exact_hz(i) - 1.0).abs() < 0.02);
                assert_eq!(bands.nearest(bands.nominal_hz(i)), i);
                assert_eq!(Bands::from_centres_hz(&bands.iter_hz().collect::<Vec<_>>()).unwrap(), bands);
            }
        }
        assert!(matches!(Bands::third_octaves(101.5, 200.0), Err(Error::UnknownBand { .. })));
        assert!(matches!(Bands::third_octaves(200.0, 100.0), Err(Error::BandOrder { .. })));
    }

    #[test]
    fn centres_say_how_wide_the_bands_are() {
        let thirds = Bands::from_centres_hz(&[100.0, 125.0, 160.0, 200.0]).unwrap();
        assert_eq!(
            (thirds.per_octave(), thirds.part(1..3)),
            (3, Bands::third_octaves(125.0, 160.0).unwrap())
        );
        assert_eq!(Bands::from_centres_hz(&[1000.0]).unwrap(), Bands::octaves(1000.0, 1000.0).unwrap());
        assert_eq!(Bands::from_centres_hz(&[800.0]).unwrap().per_octave(), 3);
        assert!(matches!(Bands::from_centres_hz(&[125.0, 160.0, 250.0]), Err(Error::BandOrder { .. })));
    }

    #[test]
    fn the_nominal_run_accepts_both_names_of_the_63_hz_band() {
        assert_eq!(Bands::from_centres_hz(&[63.0, 125.0]).unwrap(), Bands::octaves(62.5, 125.0).unwrap());
    }

    #[test]
    fn gaps_and_falling_centres_are_refused() {
        assert!(matches!(Bands::from_centres_hz(&[125.0, 500.0]), Err(Error::BandOrder { .. })));
        assert!(matches!(Bands::from_centres_hz(&[500.0, 250.0]), Err(Error::BandOrder { .. })));
        assert!(matches!(Bands::from_centres_hz(&[130.0]), Err(Error::UnknownBand { .. })));
        assert!(matches!(Bands::from_centres_hz(&[]), Err(Error::Empty { .. })));
    }

    #[test]
    fn adjacent_bands_share_an_edge() {
        let bands = Bands::SIMULATION;
        for i in 1..bands.len() {
            assert!((bands.edges_hz(i - 1).1 / bands.edges_hz(i).0 - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn mixing_runs_is_an_error_and_resampling_extends_the_ends() {
        let t60 = PerBand::uniform(Bands::T60, 1.0);
        let eq = PerBand::uniform(Bands::EQ, 1.0);
        assert!(matches!(t60.zip_with(&eq, |a, b| a + b), Err(Error::BandMismatch { .. })));
        let rising = PerBand::new(Bands::T60, vec![1., 2., 3., 4., 5., 6., 7.]).unwrap();
        assert_eq!(rising.resampled(Bands::SIMULATION).values(), &[1., 1., 2., 3., 4., 5., 6., 7.]);
        assert_eq!(rising.resampled(Bands::EQ).values(), &[1., 1., 2., 3., 4., 5., 6.]);
    }
}
