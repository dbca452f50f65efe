//! A voice in a room, mixed by kira and written to a file.
//!
//! ```text
//! cargo run -p sabine-with-kira [LEFT.wav RIGHT.wav VOICE.wav]
//! ```
//!
//! In a game, kira's default features play the same to the sound card: `AudioManager::<DefaultBackend>`.

use kira::sound::static_sound::{StaticSoundData, StaticSoundSettings};
use kira::track::{SendTrackBuilder, TrackBuilder};
use kira::{AudioManager, AudioManagerSettings, Decibels, Frame};
use sabine_acoustics::{Channel, SampleFormat, read_audio, write_wav_channels};
use sabine_with_kira::RoomEffectBuilder;
use sabine_with_kira::offline::{Offline, OfflineSettings};
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

    let mut manager = AudioManager::<Offline>::new(AudioManagerSettings {
        backend_settings: OfflineSettings { sample_rate_hz: voice.sample_rate_hz() },
        ..AudioManagerSettings::default()
    })?;
    let mut room = SendTrackBuilder::new();
    let handle = room.add_effect(RoomEffectBuilder::new(responses, 4.0)?);
    handle.set_gain(0.5)?;
    let room = manager.add_send_track(room)?;
    let mut track = manager.add_sub_track(TrackBuilder::new().with_send(&room, Decibels::IDENTITY))?;
    track.play(StaticSoundData {
        sample_rate: voice.sample_rate_hz(),
        frames: voice.samples().iter().map(|&s| Frame::from_mono(0.5 * s)).collect(),
        settings: StaticSoundSettings::default(),
        slice: None,
    })?;

    let seconds = voice.duration_s() + 2.0;
    let calls = (seconds * f64::from(voice.sample_rate_hz()) / 441.0).ceil() as usize;
    let heard: Vec<f32> = (0..calls).flat_map(|_| manager.backend_mut().render(441)).collect();
    let out = Path::new("out/with_kira");
    std::fs::create_dir_all(out)?;
    let file = out.join("heard.wav");
    let [left, right] = [0, 1].map(|c| heard.iter().skip(c).step_by(2).copied().collect::<Vec<f32>>());
    write_wav_channels(&file, &[&left, &right], voice.sample_rate_hz(), SampleFormat::Float32)?;
    println!("wrote {seconds:.1} s of sound to {}", file.display());
    Ok(())
}
