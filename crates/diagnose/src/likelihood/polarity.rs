//! Signs of the direct sounds.

use crate::effect::{Case, ChannelChange};
use crate::observe::observed_response::Measured;
use crate::statistics::median;

/// Likeness of direct pulses about its typical value: one standard deviation.
const LIKENESS_SD: f64 = 0.2;
/// Share of pulses whose likeness says nothing.
const ODD_PULSE_SHARE: f64 = 1e-6;

/// Log-likelihood of the signs of the direct sounds.
pub(crate) fn log_likelihood(measured: &[Measured], cases: &[&Case], used: &[bool]) -> f64 {
    let likeness = signs(measured);
    let fitted = likeness.iter().zip(used).filter(|(_, used)| **used);
    let typical = median(fitted.filter_map(|(x, _)| x.map(f64::abs)).collect());
    likeness
        .iter()
        .enumerate()
        .filter(|(i, _)| used[*i])
        .filter_map(|(i, x)| {
            let turned =
                cases.iter().filter(|c| c.channel_change() == Some(ChannelChange::Inverted(i))).count() % 2
                    == 1;
            let off = (if turned { -x.as_ref()? } else { *x.as_ref()? }) - typical;
            let density =
                (-0.5 * (off / LIKENESS_SD).powi(2)).exp() / (LIKENESS_SD * std::f64::consts::TAU.sqrt());
            Some(((1.0 - ODD_PULSE_SHARE) * density + ODD_PULSE_SHARE * 0.5).ln())
        })
        .sum()
}

/// Likeness of each direct pulse to the others, positive for the sign of the majority.
fn signs(measured: &[Measured]) -> Vec<Option<f64>> {
    let n = measured.len();
    if n < 3 {
        return vec![None; n];
    }
    let likeness: Vec<Vec<f64>> = measured
        .iter()
        .map(|a| measured.iter().map(|b| a.pulse_likeness(b).unwrap_or(0.0)).collect())
        .collect();
    // Signs that agree best: the leading eigenvector by repeated multiplication, from the one most like all others.
    let first = (0..n)
        .max_by(|&a, &b| {
            let sum = |i: usize| likeness[i].iter().map(|x| x.abs()).sum::<f64>();
            sum(a).total_cmp(&sum(b))
        })
        .unwrap_or(0);
    let mut signs: Vec<f64> = likeness[first].clone();
    for _ in 0..50 {
        let next: Vec<f64> =
            likeness.iter().map(|row| row.iter().zip(&signs).map(|(a, b)| a * b).sum()).collect();
        let norm = next.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
        signs = next.into_iter().map(|x| x / norm).collect();
    }
    let positive = signs.iter().filter(|s| **s > 0.0).count();
    let majority = if 2 * positive >= n { 1.0 } else { -1.0 };
    (0..n)
        .map(|i| {
            let others: Vec<f64> = (0..n)
                .filter(|&j| j != i && likeness[i][j] != 0.0)
                .map(|j| likeness[i][j] * (majority * signs[j]).signum())
                .collect();
            (!others.is_empty()).then(|| median(others))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::ChannelFault;
    use crate::hand_made::Tables;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn the_response_whose_pulse_is_turned_is_found() {
        let mut tables = Tables::new(Levels::PerResponse, TimeZero::Emission);
        let pulse: Vec<f64> =
            (0..40).map(|i| (-0.1 * f64::from(i)).exp() * (0.8 * f64::from(i)).cos()).collect();
        for (i, measured) in tables.measured.iter_mut().enumerate() {
            let sign = if i == 1 { -1.0 } else { 1.0 };
            measured.pulse = pulse.iter().map(|x| sign * x).collect();
        }
        let used = [true; 3];
        let none = log_likelihood(&tables.measured, &[], &used);
        let gains = ChannelFault.cases(&tables.survey).into_iter().filter_map(|case| {
            let ChannelChange::Inverted(response) = case.channel_change()? else { return None };
            Some((response, log_likelihood(&tables.measured, &[&case], &used) - none))
        });
        for (response, gain) in gains {
            assert_eq!(gain > 10.0, response == 1, "{response}: {gain} nats");
        }
    }
}
