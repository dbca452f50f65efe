//! A pair of which a table states parameters in place of a response: what its bins are read for.

use super::EnergyModel;
use crate::observe::stated_parameter::StatedParameter;
use crate::simulate::table_chance::TableChance;
use crate::simulate::table_readings::{TimeAxis, read, slopes};

/// The values that a table states of a pair in a band, and the bins from which they are predicted.
pub(super) struct TableBand<'a> {
    stated: &'a [StatedParameter],
    axis: TimeAxis<'a>,
    pub chance: &'a TableChance,
    /// Logarithms of the predicted energies.
    ln_energy: Vec<f64>,
}

impl TableBand<'_> {
    /// Logarithms of the quantities that are to be expected.
    pub fn predicted(&self) -> Vec<f64> {
        let read = read(self.stated, self.axis, &self.ln_energy);
        read.iter().zip(&self.chance.bias).map(|(ln, bias)| ln + bias).collect()
    }

    /// Their change with the logarithm of each energy, `[value][bin]`.
    pub fn slopes(&self) -> Vec<Vec<f64>> {
        slopes(self.stated, self.axis, &self.ln_energy)
    }

    /// Variances of measured less predicted logarithms, chance left out: the error of the measurement, and what bins are too wide to tell.
    pub fn variances(&self) -> Vec<f64> {
        let both = self.stated.iter().zip(&self.chance.by_width_of_bins);
        both.map(|(parameter, by_width)| parameter.ln_sd * parameter.ln_sd + by_width * by_width).collect()
    }
}

impl EnergyModel<'_> {
    /// The table of a pair in a band, read from these predicted bins; `None` of a pair with a response.
    pub(super) fn table(&self, pair: usize, band: usize, ln_energy: &[f64]) -> Option<TableBand<'_>> {
        let stated = self.data.measured[self.assignment[pair]].table.as_ref()?;
        let state = &self.data.states[pair][band];
        Some(TableBand {
            stated: &stated[band],
            axis: TimeAxis { bins: state.bins, time_s: &state.time_s },
            chance: state.table.as_ref()?,
            ln_energy: ln_energy.to_vec(),
        })
    }

    /// Whether a pair has a table in place of a response.
    pub(super) fn is_table(&self, pair: usize) -> bool {
        self.data.measured[self.assignment[pair]].table.is_some()
    }

    /// Bins that must be predicted for so many values that are compared: of a table all of them.
    pub(super) fn predicted_bins(&self, pair: usize, band: usize, count: usize) -> usize {
        if self.is_table(pair) { self.data.states[pair][band].ln_energy.len() } else { count }
    }
}
