//! Expected evidence between fitted hypotheses once a measurement is made.

use crate::effect::{Case, Nuisance};
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::likelihood::arrivals::at_fit;
use crate::likelihood::arrivals::expansion::heard;
use crate::likelihood::decay::EnergyModel;
use crate::likelihood::expansion::Expansion;
use crate::likelihood::laplace::Model;
use crate::plan::campaign::{shared_arrivals, shared_decay, together};
use crate::plan::gaussian::{Predictive, expected_nats};
use crate::plan::hypothesis::Fit;
use nalgebra::DMatrix;
use std::ops::Range;

/// Products over the covariance of the data, by part: of slopes with the parameters of each hypothesis and its prediction, one hypothesis
/// after the other.
#[derive(Clone)]
pub(crate) struct Weighed([DMatrix<f64>; 2]);

impl Weighed {
    /// Two independent measurements together.
    pub fn and(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|part| &self.0[part] + &other.0[part]))
    }
}

/// Fitted hypotheses.
pub(crate) struct Contest<'a> {
    pub fits: &'a [Fit],
    pub cases: &'a [CatalogueCase],
}

impl Contest<'_> {
    /// Columns of each hypothesis in a part: its parameters, and its prediction behind them.
    fn ranges(&self, part: usize) -> Vec<Range<usize>> {
        let mut first = 0;
        let range = |fit: &Fit| {
            let own = first..first + fit.values[part].len();
            first = own.end + 1;
            own
        };
        self.fits.iter().map(range).collect()
    }

    /// Nothing measured.
    pub fn nothing(&self) -> Weighed {
        Weighed([0, 1].map(|part| {
            let count = self.ranges(part).last().map_or(0, |last| last.end + 1);
            DMatrix::zeros(count, count)
        }))
    }

    /// What a measurement says.
    pub fn weighed(&self, prospect: &Baseline, moved: Option<Nuisance>, rate_hz: f64) -> Weighed {
        let mut decay = self.nothing().0[0].clone();
        for pair in 0..prospect.pairs() {
            let (all, chance): (Vec<_>, Vec<_>) =
                self.fits.iter().map(|fit| self.decays(fit, prospect, pair)).unzip();
            decay += products(&all);
            self.take_off_chance(&mut decay, &chance);
        }
        let times: Vec<(Expansion, Vec<usize>)> =
            self.fits.iter().map(|fit| self.times(fit, prospect, moved, rate_hz)).collect();
        Weighed([decay, products(&times)])
    }

    /// Takes off the products of predictions with each other what the tracer's chance makes of their differences, given what each batch of rays
    /// moves the bins by under each hypothesis: two predictions that differ by chance alone are told apart by no measurement.
    fn take_off_chance(&self, products: &mut DMatrix<f64>, chance: &[DMatrix<f64>]) {
        let Some(first) = chance.first() else { return };
        let places: Vec<usize> = self.ranges(0).iter().map(|own| own.end).collect();
        let apart: Vec<DMatrix<f64>> = chance.iter().map(|one| one - first).collect();
        for (a, one) in places.iter().zip(&apart) {
            for (b, other) in places.iter().zip(&apart) {
                // A nat is half of a squared standard deviation.
                products[(*a, *b)] -= 2.0 * one.dot(other);
            }
        }
    }

    /// Decays of a pair under a hypothesis, which parameters it shares with those measured, and the chance in them.
    fn decays(&self, fit: &Fit, prospect: &Baseline, pair: usize) -> ((Expansion, Vec<usize>), DMatrix<f64>) {
        let cases: Vec<&Case> = fit.cases[0].iter().map(|&c| &self.cases[c].case).collect();
        let (data, used) = (prospect.energy_data(), vec![true; prospect.pairs()]);
        let model = EnergyModel::new(&data, &cases, &used);
        let shared = shared_decay(&model.layout);
        let places = places(shared, &cases, |order| model.first_of(order));
        let mut values = model.start(None);
        places.iter().zip(&fit.values[0]).for_each(|(&place, value)| values[place] = *value);
        let mut one = model.expansion(&values, pair);
        let gain = model.layout.gain(pair);
        one.owning(gain, model.priors()[gain].sd);
        ((one, places), model.chance(&values, pair))
    }

    /// Arrival times of all pairs, likewise.
    fn times(
        &self,
        fit: &Fit,
        prospect: &Baseline,
        moved: Option<Nuisance>,
        rate_hz: f64,
    ) -> (Expansion, Vec<usize>) {
        let cases: Vec<&Case> = fit.cases[1].iter().map(|&c| &self.cases[c].case).collect();
        let (data, used) = (prospect.arrival_data(), vec![true; prospect.pairs()]);
        let model = at_fit(&data, &cases, &used);
        let shared = shared_arrivals(prospect);
        let first_of = |order: usize| {
            model.terms.iter().find(|t| t.order == order).map_or(model.priors().len(), |t| t.first)
        };
        let places = places(shared, &cases, first_of);
        let mut values: Vec<f64> = model.priors().iter().map(|p| p.mean).collect();
        places.iter().zip(&fit.values[1]).for_each(|(&place, value)| values[place] = *value);
        let own = moved.and_then(|nuisance| model.layout.nuisance(nuisance)).unwrap_or(0..0);
        // What a hypothesis says of a place says nothing of the place where it moves.
        let stated = |place: usize| {
            let places = if place < model.layout.receiver(0).start {
                &prospect.survey().sources[place / 3]
            } else {
                &prospect.survey().receivers[(place - model.layout.receiver(0).start) / 3]
            };
            places.position_sd_m
        };
        own.clone().for_each(|place| values[place] = 0.0);
        let expanded: Vec<Expansion> = (0..prospect.pairs())
            .map(|pair| {
                let heard = heard(&data.arrivals[pair], data.speed_m_s[pair]);
                model.expansion(&values, pair, &heard, rate_hz)
            })
            .collect();
        let mut one = together(&expanded);
        own.for_each(|place| one.owning(place, stated(place)));
        let latencies = shared..model.layout.latency(0) + model.layout.latencies();
        latencies.for_each(|latency| one.owning(latency, model.priors()[latency].sd));
        (one, places)
    }

    /// Expected evidence for each pair of hypotheses, whichever of the two is true being as likely; `None` if a figure is none.
    pub fn nats(&self, weighed: &Weighed) -> Option<Vec<f64>> {
        let ranges = [0, 1].map(|part| self.ranges(part));
        let of = |part: usize, k: usize| Predictive {
            known: &self.fits[k].known[part],
            slopes: ranges[part][k].clone(),
            predicted: ranges[part][k].end,
        };
        let both = |part: usize, a: usize, b: usize| {
            let one = |truth, rival| expected_nats(&weighed.0[part], &of(part, truth), &of(part, rival));
            Some(0.5 * (one(a, b)? + one(b, a)?))
        };
        self.pairs().into_iter().map(|(a, b)| Some(both(0, a, b)? + both(1, a, b)?)).collect()
    }

    /// All pairs of hypotheses.
    pub fn pairs(&self) -> Vec<(usize, usize)> {
        let count = self.fits.len();
        (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b))).collect()
    }
}

/// Places of what a hypothesis shares with measurements made: nuisances, and the parameters of its cases.
fn places(shared: usize, cases: &[&Case], first_of: impl Fn(usize) -> usize) -> Vec<usize> {
    let own = cases.iter().enumerate().flat_map(|(order, case)| {
        let first = first_of(order);
        first..first + case.parameters.len()
    });
    (0..shared).chain(own).collect()
}

/// Products of all hypotheses' columns over the covariance that the first of them gives the data.
fn products(all: &[(Expansion, Vec<usize>)]) -> DMatrix<f64> {
    let Some((first, _)) = all.first() else { return DMatrix::zeros(0, 0) };
    let count = all.iter().map(|(_, places)| places.len() + 1).sum();
    let mut columns = DMatrix::zeros(first.predicted.len(), count);
    let mut at = 0;
    for (one, places) in all {
        for &place in places {
            columns.set_column(at, &one.slopes.column(place));
            at += 1;
        }
        // Relative to the first: differences are all that counts, and small ones keep their digits.
        columns.set_column(at, &(&one.predicted - &first.predicted));
        at += 1;
    }
    first.products(&columns)
}
