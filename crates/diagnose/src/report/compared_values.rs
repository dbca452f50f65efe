//! Values of tables of parameters beside what is predicted.

use crate::infer::baseline::Baseline;
use crate::infer::prediction::Compared;
use serde::{Deserialize, Serialize};

/// A value of a table of parameters beside what is predicted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ComparedValue {
    /// Source and receiver, by name.
    pub pair: String,
    /// Nominal octave centre.
    pub band_hz: f64,
    /// The parameter by its symbol: `T30`, `C80`.
    pub parameter: String,
    /// As the table states it, in the unit of [`ParameterKind`](sabine_acoustics::ParameterKind).
    pub measured: f64,
    /// As predicted before.
    pub before: f64,
    /// As predicted after.
    pub after: f64,
    /// Predicted less measured in just-noticeable differences, before.
    pub jnd_before: f64,
    /// The same after.
    pub jnd_after: f64,
    /// Whether this pair was predicted from others alone.
    pub held_out: bool,
}

/// What tables state, and what is predicted before and after.
pub(crate) fn compared_values(
    baseline: &Baseline,
    before: &[Compared],
    after: &[Compared],
    held_out: bool,
) -> Vec<ComparedValue> {
    let survey = baseline.survey();
    let octave = |(before, after): (&Compared, &Compared)| -> Vec<ComparedValue> {
        let one = |((kind, measured, before_value), (_, _, after_value))| ComparedValue {
            pair: survey.responses[before.pair].name.clone(),
            band_hz: survey.bands.nominal_hz(before.band),
            parameter: sabine_acoustics::ParameterKind::symbol(kind).to_owned(),
            measured,
            before: before_value,
            after: after_value,
            jnd_before: kind.in_jnd(before_value, measured),
            jnd_after: kind.in_jnd(after_value, measured),
            held_out,
        };
        before.values().zip(after.values()).map(one).collect()
    };
    before.iter().zip(after).flat_map(octave).collect()
}
