//! One room of the second laboratory, diagnosed blind.

use crate::AnyError;
use sabine::diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, Verdict};
use sabine_testkit::{Planted, PolyhedralConfig, PolyhedralRoom, Polyhedron};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;
use std::time::Instant;

/// A wall is found where it is this near to the truth, in metres.
const WALL_M: f64 = 0.03;
/// An object is found if its middle is within this.
const OBJECT_M: f64 = 0.5;

/// What is to be diagnosed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    pub seed: u64,
    pub shape: Polyhedron,
    pub planted: Planted,
    pub nuisances: bool,
    pub receivers: usize,
    pub rays: usize,
}

/// How the answer stands to the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// What is hidden is named, with its subject, and nothing else; where nothing is hidden, nothing.
    Right,
    /// It is in what is named as a set.
    Set,
    /// It is named, and something that is not there.
    Extra,
    /// Something is named that is not there, and what is there is not.
    Wrong,
    /// A misfit without a name.
    Unexplained,
    /// The room is called adequate though it is not.
    Missed,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Right => "right",
            Self::Set => "set",
            Self::Extra => "extra",
            Self::Wrong => "wrong",
            Self::Unexplained => "unexplained",
            Self::Missed => "missed",
        })
    }
}

/// One line of the record.
#[derive(Clone, Debug)]
pub struct Trial {
    pub task: Task,
    /// None in records of before December 2026.
    pub verdict: Option<String>,
    pub outcome: Outcome,
    pub answer: String,
    /// Names of what is not there.
    pub false_names: Vec<String>,
    pub p_value: f64,
    /// Error of decay curves at positions left out in dB, without and with what is named.
    pub decay_db: Option<[f64; 2]>,
    /// Mean absolute error of absorption, as stated and as fitted.
    pub absorption: [f64; 2],
    pub seconds: f64,
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
struct Row {
    seed: u64,
    shape: Polyhedron,
    planted: Planted,
    nuisances: bool,
    receivers: usize,
    rays: usize,
    #[serde(default)]
    verdict: Option<String>,
    outcome: Outcome,
    answer: String,
    false_names: String,
    p_value: f64,
    decay_db_before: Option<f64>,
    decay_db_after: Option<f64>,
    absorption_stated: f64,
    absorption_fitted: f64,
    seconds: f64,
}

pub fn from_csv(text: &str) -> Result<Vec<Trial>, AnyError> {
    let rows: Result<Vec<Row>, csv::Error> =
        csv::Reader::from_reader(text.as_bytes()).deserialize().collect();
    let one = |row: Row| Trial {
        task: Task {
            seed: row.seed,
            shape: row.shape,
            planted: row.planted,
            nuisances: row.nuisances,
            receivers: row.receivers,
            rays: row.rays,
        },
        verdict: row.verdict,
        outcome: row.outcome,
        answer: row.answer,
        false_names: row.false_names.split_whitespace().map(str::to_owned).collect(),
        p_value: row.p_value,
        decay_db: row.decay_db_before.zip(row.decay_db_after).map(|(a, b)| [a, b]),
        absorption: [row.absorption_stated, row.absorption_fitted],
        seconds: row.seconds,
    };
    Ok(rows?.into_iter().map(one).collect())
}

pub fn to_csv(trials: &[Trial]) -> Result<Vec<u8>, AnyError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for t in trials {
        writer.serialize(Row {
            seed: t.task.seed,
            shape: t.task.shape,
            planted: t.task.planted,
            nuisances: t.task.nuisances,
            receivers: t.task.receivers,
            rays: t.task.rays,
            verdict: t.verdict.clone(),
            outcome: t.outcome,
            answer: t.answer.clone(),
            false_names: t.false_names.join(" "),
            p_value: t.p_value,
            decay_db_before: t.decay_db.map(|d| d[0]),
            decay_db_after: t.decay_db.map(|d| d[1]),
            absorption_stated: t.absorption[0],
            absorption_fitted: t.absorption[1],
            seconds: t.seconds,
        })?;
    }
    Ok(writer.into_inner()?)
}

pub fn shape_name(shape: Polyhedron) -> &'static str {
    match shape {
        Polyhedron::L => "l",
        Polyhedron::SlopedCeiling => "sloped_ceiling",
        Polyhedron::Wedge => "wedge",
        Polyhedron::Furnished => "furnished",
    }
}

impl Task {
    /// Its name, as a folder's.
    pub fn name(&self) -> String {
        let world = if self.nuisances { "nuisances" } else { "plain" };
        format!("{}_{}_{world}_{}", shape_name(self.shape), self.planted, self.seed)
    }

    /// Makes the room in a new folder, diagnoses it and compares.
    pub fn run(&self, folder: &Path) -> Result<Trial, AnyError> {
        let &Self { seed, shape, planted, nuisances, receivers, rays } = self;
        let config =
            PolyhedralConfig { seed, shape, planted, nuisances, receivers, ..PolyhedralConfig::default() };
        let laboratory = PolyhedralRoom::new(config)?;
        if let Some(parent) = folder.parent() {
            std::fs::create_dir_all(parent)?;
        }
        let room = laboratory.write(folder)?;
        let started = Instant::now();
        let config = DiagnoseConfig { rays, seed, ..DiagnoseConfig::default() };
        let asked = self.planted == Planted::Object;
        let also: &[String] = if asked { &["missing_object".to_owned()] } else { &[] };
        let found = Diagnoser::new(config)?.with_also(also)?.diagnose(&room, &[], &())?;
        let seconds = started.elapsed().as_secs_f64();
        let (outcome, false_names) = self.outcome(&found, &laboratory);
        if outcome != Outcome::Right {
            eprintln!("  hidden: {planted} {}", laboratory.subject().unwrap_or_default());
            found.notes.iter().for_each(|note| eprintln!("  {note}"));
            for cause in &found.causes {
                let subject = cause.subject.as_deref().unwrap_or("everywhere");
                eprintln!("  {} ({subject}): {:.1} nats; {}", cause.effect, cause.nats, cause.explanation);
            }
            for test in found.lack_of_fit.tests.iter().filter(|t| t.p_value < 0.01) {
                let subject = test.subject.as_deref().unwrap_or("everywhere");
                eprintln!("  {} ({subject}): {:.1e}", test.name, test.p_value);
            }
        }
        Ok(Trial {
            task: *self,
            verdict: Some(found.verdict.to_string()),
            outcome,
            answer: answer(&found),
            false_names,
            p_value: found.lack_of_fit.p_value,
            decay_db: found.held_out.as_ref().map(|h| [h.db_rmse[0], h.db_rmse[1]]),
            absorption: absorption_errors(&found, &laboratory),
            seconds,
        })
    }

    fn outcome(&self, found: &Diagnosis, laboratory: &PolyhedralRoom) -> (Outcome, Vec<String>) {
        // What the world does beside what is hidden may be named, and need not.
        let allowed: &[&str] =
            if self.nuisances { &["channel_response", "coherent_reflections"] } else { &[] };
        let is_hidden = |effect: &str| Some(effect) == self.planted.effect();
        let rightly = |cause: &sabine::diagnose::Cause| {
            is_hidden(&cause.effect)
                && laboratory.subject().is_none_or(|wanted| {
                    cause.subject.iter().chain(&cause.other_subjects).any(|s| s.contains(wanted))
                })
        };
        let found_it = match (laboratory.moved_wall(), laboratory.missing_object()) {
            (Some(wall), _) => found.model.applied().surfaces.iter().any(|s| {
                let along = |p: [f64; 3]| (0..3).map(|k| wall.normal[k] * p[k]).sum::<f64>();
                along(s.normal).abs() > 0.999 && (along(s.point_m) - along(wall.point_m)).abs() < WALL_M
            }),
            (_, Some(corners)) => found.model.applied().objects.iter().any(|object| {
                let off = |k: usize| object.foot_m[k] - 0.5 * (corners[0][k] + corners[1][k]);
                off(0).hypot(off(1)) < OBJECT_M
            }),
            _ => found.causes.iter().any(rightly),
        };
        let mut false_names: Vec<String> = found
            .causes
            .iter()
            .filter(|c| !(allowed.contains(&&*c.effect) || is_hidden(&c.effect) && found_it))
            .map(|c| c.effect.clone())
            .collect();
        false_names.sort_unstable();
        false_names.dedup();
        let due = self.planted.effect().is_some();
        let in_set = found.verdict == Verdict::Ambiguous
            && found.alternatives.iter().any(|a| is_hidden(a) || allowed.contains(&&**a));
        let outcome = match found.verdict {
            _ if found_it && false_names.is_empty() => Outcome::Right,
            _ if in_set => Outcome::Set,
            _ if found_it => Outcome::Extra,
            _ if !false_names.is_empty() => Outcome::Wrong,
            Verdict::Unexplained => Outcome::Unexplained,
            _ if due => Outcome::Missed,
            _ => Outcome::Right,
        };
        (outcome, false_names)
    }
}

fn answer(found: &Diagnosis) -> String {
    match found.verdict {
        Verdict::Explained | Verdict::Incomplete => {
            let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
            named.join(" + ")
        }
        Verdict::Ambiguous => {
            // The last cause stands for the set.
            let sure = found.causes.iter().rev().skip(1).map(|c| c.effect.clone());
            sure.chain([found.alternatives.join(" or ")]).collect::<Vec<_>>().join(" + ")
        }
        other => other.to_string(),
    }
}

/// Mean absolute error over materials and octaves, before anything is named and beside what is.
fn absorption_errors(found: &Diagnosis, laboratory: &PolyhedralRoom) -> [f64; 2] {
    let (mut before, mut after, mut count) = (0.0, 0.0, 0.0f64);
    for (material, truth) in laboratory.scene().materials().iter().zip(laboratory.true_absorption()) {
        let Some((_, fitted)) = found.materials.iter().find(|(name, _)| *name == material.name) else {
            continue;
        };
        for (b, wanted) in truth.iter().enumerate() {
            before += (fitted.absorption_before[b] - wanted).abs();
            after += (fitted.absorption[b] - wanted).abs();
            count += 1.0;
        }
    }
    [before / count.max(1.0), after / count.max(1.0)]
}
