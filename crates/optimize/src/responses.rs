//! Fits the absorption of materials to measured responses.

use crate::bounded::minimise;
use crate::fit::{AtBound, Warning};
use crate::fitter::{FAR_FROM_PRIOR, Trace};
use crate::history::History;
use crate::measured_decay::MeasuredDecay;
use crate::objective::check_paths;
use crate::prediction::t60_of_traces;
use crate::response_band::{BandFit, Likelihood, ResponseBand, Solved};
use crate::{AbsorptionPrior, Error, FitConfig, MaterialFit, MaterialFitter};
use rayon::prelude::*;
use sabine_acoustics::{
    Air, Levels, Material, Measurement, NoReading, Observer, PathSet, PerBand, TimeZero, report,
};

/// A measured response and the paths between its source and its receiver.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredPair<'a> {
    /// What was measured.
    pub measured: &'a MeasuredDecay,
    /// The paths.
    pub paths: &'a PathSet,
}

/// Materials fitted to measured responses.
#[derive(Clone, Debug)]
pub struct ResponseFit {
    /// The materials and what must be said about them; no target is unreachable here, for there are none.
    pub fit: MaterialFit,
    /// Gain of each response in each band, in dB: measured energy over that of the paths (1 at 1 m). `None` where the response
    /// cannot be read.
    pub gain_db: Vec<PerBand<Option<f64>>>,
    /// How much farther the measured energies lie from the fitted ones than chance puts them, as a variance ratio (1 =
    /// the model explains them); standard errors are widened accordingly. `None` in a band without data.
    pub dispersion: PerBand<Option<f64>>,
    /// Responses that were left out of a band, and why: index of the response, nominal centre in Hz, reason.
    pub left_out: Vec<(usize, f64, NoReading)>,
}

/// Name of this work to an observer.
const STAGE: &str = "fit to responses";
/// Expansions of the paths before the fit takes what it has.
const PASSES: usize = 12;
/// Change of any material, in standard deviations of its prior, below which it has settled.
const SETTLED: f64 = 0.02;

impl MaterialFitter {
    /// Fits to the energy decays of measured responses, all bands and responses at once.
    ///
    /// In every time bin the measured energy is Gamma distributed about gain times the energy of the paths, with as many
    /// independent values as bandwidth times duration, fewer where noise was taken away and where the paths are few. Gains
    /// are free or shared as [`Measurement::levels`] says; with an unknown gain each octave has its own, for a loudspeaker's response is
    /// not flat. Time zero is the emission, or what puts the onset on the shortest path ([`Measurement::time_zero`]). The direct sound itself (5 ms,
    /// more in low octaves) is left out: it depends on the source's directivity.
    ///
    /// Of the settings it uses bin width, bounds, smoothness and the number of iterations.
    ///
    /// # Errors
    /// For responses, paths, materials or priors that do not match or are out of range, [`Error::NoDecay`] if nothing can be read,
    /// and [`sabine_acoustics::Error::Cancelled`] if the observer asks to stop.
    pub fn fit_responses(
        &self,
        pairs: &[MeasuredPair<'_>],
        measurement: Measurement,
        materials: &[Material],
        priors: &[AbsorptionPrior],
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<ResponseFit, Error> {
        let paths: Vec<&PathSet> = pairs.iter().map(|p| p.paths).collect();
        check_paths(&paths, materials)?;
        self.check_priors(materials, priors)?;
        let octaves = materials[0].bands();
        if let Some(other) = pairs.iter().map(|p| p.measured.bands()).find(|b| *b != octaves) {
            return Err(sabine_acoustics::Error::BandMismatch { left: octaves, right: other }.into());
        }
        let config = self.config();
        let histories: Vec<History> = paths.par_iter().map(|p| History::new(p, air, config.bin_s)).collect();
        let latencies_s = latencies_s(pairs, &histories, measurement.time_zero);
        let exponents = air.energy_exponent_per_m(octaves);
        let mut left_out = Vec::new();
        let bands = (0..octaves.len())
            .map(|b| {
                let mut band = ResponseBand::new(priors, b, measurement.levels);
                for (i, pair) in pairs.iter().enumerate() {
                    match pair.measured.band(b) {
                        Ok(decay) => {
                            let exponent = exponents.values()[b];
                            let weights = histories[i].weights(pair.paths, materials, exponent, b, 1.0)?;
                            if !band.add(i, &histories[i], weights, decay, latencies_s[i]) {
                                let needed_s = decay.edges_s[1] - latencies_s[i];
                                let available_s = histories[i].bins() as f64 * config.bin_s;
                                let reason = NoReading::TooShort { needed_s, available_s };
                                left_out.push((i, octaves.nominal_hz(b), reason));
                            }
                        }
                        Err(reason) => left_out.push((i, octaves.nominal_hz(b), reason.clone())),
                    }
                }
                Ok(band)
            })
            .collect::<Result<Vec<_>, Error>>()?;
        if bands.iter().all(ResponseBand::is_empty) {
            return Err(Error::NoDecay { responses: pairs.len(), bands: octaves.len() });
        }

        let together = if config.smoothness > 0.0 { bands.len() } else { 1 };
        report(observer, STAGE, 0, 1)?;
        let groups: Vec<Vec<Solved>> =
            bands.par_chunks(together).map(|bands| solve(bands, config)).collect::<Result<_, Error>>()?;
        report(observer, STAGE, 1, 1)?;
        let solved: Vec<Solved> = groups.into_iter().flatten().collect();

        let hits: Vec<u64> =
            (0..materials.len()).map(|k| histories.iter().map(|h| h.hits[k]).sum()).collect();
        let mut fit = MaterialFit {
            materials: Vec::new(),
            absorption_standard_error: Vec::new(),
            predicted_t60_s: PerBand::from_fn(octaves, |_| Err(NoReading::NoDecay)),
            unreachable: Vec::new(),
            at_bounds: Vec::new(),
            not_determined: Vec::new(),
            warnings: Vec::new(),
            iterations: solved.iter().map(|s| s.iterations).sum(),
            cost: solved.iter().map(|s| s.prior_cost).sum(),
        };
        for (b, (band, solved)) in bands.iter().zip(&solved).enumerate() {
            let band_hz = octaves.nominal_hz(b);
            let bounded = AtBound::find(&band.standard_deviation, &solved.absorption, band_hz, config.bounds);
            solved.spread.name_open(
                0,
                &band.standard_deviation,
                band_hz,
                &hits,
                &bounded,
                &mut fit.not_determined,
            );
            fit.at_bounds.extend(bounded);
            for (k, a) in solved.absorption.iter().enumerate() {
                let deviations = (a - band.mean[k]) / band.standard_deviation[k];
                if deviations.is_finite() && deviations.abs() > FAR_FROM_PRIOR {
                    fit.warnings.push(Warning::FarFromPrior { material: k, band_hz, deviations });
                }
            }
        }
        for (k, material) in materials.iter().enumerate() {
            let absorption = PerBand::from_fn(octaves, |b| solved[b].absorption[k]);
            fit.materials.push(material.with_absorption(absorption)?);
            let error = |b: usize| solved[b].spread.standard_error[0][k];
            fit.absorption_standard_error.push(PerBand::from_fn(octaves, error));
        }
        let traces: Vec<Trace<'_>> =
            paths.iter().enumerate().map(|(pair, paths)| Trace { pair, paths, share: 1.0 }).collect();
        fit.predicted_t60_s = t60_of_traces(&traces, &fit.materials, air, config.bin_s, config.range_db)?;
        let gain_db = (0..pairs.len())
            .map(|i| PerBand::from_fn(octaves, |b| solved[b].gains_db.iter().find(|g| g.0 == i).map(|g| g.1)))
            .collect();
        let dispersion = PerBand::from_fn(octaves, |b| solved[b].dispersion);
        Ok(ResponseFit { fit, gain_db, dispersion, left_out })
    }
}

/// Seconds from the first sample of each response to the emission.
pub(crate) fn latencies_s(
    pairs: &[MeasuredPair<'_>],
    histories: &[History],
    time_zero: TimeZero,
) -> Vec<f64> {
    let shortest_s = |h: &History| h.times_s.iter().fold(f64::INFINITY, |first, t| first.min(*t));
    let own: Vec<f64> =
        pairs.iter().zip(histories).map(|(p, h)| p.measured.onset_s() - shortest_s(h)).collect();
    match time_zero {
        TimeZero::Emission => vec![0.0; pairs.len()],
        TimeZero::PerResponse => own,
        // One latency for all: the median does not mind an onset that was missed.
        _ => {
            let mut sorted = own.clone();
            sorted.sort_by(f64::total_cmp);
            vec![sorted[sorted.len() / 2]; pairs.len()]
        }
    }
}

/// Minimises the bands' cost, expanding the paths about the present materials until these settle.
fn solve(bands: &[ResponseBand<'_>], config: &FitConfig) -> Result<Vec<Solved>, Error> {
    let mut absorption: Vec<Vec<f64>> = bands.iter().map(|b| b.start(config.bounds)).collect();
    let mut dispersion = vec![1.0; bands.len()];
    let mut iterations = 0;
    let mut fits = Vec::new();
    for pass in 0..PASSES {
        fits = bands.iter().zip(&absorption).map(|(band, a)| BandFit::about(band, a)).collect();
        let likelihood = Likelihood::new(&fits, &dispersion, config);
        let start = likelihood.variables(&absorption);
        let (lower, upper) = likelihood.bounds();
        let minimum = minimise(&likelihood, &start, &lower, &upper, config.max_iterations)?;
        iterations += minimum.iterations;
        let next = likelihood.absorption(&minimum.x);
        let mut moved = 0.0f64;
        for ((band, old), new) in bands.iter().zip(&mut absorption).zip(next) {
            for (k, new) in new.into_iter().enumerate() {
                if band.standard_deviation[k] > 0.0 {
                    moved = moved.max((new - old[k]).abs() / band.standard_deviation[k]);
                    old[k] = new;
                }
            }
        }
        dispersion = fits.iter().zip(&absorption).map(|(fit, a)| fit.dispersion(a)).collect();
        if moved < SETTLED && pass > 0 {
            break;
        }
    }
    let solved = fits.iter().zip(&absorption).zip(&dispersion);
    Ok(solved.map(|((fit, a), d)| fit.solved(a, *d, config, iterations)).collect())
}

/// Whether each response, all of a band or none has a gain of its own.
pub(crate) fn gain_group(levels: Levels, response: usize) -> Option<usize> {
    match levels {
        Levels::Absolute => None,
        Levels::Common => Some(0),
        _ => Some(response),
    }
}
