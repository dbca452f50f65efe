//! Positions that a fit has not seen, predicted and compared.

use crate::effect::Case;
use crate::infer::baseline::Baseline;
use crate::likelihood::decay::EnergyModel;
use crate::observe::stated_parameter::{StatedParameter, value_of};
use sabine_acoustics::ParameterKind;
use sabine_scene::Levels;

/// Measured and predicted energies of the compared bins of one pair and band.
#[derive(Clone)]
pub(crate) struct Compared {
    pub pair: usize,
    pub band: usize,
    /// Beginnings of the bins.
    pub times_s: Vec<f64>,
    /// What a table states in place of bins, whose quantities are compared instead of energies; empty of a response.
    pub stated: Vec<StatedParameter>,
    pub measured: Vec<f64>,
    pub predicted: Vec<f64>,
}

/// All bands of some pairs under fitted values. Where the gain of a response means nothing, it is fitted to it.
pub(crate) fn compare(
    baseline: &Baseline,
    cases: &[&Case],
    values: &[f64],
    pairs: &[usize],
) -> Vec<Compared> {
    let used = vec![true; baseline.pairs()];
    let data = baseline.energy_data();
    let model = EnergyModel::new(&data, cases, &used);
    let mut found = Vec::new();
    let mut values = values.to_vec();
    for &pair in pairs {
        if baseline.survey().measurement.levels == Levels::PerResponse {
            model.fit_gain(&mut values, pair);
        }
        for band in 0..baseline.survey().bands.len() {
            let Some(energies) = model.compared(pair, band) else { continue };
            let predicted: Vec<f64> =
                model.predicted(&values, pair, band, energies.len()).iter().map(|l| l.exp()).collect();
            let bins = baseline.simulation.states[pair][band].bins;
            let table = baseline.observations.measured[pair].table.as_ref();
            found.push(Compared {
                pair,
                band,
                times_s: (0..energies.len()).map(|k| bins.edge_s(k)).collect(),
                stated: table.map_or_else(Vec::new, |table| table[band].clone()),
                measured: energies.to_vec(),
                predicted,
            });
        }
    }
    found
}

impl Compared {
    pub fn is_table(&self) -> bool {
        !self.stated.is_empty()
    }

    /// Kind, measured and predicted value of each parameter of a table.
    pub fn values(&self) -> impl Iterator<Item = (ParameterKind, f64, f64)> + '_ {
        let both = self.measured.iter().zip(&self.predicted);
        self.stated.iter().zip(both).map(|(parameter, (measured, predicted))| {
            let kind = parameter.kind;
            (kind, value_of(kind, *measured), value_of(kind, *predicted))
        })
    }
}

/// Energy still to come, in dB relative to `total`.
pub(crate) fn decay_db(energies: &[f64], total: f64) -> Vec<f64> {
    let mut left = 0.0;
    let mut found: Vec<f64> = energies
        .iter()
        .rev()
        .map(|e| {
            left += e;
            10.0 * (left / total).max(1e-12).log10()
        })
        .collect();
    found.reverse();
    found
}

/// Errors of decay curves (dB), T20 and C50 (just-noticeable differences: 5 % and 1 dB, ISO 3382-1:2009, table A.1); not numbers where there is
/// nothing to compare.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Errors {
    pub db_rmse: f64,
    pub t20_jnd: f64,
    pub c50_jnd: f64,
    /// Of all values of tables (root mean square).
    pub values_jnd: f64,
}

/// Curves are compared down to so much below their beginning: what is left of the compared range decides what lies below.
const LOWEST_DB: f64 = -30.0;
const T20_JND: f64 = 0.05;
const C50_JND_DB: f64 = 1.0;

/// Squared errors of decay curves in dB2, summed, and their number; of tables, those of their values in just-noticeable differences.
pub(crate) fn squared_errors<'a>(compared: impl IntoIterator<Item = &'a Compared>) -> (f64, f64) {
    let (mut squares, mut points) = (0.0, 0.0);
    for c in compared {
        if c.is_table() {
            let off = c.values().map(|(kind, measured, predicted)| kind.in_jnd(predicted, measured));
            squares += off.map(|jnd| jnd * jnd).sum::<f64>();
            points += c.stated.len() as f64;
            continue;
        }
        let total: f64 = c.measured.iter().sum();
        if total <= 0.0 {
            continue;
        }
        let (m, p) = (decay_db(&c.measured, total), decay_db(&c.predicted, total));
        for (m, p) in m.iter().zip(&p).filter(|(m, _)| **m > LOWEST_DB) {
            squares += (m - p).powi(2);
            points += 1.0;
        }
    }
    (squares, points)
}

impl Errors {
    /// In the mean over pairs and bands.
    pub fn of(compared: &[Compared]) -> Self {
        let (squares, points) = squared_errors(compared.iter().filter(|c| !c.is_table()));
        let (of_values, values) = squared_errors(compared.iter().filter(|c| c.is_table()));
        let (mut t20, mut t20s, mut c50, mut c50s) = (0.0, 0.0, 0.0, 0.0);
        for c in compared.iter().filter(|c| !c.is_table()) {
            let total: f64 = c.measured.iter().sum();
            if total <= 0.0 {
                continue;
            }
            let (m, p) = (decay_db(&c.measured, total), decay_db(&c.predicted, total));
            if let (Some(m), Some(p)) = (slope(&c.times_s, &m), slope(&c.times_s, &p)) {
                // T is inverse to the slope.
                t20 += (m / p - 1.0).abs() / T20_JND;
                t20s += 1.0;
            }
            if let (Some(m), Some(p)) = (c50_db(c, &c.measured), c50_db(c, &c.predicted)) {
                c50 += (m - p).abs() / C50_JND_DB;
                c50s += 1.0;
            }
        }
        Self {
            db_rmse: (squares / points).sqrt(),
            t20_jnd: t20 / t20s,
            c50_jnd: c50 / c50s,
            values_jnd: (of_values / values).sqrt(),
        }
    }
}

/// Slope between -5 and -25 dB of a decay curve, in dB/s.
fn slope(times_s: &[f64], decay: &[f64]) -> Option<f64> {
    let top = decay.first()?;
    let points: Vec<(f64, f64)> = times_s
        .iter()
        .zip(decay)
        .filter(|(_, d)| (-25.0..=-5.0).contains(&(*d - top)))
        .map(|(t, d)| (*t, *d))
        .collect();
    let n = points.len() as f64;
    if n < 3.0 {
        return None;
    }
    let (t, d) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let up: f64 = points.iter().map(|p| (p.0 - t) * (p.1 - d)).sum();
    let down: f64 = points.iter().map(|p| (p.0 - t).powi(2)).sum();
    (down > 0.0).then(|| up / down).filter(|s| *s < 0.0)
}

fn c50_db(c: &Compared, energies: &[f64]) -> Option<f64> {
    let early: f64 = c.times_s.iter().zip(energies).filter(|(t, _)| **t < 0.05).map(|(_, e)| e).sum();
    let late: f64 = energies.iter().sum::<f64>() - early;
    (early > 0.0 && late > 0.0).then(|| 10.0 * (early / late).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exponential_has_its_slope_and_its_error() {
        let times_s: Vec<f64> = (0..60).map(|k| 0.01 * f64::from(k)).collect();
        let decay =
            |t60_s: f64| -> Vec<f64> { times_s.iter().map(|t| 10f64.powf(-6.0 * t / t60_s)).collect() };
        let c = Compared {
            pair: 0,
            band: 0,
            measured: decay(0.5),
            predicted: decay(0.5),
            times_s: times_s.clone(),
            stated: Vec::new(),
        };
        let same = Errors::of(&[c]);
        assert!(same.db_rmse < 1e-9 && same.t20_jnd < 1e-9 && same.c50_jnd < 1e-9);
        let c = Compared {
            pair: 0,
            band: 0,
            measured: decay(0.5),
            predicted: decay(0.55),
            times_s,
            stated: Vec::new(),
        };
        // 10 % longer: two just-noticeable differences.
        assert!((Errors::of(&[c]).t20_jnd - 2.0).abs() < 0.1);
    }
}
