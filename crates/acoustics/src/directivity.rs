//! How a source radiates and how a microphone hears in different directions.

use crate::bands::Bands;
use crate::directivity_table::{AngleTable, SphereTable, Stencil};
use crate::error::Error;
use crate::out_of_range::OutOfRange;
use crate::per_band::PerBand;

/// Energy gain over direction and octave, relative to the acoustic axis: the gain on the axis is 1.
///
/// A source with a directivity is therefore compared with the omnidirectional one that is as loud **on its axis**: the direct
/// sound on the axis at 1 m keeps energy 1, and in a diffuse field the reverberation falls by the directivity factor.
/// Directions are those of an [`Orientation`](crate::Orientation): x forward (the axis), y to the left, z up.
/// It is energy, without phase: a rear lobe of opposite polarity counts by its magnitude.
///
/// ```
/// use sabine_acoustics::Directivity;
/// let cardioid = Directivity::first_order(Directivity::CARDIOID)?;
/// assert!(cardioid.energy_gain([-1.0, 0.0, 0.0], 0) < 1e-30); // deaf to the rear
/// assert!((cardioid.energy_gain([0.0, 1.0, 0.0], 0) - 0.25).abs() < 1e-12); // -6 dB at the side
/// assert!((cardioid.index_db(0) - 4.77).abs() < 0.01); // a factor of 3
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Directivity {
    /// `None`: the same in every band.
    bands: Option<Bands>,
    pattern: Pattern,
}

#[derive(Clone, Debug, PartialEq)]
enum Pattern {
    /// Pressure a + (1 - a) cos of the angle to the axis; a per band.
    FirstOrder(Vec<f64>),
    Angles(AngleTable),
    Sphere(SphereTable),
}

/// Where a direction falls in a directivity, whatever the band.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    /// Of the angle to the axis.
    cosine: f64,
    /// Of a pattern that is a table.
    stencil: Stencil,
}

impl Directivity {
    /// Omnidirectional share of the pressure: a sphere.
    pub const OMNIDIRECTIONAL: f64 = 1.0;
    /// Omnidirectional share of a wide cardioid, 0.7: -8 dB at the rear.
    pub const SUBCARDIOID: f64 = 0.7;
    /// Omnidirectional share of a cardioid: nothing from the rear, directivity factor 3.
    pub const CARDIOID: f64 = 0.5;
    /// Omnidirectional share of a supercardioid, (sqrt 3 - 1) / 2: the largest ratio of front to rear half space.
    pub const SUPERCARDIOID: f64 = 0.366_025_403_784_438_6;
    /// Omnidirectional share of a hypercardioid: the largest directivity factor of the first order, 4.
    pub const HYPERCARDIOID: f64 = 0.25;
    /// Omnidirectional share of a figure of eight: nothing from the sides, directivity factor 3.
    pub const FIGURE_OF_EIGHT: f64 = 0.0;

    /// The same in all directions.
    pub fn omni() -> Self {
        Self { bands: None, pattern: Pattern::FirstOrder(vec![1.0]) }
    }

    /// Pressure `a + (1 - a) cos(angle to the axis)` with the omnidirectional share `a` of 0 to 1, in all bands alike.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a share outside 0 to 1.
    pub fn first_order(omni_share: f64) -> Result<Self, Error> {
        OutOfRange::check("omnidirectional share", omni_share, 0.0, 1.0, "between 0 and 1")?;
        Ok(Self { bands: None, pattern: Pattern::FirstOrder(vec![omni_share]) })
    }

    /// As [`Directivity::first_order`] with a share for each octave, as of a loudspeaker that beams towards high frequencies.
    ///
    /// # Errors
    /// As [`Directivity::first_order`].
    pub fn first_order_per_band(omni_share: &PerBand<f64>) -> Result<Self, Error> {
        for &share in omni_share.values() {
            OutOfRange::check("omnidirectional share", share, 0.0, 1.0, "between 0 and 1")?;
        }
        let pattern = Pattern::FirstOrder(omni_share.values().to_vec());
        Ok(Self { bands: Some(omni_share.bands()), pattern })
    }

    /// A pattern that depends on the angle to the axis only: for each octave the levels in dB at these angles in degrees, which
    /// rise from 0 to 180. Minus infinity is a null; the common reference does not matter. Between angles the magnitude of
    /// the pressure goes along a line.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for angles that do not rise from 0 to 180 degrees, a level that is NaN or above 300 dB, or silence on
    /// the axis; [`Error::Length`] if a list of levels is not as long as that of the angles.
    pub fn axisymmetric(angles_deg: &[f64], levels_db: &PerBand<Vec<f64>>) -> Result<Self, Error> {
        let pattern = Pattern::Angles(AngleTable::new(angles_deg, levels_db.values())?);
        Ok(Self { bands: Some(levels_db.bands()), pattern })
    }

    /// A pattern on a regular grid of `azimuths` (0 forward, counted to the left, spaced by 360 degrees / `azimuths`) and
    /// `elevations` (from -90 to 90 degrees, both included): for each octave the levels in dB, `[elevation][azimuth]` in one list.
    ///
    /// Minus infinity is a null; the common reference does not matter. Between the nodes the magnitude of the pressure goes
    /// bilinearly over the angles, across the seam too; at a pole it is the mean of the pole's row, so the pattern is
    /// continuous on the whole sphere.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than 3 azimuths or 3 elevations, a level that is NaN or above 300 dB, or silence on the
    /// axis; [`Error::Length`] for a list of the wrong length.
    pub fn table(azimuths: usize, elevations: usize, levels_db: &PerBand<Vec<f64>>) -> Result<Self, Error> {
        let pattern = Pattern::Sphere(SphereTable::new(azimuths, elevations, levels_db.values())?);
        Ok(Self { bands: Some(levels_db.bands()), pattern })
    }

    /// The bands, or `None` if the pattern is the same in all.
    pub fn bands(&self) -> Option<Bands> {
        self.bands
    }

    /// The same directivity on another run of bands; a band that it lacks takes the nearest one's pattern.
    #[must_use]
    pub fn resampled(&self, bands: Bands) -> Self {
        let Some(own) = self.bands else { return self.clone() };
        let origin = PerBand::from_fn(own, |i| i).resampled(bands);
        let from = origin.values();
        let pattern = match &self.pattern {
            Pattern::FirstOrder(shares) => Pattern::FirstOrder(from.iter().map(|&i| shares[i]).collect()),
            Pattern::Angles(table) => Pattern::Angles(table.picked(from)),
            Pattern::Sphere(table) => Pattern::Sphere(table.picked(from)),
        };
        Self { bands: Some(bands), pattern }
    }

    /// Energy gain in a direction of any length, in the frame of the source or microphone (forward, left, up).
    ///
    /// # Panics
    /// If there is no such band; a pattern that is the same in all bands takes any.
    pub fn energy_gain(&self, direction: [f64; 3], band: usize) -> f64 {
        let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
        self.gain_at(self.place(direction.map(|c| c / length)), band)
    }

    /// Energy gain in a **unit** direction in every band at once, in the frame of the source or microphone (forward, left, up).
    ///
    /// # Panics
    /// If there are more gains than bands; a pattern that is the same in all bands takes any number.
    pub fn energy_gains(&self, direction: [f64; 3], gains: &mut [f64]) {
        let place = self.place(direction);
        gains.iter_mut().enumerate().for_each(|(band, gain)| *gain = self.gain_at(place, band));
    }

    /// Directivity factor Q: energy on the axis over its mean over all directions, by the midpoint rule on cells of one degree.
    ///
    /// # Panics
    /// If there is no such band; a pattern that is the same in all bands takes any.
    pub fn factor(&self, band: usize) -> f64 {
        let (mut sum, mut solid_angle) = (0.0, 0.0);
        for ring in 0..180 {
            let (low, high) = ((f64::from(ring) - 90.0).to_radians(), (f64::from(ring) - 89.0).to_radians());
            let (sine, cosine) = (0.5 * (low + high)).sin_cos();
            let weight = high.sin() - low.sin();
            for sector in 0..360 {
                let (y, x) = (f64::from(sector) + 0.5).to_radians().sin_cos();
                sum += weight * self.gain_at(self.place([cosine * x, cosine * y, sine]), band);
                solid_angle += weight;
            }
        }
        solid_angle / sum
    }

    /// Directivity index, 10 lg of [`Directivity::factor`], in dB.
    ///
    /// # Panics
    /// As [`Directivity::factor`].
    pub fn index_db(&self, band: usize) -> f64 {
        10.0 * self.factor(band).log10()
    }

    /// Where a unit vector falls.
    fn place(&self, direction: [f64; 3]) -> Place {
        let stencil = match &self.pattern {
            Pattern::FirstOrder(_) => Stencil::default(),
            Pattern::Angles(table) => table.stencil(direction),
            Pattern::Sphere(table) => table.stencil(direction),
        };
        Place { cosine: direction[0], stencil }
    }

    /// Energy gain at a place of this directivity.
    fn gain_at(&self, place: Place, band: usize) -> f64 {
        let band = if self.bands.is_none() { 0 } else { band };
        let magnitude = match &self.pattern {
            Pattern::FirstOrder(shares) => shares[band] + (1.0 - shares[band]) * place.cosine,
            Pattern::Angles(table) => table.magnitude(&place.stencil, band),
            Pattern::Sphere(table) => table.magnitude(&place.stencil, band),
        };
        magnitude * magnitude
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn one_band<T: Clone>(value: T) -> PerBand<T> {
        PerBand::uniform(Bands::octaves(1000.0, 1000.0).unwrap(), value)
    }

    fn decibels(magnitude: f64) -> f64 {
        20.0 * magnitude.abs().log10()
    }

    /// The sphere mean of (a + (1 - a) cos)^2 is a^2 + (1 - a)^2 / 3.
    #[test]
    fn factors_of_the_first_order_are_the_closed_forms() {
        for (share, index_db) in [(1.0, 0.0), (0.5, 4.771), (0.25, 6.021), (0.0, 4.771)] {
            let pattern = Directivity::first_order(share).unwrap();
            let closed: f64 = 1.0 / (share * share + (1.0 - share) * (1.0 - share) / 3.0);
            assert!((pattern.factor(0) / closed - 1.0).abs() < 1e-4, "{share}: {}", pattern.factor(0));
            assert!((pattern.index_db(0) - index_db).abs() < 1e-3);
        }
        let supercardioid = Directivity::first_order(Directivity::SUPERCARDIOID).unwrap();
        assert!((supercardioid.index_db(0) - 5.72).abs() < 0.01);
    }

    fn sphere_of(magnitude: impl Fn([f64; 3]) -> f64, azimuths: usize, elevations: usize) -> Directivity {
        let mut levels = Vec::new();
        for row in 0..elevations {
            let elevation = (180.0 * row as f64 / (elevations - 1) as f64 - 90.0).to_radians();
            for column in 0..azimuths {
                let azimuth = (360.0 * column as f64 / azimuths as f64).to_radians();
                let (sine, cosine) = elevation.sin_cos();
                levels.push(decibels(magnitude([cosine * azimuth.cos(), cosine * azimuth.sin(), sine])));
            }
        }
        Directivity::table(azimuths, elevations, &one_band(levels)).unwrap()
    }

    proptest! {
        #[test]
        fn tables_give_the_formula_that_filled_them(
            x in -1.0f64..1.0, y in -1.0f64..1.0, z in -1.0f64..1.0, share in 0.5f64..1.0,
        ) {
            prop_assume!(x * x + y * y + z * z > 0.01);
            let formula = Directivity::first_order(share).unwrap();
            let direction = [x, y, z];
            let angles: Vec<f64> = (0..=36).map(|i| 5.0 * f64::from(i)).collect();
            let magnitude = |cosine: f64| share + (1.0 - share) * cosine;
            let levels = angles.iter().map(|a| decibels(magnitude(a.to_radians().cos()))).collect();
            let around = Directivity::axisymmetric(&angles, &one_band(levels)).unwrap();
            let sphere = sphere_of(|d| magnitude(d[0]), 72, 37);
            for table in [around, sphere] {
                let (found, wanted) = (table.energy_gain(direction, 0), formula.energy_gain(direction, 0));
                // Chords of a cosine over 5 degrees: 0.1 % of the amplitude for each of two directions.
                prop_assert!((found.sqrt() - wanted.sqrt()).abs() < 2.1e-3, "{found} {wanted}");
            }
        }
    }

    #[test]
    fn a_table_is_continuous_at_the_seam_and_the_poles() {
        // Uneven on purpose, also among the values of one pole.
        let levels: Vec<f64> = (0..12 * 7).map(|i| -f64::from(i * 7919 % 23)).collect();
        let table = Directivity::table(12, 7, &one_band(levels)).unwrap();
        let gain = |azimuth: f64, elevation: f64| {
            table.energy_gain(
                [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()],
                0,
            )
        };
        for elevation in [-1.3, -0.4, 0.0, 0.7, 1.5] {
            assert!((gain(1e-9, elevation) - gain(-1e-9, elevation)).abs() < 1e-6);
        }
        for pole in [-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2] {
            let near: Vec<f64> = (0..8).map(|i| gain(f64::from(i), pole * (1.0 - 1e-9))).collect();
            assert!(near.iter().all(|g| (g - near[0]).abs() < 1e-6), "{near:?}");
        }
    }

    #[test]
    fn the_axis_is_the_reference() {
        let angles = [0.0, 90.0, 180.0];
        let loud =
            Directivity::axisymmetric(&angles, &one_band(vec![94.0, 88.0, f64::NEG_INFINITY])).unwrap();
        assert!((loud.energy_gain([2.0, 0.0, 0.0], 0) - 1.0).abs() < 1e-12);
        assert!((10.0 * loud.energy_gain([0.0, 0.0, 1.0], 0).log10() + 6.0).abs() < 1e-9);
        assert!(loud.energy_gain([-1.0, 0.0, 0.0], 0) < 1e-12);
    }

    #[test]
    fn bands_may_differ_and_be_resampled() {
        let bands = Bands::octaves(125.0, 500.0).unwrap();
        let beaming = PerBand::new(bands, vec![1.0, 0.7, 0.5]).unwrap();
        let pattern = Directivity::first_order_per_band(&beaming).unwrap();
        let side = |p: &Directivity, band| p.energy_gain([0.0, 1.0, 0.0], band);
        assert_eq!((side(&pattern, 0), side(&pattern, 2)), (1.0, 0.25));
        let wide = pattern.resampled(Bands::SIMULATION);
        assert_eq!((wide.bands(), side(&wide, 0), side(&wide, 7)), (Some(Bands::SIMULATION), 1.0, 0.25));
    }

    #[test]
    fn tables_that_cannot_be_are_refused() {
        let short = Directivity::axisymmetric(&[0.0, 90.0, 180.0], &one_band(vec![0.0, 0.0]));
        assert!(matches!(short, Err(Error::Length { expected: 3, found: 2 })));
        for angles in [&[0.0, 90.0][..], &[0.0, 0.0, 180.0], &[10.0, 180.0], &[0.0, f64::NAN, 180.0], &[]] {
            let flat = one_band(vec![0.0; angles.len()]);
            assert!(
                matches!(Directivity::axisymmetric(angles, &flat), Err(Error::OutOfRange(_))),
                "{angles:?}"
            );
        }
        let deaf = Directivity::axisymmetric(&[0.0, 180.0], &one_band(vec![f64::NEG_INFINITY, 0.0]));
        assert!(matches!(deaf, Err(Error::OutOfRange(_))));
        let wild = Directivity::axisymmetric(&[0.0, 180.0], &one_band(vec![0.0, f64::INFINITY]));
        assert!(matches!(wild, Err(Error::OutOfRange(_))));
        assert!(matches!(Directivity::table(2, 3, &one_band(vec![0.0; 6])), Err(Error::OutOfRange(_))));
        assert!(matches!(Directivity::table(4, 3, &one_band(vec![0.0; 6])), Err(Error::Length { .. })));
        assert!(Directivity::first_order(1.1).is_err());
    }
}
