//! `receiver_directivity`: the microphones are more sensitive in some directions than in others.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, FittedCase, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::{Place, Survey};

/// A pattern of first order, 1 - d + d cos(angle to the axis): 0 is omnidirectional, 0.5 a cardioid. Sensitivity in a diffuse field as
/// without it. One pattern for all microphones, its share rising or falling by a factor an octave, or one for each, the same in all
/// octaves. Axes are those of the room file; where it does not state all of them, one axis for all or one for each is fitted: then the
/// parameters are the components of a vector along the axis, as long as the share.
///
/// Mark: residuals of the direct sound and of early reflections that follow the angle at which they arrive, of late sound none.
/// Mimicked by: a directional source, where all microphones lie on one side of it; gains of single channels, which lift all bins.
/// Turning the microphones tells them apart.
///
/// Source: first-order patterns as in Eargle, The Microphone Book, 2nd ed., 2004, chapter 4.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReceiverDirectivity;

const MAX_SHARE: f64 = 0.9;
/// Standard deviation of a share, and of each component of a vector whose length is a share.
const SHARE_SD: f64 = 0.3;
const COMPONENT_SD: f64 = 0.25;
/// Standard deviation of the logarithm of the share's factor per octave.
const LN_PER_OCTAVE_SD: f64 = 0.15;
/// Share from which a fit starts.
const START: f64 = 0.4;

impl Effect for ReceiverDirectivity {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "receiver_directivity",
            "Directional microphone",
            "The microphones are more sensitive to sound from the front than from the sides.",
        )
        .decided_by(15, NextMeasurement::Other("Turn the microphones by 90 degrees and measure again."))
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let axes: Option<Vec<[f64; 3]>> = survey.receivers().iter().map(|r| r.axis).collect();
        let patterns = match axes {
            Some(axes) => [Pattern::OnAxes(axes.clone()), Pattern::OnAxesEach(axes)],
            None => [Pattern::OneVector, Pattern::VectorEach],
        };
        let several = survey.receivers().len() > 1;
        patterns.into_iter().take(if several { 2 } else { 1 }).map(|pattern| pattern.case(survey)).collect()
    }
}

/// How the vector of each microphone follows from the parameters.
#[derive(Clone)]
enum Pattern {
    /// One share, along the axis of each.
    OnAxes(Vec<[f64; 3]>),
    /// A share for each, along its axis.
    OnAxesEach(Vec<[f64; 3]>),
    /// One vector.
    OneVector,
    /// A vector for each.
    VectorEach,
}

impl Pattern {
    fn case(self, survey: &Survey) -> Case {
        let share = Parameter::new("directed_share", "", 0.0, SHARE_SD, (0.0, MAX_SHARE)).typically(START);
        let component = |axis: &str| {
            Parameter::new(format!("directed_{axis}"), "", 0.0, COMPONENT_SD, (-MAX_SHARE, MAX_SHARE))
                .typically(START)
        };
        let per_octave = Parameter::new("ln_per_octave", "", 0.0, LN_PER_OCTAVE_SD, (-0.5, 0.5));
        let vector = ["x", "y", "z"].map(component);
        let receivers = 0..survey.receivers().len();
        let (parameters, starts): (Vec<Parameter>, Vec<Vec<f64>>) = match &self {
            Self::OnAxes(_) => (vec![share, per_octave], vec![vec![START, 0.0]]),
            Self::OnAxesEach(axes) => (
                receivers.map(|r| share.clone().of_receiver(r, survey)).collect(),
                vec![vec![START; axes.len()]],
            ),
            Self::OneVector => {
                let towards = |k: usize, sign: f64| {
                    let mut start = vec![0.0; 4];
                    start[k] = sign * START;
                    start
                };
                let starts = (0..3).flat_map(|k| [towards(k, 1.0), towards(k, -1.0)]).collect();
                (vector.into_iter().chain([per_octave]).collect(), starts)
            }
            // Each response pulls its microphone's vector from nothing to where it points.
            Self::VectorEach => (
                receivers.flat_map(|r| vector.clone().map(|p| p.of_receiver(r, survey))).collect(),
                vec![vec![0.0; 3 * survey.receivers().len()]],
            ),
        };
        // Without a subject: patterns exclude each other, and the effect is named once.
        let pattern = self.clone();
        Case::decay(parameters, self).starting(starts).changing(move |fitted| vec![pattern.change(fitted)])
    }

    /// The directed share times the axis of a receiver's microphone.
    fn vector(&self, values: &[f64], receiver: usize, octaves: f64) -> [f64; 3] {
        let along = |axis: [f64; 3], share: f64| axis.map(|c| share * c);
        let vector = match self {
            Self::OnAxes(axes) => along(axes[receiver], values[0] * (values[1] * octaves).exp()),
            Self::OnAxesEach(axes) => along(axes[receiver], values[receiver]),
            Self::OneVector => along([values[0], values[1], values[2]], (values[3] * octaves).exp()),
            Self::VectorEach => std::array::from_fn(|k| values[3 * receiver + k]),
        };
        let share = length(vector);
        if share > MAX_SHARE { along(vector, MAX_SHARE / share) } else { vector }
    }

    fn change(&self, fitted: &FittedCase<'_>) -> ModelChange {
        let survey = fitted.survey();
        let vector = |r: usize, b: usize| self.vector(fitted.values(), r, survey.octaves_from_1khz(b));
        let receivers = || survey.receivers().iter().enumerate();
        let share =
            |(r, place): (usize, &Place)| (place.id.clone(), fitted.per_band(|b| length(vector(r, b))));
        let axis = |(r, place): (usize, &Place)| {
            let found = vector(r, 0);
            let length = length(found);
            // One that hears alike in all directions looks anywhere.
            let axis = if length > 1e-9 { found.map(|c| c / length) } else { [1.0, 0.0, 0.0] };
            (place.id.clone(), axis)
        };
        ModelChange::ReceiverPattern {
            directed_share: receivers().map(share).collect(),
            axis: receivers().map(axis).collect(),
        }
    }
}

fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|c| c * c).sum::<f64>().sqrt()
}

impl DecayTerm for Pattern {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let octaves = view.survey().octaves_from_1khz(view.band());
        let v = self.vector(values, view.pair().receiver, octaves);
        let d = length(v);
        if d == 0.0 {
            return;
        }
        let q = 1.0 - d;
        let diffuse = q * q + d * d / 3.0;
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            let (mean, [xx, yy, zz, xy, xz, yz]) = view.arrivals(bin);
            let along: f64 = mean.iter().zip(v).map(|(m, c)| m * c).sum();
            let [x, y, z] = v;
            let squared = x * x * xx + y * y * yy + z * z * zz + 2.0 * (x * y * xy + x * z * xz + y * z * yz);
            *l += ((q * q + 2.0 * q * along + squared) / diffuse).max(1e-4).ln();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vector_is_as_long_as_the_share_and_no_longer_than_allowed() {
        let stated = Pattern::OnAxes(vec![[0.0, 0.0, 1.0]]);
        assert_eq!(stated.vector(&[0.4, 0.0], 0, -2.0), [0.0, 0.0, 0.4]);
        let rising = stated.vector(&[0.4, 0.2], 0, 1.0)[2];
        assert!((rising - 0.4 * 0.2f64.exp()).abs() < 1e-12);
        let long = Pattern::VectorEach.vector(&[0.0, 0.0, 0.0, 0.8, -0.8, 0.0], 1, 0.0);
        assert!((length(long) - MAX_SHARE).abs() < 1e-12 && long[0] == -long[1]);
    }
}
