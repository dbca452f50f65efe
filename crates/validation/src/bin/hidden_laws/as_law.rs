//! A hidden law as a formula, to ask beforehand how visible it is.

use sabine::paths::laws::{Law, LawError, LawParameter, LawTarget};
use sabine_testkit::{Hidden, Truth};
use std::f64::consts::{LN_10, PI, TAU};

/// Speed of sound in m/s.
const SPEED_M_S: f64 = 343.2;
/// Places over an octave, in octaves from its centre, at which a mean over it is taken.
const IN_OCTAVE: [f64; 5] = [-0.4, -0.2, 0.0, 0.2, 0.4];

/// A formula that is being written, and its parameters.
struct Draft {
    parameters: Vec<(&'static str, LawParameter)>,
}

impl Draft {
    /// `k` is a level to which the whole law goes in proportion.
    fn new(k_db: f64) -> Self {
        Self { parameters: vec![("k", LawParameter::new(k_db, [0.0, 1.5 * k_db], "dB"))] }
    }

    fn known(mut self, name: &'static str, value: f64, unit: &str) -> Self {
        self.parameters.push((name, LawParameter::new(value, [value; 2], unit)));
        self
    }

    fn law(self, target: LawTarget, surface: Option<&str>, formula: &str) -> Result<Law, LawError> {
        Law::new("hidden", target, surface, formula, self.parameters)
    }
}

/// The mean over an octave of a term that is written for a frequency.
fn mean_of_octave(term: impl Fn(&str) -> String) -> String {
    let one = |octaves: f64| term(&format!("({:.6} * frequency_hz)", octaves.exp2()));
    let sum = IN_OCTAVE.map(one).join(" + ");
    format!("(({sum}) / {})", IN_OCTAVE.len())
}

/// The law; none for what changes no level. An octave is taken at a few of its frequencies.
///
/// # Errors
/// For numbers that a law refuses.
pub fn as_law(hidden: &Hidden, truth: &Truth) -> Result<Option<Law>, LawError> {
    let name = |material: usize| truth.materials.get(material).map(|m| m.name.as_str());
    let decibel = 10.0 / LN_10;
    let law = match hidden {
        Hidden::GrazingAbsorption { material, db, from_hz } => {
            let formula = "-k * (1 - cos_incidence)^2 * above(frequency_hz, f0)";
            let draft = Draft::new(*db).known("f0", from_hz / 2f64.sqrt(), "Hz");
            draft.law(LawTarget::Reflection, name(*material), formula)?
        }
        Hidden::SeatDip { material, db, f0_hz, q } => {
            let formula = "-k * (1 - cos_incidence)^2 * resonance(frequency_hz, f0, q)";
            let draft = Draft::new(*db).known("f0", *f0_hz, "Hz").known("q", *q, "1");
            draft.law(LawTarget::Reflection, name(*material), formula)?
        }
        Hidden::HelmholtzAbsorber { material, share, f0_hz, q, resistance } => {
            let absorbed = |f: &str| {
                let reactance = format!("(q * cos_incidence * ({f} / f0 - f0 / {f}))^2");
                let matched = |sign: &str| format!("((r * cos_incidence {sign} 1)^2 + {reactance})");
                format!("(1 - {} / {})", matched("-"), matched("+"))
            };
            let formula = format!("k * ln(1 - s * {})", mean_of_octave(absorbed));
            let draft = Draft::new(decibel).known("s", *share, "1").known("f0", *f0_hz, "Hz");
            let draft = draft.known("q", *q, "1").known("r", *resistance, "1");
            draft.law(LawTarget::Reflection, name(*material), &formula)?
        }
        Hidden::LimpWall { material, kg_m2 } => {
            let kept = |f: &str| format!("(1 - 1 / (1 + ({f} / f0 * cos_incidence)^2))");
            let formula = format!("k * ln(max({}, 0.001))", mean_of_octave(kept));
            let draft = Draft::new(decibel).known("f0", 413.3 / (PI * kg_m2), "Hz");
            draft.law(LawTarget::Reflection, name(*material), &formula)?
        }
        Hidden::Fog { water_g_m3, radius_um } => {
            let square_m2 = (1e-6 * radius_um).powi(2);
            let mass = water_g_m3 / 1204.0;
            let lags_s =
                [2.0 * 998.0 * square_m2 / (9.0 * 1.81e-5), 998.0 * 4184.0 * square_m2 / (3.0 * 0.0257)];
            let relaxing =
                |load: &str, f: &str| format!("{load} * (frequency_hz / {f}) / (1 + (frequency_hz / {f})^2)");
            let formula = format!(
                "-k * (frequency_hz / h) * (length_m / l) * ({} + {})",
                relaxing("a", "fa"),
                relaxing("b", "fb")
            );
            let draft = Draft::new(decibel * TAU / SPEED_M_S).known("h", 1.0, "Hz").known("l", 1.0, "m");
            let draft = draft.known("a", mass, "1").known("b", mass * 0.4 * 4184.0 / 1005.0, "1");
            let draft = draft.known("fa", 1.0 / (TAU * lags_s[0]), "Hz");
            draft.known("fb", 1.0 / (TAU * lags_s[1]), "Hz").law(LawTarget::Path, None, &formula)?
        }
        Hidden::ReceiverDirectivity { omni_share, .. } => {
            // The share of each octave, from edge to edge.
            let edge = |b: usize| (truth.bands_hz[b] * truth.bands_hz[b + 1]).sqrt();
            let step = |b: usize| {
                let by = omni_share[b + 1] - omni_share[b];
                format!("{by:+.6} * above(frequency_hz / h, {:.3})", edge(b))
            };
            let steps: String = (0..omni_share.len() - 1).map(step).collect::<Vec<_>>().join(" ");
            let q = format!("({:.6} {steps})", omni_share[0]);
            let formula = format!("k * ln(max(({q} + (1 - {q}) * arrival_cos)^2, 0.000001))");
            Draft::new(decibel).known("h", 1.0, "Hz").law(LawTarget::Path, None, &formula)?
        }
        Hidden::WarmingLoudspeaker { final_db, time_constant } => {
            let hot = 10f64.powf(final_db / 20.0) - 1.0;
            let draft = Draft::new(2.0 * decibel).known("h", hot, "1").known("t", *time_constant, "1");
            draft.law(LawTarget::Path, None, "-k * ln(1 + h * (1 - exp(-recording_order / t)))")?
        }
        Hidden::GainDrift { depth_db, period_s, phase_rad } => {
            let draft = Draft::new(*depth_db).known("t", period_s / TAU, "s").known("p", *phase_rad, "1");
            draft.law(LawTarget::Recorder, None, "k * sin(file_time_s / t + p)")?
        }
        Hidden::ColumnLoudspeaker { length_m } => {
            let energy = |f: &str| {
                let x = format!("({f} / f0 * abs(sin(departure_elevation_deg)) + 0.001)");
                format!("(sin({x}) / {x})^2")
            };
            let formula = format!("k * ln(max({}, 0.000001))", mean_of_octave(energy));
            let draft = Draft::new(decibel).known("f0", SPEED_M_S / (PI * length_m), "Hz");
            draft.law(LawTarget::Path, None, &formula)?
        }
        _ => return Ok(None),
    };
    Ok(Some(law))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::kinds::KINDS;
    use crate::truth::{Point, level_db};
    use rand::{Rng, SeedableRng, rngs::SmallRng};
    use sabine_testkit::{LabConfig, Laboratory};

    /// The oracle is the closed form by which answers are judged.
    #[test]
    fn a_formula_says_what_its_law_does() {
        let config = LabConfig { seed: 3, receivers: 6, recording_order: true, ..LabConfig::default() };
        let lab = Laboratory::new(config).unwrap();
        let mut random = SmallRng::seed_from_u64(8);
        for kind in &KINDS {
            let hidden = kind.hide(1.0, &lab, 3).unwrap();
            let truth = lab.truth(std::slice::from_ref(&hidden)).unwrap();
            let Some(law) = as_law(&hidden, &truth).unwrap() else {
                assert_eq!(kind.id, "temperature_gradient");
                continue;
            };
            assert_eq!(law.surface(), kind.surface_of(&hidden, &truth), "{}", kind.id);
            for (band, &frequency_hz) in truth.bands_hz.iter().enumerate() {
                for _ in 0..20 {
                    let at = Point {
                        frequency_hz,
                        cos_incidence: random.random_range(0.05..1.0),
                        length_m: random.random_range(1.0..100.0),
                        arrival_cos: random.random_range(-1.0..1.0),
                        departure_elevation_deg: random.random_range(-80.0..80.0),
                        recording_order: random.random_range(0.0..6.0),
                    };
                    let found = law.value(|name| at.variable(name)).unwrap();
                    let expected = level_db(&hidden, &at, band).unwrap();
                    // Where a mean over the octave is nearly nothing, five of its frequencies are few.
                    let close = 0.05 * expected.abs() + 0.1;
                    assert!(
                        (found - expected).abs() < close || expected < -12.0 && found < -9.0,
                        "{} {at:?}: {found} {expected}",
                        kind.id
                    );
                }
            }
        }
    }
}
