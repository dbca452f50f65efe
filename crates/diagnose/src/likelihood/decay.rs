//! How probable measured energies are under materials, gains and effects.
//!
//! In each time bin the measured energy E is Gamma distributed about the predicted M with shape 1 / (relative variance), as
//! the energy of band-limited noise is (Kuttruff, Room Acoustics, 6th ed., 3.5), and the prediction's own Monte-Carlo error makes it wider.

mod chance;
mod drift;
mod expansion;
mod fit;
mod group_sums;
mod offsets;
mod pair_likelihood;
mod table_band;
#[cfg(test)]
mod tests;
mod variance;

pub(crate) use fit::{WarmStart, fit, fit_from_elsewhere};
use group_sums::energies_and_hits;
use offsets::{BandBins, Directions};
pub(crate) use offsets::{DRIFTS, unit_drift};
use pair_likelihood::ComparedBand;

use crate::effect::{Case, Parameter, Stage};
use crate::likelihood::laplace::{Model, Prior, Slopes, Together};
use crate::likelihood::parameters::{DecayLayout, ModelTerm, ModelTerms};
use crate::observe::observed_response::Measured;
use crate::simulate::band_state::BandState;
use crate::simulate::reflection_reweighting::HitChanges;
use crate::simulate::tables::Tables;
use crate::simulate::views::BandView;
use crate::statistics::{exp_all, median};
use crate::survey::Survey;
use rayon::prelude::*;
use sabine_scene::Levels;

/// Logarithm of energy in one decibel.
const LN_PER_DB: f64 = std::f64::consts::LN_10 / 10.0;
/// Energy below the reference by so much counts as this much, measured or predicted: digital silence has no logarithm.
const SILENCE: f64 = 1e-9;
/// Gain of a whole recording whose level means nothing, in dB.
const FREE_GAIN_DB: f64 = 40.0;
/// Step of differences, in prior standard deviations (or logarithms of energy).
const STEP: f64 = 1e-4;
/// Bins in which unknown gains are first read.
const EARLY_BINS: usize = 8;
/// A gain is looked for within so much of where early energies meet, in dB ...
const GAIN_REACH_DB: f64 = 12.0;
/// ... to this.
const GAIN_STEP_DB: f64 = 0.01;
/// Pairs whose likelihood one thread sums.
const PAIRS_AT_ONCE: usize = 3;

/// What all energy models of one diagnosis share.
pub(crate) struct EnergyData<'a> {
    pub survey: &'a Survey,
    pub measured: &'a [Measured],
    /// Predictions, `[pair][band]`, expanded about `absorption`.
    pub states: &'a [Vec<BandState>],
    /// Bins to compare, `[pair][band]`.
    pub ends: &'a [Vec<usize>],
    pub direct_s: &'a [f64],
    /// Energy to which added sound refers, by band.
    pub reference: &'a [f64],
    /// Absorption of the expansion, `[material][band]`.
    pub absorption: &'a [Vec<f64>],
    /// What is known of it.
    pub priors: &'a [Vec<Prior>],
    pub gain_sd_db: f64,
    /// How far the level of a response in each band may lie from the prediction (standard deviation, as a logarithm of energy).
    pub level_sd: &'a [f64],
    /// Tables of the terms, by slot.
    pub tables: &'a [Tables],
    /// Factor by which variances exceed what is expected, by band.
    pub dispersion: &'a [f64],
    /// How far single responses drift from the prediction along the decay (standard deviation of the first cosine, as a logarithm of
    /// energy), by band.
    pub drift_sd: &'a [f64],
}

pub(crate) struct EnergyModel<'a> {
    data: &'a EnergyData<'a>,
    pub layout: DecayLayout,
    pub terms: Vec<ModelTerm<'a>>,
    priors: Vec<Prior>,
    together: Vec<Together>,
    /// Pairs that count.
    used: &'a [bool],
    /// Which response holds which pair.
    assignment: Vec<usize>,
}

/// One compared bin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinResidual {
    pub pair: usize,
    pub band: usize,
    pub bin: usize,
    /// Logarithm of measured over predicted energy.
    pub ln_ratio: f64,
    /// What of it the level of the whole response in this octave makes.
    pub level: f64,
    /// The same, its drift along the decay, and what the tracer's chance makes in many bins together.
    pub offset: f64,
    pub ln_predicted: f64,
    /// Expected relative variance, dispersion left out.
    pub variance: f64,
}

impl<'a> EnergyModel<'a> {
    pub fn new(data: &'a EnergyData<'a>, cases: &[&'a Case], used: &'a [bool]) -> Self {
        let survey = data.survey;
        let layout = DecayLayout::of(survey);
        let mut priors: Vec<Prior> = Vec::with_capacity(layout.len());
        for material in data.priors {
            priors.extend_from_slice(&material[..survey.bands.len()]);
        }
        priors.extend(layout.common_gain().map(|_| Prior::normal(0.0, FREE_GAIN_DB)));
        let levels = survey.measurement.levels;
        let sd = if levels == Levels::PerResponse { FREE_GAIN_DB } else { data.gain_sd_db };
        priors.extend(survey.responses.iter().map(|_| Prior::normal(0.0, sd)));
        let mut ordered: Vec<(usize, &Case)> = cases.iter().copied().enumerate().collect();
        ordered.sort_by_key(|(_, c)| c.stage);
        let all = ModelTerms::new(priors, ordered, survey, |nuisance| layout.nuisance(nuisance));
        let ModelTerms { priors, together, terms, assignment } = all;
        Self { data, layout, terms, priors, together, used, assignment }
    }

    /// Values to start from: those of another fit as far as they go, and the effect's.
    pub fn start(&self, before: Option<&[f64]>) -> Vec<f64> {
        let mut x: Vec<f64> = self.priors.iter().map(|p| p.mean).collect();
        if let Some(before) = before {
            let n = self.layout.len().min(before.len());
            x[..n].copy_from_slice(&before[..n]);
        }
        x
    }

    /// Values with other absorptions, by material and band.
    fn with_absorption(&self, values: &[f64], absorption: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut x = values.to_vec();
        for m in 0..self.data.absorption.len() {
            for band in 0..self.data.survey.bands.len() {
                x[self.layout.absorption(m, band)] = absorption(m, band);
            }
        }
        x
    }

    /// Unknown gains begin where early energies meet: from tens of decibels off, steps would be many.
    fn start_gains(&self, values: &mut [f64]) {
        let heard = |p: &usize| self.used[*p] && !self.is_table(*p);
        let pairs: Vec<usize> = (0..self.assignment.len()).filter(heard).collect();
        // Tables hold no levels.
        if pairs.is_empty() {
            return;
        }
        if let Some(index) = self.layout.common_gain() {
            values[index] = median(pairs.iter().map(|&p| self.early_gain_db(p)).collect());
        } else if self.data.survey.measurement.levels == Levels::PerResponse {
            for pair in pairs {
                values[self.layout.gain(self.assignment[pair])] = self.early_gain_db(pair);
            }
        }
    }

    /// Early energy measured over that predicted of a pair, in dB: the median over the octaves.
    fn early_gain_db(&self, pair: usize) -> f64 {
        let ratios: Vec<f64> = (0..self.data.survey.bands.len())
            .filter_map(|band| {
                let energies = self.compared(pair, band)?;
                let count = energies.len().min(EARLY_BINS);
                let measured: f64 = energies[..count].iter().sum();
                let predicted: f64 =
                    self.data.states[pair][band].ln_energy[..count].iter().map(|l| l.exp()).sum();
                (measured > 0.0 && predicted > 0.0).then(|| (measured / predicted).ln() / LN_PER_DB)
            })
            .collect();
        median(ratios)
    }

    /// Fits the gain of one response, everything else staying as it is: where gains mean nothing, that of a response which was left out is
    /// not known from the others, and what is added after the gain (noise) must be added to sound of the right level.
    pub fn fit_gain(&self, values: &mut [f64], pair: usize) {
        if self.is_table(pair) {
            return;
        }
        let index = self.layout.gain(self.assignment[pair]);
        let mut at = |gain_db: f64| -> f64 {
            values[index] = gain_db;
            self.pair_likelihood(values, pair, None)
        };
        // Golden section (Kiefer 1953) about where early energies meet.
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        let about = self.early_gain_db(pair);
        let (mut low, mut high) = (about - GAIN_REACH_DB, about + GAIN_REACH_DB);
        while high - low > GAIN_STEP_DB {
            let (left, right) = (high - golden * (high - low), low + golden * (high - low));
            if at(left) < at(right) { low = left } else { high = right }
        }
        at((low + high) / 2.0);
    }

    /// Where the parameters of the case with this number start.
    pub fn first_of(&self, order: usize) -> usize {
        self.terms.iter().find(|p| p.order == order).map_or(self.priors.len(), |p| p.first)
    }

    /// From the octave's own energy to what its filter passes: effects up to the microphone act on the octave and on what
    /// leaks in from its neighbours, each as it is; the rest on their sum.
    fn apply(&self, values: &[f64], view: &BandView<'_>, gain_db: f64, ln_energy: &mut [f64]) {
        let effects = |early: bool, view: &BandView<'_>, ln_energy: &mut [f64]| {
            for placed in self.terms.iter().filter(|p| (p.case.stage <= Stage::Transducer) == early) {
                if let Some(term) = placed.case.decay_term() {
                    term.apply(placed.own(values), &view.with_table(placed.case.slot), ln_energy);
                }
            }
        };
        effects(true, view, ln_energy);
        let mut sums = ln_energy.to_vec();
        exp_all(&mut sums);
        sums.iter_mut().for_each(|s| *s *= view.state.own_share);
        for (band, share, leak) in &view.state.leaks {
            let mut leak: Vec<f64> = leak[..sums.len()].iter().map(|l| l + gain_db * LN_PER_DB).collect();
            let reference = self.data.reference[*band];
            effects(true, &BandView { band: *band, reference, ..*view }, &mut leak);
            exp_all(&mut leak);
            sums.iter_mut().zip(&leak).for_each(|(s, l)| *s += share * l);
        }
        ln_energy.iter_mut().zip(&sums).for_each(|(l, s)| *l = s.max(1e-300).ln());
        effects(false, view, ln_energy);
        let silence = (SILENCE * view.reference).ln();
        ln_energy.iter_mut().for_each(|l| *l = l.max(silence));
    }

    fn gain_db(&self, values: &[f64], pair: usize) -> f64 {
        values[self.layout.gain(self.assignment[pair])]
            + self.layout.common_gain().map_or(0.0, |index| values[index])
    }

    /// Logarithm of the energy of the paths in one band at these materials and gains, before any effect, and, where wanted, its change
    /// with the absorption of each material, `[bin * materials + material]`.
    fn paths(
        &self,
        values: &[f64],
        (pair, band): (usize, usize),
        count: usize,
        sloping: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let m = self.data.absorption.len();
        let state = &self.data.states[pair][band];
        let left: Vec<f64> = (0..m).map(|k| 1.0 - values[self.layout.absorption(k, band)]).collect();
        let ln_kept: Vec<f64> = left
            .iter()
            .zip(self.data.absorption)
            .map(|(left, expanded)| (left / (1.0 - expanded[band])).ln())
            .collect();
        let gain = self.gain_db(values, pair) * LN_PER_DB;
        let (energies, mut slopes) = energies_and_hits(state, count, &ln_kept, sloping);
        for (hits, energy) in slopes.chunks_exact_mut(m).zip(&energies) {
            hits.iter_mut().zip(&left).for_each(|(hits, left)| *hits /= -energy * left);
        }
        let ln_energy = energies.iter().zip(&state.correction).map(|(e, c)| e.ln() + c + gain).collect();
        (ln_energy, slopes)
    }

    fn view<'v>(
        &'v self,
        (pair, band): (usize, usize),
        gain_db: f64,
        hit_changes: &'v HitChanges,
    ) -> BandView<'v> {
        BandView {
            survey: self.data.survey,
            pair,
            response: self.assignment[pair],
            band,
            state: &self.data.states[pair][band],
            direct_s: self.data.direct_s[pair],
            reference: self.data.reference[band],
            gain: (gain_db * LN_PER_DB).exp(),
            hit_changes,
            tables: self.data.tables,
            own_band: band,
            reflections: false,
            table: None,
        }
    }

    /// Whether a parameter of a case may change the prediction of a pair in a band.
    fn bears_on(&self, parameter: &Parameter, pair: usize, band: usize) -> bool {
        parameter.band.is_none_or(|own| own == band)
            && parameter.receiver.is_none_or(|own| own == self.data.survey.responses[pair].receiver)
            && parameter.response.is_none_or(|own| own == self.assignment[pair])
    }

    /// Bins that are compared, and their measured energies; or the quantities of a table.
    pub fn compared(&self, pair: usize, band: usize) -> Option<&[f64]> {
        let energies = self.data.measured[self.assignment[pair]].energies[band].as_deref()?;
        let end = self.data.ends[pair][band];
        let count = if !self.is_table(pair) {
            end.min(energies.len())
        } else if end > 0 && self.data.states[pair][band].table.is_some() {
            energies.len()
        } else {
            0
        };
        (count > 0).then(|| &energies[..count])
    }

    /// Logarithm of the predicted energy in the bins of a pair and band, as many as are compared; of the quantities of its table, where it has one.
    pub fn predicted(&self, values: &[f64], pair: usize, band: usize, count: usize) -> Vec<f64> {
        let bins = self.predicted_bins(pair, band, count);
        let ln_energy = self.affected(values, (pair, band), self.paths(values, (pair, band), bins, false).0);
        self.table(pair, band, &ln_energy).map_or(ln_energy, |table| table.predicted())
    }

    /// What the effects make of the logarithm of the energy of the paths.
    fn affected(&self, values: &[f64], (pair, band): (usize, usize), mut ln_energy: Vec<f64>) -> Vec<f64> {
        let gain_db = self.gain_db(values, pair);
        let changes = HitChanges::default();
        self.apply(values, &self.view((pair, band), gain_db, &changes), gain_db, &mut ln_energy);
        ln_energy
    }

    /// All compared bins of the given pairs.
    pub fn residuals(&self, values: &[f64], pairs: impl Iterator<Item = usize>) -> Vec<BinResidual> {
        let mut found = Vec::new();
        for pair in pairs {
            let compared = self.compared_bands(values, pair, false);
            let bins: Vec<BandBins<'_>> = compared.iter().map(ComparedBand::bins).collect();
            let offsets = Directions::new(&bins).top();
            for (place, one) in compared.iter().enumerate() {
                let (level, offset) = (offsets.levels[place], &offsets.of[place]);
                for (bin, (&ln_ratio, &offset)) in one.ln_ratio.iter().zip(offset).enumerate() {
                    let (band, ln_predicted, variance) = (one.band, one.predicted[bin], one.variances[bin]);
                    found.push(BinResidual {
                        pair,
                        band,
                        bin,
                        ln_ratio,
                        level,
                        offset,
                        ln_predicted,
                        variance,
                    });
                }
            }
        }
        found
    }

    /// Logarithm of measured over predicted energy in bins of a band.
    fn ln_ratio(&self, band: usize, energies: &[f64], ln_predicted: &[f64]) -> Vec<f64> {
        let silence = SILENCE * self.data.reference[band];
        energies.iter().zip(ln_predicted).map(|(e, p)| e.max(silence).ln() - p).collect()
    }

    /// Shapes of the Gamma distributions of bins with these expected variances.
    fn shapes(&self, band: usize, variances: &[f64]) -> Vec<f64> {
        variances.iter().map(|v| 1.0 / (v * self.data.dispersion[band])).collect()
    }
}

impl Model for EnergyModel<'_> {
    fn priors(&self) -> &[Prior] {
        &self.priors
    }

    fn together(&self) -> &[Together] {
        &self.together
    }

    fn log_likelihood(&self, values: &[f64], slopes: Option<&mut Slopes>) -> f64 {
        let pairs: Vec<usize> = (0..self.assignment.len()).filter(|&p| self.used[p]).collect();
        let (sloping, n) = (slopes.is_some(), self.priors.len());
        // Parts of a fixed size, added up in order: the sum is the same on any number of threads.
        let parts: Vec<(f64, Option<Slopes>)> = pairs
            .par_chunks(PAIRS_AT_ONCE)
            .map(|pairs| {
                let mut own = sloping.then(|| Slopes::zero(n));
                let mut sum = 0.0;
                for &pair in pairs {
                    sum += self.pair_likelihood(values, pair, own.as_mut());
                }
                (sum, own)
            })
            .collect();
        if let Some(slopes) = slopes {
            parts.iter().flat_map(|p| &p.1).for_each(|own| slopes.add(own));
        }
        parts.iter().map(|p| p.0).sum()
    }
}
