//! Sound in a room, block by block as a sound card asks for it, with a cross-fade into another room on the way.
//!
//! ```text
//! cargo run --example live_convolution
//! ```
//!
//! It writes `out/live_convolution/heard.wav` and prints
//! ```text
//! 8.4 s of sound in blocks of 11.6 ms
//! asked for another room at 2.79 s, heard it alone from 3.25 s
//! largest difference from one long convolution, relative to the peak:
//!   first room -133 dB
//!   second room -132 dB
//! wrote out/live_convolution/heard.wav, its level changed by +0.2 dB
//! ```
//!
//! While somebody speaks and the room is estimated: `sabine live`. Threads, latency, what allocates: `docs/how-to/live-use.md`.

use sabine::acoustics::{Channel, SampleFormat, read_audio, write_wav};
use sabine::augment::{T60Augment, T60Config};
use sabine::eqfilter::{PartitionedConfig, PartitionedConvolver, convolve};
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let voice = read_audio(fixtures.join("speech/dry_guest.wav"), Channel::Mono)?;
    let rate_hz = f64::from(voice.sample_rate_hz());
    let room = read_audio(fixtures.join("room/ir/talker_microphone.wav"), Channel::Mono)?.into();
    // The other room: the same one, twice as reverberant.
    let hall =
        T60Augment::new(T60Config { longest_s: 4.0, ..T60Config::default() })?.by_factor(&room, 2.0, 1)?;

    // All that allocates happens here, and in the preparer: on another thread, when a new response is known.
    let longest_response = room.samples().len().max(hall.samples().len());
    let config = PartitionedConfig { block: 256, longest_response, fade_blocks: 8 };
    let mut convolver = PartitionedConvolver::new(room.samples(), config)?;
    let preparer = convolver.preparer();
    let response = hall.samples().to_vec();
    let hall_prepared = std::thread::spawn(move || preparer.prepare(&response));
    let mut next = Some(hall_prepared.join().map_err(|_| "the preparing thread has panicked")??);

    // The audio thread: blocks in, blocks out.
    let mut input = voice.samples().to_vec();
    input.resize(input.len().next_multiple_of(config.block) + 256 * config.block, 0.0);
    let mut heard = vec![0.0; input.len()];
    let change = input.len() / 3 / config.block;
    let (mut changed, mut slowest_s) = (None, 0.0_f64);
    let start = Instant::now();
    for (i, (dry, wet)) in input.chunks(config.block).zip(heard.chunks_mut(config.block)).enumerate() {
        if i == change
            && let Some(response) = next.take()
            && convolver.exchange(response).is_err()
        {
            return Err("the convolver did not take the new response".into());
        }
        let block_start = Instant::now();
        convolver.process_block(dry, wet)?;
        slowest_s = slowest_s.max(block_start.elapsed().as_secs_f64());
        // The old response comes back when the cross-fade is over: to be dropped elsewhere.
        if convolver.take_retired().is_some() {
            changed = Some((i + 1) * config.block);
        }
    }
    let work_s = start.elapsed().as_secs_f64();
    let changed = changed.ok_or("the voice ended before the cross-fade did")?;

    let sound_s = input.len() as f64 / rate_hz;
    println!("{sound_s:.1} s of sound in blocks of {:.1} ms", 1e3 * config.block as f64 / rate_hz);
    let [from_s, to_s] = [change * config.block, changed].map(|n| n as f64 / rate_hz);
    println!("asked for another room at {from_s:.2} s, heard it alone from {to_s:.2} s");
    eprintln!("worked {work_s:.2} s, {:.2} ms in the slowest block", 1e3 * slowest_s);

    // Block by block or at once: the same sound, from before the change to after it.
    let before = change * config.block;
    let difference = |response: &[f32], part: std::ops::Range<usize>| {
        let whole = convolve(&input, response);
        let most = part.clone().map(|n| (heard[n] - whole[n]).abs()).fold(0.0, f32::max);
        20.0 * (most / whole[part].iter().fold(0.0_f32, |peak, s| peak.max(s.abs()))).log10()
    };
    println!("largest difference from one long convolution, relative to the peak:");
    println!("  first room {:.0} dB", difference(room.samples(), 0..before));
    println!("  second room {:.0} dB", difference(hall.samples(), changed..input.len()));

    let gain = 0.9 / heard.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    heard.iter_mut().for_each(|s| *s *= gain);
    let out = Path::new("out/live_convolution");
    std::fs::create_dir_all(out)?;
    write_wav(out.join("heard.wav"), &heard, voice.sample_rate_hz(), SampleFormat::Int16)?;
    println!(
        "wrote {}, its level changed by {:+.1} dB",
        out.join("heard.wav").display(),
        20.0 * gain.log10()
    );
    Ok(())
}
