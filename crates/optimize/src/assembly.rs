//! The answer, put together from its bands.

use crate::fit::{AtBound, MaterialFit, Warning};
use crate::history::History;
use crate::uncertainty::Spread;
use crate::unknowns::BandPrior;
use crate::{Error, FitConfig};
use sabine_acoustics::{Material, NoReading, PerBand};

/// Deviation from a prior that is worth a warning, in standard deviations.
const FAR_FROM_PRIOR: f64 = 3.0;

/// What was found in one band.
pub(crate) struct FoundBand<'s> {
    pub prior: &'s BandPrior,
    pub absorption: &'s [f64],
    /// Of the group of bands that it was solved with.
    pub spread: &'s Spread,
    /// Its place in that group.
    pub place: usize,
}

impl MaterialFit {
    /// Materials, their standard errors, bounds, open questions and far priors of all bands; reverberation times are left to
    /// whoever reads them.
    pub(crate) fn of_bands(
        materials: &[Material],
        histories: &[History],
        found: &[FoundBand<'_>],
        config: &FitConfig,
    ) -> Result<Self, Error> {
        let octaves = materials[0].bands();
        let hits: Vec<u64> =
            (0..materials.len()).map(|k| histories.iter().map(|h| h.hits[k]).sum()).collect();
        let mut fit = Self {
            materials: Vec::new(),
            absorption_standard_error: Vec::new(),
            predicted_t60_s: PerBand::from_fn(octaves, |_| Err(NoReading::NoDecay)),
            unreachable: Vec::new(),
            at_bounds: Vec::new(),
            not_determined: Vec::new(),
            warnings: Vec::new(),
            iterations: 0,
            cost: 0.0,
        };
        for (band_hz, found) in octaves.iter_hz().zip(found) {
            let prior = found.prior;
            let bounded = AtBound::find(&prior.standard_deviation, found.absorption, band_hz, config.bounds);
            let open = &mut fit.not_determined;
            found.spread.name_open(found.place, &prior.standard_deviation, band_hz, &hits, &bounded, open);
            fit.at_bounds.extend(bounded);
            for material in prior.free() {
                let deviations = prior.deviation(material, found.absorption[material]);
                if deviations.abs() > FAR_FROM_PRIOR {
                    fit.warnings.push(Warning::FarFromPrior { material, band_hz, deviations });
                }
            }
        }
        for (k, material) in materials.iter().enumerate() {
            let absorption = PerBand::from_fn(octaves, |b| found[b].absorption[k]);
            fit.materials.push(material.with_absorption(absorption)?);
            let error = |b: usize| found[b].spread.standard_error[found[b].place][k];
            fit.absorption_standard_error.push(PerBand::from_fn(octaves, error));
        }
        Ok(fit)
    }
}
