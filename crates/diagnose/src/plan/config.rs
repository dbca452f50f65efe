//! Settings of a plan.

use crate::config::DiagnoseConfig;
use crate::plan::cost::CostTable;
use crate::plan::error::PlanError;
use sabine_acoustics::OutOfRange;

/// Settings of a [`Planner`](crate::Planner).
#[derive(Clone, Debug, PartialEq)]
pub struct PlanConfig {
    /// Rays, seeds, and what is known of places, gains and levels, as in the diagnosis that will follow. Rays of that diagnosis widen what is
    /// expected of single bins: plan with as many, or a little less is promised than will be found. Wave solutions are left out.
    pub diagnose: DiagnoseConfig,
    /// Places for microphones that are to be chosen, 0 to 20.
    pub microphones: usize,
    /// Places for sources that are to be chosen, 0 to 5.
    pub sources: usize,
    /// Measurements that are weighed, about: 4 to 1000.
    pub candidates: usize,
    /// Least distance of a new place from all surfaces, sources and receivers, in metres: 0.05 to 10.
    pub clearance_m: f64,
    /// Places that microphones can take, in metres, instead of those of a grid; any that lies outside the room is an error when it is traced.
    pub places_m: Vec<[f64; 3]>,
    /// Minutes of each kind of measurement.
    pub cost: CostTable,
}

impl Default for PlanConfig {
    /// Half a metre away from everything; ISO 3382-2:2008, 4.3, asks for a metre, which small rooms do not have.
    fn default() -> Self {
        Self {
            diagnose: DiagnoseConfig { rays: 2000, ..DiagnoseConfig::default() },
            microphones: 3,
            sources: 0,
            candidates: 60,
            clearance_m: 0.5,
            places_m: Vec::new(),
            cost: CostTable::default(),
        }
    }
}

impl PlanConfig {
    /// Checks all settings.
    pub(crate) fn check(&self) -> Result<(), PlanError> {
        self.diagnose.check()?;
        self.cost.check()?;
        for (field, value, low, high, range) in [
            ("microphones", self.microphones as f64, 0.0, 20.0, "0 to 20"),
            ("sources", self.sources as f64, 0.0, 5.0, "0 to 5"),
            ("candidates", self.candidates as f64, 4.0, 1000.0, "4 to 1000"),
            ("clearance_m", self.clearance_m, 0.05, 10.0, "0.05 to 10"),
        ] {
            OutOfRange::check(field, value, low, high, range)?;
        }
        Ok(())
    }
}
