//! The variables in which absorption is solved for.

/// What a surface takes of the logarithm of energy: the slope of a decay is nearly linear in it, right up to full absorption.
fn loss(absorption: f64) -> f64 {
    -(-absorption).ln_1p()
}

/// The solver's variable for an absorption: its loss less that of the prior's mean, in units in which a step about the mean
/// is one standard deviation of absorption.
#[derive(Clone, Copy)]
pub(crate) struct Scale {
    origin: f64,
    unit: f64,
}

impl Scale {
    /// About a prior's mean, which must be below 1, and its standard deviation.
    pub fn about(mean: f64, standard_deviation: f64) -> Self {
        Self { origin: loss(mean), unit: standard_deviation / (1.0 - mean) }
    }

    pub fn variable(&self, absorption: f64) -> f64 {
        (loss(absorption) - self.origin) / self.unit
    }

    pub fn absorption(&self, variable: f64) -> f64 {
        -(-(self.origin + self.unit * variable)).exp_m1()
    }

    /// Derivative of absorption by the variable.
    pub fn by_variable(&self, variable: f64) -> f64 {
        (1.0 - self.absorption(variable)) * self.unit
    }
}
