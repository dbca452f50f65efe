//! A named physical cause of a misfit, and the cases in which it can come.

pub(crate) mod fitted_case;
pub(crate) mod info;
pub(crate) mod next_measurement;
pub(crate) mod reflection_gate;

pub use fitted_case::FittedCase;
pub use info::EffectInfo;

use crate::effect::reflection_gate::ReflectionGate;
use crate::extend::model_change::ModelChange;
use crate::likelihood::multilateration::UnassignedPeaks;
use crate::observe::pre_arrival::PreArrival;
use crate::report::diagnosis::FoundParameter;
use crate::simulate::views::{ArrivalView, BandView};
use crate::survey::Survey;

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name, with the octave where it belongs to one.
    pub name: String,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// Most probable value before anything is measured; that at which the effect is absent, where there is one.
    pub neutral: f64,
    /// Standard deviation of the prior, a normal distribution about the neutral value.
    pub prior_sd: f64,
    /// Least and greatest value.
    pub bounds: (f64, f64),
    /// A value at which the effect is plain to see: where its signature is compared with those of others.
    pub typical: f64,
    /// The only band that it bears on, where there is one.
    pub band: Option<usize>,
}

impl Parameter {
    /// A parameter of all bands.
    pub fn new(
        name: impl Into<String>,
        unit: &'static str,
        neutral: f64,
        prior_sd: f64,
        bounds: (f64, f64),
    ) -> Self {
        Self { name: name.into(), unit, neutral, prior_sd, bounds, typical: neutral, band: None }
    }

    /// The same, with the value at which its signature is plain.
    #[must_use]
    pub fn typically(self, typical: f64) -> Self {
        Self { typical, ..self }
    }

    /// The same, for one band alone, whose nominal centre is added to the name.
    #[must_use]
    pub fn in_band(self, band: usize, survey: &Survey) -> Self {
        let name = format!("{}_{}_hz", self.name, survey.bands().nominal_hz(band));
        Self { name, band: Some(band), ..self }
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

/// What part of the data an effect bears on. They are fitted separately: no effect needs several at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observable {
    /// Energy over time in octaves.
    Decay,
    /// Arrival times of the direct sound and of early reflections.
    Arrivals,
    /// Which response is which, or its sign: both of the above and polarity.
    Channels,
    /// What comes before the direct sound: [`Case::pre_arrival`] weighs it.
    PreArrival,
}

impl Observable {
    /// Whether a case with this evidence takes part in the fit of decays or of arrivals.
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

/// What single reflections, or the time before the direct sound, say for a cause.
#[derive(Clone, Debug, PartialEq)]
pub struct AuxiliaryEvidence {
    /// Logarithm of how much more probable they are with the cause than without, its parameters summed over.
    pub nats: f64,
    /// Its parameters as they and the fit together give them.
    pub parameters: Vec<FoundParameter>,
}

/// A reflection that the mesh does not have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AddedReflection {
    /// Length of its path in metres.
    pub length_m: f64,
    /// Unit vector in which it leaves the source.
    pub departure: [f64; 3],
    /// Unit vector from the receiver towards where it comes from.
    pub arrival: [f64; 3],
    /// Height of its peak over that of the direct sound, in dB.
    pub level_db: f64,
}

/// A named physical cause: an entry of the catalogue.
///
/// To add one, implement this and [`Case`], and hand it to [`Diagnoser::with_effects`](crate::Diagnoser::with_effects) beside
/// [`catalogue`](crate::catalogue).
pub trait Effect: Send + Sync {
    /// Identifier, title, explanation, and the measurement that tells it apart from others.
    fn info(&self) -> EffectInfo;

    /// Its identifier.
    fn id(&self) -> &'static str {
        self.info().id
    }

    /// The cases in which it may come: one for each receiver, material, response ..., or a single one. None if it cannot be at
    /// work here.
    fn cases(&self, survey: &Survey) -> Vec<Box<dyn Case>>;

    /// Whether its cases look at [`BandView::wave_change`]: waves are not solved if no effect does.
    fn needs_waves(&self) -> bool {
        false
    }
}

/// An effect with its subject: "this receiver stands elsewhere". Its parameters are fitted with everything else left open.
pub trait Case: Send + Sync {
    /// What it concerns, by name, where the effect has several cases.
    fn subject(&self) -> Option<String> {
        None
    }

    /// The data that it bears on.
    fn observable(&self) -> Observable {
        Observable::Decay
    }

    /// Its place in the chain.
    fn stage(&self) -> Stage {
        Stage::Room
    }

    /// Parameters.
    fn parameters(&self, survey: &Survey) -> Vec<Parameter>;

    /// Values to start the fit from; the best end counts.
    fn starts(&self, survey: &Survey) -> Vec<Vec<f64>> {
        vec![self.parameters(survey).iter().map(|p| p.neutral).collect()]
    }

    /// Changes the natural logarithm of the predicted energy in the time bins of one band and pair. Each bin must depend on its own
    /// energy alone.
    fn energy(&self, _values: &[f64], _view: &BandView<'_>, _ln_energy: &mut [f64]) {}

    /// Changes the expected variance of the bins of one band and pair, as a share of their energy squared: it is less where the
    /// case predicts what else is left to chance.
    fn variance(&self, _values: &[f64], _view: &BandView<'_>, _variance: &mut [f64]) {}

    /// Seconds by which an arrival comes later.
    fn delay_s(&self, _values: &[f64], _arrival: &ArrivalView<'_>) -> f64 {
        0.0
    }

    /// A reflection that it adds to a response (index).
    fn added_reflection(
        &self,
        _values: &[f64],
        _survey: &Survey,
        _response: usize,
    ) -> Option<AddedReflection> {
        None
    }

    /// Whether its fit must start from what peaks say: then [`Case::starts_among`] gives the starts.
    fn seeks(&self) -> bool {
        false
    }

    /// Values to start from, given the peaks that nothing predicted explains.
    fn starts_among(&self, _strays: &UnassignedPeaks<'_>) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// Whether single reflections weigh it: then [`Case::among_reflections`] says how much.
    fn weighs_reflections(&self) -> bool {
        false
    }

    /// What single reflections say for it, given its parameters (value and standard deviation) from the fit of the decays.
    fn among_reflections(&self, _own: &[(f64, f64)], _gates: &[ReflectionGate]) -> Option<AuxiliaryEvidence> {
        None
    }

    /// What the responses that count (a flag for each) say for it before their direct sounds, its parameters included.
    fn pre_arrival(&self, _responses: &PreArrival, _used: &[bool]) -> Option<AuxiliaryEvidence> {
        None
    }

    /// Priors that it relaxes, with their new standard deviation.
    fn relaxes(&self) -> Vec<(Nuisance, f64)> {
        Vec::new()
    }

    /// What it changes in the model once it is named: changes of temperature, dimensions and positions are traced again, and the extended
    /// model renders all of them. A case without any is named, not rendered.
    fn model_changes(&self, _fitted: &FittedCase<'_>) -> Vec<ModelChange> {
        Vec::new()
    }

    /// Two responses (indices) that were exchanged.
    fn exchanged(&self) -> Option<(usize, usize)> {
        None
    }

    /// A response (index) whose sign is turned.
    fn inverted(&self) -> Option<usize> {
        None
    }
}
