//! What can be wrong with an extended model, and which field says so.

use crate::extend::applied_changes::{AppliedChanges, Dimensions};
use crate::extend::laws_of_pairs::check_laws;
use crate::survey::planes::dot;
use sabine_acoustics::{Bands, Error as Cause, OutOfRange};
use sabine_scene::MeasuredRoom;
use std::collections::{BTreeMap, BTreeSet};

/// A field and what is wrong with it.
pub(super) type Fault = (String, Cause);

impl AppliedChanges {
    /// Everything that can be said without the room; the bands.
    pub(super) fn check(&self) -> Result<Bands, Fault> {
        check_laws(&self.laws)?;
        let bands = Bands::from_centres_hz(&self.centres_hz).map_err(|e| ("centres_hz".to_owned(), e))?;
        let check = Checks { bands: bands.len() };
        self.check_bands(&check)?;
        self.check_numbers(&check)?;
        Ok(bands)
    }

    fn check_bands(&self, check: &Checks) -> Result<(), Fault> {
        for (table, columns) in [
            ("absorption", &self.absorption),
            ("scattering", &self.scattering),
            ("receiver_pattern.directed_share", &self.receiver_directed_share),
        ] {
            for (name, values) in columns {
                check.per_band(&format!("{table}.{name}"), values, (0.0, 1.0), "between 0 and 1")?;
            }
        }
        for (name, values) in &self.response_band_gain_db {
            let field = format!("response_band_gains.{name}");
            check.per_band(&field, values, (-200.0, 200.0), "within 200 dB")?;
        }
        for (field, values, limits, range) in [
            ("gain_db", &self.gain_db, (-200.0, 200.0), "within 200 dB"),
            ("source_pattern.directed_share", &self.directed_share, (0.0, 1.0), "between 0 and 1"),
            ("noise_per_s", &self.noise_per_s, (0.0, 1e6), "between 0 and a million per second"),
        ] {
            if !values.is_empty() {
                check.per_band(field, values, limits, range)?;
            }
        }
        if let Some(coupled) = &self.coupled {
            let most = "between 0 and a million per second";
            check.per_band("coupled.energy_per_s", &coupled.energy_per_s, (0.0, 1e6), most)?;
            let range = "between 0.01 and 100 s";
            check.per_band("coupled.decay_time_s", &coupled.decay_time_s, (0.01, 100.0), range)?;
        }
        Ok(())
    }

    fn check_numbers(&self, check: &Checks) -> Result<(), Fault> {
        let (gradient, centre) = self
            .coupled
            .as_ref()
            .map_or((Vec::new(), Vec::new()), |c| (c.gradient_db_per_m.to_vec(), c.centre_m.to_vec()));
        let of_dimensions = |pick: fn(&Dimensions) -> [f64; 3]| {
            self.dimensions.as_ref().map_or(Vec::new(), |d| pick(d).to_vec())
        };
        let one = |value: Option<f64>| value.into_iter().collect::<Vec<f64>>();
        let places = self.position_m.iter().map(|(id, p)| (format!("position.{id}"), p));
        let axes = self.axis.iter().map(|(id, p)| (format!("source_pattern.axis.{id}"), p));
        let heard = self.receiver_axis.iter().map(|(id, p)| (format!("receiver_pattern.axis.{id}"), p));
        for (field, values) in places.chain(axes).chain(heard) {
            check.each(&field, values, (-1e5, 1e5), "a finite coordinate")?;
        }
        for (name, &gain) in &self.response_gain_db {
            check.each(&format!("response_gain.{name}"), &[gain], (-200.0, 200.0), "within 200 dB")?;
        }
        if let Some(motion) = &self.coordinate_shift {
            check.each("coordinate_shift.shift_m", &motion.shift_m, (-100.0, 100.0), "within 100 m")?;
            check.each(
                "coordinate_shift.turn_deg",
                &[motion.turn_deg],
                (-180.0, 180.0),
                "within 180 degrees",
            )?;
            check.each("coordinate_shift.about_m", &motion.about_m, (-1e5, 1e5), "a finite coordinate")?;
        }
        for surface in &self.surfaces {
            check.each("surface.point_m", &surface.point_m, (-1e5, 1e5), "a finite coordinate")?;
            let length = dot(surface.normal, surface.normal).sqrt();
            check.each("surface.normal", &[length], (0.99, 1.01), "a vector of length 1")?;
            check.each("surface.offset_m", &[surface.offset_m], (-2.0, 2.0), "within 2 m")?;
            check.each("surface.tilt_deg", &surface.tilt_deg, (-20.0, 20.0), "within 20 degrees")?;
        }
        for sheet in &self.sheets {
            let corners = sheet.corners_m.as_flattened();
            check.each("sheet.corners_m", corners, (-1e5, 1e5), "a finite coordinate")?;
            check.each("sheet.absorption", &[sheet.absorption], (0.0, 1.0), "between 0 and 1")?;
        }
        for object in &self.objects {
            check.each("object.foot_m", &object.foot_m, (-1e5, 1e5), "a finite coordinate")?;
            check.each("object.size_m", &object.size_m, (0.05, 20.0), "between 0.05 and 20 m")?;
            check.each("object.turn_deg", &[object.turn_deg], (-180.0, 180.0), "within 180 degrees")?;
        }
        self.check_gain_over_time(check)?;
        for (field, values, limits, range) in [
            (
                "relative_humidity_percent",
                one(self.relative_humidity_percent),
                (0.0, 100.0),
                "between 0 and 100 %",
            ),
            ("temperature_c", one(self.temperature_c), (-20.0, 50.0), "between -20 and 50 C"),
            ("clock_ppm", one(self.clock_ppm), (-2e4, 2e4), "within 20000 ppm"),
            ("wave_below_hz", one(self.wave_below_hz), (20.0, 3500.0), "between 20 and 3,500 Hz"),
            ("locally_reacting_share", one(self.locally_reacting_share), (-0.5, 1.5), "between -0.5 and 1.5"),
            ("latency_s", one(self.latency_s), (-10.0, 10.0), "within 10 s"),
            (
                "truncation_s",
                self.truncation.map_or(Vec::new(), |t| t.to_vec()),
                (0.0, 1e3),
                "between 0 and 1000 s",
            ),
            ("coupled.gradient_db_per_m", gradient, (-100.0, 100.0), "within 100 dB/m"),
            ("coupled.centre_m", centre, (-1e5, 1e5), "a finite coordinate"),
            ("dimensions.scale", of_dimensions(|d| d.scale), (0.5, 2.0), "between 0.5 and 2"),
            ("dimensions.shift_m", of_dimensions(|d| d.shift_m), (-100.0, 100.0), "within 100 m"),
        ] {
            check.each(field, &values, limits, range)?;
        }
        Ok(())
    }

    fn check_gain_over_time(&self, check: &Checks) -> Result<(), Fault> {
        let Some(gain) = &self.gain_over_time else { return Ok(()) };
        let (times, gains) = (&gain.time_s, &gain.gain_db);
        if times.len() != gains.len() || times.is_empty() {
            let error = Cause::BandCount { expected: times.len().max(1), found: gains.len() };
            return Err(("gain_over_time.gain_db".to_owned(), error));
        }
        check.each("gain_over_time.time_s", times, (0.0, 1e4), "between 0 and 10000 s")?;
        check.each("gain_over_time.gain_db", gains, (-200.0, 200.0), "within 200 dB")?;
        let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        check.each("gain_over_time.time_s", &steps, (1e-9, 1e4), "rising")
    }

    pub(super) fn check_names(&self, room: &MeasuredRoom) -> Result<(), Fault> {
        let materials: BTreeSet<&str> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
        let sources: BTreeSet<&str> = room.sources().iter().map(|s| s.id.as_str()).collect();
        let receivers: BTreeSet<&str> = room.receivers().iter().map(|r| r.id.as_str()).collect();
        let places: BTreeSet<&str> = sources.union(&receivers).copied().collect();
        let pairs: BTreeSet<String> =
            sources.iter().flat_map(|s| receivers.iter().map(move |r| format!("{s}-{r}"))).collect();
        let pairs: BTreeSet<&str> = pairs.iter().map(String::as_str).collect();
        let exchanged: Vec<String> = self.exchanged.iter().flatten().cloned().collect();
        for (field, names, known) in [
            ("absorption", keys(&self.absorption), &materials),
            ("scattering", keys(&self.scattering), &materials),
            ("object.material", self.objects.iter().map(|o| o.material.clone()).collect(), &materials),
            ("source_pattern.axis", keys(&self.axis), &sources),
            ("receiver_pattern.directed_share", keys(&self.receiver_directed_share), &receivers),
            ("receiver_pattern.axis", keys(&self.receiver_axis), &receivers),
            ("position", keys(&self.position_m), &places),
            ("response_gain", keys(&self.response_gain_db), &pairs),
            ("response_band_gains", keys(&self.response_band_gain_db), &pairs),
            ("inverted", self.inverted.clone(), &pairs),
            ("exchanged", exchanged, &pairs),
        ] {
            if let Some(id) = names.into_iter().find(|name| !known.contains(name.as_str())) {
                return Err((field.to_owned(), Cause::UnknownId { id }));
            }
        }
        Ok(())
    }
}

fn keys<T>(table: &BTreeMap<String, T>) -> Vec<String> {
    table.keys().cloned().collect()
}

struct Checks {
    bands: usize,
}

impl Checks {
    fn per_band(
        &self,
        field: &str,
        values: &[f64],
        limits: (f64, f64),
        range: &'static str,
    ) -> Result<(), Fault> {
        if values.len() != self.bands {
            let error = Cause::BandCount { expected: self.bands, found: values.len() };
            return Err((field.to_owned(), error));
        }
        self.each(field, values, limits, range)
    }

    #[allow(clippy::unused_self)] // reads as the other check does
    fn each(
        &self,
        field: &str,
        values: &[f64],
        (low, high): (f64, f64),
        range: &'static str,
    ) -> Result<(), Fault> {
        match values.iter().find(|v| !(low..=high).contains(*v)) {
            Some(&value) => {
                Err((field.to_owned(), Cause::OutOfRange(OutOfRange { field: "value", value, range })))
            }
            None => Ok(()),
        }
    }
}
