//! Harmonics of an exponential sweep before the direct sound: copies of each response's own decay, all earlier by the same times, in the
//! ratio of the logarithms of 2 and 3, over steady noise.

use crate::effect::{AuxiliaryEvidence, Parameter};
use crate::error::Error;
use crate::found_parameter::FoundParameter;
use crate::likelihood::laplace::{LaplaceFit, Model, Prior, Slopes, maximise};
use crate::observe::pre_arrival::{PreArrival, PreArrivalBand};
use crate::statistics::log_density;

/// The second and the third harmonic of an exponential sweep come earlier by the logarithms of 2 and 3.
const THIRD_TO_SECOND: f64 = 1.584_962_500_721_156;
/// Step of the times at which the fit starts, in seconds.
const START_STEP_S: f64 = 5e-3;
/// Level at which harmonics start, in dB.
const START_DB: f64 = -38.0;
/// Starts that are followed to their top.
const MAX_STARTS: usize = 3;
/// What an octave's harmonics may be off the straight line over octaves, in dB.
const OCTAVE_SD_DB: f64 = 1.5;
/// Spread of the logarithm of a noise floor about what a quiet quarter of its bins has.
const FLOOR_SD: f64 = 3.0;
const LN_PER_DB: f64 = std::f64::consts::LN_10 / 10.0;
/// The time from a copy to the direct sound is known no better than this, whatever the bins say: both are as wide as a loudspeaker's pulse.
const LEAD_SD_S: f64 = 2e-4;
/// Step of differences over time, in seconds.
const STEP_S: f64 = 5e-4;
const HALF_90: f64 = 1.645;

/// Time by which the second harmonic leads (s), and level of both harmonics at 1 kHz (dB) with a slope (dB per octave).
pub(super) fn parameters() -> Vec<Parameter> {
    let level = |name: &str| Parameter::new(name, "dB", -60.0, 15.0, (-90.0, 0.0)).typically(-35.0);
    let slope = |name: &str| Parameter::new(name, "dB", 0.0, 2.0, (-10.0, 10.0));
    vec![
        Parameter::new("second_harmonic_lead", "s", 0.5, 0.4, (0.1, 5.0)),
        level("second_harmonic_1_khz"),
        slope("second_harmonic_per_octave"),
        level("third_harmonic_1_khz"),
        slope("third_harmonic_per_octave"),
    ]
}

/// Evidence for harmonics in the responses that count (a flag for each), and their parameters; none where nothing precedes the direct
/// sounds for long enough.
pub(super) fn fit(responses: &PreArrival, used: &[bool]) -> Result<Option<AuxiliaryEvidence>, Error> {
    let cells: Vec<&PreArrivalBand> = responses
        .responses
        .iter()
        .zip(used)
        .filter(|(_, used)| **used)
        .flat_map(|(bands, _)| bands)
        .collect();
    if cells.is_empty() {
        return Ok(None);
    }
    let quiet: Vec<f64> = cells.iter().map(|c| c.quiet().ln()).collect();
    let without = HarmonicModel::new(&cells, &quiet, &[]);
    let base = maximise(&without, &quiet, "lead-ins")?;
    let parameters = parameters();
    let model = HarmonicModel::new(&cells, &quiet, &parameters);
    let longest_s = cells.iter().map(|c| c.length_s()).fold(0.0, f64::max);
    let start = |lead_s: f64| {
        let mut x = quiet.clone();
        x.extend([lead_s, START_DB, 0.0, START_DB, 0.0]);
        x.resize(model.priors.len(), 0.0);
        x
    };
    let mut starts: Vec<(f64, f64)> = (1..(longest_s / START_STEP_S) as usize)
        .map(|k| START_STEP_S * k as f64)
        .filter(|lead_s| *lead_s > parameters[0].bounds.0)
        .map(|lead_s| (model.log_likelihood(&start(lead_s), None), lead_s))
        .collect();
    starts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best: Option<LaplaceFit> = None;
    for &(_, lead_s) in starts.iter().take(MAX_STARTS) {
        let found = maximise(&model, &start(lead_s), "lead-ins")?;
        if best.as_ref().is_none_or(|b| found.log_evidence > b.log_evidence) {
            best = Some(found);
        }
    }
    let Some(best) = best else { return Ok(None) };
    let found = parameters.iter().enumerate().map(|(i, p)| {
        let (value, fitted_sd) = (best.values[cells.len() + i], best.sd(cells.len() + i));
        let sd = if i == 0 { fitted_sd.hypot(LEAD_SD_S) } else { fitted_sd };
        FoundParameter {
            name: p.name.clone(),
            value,
            low: (value - HALF_90 * sd).max(p.bounds.0),
            high: (value + HALF_90 * sd).min(p.bounds.1),
            unit: p.unit.to_string(),
        }
    });
    Ok(Some(AuxiliaryEvidence { nats: best.log_evidence - base.log_evidence, parameters: found.collect() }))
}

/// Steady noise in each band of each response (logarithm of the energy of a bin) and, if there are parameters for them, harmonics: their
/// parameters, and what each octave is off the line that these describe, the second harmonic's octaves first (dB).
struct HarmonicModel<'a> {
    cells: &'a [&'a PreArrivalBand],
    priors: Vec<Prior>,
    harmonics: bool,
    /// Octaves from 1 kHz of the bands that there are.
    octaves: Vec<f64>,
}

impl<'a> HarmonicModel<'a> {
    fn new(cells: &'a [&'a PreArrivalBand], quiet: &[f64], parameters: &[Parameter]) -> Self {
        let mut priors: Vec<Prior> = quiet.iter().map(|q| Prior::normal(*q, FLOOR_SD)).collect();
        priors.extend(parameters.iter().map(Prior::of));
        let mut octaves: Vec<f64> = cells.iter().map(|c| c.octaves_from_1khz).collect();
        octaves.sort_by(f64::total_cmp);
        octaves.dedup();
        let harmonics = !parameters.is_empty();
        if harmonics {
            priors.extend(vec![Prior::normal(0.0, OCTAVE_SD_DB); 2 * octaves.len()]);
        }
        Self { cells, priors, harmonics, octaves }
    }
}

impl Model for HarmonicModel<'_> {
    fn priors(&self) -> &[Prior] {
        &self.priors
    }

    fn log_likelihood(&self, values: &[f64], mut slopes: Option<&mut Slopes>) -> f64 {
        let own = self.cells.len();
        let mut sum = 0.0;
        for (c, cell) in self.cells.iter().enumerate() {
            let noise = values[c].exp();
            for (bin, &measured) in cell.energies.iter().enumerate() {
                let mut predicted = noise;
                // Of the logarithm of the prediction, times the prediction.
                let mut rows = vec![(c, noise)];
                if self.harmonics {
                    let lead_s = values[own];
                    let mut along_lead = 0.0;
                    let octave = self.octaves.iter().position(|o| *o == cell.octaves_from_1khz).unwrap_or(0);
                    for (harmonic, ratio) in [1.0, THIRD_TO_SECOND].into_iter().enumerate() {
                        let first = own + 1 + 2 * harmonic;
                        let off = own + 5 + harmonic * self.octaves.len() + octave;
                        let line_db = values[first] + values[first + 1] * cell.octaves_from_1khz;
                        let level_db = line_db + values[off];
                        let share = (level_db * LN_PER_DB).exp();
                        let energy = share * cell.earlier(bin, ratio * lead_s);
                        predicted += energy;
                        if slopes.is_some() {
                            let moved = cell.earlier(bin, ratio * lead_s + STEP_S)
                                - cell.earlier(bin, ratio * lead_s - STEP_S);
                            along_lead += share * ratio * moved / (2.0 * STEP_S);
                            rows.push((first, energy * LN_PER_DB));
                            rows.push((off, energy * LN_PER_DB));
                            rows.push((first + 1, energy * LN_PER_DB * cell.octaves_from_1khz));
                        }
                    }
                    rows.push((own, along_lead));
                }
                let silence = cell.silence();
                let ln_ratio = (measured.max(silence) / predicted.max(silence)).ln();
                sum += cell.shape * log_density(ln_ratio);
                let Some(slopes) = slopes.as_deref_mut() else { continue };
                let pull = cell.shape * (ln_ratio.exp() - 1.0);
                for &(a, row) in &rows {
                    slopes.gradient[a] += pull * row / predicted;
                    for &(b, other) in &rows {
                        slopes.information[(a, b)] += cell.shape * row * other / (predicted * predicted);
                    }
                }
            }
        }
        sum
    }
}
