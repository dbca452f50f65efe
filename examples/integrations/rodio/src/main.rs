//! A voice in a room, as rodio plays it, written to a file.
//!
//! ```text
//! cargo run -p sabine-with-rodio [LEFT.wav RIGHT.wav VOICE.wav]
//! ```
//!
//! With rodio's default features the same source goes to the sound card: append it to a player.

use rodio::Source;
use rodio::buffer::SamplesBuffer;
use sabine_acoustics::{Channel, SampleFormat, read_audio, write_wav_channels};
use sabine_with_rodio::Room;
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../fixtures"));
    let given: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let own = ["room/ir/talker_microphone.wav", "room/ir/talker_corner.wav", "speech/dry_guest.wav"];
    let [left, right, voice] = match &given[..] {
        [] => own.map(|file| fixtures.join(file)),
        [left, right, voice] => [left, right, voice].map(PathBuf::clone),
        _ => return Err("give three files, LEFT.wav RIGHT.wav VOICE.wav, or none".into()),
    };
    let responses = [read_audio(left, Channel::Mono)?.into(), read_audio(right, Channel::Mono)?.into()];
    let voice = read_audio(voice, Channel::Mono)?;
    let rate = voice.sample_rate_hz().try_into()?;
    let source = SamplesBuffer::new(1.try_into()?, rate, voice.into_samples());

    let room = Room::new(source.amplify(0.5), &responses, 4.0)?;
    let rate_hz = room.sample_rate().get();
    let heard: Vec<f32> = room.collect();
    let out = Path::new("out/with_rodio");
    std::fs::create_dir_all(out)?;
    let file = out.join("heard.wav");
    let [left, right] = [0, 1].map(|c| heard.iter().skip(c).step_by(2).copied().collect::<Vec<f32>>());
    write_wav_channels(&file, &[&left, &right], rate_hz, SampleFormat::Float32)?;
    println!("wrote {:.1} s of sound to {}", left.len() as f64 / f64::from(rate_hz), file.display());
    Ok(())
}
