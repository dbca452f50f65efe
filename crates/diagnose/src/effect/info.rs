//! What an effect says of itself.

use crate::effect::next_measurement::NextMeasurement;
use std::borrow::Cow;

/// Identifier, title and texts of an effect: everything that reports show of it.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectInfo {
    /// Identifier in the catalogue.
    pub id: Cow<'static, str>,
    /// Title in reports.
    pub title: Cow<'static, str>,
    /// One sentence for people: what is the matter.
    pub explanation: Cow<'static, str>,
    /// Measurements that tell it apart from single other effects, by their identifiers.
    pub against: &'static [(&'static str, NextMeasurement)],
    /// The measurement that tells it apart from all others, with a rank: of two effects the one with the lower rank decides.
    pub next_measurement: Option<(u8, NextMeasurement)>,
}

impl EffectInfo {
    /// An effect without advice on further measurements.
    pub fn new(
        id: impl Into<Cow<'static, str>>,
        title: impl Into<Cow<'static, str>>,
        explanation: impl Into<Cow<'static, str>>,
    ) -> Self {
        let (id, title, explanation) = (id.into(), title.into(), explanation.into());
        Self { id, title, explanation, against: &[], next_measurement: None }
    }

    /// The same, with measurements that tell it apart from single other effects.
    #[must_use]
    pub fn against(self, against: &'static [(&'static str, NextMeasurement)]) -> Self {
        Self { against, ..self }
    }

    /// The same, with the measurement that tells it apart from any other effect; of two effects the one with the lower rank decides.
    #[must_use]
    pub fn decided_by(self, rank: u8, measurement: NextMeasurement) -> Self {
        Self { next_measurement: Some((rank, measurement)), ..self }
    }
}

/// What would tell two effects apart: what one of them names against the other, or else what the one with the lower rank asks for.
///
/// ```
/// use sabine_diagnose::{Effect, NextMeasurement, SamplingClock, SoundSpeed, discriminating_measurement};
/// let (clock, air) = (SamplingClock.info(), SoundSpeed.info());
/// assert_eq!(discriminating_measurement(&clock, &air), NextMeasurement::ClockOrThermometer);
/// assert_eq!(discriminating_measurement(&air, &clock), NextMeasurement::ClockOrThermometer);
/// ```
pub fn discriminating_measurement(a: &EffectInfo, b: &EffectInfo) -> NextMeasurement {
    let named = |one: &EffectInfo, other: &EffectInfo| {
        one.against.iter().find(|(id, _)| *id == other.id).map(|(_, measurement)| *measurement)
    };
    let ranked = || a.next_measurement.into_iter().chain(b.next_measurement).min_by_key(|(rank, _)| *rank);
    named(a, b)
        .or_else(|| named(b, a))
        .or_else(|| ranked().map(|(_, measurement)| measurement))
        .unwrap_or(NextMeasurement::MorePositionsAndSource)
}
