//! What measurements would show of each effect of the catalogue, before anything is known of it: its size in standard deviations, the
//! smallest that would be named, and how alike two effects look.

use crate::effect::{Case, Nuisance, Observable};
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::likelihood::arrivals::at_fit;
use crate::likelihood::arrivals::expansion::heard;
use crate::likelihood::decay::EnergyModel;
use crate::likelihood::expansion::Expansion;
use crate::likelihood::laplace::Model;
use crate::likelihood::parameters::DecayLayout;
use crate::plan::gaussian::Known;
use crate::plan::prospect::Setting;
use nalgebra::{DMatrix, DVector};
use sabine_scene::TimeZero;

/// The two kinds of data, which share no parameter.
pub(crate) const PARTS: [Observable; 2] = [Observable::Decay, Observable::Arrivals];

/// Products over the covariance of the data, by part: of slopes with the nuisance parameters, and of what each case makes of the
/// prediction at its typical size.
#[derive(Clone)]
pub(crate) struct Shown(pub [DMatrix<f64>; 2]);

impl Shown {
    /// Two independent measurements together.
    pub fn and(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|part| &self.0[part] + &other.0[part]))
    }
}

/// What is known of the nuisance parameters beforehand, by part, and which cases there are.
pub(crate) struct Campaign<'a> {
    pub cases: &'a [CatalogueCase],
    pub known: [Known; 2],
    nuisances: [usize; 2],
}

/// Size of each effect, and how alike two look.
pub(crate) struct Sizes {
    /// One over the variance with which the size of a case is found, in units of its typical one.
    pub information: Vec<f64>,
    /// Products of the signatures, by part.
    signatures: [DMatrix<f64>; 2],
}

impl Sizes {
    /// Cosine of the angle between the signatures of two cases; `None` where one has none, or they show in different data.
    pub fn cosine(&self, a: usize, b: usize) -> Option<f64> {
        self.signatures.iter().find_map(|m| {
            let (aa, bb) = (m[(a, a)], m[(b, b)]);
            (aa > 1e-9 && bb > 1e-9).then(|| (m[(a, b)].abs() / (aa * bb).sqrt()).min(1.0))
        })
    }
}

/// Whether a case shows in decays or arrival times at any place: the others are found in single channels, in peaks that nothing predicted
/// explains, or before the direct sound.
pub(crate) fn is_predicted(case: &Case) -> bool {
    let of_response = case.parameters.iter().any(|p| p.response.is_some())
        || case.relaxes.iter().any(|(n, _)| matches!(n, Nuisance::ResponseGain(_)));
    let shows = PARTS.contains(&case.observable()) && case.reflection_term().is_none();
    shows && !of_response
}

/// Variance of a case's size beforehand, in units of its typical one squared.
pub(crate) fn prior_variance(case: &Case) -> f64 {
    let own: f64 = case.parameters.iter().map(|p| ((p.typical - p.neutral) / p.prior_sd).powi(2)).sum();
    // What a relaxed prior allows is typical.
    1.0 / (own + if case.relaxes.is_empty() { 0.0 } else { 1.0 }).max(1e-12)
}

impl<'a> Campaign<'a> {
    /// `base` holds the room as stated.
    pub fn new(base: &Baseline, cases: &'a [CatalogueCase]) -> Self {
        let used = vec![true; base.pairs()];
        let (energy, arrivals) = (base.energy_data(), base.arrival_data());
        let decay = EnergyModel::new(&energy, &[], &used);
        let times = at_fit(&arrivals, &[], &used);
        let nuisances = [shared_decay(&decay.layout), shared_arrivals(base)];
        let sd = |model: &dyn Model, count: usize| -> Vec<f64> {
            model.priors()[..count].iter().map(|p| p.sd).collect()
        };
        let known = [sd(&decay, nuisances[0]), sd(&times, nuisances[1])];
        Self { cases, known: known.map(|sd| Known::independent(&sd)), nuisances }
    }

    /// What a measurement shows.
    pub fn shown(&self, prospect: &Baseline, moved: Option<Nuisance>, setting: &Setting<'_>) -> Shown {
        Shown([self.decays(prospect), self.times(prospect, moved, f64::from(setting.rate_hz))])
    }

    /// Nothing measured.
    pub fn nothing(&self) -> Shown {
        Shown(self.nuisances.map(|n| DMatrix::zeros(n + self.cases.len(), n + self.cases.len())))
    }

    fn decays(&self, prospect: &Baseline) -> DMatrix<f64> {
        let (data, used) = (prospect.energy_data(), vec![true; prospect.pairs()]);
        let plain = EnergyModel::new(&data, &[], &used);
        let values = expansion_point(prospect, &plain);
        let n = self.nuisances[0];
        let mut sum = DMatrix::zeros(n + self.cases.len(), n + self.cases.len());
        for pair in 0..prospect.pairs() {
            let mut one = plain.expansion(&values, pair);
            let gain = plain.layout.gain(pair);
            one.owning(gain, plain.priors()[gain].sd);
            let signature = |case: &Case| -> Option<DVector<f64>> {
                let mut signature = DVector::zeros(one.predicted.len());
                if case.decay_term().is_some() {
                    let model = EnergyModel::new(&data, &[case], &used);
                    let mut moved = values.clone();
                    moved.extend(case.parameters.iter().map(|p| p.typical));
                    signature = model.prediction(&moved, pair) - &one.predicted;
                }
                add_relaxed(&mut signature, &one, case, |nuisance| plain.layout.nuisance(nuisance));
                signature.iter().all(|x| x.is_finite()).then_some(signature)
            };
            sum += one.products(&self.columns(0, &one, signature));
        }
        sum
    }

    fn times(&self, prospect: &Baseline, moved: Option<Nuisance>, rate_hz: f64) -> DMatrix<f64> {
        let (data, used) = (prospect.arrival_data(), vec![true; prospect.pairs()]);
        let plain = at_fit(&data, &[], &used);
        let values: Vec<f64> = plain.priors().iter().map(|p| p.mean).collect();
        let n = self.nuisances[1];
        let own = moved.and_then(|nuisance| plain.layout.nuisance(nuisance)).unwrap_or(0..0);
        let latencies = n..plain.priors().len();
        let expanded: Vec<Expansion> = (0..prospect.pairs())
            .map(|pair| {
                let heard = heard(&data.arrivals[pair], data.speed_m_s[pair]);
                plain.expansion(&values, pair, &heard, rate_hz)
            })
            .collect();
        // Responses share the place that is new: they are one set of data.
        let mut one = together(&expanded);
        own.chain(latencies).for_each(|parameter| one.owning(parameter, plain.priors()[parameter].sd));
        let signature = |case: &Case| -> Option<DVector<f64>> {
            let mut signature = DVector::zeros(one.predicted.len());
            if case.arrival_term().is_some() {
                let model = at_fit(&data, &[case], &used);
                let mut moved = values.clone();
                moved.extend(case.parameters.iter().map(|p| p.typical));
                let times = (0..prospect.pairs()).flat_map(|pair| {
                    let heard = heard(&data.arrivals[pair], data.speed_m_s[pair]);
                    model
                        .expansion(&moved, pair, &heard, rate_hz)
                        .predicted
                        .iter()
                        .copied()
                        .collect::<Vec<_>>()
                });
                signature = DVector::from_iterator(one.predicted.len(), times) - &one.predicted;
            }
            add_relaxed(&mut signature, &one, case, |nuisance| plain.layout.nuisance(nuisance));
            signature.iter().all(|x| x.is_finite()).then_some(signature)
        };
        one.products(&self.columns(1, &one, signature))
    }

    /// Slopes with the nuisance parameters of a part, and the signatures of the cases that show in it.
    fn columns(
        &self,
        part: usize,
        one: &Expansion,
        signature: impl Fn(&Case) -> Option<DVector<f64>>,
    ) -> DMatrix<f64> {
        let n = self.nuisances[part];
        let mut columns = DMatrix::zeros(one.predicted.len(), n + self.cases.len());
        columns.columns_mut(0, n).copy_from(&one.slopes.columns(0, n));
        let shows = |c: &CatalogueCase| is_predicted(&c.case) && c.case.observable() == PARTS[part];
        let own = self.cases.iter().enumerate().filter(|(_, c)| shows(c));
        for (place, case) in own {
            if let Some(found) = signature(&case.case) {
                columns.set_column(n + place, &found);
            }
        }
        columns
    }

    /// Sizes of all cases once this has been measured; `None` if a figure is none.
    pub fn sizes(&self, shown: &Shown) -> Option<Sizes> {
        let of_part = |part: usize| {
            let n = self.nuisances[part];
            self.known[part].projected(&shown.0[part], 0..n, n..n + self.cases.len())
        };
        let signatures = [of_part(0)?, of_part(1)?];
        let information = (0..self.cases.len())
            .map(|c| signatures[0][(c, c)].max(signatures[1][(c, c)]).max(0.0))
            .collect();
        Some(Sizes { information, signatures })
    }

    /// What is learned of the absorption of all materials, in nats.
    pub fn material_nats(&self, shown: &Shown) -> Option<f64> {
        let n = self.nuisances[0];
        self.known[0].information_nats(&shown.0[0].view((0, 0), (n, n)).into_owned())
    }
}

/// Nuisance parameters of the decays that responses share.
pub(crate) fn shared_decay(layout: &DecayLayout) -> usize {
    layout.gain(0)
}

/// The same of the arrival times: all places, and a latency that is common.
pub(crate) fn shared_arrivals(baseline: &Baseline) -> usize {
    let own = baseline.survey().measurement.time_zero == TimeZero::PerResponse;
    baseline.arrival_layout().latency(0) + usize::from(!own)
}

/// Absorption of the expansion, and gains of none.
pub(crate) fn expansion_point(baseline: &Baseline, model: &EnergyModel<'_>) -> Vec<f64> {
    let mut values = model.start(None);
    for (m, material) in baseline.simulation.absorption.iter().enumerate() {
        values[model.layout.material(m)].copy_from_slice(material);
    }
    values
}

/// Adds what a case makes of the data that relaxes a prior, as far as it allows: all coordinates alike, one standard deviation long.
fn add_relaxed(
    signature: &mut DVector<f64>,
    one: &Expansion,
    case: &Case,
    place: impl Fn(Nuisance) -> Option<std::ops::Range<usize>>,
) {
    for &(nuisance, sd) in &case.relaxes {
        let Some(range) = place(nuisance) else { continue };
        // A place has a distance; absorption is off in every octave.
        let each = match nuisance {
            Nuisance::SourcePosition(_) | Nuisance::ReceiverPosition(_) => sd / (range.len() as f64).sqrt(),
            _ => sd,
        };
        range.for_each(|parameter| *signature += one.slopes.column(parameter) * each);
    }
}

/// Data of several responses as one set.
pub(crate) fn together(all: &[Expansion]) -> Expansion {
    let count: usize = all.iter().map(|one| one.predicted.len()).sum();
    let parameters = all.first().map_or(0, |one| one.slopes.ncols());
    let shared: usize = all.iter().map(|one| one.shared.ncols()).sum();
    let mut whole = Expansion {
        predicted: DVector::zeros(count),
        slopes: DMatrix::zeros(count, parameters),
        weights: DVector::zeros(count),
        shared: DMatrix::zeros(count, shared),
    };
    let (mut row, mut column) = (0, 0);
    for one in all {
        let (n, k) = one.shared.shape();
        whole.predicted.rows_mut(row, n).copy_from(&one.predicted);
        whole.weights.rows_mut(row, n).copy_from(&one.weights);
        whole.slopes.rows_mut(row, n).copy_from(&one.slopes);
        whole.shared.view_mut((row, column), (n, k)).copy_from(&one.shared);
        (row, column) = (row + n, column + k);
    }
    whole
}
