//! The whole job on files of your own, read and written in blocks.
//!
//! ```text
//! cargo run -p sabine --example match_files -- recording.wav my_room voice.wav matched.wav
//! ```
//!
//! `my_room` is the folder of a room (docs/measured-room.md of the repository); `recording.wav` is speech recorded in it, `voice.wav` is
//! a dry voice that should sound as if it were there.

use sabine::acoustics::Channel;
use sabine::scene::MeasuredRoom;
use sabine::{MatchConfig, MatchFiles, match_room_files, materials_toml};
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [speech, room, dry, matched] = &files[..] else {
        return Err("four arguments: recording, folder of the room, dry sound, where to write".into());
    };
    let room = MeasuredRoom::read(room)?;
    let (Some(source), Some(receiver)) = (room.sources().first(), room.receivers().first()) else {
        return Err("room.toml names no source or no receiver".into());
    };
    let files = MatchFiles {
        speech,
        dry,
        channel: Channel::Mono,
        room: &room,
        source: &source.id,
        receiver: &receiver.id,
        matched,
    };
    let found = match_room_files(&files, &MatchConfig::default(), &())?;
    for warning in &found.matched.warnings {
        println!("note: {warning}");
    }
    // The fitted materials, as a file that `MeasuredRoom::with_materials_file` reads.
    print!("{}", materials_toml(&found.matched)?);
    println!("# written: {}", matched.display());
    Ok(())
}
