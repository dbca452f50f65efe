//! Settings of a diagnosis.

use sabine_acoustics::OutOfRange;
use sabine_propagate::TracerConfig;
use sabine_scene::PositionSd;

/// Specular paths in a cuboid that are predicted exactly.
pub(crate) const CUBOID_PATHS: usize = 150_000;

/// Settings of [`Diagnoser`](crate::Diagnoser).
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnoseConfig {
    /// Rays for each source-receiver pair, 100 to 10 million. Their Monte-Carlo error is part of the expected spread.
    pub rays: usize,
    /// Seed of rays and simulated measurements.
    pub seed: u64,
    /// Specular paths of up to so many reflections are predicted as single arrivals, 1 to 6.
    pub image_order: usize,
    /// Energy is compared until the predicted decay has fallen by so much, 20 to 60 dB.
    pub range_db: f64,
    /// How well positions are known where the room file does not say: one standard deviation along each axis, 0.1 mm to 1 m.
    pub position_sd_m: f64,
    /// How well the gains of responses agree where the room file says that they are common or absolute, 0.01 to 10 dB.
    pub gain_sd_db: f64,
    /// How well the level of one response in one octave can be predicted, all its bins alike: interference, a microphone's own response and
    /// what stands near it, one standard deviation, 0.01 to 10 dB.
    pub level_sd_db: f64,
    /// Logarithm of the odds (nats, after correction for the number tried) at which a cause is named, 0 to 50.
    pub naming_nats: f64,
    /// Probability of a lack of fit below which a misfit counts as real, 1e-6 to 0.5.
    pub significance: f64,
    /// Most causes of decays that are named, and most of all others (places, geometry, clocks, channels), 1 to 5.
    pub most_causes: usize,
    /// Simulated measurements behind the calibration of the lack of fit, 10 to 1000.
    pub simulations: usize,
    /// Solve the wave equation in the octaves below the Schroeder frequency: seconds for each source, twice or more.
    pub wave_solutions: bool,
    /// Go on with a mesh that leaks.
    pub allow_leaks: bool,
}

impl Default for DiagnoseConfig {
    fn default() -> Self {
        Self {
            rays: 10_000,
            seed: 0,
            image_order: 3,
            range_db: 35.0,
            position_sd_m: PositionSd::DEFAULT_M,
            gain_sd_db: 0.4,
            level_sd_db: 0.7,
            naming_nats: 3.0,
            significance: 0.01,
            most_causes: 3,
            simulations: 16,
            wave_solutions: true,
            allow_leaks: false,
        }
    }
}

impl DiagnoseConfig {
    pub(crate) fn check(&self) -> Result<(), OutOfRange> {
        let limits = [
            ("rays", self.rays as f64, 100.0, 1e7, "between 100 and 10 million"),
            ("image_order", self.image_order as f64, 1.0, 6.0, "between 1 and 6"),
            ("range_db", self.range_db, 20.0, 60.0, "between 20 and 60 dB"),
            ("position_sd_m", self.position_sd_m, 1e-4, 1.0, "between 0.1 mm and 1 m"),
            ("gain_sd_db", self.gain_sd_db, 0.01, 10.0, "between 0.01 and 10 dB"),
            ("level_sd_db", self.level_sd_db, 0.01, 10.0, "between 0.01 and 10 dB"),
            ("naming_nats", self.naming_nats, 0.0, 50.0, "between 0 and 50"),
            ("significance", self.significance, 1e-6, 0.5, "between 0.000001 and 0.5"),
            ("most_causes", self.most_causes as f64, 1.0, 5.0, "between 1 and 5"),
            ("simulations", self.simulations as f64, 10.0, 1000.0, "between 10 and 1000"),
        ];
        for (field, value, low, high, range) in limits {
            OutOfRange::check(field, value, low, high, range)?;
        }
        Ok(())
    }

    pub(crate) fn tracer(&self) -> TracerConfig {
        TracerConfig {
            rays: self.rays,
            seed: self.seed,
            image_order: self.image_order,
            cuboid_paths: CUBOID_PATHS,
            path_guiding: true,
            allow_leaks: self.allow_leaks,
            ..TracerConfig::default()
        }
    }
}
