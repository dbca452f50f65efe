//! Which measurement decides, and by how much, before it is made.

mod floor;
mod open_question;
mod report;

use crate::bar::Bar;
use crate::commands::diagnose::words;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::laws::naming_laws;
use crate::output::OutputFolder;
use crate::room::RoomArguments;
use clap::Args;
use sabine::diagnose::{CostTable, DiagnoseConfig, EffectSize, Plan, PlanConfig, Planner, read_laws};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Measurements that are printed.
const PRINTED: usize = 10;

/// Plan the next measurement: which one decides, and by how much.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    room: RoomArguments,
    /// A diagnosis.json of this room: plan what decides between its leading causes [default: plan for all causes of the catalogue]
    #[arg(long, value_name = "F")]
    diagnosis: Option<PathBuf>,
    /// Formulas that are causes beside the catalogue, `[[laws]]` in TOML: a file, or a folder of such files
    #[arg(long, value_name = "F")]
    laws: Option<PathBuf>,
    /// Minutes that each kind of measurement takes, as TOML: microphone_min, source_min, source_turned_min, climate_min
    #[arg(long, value_name = "F")]
    cost: Option<PathBuf>,
    /// Places for microphones to choose
    #[arg(long, value_name = "N", default_value_t = 3)]
    microphones: usize,
    /// Places for the first source to choose
    #[arg(long, value_name = "M", default_value_t = 0)]
    sources: usize,
    /// Measurements that are weighed, about
    #[arg(long, default_value_t = 60)]
    candidates: usize,
    /// Least distance of a new place from surfaces, sources and receivers, in metres
    #[arg(long, value_name = "M", default_value_t = 0.5)]
    clearance: f64,
    /// Rays for each source-receiver pair
    #[arg(long, default_value_t = 2000)]
    rays: usize,
    /// Seed of the rays
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Go on although more than one ray in a thousand escapes through holes of the mesh
    #[arg(long)]
    allow_leaks: bool,
    /// Folder for plan.json and plan.html
    #[arg(long, value_name = "DIR", default_value = "out/plan")]
    out: PathBuf,
}

/// What the program adds to a plan in `plan.json`.
#[derive(Serialize)]
struct Document<'a> {
    room: &'a str,
    #[serde(flatten)]
    plan: &'a Plan,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut demo = Demo::default();
    let cost = arguments.cost.as_ref().map(CostTable::read).transpose()?.unwrap_or_default();
    let diagnose = DiagnoseConfig {
        rays: arguments.rays,
        seed: arguments.seed,
        allow_leaks: arguments.allow_leaks,
        ..DiagnoseConfig::default()
    };
    let laws = arguments.laws.as_ref().map(read_laws).transpose()?.unwrap_or_default();
    let mut planner = Planner::new(PlanConfig {
        diagnose,
        microphones: arguments.microphones,
        sources: arguments.sources,
        candidates: arguments.candidates,
        clearance_m: arguments.clearance,
        cost,
        ..PlanConfig::default()
    })?;
    let file = arguments.laws.as_deref();
    planner = planner.with_laws(laws).map_err(|error| naming_laws(error.into(), file))?;
    // A folder that cannot be written to should not cost the user a computation first.
    let mut out = OutputFolder::create(&arguments.out)?;
    let (room, name) = arguments.room.read(&mut demo)?;
    let mut question = None;
    if let Some(path) = &arguments.diagnosis {
        let (asked, mut found) = open_question::read(path, &room, |id| planner.knows(id))?;
        found.retain(|law| !planner.knows(law.id()));
        planner = planner.with_laws(found).map_err(|error| naming_laws(error.into(), Some(path)))?;
        question = Some(asked);
    }
    let bar = Bar::new();
    let plan = planner
        .plan(&room, question.as_ref(), &bar)
        .map_err(|error| naming_laws(error.into(), arguments.laws.as_deref()))?;
    bar.finish();
    let json = serde_json::to_string_pretty(&serde_json::to_value(Document { room: &name, plan: &plan })?)?;
    out.write("plan.json", json.as_bytes())?;
    out.write("plan.html", report::html(&room, &name, &plan).as_bytes())?;
    out.finish()?;
    print_plan(&plan, &arguments.out);
    Ok(())
}

/// Two hypotheses, or an effect, in plain words.
pub fn decided(what: &str) -> String {
    let one = |name: &str| match name.split_once(" (") {
        Some((id, subject)) => words::effect_of(id, Some(subject.trim_end_matches(')'))),
        None => words::effect(name),
    };
    what.split(" or ").map(one).collect::<Vec<_>>().join(" or ")
}

fn print_plan(plan: &Plan, out: &Path) {
    match &plan.question {
        Some(question) => {
            let names: Vec<String> = question.leading.iter().map(|h| decided(&h.to_string())).collect();
            println!("which is it: {}", names.join("; "));
        }
        None => println!("nats: what is learned of each cause's size by itself, added up over the catalogue"),
    }
    for (number, chosen) in (1..).zip(&plan.chosen) {
        let measurement = &plan.candidates[chosen.candidate].measurement;
        let decides: Vec<String> = chosen.decides.iter().take(2).map(|d| decided(&d.what)).collect();
        println!("{number}. {measurement}: {:.1} nats more ({})", chosen.adds_nats, decides.join("; "));
    }
    println!("{:<58} {:>6} {:>8} {:>10}", "one measurement more", "nats", "minutes", "per minute");
    for one in plan.candidates.iter().take(PRINTED) {
        let name = one.measurement.to_string();
        println!("{name:<58} {:>6.1} {:>8.1} {:>10.3}", one.nats, one.minutes, one.nats_per_minute);
    }
    if let Some(best) = plan.most_per_minute() {
        println!("most for each minute: {} ({:.2} nats)", best.measurement, best.nats_per_minute);
    }
    println!("{:<44} {:>14} {:>14}", "a cause is named from", "as stated", "with these");
    for effect in easiest(plan) {
        let size = |k: usize| size(effect, effect.named_from[k]);
        println!("{:<44} {:>14} {:>14}", words::effect(&effect.effect), size(0), size(1));
    }
    let seconds: f64 = plan.seconds.iter().map(|(_, s)| s).sum();
    println!("{seconds:.1} s; look at {}", out.join("plan.html").display());
}

/// Of each effect the case that shows most once the chosen measurements are made.
pub fn easiest(plan: &Plan) -> Vec<&EffectSize> {
    let mut found: Vec<&EffectSize> = Vec::new();
    for effect in &plan.effects {
        match found.last_mut().filter(|last| last.effect == effect.effect) {
            Some(last) if last.d_prime[1] < effect.d_prime[1] => *last = effect,
            Some(_) => {}
            None => found.push(effect),
        }
    }
    found
}

/// A size with its unit; a dash for one that nothing shows.
pub fn size(effect: &EffectSize, size: f64) -> String {
    if !size.is_finite() {
        return "-".to_owned();
    }
    let digits = if size.abs() >= 100.0 {
        0
    } else if size.abs() >= 1.0 {
        1
    } else {
        3
    };
    format!("{size:.digits$} {}", effect.unit).trim_end().to_owned()
}
