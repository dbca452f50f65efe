//! Fits the absorption of materials to tables of measured parameters, alone or beside responses.

use crate::fit_problem::FitProblem;
use crate::history::{History, Unabsorbed};
use crate::response_band::ResponseBand;
use crate::table_band::TableBand;
use crate::{Error, MaterialFitter, MeasuredTable, ResponseFit};
use sabine_acoustics::{NoReading, Observer, PerBand};
use sabine_scene::{Levels, Measurement, TimeZero};

/// Materials fitted to tables of parameters, or to tables and responses.
#[derive(Clone, Debug)]
pub struct TableFit {
    /// The materials, what must be said about them, and what concerns the responses.
    pub of_responses: ResponseFit,
    /// How much farther the values of the tables lie from the fitted ones than chance and their errors put them, as a variance ratio
    /// (1 = the model explains them, and never less); standard errors are widened accordingly. `None` in a band without values.
    pub dispersion: PerBand<Option<f64>>,
    /// Values that were left out, and why: index of the table, of the value in it, reason.
    pub left_out: Vec<(usize, usize, NoReading)>,
}

impl MaterialFitter {
    /// Fits to the parameters of several pairs, all bands and parameters at once.
    ///
    /// Each value is taken for normally distributed about what the decay of the paths gives (decay times by their logarithm), with the
    /// covariance of all values of a pair and octave: what the measurement leaves open ([`MeasuredParameter::sd`](crate::MeasuredParameter::sd)), what the interference
    /// of arrivals at random phase does to the energies that all of them are read from, what is not known of single reflections
    /// ([`FitConfig::reflection_error`](crate::FitConfig::reflection_error)), and the Monte-Carlo error of the rays. `docs/explanation/objective.md` derives it.
    /// No level and no time zero is needed: parameters count from the direct sound. D50 beside a C50 of the same pair and octave is not used twice.
    ///
    /// # Errors
    /// As [`fit_responses`](Self::fit_responses); [`sabine_acoustics::Error::OutOfRange`] for values that no room has;
    /// [`Error::NoDecay`] if there is no value in any of the bands.
    pub fn fit_tables(
        &self,
        tables: &[MeasuredTable<'_>],
        problem: &FitProblem<'_>,
        observer: &dyn Observer,
    ) -> Result<TableFit, Error> {
        let measurement = Measurement { time_zero: TimeZero::PerResponse, levels: Levels::PerResponse };
        self.fit_measured((&[], measurement), tables, problem, observer)
    }

    /// What the tables add to each band, and what is left out of it.
    pub(crate) fn read_tables<'h>(
        &self,
        bands: &mut [ResponseBand<'h>],
        tables: &[MeasuredTable<'_>],
        (histories, unabsorbed): (&'h [History], &[Unabsorbed]),
        problem: &FitProblem<'_>,
    ) -> Result<Vec<(usize, usize, NoReading)>, Error> {
        let octaves = problem.materials[0].bands();
        let mut left_out = Vec::new();
        for (b, band) in bands.iter_mut().enumerate() {
            let start = band.prior.mean.clone();
            for (i, table) in tables.iter().enumerate() {
                let weights = histories[i].weights(table.paths, problem.materials, &unabsorbed[i], b, 1.0)?;
                let mut of_band = TableBand::new(table.values, (octaves, b), (&histories[i], weights));
                let unread = of_band.leave_unreadable(&self.within(&start));
                left_out.extend(unread.into_iter().map(|(place, why)| (i, place, why)));
                band.tables.push(of_band);
            }
        }
        Ok(left_out)
    }

    /// Absorption within the bounds of the fit.
    fn within(&self, absorption: &[f64]) -> Vec<f64> {
        let (lower, upper) = self.config().bounds;
        absorption.iter().map(|a| a.clamp(lower, upper)).collect()
    }
}

/// That every value can be.
pub(crate) fn check_tables(tables: &[MeasuredTable<'_>]) -> Result<(), Error> {
    tables.iter().flat_map(|table| table.values).try_for_each(|value| Ok(value.check()?))
}
