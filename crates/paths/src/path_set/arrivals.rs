//! When paths arrive under laws, and what laws add beside them.

use super::PathSet;
use crate::conditions::Conditions;
use crate::laws::{AddedEnergy, delays_s};
use sabine_acoustics::{Error, OutOfRange};

impl PathSet {
    /// What laws of delay add to the time at which each contribution arrives, in seconds; `None` where no law does.
    ///
    /// # Errors
    /// [`Error::MaterialCount`]; a law that has no value on some path or lets it arrive before the emission.
    pub fn delays_s(&self, conditions: &Conditions) -> Result<Option<Vec<f64>>, Error> {
        let bands = self.check_materials(conditions.materials)?;
        let Some(laws) = conditions.laws else { return Ok(None) };
        Ok(delays_s(laws, self, conditions.air.speed_of_sound_m_s(), bands)?)
    }

    /// Energy that laws add in steps of `step_s` seconds from the emission on, `[band][step]`, relative to the direct sound at 1 m; none before the
    /// first arrival. `None` where no law adds any.
    ///
    /// # Errors
    /// As [`PathSet::delays_s`]; [`Error::OutOfRange`] for a step that is not positive; a law that has no value at some time.
    pub fn added_energy(
        &self,
        conditions: &Conditions,
        step_s: f64,
        steps: usize,
    ) -> Result<Option<Vec<Vec<f64>>>, Error> {
        let first_s = self.first_arrival_s(conditions)?;
        self.added_after(conditions, first_s, (-first_s, step_s), steps)
    }

    /// When the first contribution arrives after the emission.
    pub(crate) fn first_arrival_s(&self, conditions: &Conditions) -> Result<f64, Error> {
        let speed_m_s = conditions.air.speed_of_sound_m_s();
        let delays_s = self.delays_s(conditions)?;
        let arrival = |(i, &length_m): (usize, &f32)| {
            f64::from(length_m) / speed_m_s + delays_s.as_ref().map_or(0.0, |delays_s| delays_s[i])
        };
        Ok(self.lengths_m().iter().enumerate().map(arrival).fold(f64::INFINITY, f64::min))
    }

    /// Energy that laws add in steps, the first of which begins `start_s` after the first arrival.
    pub(crate) fn added_after(
        &self,
        conditions: &Conditions,
        first_s: f64,
        (start_s, step_s): (f64, f64),
        steps: usize,
    ) -> Result<Option<Vec<Vec<f64>>>, Error> {
        OutOfRange::check("step (s)", step_s, 1e-6, 10.0, "between 1 us and 10 s")?;
        let bands = self.check_materials(conditions.materials)?;
        let added = conditions.laws.and_then(|laws| AddedEnergy::new(laws, first_s));
        let Some(added) = added.filter(|_| first_s.is_finite()) else { return Ok(None) };
        let energy = |step: usize, hz: f64| {
            let (begin_s, end_s) = (start_s + step as f64 * step_s, start_s + (step + 1) as f64 * step_s);
            let begin_s = begin_s.max(0.0);
            if end_s <= begin_s {
                return Ok(0.0);
            }
            Ok::<f64, Error>((end_s - begin_s) * added.per_s(0.5 * (begin_s + end_s), hz)?)
        };
        let of_band = |hz: f64| (0..steps).map(|step| energy(step, hz)).collect::<Result<Vec<f64>, Error>>();
        Ok(Some(bands.iter_hz().map(of_band).collect::<Result<_, _>>()?))
    }
}
