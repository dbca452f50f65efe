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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AbsorptionPrior;
    use sabine_acoustics::Bands;

    /// A fit of one material in two octaves, of which some have not converged.
    fn assembled(unconverged: [Option<Unconverged>; 2]) -> Result<MaterialFit, Error> {
        let octaves = Bands::octaves(500.0, 1000.0).unwrap();
        let priors = [AbsorptionPrior::uniform(octaves, 0.2, 0.1)];
        let of_band: Vec<BandPrior> = (0..2).map(|b| BandPrior::new(&priors, b)).collect();
        // What the curvature at an arbitrary point would give.
        let spread = Spread {
            standard_error: vec![vec![0.01]; 2],
            remaining: vec![vec![0.01]; 2],
            shows: vec![vec![true]; 2],
            data: vec![true; 2],
        };
        let found: Vec<FoundBand<'_>> = (0..2)
            .map(|place| FoundBand {
                prior: &of_band[place],
                absorption: &[0.2],
                spread: &spread,
                place,
                unconverged: unconverged[place],
            })
            .collect();
        let material = Material::uniform(octaves, 0.2, 0.1).unwrap();
        MaterialFit::of_bands(&[material], &[], &found, &FitConfig::default())
    }

    #[test]
    fn a_band_that_has_not_converged_is_no_result() {
        let fit = assembled([None, Some(Unconverged::NoDescent)]).unwrap();
        assert_eq!(fit.unconverged_hz(), [1000.0]);
        assert!(fit.warnings[0].to_string().contains("not converged"), "{}", fit.warnings[0]);
        // What was not fitted is known no better than before.
        assert_eq!(fit.absorption_standard_error[0].values(), [0.01, 0.1]);
    }

    #[test]
    fn a_fit_that_has_converged_nowhere_is_an_error() {
        let moving = Unconverged::StillMoving { deviations: 0.4 };
        let refused = assembled([Some(moving), Some(Unconverged::NoDescent)]);
        assert!(
            matches!(refused, Err(Error::NotConverged { bands: 2, reason }) if reason == moving),
            "{refused:?}"
        );
    }
}
