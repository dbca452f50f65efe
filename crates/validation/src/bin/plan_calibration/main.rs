//! Whether a plan keeps its word: nats that a measurement was expected to bring between two hypotheses, and those that it brought.
//!
//! Each room of the laboratory is drawn independently, with one effect hidden in it. Three of its microphones are measured; each of the others is a
//! place where the next one could stand. The plan says how many nats it would bring between the hidden effect and a look-alike; then it is
//! brought in, both hypotheses are fitted once more, and the change of the evidence between them is what was realised.
//!
//! `cargo run --release -p sabine-validation --bin plan_calibration -- --rooms 40 --record FILE` adds rooms to a record and prints what it
//! amounts to; a room that the record holds is not measured again.

mod summary;

use clap::Parser;
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sabine::diagnose::{DiagnoseConfig, Hypothesis, OpenQuestion, PlanConfig, PlannedMeasurement, Planner};
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use sabine_validation::AnyError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Any error, to be printed.
/// Microphones that are measured before the plan.
const MEASURED: usize = 3;
/// Microphones in all.
const MICROPHONES: usize = 9;
/// A hidden effect and what it is taken for, in turn.
const CONTESTS: [[&str; 2]; 6] = [
    ["source_directivity", "transducer_response"],
    ["scattering", "surface_absorption"],
    ["surface_absorption", "air_absorption"],
    ["coupled_volume", "background_noise"],
    ["sound_speed", "room_dimensions"],
    ["air_absorption", "scattering"],
];

/// Expected against realised nats of a next measurement.
#[derive(Parser)]
struct Arguments {
    /// Rooms, one hidden effect each
    #[arg(long, default_value_t = 40)]
    rooms: u64,
    /// First seed
    #[arg(long, default_value_t = 8800)]
    seed: u64,
    /// Rays for each source-receiver pair
    #[arg(long, default_value_t = 1000)]
    rays: usize,
    /// Stop after so many seconds, after the room at hand
    #[arg(long, default_value_t = 3600)]
    time_limit: u64,
    /// CSV file that rooms are added to
    #[arg(long, default_value = "docs/validation/plan/calibration.csv")]
    record: PathBuf,
}

/// One place in one room.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trial {
    /// Seed of the room.
    pub seed: u64,
    /// Effect that is hidden in it.
    pub hidden: String,
    /// Effect that it is told from.
    pub rival: String,
    /// Size of the hidden effect, 1 being typical.
    pub strength: f64,
    /// Evidence for the hidden effect over the other before the plan, in nats; none in records made before it was kept.
    #[serde(default)]
    pub before_nats: Option<f64>,
    /// Number of the place among the candidates.
    pub place: usize,
    /// Nats that the plan promises.
    pub expected_nats: f64,
    /// Nats that a measurement there gave.
    pub realised_nats: f64,
}

fn main() -> Result<(), AnyError> {
    let arguments = Arguments::parse();
    let started = std::time::Instant::now();
    let mut trials: Vec<Trial> = match csv::Reader::from_path(&arguments.record) {
        Ok(mut record) => record.deserialize().collect::<Result<_, _>>()?,
        Err(_) => Vec::new(),
    };
    for seed in arguments.seed..arguments.seed + arguments.rooms {
        if started.elapsed().as_secs() > arguments.time_limit {
            eprintln!("the time is over");
            break;
        }
        if trials.iter().any(|t| t.seed == seed) {
            continue;
        }
        match room(seed, arguments.rays) {
            Ok(found) => {
                for t in &found {
                    let before = t.before_nats.unwrap_or(f64::NAN);
                    eprintln!(
                        "{seed} {} ({}), {before:.1} nats before: expected {:.2}, realised {:.2}",
                        t.hidden, t.rival, t.expected_nats, t.realised_nats
                    );
                }
                trials.extend(found);
                write(&arguments.record, &trials)?;
            }
            Err(error) => eprintln!("{seed}: left out: {error}"),
        }
    }
    summary::print(&trials);
    Ok(())
}

/// The whole record, under a temporary name until it is complete.
fn write(path: &std::path::Path, trials: &[Trial]) -> Result<(), AnyError> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let unfinished = path.with_extension("unfinished");
    let mut record = csv::Writer::from_path(&unfinished)?;
    trials.iter().try_for_each(|trial| record.serialize(trial))?;
    record.flush()?;
    Ok(std::fs::rename(unfinished, path)?)
}

/// All places of a room.
fn room(seed: u64, rays: usize) -> Result<Vec<Trial>, AnyError> {
    let [hidden_id, rival] = CONTESTS[(seed % CONTESTS.len() as u64) as usize];
    let mut random = SmallRng::seed_from_u64(seed);
    let strength = random.random_range(0.25..0.75);
    let lab = Laboratory::new(LabConfig { seed, receivers: MICROPHONES, ..LabConfig::default() })?;
    let hidden = Hidden::random(hidden_id, strength, &lab, seed)?;
    let folder = std::env::temp_dir().join(format!("sabine-plan-{}-{seed}", std::process::id()));
    let written = lab.write(std::slice::from_ref(&hidden), &folder, None);
    let found = written.map_err(AnyError::from).and_then(|whole| {
        let subject = match &hidden {
            Hidden::SurfaceAbsorption { material, .. } => {
                Some(whole.scene().materials()[*material].name.clone())
            }
            _ => None,
        };
        let truth = Hypothesis { effect: hidden_id.to_owned(), subject };
        let question = OpenQuestion { sure: Vec::new(), leading: vec![truth, Hypothesis::of(rival)] };
        let measured = whole.with_responses(|r| r.receiver < MEASURED);
        let places_m: Vec<[f64; 3]> = whole.receivers()[MEASURED..].iter().map(|r| r.position_m).collect();
        let planner = Planner::new(PlanConfig {
            diagnose: DiagnoseConfig { rays, seed, ..DiagnoseConfig::default() },
            microphones: 0,
            candidates: 4,
            places_m: places_m.clone(),
            ..PlanConfig::default()
        })?;
        let plan = planner.plan(&measured, Some(&question), &())?;
        let between = |evidence: Vec<f64>| evidence[0] - evidence[1];
        let before = between(planner.log_evidence(&measured, &question, &())?);
        let mut trials = Vec::new();
        for (place, position_m) in places_m.iter().enumerate() {
            let own = PlannedMeasurement::Microphone { position_m: *position_m };
            let weighing = plan.candidates.iter().find(|c| c.measurement == own);
            let expected_nats = weighing.ok_or("a place was not weighed")?.nats;
            let more = whole.with_responses(|r| r.receiver < MEASURED || r.receiver == MEASURED + place);
            let after = between(planner.log_evidence(&more, &question, &())?);
            trials.push(Trial {
                seed,
                hidden: hidden_id.to_owned(),
                rival: rival.to_owned(),
                strength,
                before_nats: Some(before),
                place,
                expected_nats,
                realised_nats: after - before,
            });
        }
        Ok(trials)
    });
    let _ = std::fs::remove_dir_all(&folder);
    found
}
