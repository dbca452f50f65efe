//! A voice in a room, mixed by firewheel's graph and written to a file.
//!
//! ```text
//! cargo run -p sabine-with-firewheel [LEFT.wav RIGHT.wav VOICE.wav]
//! ```
//!
//! In a game, firewheel's feature `cpal` starts the same graph on the sound card, and a sampler node takes the place of the input.

use firewheel::channel_config::ChannelCount;
use firewheel::{FirewheelConfig, FirewheelContext, Volume};
use sabine_acoustics::{Channel, SampleFormat, read_audio, write_wav_channels};
use sabine_with_firewheel::offline::Offline;
use sabine_with_firewheel::{RoomNode, RoomNodeConfig};
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
    let responses = vec![read_audio(left, Channel::Mono)?.into(), read_audio(right, Channel::Mono)?.into()];
    let voice = read_audio(voice, Channel::Mono)?;
    let rate_hz = voice.sample_rate_hz();

    let mut context = FirewheelContext::new(FirewheelConfig {
        num_graph_inputs: ChannelCount::MONO,
        ..FirewheelConfig::default()
    });
    let room = RoomNode { wet: Volume::Decibels(-12.0), dry: Volume::Decibels(-6.0) };
    let config = RoomNodeConfig { responses, longest_s: 4.0, ..RoomNodeConfig::default() };
    let room = context.add_node(room, Some(config))?;
    let (input, output) = (context.graph_in_node_id(), context.graph_out_node_id());
    context.connect(input, room, &[(0, 0)], true)?;
    context.connect(room, output, &[(0, 0), (1, 1)], true)?;

    let mut stream = Offline::start(&mut context, rate_hz.try_into()?, 1)?;
    let mut voice = voice.into_samples();
    voice.resize(voice.len() + 2 * rate_hz as usize, 0.0);
    let mut heard = vec![0.0; 2 * voice.len()];
    for (dry, wet) in voice.chunks(441).zip(heard.chunks_mut(2 * 441)) {
        stream.render(dry, wet);
        context.update()?; // a game does so with each picture
    }

    let out = Path::new("out/with_firewheel");
    std::fs::create_dir_all(out)?;
    let file = out.join("heard.wav");
    let [left, right] = [0, 1].map(|c| heard.iter().skip(c).step_by(2).copied().collect::<Vec<f32>>());
    write_wav_channels(&file, &[&left, &right], rate_hz, SampleFormat::Float32)?;
    println!("wrote {:.1} s of sound to {}", left.len() as f64 / f64::from(rate_hz), file.display());
    Ok(())
}
