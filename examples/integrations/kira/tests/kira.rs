//! What kira's mixer gives out is the dry sound and its convolution with the responses.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use kira::sound::static_sound::{StaticSoundData, StaticSoundSettings};
use kira::track::{SendTrackBuilder, SendTrackHandle, TrackBuilder, TrackHandle};
use kira::{AudioManager, AudioManagerSettings, Decibels, Frame};
use sabine_acoustics::{Channel, ImpulseResponse, read_audio, resample_response};
use sabine_with_kira::offline::{Offline, OfflineSettings};
use sabine_with_kira::{BLOCK, RoomEffectBuilder, RoomHandle};

const FRAMES: usize = 30_000;

fn response(file: &str) -> ImpulseResponse {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../fixtures/room/ir/");
    read_audio(format!("{folder}{file}.wav"), Channel::Mono).unwrap().into()
}

fn responses() -> [ImpulseResponse; 2] {
    [response("talker_microphone"), response("talker_corner")]
}

/// Handles keep their tracks alive.
struct Engine {
    manager: AudioManager<Offline>,
    room: RoomHandle,
    _send: SendTrackHandle,
    _track: TrackHandle,
}

/// An engine whose only sound, a second of noise, goes to the main track and, by this volume, to a room on a send track.
fn engine(sample_rate_hz: u32, room_volume: Decibels) -> Engine {
    let settings = AudioManagerSettings {
        backend_settings: OfflineSettings { sample_rate_hz },
        ..AudioManagerSettings::default()
    };
    let mut manager = AudioManager::<Offline>::new(settings).unwrap();
    let mut send = SendTrackBuilder::new();
    let room = send.add_effect(RoomEffectBuilder::new(responses(), 4.0).unwrap());
    let send = manager.add_send_track(send).unwrap();
    let mut track = manager.add_sub_track(TrackBuilder::new().with_send(&send, room_volume)).unwrap();
    let mut state = 1_u32;
    let frames = (0..sample_rate_hz)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            Frame::from_mono(0.02 * (state as f32 / u32::MAX as f32 - 0.5))
        })
        .collect();
    let settings = StaticSoundSettings::default();
    track.play(StaticSoundData { sample_rate: sample_rate_hz, frames, settings, slice: None }).unwrap();
    Engine { manager, room, _send: send, _track: track }
}

/// Left and right of so many frames, asked for in portions as sound cards do.
fn render(engine: &mut Engine, frames: usize) -> [Vec<f32>; 2] {
    let mut heard = Vec::new();
    for portion in [1, 64, 441, 1024].iter().cycle() {
        let now = (frames - heard.len() / 2).min(*portion);
        heard.extend(engine.manager.backend_mut().render(now));
        if heard.len() == 2 * frames {
            break;
        }
    }
    [0, 1].map(|channel| heard.iter().skip(channel).step_by(2).copied().collect())
}

/// What the engine plays without the room.
fn dry(sample_rate_hz: u32) -> Vec<f32> {
    let [left, _] = render(&mut engine(sample_rate_hz, Decibels::SILENCE), FRAMES);
    left
}

/// The plain sum, late by the block of the effect, at some samples.
fn wet_at(dry: &[f32], response: &ImpulseResponse, n: usize) -> f64 {
    let taps = response.samples().iter().enumerate();
    let heard = taps.filter_map(|(k, &h)| Some((h, dry.get(n.checked_sub(k + BLOCK)?)?)));
    heard.map(|(h, &x)| f64::from(h) * f64::from(x)).sum()
}

#[test]
fn the_mixer_gives_out_the_dry_sound_and_the_convolution() {
    let rate_hz = response("talker_microphone").sample_rate_hz();
    for rate_hz in [rate_hz, 48_000] {
        let mut engine = engine(rate_hz, Decibels::IDENTITY);
        let heard = render(&mut engine, FRAMES);
        let dry = dry(rate_hz);
        for (heard, response) in heard.iter().zip(responses()) {
            let response = resample_response(&response, rate_hz).unwrap();
            let mut peak = 0.0_f64;
            for n in (0..FRAMES).step_by(37) {
                let wet = wet_at(&dry, &response, n);
                let off = (f64::from(heard[n]) - f64::from(dry[n]) - wet).abs();
                assert!(off < 2e-6, "{rate_hz} Hz, frame {n}: {} != {} + {wet}", heard[n], dry[n]);
                peak = peak.max(wet.abs());
            }
            assert!(peak > 1e-3, "the room is heard");
        }
    }
}

#[test]
fn another_room_and_another_sample_rate_are_heard_while_it_plays() {
    let rate_hz = response("talker_microphone").sample_rate_hz();
    let mut engine = engine(rate_hz, Decibels::IDENTITY);
    let pulse = |gain: f32| ImpulseResponse::new(vec![gain], rate_hz).unwrap();
    engine.room.change_room([pulse(0.5), pulse(0.25)]).unwrap();
    // Taken up with the first block: faded long before the sound ends.
    let [left, right] = render(&mut engine, 4000);
    let dry = dry(rate_hz);
    for n in 3900..4000 {
        for (heard, gain) in [(left[n], 0.5), (right[n], 0.25)] {
            assert!((heard - dry[n] - gain * dry[n - BLOCK]).abs() < 2e-6, "frame {n}: {heard}");
        }
    }
    let too_long = ImpulseResponse::new(vec![0.1; 400_000], rate_hz).unwrap();
    assert!(engine.room.change_room([pulse(0.5), too_long]).is_err());

    // A rate that no room runs at silences the room alone, until the next change.
    engine.manager.backend_mut().change_sample_rate(999);
    render(&mut engine, 10);
    engine.manager.backend_mut().change_sample_rate(2 * rate_hz);
    let [left, right] = render(&mut engine, 4000);
    let different = |from: usize, left: &[f32], right: &[f32]| {
        left[from..].iter().zip(&right[from..]).filter(|(l, r)| (*l - *r).abs() > 1e-4).count()
    };
    assert!(different(3000, &left, &right) > 900, "the room is heard at the new rate");
    engine.room.change_room([pulse(0.0), pulse(0.0)]).unwrap();
    let [left, right] = render(&mut engine, 6000);
    assert_eq!(different(5000, &left, &right), 0, "and the handle changes it");
    assert!(left[5000..].iter().any(|s| s.abs() > 1e-3), "while the sound goes on");
}
