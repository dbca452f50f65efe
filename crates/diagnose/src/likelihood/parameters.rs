//! Where each parameter of a fit stands in the vector of its values.
//!
//! A vector begins with the nuisance parameters, which every model leaves open ([`DecayLayout`], [`ArrivalLayout`]); the parameters of
//! the cases follow, one [`ModelTerm`] each. No other file knows this order.

use crate::effect::{Case, ChannelChange, Nuisance};
use crate::likelihood::laplace::{Prior, Together};
use crate::survey::Survey;
use nalgebra::DMatrix;
use sabine_acoustics::Bands;
use sabine_scene::{Levels, TimeZero};
use std::ops::Range;

/// Nuisance parameters of the decays: absorption of each material and band, a common gain where levels are common, and a gain of each
/// response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DecayLayout {
    materials: usize,
    bands: usize,
    has_common_gain: bool,
    responses: usize,
}

impl DecayLayout {
    pub fn of(survey: &Survey) -> Self {
        Self {
            materials: survey.materials.len(),
            bands: survey.bands.len(),
            has_common_gain: survey.measurement.levels == Levels::Common,
            responses: survey.responses.len(),
        }
    }

    /// Absorption of a material in a band.
    pub fn absorption(&self, material: usize, band: usize) -> usize {
        material * self.bands + band
    }

    /// Absorption of a material in all bands.
    pub fn material(&self, material: usize) -> Range<usize> {
        self.absorption(material, 0)..self.absorption(material + 1, 0)
    }

    /// Gain of all responses together, where there is one.
    pub fn common_gain(&self) -> Option<usize> {
        self.has_common_gain.then(|| self.absorption(self.materials, 0))
    }

    /// Gain of a response.
    pub fn gain(&self, response: usize) -> usize {
        self.absorption(self.materials, 0) + usize::from(self.has_common_gain) + response
    }

    /// Number of nuisance parameters.
    pub fn len(&self) -> usize {
        self.gain(self.responses)
    }

    /// Those that a nuisance stands for; none of an arrival's.
    pub fn nuisance(&self, nuisance: Nuisance) -> Option<Range<usize>> {
        match nuisance {
            Nuisance::Absorption(material) => Some(self.material(material)),
            Nuisance::ResponseGain(response) => Some(self.gain(response)..self.gain(response) + 1),
            Nuisance::SourcePosition(_) | Nuisance::ReceiverPosition(_) => None,
        }
    }
}

/// Nuisance parameters of the arrival times: three coordinates of each source and receiver, and one latency, or one of each response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ArrivalLayout {
    sources: usize,
    receivers: usize,
    /// Number of latencies of their own; one serves all responses otherwise.
    latencies: Option<usize>,
}

impl ArrivalLayout {
    pub fn of(survey: &Survey) -> Self {
        let own = survey.measurement.time_zero == TimeZero::PerResponse;
        Self {
            sources: survey.sources.len(),
            receivers: survey.receivers.len(),
            latencies: own.then_some(survey.responses.len()),
        }
    }

    /// Offset of a source along the three axes.
    pub fn source(&self, source: usize) -> Range<usize> {
        3 * source..3 * source + 3
    }

    /// Offset of a receiver along the three axes.
    pub fn receiver(&self, receiver: usize) -> Range<usize> {
        let first = 3 * (self.sources + receiver);
        first..first + 3
    }

    /// Latency of a response.
    pub fn latency(&self, response: usize) -> usize {
        self.receiver(self.receivers).start + if self.latencies.is_some() { response } else { 0 }
    }

    /// Number of latencies.
    pub fn latencies(&self) -> usize {
        self.latencies.unwrap_or(1)
    }

    /// Those that a nuisance stands for; none of a decay's.
    pub fn nuisance(&self, nuisance: Nuisance) -> Option<Range<usize>> {
        match nuisance {
            Nuisance::SourcePosition(i) => Some(self.source(i)),
            Nuisance::ReceiverPosition(i) => Some(self.receiver(i)),
            Nuisance::Absorption(_) | Nuisance::ResponseGain(_) => None,
        }
    }
}

/// Octaves over which the correlation of absorption falls by a factor e. Between two surfaces of the material library the difference
/// correlates by 0.88 to 1.00 from octave to octave and by 0.52 over six ([`sabine_acoustics::material_library`], 34 surfaces); this says 0.88
/// and 0.47.
const ABSORPTION_OCTAVES: f64 = 8.0;

/// How the absorption of a surface that is not what its table says goes together over the bands: what absorbs much at 500 Hz absorbs
/// much at 1 kHz. The narrower the bands, the fewer free values they are worth.
fn over_bands(bands: &Bands) -> DMatrix<f64> {
    let n = bands.len();
    DMatrix::from_fn(n, n, |a, b| {
        (-(bands.exact_hz(a) / bands.exact_hz(b)).log2().abs() / ABSORPTION_OCTAVES).exp()
    })
}

/// A case in a model, and where its parameters stand.
pub(crate) struct ModelTerm<'a> {
    pub case: &'a Case,
    pub first: usize,
    /// Number of the case, as the caller counts.
    pub order: usize,
}

impl ModelTerm<'_> {
    /// Where its parameters stand.
    pub fn range(&self) -> Range<usize> {
        self.first..self.first + self.case.parameters.len()
    }

    /// Its own part of all values.
    pub fn own<'v>(&self, values: &'v [f64]) -> &'v [f64] {
        &values[self.range()]
    }
}

/// Which response holds which pair, some having been exchanged.
pub(crate) fn assignment<'a>(pairs: usize, cases: impl IntoIterator<Item = &'a Case>) -> Vec<usize> {
    let mut assignment: Vec<usize> = (0..pairs).collect();
    for change in cases.into_iter().filter_map(Case::channel_change) {
        if let ChannelChange::Exchanged(a, b) = change {
            assignment.swap(a, b);
        }
    }
    assignment
}

/// The cases of a model behind its nuisance parameters.
pub(crate) struct ModelTerms<'a> {
    pub priors: Vec<Prior>,
    pub together: Vec<Together>,
    pub terms: Vec<ModelTerm<'a>>,
    /// Which response holds which pair.
    pub assignment: Vec<usize>,
}

impl<'a> ModelTerms<'a> {
    /// Appends the cases (each with its number) in this order to the priors of the nuisance parameters, and relaxes those that the cases
    /// relax.
    pub fn new(
        mut priors: Vec<Prior>,
        cases: impl IntoIterator<Item = (usize, &'a Case)>,
        survey: &Survey,
        nuisance: impl Fn(Nuisance) -> Option<Range<usize>>,
    ) -> Self {
        let mut assignment: Vec<usize> = (0..survey.responses.len()).collect();
        let (mut terms, mut together) = (Vec::new(), Vec::<Together>::new());
        for (order, case) in cases {
            for &(relaxed, sd) in &case.relaxes {
                let range = nuisance(relaxed).unwrap_or(0..0);
                for prior in &mut priors[range.clone()] {
                    prior.sd = prior.sd.max(sd);
                }
                if matches!(relaxed, Nuisance::Absorption(_)) && !together.iter().any(|t| t.range == range) {
                    together.extend(Together::new(range, over_bands(&survey.bands)));
                }
            }
            if let Some(ChannelChange::Exchanged(a, b)) = case.channel_change() {
                assignment.swap(a, b);
            }
            let first = priors.len();
            priors.extend(case.parameters.iter().map(Prior::of));
            terms.push(ModelTerm { case, first, order });
        }
        Self { priors, together, terms, assignment }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::effect::Effect;
    use crate::effects::{SurfaceAbsorption, TimeZeroOffset, TransducerResponse};
    use crate::hand_made;

    /// All places of a layout in turn: each once, none left out, none beyond the end.
    fn is_a_partition(mut places: Vec<usize>, len: usize) -> bool {
        places.sort_unstable();
        places == (0..len).collect::<Vec<usize>>()
    }

    #[test]
    fn each_nuisance_of_the_decays_has_a_place_of_its_own() {
        for levels in [Levels::Common, Levels::Absolute, Levels::PerResponse] {
            let survey = hand_made::survey(levels, TimeZero::Emission);
            let layout = DecayLayout::of(&survey);
            let mut places: Vec<usize> = layout.common_gain().into_iter().collect();
            places.extend((0..survey.materials().len()).flat_map(|m| layout.material(m)));
            places.extend((0..survey.responses().len()).map(|r| layout.gain(r)));
            assert!(is_a_partition(places, layout.len()), "{levels:?}");
            assert_eq!(layout.common_gain().is_some(), levels == Levels::Common);
            for (m, band) in [(0, 1), (1, 0), (1, 1)] {
                assert_eq!(layout.absorption(m, band), layout.material(m).nth(band).unwrap());
            }
            assert_eq!(layout.nuisance(Nuisance::ResponseGain(2)), Some(layout.gain(2)..layout.gain(2) + 1));
            assert_eq!(layout.nuisance(Nuisance::SourcePosition(0)), None);
        }
    }

    #[test]
    fn each_nuisance_of_the_arrivals_has_a_place_of_its_own() {
        for time_zero in [TimeZero::Emission, TimeZero::Common, TimeZero::PerResponse] {
            let survey = hand_made::survey(Levels::Common, time_zero);
            let layout = ArrivalLayout::of(&survey);
            let latencies = if time_zero == TimeZero::PerResponse { survey.responses().len() } else { 1 };
            assert_eq!(layout.latencies(), latencies);
            let mut places: Vec<usize> = (0..latencies).map(|r| layout.latency(r)).collect();
            places.extend((0..survey.sources().len()).flat_map(|s| layout.source(s)));
            places.extend((0..survey.receivers().len()).flat_map(|r| layout.receiver(r)));
            let len = 3 * (survey.sources().len() + survey.receivers().len()) + latencies;
            assert!(is_a_partition(places, len), "{time_zero:?}");
            assert_eq!(layout.nuisance(Nuisance::ReceiverPosition(1)), Some(layout.receiver(1)));
        }
    }

    #[test]
    fn absorption_goes_together_over_octaves_and_closer_over_their_thirds() {
        let octaves = over_bands(&Bands::octaves(125.0, 8000.0).unwrap());
        assert!((octaves[(0, 1)] - 0.882).abs() < 2e-3 && (octaves[(6, 0)] - 0.472).abs() < 2e-3);
        let thirds = over_bands(&Bands::third_octaves(125.0, 250.0).unwrap());
        assert!((thirds[(0, 3)] - octaves[(0, 1)]).abs() < 1e-3 && thirds[(0, 1)] > 0.95);
    }

    #[test]
    fn terms_follow_the_nuisances_one_after_the_other_and_relax_what_they_name() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let layout = DecayLayout::of(&survey);
        let priors = vec![Prior::normal(0.0, 0.1); layout.len()];
        let one = |effect: &dyn Effect, i: usize| effect.cases(&survey).swap_remove(i);
        let cases = [one(&TransducerResponse, 0), one(&SurfaceAbsorption, 1), one(&TimeZeroOffset, 0)];
        let numbered = cases.iter().enumerate();
        let all = ModelTerms::new(priors, numbered, &survey, |nuisance| layout.nuisance(nuisance));
        let mut next = layout.len();
        for (order, term) in all.terms.iter().enumerate() {
            assert_eq!((term.order, term.first), (order, next));
            next = term.range().end;
        }
        assert_eq!(all.priors.len(), next);
        let values: Vec<f64> = (0..next).map(|i| i as f64).collect();
        assert_eq!(all.terms[0].own(&values)[0], layout.len() as f64);
        for (i, prior) in all.priors[..layout.len()].iter().enumerate() {
            assert_eq!(prior.sd > 0.1, layout.material(1).contains(&i), "{i}");
        }
        assert_eq!(all.together.len(), 1);
        assert_eq!(all.together[0].range, layout.material(1));
    }
}
