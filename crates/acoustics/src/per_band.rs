//! Quantities that know which bands they belong to.

use crate::bands::Bands;
use crate::error::Error;

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
