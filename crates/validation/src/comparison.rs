//! Models held against what was measured at positions that no fit has seen.
//!
//! Decays: levels of octaves in stretches of time that double (20, 20, 40, 80 ms ...) from just before the measured arrival on, down to 45 dB
//! below the strongest. Arrivals: when the direct sound comes. Both are compared by the predictive density of a normal error of unknown
//! variance about what the model says (Student's t; A. Gelman et al., *Bayesian Data Analysis*, 3rd ed., 3.2, without a prior): what is known
//! of the variance, for each octave and stretch and for arrivals, are the errors of the model at the positions that were fitted. One gain,
//! which the room file leaves open, is fitted there, too.

use crate::heard::{BIN_S, Heard};
use crate::median;

/// Ends of the stretches in seconds from just before the measured arrival.
const ENDS_S: [f64; 8] = [0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.28, 2.56];
/// They begin so long before the arrival, in seconds: filters smear it.
const BEFORE_S: f64 = 2e-3;
/// Sound so far below the strongest stretch of its octave says nothing, in dB.
const FLOOR_DB: f64 = -45.0;
/// Decay curves are compared down to so much below their beginning, in dB.
const CURVE_END_DB: f64 = -30.0;
/// Least errors that are taken for the standard deviation: half a sample at 48 kHz, and what levels of a few thousand rays differ by.
const LEAST_ARRIVAL_SD_S: f64 = 1e-5;
const LEAST_LEVEL_SD_DB: f64 = 0.1;

/// How probable a model makes each position that was not fitted, and how far off it is there.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Logarithm of the density of the levels of each position, in nats.
    pub decay_nats: Vec<f64>,
    /// Number of levels of each position.
    pub levels: Vec<usize>,
    /// Logarithm of the density of the arrival at each position, in nats.
    pub arrival_nats: Vec<f64>,
    /// Root mean square error of decay curves in dB.
    pub curve_db: f64,
    /// Root mean square error of arrivals in seconds.
    pub arrival_s: f64,
}

/// What is gained by one prediction over another, in nats for each level or arrival, and the standard error of that mean over positions.
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    /// The mean.
    pub nats: f64,
    /// Its standard error.
    pub standard_error: f64,
}

impl Gain {
    /// From nats of each position and the number of what was compared there.
    pub fn of(better: &[f64], worse: &[f64], counts: &[usize]) -> Self {
        let gains: Vec<f64> = better.iter().zip(worse).map(|(b, w)| b - w).collect();
        let positions = gains.len() as f64;
        let count = counts.iter().sum::<usize>() as f64;
        let mean = gains.iter().sum::<f64>() / positions;
        let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (positions - 1.0);
        Self { nats: positions * mean / count, standard_error: (positions * variance).sqrt() / count }
    }
}

/// Compares models with the measurement; the first `fitted` responses are those that were fitted. `common_latency` says that one latency of
/// all responses is left open.
pub fn compare(
    measured: &[Heard],
    models: &[&[Heard]],
    fitted: usize,
    common_latency: bool,
) -> Vec<Prediction> {
    let gains: Vec<f64> = models.iter().map(|model| open_gain(measured, model, fitted)).collect();
    // What is compared is the same for all models.
    let errors: Vec<Vec<LevelErrors>> =
        (0..measured.len()).map(|r| level_errors(&measured[r], models, &gains, r)).collect();
    let one = |m: usize| {
        let late_s = arrival_errors_s(measured, models[m], fitted, common_latency);
        prediction((&errors, m), &late_s, fitted, curve_error_db(measured, models[m], gains[m], fitted))
    };
    (0..models.len()).map(one).collect()
}

/// Measured less predicted level of a stretch of an octave.
struct LevelErrors {
    band: usize,
    stretch: usize,
    /// Of each model, in dB.
    errors_db: Vec<f64>,
}

/// The gain of the energies of a model that fits it to the measurement: the median over the fitted responses of the mean over octaves.
fn open_gain(measured: &[Heard], model: &[Heard], fitted: usize) -> f64 {
    let of_response = |(own, model): (&Heard, &Heard)| {
        let db = |(own, model): (&Vec<f64>, &Vec<f64>)| {
            10.0 * (own.iter().sum::<f64>() / model.iter().sum::<f64>()).log10()
        };
        let all: Vec<f64> = own.energy.iter().zip(&model.energy).map(db).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let gains: Vec<f64> = measured.iter().zip(model).take(fitted).map(of_response).collect();
    10f64.powf(median(gains) / 10.0)
}

/// All levels of one response in which the measurement or a model sounds.
fn level_errors(measured: &Heard, models: &[&[Heard]], gains: &[f64], response: usize) -> Vec<LevelErrors> {
    let from = (((measured.arrival_s - BEFORE_S) / BIN_S).max(0.0)) as usize;
    let powers = |energy: &[f64], gain: f64| -> Vec<f64> {
        let mut begin = from;
        let mean = |end_s: &f64| {
            let end = from + (end_s / BIN_S).round() as usize;
            // Silence follows the last sample.
            let sum: f64 = energy.iter().take(end).skip(begin).sum();
            let mean = gain * sum / (end - begin) as f64;
            begin = end;
            mean
        };
        ENDS_S.iter().map(mean).collect()
    };
    let mut found = Vec::new();
    for (band, energy) in measured.energy.iter().enumerate() {
        let own = powers(energy, 1.0);
        let predicted: Vec<Vec<f64>> =
            models.iter().zip(gains).map(|(m, gain)| powers(&m[response].energy[band], *gain)).collect();
        let floor = own.iter().copied().fold(f64::MIN_POSITIVE, f64::max) * 10f64.powf(FLOOR_DB / 10.0);
        for (stretch, own) in own.iter().enumerate() {
            if *own > floor || predicted.iter().any(|p| p[stretch] > floor) {
                let off = |p: &Vec<f64>| 10.0 * ((own + floor) / (p[stretch] + floor)).log10();
                found.push(LevelErrors { band, stretch, errors_db: predicted.iter().map(off).collect() });
            }
        }
    }
    found
}

/// How much later the direct sound arrives than a model says, in seconds.
fn arrival_errors_s(measured: &[Heard], model: &[Heard], fitted: usize, common_latency: bool) -> Vec<f64> {
    let late: Vec<f64> = measured.iter().zip(model).map(|(m, p)| m.arrival_s - p.arrival_s).collect();
    let open = if common_latency { median(late[..fitted].to_vec()) } else { 0.0 };
    late.into_iter().map(|late| late - open).collect()
}

/// What is known of an error: those at the positions that were fitted.
struct Known {
    square: f64,
    count: f64,
}

impl Known {
    fn of(errors: &[f64], least: f64) -> Self {
        Self { square: rms(errors.iter().copied()).max(least).powi(2), count: errors.len() as f64 }
    }

    /// Logarithm of the density of another one, less what depends on their number alone.
    fn ln_density(&self, error: f64) -> f64 {
        let relative = error * error / (self.count * self.square);
        -0.5 * self.square.ln() - 0.5 * (self.count + 1.0) * relative.ln_1p()
    }
}

/// From the errors of one model in the levels of all responses, and in arrivals.
fn prediction(
    (levels, model): (&[Vec<LevelErrors>], usize),
    late_s: &[f64],
    fitted: usize,
    curve_db: f64,
) -> Prediction {
    let known = |band: usize, stretch: usize| {
        let of = |belongs: &dyn Fn(&LevelErrors) -> bool| -> Vec<f64> {
            let all = levels[..fitted].iter().flatten();
            all.filter(|e| belongs(e)).map(|e| e.errors_db[model]).collect()
        };
        let own = of(&|e| e.band == band && e.stretch == stretch);
        // Where few of the fitted responses sound, those of the whole octave stand for them.
        let own = if 2 * own.len() >= fitted { own } else { of(&|e| e.band == band) };
        Known::of(&own, LEAST_LEVEL_SD_DB)
    };
    let decay_nats = |response: &Vec<LevelErrors>| -> f64 {
        response.iter().map(|e| known(e.band, e.stretch).ln_density(e.errors_db[model])).sum()
    };
    let arrivals = Known::of(&late_s[..fitted], LEAST_ARRIVAL_SD_S);
    Prediction {
        decay_nats: levels[fitted..].iter().map(decay_nats).collect(),
        levels: levels[fitted..].iter().map(Vec::len).collect(),
        arrival_nats: late_s[fitted..].iter().map(|late| arrivals.ln_density(*late)).collect(),
        curve_db,
        arrival_s: rms(late_s[fitted..].iter().copied()),
    }
}

/// Root mean square error of decay curves (energy still to come) in dB, at positions that were not fitted.
fn curve_error_db(measured: &[Heard], model: &[Heard], gain: f64, fitted: usize) -> f64 {
    let curve = |energy: &[f64], total: f64| -> Vec<f64> {
        let mut left = 0.0;
        let mut curve: Vec<f64> = energy
            .iter()
            .rev()
            .map(|e| {
                left += e;
                10.0 * (left / total).max(1e-12).log10()
            })
            .collect();
        curve.reverse();
        curve
    };
    let mut errors = Vec::new();
    for (own, model) in measured.iter().zip(model).skip(fitted) {
        for (own, model) in own.energy.iter().zip(&model.energy) {
            let total: f64 = own.iter().sum();
            let (own, model) = (curve(own, total), curve(model, total / gain));
            errors.extend(own.iter().zip(&model).filter(|(m, _)| **m > CURVE_END_DB).map(|(m, p)| m - p));
        }
    }
    rms(errors.into_iter())
}

/// Root of the mean square; 0 of nothing.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A response that falls by 10 dB in a second, its octaves from some levels in dB on.
    fn falling(levels_db: [f64; 2], arrival_s: f64) -> Heard {
        let energy =
            |level_db: f64| (0..1000).map(|k| 10f64.powf((level_db - 0.01 * f64::from(k)) / 10.0)).collect();
        Heard { energy: levels_db.map(energy).to_vec(), arrival_s }
    }

    #[test]
    fn a_gain_is_the_difference_of_students_densities() {
        // Positions differ by -0.6, 0 and 0.6 dB, which leaves the gain that is open at 3 dB; in the wrong model octaves are 2 dB off, too.
        let error = |i: usize| [-0.6, 0.0, 0.6][i % 3];
        let measured: Vec<Heard> = (0..20).map(|i| falling([3.0 + error(i); 2], 0.01)).collect();
        let right = vec![falling([0.0; 2], 0.01); 20];
        let wrong = vec![falling([2.0, -2.0], 0.01); 20];
        let found = compare(&measured, &[&right, &wrong], 8, false);
        let gain = Gain::of(&found[0].decay_nats, &found[1].decay_nats, &found[0].levels);
        let mean = |range: std::ops::Range<usize>, value: &dyn Fn(usize) -> f64| {
            range.clone().map(value).sum::<f64>() / range.len() as f64
        };
        let of_model = |off: f64| {
            let square = mean(0..8, &|i| (error(i) + off).powi(2));
            mean(8..20, &|i| {
                // Student's t with 8 degrees of freedom, its constant left out.
                let t = (1.0 + (error(i) + off).powi(2) / (8.0 * square)).powf(-4.5) / square.sqrt();
                t.ln()
            })
        };
        let expected = of_model(0.0) - 0.5 * (of_model(-2.0) + of_model(2.0));
        assert!(expected > 1.0, "{expected}");
        assert!((gain.nats - expected).abs() < 0.01, "{gain:?} {expected}");
        // Seven stretches of a second in two octaves.
        assert_eq!(found[0].levels, [14; 12]);
        assert!(found[0].curve_db < 0.6 && found[1].curve_db > 2.0, "{found:?}");
    }

    #[test]
    fn a_latency_counts_unless_it_is_open() {
        let measured: Vec<Heard> = vec![falling([0.0; 2], 0.014); 20];
        let early: Vec<Heard> = vec![falling([0.0; 2], 0.01); 20];
        let late = |open| compare(&measured, &[&early], 8, open)[0].arrival_s;
        assert!((late(false) - 0.004).abs() < 1e-12 && late(true) < 1e-12);
    }
}
