//! The room of a command: which one, and how it is read.

use crate::demo::Demo;
use crate::failure::Failure;
use clap::Args;
use sabine::acoustics::MeasuredRoom;
use std::path::PathBuf;

/// Options of every command that reads a room.
#[derive(Args, Debug, Default)]
pub struct RoomArguments {
    /// Folder with room.toml and its mesh [default: the built-in demo]
    #[arg(long = "room", value_name = "DIR")]
    pub folder: Option<PathBuf>,
}

impl RoomArguments {
    /// The room, and its name as the user should read it.
    ///
    /// # Errors
    /// The room cannot be read: the error names file and field.
    pub fn read(&self, demo: &mut Demo) -> Result<(MeasuredRoom, String), Failure> {
        let folder = demo.or(self.folder.as_deref(), "room")?;
        Ok((MeasuredRoom::read(&folder)?, demo.name(&folder)))
    }
}
