//! A named physical cause of a misfit, and the cases in which it can come.

pub(crate) mod case;
pub(crate) mod fitted_case;
pub(crate) mod info;
pub(crate) mod next_measurement;
pub(crate) mod reflection_gate;
pub(crate) mod term;

pub use case::Case;
pub use fitted_case::FittedCase;
pub use info::EffectInfo;
pub use term::{
    AddedReflection, ArrivalTerm, AuxiliaryEvidence, ChannelChange, DecayTerm, PreArrivalTerm,
    ReflectionEvidence, ReflectionTerm, Term,
};

use crate::survey::Survey;
use std::borrow::Cow;

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name, with the octave where it belongs to one.
    pub name: String,
    /// Unit; empty for a pure number.
    pub unit: Cow<'static, str>,
    /// Most probable value before anything is measured; that at which the effect is absent, where there is one.
    pub neutral: f64,
    /// Standard deviation of the prior, a normal distribution about the neutral value.
    pub prior_sd: f64,
    /// Least and greatest value.
    pub bounds: (f64, f64),
    /// Whether the least value is as far as the model claims to go, as a floor of uncertainty is: reaching it does not say that more of
    /// the effect may be there.
    pub has_floor: bool,
    /// Whether the greatest value is as far as the model claims to go, as a share of the whole is.
    pub has_ceiling: bool,
    /// A value at which the effect is plain to see: where its signature is compared with those of others.
    pub typical: f64,
    /// The only band that it bears on, where there is one.
    pub band: Option<usize>,
    /// The only receiver (index) that it bears on, where there is one: a fit that has not seen it knows nothing of this parameter.
    pub receiver: Option<usize>,
    /// The only response (index) that it bears on, likewise.
    pub response: Option<usize>,
}

impl Parameter {
    /// A parameter of all bands.
    pub fn new(
        name: impl Into<String>,
        unit: impl Into<Cow<'static, str>>,
        neutral: f64,
        prior_sd: f64,
        bounds: (f64, f64),
    ) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            neutral,
            prior_sd,
            bounds,
            has_floor: false,
            has_ceiling: false,
            typical: neutral,
            band: None,
            receiver: None,
            response: None,
        }
    }

    /// The same, with the value at which its signature is plain.
    #[must_use]
    pub fn typically(self, typical: f64) -> Self {
        Self { typical, ..self }
    }

    /// The same, its least value being a floor.
    #[must_use]
    pub fn with_floor(self) -> Self {
        Self { has_floor: true, ..self }
    }

    /// The same, its greatest value being a ceiling.
    #[must_use]
    pub fn with_ceiling(self) -> Self {
        Self { has_ceiling: true, ..self }
    }

    /// Whether a value lies at an end of the range beyond which more of the effect may be there.
    pub(crate) fn may_go_on(&self, value: f64) -> bool {
        let low = value <= self.bounds.0 && !self.has_floor;
        let high = value >= self.bounds.1 && !self.has_ceiling;
        (low || high) && value != self.neutral
    }

    /// The same, for one band alone, whose nominal centre is added to the name.
    #[must_use]
    pub fn in_band(self, band: usize, survey: &Survey) -> Self {
        let name = format!("{}_{}_hz", self.name, survey.bands().nominal_hz(band));
        Self { name, band: Some(band), ..self }
    }

    /// The same, for one receiver (index) alone, whose name is added.
    #[must_use]
    pub fn of_receiver(self, receiver: usize, survey: &Survey) -> Self {
        let name = format!("{}_{}", self.name, survey.receivers()[receiver].id);
        Self { name, receiver: Some(receiver), ..self }
    }

    /// The same, for one response (index) alone, whose name is added.
    #[must_use]
    pub fn of_response(self, response: usize, survey: &Survey) -> Self {
        let name = format!("{}_{}", self.name, survey.responses()[response].name);
        Self { name, response: Some(response), ..self }
    }

    /// Whether it bears on a part of the data alone.
    pub(crate) fn is_local(&self) -> bool {
        self.receiver.is_some() || self.response.is_some()
    }
}

/// Nuisance parameter. Fitted under its prior in every model; an effect may relax that prior.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Nuisance {
    /// Absorption of a material (index) in all bands; standard deviation as a share of energy.
    Absorption(usize),
    /// Place of a source (index); metres along each axis.
    SourcePosition(usize),
    /// Place of a receiver (index); metres along each axis.
    ReceiverPosition(usize),
    /// Gain of a response (index) in all bands; dB.
    ResponseGain(usize),
}

/// What part of the data a case bears on. They are fitted separately: no case needs several at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Observable {
    /// Energy over time in octaves.
    Decay,
    /// Arrival times of the direct sound and of early reflections.
    Arrivals,
    /// Which response is which, or its sign: both of the above and polarity.
    Channels,
    /// What comes before the direct sound.
    PreArrival,
}

impl Observable {
    /// Whether a case that bears on this takes part in the fit of decays or of arrivals.
    pub(crate) fn concerns(self, fit: Self) -> bool {
        self == fit || self == Self::Channels
    }
}

/// Where in the chain from loudspeaker to file an effect sits: earlier ones are applied first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Source, surfaces and air.
    Room,
    /// Sound that joins from elsewhere.
    Added,
    /// Loudspeaker and microphone response.
    Transducer,
    /// Noise.
    Noise,
    /// What the recorder cuts.
    Recorder,
}

/// A named physical cause: an entry of the catalogue.
///
/// To add one, implement this and the trait of its [`Term`], and hand it to
/// [`Diagnoser::with_effects`](crate::Diagnoser::with_effects) beside [`catalogue`](crate::catalogue).
pub trait Effect: Send + Sync {
    /// Identifier, title, explanation, and the measurement that tells it apart from others.
    fn info(&self) -> EffectInfo;

    /// Its identifier.
    fn id(&self) -> Cow<'static, str> {
        self.info().id
    }

    /// The cases in which it may occur: one for each receiver, material, response ..., or a single one. None if it cannot occur here.
    fn cases(&self, survey: &Survey) -> Vec<Case>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_or_a_ceiling_is_no_end_of_a_range() {
        let open = Parameter::new("share", "", 1.0, 0.5, (0.1, 2.0));
        assert!(open.may_go_on(0.1) && open.may_go_on(2.0) && !open.may_go_on(1.5));
        let floored = open.clone().with_floor();
        assert!(!floored.may_go_on(0.1) && floored.may_go_on(2.0));
        let closed = open.with_ceiling();
        assert!(closed.may_go_on(0.1) && !closed.may_go_on(2.0));
        // Nothing is found at the neutral value, wherever it lies.
        assert!(!Parameter::new("level", "dB", -90.0, 30.0, (-90.0, 0.0)).may_go_on(-90.0));
    }
}
