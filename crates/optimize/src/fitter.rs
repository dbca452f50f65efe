//! Fits the absorption of materials to reverberation times.

use crate::assembly::FoundBand;
use crate::decay_slope::DecaySlope;
use crate::fit::{MaterialFit, Unreachable, UnreachableReason, Warning, at_bound};
use crate::fit_problem::FitProblem;
use crate::group::{Band, Fitted, Group};
use crate::history::{Trace, by_pair, check_paths};
use crate::single_paths::SinglePathSlope;
use crate::uncertainty::Spread;
use crate::unknowns::BandPrior;
use crate::{AbsorptionPrior, Error, FitConfig, SlopeObjective};
use rayon::prelude::*;
use sabine_acoustics::{Air, Bands, Estimate, Material, Observer, PerBand, report};
use sabine_paths::PathSet;
use std::sync::atomic::{AtomicU64, Ordering};

/// Shortest and longest T60 that is accepted as a target, in seconds: a studio's booth and a mausoleum.
pub(crate) const TARGET_RANGE_S: (f64, f64) = (0.02, 20.0);
/// Name of this work to an observer.
const STAGE: &str = "fit materials";
/// Relative Monte-Carlo error of T60 that is worth a warning.
const FEW_PATHS: f64 = 0.03;

/// Fits materials so that the simulated decay of every band has the slope -60/T60.
///
/// Of all materials that meet the targets it finds those that are most probable by their priors. One target for each band
/// cannot tell several materials apart: what the data leave open is said in the result.
#[derive(Clone, Debug)]
pub struct MaterialFitter {
    config: FitConfig,
}

impl MaterialFitter {
    /// A fitter with these settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting out of its range.
    pub fn new(config: FitConfig) -> Result<Self, Error> {
        config.check()?;
        Ok(Self { config })
    }

    /// The settings.
    pub fn config(&self) -> &FitConfig {
        &self.config
    }

    /// Fits to one reverberation time for each band, in seconds, the mean over the given source-receiver pairs.
    ///
    /// `materials` give the bands and the scattering, `priors` what is expected of their absorption (and the start of the
    /// search; the absorption in `materials` is not used). A band of the materials for which there is no target takes that of the
    /// nearest band which has one: 62.5 Hz that of 125 Hz, as the paper does.
    ///
    /// # Errors
    /// For paths, materials, priors or targets that do not match or are out of range, paths too short for a target, [`Error::NotConverged`] if the fit converges in none of the bands, and
    /// [`sabine_acoustics::Error::Cancelled`] if the observer asks to stop. A target that cannot be reached is no error.
    pub fn fit_t60(
        &self,
        paths: &[&PathSet],
        problem: &FitProblem<'_>,
        target_t60_s: &PerBand<Estimate>,
        observer: &dyn Observer,
    ) -> Result<MaterialFit, Error> {
        let traces: Vec<Trace<'_>> =
            paths.iter().enumerate().map(|(pair, paths)| Trace { pair, paths, share: 1.0 }).collect();
        self.fit_traces(&traces, problem, target_t60_s, observer)
    }

    /// Whether targets are in range, and paths of this duration in seconds long enough for them: what [`fit_t60`](Self::fit_t60)
    /// would refuse after they have been traced.
    ///
    /// # Errors
    /// [`Error::Target`], [`Error::TargetError`] and [`Error::PathsTooShort`].
    pub fn check_t60(
        &self,
        target_t60_s: &PerBand<Estimate>,
        bands: Bands,
        air: &Air,
        traced_s: f64,
    ) -> Result<(), Error> {
        check_targets(target_t60_s)?;
        let limits_s = air_limits_s(air, bands);
        for ((band_hz, target), limit_s) in target_t60_s.resampled(bands).iter().zip(limits_s.values()) {
            let needed_s = -self.config.range_db.1 / 60.0 * target.value.min(*limit_s);
            if traced_s < needed_s {
                return Err(Error::PathsTooShort { band_hz, target_s: target.value, needed_s, traced_s });
            }
        }
        Ok(())
    }

    /// The same for pairs that were traced more than once: their energies add up.
    pub(crate) fn fit_traces(
        &self,
        traces: &[Trace<'_>],
        problem: &FitProblem<'_>,
        target_t60_s: &PerBand<Estimate>,
        observer: &dyn Observer,
    ) -> Result<MaterialFit, Error> {
        let FitProblem { materials, priors, air, .. } = *problem;
        let paths: Vec<&PathSet> = traces.iter().map(|t| t.paths).collect();
        check_paths(&paths, materials)?;
        self.check_priors(materials, priors)?;
        let octaves = materials[0].bands();
        let targets = target_t60_s.resampled(octaves);
        let limits_s = air_limits_s(air, octaves);
        let traced_s =
            paths.iter().map(|p| p.max_length_m()).fold(f64::INFINITY, f64::min) / air.speed_of_sound_m_s();
        self.check_t60(target_t60_s, octaves, air, traced_s)?;

        let (histories, unabsorbed) = problem.histories(traces, self.config.bin_s)?;
        let bands = (0..octaves.len())
            .into_par_iter()
            .map(|b| {
                let weighted = histories
                    .iter()
                    .zip(&unabsorbed)
                    .zip(traces)
                    .map(|((history, own), trace)| {
                        Ok((history, history.weights(trace.paths, materials, own, b, trace.share)?))
                    })
                    .collect::<Result<Vec<_>, Error>>()?;
                let line = match self.config.objective {
                    SlopeObjective::DecayCurve => None,
                    SlopeObjective::Paper => Some(SinglePathSlope::through_mean(&weighted)),
                    SlopeObjective::Li2018 => Some(SinglePathSlope::through_first(&weighted)),
                };
                Ok(Band {
                    curve: DecaySlope::new(by_pair(traces, weighted), self.config.range_db),
                    line,
                    target_s: targets.values()[b].value,
                    prior: BandPrior::new(priors, b),
                })
            })
            .collect::<Result<Vec<_>, Error>>()?;

        // Smoothness ties the bands together; else each is a problem of its own.
        let together = if self.config.smoothness > 0.0 { bands.len() } else { 1 };
        let total = bands.len() as u64;
        let done = AtomicU64::new(0);
        report(observer, STAGE, 0, total)?;
        let fitted = bands
            .par_chunks(together)
            .zip(targets.values().par_chunks(together))
            .map(|(bands, targets)| {
                let group = Group::new(bands, &self.config);
                let solution = group.solve()?;
                let relative_error: Vec<f64> = targets.iter().map(|t| t.standard_error / t.value).collect();
                let spread = Spread::new(&group, bands, &solution, &relative_error, self.config.bounds);
                let done = done.fetch_add(bands.len() as u64, Ordering::Relaxed) + bands.len() as u64;
                report(observer, STAGE, done, total)?;
                Ok((solution, spread))
            })
            .collect::<Result<Vec<_>, Error>>()?;

        let found: Vec<FoundBand<'_>> = bands
            .iter()
            .enumerate()
            .map(|(b, band)| {
                let (solution, spread) = &fitted[b / together];
                let place = b % together;
                FoundBand {
                    prior: &band.prior,
                    absorption: &solution.bands[place].absorption,
                    spread,
                    place,
                    unconverged: solution.unconverged,
                }
            })
            .collect();
        let mut fit = MaterialFit::of_bands(materials, &histories, &found, &self.config)?;
        fit.iterations = fitted.iter().map(|(s, _)| s.iterations).sum();
        fit.cost = fitted.iter().map(|(s, _)| s.cost).sum();
        let mut predicted = Vec::new();
        for (b, band) in bands.iter().enumerate() {
            let band_hz = octaves.nominal_hz(b);
            let found = &fitted[b / together].0.bands[b % together];
            let reading = found.t60_s.clone();
            if let Some(reason) = self.unreachable(band, found, limits_s.values()[b]) {
                fit.unreachable.push(Unreachable { band_hz, reason });
            }
            if let Ok(t60_s) = &reading {
                let relative_error = t60_s.standard_error / t60_s.value;
                if relative_error > FEW_PATHS {
                    fit.warnings.push(Warning::FewPaths { band_hz, relative_error });
                }
            }
            // 15 dB below the range, what is missing bends its lower end by 0.14 dB.
            let reached_s = reading.as_ref().map_or(0.0, |r| r.value);
            let advised_s = (15.0 - self.config.range_db.1) / 60.0 * reached_s;
            if traced_s < advised_s {
                fit.warnings.push(Warning::ShortPaths { band_hz, traced_s, advised_s });
            }
            predicted.push(reading);
        }
        fit.predicted_t60_s = PerBand::new(octaves, predicted)?;
        Ok(fit)
    }

    /// Why the target of a band is not met; `None` where it is.
    fn unreachable(&self, band: &Band<'_>, found: &Fitted, limit_s: f64) -> Option<UnreachableReason> {
        let Some(residual) = found.residual.filter(|_| found.t60_s.is_ok()) else {
            return Some(UnreachableReason::NoEnergy);
        };
        if residual.abs() <= self.config.target_tolerance {
            return None;
        }
        let target_s = band.target_s;
        // m = (1 + residual) m': a slope of zero or upwards never comes down.
        let reached_s = if residual > -1.0 { target_s / (1.0 + residual) } else { f64::INFINITY };
        if residual > 0.0 && target_s >= limit_s {
            return Some(UnreachableReason::AirLimit { limit_s, target_s });
        }
        let Fitted { absorption, gradient, .. } = found;
        let greatest = gradient.iter().fold(0.0f64, |w, g| w.max(g.abs()));
        let matters = |k: &usize| gradient[*k].abs() > 1e-3 * greatest;
        let mut free = band.prior.free().filter(matters).peekable();
        if free.peek().is_none() {
            return Some(UnreachableReason::AllHeld { reached_s, target_s });
        }
        let bound = if residual > 0.0 { self.config.bounds.0 } else { self.config.bounds.1 };
        Some(if !free.all(|k| at_bound(absorption[k], bound)) {
            UnreachableReason::NothingCloser { reached_s, target_s }
        } else if residual > 0.0 {
            UnreachableReason::AbsorptionAtLowerBound { reached_s, target_s }
        } else {
            UnreachableReason::AbsorptionAtUpperBound { reached_s, target_s }
        })
    }

    /// Whether there is a prior for each material, in range and in the same bands.
    pub(crate) fn check_priors(
        &self,
        materials: &[Material],
        priors: &[AbsorptionPrior],
    ) -> Result<(), Error> {
        if priors.len() != materials.len() {
            return Err(Error::Count { what: "priors", expected: materials.len(), found: priors.len() });
        }
        let bands = materials[0].bands();
        let (lower, upper) = self.config.bounds;
        for (material, prior) in priors.iter().enumerate() {
            for values in [&prior.mean, &prior.standard_deviation] {
                if values.bands() != bands {
                    let (left, right) = (bands, values.bands());
                    return Err(sabine_acoustics::Error::BandMismatch { left, right }.into());
                }
            }
            for ((band_hz, &mean), &sd) in prior.mean.iter().zip(prior.standard_deviation.values()) {
                let wrong = |field, value, range| Error::Prior { material, band_hz, field, value, range };
                if !(0.0..=1.0).contains(&mean) {
                    return Err(wrong("mean", mean, "between 0 and 1"));
                }
                if !(sd >= 0.0 && sd.is_finite()) {
                    return Err(wrong("standard_deviation", sd, "finite and not negative"));
                }
                if sd == 0.0 && !(lower..=upper).contains(&mean) {
                    return Err(Error::ContradictoryPrior { material, band_hz, mean, lower, upper });
                }
            }
        }
        Ok(())
    }
}

/// T60 between rigid walls, in seconds: the air alone, at the exact centre of the band as the paths are computed.
fn air_limits_s(air: &Air, bands: Bands) -> PerBand<f64> {
    let speed_m_s = air.speed_of_sound_m_s();
    air.energy_exponent_per_m(bands).map(|m| 60.0 / (crate::decay::DB_PER_NEPER * m * speed_m_s))
}

fn check_targets(target_t60_s: &PerBand<Estimate>) -> Result<(), Error> {
    let (low_s, high_s) = TARGET_RANGE_S;
    for (band_hz, target) in target_t60_s.iter() {
        if !(low_s..=high_s).contains(&target.value) {
            return Err(Error::Target { band_hz, value_s: target.value, low_s, high_s });
        }
        if !(target.standard_error >= 0.0 && target.standard_error.is_finite()) {
            return Err(Error::TargetError { band_hz, value_s: target.standard_error });
        }
    }
    Ok(())
}
