//! What drifts from recording to recording, where the room file says in which order they were taken.

use crate::infer::baseline::Baseline;
use crate::infer::search::State;
use crate::statistics::{median, student_tail};
use crate::survey::{LEAST_RECORDINGS, Survey};
use sabine_scene::{Levels, TimeZero};

/// Levels and times: the probability that a trend asks for is shared by both.
const TRENDS: f64 = 2.0;

/// A straight line through values over time.
#[derive(Clone, Copy, Debug)]
struct Trend {
    /// Change from the first recording to the last.
    change: f64,
    /// Probability of a slope as steep where there is none.
    p_value: f64,
}

/// Notes on levels and on travel times that rise or fall with the time of recording.
pub(crate) fn notes(baseline: &Baseline, state: &State) -> Vec<String> {
    let (survey, layout) = (baseline.survey(), baseline.decay_layout());
    let gains_db: Vec<f64> = (0..baseline.pairs()).map(|i| state.energy.values[layout.gain(i)]).collect();
    let arrived_s: Vec<f64> = baseline.observations.measured.iter().map(|m| m.direct_s).collect();
    told(survey, &gains_db, &arrived_s, &baseline.simulation.direct_s, baseline.config.significance)
}

/// The same of gains, and of measured and predicted times of the direct sounds, by response.
fn told(
    survey: &Survey,
    gains_db: &[f64],
    arrived_s: &[f64],
    direct_s: &[f64],
    significance: f64,
) -> Vec<String> {
    let timed: Vec<(usize, f64)> =
        survey.responses.iter().enumerate().filter_map(|(i, r)| Some((i, r.recorded_at?))).collect();
    let trend = |value: &dyn Fn(usize) -> f64| {
        let points: Vec<(f64, f64)> = timed.iter().map(|&(i, time)| (time, value(i))).collect();
        trend(&points).filter(|t| t.p_value < significance / TRENDS)
    };
    let mut notes = Vec::new();
    if survey.measurement.levels != Levels::PerResponse
        && let Some(Trend { change, p_value }) = trend(&|i| gains_db[i])
    {
        notes.push(format!(
            "Levels change by {change:+.1} dB from the first recording to the last (p = {p_value:.1e}): the equipment drifted, or \
             something changed with the places in the order of recording."
        ));
    }
    if survey.measurement.time_zero != TimeZero::PerResponse {
        let late_s: Vec<f64> = arrived_s.iter().zip(direct_s).map(|(a, d)| a - d).collect();
        let latency_s = match survey.measurement.time_zero {
            TimeZero::Common => median(late_s.clone()),
            _ => 0.0,
        };
        let percent = |i: usize| 100.0 * (late_s[i] - latency_s) / direct_s[i];
        if let Some(Trend { change, p_value }) = trend(&percent) {
            notes.push(format!(
                "Travel times of the direct sound change by {change:+.2} % from the first recording to the last (p = {p_value:.1e}): 1 % \
                 is a change of the air by 6 degrees, or of the clock by as much."
            ));
        }
    }
    notes
}

/// The least-squares line through points (time, value); none through few or without a spread of times.
fn trend(points: &[(f64, f64)]) -> Option<Trend> {
    if points.len() < LEAST_RECORDINGS {
        return None;
    }
    let n = points.len() as f64;
    let mean = |part: fn(&(f64, f64)) -> f64| points.iter().map(part).sum::<f64>() / n;
    let (time, value) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |product: &dyn Fn(f64, f64) -> f64| -> f64 {
        points.iter().map(|p| product(p.0 - time, p.1 - value)).sum()
    };
    let (times, both) = (sum(&|t, _| t * t), sum(&|t, v| t * v));
    let span = |fold: fn(f64, f64) -> f64, from: f64| points.iter().map(|p| p.0).fold(from, fold);
    let duration = span(f64::max, f64::NEG_INFINITY) - span(f64::min, f64::INFINITY);
    if times <= 0.0 || !duration.is_finite() {
        return None;
    }
    let slope = both / times;
    let left = sum(&|t, v| (v - slope * t).powi(2));
    let error = (left / (n - 2.0) / times).sqrt();
    let p_value = match slope.abs() {
        0.0 => 1.0,
        steep => 2.0 * student_tail(steep / error.max(f64::MIN_POSITIVE), points.len() - 2),
    };
    Some(Trend { change: slope * duration, p_value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made;
    use sabine_scene::Measurement;

    #[test]
    fn a_line_has_the_change_and_the_probability_of_the_textbook() {
        // The figures are those of scipy.stats.linregress 1.17.1 on these points.
        let points = [(1.0, 2.0), (2.0, 4.1), (3.0, 5.6), (4.0, 8.1), (5.0, 9.8), (6.0, 11.3)];
        let found = trend(&points).expect("a trend");
        assert!((found.change - 5.0 * 1.888_571_428_6).abs() < 1e-9, "{found:?}");
        assert!((found.p_value / 8.090_623_401e-6 - 1.0).abs() < 1e-6, "{found:?}");
        let flat = [(1.0, 1.0), (2.0, -1.0), (3.0, 1.0), (4.0, -1.0), (5.0, 1.0), (6.0, 0.0)];
        let found = trend(&flat).expect("a trend");
        assert!((found.change + 5.0 * 0.028_571_428_6).abs() < 1e-9, "{found:?}");
        assert!((found.p_value - 0.918_531_301_6).abs() < 1e-9, "{found:?}");
        assert!(trend(&points[..5]).is_none(), "too few");
        assert!(trend(&[(2.0, 1.0); 8]).is_none(), "all at one time");
    }

    #[test]
    fn what_drifts_is_told_where_the_order_of_recording_is_stated() {
        let mut survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        survey.responses = [survey.responses.clone(), survey.responses.clone()].concat();
        let direct_s: Vec<f64> = survey.responses.iter().map(|r| r.direct_s).collect();
        let rising = |step: f64| (0..6).map(|i| step * f64::from(i)).collect::<Vec<f64>>();
        let later_s: Vec<f64> =
            direct_s.iter().zip(rising(1e-3)).map(|(d, share)| d * (1.0 + share)).collect();
        let of =
            |survey: &Survey, gains: &[f64], arrived: &[f64]| told(survey, gains, arrived, &direct_s, 0.01);
        assert!(of(&survey, &rising(0.2), &later_s).is_empty(), "no time of recording is stated");
        for (i, response) in survey.responses.iter_mut().enumerate() {
            response.recorded_at = Some(100.0 + i as f64);
        }
        assert!(of(&survey, &[0.1, -0.2, 0.2, 0.0, -0.1, 0.1], &direct_s).is_empty());
        let found = of(&survey, &rising(0.2), &later_s);
        assert!(
            found.len() == 2 && found[0].contains("+1.0 dB") && found[1].contains("+0.50 %"),
            "{found:?}"
        );
        // Levels and times that mean nothing cannot drift.
        survey.measurement = Measurement { time_zero: TimeZero::PerResponse, levels: Levels::PerResponse };
        assert!(of(&survey, &rising(0.2), &later_s).is_empty());
    }
}
