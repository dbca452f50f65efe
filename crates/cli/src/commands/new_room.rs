//! A room folder without a mesh program: from its size or its floor plan, and names of the material library.

use crate::failure::Failure;
use crate::positions::{places, size};
use clap::{ArgGroup, Args};
use sabine::scene::{DrawnRoom, FloorPlan, Receiver, Source};
use std::path::PathBuf;

/// Make a room folder from a size or a floor plan and names of the material library (`sabine materials`).
#[derive(Args)]
#[command(group(ArgGroup::new("outline").required(true).args(["size", "plan"])))]
pub struct Arguments {
    /// Length, width and height in metres, as 5x4x2.6: x from 0 to length, y from 0 to width, z up
    #[arg(long, value_name = "LxWxH", allow_hyphen_values = true)]
    size: Option<String>,
    /// Floor plan: a file with one corner in a line, x y in metres, in order
    #[arg(long, value_name = "FILE", requires = "height")]
    plan: Option<PathBuf>,
    /// Height in metres, with --plan
    #[arg(long, value_name = "M", conflicts_with = "size")]
    height: Option<f64>,
    /// Material of the floor [default: unknown, to be fitted]
    #[arg(long, value_name = "NAME")]
    floor: Option<String>,
    /// Material of the ceiling [default: unknown, to be fitted]
    #[arg(long, value_name = "NAME")]
    ceiling: Option<String>,
    /// Material of all walls that have none of their own [default: unknown, to be fitted]
    #[arg(long, value_name = "NAME")]
    walls: Option<String>,
    /// Material of one wall, repeatable. Wall 1 goes from corner 1 to corner 2; with --size 1 is y = 0, 2 x = length, 3 y = width,
    /// 4 x = 0
    #[arg(long, value_name = "N=NAME")]
    wall: Vec<String>,
    /// Position of a source in metres, repeatable; named s1, s2, ... unless it is given a name
    #[arg(long, value_name = "[ID=]X,Y,Z", allow_hyphen_values = true)]
    source: Vec<String>,
    /// Position of a receiver in metres, repeatable; named r1, r2, ... unless it is given a name
    #[arg(long, value_name = "[ID=]X,Y,Z", allow_hyphen_values = true)]
    receiver: Vec<String>,
    /// Folder to be made; it must not exist, or be empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let room = drawn(arguments)?.write(&arguments.out)?;
    let folder = arguments.out.display();
    println!("{}", room.size_line());
    for note in room.notes() {
        println!("note: {note}");
    }
    println!("wrote {folder}/room.toml and {folder}/room.obj");
    for (empty, table) in [(room.sources().is_empty(), "sources"), (room.receivers().is_empty(), "receivers")]
    {
        if empty {
            println!(
                "note: there are no {table}: add [[{table}]] with id and position_m to {folder}/room.toml"
            );
        }
    }
    println!("next: sabine trace --room {folder} --out {folder}-traced");
    Ok(())
}

fn drawn(arguments: &Arguments) -> Result<DrawnRoom, Failure> {
    let (plan, height_m) = match (&arguments.size, &arguments.plan, arguments.height) {
        (Some(text), _, _) => {
            let [length, width, height] = size(text)?;
            (FloorPlan::rectangle(length, width).map_err(|error| format!("--size {text}: {error}"))?, height)
        }
        (None, Some(plan), Some(height)) => (FloorPlan::read(plan)?, height),
        // Refused by the group and by `requires` before.
        _ => return Err("give --size, or --plan and --height".into()),
    };
    let walls = arguments.wall.iter().map(|text| {
        let (number, name) = text.split_once('=').unwrap_or((text, ""));
        let number = number.trim().parse::<usize>().ok().filter(|_| !name.trim().is_empty());
        let number =
            number.ok_or_else(|| format!("--wall {text}: write number=material, as 2=glass_window"))?;
        Ok((number, name.trim().to_owned()))
    });
    let source = |(id, position_m)| Source { id, position_m, axis: None };
    let receiver = |(id, position_m)| Receiver { id, position_m, axis: None };
    Ok(DrawnRoom {
        plan,
        height_m,
        floor: arguments.floor.clone(),
        ceiling: arguments.ceiling.clone(),
        walls: arguments.walls.clone(),
        wall: walls.collect::<Result<_, Failure>>()?,
        sources: places(&arguments.source, "source")?.into_iter().map(source).collect(),
        receivers: places(&arguments.receiver, "receiver")?.into_iter().map(receiver).collect(),
    })
}
