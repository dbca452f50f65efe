//! One laboratory room, diagnosed blind, and its truth beside what was found.

use crate::decide;
use crate::task::Task;
use sabine::diagnose::{Cause, Diagnosis, Verdict};
use sabine::scene::NamedMaterial;
use sabine_testkit::{Fault, Hidden, LabConfig, Laboratory};
use sabine_validation::AnyError;
use sabine_validation::absorption::absorption_errors;
use sabine_validation::hiding::{answer, hide, named};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How the answer stands to the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Just what was hidden is named; nothing where nothing was hidden; nothing that no catalogue holds.
    Right,
    /// The set that is named holds it.
    Set,
    /// All that was hidden is named, and more.
    Extra,
    /// One of two is named, and nothing else.
    Part,
    /// Something else is named.
    Wrong,
    /// The room is called adequate though it is not.
    Missed,
    /// A misfit without a name, where a name was due.
    Unnamed,
}

/// One line of the record.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trial {
    pub hidden: String,
    pub strength: f64,
    pub seed: u64,
    pub receivers: usize,
    #[serde(default = "one")]
    pub sources: usize,
    #[serde(default = "usual_rate")]
    pub sample_rate_hz: u32,
    #[serde(default = "one")]
    pub sessions: usize,
    #[serde(default)]
    pub positive_reflections: bool,
    #[serde(default = "one")]
    pub bands_per_octave: usize,
    pub shams: usize,
    pub verdict: String,
    pub answer: String,
    pub outcome: Outcome,
    pub p_value: f64,
    /// Size found of the first hidden effect, in its standard deviations.
    pub d_prime: Option<f64>,
    /// Its evidence in nats, corrected for the number of its cases.
    pub nats: Option<f64>,
    /// Lower end of the gain of the first cause at positions not seen, in nats per bin.
    pub gain_low: Option<f64>,
    /// Parameters of the first hidden effect, named, whose truth is known; and how many of their 90 % intervals hold it.
    pub intervals: usize,
    pub covered: usize,
    /// Mean absolute error of fitted absorption under the baseline and beside the named causes.
    pub absorption_before: f64,
    pub absorption_after: f64,
    /// On the clock; a room of an atlas in a folder has none, for its bytes must not depend on when it was made.
    pub seconds: Option<f64>,
    /// The measurement that would decide, and whether it does; the same of one drawn from the others.
    #[serde(default)]
    pub asked: Option<String>,
    #[serde(default)]
    pub asked_decides: Option<bool>,
    #[serde(default)]
    pub other: Option<String>,
    #[serde(default)]
    pub other_decides: Option<bool>,
}

fn one() -> usize {
    1
}

fn usual_rate() -> u32 {
    LabConfig::default().sample_rate_hz
}

/// Effects whose fitted parameters are printed room by room.
const IN_SPACE: [&str; 2] = ["surface_displacement", "coordinate_shift"];

impl Task {
    /// Whether a record holds this task.
    pub fn is_done(&self, trials: &[Trial]) -> bool {
        trials.iter().any(|t| {
            t.hidden == self.name()
                && t.strength == self.strength
                && (t.seed, t.receivers, t.shams) == (self.seed, self.receivers, self.shams)
                && t.positive_reflections == self.positive_reflections
                && (t.sources, t.sample_rate_hz, t.sessions, t.bands_per_octave)
                    == (self.sources, self.sample_rate_hz, self.sessions, self.bands_per_octave)
        })
    }

    /// Hides, diagnoses and compares.
    pub fn run(&self, folder: &Path) -> Result<Trial, AnyError> {
        let config = self.lab()?;
        let lab = Laboratory::new(config.clone())?;
        let hidden = hide(&self.hidden, self.strength, &lab, self.seed)?;
        let started = std::time::Instant::now();
        let found = self.diagnose(&lab, &hidden, folder)?;
        let seconds = started.elapsed().as_secs_f64();
        let outcome = match (outcome(&found, &hidden, self.positive_reflections), &hidden[..]) {
            (Outcome::Right, [Hidden::SurfaceDisplacement { face, .. }])
                if !is_of_face(&found, &lab, *face) =>
            {
                Outcome::Wrong
            }
            (outcome, _) => outcome,
        };
        for cause in found.causes.iter().filter(|c| IN_SPACE.contains(&&*c.effect)) {
            let values = cause.parameters.iter();
            let values: Vec<String> = values
                .map(|p| format!("{} {:.3} [{:.3}, {:.3}] {}", p.name, p.value, p.low, p.high, p.unit))
                .collect();
            let subject = cause.subject.as_deref().unwrap_or_default();
            eprintln!("  {subject}: {}; hidden: {:?}", values.join(", "), hidden);
        }
        if outcome != Outcome::Right {
            found.notes.iter().for_each(|note| eprintln!("  {note}"));
            for test in found.lack_of_fit.tests.iter().filter(|t| t.p_value < 0.01) {
                let subject = test.subject.as_deref().unwrap_or("everywhere");
                eprintln!("  {} ({subject}): {:.1e}", test.name, test.p_value);
            }
        }

        let first = hidden.first().map(Hidden::id);
        let own = found.candidates.iter().find(|c| Some(c.effect.as_str()) == first);
        let cause = found.causes.iter().find(|c| Some(c.effect.as_str()) == first);
        let truths = match hidden.first() {
            Some(effect) => true_parameters(effect, &lab)?,
            None => Vec::new(),
        };
        let held = cause.map(|c| within(c, &truths)).unwrap_or_default();
        let [before, after] = absorption_errors(&found, &lab, &hidden)?;
        let follow_up = match &hidden[..] {
            [one]
                if self.decide
                    && outcome == Outcome::Set
                    && found.alternatives.iter().any(|a| a == one.id()) =>
            {
                Some(decide::follow_up(self, &config, one, &found.alternatives, folder)?)
            }
            _ => None,
        };
        Ok(Trial {
            hidden: self.name(),
            strength: self.strength,
            seed: self.seed,
            receivers: self.receivers,
            sources: self.sources,
            sample_rate_hz: self.sample_rate_hz,
            sessions: self.sessions,
            positive_reflections: self.positive_reflections,
            bands_per_octave: self.bands_per_octave,
            shams: self.shams,
            verdict: found.verdict.to_string(),
            answer: answer(&found),
            outcome,
            p_value: found.lack_of_fit.p_value,
            d_prime: own.map(|c| c.d_prime),
            nats: own.map(|c| c.nats),
            gain_low: found.causes.first().and_then(|c| c.held_out_gain.as_ref()).map(|g| g.low),
            intervals: held.len(),
            covered: held.iter().filter(|h| **h).count(),
            absorption_before: before,
            absorption_after: after,
            seconds: Some(seconds),
            asked: follow_up.as_ref().map(|f| format!("{:?}", f.asked.0)),
            asked_decides: follow_up.as_ref().map(|f| f.asked.1),
            other: follow_up.as_ref().map(|f| format!("{:?}", f.other.0)),
            other_decides: follow_up.as_ref().map(|f| f.other.1),
        })
    }
}

fn outcome(found: &Diagnosis, hidden: &[Hidden], positive_reflections: bool) -> Outcome {
    let mut truth: Vec<&str> = hidden.iter().map(Hidden::id).collect();
    // Where reflections keep their sign the simulation is wrong in that, whatever else is hidden.
    truth.extend(positive_reflections.then_some("coherent_reflections"));
    truth.sort_unstable();
    let named = named(found);
    let outside = truth.contains(&"outside");
    match found.verdict {
        Verdict::Adequate if truth.is_empty() => Outcome::Right,
        Verdict::Adequate => Outcome::Missed,
        Verdict::Unexplained if outside => Outcome::Right,
        Verdict::Unexplained => Outcome::Unnamed,
        Verdict::Explained | Verdict::Incomplete | Verdict::Law if named == truth => Outcome::Right,
        Verdict::Ambiguous
            if truth.iter().all(|t| named.contains(t) || found.alternatives.iter().any(|a| a == t))
                && !truth.is_empty() =>
        {
            Outcome::Set
        }
        _ if !truth.is_empty() && truth.iter().all(|t| named.contains(t)) => Outcome::Extra,
        Verdict::Explained | Verdict::Incomplete | Verdict::Law
            if named.iter().all(|n| truth.contains(n)) =>
        {
            Outcome::Part
        }
        _ => Outcome::Wrong,
    }
}

/// Whether the only surface that stands elsewhere is a face of the box.
fn is_of_face(found: &Diagnosis, lab: &Laboratory, face: usize) -> bool {
    let (axis, truth) = (face / 2, lab.truth(&[]));
    let at = |size_m: [f64; 3]| if face.is_multiple_of(2) { 0.0 } else { size_m[axis] };
    match (&found.model.applied().surfaces[..], truth) {
        ([one], Ok(truth)) => {
            one.normal[axis].abs() > 0.999 && (one.point_m[axis] - at(truth.size_m)).abs() < 1e-3
        }
        _ => false,
    }
}

/// The truth of those parameters of an effect that the laboratory and the catalogue define alike.
fn true_parameters(hidden: &Hidden, lab: &Laboratory) -> Result<Vec<(String, f64)>, AnyError> {
    let bands = lab.truth(&[])?.bands()?;
    let by_band = |name: &str, values: &[f64]| -> Vec<(String, f64)> {
        values.iter().enumerate().map(|(b, v)| (format!("{name}_{}_hz", bands.nominal_hz(b)), *v)).collect()
    };
    let by_axis = |name: &str, values: [f64; 3]| -> Vec<(String, f64)> {
        ["x", "y", "z"].iter().zip(values).map(|(axis, v)| (format!("{name}_{axis}"), v)).collect()
    };
    Ok(match hidden {
        Hidden::TransducerResponse { gains_db } => {
            let off = |b: &usize| (bands.exact_hz(*b) / 1000.0).log2().abs();
            let middle = (0..bands.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
            let relative: Vec<f64> = gains_db.iter().map(|g| g - gains_db[middle]).collect();
            by_band("gain", &relative)
        }
        Hidden::AirAbsorption { relative_humidity_percent } => {
            vec![("relative_humidity".into(), *relative_humidity_percent)]
        }
        Hidden::SurfaceAbsorption { absorption, .. } => by_band("absorption", absorption),
        Hidden::AbsorptionTables { absorption } => {
            let stated = lab.scene().materials().iter();
            let factor = |(own, true_values): (&NamedMaterial, &Vec<f64>)| {
                let table = own.material.absorption().values();
                let factor = true_values.iter().sum::<f64>() / table.iter().sum::<f64>();
                (format!("factor_{}", own.name), factor)
            };
            stated.zip(absorption).map(factor).collect()
        }
        Hidden::Truncation { end_s, .. } => vec![("end".into(), *end_s)],
        Hidden::SoundSpeed { temperature_offset_k } => {
            vec![("temperature".into(), lab.air().temperature_c() + temperature_offset_k)]
        }
        Hidden::SamplingClock { ppm } => vec![("deviation".into(), *ppm)],
        Hidden::RoomDimensions { scale } => by_axis("scale", scale.map(|s| 100.0 * (s - 1.0))),
        Hidden::SurfaceDisplacement { face, offset_m } => {
            let tilts = ["x", "y", "z"].iter().enumerate().filter(|(axis, _)| *axis != face / 2);
            let tilts = tilts.map(|(_, axis)| (format!("tilt_{axis}"), 0.0));
            tilts.chain([("offset".to_owned(), *offset_m)]).collect()
        }
        Hidden::PositionError { offset_m, .. } => by_axis("offset", *offset_m),
        Hidden::CoordinateShift { shift_m, turn_deg } => {
            let turn = ("turn".to_owned(), *turn_deg);
            by_axis("shift", *shift_m).into_iter().chain([turn]).collect()
        }
        Hidden::TimeZero { latency_s } => vec![("latency".into(), 1000.0 * latency_s)],
        Hidden::NonlinearDistortion { sweep_s, from_hz, to_hz, quadratic, cubic, .. } => {
            let level = |name: &str, amplitude: f64| (name.to_owned(), 20.0 * amplitude.abs().log10());
            vec![
                ("second_harmonic_lead".into(), sweep_s / (to_hz / from_hz).ln() * 2f64.ln()),
                level("second_harmonic_1_khz", 0.5 * quadratic),
                level("third_harmonic_1_khz", 0.25 * cubic),
            ]
        }
        Hidden::ChannelFault { fault: Fault::Gain { gain_db, .. } } => vec![("gain".into(), *gain_db)],
        _ => Vec::new(),
    })
}

/// Whether each interval holds its truth.
fn within(cause: &Cause, truths: &[(String, f64)]) -> Vec<bool> {
    truths
        .iter()
        .filter_map(|(name, truth)| {
            let p = cause.parameters.iter().find(|p| p.name == *name)?;
            Some(p.low <= *truth && *truth <= p.high)
        })
        .collect()
}
