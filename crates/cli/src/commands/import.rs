//! A measured room of files of other programs.

use crate::failure::Failure;
use crate::positions;
use clap::{Args, ValueEnum};
use sabine::propagate::{MeshScene, check_placement};
use sabine::scene::{
    ImportOptions, LengthUnit, Levels, Materials, Measurements, MeshOptions, NewRoom, Receiver, RoomModel,
    Source, TimeZero, UpAxis,
};
use std::path::{Path, PathBuf};

/// Make a measured room of files of other programs.
///
/// Read are SOFA files (.sofa) of the conventions SingleRoomSRIR and SingleRoomMIMOSRIR, tables of sound files and positions (.csv),
/// and single responses: text exported by REW (.txt), sound (.wav and others), or a measurement of REW while it runs
/// (`http://127.0.0.1:4735/measurements/1`).
#[derive(Args)]
pub struct Arguments {
    /// The measurements
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The room as a mesh: .obj, .gltf or .glb
    #[arg(long, value_name = "FILE", conflicts_with = "size")]
    mesh: Option<PathBuf>,
    /// The room as a box with a corner at the origin: length, width and height in metres, as 5x4x2.6 [default without --mesh: the
    /// box that the file states]
    #[arg(long, value_name = "LxWxH", allow_hyphen_values = true)]
    size: Option<String>,
    /// Unit of the mesh's coordinates
    #[arg(long, value_name = "UNIT", requires = "mesh", value_parser = ["m", "cm", "mm", "in", "ft"])]
    units: Option<String>,
    /// Axis of the mesh that points up [default: z for OBJ, y for glTF]
    #[arg(long, value_name = "AXIS", requires = "mesh", value_parser = ["y", "z"])]
    up_axis: Option<String>,
    /// Where the source of a single response was, in metres; named s1 unless it is given a name
    #[arg(long, value_name = "[ID=]X,Y,Z", allow_hyphen_values = true)]
    source: Option<String>,
    /// Where its receiver was, in metres; named r1 unless it is given a name
    #[arg(long, value_name = "[ID=]X,Y,Z", allow_hyphen_values = true)]
    receiver: Option<String>,
    /// Read sounds that a table names outside its folder, too: only for tables that you trust
    #[arg(long)]
    allow_outside: bool,
    /// Tables of the room's materials, as a materials.toml [default: the library's where it has the name, else unknown]
    #[arg(long, value_name = "F")]
    materials: Option<PathBuf>,
    /// What sample 0 of a response is [default: as the file says, else common]
    #[arg(long, value_enum, value_name = "WHAT")]
    time_zero: Option<TimeZeroArgument>,
    /// What the levels mean [default: as the file says, else common]
    #[arg(long, value_enum, value_name = "WHAT")]
    levels: Option<LevelsArgument>,
    /// Relative humidity where the file has a temperature only
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0)]
    humidity: f64,
    /// How well the places are known: one standard deviation along each axis, in metres [default: not stated]
    #[arg(long, value_name = "M")]
    position_sd: Option<f64>,
    /// Folder to be made; it must not exist, or be empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum TimeZeroArgument {
    /// The instant of emission
    Emission,
    /// One unknown latency for all
    Common,
    /// An unknown latency for each
    PerResponse,
}

#[derive(Clone, Copy, ValueEnum)]
enum LevelsArgument {
    /// Calibrated: the direct sound at 1 m has amplitude 1
    Absolute,
    /// One unknown gain for all
    Common,
    /// An unknown gain for each
    PerResponse,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let set = read(arguments, &options(arguments))?;
    let model = model(arguments, &set)?;
    let notes = set.notes.clone();
    let new = set.into_room(model, arguments.position_sd);
    check_places(&new, &arguments.file)?;
    let room = new.write(&arguments.out)?;
    println!("{}", room.size_line());
    let (sources, receivers, responses) =
        (room.sources().len(), room.receivers().len(), room.responses().len());
    println!("{sources} sources, {receivers} receivers, {responses} responses");
    for note in notes.into_iter().chain(room.notes().iter().map(ToString::to_string)) {
        println!("note: {note}");
    }
    let folder = arguments.out.display();
    println!("wrote {folder}/room.toml, {folder}/room.obj and {folder}/ir");
    println!("next: sabine fit --room {folder} --out {folder}-fitted");
    Ok(())
}

fn options(arguments: &Arguments) -> ImportOptions {
    ImportOptions {
        time_zero: arguments.time_zero.map(|meaning| match meaning {
            TimeZeroArgument::Emission => TimeZero::Emission,
            TimeZeroArgument::Common => TimeZero::Common,
            TimeZeroArgument::PerResponse => TimeZero::PerResponse,
        }),
        levels: arguments.levels.map(|meaning| match meaning {
            LevelsArgument::Absolute => Levels::Absolute,
            LevelsArgument::Common => Levels::Common,
            LevelsArgument::PerResponse => Levels::PerResponse,
        }),
        relative_humidity_percent: arguments.humidity,
        allow_outside: arguments.allow_outside,
    }
}

/// The measurements of a file, whose ending says what it is.
fn read(arguments: &Arguments, options: &ImportOptions) -> Result<Measurements, Failure> {
    let file = &arguments.file;
    let ending = file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let many = ["sofa", "csv"].contains(&ending.as_str());
    match (&arguments.source, &arguments.receiver) {
        (None, None) if ending == "sofa" => Ok(Measurements::read_sofa(file, options)?),
        (None, None) if ending == "csv" => Ok(Measurements::read_table(file, options)?),
        _ if many => Err(format!(
            "{}: says itself where its places are: leave out --source and --receiver",
            file.display()
        )
        .into()),
        (Some(source), Some(receiver)) => {
            let source = one(source, "source")?;
            let receiver = one(receiver, "receiver")?;
            let source = Source { id: source.0, position_m: source.1, axis: None };
            let receiver = Receiver { id: receiver.0, position_m: receiver.1, axis: None };
            if let Some(address) = file.to_str().filter(|name| name.contains("://")) {
                return Ok(Measurements::read_rew(address, source, receiver, options)?);
            }
            Ok(Measurements::read_single(file, source, receiver, options)?)
        }
        _ => {
            let file = file.display();
            Err(format!("{file}: a single response needs --source X,Y,Z and --receiver X,Y,Z; several need a table (.csv) or SOFA (.sofa)").into())
        }
    }
}

fn one(text: &str, kind: &str) -> Result<(String, [f64; 3]), Failure> {
    let mut places = positions::places(&[text.to_owned()], kind)?;
    Ok(places.swap_remove(0))
}

fn model(arguments: &Arguments, set: &Measurements) -> Result<RoomModel, Failure> {
    let tables = arguments.materials.as_ref().map(Materials::read).transpose()?;
    let tables = tables.as_ref();
    match (&arguments.mesh, &arguments.size, set.shoebox_m) {
        (Some(mesh), _, _) => {
            let unit =
                LengthUnit::ALL.into_iter().find(|unit| arguments.units.as_deref() == Some(unit.symbol()));
            let up_axis =
                arguments.up_axis.as_deref().map(|axis| if axis == "y" { UpAxis::Y } else { UpAxis::Z });
            let options = MeshOptions { unit: unit.unwrap_or_default(), up_axis, ..MeshOptions::default() };
            Ok(RoomModel::of_mesh(mesh, &options, tables)?)
        }
        (None, Some(text), _) => {
            let model = RoomModel::of_box([[0.0; 3], positions::size(text)?], tables);
            Ok(model.map_err(|error| format!("--size {text}: {error}"))?)
        }
        (None, None, Some(corners)) => {
            let model = RoomModel::of_box(corners, tables);
            Ok(model.map_err(|error| {
                format!("{}: RoomCornerA, RoomCornerB: {error}", arguments.file.display())
            })?)
        }
        (None, None, None) => {
            let file = arguments.file.display();
            Err(format!("{file} does not say what the room is: give --mesh FILE, or --size LxWxH").into())
        }
    }
}

/// Every place must be in the room before anything is written. A count of surfaces needs a source and a receiver: each place is
/// looked at with the first of the other kind.
fn check_places(room: &NewRoom, file: &Path) -> Result<(), Failure> {
    let mesh = MeshScene::new(&room.scene)?;
    let (Some(first_source), Some(first_receiver)) = (room.sources.first(), room.receivers.first()) else {
        return Ok(());
    };
    let check = |source: &Source, receiver: &Receiver| {
        let inside = check_placement(&mesh, source, receiver).map(|_| ());
        inside.map_err(|error| format!("{}: {error}", file.display()))
    };
    room.sources.iter().try_for_each(|source| check(source, first_receiver))?;
    room.receivers.iter().try_for_each(|receiver| check(first_source, receiver))?;
    Ok(())
}
