//! The answer, put together from its bands.

use crate::fit::{AtBound, MaterialFit, Unconverged, Warning};
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
    /// Why there is no answer, where there is none.
    pub unconverged: Option<Unconverged>,
}

impl FoundBand<'_> {
    /// Standard error of a material; what is no answer is known no better than beforehand.
    fn standard_error(&self, material: usize) -> f64 {
        let error = self.spread.standard_error[self.place][material];
        if self.unconverged.is_some() { error.max(self.prior.standard_deviation[material]) } else { error }
    }
}

impl MaterialFit {
    /// Materials, their standard errors, bounds, open questions and far priors of all bands; reverberation times are left to
    /// whoever reads them.
    ///
    /// # Errors
    /// [`Error::NotConverged`] if no band has an answer.
    pub(crate) fn of_bands(
        materials: &[Material],
        histories: &[History],
        found: &[FoundBand<'_>],
        config: &FitConfig,
    ) -> Result<Self, Error> {
        let octaves = materials[0].bands();
        let with_data: Vec<&FoundBand<'_>> = found.iter().filter(|f| f.spread.data[f.place]).collect();
        let failed = with_data.iter().filter_map(|f| f.unconverged);
        if let Some(reason) = failed.clone().next().filter(|_| failed.count() == with_data.len()) {
            return Err(Error::NotConverged { bands: with_data.len(), reason });
        }
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
            if let Some(reason) = found.unconverged {
                fit.warnings.push(Warning::NotConverged { band_hz, reason });
            }
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
            let error = |b: usize| found[b].standard_error(k);
            fit.absorption_standard_error.push(PerBand::from_fn(octaves, error));
        }
        Ok(fit)
    }
}
