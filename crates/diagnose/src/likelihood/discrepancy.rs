//! The rival that has no name: any smooth misfit over octave and time that is the same at all positions.

use crate::effect::{Case, DecayTerm, Parameter, Stage};
use crate::simulate::views::BandView;
use crate::survey::Survey;

/// Standard deviation of the discrepancy at a knot, in dB.
const KNOT_SD_DB: f64 = 3.0;
/// Knots over the compared time of an octave.
const KNOTS: [f64; 6] = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0];

/// A smooth level error for each octave: straight lines between knots over the compared time.
struct FreeDiscrepancy {
    /// Compared time of each octave, in seconds after the direct sound.
    end_s: Vec<f64>,
}

/// The discrepancy as a case, given the compared time of each octave in seconds after the direct sound.
pub(crate) fn free_discrepancy(survey: &Survey, end_s: Vec<f64>) -> Case {
    let level = Parameter::new("level", "dB", 0.0, KNOT_SD_DB, (-60.0, 60.0));
    let knots = (0..survey.bands().len())
        .flat_map(|band| KNOTS.map(|_| level.clone().in_band(band, survey)))
        .collect();
    Case::decay(knots, FreeDiscrepancy { end_s }).at(Stage::Recorder)
}

impl DecayTerm for FreeDiscrepancy {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let own = &values[view.band() * KNOTS.len()..(view.band() + 1) * KNOTS.len()];
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            let x = (view.after_direct_s(bin) / self.end_s[view.band()]).clamp(0.0, 1.0);
            let upper = KNOTS.iter().position(|&k| k >= x).unwrap_or(1).max(1);
            let share = (x - KNOTS[upper - 1]) / (KNOTS[upper] - KNOTS[upper - 1]);
            let db = own[upper - 1] * (1.0 - share) + own[upper] * share;
            *l += db * std::f64::consts::LN_10 / 10.0;
        }
    }
}
