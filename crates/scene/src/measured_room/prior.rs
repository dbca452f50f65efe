//! What is known of a material beforehand.

use sabine_acoustics::PerBand;

/// How much is known of a material's absorption before anything is fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPrior {
    /// The room file's table, or `None` where the absorption is unknown and to be fitted; the scene then holds
    /// [`MaterialPrior::UNKNOWN_ABSORPTION`] in its place.
    pub absorption: Option<PerBand<f64>>,
    /// How far the table is trusted: one standard deviation, 0.0001 to 1.
    pub absorption_sd: PerBand<f64>,
}

impl MaterialPrior {
    /// Stands in for an unknown absorption: about the mean of the surfaces in [`sabine_acoustics::material_library`].
    pub const UNKNOWN_ABSORPTION: f64 = 0.2;
    /// Standard deviation of an unknown absorption: about that of the surfaces in [`sabine_acoustics::material_library`].
    pub const UNKNOWN_ABSORPTION_SD: f64 = 0.25;
    /// Standard deviation of a table that does not state one (the format's default).
    pub const TABLE_SD: f64 = 0.1;
}
