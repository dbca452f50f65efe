//! An effect with its subject, as data.

use crate::effect::fitted_case::FittedCase;
use crate::effect::term::{ArrivalTerm, ChannelChange, DecayTerm, PreArrivalTerm, ReflectionTerm, Term};
use crate::effect::{Nuisance, Observable, Parameter, Stage};
use crate::extend::model_change::ModelChange;
use std::fmt;

/// What a case changes in the model, given how it was fitted.
type Changes = Box<dyn Fn(&FittedCase<'_>) -> Vec<ModelChange> + Send + Sync>;

/// An effect with its subject: "this receiver stands elsewhere". Its parameters are fitted with everything else left open.
///
/// ```
/// use sabine_diagnose::{BandView, Case, DecayTerm, Parameter, Stage};
/// struct Gain;
/// impl DecayTerm for Gain {
///     fn apply(&self, values: &[f64], _: &BandView<'_>, ln_energy: &mut [f64]) {
///         ln_energy.iter_mut().for_each(|ln| *ln += values[0]);
///     }
/// }
/// let gain = Parameter::new("gain", "Np", 0.0, 0.5, (-3.0, 3.0));
/// let case = Case::decay(vec![gain], Gain).at(Stage::Transducer).starting(vec![vec![-0.5], vec![0.5]]);
/// assert_eq!((case.parameters.len(), case.starts.len()), (1, 2));
/// ```
pub struct Case {
    /// What it concerns, by name, where the effect has several cases.
    pub subject: Option<String>,
    /// Parameters.
    pub parameters: Vec<Parameter>,
    /// Values from which the fit starts; the best result counts. The neutral values unless [`Case::starting`] names others.
    pub starts: Vec<Vec<f64>>,
    /// Priors that it relaxes, with their new standard deviation.
    pub relaxes: Vec<(Nuisance, f64)>,
    /// Its place in the chain from loudspeaker to file.
    pub stage: Stage,
    /// What it does to a prediction.
    pub term: Term,
    /// Which of the tables of a diagnosis are its own.
    pub(crate) slot: Option<usize>,
    changes: Option<Changes>,
}

impl fmt::Debug for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Case").field("subject", &self.subject).field("parameters", &self.parameters).finish()
    }
}

impl Case {
    fn new(parameters: Vec<Parameter>, term: Term) -> Self {
        Self {
            subject: None,
            starts: vec![parameters.iter().map(|p| p.neutral).collect()],
            parameters,
            relaxes: Vec::new(),
            stage: Stage::Room,
            term,
            slot: None,
            changes: None,
        }
    }

    /// Changes predicted energies.
    pub fn decay(parameters: Vec<Parameter>, term: impl DecayTerm + 'static) -> Self {
        Self::new(parameters, Term::Decay(Box::new(term)))
    }

    /// Moves arrivals.
    pub fn arrivals(parameters: Vec<Parameter>, term: impl ArrivalTerm + 'static) -> Self {
        Self::new(parameters, Term::Arrivals(Box::new(term)))
    }

    /// Adds a reflection that the mesh does not have.
    pub fn reflection(parameters: Vec<Parameter>, term: impl ReflectionTerm + 'static) -> Self {
        Self::new(parameters, Term::Reflection(Box::new(term)))
    }

    /// Exchanges or inverts channels.
    pub fn channels(change: ChannelChange) -> Self {
        Self::new(Vec::new(), Term::Channels(change))
    }

    /// Shows before the direct sound.
    pub fn pre_arrival(parameters: Vec<Parameter>, term: impl PreArrivalTerm + 'static) -> Self {
        Self::new(parameters, Term::PreArrival(Box::new(term)))
    }

    /// Relaxes one prior and does nothing else; more with [`Case::relaxing`].
    pub fn prior(nuisance: Nuisance, sd: f64) -> Self {
        Self::new(Vec::new(), Term::PriorOnly).relaxing(nuisance, sd)
    }

    /// The same, with what it concerns.
    #[must_use]
    pub fn about(self, subject: impl Into<String>) -> Self {
        Self { subject: Some(subject.into()), ..self }
    }

    /// The same, with the values from which the fit starts.
    #[must_use]
    pub fn starting(self, starts: Vec<Vec<f64>>) -> Self {
        Self { starts, ..self }
    }

    /// The same, at another place in the chain.
    #[must_use]
    pub fn at(self, stage: Stage) -> Self {
        Self { stage, ..self }
    }

    /// The same, with a prior that it relaxes to this standard deviation.
    #[must_use]
    pub fn relaxing(mut self, nuisance: Nuisance, sd: f64) -> Self {
        self.relaxes.push((nuisance, sd));
        self
    }

    /// The same, with what it changes in the model once it is named: changes of temperature, dimensions and positions are traced again, and
    /// the extended model renders all of them. A case without any is named, not rendered.
    #[must_use]
    pub fn changing(
        self,
        changes: impl Fn(&FittedCase<'_>) -> Vec<ModelChange> + Send + Sync + 'static,
    ) -> Self {
        Self { changes: Some(Box::new(changes)), ..self }
    }

    /// What it changes in the model.
    pub fn model_changes(&self, fitted: &FittedCase<'_>) -> Vec<ModelChange> {
        self.changes.as_ref().map_or_else(Vec::new, |changes| changes(fitted))
    }

    /// The data that it bears on.
    pub(crate) fn observable(&self) -> Observable {
        match self.term {
            Term::Decay(_) => Observable::Decay,
            Term::Arrivals(_) | Term::Reflection(_) => Observable::Arrivals,
            Term::Channels(_) => Observable::Channels,
            Term::PreArrival(_) => Observable::PreArrival,
            // Those of the fit that holds what it relaxes.
            Term::PriorOnly => match self.relaxes.first() {
                Some((Nuisance::SourcePosition(_) | Nuisance::ReceiverPosition(_), _)) => {
                    Observable::Arrivals
                }
                _ => Observable::Decay,
            },
        }
    }

    /// Whether parameters of decays tell of it: they hold neither times and levels, nor what the recorder adds and cuts.
    pub(crate) fn bears_on_tables(&self) -> bool {
        let of_levels = |(nuisance, _): &(Nuisance, f64)| matches!(nuisance, Nuisance::ResponseGain(_));
        self.observable() == Observable::Decay
            && self.stage < Stage::Transducer
            && !self.relaxes.iter().any(of_levels)
    }

    /// Whether it does not believe the tables of several materials: beside it every other cause is judged by tables that may be anything.
    pub(crate) fn opens_several_tables(&self) -> bool {
        self.relaxes.iter().filter(|(nuisance, _)| matches!(nuisance, Nuisance::Absorption(_))).count() > 1
    }

    /// Whether another case relaxes all that this one does, and more: it says the same less precisely.
    pub(crate) fn is_part_of(&self, other: &Self) -> bool {
        let alone = |case: &Self| matches!(case.term, Term::PriorOnly);
        let within = |(nuisance, _): &(Nuisance, f64)| other.relaxes.iter().any(|(n, _)| n == nuisance);
        alone(self)
            && alone(other)
            && self.relaxes.len() < other.relaxes.len()
            && self.relaxes.iter().all(within)
    }

    pub(crate) fn decay_term(&self) -> Option<&dyn DecayTerm> {
        if let Term::Decay(term) = &self.term { Some(&**term) } else { None }
    }

    pub(crate) fn arrival_term(&self) -> Option<&dyn ArrivalTerm> {
        if let Term::Arrivals(term) = &self.term { Some(&**term) } else { None }
    }

    pub(crate) fn reflection_term(&self) -> Option<&dyn ReflectionTerm> {
        if let Term::Reflection(term) = &self.term { Some(&**term) } else { None }
    }

    pub(crate) fn channel_change(&self) -> Option<ChannelChange> {
        if let Term::Channels(change) = self.term { Some(change) } else { None }
    }

    pub(crate) fn pre_arrival_term(&self) -> Option<&dyn PreArrivalTerm> {
        if let Term::PreArrival(term) = &self.term { Some(&**term) } else { None }
    }
}
