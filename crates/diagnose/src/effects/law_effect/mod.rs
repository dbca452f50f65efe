//! A law as a cause: a formula that somebody wrote, weighed beside the catalogue.

mod added_law;
mod delay_law;
mod edges;
mod free_parameters;
mod path_classes;
mod sketched_law;
pub(super) mod tabulated_law;

use crate::effect::{Case, DecayTerm, Effect, EffectInfo, FittedCase, Stage};
use crate::error::Error;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use added_law::AddedLaw;
use delay_law::{DelayLaw, is_untold};
use free_parameters::{FittedLaw, MAX_FREE};
use sabine_acoustics::Bands;
use sabine_paths::laws::{Law, LawParameter, LawTarget};
use sketched_law::SketchedLaw;
use tabulated_law::TabulatedLaw;

/// Name of the amplitude of a law that has none of its own.
const STRENGTH: &str = "strength";
/// A strength of so much on either side is tried: the law as it was written, half as much again, or turned about.
const STRENGTHS: [f64; 2] = [-1.5, 1.5];

/// A law whose parameters are fitted.
///
/// **Amplitudes** say how strong the law is: the parameter in proportion to which the whole law goes ([`Law::amplitude`]); where there is
/// none, those that have an interval and together make it vanish ([`Law::amplitudes`]: a level and its slope over the octaves); or else a
/// `strength` that multiplies the formula and is 1 where the law holds as it was written. They are sought over their interval and zero, under
/// a normal prior about zero whose 90 % interval reaches to the farther end: a law must speak for itself, however sure its author is. What a
/// law of added sound says is a level: it has no amplitude.
///
/// **Other parameters** that have an interval are fitted, too, within it: a normal prior about its middle holds 90 % between its ends. A
/// parameter whose `low` and `high` are one value stays there. An **edge of bands** (`f0` in `above(frequency_hz, f0)`) changes nothing between
/// the centres of two bands: each of the places that it may have is a case of its own, and the law pays for their number.
///
/// Energies under one amplitude alone are tabulated at nine values on each side and joined by straight lines. Laws of more parameters are
/// evaluated at every step of the fit on classes of paths in each time bin: at most 12 classes of a variable, and laws of reflections at 12
/// angles. Single reflections stay as they are. Laws of delay move arrivals, laws of added sound add energy to each bin.
///
/// ```
/// use sabine_diagnose::{DiagnoseConfig, Diagnoser, LawEffect, Effect};
/// use sabine_paths::laws::{Law, LawParameter, LawTarget};
/// let a = LawParameter::new(3.0, [0.0, 10.0], "dB");
/// let l = LawParameter::new(10.0, [3.0, 30.0], "m");
/// let haze = Law::new("haze", LawTarget::Path, None, "-a * (1 - exp(-length_m / l))", [("a", a), ("l", l)])?;
/// assert_eq!(LawEffect::new(haze.clone())?.id(), "haze");
/// let diagnoser = Diagnoser::new(DiagnoseConfig::default())?.with_laws(vec![haze])?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct LawEffect {
    law: Law,
}

impl LawEffect {
    /// Takes a law.
    ///
    /// # Errors
    /// [`Error::LawNotWeighed`] for a law whose amplitude has no range but zero, for one that has no amplitude and cannot be multiplied by a
    /// `strength`, for a law of added sound without any parameter that has an interval, for more than ten parameters to be fitted, and for a
    /// law of delay that asks for `reflections` or `hits`.
    pub fn new(law: Law) -> Result<Self, Error> {
        let id = law.id().to_owned();
        let refused = |reason: String| Error::LawNotWeighed { id: id.clone(), reason };
        if law.target() == LawTarget::Delay
            && let Some(name) = law.variables().into_iter().find(|name| is_untold(name))
        {
            return Err(refused(format!(
                "`{name}` is not known of the arrivals that are compared: a law of delay with it is rendered, not weighed as a cause"
            )));
        }
        let law = if law.target() == LawTarget::Added || !law.amplitudes().is_empty() {
            law
        } else {
            law.times(STRENGTH, LawParameter::new(1.0, STRENGTHS, "1")).map_err(|error| {
                refused(format!("no parameter says how strong it is, and none can be added: {error}"))
            })?
        };
        let fitted = FittedLaw::new(law.clone());
        let names = fitted.names();
        if names.len() > MAX_FREE {
            return Err(refused(format!(
                "{} parameters have an interval ({}), and at most {MAX_FREE} are fitted: give some of them one value as `low` and `high`",
                names.len(),
                names.join(", ")
            )));
        }
        if names.is_empty() {
            return Err(refused("no parameter has an interval: nothing is left to fit".to_owned()));
        }
        let zero = fitted.ranges().iter().position(|(low, high)| low == high);
        if let Some(name) = zero.map(|i| &names[i]) {
            return Err(refused(format!("the interval of `{name}` is zero alone: nothing is left to fit")));
        }
        Ok(Self { law })
    }

    /// That no effect beside it has the identifier of a law.
    pub(crate) fn check_name(law: &Law, effects: &[Box<dyn Effect>]) -> Result<(), Error> {
        if effects.iter().all(|effect| effect.id() != law.id()) {
            return Ok(());
        }
        let reason = "an effect, or another law, has this identifier".to_owned();
        Err(Error::LawNotWeighed { id: law.id().to_owned(), reason })
    }

    /// That the edges of a law have no more places between these bands than can be weighed.
    pub(crate) fn check_edges(law: &Law, bands: Bands) -> Result<(), Error> {
        edges::check(law, bands).map_err(|count| Error::LawNotWeighed {
            id: law.id().to_owned(),
            reason: format!(
                "its edges of bands have {count} combinations of places, and at most {} are weighed: narrow their intervals",
                edges::MAX_COMBINATIONS
            ),
        })
    }

    /// Takes a law whose edges of bands stay where they are.
    pub(crate) fn with_edges_as_written(law: &Law) -> Result<Self, Error> {
        let one = |(name, p): (&str, &LawParameter)| {
            let interval = if law.is_edge_of_bands(name) { [p.value; 2] } else { [p.low, p.high] };
            (p.value, interval)
        };
        let (values, intervals): (Vec<f64>, Vec<[f64; 2]>) = law.parameters().map(one).unzip();
        let placed = law.with_fitted(&values, &intervals).map_err(|error| Error::Acoustics(error.into()))?;
        Self::new(placed)
    }

    /// The law.
    pub(crate) fn law(&self) -> &Law {
        &self.law
    }

    /// The case in which its edges stand where those of this law do.
    fn case(law: Law, survey: &Survey) -> Case {
        let fitted = FittedLaw::new(law);
        let (mut parameters, starts) = (fitted.parameters(), fitted.starts());
        // What bears on one receiver alone cannot help at others.
        let only = fitted.law.only_receiver();
        let receiver = only.and_then(|id| survey.receivers().iter().position(|own| own.id == id));
        parameters.iter_mut().for_each(|parameter| parameter.receiver = receiver);
        let own = fitted.clone();
        let stage = if fitted.law.target() == LawTarget::Recorder { Stage::Recorder } else { Stage::Room };
        let case = match (fitted.law.target(), fitted.amplitude_alone()) {
            (LawTarget::Delay, _) => Case::arrivals(parameters, DelayLaw(fitted)),
            (LawTarget::Added, _) => {
                let term = AddedLaw(fitted);
                let stage = term.stage();
                Case::decay(parameters, term).at(stage)
            }
            (_, Some(amplitude)) => {
                let range = fitted.ranges()[0];
                Case::decay(parameters, OneAmplitude(TabulatedLaw::new(fitted.law, amplitude, range)))
                    .at(stage)
            }
            _ => Case::decay(parameters, SketchedLaw(fitted)).at(stage),
        };
        case.starting(starts).changing(move |fitted: &FittedCase<'_>| own.changes(fitted))
    }
}

impl Effect for LawEffect {
    fn info(&self) -> EffectInfo {
        let law = &self.law;
        let (printed, words) = (law.printed(), law.words());
        let explanation = if words.is_empty() {
            format!("The law `{printed}` is at work on each {}.", law.target())
        } else {
            words.to_owned()
        };
        EffectInfo::new(law.id().to_owned(), format!("Law {}: {printed}", law.id()), explanation)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let placed = edges::placed(&self.law, survey.bands());
        let one = |placed: edges::PlacedEdges| {
            let case = Self::case(placed.law, survey);
            if placed.words.is_empty() { case } else { case.about(placed.words) }
        };
        placed.into_iter().map(one).collect()
    }
}

/// A law of which one amplitude is fitted and nothing else.
struct OneAmplitude(TabulatedLaw);

impl DecayTerm for OneAmplitude {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        self.0.prepare(room)
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(self.0.by_hand(bins))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        self.0.apply(values[0], view, ln_energy);
    }
}
