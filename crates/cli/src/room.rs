//! The room of a command: which one, and how it is read.

use crate::demo::Demo;
use crate::failure::Failure;
use clap::Args;
use sabine::acoustics::{MeasuredRoom, ReadOptions};
use std::path::{Path, PathBuf};

/// Options of every command that reads a room.
#[derive(Args, Debug, Default)]
pub struct RoomArguments {
    /// Folder with room.toml and its mesh [default: the built-in demo]
    #[arg(long = "room", value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// Read a mesh or responses outside the room's folder, too: only for rooms that you trust
    #[arg(long)]
    pub allow_outside: bool,
    /// Tables of materials instead of the room's: a materials.toml as `fit` and `match` write it
    #[arg(long, value_name = "F")]
    pub materials: Option<PathBuf>,
}

impl RoomArguments {
    /// The room, and its name as the user should read it. Its size and what should be known of it are printed.
    ///
    /// # Errors
    /// The room cannot be read: the error names file and field.
    pub fn read(&self, demo: &mut Demo) -> Result<(MeasuredRoom, String), Failure> {
        let folder = demo.or(self.folder.as_deref(), "room")?;
        let room = read_room(&folder, self.allow_outside, self.materials.as_deref())?;
        Ok((room, demo.name(&folder)))
    }
}

/// Reads a room, with the tables of a file where there is one, and prints its size and what should be known of it before numbers are
/// believed.
///
/// # Errors
/// Room or tables cannot be read, or a table is of a material that the room does not have: the error names file and field.
pub fn read_room(
    folder: &Path,
    allow_outside: bool,
    materials: Option<&Path>,
) -> Result<MeasuredRoom, Failure> {
    let mut room = MeasuredRoom::read_with(folder, &ReadOptions { allow_outside })?;
    if let Some(file) = materials {
        room = room.with_materials_file(file)?;
    }
    println!("{}", room.size_line());
    for note in room.notes() {
        println!("note: {note}");
    }
    Ok(room)
}
