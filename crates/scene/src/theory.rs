//! Reverberation formulas: what theory expects of a room, kept apart from what is measured.

use crate::scene::Scene;
use sabine_acoustics::{Air, Bands, Error, OutOfRange, PerBand};
use std::f64::consts::{LN_10, PI};

/// A room as statistical acoustics sees it: a volume, surfaces, air. All formulas assume a diffuse field; in rooms where the
/// absorption is uneven or the walls are flat and parallel they are off, by up to several times (see
/// `docs/validation/measures.md` and the image-source oracle of the test kit).
///
/// ```
/// use sabine_scene::DiffuseRoom;
/// // 10 x 7 x 3 m, absorption 0.1 everywhere, no air absorption, 343 m/s.
/// let room = DiffuseRoom::new(210.0, &[(242.0, 0.1)], 343.0, 0.0)?;
/// assert!((room.sabine_t60_s() - 1.398).abs() < 1e-3);
/// assert!((room.eyring_t60_s() - 1.327).abs() < 1e-3);
/// assert!((room.mean_free_path_m() - 3.471).abs() < 1e-3);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseRoom {
    volume_m3: f64,
    surfaces: Vec<(f64, f64)>,
    speed_of_sound_m_s: f64,
    air_exponent_per_m: f64,
}

impl DiffuseRoom {
    /// A room of a volume in m3 with surfaces of (area in m2, random-incidence absorption 0 to 1), a speed of sound in m/s and
    /// the energy attenuation exponent of the air in 1/m ([`Air::energy_exponent_per_m`]).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a volume, area, absorption, speed or exponent that cannot be, [`Error::Empty`] without surfaces.
    pub fn new(
        volume_m3: f64,
        surfaces: &[(f64, f64)],
        speed_of_sound_m_s: f64,
        air_exponent_per_m: f64,
    ) -> Result<Self, Error> {
        OutOfRange::check("volume (m3)", volume_m3, 1e-3, 1e9, "between 1 litre and 1 km3")?;
        if surfaces.is_empty() {
            return Err(Error::Empty { what: "the list of surfaces" });
        }
        for &(area_m2, absorption) in surfaces {
            OutOfRange::check("area (m2)", area_m2, 1e-6, 1e8, "positive")?;
            OutOfRange::check("absorption", absorption, 0.0, 1.0, "between 0 and 1")?;
        }
        OutOfRange::check(
            "speed of sound (m/s)",
            speed_of_sound_m_s,
            100.0,
            2000.0,
            "between 100 and 2000 m/s",
        )?;
        OutOfRange::check("air exponent (1/m)", air_exponent_per_m, 0.0, 10.0, "between 0 and 10 per metre")?;
        Ok(Self { volume_m3, surfaces: surfaces.to_vec(), speed_of_sound_m_s, air_exponent_per_m })
    }

    /// The room that a scene encloses, in each band.
    ///
    /// # Errors
    /// As [`DiffuseRoom::new`]; [`Error::BandMismatch`] if the materials are not given in these bands.
    pub fn of_scene(scene: &Scene, air: &Air, bands: Bands) -> Result<PerBand<Self>, Error> {
        let exponents = air.energy_exponent_per_m(bands);
        for named in scene.materials() {
            let found = named.material.absorption().bands();
            if found != bands {
                return Err(Error::BandMismatch { left: bands, right: found });
            }
        }
        let areas = scene.material_areas_m2();
        let rooms = (0..bands.len())
            .map(|i| {
                let surfaces: Vec<(f64, f64)> = areas
                    .iter()
                    .zip(scene.materials())
                    .filter(|(area, _)| **area > 0.0)
                    .map(|(&area, named)| (area, named.material.absorption().values()[i]))
                    .collect();
                Self::new(scene.volume_m3(), &surfaces, air.speed_of_sound_m_s(), exponents.values()[i])
            })
            .collect::<Result<Vec<Self>, Error>>()?;
        PerBand::new(bands, rooms)
    }

    /// Surface in m2.
    pub fn surface_m2(&self) -> f64 {
        self.surfaces.iter().map(|(area, _)| area).sum()
    }

    /// Mean absorption of the surfaces by area, 0 to 1.
    pub fn mean_absorption(&self) -> f64 {
        self.surfaces.iter().map(|(area, absorption)| area * absorption).sum::<f64>() / self.surface_m2()
    }

    /// Mean distance between reflections in a diffuse field, 4 V / S, in metres (Kuttruff, Room Acoustics, 5.2).
    pub fn mean_free_path_m(&self) -> f64 {
        4.0 * self.volume_m3 / self.surface_m2()
    }

    /// Sabine's reverberation time, 24 ln(10) V / (c (S a + 4 m V)), in seconds. Infinite if nothing absorbs.
    pub fn sabine_t60_s(&self) -> f64 {
        self.t60_s(self.surface_m2() * self.mean_absorption())
    }

    /// Eyring's reverberation time (1930), with -S ln(1 - a) for S a, in seconds; 0 if the surfaces absorb everything.
    pub fn eyring_t60_s(&self) -> f64 {
        self.t60_s(-self.surface_m2() * (1.0 - self.mean_absorption()).ln())
    }

    /// Millington's and Sette's reverberation time (1932), with -sum S_i ln(1 - a_i) for S a, in seconds; 0 as soon as one
    /// surface absorbs everything.
    pub fn millington_t60_s(&self) -> f64 {
        self.t60_s(
            -self.surfaces.iter().map(|(area, absorption)| area * (1.0 - absorption).ln()).sum::<f64>(),
        )
    }

    /// Arau-Puchades' reverberation time for a box (1988), in seconds: the geometric mean of Eyring's formula for the mean
    /// absorption of each pair of facing walls, weighted by their areas. `pairs` are (area of both walls in m2, their mean
    /// absorption); the surfaces of the room itself play no part.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an area that is not positive or an absorption outside 0 to 1.
    pub fn arau_puchades_t60_s(&self, pairs: [(f64, f64); 3]) -> Result<f64, Error> {
        self.over_pairs(pairs, |share, t60_s| share * t60_s.ln()).map(f64::exp)
    }

    /// Fitzroy's reverberation time for a box (1959), in seconds: as [`DiffuseRoom::arau_puchades_t60_s`] with the arithmetic
    /// mean. It overestimates where one pair absorbs little.
    ///
    /// # Errors
    /// As [`DiffuseRoom::arau_puchades_t60_s`].
    pub fn fitzroy_t60_s(&self, pairs: [(f64, f64); 3]) -> Result<f64, Error> {
        self.over_pairs(pairs, |share, t60_s| share * t60_s)
    }

    /// Distance from a source of directivity factor `directivity` (1: all directions alike) at which the reverberant field
    /// is as strong as the direct sound, sqrt(Q A / (16 pi)), in metres (Kuttruff, 5.5).
    pub fn critical_distance_m(&self, directivity: f64) -> f64 {
        let area_m2 =
            self.surface_m2() * self.mean_absorption() + 4.0 * self.air_exponent_per_m * self.volume_m3;
        (directivity * area_m2 / (16.0 * PI)).sqrt()
    }

    fn over_pairs(&self, pairs: [(f64, f64); 3], term: impl Fn(f64, f64) -> f64) -> Result<f64, Error> {
        let total_m2: f64 = pairs.iter().map(|(area, _)| area).sum();
        let mut sum = 0.0;
        for (area_m2, absorption) in pairs {
            OutOfRange::check("area of a pair of walls (m2)", area_m2, 1e-6, 1e8, "positive")?;
            OutOfRange::check("absorption of a pair of walls", absorption, 0.0, 1.0, "between 0 and 1")?;
            sum += term(area_m2 / total_m2, self.t60_s(-total_m2 * (1.0 - absorption).ln()));
        }
        Ok(sum)
    }

    /// Energy falls as exp(-c (A / 4 V + m) t): 60 dB take 6 ln(10) over that rate.
    fn t60_s(&self, absorption_area_m2: f64) -> f64 {
        24.0 * LN_10 * self.volume_m3
            / (self.speed_of_sound_m_s
                * (absorption_area_m2 + 4.0 * self.air_exponent_per_m * self.volume_m3))
    }
}

/// Frequency above which modes overlap enough for statistics, 2000 sqrt(T / V), in Hz (Schroeder 1962; Kuttruff, 3.5), for a
/// reverberation time in seconds and a volume in m3.
///
/// ```
/// // A living room: below 200 Hz single modes count.
/// assert_eq!(sabine_scene::schroeder_frequency_hz(0.5, 50.0).round(), 200.0);
/// ```
pub fn schroeder_frequency_hz(t60_s: f64, volume_m3: f64) -> f64 {
    2000.0 * (t60_s / volume_m3).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use sabine_acoustics::Material;

    #[test]
    fn a_scene_gives_the_same_room_as_its_numbers() {
        let bands = Bands::SIMULATION;
        let material = Material::uniform(bands, 0.1, 0.1).unwrap();
        let scene = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| material.clone())).unwrap();
        let air = Air::default();
        let rooms = DiffuseRoom::of_scene(&scene, &air, bands).unwrap();
        let exponent = air.energy_exponent_per_m(bands).values()[4];
        let room = DiffuseRoom::new(210.0, &[(242.0, 0.1)], air.speed_of_sound_m_s(), exponent).unwrap();
        assert!((rooms.values()[4].eyring_t60_s() - room.eyring_t60_s()).abs() < 1e-9);
        assert!(matches!(DiffuseRoom::of_scene(&scene, &air, Bands::T60), Err(Error::BandMismatch { .. })));
    }

    #[test]
    fn walls_that_absorb_nothing_leave_the_air_to_end_the_sound() {
        let air = Air::default();
        let exponent = air.attenuation_db_per_m(8000.0) * LN_10 / 10.0;
        let room = DiffuseRoom::new(100.0, &[(130.0, 0.0)], air.speed_of_sound_m_s(), exponent).unwrap();
        for found in [room.sabine_t60_s(), room.eyring_t60_s(), room.millington_t60_s()] {
            assert!((found / air.t60_limit_s(8000.0) - 1.0).abs() < 1e-9);
        }
    }

    /// At the critical distance the direct intensity Q / (4 pi r^2) equals the diffuse one, 4 / A.
    #[test]
    fn fields_are_equal_at_the_critical_distance() {
        let room = DiffuseRoom::new(210.0, &[(242.0, 0.1)], 343.0, 0.0).unwrap();
        let r = room.critical_distance_m(2.0);
        assert!((2.0 / (4.0 * PI * r * r) / (4.0 / 24.2) - 1.0).abs() < 1e-12);
    }

    proptest! {
        /// Sabine is never below Eyring, Eyring never below Millington; equal absorption makes the box formulas Eyring's;
        /// Fitzroy's arithmetic mean is never below the geometric one.
        #[test]
        fn formulas_keep_their_order(
            x in 2.0..30.0f64, y in 2.0..30.0f64, z in 2.0..10.0f64,
            a in 0.01..0.95f64, b in 0.01..0.95f64, c in 0.01..0.95f64,
        ) {
            let pairs = [(2.0 * y * z, a), (2.0 * x * z, b), (2.0 * x * y, c)];
            let room = DiffuseRoom::new(x * y * z, &pairs, 343.0, 1e-3).unwrap();
            prop_assert!(room.sabine_t60_s() >= room.eyring_t60_s());
            prop_assert!(room.eyring_t60_s() >= room.millington_t60_s() * (1.0 - 1e-12));
            let (arau, fitzroy) =
                (room.arau_puchades_t60_s(pairs).unwrap(), room.fitzroy_t60_s(pairs).unwrap());
            prop_assert!(fitzroy >= arau * (1.0 - 1e-12));
            let even = pairs.map(|(area, _)| (area, a));
            let room = DiffuseRoom::new(x * y * z, &even, 343.0, 1e-3).unwrap();
            prop_assert!((room.arau_puchades_t60_s(even).unwrap() / room.eyring_t60_s() - 1.0).abs() < 1e-9);
            prop_assert!((room.fitzroy_t60_s(even).unwrap() / room.eyring_t60_s() - 1.0).abs() < 1e-9);
        }
    }
}
