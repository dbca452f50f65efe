//! The room of a command: which one, and how it is read.

use crate::demo::Demo;
use crate::failure::Failure;
use clap::Args;
use sabine::scene::{MeasuredRoom, ReadOptions, Receiver, Source};
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

/// Options of every command that works between one source and one receiver.
#[derive(Args, Debug, Default)]
pub struct PlaceArguments {
    /// Source in the room file [default: its first; where a measured response is needed, the first response's]
    #[arg(long, value_name = "ID")]
    pub source: Option<String>,
    /// Receiver in the room file [default: its first; where a measured response is needed, the first response's]
    #[arg(long, value_name = "ID")]
    pub receiver: Option<String>,
}

impl PlaceArguments {
    /// Source and receiver that were asked for, or the room's first.
    ///
    /// # Errors
    /// The room has none of that name, or none at all.
    pub fn of<'r>(&self, room: &'r MeasuredRoom) -> Result<(&'r Source, &'r Receiver), Failure> {
        let source = match &self.source {
            Some(id) => room.source(id)?,
            None => room.sources().first().ok_or("room.toml: sources: there is none")?,
        };
        let receiver = match &self.receiver {
            Some(id) => room.receiver(id)?,
            None => room.receivers().first().ok_or("room.toml: receivers: there is none")?,
        };
        Ok((source, receiver))
    }

    /// Number of the first response that was measured between the source and the receiver that were asked for; `None` where there
    /// is none. A place that was not asked for may be any.
    ///
    /// # Errors
    /// The room has no source or receiver of that name.
    pub fn response(&self, room: &MeasuredRoom) -> Result<Option<usize>, Failure> {
        if let Some(id) = &self.source {
            room.source(id)?;
        }
        if let Some(id) = &self.receiver {
            room.receiver(id)?;
        }
        let wanted = |wanted: &Option<String>, id: &str| wanted.as_deref().is_none_or(|wanted| wanted == id);
        Ok(room.responses().iter().position(|entry| {
            wanted(&self.source, &room.sources()[entry.source].id)
                && wanted(&self.receiver, &room.receivers()[entry.receiver].id)
        }))
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
