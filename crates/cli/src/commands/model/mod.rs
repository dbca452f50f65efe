//! Extended models as `diagnose` writes them: said in words, fitted anew, joined, taken apart, drawn. See docs/how-to/extended-model.md.

mod show;

use crate::bar::Bar;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::output::OutputFolder;
use crate::room::RoomArguments;
use clap::{Args, Subcommand};
use sabine::diagnose::{DiagnoseConfig, Diagnoser, ExtendedModel, ModelCause};
use std::path::PathBuf;

/// Show extended models, fit them anew, join them, take causes out, draw from them.
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Say in words what a model changes, and how sure its numbers are
    Show(ShowArguments),
    /// Fit a model's parameters and the absorption anew to the responses of a room: nothing is looked for, nothing is dropped
    Refit(RefitArguments),
    /// Join two models: the causes of the first, then those of the second
    Merge(MergeArguments),
    /// Leave a cause out
    Drop(DropArguments),
    /// Draw models that could be as well, from how sure the numbers of one are
    Sample(SampleArguments),
}

#[derive(Args)]
struct ShowArguments {
    /// extended_model.toml of `diagnose`
    #[arg(value_name = "MODEL")]
    model: PathBuf,
}

#[derive(Args)]
struct RefitArguments {
    /// The model that is fitted
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    #[command(flatten)]
    room: RoomArguments,
    /// Rays for each source-receiver pair [default: 10000]
    #[arg(long)]
    rays: Option<usize>,
    /// Seed of rays
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Go on although more than one ray in a thousand escapes through holes of the mesh
    #[arg(long)]
    allow_leaks: bool,
    /// File for the model
    #[arg(long, value_name = "F.toml", default_value = "out/refitted_model.toml")]
    out: PathBuf,
}

#[derive(Args)]
struct MergeArguments {
    /// Its absorption stays
    #[arg(value_name = "FIRST")]
    first: PathBuf,
    /// Its causes follow
    #[arg(value_name = "SECOND")]
    second: PathBuf,
    /// File for the model
    #[arg(long, value_name = "F.toml", default_value = "out/merged_model.toml")]
    out: PathBuf,
}

#[derive(Args)]
struct DropArguments {
    /// The model
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// The cause to leave out, by its name in `show`
    #[arg(long, value_name = "ID")]
    cause: String,
    /// What it concerns, where the model has several of that name
    #[arg(long, value_name = "SUBJECT")]
    subject: Option<String>,
    /// File for the model
    #[arg(long, value_name = "F.toml", default_value = "out/smaller_model.toml")]
    out: PathBuf,
}

#[derive(Args)]
struct SampleArguments {
    /// The model
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// How many, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    draws: u32,
    /// Seed of the draws
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for draw_1.toml and so on
    #[arg(long, value_name = "DIR", default_value = "out/draws")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.task {
        Task::Show(own) => {
            print!("{}", show::in_words(&ExtendedModel::read(&own.model)?));
            Ok(())
        }
        Task::Refit(own) => refit(own),
        Task::Merge(own) => {
            let (first, second) = (ExtendedModel::read(&own.first)?, ExtendedModel::read(&own.second)?);
            write(&first.merged(second)?, &own.out)
        }
        Task::Drop(own) => {
            let model = ExtendedModel::read(&own.model)?;
            let place = place_of(&model.causes, &own.cause, own.subject.as_deref())?;
            write(&model.without(place), &own.out)
        }
        Task::Sample(own) => sample(own),
    }
}

fn refit(arguments: &RefitArguments) -> Result<(), Failure> {
    let model = ExtendedModel::read(&arguments.model)?;
    let default = DiagnoseConfig::default();
    let config = DiagnoseConfig {
        rays: arguments.rays.unwrap_or(default.rays),
        seed: arguments.seed,
        allow_leaks: arguments.allow_leaks,
        ..default
    };
    let diagnoser = Diagnoser::new(config)?.with_effects(Vec::new()).starting_from(&model)?;
    let (room, _) = arguments.room.read(&mut Demo::default())?;
    let bar = Bar::new();
    let refitted = diagnoser.refit(&room, &bar)?;
    bar.finish();
    print!("{}", show::in_words(&refitted));
    write(&refitted, &arguments.out)
}

fn sample(arguments: &SampleArguments) -> Result<(), Failure> {
    let model = ExtendedModel::read(&arguments.model)?;
    if model.uncertainty.is_none() {
        return Err(format!("{}: uncertainty: it has none to draw from", arguments.model.display()).into());
    }
    let draws = model.draws(arguments.draws as usize, arguments.seed)?;
    let mut out = OutputFolder::create(&arguments.out)?;
    for (number, draw) in draws.iter().enumerate() {
        out.write(&format!("draw_{}.toml", number + 1), draw.to_toml()?.as_bytes())?;
    }
    out.finish()?;
    println!("{} models in {}", draws.len(), arguments.out.display());
    Ok(())
}

fn write(model: &ExtendedModel, path: &PathBuf) -> Result<(), Failure> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    model.write(path)?;
    println!("wrote {}", path.display());
    Ok(())
}

/// The place of the one cause that is meant.
fn place_of(causes: &[ModelCause], id: &str, subject: Option<&str>) -> Result<usize, Failure> {
    let is_meant =
        |cause: &ModelCause| cause.id == id && subject.is_none_or(|s| cause.subject.as_deref() == Some(s));
    let mut places = (0..causes.len()).filter(|&place| is_meant(&causes[place]));
    let all = || causes.iter().map(ModelCause::name).collect::<Vec<_>>().join(", ");
    match (places.next(), places.next()) {
        (Some(place), None) => Ok(place),
        (None, _) if causes.is_empty() => Err("the model has no causes".into()),
        (None, _) => {
            let of_what = subject.map_or(String::new(), |s| format!(" and --subject {s}"));
            Err(format!("the model has no cause --cause {id}{of_what}; it has {}", all()).into())
        }
        (Some(_), Some(_)) => Err(format!(
            "the model has several causes --cause {id}: say which with --subject; it has {}",
            all()
        )
        .into()),
    }
}
