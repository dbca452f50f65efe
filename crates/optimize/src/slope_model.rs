//! What every slope of a band's decay is to the solvers.

/// Slope of a band's decay as a function of the absorption of each material.
pub(crate) trait SlopeModel: Send + Sync {
    /// Slope in dB/s; its derivative by each absorption goes to `gradient`. `None` where there is no slope.
    fn slope(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64>;
}
