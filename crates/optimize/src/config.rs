//! Settings of a fit and what is known of the materials beforehand.

use sabine_acoustics::{Bands, OutOfRange, PerBand};
use sabine_scene::{MaterialPrior, MeasuredRoom, NamedMaterial};

/// Which slope of the simulated decay is made to meet the target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SlopeObjective {
    /// Slope of the level of the backward-integrated energy over [`FitConfig::range_db`]: what ISO 3382 reads.
    #[default]
    DecayCurve,
    /// Unweighted line through the decibels of single paths (Tang et al. 2020, with its errata mended).
    Paper,
    /// The same line forced through the first path (Li et al. 2018, equation 3).
    Li2018,
}

/// What is known of a material's absorption before the fit, for instance from a table.
#[derive(Clone, Debug, PartialEq)]
pub struct AbsorptionPrior {
    /// Expected absorption, 0..1 (energy, random incidence).
    pub mean: PerBand<f64>,
    /// Standard deviation of absorption about the mean; zero holds the material where it is.
    pub standard_deviation: PerBand<f64>,
}

impl AbsorptionPrior {
    /// What a room's file states of each of its materials, in the order of the scene. A band takes the mean over the bands of the file
    /// that lie in it, or else the nearest one's value, means and standard deviations alike.
    ///
    /// ```
    /// use sabine_acoustics::Bands;
    /// use sabine_scene::MeasuredRoom;
    /// # let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
    /// let room = MeasuredRoom::read(fixture)?;
    /// let priors = sabine_optimize::AbsorptionPrior::of_room(&room, Bands::T60);
    /// assert_eq!(priors.len(), room.scene().materials().len());
    /// # Ok::<(), sabine_scene::Error>(())
    /// ```
    pub fn of_room(room: &MeasuredRoom, bands: Bands) -> Vec<Self> {
        let of = |(named, prior): (&NamedMaterial, &MaterialPrior)| Self {
            mean: named.material.absorption().averaged(bands),
            standard_deviation: prior.absorption_sd.averaged(bands),
        };
        room.scene().materials().iter().zip(room.priors()).map(of).collect()
    }

    /// The same mean and standard deviation in every band.
    pub fn uniform(bands: Bands, mean: f64, standard_deviation: f64) -> Self {
        Self {
            mean: PerBand::uniform(bands, mean),
            standard_deviation: PerBand::uniform(bands, standard_deviation),
        }
    }
}

/// Settings of [`MaterialFitter`](crate::MaterialFitter).
#[derive(Clone, Debug, PartialEq)]
pub struct FitConfig {
    /// Which slope is fitted.
    pub objective: SlopeObjective,
    /// Upper and lower level of the decay range in dB re the total energy: (-5, -35) is T30 (ISO 3382-1, 5.3.3).
    pub range_db: (f64, f64),
    /// Width of the time bins in which energy is summed, in seconds: 0.1 ms to 50 ms.
    pub bin_s: f64,
    /// Least and greatest absorption that a material may take, within 0..1 exclusive of 1.
    pub bounds: (f64, f64),
    /// Curvature of the prior's cost relative to that of the target's in the first round, 1e-6 to 1. It sets the pace,
    /// not the answer: later rounds remove the pull of the prior away from the target until
    /// [`target_tolerance`](Self::target_tolerance) is met.
    pub prior_weight: f64,
    /// How strongly deviations from the prior, counted in standard deviations, are held equal in neighbouring octaves;
    /// 0 fits each band by itself, 1 weighs a difference between neighbours like a deviation from the prior.
    pub smoothness: f64,
    /// Relative standard deviation of the energy of a single early reflection about what the model gives for it, 0 to 2:
    /// what the directions of source and receiver, the angle of incidence and a mesh less than perfect do. Used where responses
    /// are fitted; with 0 the early reflections are trusted as they are.
    pub reflection_error: f64,
    /// Standard deviation of the arrival of a single early reflection about what the model gives for it, in seconds, 0 to 0.01: what
    /// errors of positions and of the mesh do to a path, over the speed of sound. Where responses are fitted, no time bin is narrower than
    /// twice this, and a reflection near an edge may lie on either side of it; with 0 arrivals are trusted as they are.
    pub arrival_error_s: f64,
    /// Most iterations of the solver in each round.
    pub max_iterations: usize,
    /// Most rounds; see [`prior_weight`](Self::prior_weight).
    pub max_rounds: usize,
    /// Relative error of the slope below which a target counts as met.
    pub target_tolerance: f64,
}

impl Default for FitConfig {
    /// Slope of the decay curve over the range of T30, bins of 1 ms, absorption 0.005 to 0.99, bands by themselves, targets
    /// met within 0.5 %, single reflections known to 1 dB and 0.3 ms, which is 0.1 m.
    fn default() -> Self {
        Self {
            objective: SlopeObjective::DecayCurve,
            range_db: (-5.0, -35.0),
            bin_s: 1e-3,
            bounds: (0.005, 0.99),
            prior_weight: 1e-3,
            smoothness: 0.0,
            reflection_error: 0.25,
            arrival_error_s: 3e-4,
            max_iterations: 60,
            max_rounds: 10,
            target_tolerance: 0.005,
        }
    }
}

impl FitConfig {
    /// Checks every field.
    pub(crate) fn check(&self) -> Result<(), OutOfRange> {
        let within = OutOfRange::check;
        within("range_db.0", self.range_db.0, -30.0, 0.0, "between -30 and 0 dB")?;
        within(
            "range_db.1",
            self.range_db.1,
            -80.0,
            self.range_db.0 - 5.0,
            "5 dB below range_db.0 or more, -80 dB at most",
        )?;
        within("bin_s", self.bin_s, 1e-4, 0.05, "between 0.1 ms and 50 ms")?;
        within("bounds.0", self.bounds.0, 0.0, 0.999, "between 0 and 0.999")?;
        within("bounds.1", self.bounds.1, self.bounds.0 + 1e-6, 0.9999, "above bounds.0, 0.9999 at most")?;
        within("prior_weight", self.prior_weight, 1e-6, 1.0, "between 1e-6 and 1")?;
        within("smoothness", self.smoothness, 0.0, 1e4, "between 0 and 10000")?;
        within("reflection_error", self.reflection_error, 0.0, 2.0, "between 0 and 2")?;
        within("arrival_error_s", self.arrival_error_s, 0.0, 0.01, "between 0 and 10 ms")?;
        within("max_iterations", self.max_iterations as f64, 1.0, 1e5, "between 1 and 100000")?;
        within("max_rounds", self.max_rounds as f64, 1.0, 1000.0, "between 1 and 1000")?;
        within("target_tolerance", self.target_tolerance, 1e-6, 1.0, "between 1e-6 and 1")
    }
}
