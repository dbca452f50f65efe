//! Cost of one band: the squared difference between the slope of its simulated decay and the slope that is wanted.

use crate::decay_slope::DecaySlope;
use crate::fit_problem::FitProblem;
use crate::history::{Trace, check_paths};
use crate::objective::Objective;
use crate::single_paths::SinglePathSlope;
use crate::slope_model::SlopeModel;
use crate::{Error, FitConfig, SlopeObjective};
use sabine_acoustics::{Air, Material};
use sabine_paths::{Conditions, PathSet};

/// J(absorption) = (m - m')2 of one octave band, in (dB/s)2, m' = -60/T60 (Tang et al. 2020, section 3.4).
///
/// The slope m is one of three, see [`SlopeObjective`]. Variables are the absorptions of the materials in this band, 0
/// inclusive to 1 exclusive. The gradient is exact: it comes from how often each path hit each material, and the paths are
/// not traced again.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Material};
/// use sabine_optimize::Objective;
/// use sabine_paths::{Contribution, PathSet, Reflection};
/// use sabine_optimize::{FitConfig, SlopeEvaluation, SlopeObjective};
/// // A corridor in which a path meets the one material every 10 m.
/// let mut paths = PathSet::new(1, 2000.0);
/// let mut chain = PathSet::DIRECT;
/// for n in 0..200 {
///     paths.push(Contribution { length_m: 10.0 * f64::from(n) + 1.0, log_weight: 0.0, chain, tail: PathSet::DIRECT,
///         departure: [1.0, 0.0, 0.0], arrival: [1.0, 0.0, 0.0], batch: None });
///     chain = paths.reflect(chain, 0, Reflection::Specular);
/// }
/// let materials = [Material::uniform(Bands::T60, 0.2, 0.0)?];
/// let config = FitConfig { objective: SlopeObjective::Paper, ..FitConfig::default() };
/// let cost = SlopeEvaluation::new(&config, &[&paths], &materials, &Air::default(), 0, 1.0)?;
/// // 0.969 dB at every reflection, 34.32 reflections a second, and 0.15 dB/s in the air.
/// let mut gradient = [0.0];
/// let slope_db_s = cost.slope_db_per_s(&[0.2], &mut gradient).ok_or("no slope")?;
/// assert!((slope_db_s + 33.26 + 0.15).abs() < 0.01);
/// // J = (m - m')2, and dJ/da = 2 (m - m') dm/da.
/// let j = cost.value_and_gradient(&[0.2], &mut gradient);
/// assert!((j / (slope_db_s + 60.0).powi(2) - 1.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct SlopeEvaluation {
    model: Box<dyn SlopeModel>,
    materials: usize,
    band_hz: f64,
    target_slope_db_per_s: f64,
}

impl SlopeEvaluation {
    /// The cost of band `band` of the materials for a target T60 in seconds; the scattering of `materials` is used, their
    /// absorption is not. Several path sets (source-receiver pairs) have equal weight.
    ///
    /// # Errors
    /// For settings out of range, a target that is not positive, no paths, or materials that do not match the paths.
    pub fn new(
        config: &FitConfig,
        paths: &[&PathSet],
        materials: &[Material],
        air: &Air,
        band: usize,
        target_t60_s: f64,
    ) -> Result<Self, Error> {
        Self::of(config, paths, &FitProblem::new(materials, &[], air), (band, target_t60_s))
    }

    /// The same under conditions, one for each path set: another attenuation, directional ends, laws, walls that react locally. Their materials
    /// must be the same in all; their scattering is used.
    ///
    /// # Errors
    /// As [`SlopeEvaluation::new`], and [`Error::ConditionCount`], [`Error::AddedSound`], and a law that has no value on some path.
    pub fn under(
        config: &FitConfig,
        paths: &[&PathSet],
        conditions: &[Conditions<'_>],
        band: usize,
        target_t60_s: f64,
    ) -> Result<Self, Error> {
        let Some(first) = conditions.first() else {
            return Err(Error::ConditionCount { pairs: paths.len(), found: 0 });
        };
        let problem = FitProblem::new(first.materials, &[], first.air).under(conditions);
        Self::of(config, paths, &problem, (band, target_t60_s))
    }

    fn of(
        config: &FitConfig,
        paths: &[&PathSet],
        problem: &FitProblem<'_>,
        (band, target_t60_s): (usize, f64),
    ) -> Result<Self, Error> {
        let materials = problem.materials;
        config.check()?;
        check_paths(paths, materials)?;
        let bands = materials[0].bands();
        if band >= bands.len() {
            return Err(
                sabine_acoustics::Error::Index { what: "band", index: band, count: bands.len() }.into()
            );
        }
        if !(target_t60_s > 0.0 && target_t60_s.is_finite()) {
            let (low_s, high_s) = crate::fitter::TARGET_RANGE_S;
            return Err(Error::Target {
                band_hz: bands.nominal_hz(band),
                value_s: target_t60_s,
                low_s,
                high_s,
            });
        }
        let traces: Vec<Trace<'_>> =
            paths.iter().enumerate().map(|(pair, paths)| Trace { pair, paths, share: 1.0 }).collect();
        let (histories, unabsorbed) = problem.histories(&traces, config.bin_s)?;
        let pairs = histories
            .into_iter()
            .zip(unabsorbed.iter().zip(paths))
            .map(|(history, (own, paths))| {
                let weights = history.weights(paths, materials, own, band, 1.0)?;
                Ok((history, weights))
            })
            .collect::<Result<Vec<_>, Error>>()?;
        let model: Box<dyn SlopeModel> = match config.objective {
            SlopeObjective::DecayCurve => {
                Box::new(DecaySlope::new(pairs.into_iter().map(|pair| vec![pair]).collect(), config.range_db))
            }
            SlopeObjective::Paper => Box::new(SinglePathSlope::through_mean(&pairs)),
            SlopeObjective::Li2018 => Box::new(SinglePathSlope::through_first(&pairs)),
        };
        Ok(Self {
            model,
            materials: materials.len(),
            band_hz: bands.nominal_hz(band),
            target_slope_db_per_s: -60.0 / target_t60_s,
        })
    }

    /// Nominal centre of the band, in Hz.
    pub fn band_hz(&self) -> f64 {
        self.band_hz
    }

    /// Slope m' that is wanted, in dB/s.
    pub fn target_slope_db_per_s(&self) -> f64 {
        self.target_slope_db_per_s
    }

    /// Slope m in dB/s at an absorption of each material, its derivatives going to `gradient`; `None` in a band without energy.
    ///
    /// # Panics
    /// If either slice is not as long as there are materials.
    pub fn slope_db_per_s(&self, absorption: &[f64], gradient: &mut [f64]) -> Option<f64> {
        assert_eq!((absorption.len(), gradient.len()), (self.materials, self.materials));
        self.model.slope(absorption, gradient)
    }
}

impl Objective for SlopeEvaluation {
    fn dimension(&self) -> usize {
        self.materials
    }

    /// (m - m')2; zero with zero gradient in a band without energy, where nothing can be asked for.
    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        match self.model.slope(x, gradient) {
            Some(slope) => {
                let difference = slope - self.target_slope_db_per_s;
                gradient.iter_mut().for_each(|g| *g *= 2.0 * difference);
                difference * difference
            }
            None => {
                gradient.fill(0.0);
                0.0
            }
        }
    }
}
