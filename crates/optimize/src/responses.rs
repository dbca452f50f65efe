//! Fits the absorption of materials to measured responses.

use crate::assembly::FoundBand;
use crate::fit::Warning;
use crate::fit_problem::FitProblem;
use crate::history::{History, Trace, Unabsorbed, check_paths};
use crate::measured_decay::MeasuredDecay;
use crate::prediction::t60_of_traces;
use crate::response_band::ResponseBand;
use crate::response_leaks::solve_with_leaks;
use crate::response_solver::Solved;
use crate::tables::{TableFit, check_tables};
use crate::{Error, FitConfig, MaterialFit, MaterialFitter, MeasuredTable};
use sabine_acoustics::{Material, NoReading, Observer, PerBand, report};
use sabine_paths::PathSet;
use sabine_scene::{Measurement, TimeZero};

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
    /// Gain of each response in each band, in dB: measured energy over that of the paths (1 at 1 m), leaks of neighbouring bands taken off. `None` where the response
    /// cannot be read.
    pub gain_db: Vec<PerBand<Option<f64>>>,
    /// How much farther the measured energies lie from the fitted ones than chance puts them, as a variance ratio (1 =
    /// the model explains them); standard errors are widened accordingly. `None` in a band without data.
    pub dispersion: PerBand<Option<f64>>,
    /// Responses that were left out of a band, and why: index of the response, nominal centre in Hz, reason.
    pub left_out: Vec<(usize, f64, NoReading)>,
}

/// [`ResponseFit::left_out`].
type LeftOut = Vec<(usize, f64, NoReading)>;

/// Name of this work to an observer.
const STAGE: &str = "fit to responses";

impl MaterialFitter {
    /// Fits to the energy decays of measured responses, all bands and responses at once.
    ///
    /// In every time bin the measured energy is taken for Gamma distributed about gain times the energy of the paths that the filter
    /// lets fall into it. Its variance is that of arrivals which interfere at random: of the exact paths one by one, each known to
    /// [`FitConfig::reflection_error`](crate::FitConfig::reflection_error), of the sampled ones as a diffuse field; with what noise and few rays add. Gains
    /// are free or shared as [`Measurement::levels`] says; with an unknown gain each octave has its own, for a loudspeaker's response is
    /// not flat. The filters pass some per cent of the neighbouring octaves; what leaks in so is predicted from what is found there, in as
    /// many rounds as it takes ([`FilterBank::shares`](sabine_acoustics::FilterBank::shares)). Time zero is the emission, or what puts the onset on the shortest path ([`Measurement::time_zero`]). The direct sound itself (5 ms,
    /// more in low octaves) is left out: it depends on the source's directivity.
    ///
    /// Of the settings it uses bin width, bounds, smoothness, the errors of reflections and of their arrival and the number of iterations. It runs
    /// until the materials converge, and says where they do not ([`Warning::NotConverged`](crate::Warning::NotConverged)).
    ///
    /// # Errors
    /// For responses, paths, materials or priors that do not match or are out of range, [`Error::NoDecay`] if nothing can be read,
    /// [`Error::NotConverged`] if the fit converges in none of the bands, and [`sabine_acoustics::Error::Cancelled`] if the observer asks to stop.
    pub fn fit_responses(
        &self,
        pairs: &[MeasuredPair<'_>],
        measurement: Measurement,
        problem: &FitProblem<'_>,
        observer: &dyn Observer,
    ) -> Result<ResponseFit, Error> {
        Ok(self.fit_measured((pairs, measurement), &[], problem, observer)?.of_responses)
    }

    /// Fits to the energy decays of responses, as [`fit_responses`](Self::fit_responses) does, and to the parameters of other pairs, as
    /// [`fit_tables`](Self::fit_tables) does. A pair that has both should be given once: its parameters are read from its response.
    ///
    /// Conditions of the problem are those of the responses' pairs, followed by those of the tables'.
    ///
    /// # Errors
    /// As either.
    pub fn fit_measured(
        &self,
        (pairs, measurement): (&[MeasuredPair<'_>], Measurement),
        tables: &[MeasuredTable<'_>],
        problem: &FitProblem<'_>,
        observer: &dyn Observer,
    ) -> Result<TableFit, Error> {
        let FitProblem { materials, priors, .. } = *problem;
        let paths: Vec<&PathSet> =
            pairs.iter().map(|p| p.paths).chain(tables.iter().map(|t| t.paths)).collect();
        check_paths(&paths, materials)?;
        self.check_priors(materials, priors)?;
        check_tables(tables)?;
        let octaves = materials[0].bands();
        if let Some(other) = pairs.iter().map(|p| p.measured.bands()).find(|b| *b != octaves) {
            return Err(sabine_acoustics::Error::BandMismatch { left: octaves, right: other }.into());
        }
        let config = self.config();
        let traces: Vec<Trace<'_>> =
            paths.iter().enumerate().map(|(pair, paths)| Trace { pair, paths, share: 1.0 }).collect();
        let (histories, unabsorbed) = problem.histories_since(&traces, config.bin_s, pairs.len())?;
        let (of_pairs, of_tables) = histories.split_at(pairs.len());
        let (mut bands, left_out) =
            self.read_bands(pairs, (of_pairs, &unabsorbed[..pairs.len()]), measurement, problem)?;
        let values_left_out =
            self.read_tables(&mut bands, tables, (of_tables, &unabsorbed[pairs.len()..]), problem)?;
        if bands.iter().all(ResponseBand::is_empty) {
            return Err(Error::NoDecay { responses: paths.len(), bands: octaves.len() });
        }

        let together = if config.smoothness > 0.0 { bands.len() } else { 1 };
        report(observer, STAGE, 0, 1)?;
        let solved = solve_with_leaks(&mut bands, together, config)?;
        report(observer, STAGE, 1, 1)?;

        let mut fit = material_fit(materials, &histories, (&bands, &solved), config)?;
        let fitted = FitProblem { materials: &fit.materials, ..*problem };
        fit.predicted_t60_s = t60_of_traces(&traces, &fitted, config.bin_s, config.range_db)?;
        let group = |b: usize| (&solved[b / together], b % together);
        let gain_db = (0..pairs.len())
            .map(|i| {
                PerBand::from_fn(octaves, |b| {
                    let (group, place) = group(b);
                    group.gains_db[place].iter().find(|g| g.0 == i).map(|g| g.1)
                })
            })
            .collect();
        let dispersion = PerBand::from_fn(octaves, |b| group(b).0.dispersion[group(b).1]);
        Ok(TableFit {
            of_responses: ResponseFit { fit, gain_db, dispersion, left_out },
            dispersion: PerBand::from_fn(octaves, |b| group(b).0.table_dispersion[group(b).1]),
            left_out: values_left_out,
        })
    }

    /// What each band holds of each response, and what is left out of it.
    fn read_bands<'h>(
        &self,
        pairs: &[MeasuredPair<'_>],
        (histories, unabsorbed): (&'h [History], &[Unabsorbed]),
        measurement: Measurement,
        problem: &FitProblem<'_>,
    ) -> Result<(Vec<ResponseBand<'h>>, LeftOut), Error> {
        let FitProblem { materials, priors, .. } = *problem;
        let (octaves, config) = (materials[0].bands(), self.config());
        let latencies_s = latencies_s(pairs, histories, measurement.time_zero);
        let mut left_out = Vec::new();
        let mut bands = Vec::with_capacity(octaves.len());
        for (b, band_hz) in octaves.iter_hz().enumerate() {
            let mut band = ResponseBand::new(priors, b, measurement.levels);
            for (i, (pair, history)) in pairs.iter().zip(histories).enumerate() {
                let weights = history.weights(pair.paths, materials, &unabsorbed[i], b, 1.0)?;
                match pair.measured.band(b) {
                    Ok(decay) => {
                        let arrival_error_s = config.arrival_error_s;
                        if !band.add(i, history, weights, decay, latencies_s[i], arrival_error_s) {
                            let needed_s = decay.edges_s[1] - latencies_s[i];
                            let available_s = history.bins() as f64 * config.bin_s;
                            left_out.push((i, band_hz, NoReading::TooShort { needed_s, available_s }));
                        }
                    }
                    Err(reason) => {
                        band.add_unread(i, history, weights);
                        left_out.push((i, band_hz, reason.clone()));
                    }
                }
            }
            bands.push(band);
        }
        Ok((bands, left_out))
    }
}

/// The materials of bands that were solved in groups, and what must be said of them.
fn material_fit(
    materials: &[Material],
    histories: &[History],
    (bands, solved): (&[ResponseBand<'_>], &[Solved]),
    config: &FitConfig,
) -> Result<MaterialFit, Error> {
    let together = bands.len() / solved.len();
    let group = |b: usize| (&solved[b / together], b % together);
    let found: Vec<FoundBand<'_>> = bands
        .iter()
        .enumerate()
        .map(|(b, band)| {
            let (group, place) = group(b);
            let (prior, absorption, spread) = (&band.prior, &group.absorption[place][..], &group.spread);
            // A band without data keeps its priors, and says so.
            let unconverged = group.unconverged.filter(|_| !band.is_empty());
            FoundBand { prior, absorption, spread, place, unconverged }
        })
        .collect();
    let mut fit = MaterialFit::of_bands(materials, histories, &found, config)?;
    fit.iterations = solved.iter().map(|s| s.iterations).sum();
    fit.cost = solved.iter().map(|s| s.prior_cost).sum();
    for (b, band_hz) in materials[0].bands().iter_hz().enumerate() {
        if group(b).0.confined[group(b).1] {
            fit.warnings.push(Warning::LateDecayLeftOut { band_hz });
        }
    }
    Ok(fit)
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
