//! The numbers of a fit, for files and for people.

use super::verdict::{Octave, in_one_sentence};
use super::{OCTAVES, Outcome};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// The numbers, as other programs read them.
#[derive(Serialize)]
pub struct Summary {
    /// How well it fits, in one sentence.
    pub verdict: String,
    /// Octaves in which the fit has not converged, in Hz: their absorption is no result.
    pub unconverged_hz: Vec<f64>,
    pub bands_hz: Vec<f64>,
    pub target_t60_s: Vec<Option<f64>>,
    pub reached_t60_s: Vec<Option<f64>>,
    pub unreachable: Vec<UnreachableBand>,
    pub materials: BTreeMap<String, Fitted>,
    pub not_determined: Vec<String>,
    /// Bounds that were reached and warnings, in words; `not_determined` is among them.
    pub notes: Vec<String>,
    pub seconds: Seconds,
}

#[derive(Serialize)]
pub struct UnreachableBand {
    pub band_hz: f64,
    pub reason: String,
}

#[derive(Serialize)]
pub struct Fitted {
    pub absorption: Vec<f64>,
    pub absorption_sd: Vec<f64>,
}

#[derive(Serialize)]
pub struct Seconds {
    pub trace: f64,
    pub fit: f64,
}

/// A response before and after the fit, per octave.
#[derive(Serialize)]
pub struct Compared {
    pub source: String,
    pub receiver: String,
    pub held_out: bool,
    pub measured_t30_s: Vec<Option<f64>>,
    pub t30_before_s: Vec<Option<f64>>,
    pub t30_after_s: Vec<Option<f64>>,
    pub decay_rmse_before_db: Vec<Option<f64>>,
    pub decay_rmse_after_db: Vec<Option<f64>>,
}

/// Mean of what there is.
pub fn mean_of(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    (count > 0.0).then(|| sum / count)
}

impl Summary {
    /// The numbers of a fit to materials of these names.
    pub fn new(names: &[&str], outcome: &Outcome<'_>) -> Self {
        let fit = &outcome.fit;
        let fitted = |k: usize| Fitted {
            absorption: fit.materials[k].absorption().values().to_vec(),
            absorption_sd: fit.absorption_standard_error[k].values().to_vec(),
        };
        let not_determined: Vec<String> = fit.not_determined.iter().map(|u| u.describe(names)).collect();
        let bounds = fit.at_bounds.iter().map(|bound| bound.describe(names));
        let warnings = fit.warnings.iter().map(|warning| warning.describe(names));
        let notes = bounds.chain(warnings).chain(outcome.warnings.clone()).chain(not_determined.clone());
        let unconverged_hz = fit.unconverged_hz();
        let octave = |(b, hz): (usize, f64)| Octave {
            hz,
            wanted_s: outcome.target_s[b],
            reached_s: outcome.reached_s[b],
            converged: !unconverged_hz.contains(&hz),
        };
        let octaves: Vec<Octave> = OCTAVES.iter_hz().enumerate().map(octave).collect();
        Self {
            verdict: in_one_sentence(&outcome.aim, &octaves),
            unconverged_hz,
            notes: notes.collect(),
            bands_hz: OCTAVES.iter_hz().collect(),
            target_t60_s: outcome.target_s.clone(),
            reached_t60_s: outcome.reached_s.clone(),
            unreachable: fit
                .unreachable
                .iter()
                .map(|u| UnreachableBand { band_hz: u.band_hz, reason: u.reason.to_string() })
                .collect(),
            materials: names.iter().enumerate().map(|(k, n)| ((*n).to_owned(), fitted(k))).collect(),
            not_determined,
            seconds: Seconds { ..outcome.seconds },
        }
    }

    /// Absorption as rows of a table.
    pub fn table(&self) -> Vec<Vec<String>> {
        let head = self.bands_hz.iter().map(|hz| format!("{hz} Hz"));
        let mut rows = vec![std::iter::once("material".to_owned()).chain(head).collect()];
        for (name, fitted) in &self.materials {
            let cells = fitted.absorption.iter().zip(&fitted.absorption_sd);
            let cells = cells.zip(&self.bands_hz).map(|((a, sd), hz)| {
                if self.unconverged_hz.contains(hz) { "-".to_owned() } else { format!("{a:.3} ± {sd:.3}") }
            });
            rows.push(std::iter::once(name.clone()).chain(cells).collect());
        }
        rows
    }

    /// Prints them, and what should be known.
    pub fn print(&self, outcome: &Outcome<'_>, out: &Path) {
        let row = |values: &[Option<f64>]| -> String {
            values.iter().map(|v| v.map_or("     -".to_owned(), |v| format!("{v:>6.2}"))).collect()
        };
        println!("octave        {}", self.bands_hz.iter().map(|hz| format!("{hz:>6}")).collect::<String>());
        println!("T60 wanted    {} s", row(&self.target_t60_s));
        println!("T60 reached   {} s", row(&self.reached_t60_s));
        for (name, fitted) in &self.materials {
            let cells = fitted.absorption.iter().zip(&fitted.absorption_sd);
            let cells = cells.zip(&self.bands_hz).map(|((a, sd), hz)| {
                if self.unconverged_hz.contains(hz) {
                    format!("{:>10}", "-")
                } else {
                    format!(" {a:.2}±{sd:.2}")
                }
            });
            println!("{name:14}{}", cells.collect::<String>());
        }
        for held_out in [false, true] {
            let some = || outcome.compared.iter().filter(|c| c.held_out == held_out);
            if some().next().is_none() {
                continue;
            }
            println!("{} responses, before -> after:", if held_out { "held-out" } else { "fitted" });
            let mean = |of: &dyn Fn(&Compared, usize) -> Option<f64>| -> Vec<Option<f64>> {
                (0..OCTAVES.len()).map(|b| mean_of(some().filter_map(|c| of(c, b)))).collect()
            };
            let t30 = |simulated: &dyn Fn(&Compared) -> &Vec<Option<f64>>, b: usize, c: &Compared| {
                Some(100.0 * (simulated(c)[b]? / c.measured_t30_s[b]? - 1.0).abs())
            };
            println!("  T30 error %  {}", row(&mean(&|c, b| t30(&|c| &c.t30_before_s, b, c))));
            println!("           ->  {}", row(&mean(&|c, b| t30(&|c| &c.t30_after_s, b, c))));
            println!("  decay dB     {}", row(&mean(&|c, b| c.decay_rmse_before_db[b])));
            println!("           ->  {}", row(&mean(&|c, b| c.decay_rmse_after_db[b])));
        }
        if let Some(tables) = &outcome.tables {
            tables.print();
        }
        for band in &self.unreachable {
            println!("unreachable: {} Hz: {}", band.band_hz, band.reason);
        }
        for text in &self.notes {
            println!("note: {text}");
        }
        println!("{}", self.verdict);
        println!(
            "{:.2} s tracing, {:.2} s fitting; look at {}",
            self.seconds.trace,
            self.seconds.fit,
            out.join("report.html").display()
        );
    }
}
