//! How far the parameters of a simulation are from those that a table lists.

use crate::fit_problem::FitProblem;
use crate::history::{Trace, check_paths};
use crate::parameter_readings::{unscaled, unscaled_sd};
use crate::table_band::{TableBand, TableValue};
use crate::tables::check_tables;
use crate::{Error, MeasuredParameter, MeasuredTable};
use nalgebra::DVector;
use sabine_acoustics::{Estimate, NoReading, Reading};
use sabine_paths::Conditions;

/// Width of the time bins, in seconds.
const BIN_S: f64 = 1e-3;

/// The table of a pair against the paths between its source and receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct TableMisfit {
    /// Each value of the table, in its order.
    pub values: Vec<ParameterMisfit>,
    /// The octaves in which the table has values, lowest first.
    pub octaves: Vec<OctaveMisfit>,
}

/// A measured value against its prediction.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterMisfit {
    /// What was measured.
    pub measured: MeasuredParameter,
    /// What the paths give, with their Monte-Carlo standard error; else why they give nothing.
    pub predicted: Reading,
    /// Standard deviation of measured less predicted if the model were right: the measurement's error, the interference of arrivals, what is
    /// not known of single reflections, the rays. In the parameter's unit.
    pub expected_sd: f64,
    /// Measured less predicted in such standard deviations; not a number where nothing is predicted. Decay times by their logarithm.
    pub deviations: f64,
    /// The same, given what all other values of the pair and octave deviate by: the square is by how much [`OctaveMisfit::chi_squared`] falls
    /// if this value is left out. A single wrong value has the greatest.
    pub own_deviations: f64,
}

/// All values of a pair in an octave, taken together.
#[derive(Clone, Debug, PartialEq)]
pub struct OctaveMisfit {
    /// Nominal centre, in Hz.
    pub band_hz: f64,
    /// Squared distance of measured from predicted values by their common covariance.
    pub chi_squared: f64,
    /// Number of values.
    pub count: usize,
    /// Index in [`TableMisfit::values`] of the one that deviates most from what the others say.
    pub worst: usize,
}

impl ParameterMisfit {
    /// Measured less predicted in just-noticeable differences; not a number where nothing is predicted.
    pub fn jnd(&self) -> f64 {
        let MeasuredParameter { kind, value, .. } = self.measured;
        self.predicted.as_ref().map_or(f64::NAN, |predicted| -kind.in_jnd(predicted.value, value))
    }
}

impl TableMisfit {
    /// Compares a table with what its paths give under conditions; `reflection_error` as in [`FitConfig`](crate::FitConfig::reflection_error).
    /// Values in bands that the materials do not have are not predicted.
    ///
    /// # Errors
    /// For paths and materials that do not belong together, values that no room has, and laws that have no value on some path or add sound.
    pub fn under(
        table: MeasuredTable<'_>,
        conditions: &Conditions<'_>,
        reflection_error: f64,
    ) -> Result<Self, Error> {
        let Conditions { materials, air, .. } = *conditions;
        check_paths(&[table.paths], materials)?;
        check_tables(&[table])?;
        let bands = materials[0].bands();
        let under = [*conditions];
        let problem = FitProblem::new(materials, &[], air).under(&under);
        let trace = Trace { pair: 0, paths: table.paths, share: 1.0 };
        let (histories, unabsorbed) = problem.histories_since(&[trace], BIN_S, 0)?;
        let none = |measured: &MeasuredParameter| ParameterMisfit {
            measured: *measured,
            predicted: Err(NoReading::NoBand { first_hz: measured.band_hz, last_hz: measured.band_hz }),
            expected_sd: measured.sd(),
            deviations: f64::NAN,
            own_deviations: f64::NAN,
        };
        let mut misfit = Self { values: table.values.iter().map(none).collect(), octaves: Vec::new() };
        for (b, band_hz) in bands.iter_hz().enumerate() {
            let weights = histories[0].weights(table.paths, materials, &unabsorbed[0], b, 1.0)?;
            let absorption: Vec<f64> = materials.iter().map(|m| m.absorption().values()[b]).collect();
            let band_of = |list: &[MeasuredParameter]| {
                TableBand::new(list, (bands, b), (&histories[0], weights.clone()))
            };
            let mut band = band_of(table.values);
            for (place, why) in band.leave_unreadable(&absorption) {
                misfit.values[place].predicted = Err(why);
            }
            if let Some(octave) = misfit.compare(&band, &absorption, reflection_error, band_hz) {
                misfit.octaves.push(octave);
            }
            // What follows from another value is shown, but says nothing of its own.
            for value in &mut misfit.values {
                if matches!(value.predicted, Err(NoReading::NoBand { .. }))
                    && bands.index_of(value.measured.band_hz) == Some(b)
                {
                    let mut alone = Self { values: vec![value.clone()], octaves: Vec::new() };
                    alone.compare(&band_of(&[value.measured]), &absorption, reflection_error, band_hz);
                    *value = ParameterMisfit { own_deviations: f64::NAN, ..alone.values.remove(0) };
                }
            }
        }
        Ok(misfit)
    }

    /// Compares the values of an octave; `None` where there are none.
    fn compare(
        &mut self,
        band: &TableBand<'_>,
        absorption: &[f64],
        reflection_error: f64,
        band_hz: f64,
    ) -> Option<OctaveMisfit> {
        let readings = band.readings(absorption, reflection_error).filter(|r| !r.predicted.is_empty())?;
        let (weight, rays) = (readings.weight(), readings.rays());
        let measured = DVector::from_iterator(band.values.len(), band.values.iter().map(|v| v.measured));
        let residual = &measured - &readings.predicted;
        let weighted = &weight * &residual;
        let own = |i: usize| weighted[i] / weight[(i, i)].sqrt();
        for (i, &TableValue { place, kind, .. }) in band.values.iter().enumerate() {
            let value = unscaled(kind, readings.predicted[i]);
            let sd = (readings.chance[(i, i)] + rays[(i, i)]).sqrt();
            let of = &mut self.values[place];
            of.predicted = Ok(Estimate::new(value, unscaled_sd(kind, value, rays[(i, i)].sqrt())));
            of.expected_sd = unscaled_sd(kind, value, sd);
            of.deviations = residual[i] / sd;
            of.own_deviations = own(i);
        }
        let worst = (0..band.values.len()).max_by(|&i, &j| own(i).abs().total_cmp(&own(j).abs()))?;
        Some(OctaveMisfit {
            band_hz,
            chi_squared: residual.dot(&weighted),
            count: band.values.len(),
            worst: band.values[worst].place,
        })
    }
}
