//! Gives a weights file of an older version its checksum: `cargo run -p sabine-estimator --example add_checksum -- FILE`.

use std::io::Write;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path: PathBuf = std::env::args_os().nth(1).ok_or("which weights file?")?.into();
    let bytes = sabine_estimator::add_checksum(&std::fs::read(&path)?)?;
    sabine_acoustics::write_atomically(&path, |file| file.write_all(&bytes))?;
    Ok(())
}
