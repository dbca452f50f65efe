//! What responses hold before their direct sound, and how probable that is with harmonics of a sweep in it.

use crate::effect::{OwnEvidence, Parameter};
use crate::energy_model::log_density;
use crate::gauss_newton::{Maximum, Model, Prior, Slopes, maximise};
use crate::{Error, FoundParameter, Survey};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Shortest bin, in seconds.
const BIN_S: f64 = 0.02;
/// Length of a bin in units of one over the bandwidth.
const BANDWIDTH_TIMES: f64 = 2.0;
/// The filters' ringing before the direct sound, in units of one over the bandwidth: nothing is compared so late.
const RINGING_BANDWIDTH_TIMES: f64 = 6.0;
/// Nor within so long before it, in seconds: steep filters of converters and of whoever prepared the recording ring, too.
const GUARD_S: f64 = 0.06;
/// Bins that a band of a response must have before its direct sound to count.
const LEAST_BINS: usize = 4;
/// A copy of a decay is never predicted better, as a share of its energy.
const MODEL_SD: f64 = 0.15;
/// A bin with less than this share of the energy of the whole decay counts as having so much: nobody minds harmonics at -65 dB, and
/// filters without phase shift that a recording has been through leave as much long before the direct sound.
const SILENCE: f64 = 3e-7;
/// The second and the third harmonic of an exponential sweep come earlier by the logarithms of 2 and 3.
const THIRD_TO_SECOND: f64 = 1.584_962_500_721_156;
/// Step of the times at which the fit starts, in seconds.
const START_STEP_S: f64 = 5e-3;
/// Level at which harmonics start, in dB.
const START_DB: f64 = -38.0;
/// Starts that are followed to their top.
const MOST_STARTS: usize = 3;
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

/// One band of one response: energy before the direct sound, and the decay after it.
#[derive(Clone, Debug)]
pub(crate) struct LeadInBand {
    octaves_from_1khz: f64,
    /// Energy of each bin, the last before the direct sound first.
    energies: Vec<f64>,
    /// Where the first of them ends, in seconds before the direct sound, and how long they are.
    end_s: f64,
    bin_s: f64,
    /// Degrees of freedom of the energy of a bin, halved.
    shape: f64,
    /// Energy between the end of the lead-in and each sample after it.
    after: Vec<f64>,
    rate_hz: f64,
}

impl LeadInBand {
    /// None where too little comes before the direct sound. `samples` are those of the band, `direct` the direct sound's place among them.
    pub fn new(
        samples: &[f32],
        direct: f64,
        rate_hz: f64,
        bandwidth_hz: f64,
        octaves_from_1khz: f64,
    ) -> Option<Self> {
        let bin_s = BIN_S.max(BANDWIDTH_TIMES / bandwidth_hz);
        let end_s = GUARD_S.max(RINGING_BANDWIDTH_TIMES / bandwidth_hz);
        let count = ((direct / rate_hz - end_s) / bin_s).floor();
        if count < LEAST_BINS as f64 {
            return None;
        }
        let first = (direct - end_s * rate_hz).round() as usize;
        let square = |x: &f32| f64::from(*x).powi(2);
        let length = (bin_s * rate_hz) as usize;
        let energies = (1..=count as usize)
            .map(|k| samples.get(first.checked_sub(k * length)?..first - (k - 1) * length))
            .map(|bin| bin.map(|bin| bin.iter().map(square).sum()))
            .collect::<Option<Vec<f64>>>()?;
        let mut sum = 0.0;
        let after = std::iter::once(0.0)
            .chain(samples.get(first..)?.iter().map(|x| {
                sum += square(x);
                sum
            }))
            .collect();
        let bin_s = length as f64 / rate_hz;
        let shape = 1.0 / (1.0 / (bandwidth_hz * bin_s) + MODEL_SD * MODEL_SD);
        Some(Self { octaves_from_1khz, energies, end_s, bin_s, shape, after, rate_hz })
    }

    fn length_s(&self) -> f64 {
        self.end_s + self.bin_s * self.energies.len() as f64
    }

    /// Energy that the decay would have in a bin if it came so much earlier.
    fn earlier(&self, bin: usize, lead_s: f64) -> f64 {
        let until = |time_s: f64| {
            let at = (time_s * self.rate_hz).clamp(0.0, (self.after.len() - 1) as f64);
            let index = (at as usize).min(self.after.len().saturating_sub(2));
            let low = self.after[index];
            low + (self.after.get(index + 1).unwrap_or(&low) - low) * (at - index as f64)
        };
        // Times of the copy after the end of the lead-in.
        let end_s = lead_s - self.bin_s * bin as f64;
        until(end_s) - until(end_s - self.bin_s)
    }

    /// Energy of a bin that counts as nothing.
    fn silence(&self) -> f64 {
        SILENCE * self.after.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE)
    }

    fn quiet(&self) -> f64 {
        let mut sorted = self.energies.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 4].max(self.silence())
    }
}

/// What responses hold before their direct sound, in octaves.
#[derive(Debug, Default)]
pub struct LeadIns {
    /// `[response][band]`, bands with too little left out.
    responses: Vec<Vec<LeadInBand>>,
    /// What was found so far, by the responses that count: fits are asked for again and again.
    found: Mutex<BTreeMap<Vec<bool>, Option<OwnEvidence>>>,
}

impl LeadIns {
    pub(crate) fn new(responses: Vec<Vec<LeadInBand>>) -> Self {
        Self { responses, found: Mutex::default() }
    }

    /// What the lead-ins of the responses that count say for second and third harmonics of an exponential sweep: copies of each
    /// response's own decay, all earlier by the same times, as the logarithms of 2 and 3, over steady noise. Parameters as in
    /// [`LeadIns::harmonic_parameters`]. None where no lead-in is long enough.
    #[must_use]
    pub fn harmonics(&self, used: &[bool]) -> Option<OwnEvidence> {
        let known = |found: &BTreeMap<_, _>| found.get(used).cloned();
        if let Some(known) = known(&self.found.lock().unwrap_or_else(PoisonError::into_inner)) {
            return known;
        }
        // A fit without a top says nothing.
        let found = self.fit(used).ok().flatten();
        let mut all = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        all.insert(used.to_vec(), found.clone());
        found
    }

    /// Time by which the second harmonic leads (s), and level of both harmonics at 1 kHz (dB) with a slope (dB per octave).
    #[must_use]
    pub fn harmonic_parameters() -> Vec<Parameter> {
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

    /// Whether any response has enough before its direct sound.
    pub(crate) fn any(survey: &Survey) -> bool {
        let bands = survey.bands();
        let (low, high) = bands.edges_hz(bands.len() - 1);
        let least_s = GUARD_S.max(RINGING_BANDWIDTH_TIMES / (high - low)) + BIN_S * LEAST_BINS as f64;
        survey.responses().iter().any(|r| r.direct_s > least_s)
    }

    fn fit(&self, used: &[bool]) -> Result<Option<OwnEvidence>, Error> {
        let cells: Vec<&LeadInBand> =
            self.responses.iter().zip(used).filter(|(_, used)| **used).flat_map(|(bands, _)| bands).collect();
        if cells.is_empty() {
            return Ok(None);
        }
        let quiet: Vec<f64> = cells.iter().map(|c| c.quiet().ln()).collect();
        let without = HarmonicModel::new(&cells, &quiet, &[]);
        let base = maximise(&without, &quiet, "lead-ins")?;
        let parameters = Self::harmonic_parameters();
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
        let mut best: Option<Maximum> = None;
        for &(_, lead_s) in starts.iter().take(MOST_STARTS) {
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
                unit: p.unit.to_owned(),
            }
        });
        Ok(Some(OwnEvidence { nats: best.log_evidence - base.log_evidence, parameters: found.collect() }))
    }
}

/// Steady noise in each band of each response (logarithm of the energy of a bin) and, if there are parameters for them, harmonics: their
/// parameters, and what each octave is off the line that these describe, the second harmonic's octaves first (dB).
struct HarmonicModel<'a> {
    cells: &'a [&'a LeadInBand],
    priors: Vec<Prior>,
    harmonics: bool,
    /// Octaves from 1 kHz of the bands that there are.
    octaves: Vec<f64>,
}

impl<'a> HarmonicModel<'a> {
    fn new(cells: &'a [&'a LeadInBand], quiet: &[f64], parameters: &[Parameter]) -> Self {
        let mut priors: Vec<Prior> = quiet.iter().map(|q| Prior::normal(*q, FLOOR_SD)).collect();
        priors.extend(parameters.iter().map(|p| Prior {
            mean: p.neutral,
            sd: p.prior_sd,
            low: p.bounds.0,
            high: p.bounds.1,
        }));
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

/// The lead-in of every band of a response, given its filtered samples.
pub(crate) fn of_response(
    filtered: &[Vec<f32>],
    complete: &dyn Fn(usize) -> bool,
    bands: sabine_acoustics::Bands,
    direct: f64,
    rate_hz: f64,
) -> Vec<LeadInBand> {
    (0..bands.len())
        .filter(|&band| complete(band))
        .filter_map(|band| {
            let (low, high) = bands.edges_hz(band);
            let octaves = (bands.exact_hz(band) / 1000.0).log2();
            LeadInBand::new(&filtered[band], direct, rate_hz, high - low, octaves)
        })
        .collect()
}
