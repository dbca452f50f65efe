//! `truncation`: the responses were cut off before they had died away.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, Parameter, Stage};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::statistics::median;
use crate::survey::Survey;

/// The end of all responses in the time of the file, after a raised-cosine fade; nothing follows.
///
/// Mark: decays steepen towards one instant that is the same in all octaves and responses. Mimicked by: subtraction of noise.
///
/// Source: ISO 18233:2006, annex B, on windows after deconvolution.
#[derive(Clone, Copy, Debug, Default)]
pub struct Truncation;

/// Energy that a cut leaves: rounding.
const LEFT: f64 = 1e-9;
/// Points within a bin at which the fade is averaged.
const POINTS: usize = 4;

/// Distance of the ends from which a fit starts, in seconds.
const START_S: f64 = 0.02;

impl Effect for Truncation {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "truncation",
            "Responses cut off early",
            "The responses were faded out or cut off before the sound had decayed.",
        )
        .decided_by(2, NextMeasurement::LongerWithSilence)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let longest_s = longest_s(survey);
        // What sounds on has not ended. Half of the responses decide: a door may slam in any of them.
        let sounds_until_s = median(survey.responses().iter().map(|r| r.sounds_until_s).collect());
        let earliest_s = sounds_until_s.max(0.02).min(longest_s);
        let parameters = vec![
            Parameter::new("end", "s", 1.2 * longest_s, 0.6 * longest_s, (earliest_s, 2.0 * longest_s))
                .typically(0.4 * longest_s),
            Parameter::new("fade", "s", 0.03, 0.05, (0.002, 0.5)),
        ];
        let starts = starts(earliest_s, longest_s);
        let case = Case::decay(parameters, *self).at(Stage::Recorder).starting(starts);
        vec![case.changing(|fitted| vec![ModelChange::Truncation([fitted.values()[0], fitted.values()[1]])])]
    }
}

fn longest_s(survey: &Survey) -> f64 {
    survey.responses().iter().map(|r| r.duration_s).fold(0.0, f64::max)
}

/// An end beyond what is compared changes nothing, and one before the true end silences what was measured: only close starts lead there.
fn starts(earliest_s: f64, longest_s: f64) -> Vec<Vec<f64>> {
    let steps = (((longest_s - earliest_s) / START_S) as usize).clamp(8, 120);
    let end_s = |k: usize| earliest_s + k as f64 / steps as f64 * (longest_s - earliest_s);
    (0..steps).map(|k| vec![end_s(k), 0.03]).collect()
}

impl DecayTerm for Truncation {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let (end_s, fade_s) = (values[0], values[1]);
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            let middle_s = view.file_time_s(bin);
            let mean: f64 = (0..POINTS)
                .map(|i| {
                    let time_s = middle_s + ((i as f64 + 0.5) / POINTS as f64 - 0.5) * view.bin_s();
                    let share = ((end_s - time_s) / fade_s).clamp(0.0, 1.0);
                    (0.5 - 0.5 * (std::f64::consts::PI * share).cos()).powi(2)
                })
                .sum::<f64>()
                / POINTS as f64;
            *l += (mean + LEFT).ln();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn what_most_responses_sound_beyond_is_no_end() {
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        for (response, until_s) in survey.responses.iter_mut().zip([0.2, 0.18, 0.39]) {
            response.sounds_until_s = until_s;
        }
        let case = &Truncation.cases(&survey)[0];
        let (low, high) = case.parameters[0].bounds;
        assert!((low - 0.2).abs() < 1e-9 && high > 0.4, "{low} {high}");
        assert!(case.starts.iter().all(|start| (low..0.4).contains(&start[0])));
    }
}
