//! What is heard: the convolution with the room's responses, whatever the sample rate and the blocks.

use crate::host::{Rack, change, convolved, decay, noise, state};
use clack_extensions::audio_ports_config::{AudioPortsConfigBuffer, PluginAudioPortsConfig};
use clack_extensions::tail::TailLength;
use clack_host::prelude::ClapId;
use sabine_acoustics::{
    Channel, ImpulseResponse, SampleFormat, read_audio, resample_response, write_wav_channels,
};
use sabine_clap_plugin::{LATENCY_SAMPLES, Parameter};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use tempfile::TempDir;

const LATE: usize = LATENCY_SAMPLES as usize;
const OFF_DB: f64 = Parameter::LEAST_DB;

/// A file with these channels at 48 kHz.
fn room(folder: &TempDir, name: &str, channels: &[Vec<f32>]) -> PathBuf {
    let path = folder.path().join(name);
    let channels: Vec<&[f32]> = channels.iter().map(Vec::as_slice).collect();
    write_wav_channels(&path, &channels, 48_000, SampleFormat::Float32).unwrap();
    path
}

fn at_rate(response: &[f32], rate_hz: u32) -> Vec<f32> {
    let response = ImpulseResponse::new(response.to_vec(), 48_000).unwrap();
    resample_response(&response, rate_hz).unwrap().into_samples()
}

#[test]
fn an_impulse_gives_the_response_and_a_tail_as_long() {
    let folder = tempfile::tempdir().unwrap();
    let sides = [decay(9000, 1), decay(9000, 2)];
    let mut rack = Rack::with_room(&room(&folder, "hall.wav", &sides), 0.0, OFF_DB);
    let mut player = rack.start(48e3, 512, 2);
    assert_eq!(player.tail(), TailLength::Finite(64 + 9000 - 1));
    let mut impulse = vec![0.0; 10_000];
    impulse[0] = 1.0;
    let heard = player.render(&[&impulse, &impulse], &[], &[512]);
    for (heard, response) in heard.iter().zip(&sides) {
        let wanted = |n: usize| n.checked_sub(LATE).and_then(|n| response.get(n)).copied().unwrap_or(0.0);
        let off = (0..10_000).map(|n| (heard[n] - wanted(n)).abs()).fold(0.0, f32::max);
        assert!(off < 1e-6, "{off}");
    }
    rack.stop(player);
}

#[test]
fn every_rate_and_every_block_give_the_convolution() {
    let folder = tempfile::tempdir().unwrap();
    let sides = [decay(12_000, 3), decay(12_000, 4)];
    let path = room(&folder, "hall.wav", &sides);
    for rate_hz in [44_100, 48_000, 96_000] {
        let frames = 30_000;
        let input = [noise(frames, 5, 0.5), noise(frames, 6, 0.5)];
        let given: Vec<&[f32]> = input.iter().map(Vec::as_slice).collect();
        let mut first: Option<[Vec<f32>; 2]> = None;
        for blocks in [&[480][..], &[1], &[64], &[4096], &[1, 64, 480, 4096, 7]] {
            let mut rack = Rack::with_room(&path, 0.0, -6.0);
            let mut player = rack.start(f64::from(rate_hz), 4096, 2);
            let heard = player.render(&given, &[], blocks);
            rack.stop(player);
            if let Some(first) = &first {
                assert!(*first == heard, "{rate_hz} Hz, blocks of {blocks:?}: to the last bit");
                continue;
            }
            for ((heard, input), side) in heard.iter().zip(&input).zip(&sides) {
                let response = at_rate(side, rate_hz);
                for n in (0..frames).step_by(997) {
                    let dry = n.checked_sub(LATE).map_or(0.0, |n| f64::from(input[n]));
                    let wet = n.checked_sub(LATE).map_or(0.0, |n| convolved(input, &response, n));
                    let wanted = wet + 10_f64.powf(-0.3) * dry;
                    // Partitions of single precision: a hundred thousandth of the sum of magnitudes.
                    assert!((f64::from(heard[n]) - wanted).abs() < 2e-5, "{rate_hz} Hz, frame {n}");
                }
            }
            first = Some(heard);
        }
    }
}

#[test]
fn a_mono_file_serves_both_sides_and_four_channels_lead_across() {
    let folder = tempfile::tempdir().unwrap();
    let parts: Vec<Vec<f32>> = (0..4).map(|seed| decay(3000, 10 + seed)).collect();
    let input = [noise(5000, 20, 0.5), noise(5000, 21, 0.5)];
    let given: Vec<&[f32]> = input.iter().map(Vec::as_slice).collect();
    // Responses from left and from right to each side.
    for (channels, pairs) in [
        (&parts[..1], [[Some(0), None], [None, Some(0)]]),
        (&parts[..2], [[Some(0), None], [None, Some(1)]]),
        (&parts[..4], [[Some(0), Some(2)], [Some(1), Some(3)]]),
    ] {
        let path = room(&folder, "room.wav", channels);
        let mut rack = Rack::with_room(&path, 0.0, OFF_DB);
        let mut player = rack.start(48e3, 300, 2);
        let heard = player.render(&given, &[], &[300]);
        for (heard, from) in heard.iter().zip(pairs) {
            for n in (LATE..5000).step_by(83) {
                let parts = from.iter().zip(&input);
                let wanted: f64 = parts
                    .filter_map(|(pair, input)| Some(convolved(input, &channels[(*pair)?], n - LATE)))
                    .sum();
                assert!((f64::from(heard[n]) - wanted).abs() < 2e-5, "{} channels", channels.len());
            }
        }
        rack.stop(player);
    }
}

#[test]
fn mono_comes_in_where_the_host_chooses_it() {
    let folder = tempfile::tempdir().unwrap();
    let sides = [decay(3000, 30), decay(3000, 31)];
    let mut rack = Rack::with_room(&room(&folder, "room.wav", &sides), 0.0, -6.0);
    let plugin = rack.instance.plugin_handle();
    let choices: PluginAudioPortsConfig = plugin.get_extension().unwrap();
    let mut buffer = AudioPortsConfigBuffer::new();
    let mono = (0..choices.count(&plugin))
        .find_map(|index| {
            let choice = choices.get(&plugin, index, &mut buffer)?;
            (choice.main_input?.channel_count == 1).then_some(choice.id)
        })
        .unwrap();
    assert!(choices.select(&plugin, ClapId::new(99)).is_err());
    choices.select(&plugin, mono).unwrap();
    let mut player = rack.start(48e3, 256, 1);
    let input = noise(5000, 32, 0.5);
    let heard = player.render(&[&input], &[], &[256]);
    for (heard, side) in heard.iter().zip(&sides) {
        for n in (LATE..5000).step_by(83) {
            let dry = 10_f64.powf(-0.3) * f64::from(input[n - LATE]);
            let wanted = dry + convolved(&input, side, n - LATE);
            assert!((f64::from(heard[n]) - wanted).abs() < 2e-5, "frame {n}");
        }
    }
    rack.stop(player);
}

#[test]
fn another_room_fades_in_while_it_plays() {
    let folder = tempfile::tempdir().unwrap();
    let [before, after] = [("before.wav", 0.5), ("after.wav", -0.25)]
        .map(|(name, gain)| room(&folder, name, &[vec![gain; if gain > 0.0 { 1 } else { 400 }]]));
    let mut rack = Rack::with_room(&before, 0.0, OFF_DB);
    let mut player = rack.start(48e3, 480, 2);
    let ones = vec![1.0; 4800];
    let first = player.render(&[&ones, &ones], &[], &[480]);
    assert!(first[0][LATE..].iter().all(|s| (s - 0.5).abs() < 1e-5));
    assert!(rack.load(state(&after, 0.0, OFF_DB).as_bytes()));
    // Long enough for the parts of the response that are convolved in longer blocks.
    let ones = vec![1.0; 9600];
    let then = player.render(&[&ones, &ones], &[], &[480]);
    assert_eq!(rack.asked.tail_changes.load(Ordering::Relaxed), 1);
    assert_eq!(player.tail(), TailLength::Finite(64 + 400 - 1));
    let last = then[0].last().unwrap();
    assert!((last - -100.0).abs() < 1e-2, "{last}");
    let steps = std::iter::once(&first[0][4799]).chain(&then[0]).zip(&then[0]);
    let widest = steps.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // From 0.5 to -100 in a line of 50 ms or 2400 samples, rounded up to blocks.
    assert!(widest < 1.2 * 100.5 / 2400.0, "no click: {widest}");
    rack.stop(player);
}

#[test]
fn reset_forgets_and_a_new_start_takes_another_rate() {
    let folder = tempfile::tempdir().unwrap();
    let response = decay(20_000, 40);
    let mut rack = Rack::with_room(&room(&folder, "room.wav", std::slice::from_ref(&response)), 0.0, OFF_DB);
    let mut player = rack.start(48e3, 1000, 2);
    let input = noise(5000, 41, 0.5);
    assert!(player.render(&[&input, &input], &[], &[1000])[0].iter().any(|s| s.abs() > 0.01));
    player.processor.reset();
    let silence = vec![0.0; 25_000];
    assert!(player.render(&[&silence, &silence], &[], &[1000])[1].iter().all(|s| *s == 0.0));
    rack.stop(player);
    let mut player = rack.start(96e3, 64, 2);
    assert_eq!(player.tail(), TailLength::Finite(64 + at_rate(&response, 96_000).len() as u32 - 1));
    let heard = player.render(&[&input, &input], &[], &[64]);
    let wanted = convolved(&input, &at_rate(&response, 96_000), 4000);
    assert!((f64::from(heard[0][4000 + LATE]) - wanted).abs() < 2e-5);
    rack.stop(player);
}

#[test]
fn the_built_in_hall_sounds_at_once() {
    let mut rack = Rack::new();
    let mut player = rack.start(48e3, 4096, 2);
    let mut impulse = vec![0.0; 96_000];
    impulse[0] = 1.0;
    let mute_dry = change(0, Parameter::Dry, OFF_DB);
    let heard = player.render(&[&impulse, &impulse], &[mute_dry], &[4096]);
    for heard in &heard {
        let energy = |from: usize| heard[from..from + 9600].iter().map(|s| f64::from(s * s)).sum::<f64>();
        assert!(energy(4800) > 1e-3 && energy(86_400) < 1e-3 * energy(4800), "{}", energy(86_400));
    }
    assert!(heard[0] != heard[1], "two sides");
    assert_eq!(rack.asked.log(), []);
    rack.stop(player);
}

/// The sound of docs/img/clap_hall.png: `cargo test -p sabine-clap-plugin --test it what_the_page_draws -- --ignored`, then
/// `docs/img/draw_heard.py`.
#[test]
#[ignore = "writes out/with_clap/heard.wav"]
fn what_the_page_draws_of_the_built_in_hall() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../.."));
    let voice = read_audio(root.join("fixtures/speech/dry_guest.wav"), Channel::Mono).unwrap();
    let rate = voice.sample_rate_hz();
    let input: Vec<f32> = voice.samples().iter().copied().cycle().take(12 * rate as usize).collect();
    let at = |seconds: usize| seconds * rate as usize;
    let events = [
        change(0, Parameter::Wet, -60.0),
        change(at(4), Parameter::Wet, -14.0),
        change(at(8), Parameter::Wet, 0.0),
    ];
    let mut rack = Rack::new();
    let mut player = rack.start(f64::from(rate), 1024, 2);
    let [left, right] = player.render(&[&input, &input], &events, &[1024]);
    rack.stop(player);
    let folder = root.join("out/with_clap");
    std::fs::create_dir_all(&folder).unwrap();
    write_wav_channels(folder.join("heard.wav"), &[&left, &right], rate, SampleFormat::Float32).unwrap();
    // Between words the hall is heard, the more of it the louder.
    let quietest = |from: usize| {
        let energies = left[at(from + 1)..at(from + 4)].chunks(rate as usize / 20);
        energies.map(|part| part.iter().map(|s| s * s).sum::<f32>()).fold(f32::INFINITY, f32::min)
    };
    assert!(10.0 * quietest(0) < quietest(4) && 3.0 * quietest(4) < quietest(8));
}
