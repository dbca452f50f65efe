//! A law as a cause: a formula that somebody wrote, weighed beside the catalogue.

pub(super) mod tabulated_law;

use crate::effect::{Case, DecayTerm, Effect, EffectInfo, FittedCase, Parameter, Stage};
use crate::error::Error;
use crate::extend::model_change::ModelChange;
use crate::found_parameter::HALF_90;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_paths::laws::{Law, LawParameter, LawTarget};
use tabulated_law::TabulatedLaw;

/// Name of the amplitude of a law that has none of its own.
const STRENGTH: &str = "strength";
/// A strength of so much on either side is tried: the law as it was written, half as much again, or turned about.
const STRENGTHS: [f64; 2] = [-1.5, 1.5];

/// A law whose amplitude is fitted: the parameter in proportion to which the whole law goes ([`Law::amplitude`]), or else a `strength` that
/// multiplies the formula and is 1 where the law holds as it was written. Other parameters keep the values that were written.
///
/// The amplitude is sought over its interval and zero, under a normal prior about zero whose 90 % interval reaches to the farther end: a law
/// must speak for itself, however sure its author is. Energies of the traced paths are tabulated at six amplitudes on each side and joined
/// by straight lines; single reflections and arrival times stay as they are.
///
/// Laws of paths, reflections and the recorder are weighed. Laws of delay and of added sound are not.
///
/// ```
/// use sabine_diagnose::{DiagnoseConfig, Diagnoser, LawEffect, Effect};
/// use sabine_paths::laws::{Law, LawParameter, LawTarget};
/// let a = LawParameter::new(0.1, [0.0, 0.4], "dB/m");
/// let fog = Law::new("fog", LawTarget::Path, None, "-a * length_m", [("a", a)])?;
/// assert_eq!(LawEffect::new(fog.clone())?.id(), "fog");
/// let diagnoser = Diagnoser::new(DiagnoseConfig::default())?.with_laws(vec![fog])?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct LawEffect {
    law: TabulatedLaw,
    /// Name and unit of its amplitude.
    name: String,
    unit: String,
}

impl LawEffect {
    /// Takes a law.
    ///
    /// # Errors
    /// [`Error::LawNotWeighed`] for a law of delay or of added sound, for one whose amplitude has no range but zero, and for one that has no
    /// amplitude and cannot be multiplied by a `strength`.
    pub fn new(law: Law) -> Result<Self, Error> {
        let id = law.id().to_owned();
        let refused = |reason: String| Error::LawNotWeighed { id: id.clone(), reason };
        match law.target() {
            LawTarget::Path | LawTarget::Reflection | LawTarget::Recorder => {}
            other => {
                return Err(refused(format!(
                    "a law of target `{other}` is rendered, not weighed as a cause"
                )));
            }
        }
        let strengthened = || law.times(STRENGTH, LawParameter::new(1.0, STRENGTHS, "1"));
        let law = if law.amplitude().is_some() {
            law
        } else {
            strengthened().map_err(|error| {
                refused(format!("no parameter says how strong it is, and none can be added: {error}"))
            })?
        };
        let named = law.parameters().enumerate().find(|(_, (name, _))| Some(*name) == law.amplitude());
        let Some((amplitude, (name, parameter))) = named else {
            return Err(refused("no parameter says how strong it is".to_owned()));
        };
        let (low, high) = (parameter.low.min(0.0), parameter.high.max(0.0));
        if low == high {
            return Err(refused(format!("the interval of `{name}` is zero alone: nothing is left to fit")));
        }
        let (name, unit) =
            (name.to_owned(), if parameter.unit == "1" { "" } else { &parameter.unit }.to_owned());
        Ok(Self { law: TabulatedLaw::new(law, amplitude, (low, high)), name, unit })
    }
}

impl Effect for LawEffect {
    fn info(&self) -> EffectInfo {
        let law = &self.law.law;
        let (printed, words) = (law.printed(), law.words());
        let explanation = if words.is_empty() {
            format!("The law `{printed}` is at work on each {}.", law.target())
        } else {
            words.to_owned()
        };
        EffectInfo::new(law.id().to_owned(), format!("Law {}: {printed}", law.id()), explanation)
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let (low, high) = self.law.range();
        let farther = if -low > high { low } else { high };
        let amplitude =
            Parameter::new(self.name.clone(), self.unit.clone(), 0.0, farther.abs() / HALF_90, (low, high));
        let starts = [0.1 * farther, 0.6 * farther].map(|start| vec![start]).to_vec();
        let own = self.law.clone();
        let changes = move |fitted: &FittedCase<'_>| {
            let value = fitted.values()[0];
            // What was fitted lies in its interval.
            own.at(value, fitted.interval(0))
                .map_or_else(|_| Vec::new(), |law| vec![ModelChange::Law(Box::new(law))])
        };
        let stage = if self.law.law.target() == LawTarget::Recorder { Stage::Recorder } else { Stage::Room };
        let case = Case::decay(vec![amplitude.typically(0.5 * farther)], self.clone());
        vec![case.at(stage).starting(starts).changing(changes)]
    }
}

impl DecayTerm for LawEffect {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        self.law.prepare(room)
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(self.law.by_hand(bins))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        self.law.apply(values[0], view, ln_energy);
    }
}
