//! What devices are given and give: every format, every number of channels, too little and too much, and devices that vanish.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use dasp_sample::{FromSample, I24};
use sabine_acoustics::{ImpulseResponse, SampleFormat, write_wav, write_wav_channels};
use sabine_with_cpal::{
    Command, Error, Input, Player, PlayerConfig, Watch, microphone, read_room, read_voice,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

const RATE_HZ: u32 = 48_000;

fn config(channels: u16) -> PlayerConfig {
    PlayerConfig { sample_rate_hz: RATE_HZ, channels, wet: 1.0, dry: 0.0, longest_s: 1.0 }
}

fn response(samples: &[f32]) -> ImpulseResponse {
    ImpulseResponse::new(samples.to_vec(), RATE_HZ).unwrap()
}

/// A player whose left ear hears the input at once and whose right ear hears half of it two frames later.
fn player(input: Input, channels: u16, watch: &Arc<Watch>) -> Player {
    Player::new(input, &[response(&[1.0]), response(&[0.0, 0.0, 0.5])], config(channels), watch).unwrap()
}

fn noise(samples: usize, seed: u32) -> Vec<f32> {
    let mut state = seed;
    (0..samples)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as f32 / u32::MAX as f32 - 0.5
        })
        .collect()
}

/// Frames in portions as sound systems ask for them.
fn fill<T: FromSample<f32> + Clone>(player: &mut Player, frames: usize, channels: u16) -> Vec<T> {
    let mut heard: Vec<T> = Vec::new();
    for portion in [480, 1, 1024, 0, 37].into_iter().cycle() {
        let now = portion.min(frames - heard.len() / usize::from(channels));
        let mut buffer = vec![T::from_sample_(0.7); now * usize::from(channels)];
        player.fill(&mut buffer);
        heard.extend(buffer);
        if heard.len() == frames * usize::from(channels) {
            return heard;
        }
    }
    heard
}

#[test]
fn a_recording_is_repeated_in_the_room_on_every_number_of_channels() {
    let recording = noise(700, 1);
    for channels in [1, 2, 3, 6, 64] {
        let watch = Arc::new(Watch::default());
        let mut player = player(Input::Loop(recording.clone()), channels, &watch);
        let late = player.latency_samples();
        let heard: Vec<f32> = fill(&mut player, 3000, channels);
        // Frame n of the input, that of a recording without end.
        let dry = |n: usize| if n >= late { recording[(n - late) % 700] } else { 0.0 };
        for (n, frame) in heard.chunks_exact(usize::from(channels)).enumerate() {
            let (left, right) = (dry(n), if n >= 2 { 0.5 * dry(n - 2) } else { 0.0 });
            let expected: &[f32] = if channels == 1 { &[0.5 * (left + right)] } else { &[left, right] };
            for (channel, &sample) in frame.iter().enumerate() {
                let expected = expected.get(channel).copied().unwrap_or(0.0);
                assert!(
                    (sample - expected).abs() < 1e-6,
                    "{channels} channels, frame {n}: {sample} != {expected}"
                );
            }
        }
        assert_eq!(watch.figures().frames, 3000);
    }
}

/// The first frames of a player that gives out its input as it is, which is far above full scale, and far below it two frames later.
fn loud<T: FromSample<f32> + Clone>() -> [T; 3] {
    let watch = Arc::new(Watch::default());
    let input = Input::Loop(vec![9.0, 0.25, -9.0, 0.0]);
    let config = PlayerConfig { wet: 0.0, dry: 1.0, ..config(2) };
    let mut player = Player::new(input, &[response(&[1.0]), response(&[1.0])], config, &watch).unwrap();
    let late = player.latency_samples();
    let heard: Vec<T> = fill(&mut player, late + 3, 2);
    [0, 1, 2].map(|n| heard[2 * (late + n)].clone())
}

#[test]
fn every_format_of_samples_is_clipped_at_its_own_full_scale() {
    assert_eq!(loud::<f32>(), [1.0 - f32::EPSILON / 2.0, 0.25, -1.0]);
    assert_eq!(loud::<f64>(), [1.0 - f64::from(f32::EPSILON) / 2.0, 0.25, -1.0]);
    assert_eq!(loud::<i8>(), [i8::MAX, 32, i8::MIN]);
    assert_eq!(loud::<u8>(), [u8::MAX, 160, 0]);
    assert_eq!(loud::<i16>(), [i16::MAX, 8192, i16::MIN]);
    assert_eq!(loud::<u16>(), [u16::MAX, 40_960, 0]);
    assert_eq!(loud::<I24>().map(I24::inner), [8_388_607, 2_097_152, -8_388_608]);
    // The mantissa of f32 ends 128 below full scale.
    assert_eq!(loud::<i32>(), [i32::MAX - 127, 1 << 29, i32::MIN]);
    assert_eq!(loud::<u32>(), [u32::MAX - 127, (1 << 31) + (1 << 29), 0]);
}

/// What a microphone of this format and two channels hears of half of full scale on the left and silence on the right.
fn half<T: FromSample<f32> + Copy>() -> f32
where
    f32: FromSample<T>,
{
    let watch = Arc::new(Watch::default());
    let (mut writer, mut reader) = microphone(2, RATE_HZ, RATE_HZ, 0.001, &watch).unwrap();
    writer.write(&[T::from_sample_(0.5), T::from_sample_(0.0)].repeat(48));
    let mut heard = [0.0; 48];
    reader.read(&mut heard);
    assert!(heard.iter().all(|&sample| sample == heard[0]));
    heard[0]
}

#[test]
fn a_microphone_of_every_format_is_heard() {
    let heard = [
        half::<f32>(),
        half::<i8>(),
        half::<u8>(),
        half::<i16>(),
        half::<u16>(),
        half::<i32>(),
        half::<I24>(),
    ];
    assert_eq!(heard, [0.25; 7]);
}

#[test]
fn a_microphone_that_falls_behind_is_silence_until_its_delay_has_gathered_again() {
    let watch = Arc::new(Watch::default());
    let (mut writer, mut reader) = microphone(1, RATE_HZ, RATE_HZ, 0.01, &watch).unwrap(); // 480 frames
    let mut heard = [9.0; 300];
    writer.write(&[0.1_f32; 479]);
    reader.read(&mut heard);
    assert_eq!(heard, [0.0; 300], "less than the delay");
    assert_eq!(watch.figures().microphone_short, 0, "that is no fault");
    writer.write(&[0.1_f32; 1]);
    reader.read(&mut heard);
    assert_eq!(heard, [0.1; 300]);
    reader.read(&mut heard);
    assert_eq!((heard[179], heard[180]), (0.1, 0.0), "what there is, then silence");
    assert_eq!(watch.figures().microphone_short, 1);
    writer.write(&[0.1_f32; 400]);
    reader.read(&mut heard);
    assert_eq!(heard, [0.0; 300], "it gathers again");
    writer.write(&[0.1_f32; 80]);
    reader.read(&mut heard);
    assert_eq!(heard, [0.1; 300]);
    assert_eq!(watch.figures().microphone_short, 1);
}

#[test]
fn a_microphone_that_runs_ahead_leaves_out_what_does_not_fit() {
    let watch = Arc::new(Watch::default());
    let (mut writer, mut reader) = microphone(1, RATE_HZ, RATE_HZ, 0.01, &watch).unwrap();
    let recording = noise(1500, 1);
    writer.write(&recording);
    assert_eq!(watch.figures().microphone_left_out, 1500 - 960);
    let mut heard = [0.0; 960];
    reader.read(&mut heard);
    assert_eq!(heard, recording[..960]);
}

#[test]
fn what_is_not_a_number_does_not_stay_in_the_room() {
    let watch = Arc::new(Watch::default());
    let (mut writer, reader) = microphone(2, RATE_HZ, RATE_HZ, 0.02, &watch).unwrap();
    let mut player = player(Input::Microphone(reader), 2, &watch);
    let mut input = vec![0.25_f32; 2 * 1900];
    (input[20], input[40], input[41]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY);
    writer.write(&input);
    let heard: Vec<f32> = fill(&mut player, 1900, 2);
    assert!(heard.iter().all(|sample| sample.is_finite()));
    assert_eq!(
        heard.iter().filter(|&&sample| sample > 0.2).count(),
        1900 - 64 - 2,
        "the two frames are silent"
    );
}

#[test]
fn devices_that_do_not_fit_are_refused() {
    let watch = Arc::new(Watch::default());
    let refused = |channels, microphone_hz, delay_s| {
        microphone(channels, microphone_hz, RATE_HZ, delay_s, &watch).unwrap_err().to_string()
    };
    for (error, expected) in [
        (refused(0, RATE_HZ, 0.05), "0 channels"),
        (refused(65, RATE_HZ, 0.05), "65 channels"),
        (refused(1, 44_100, 0.05), "the microphone runs at 44100 Hz, the output at 48000 Hz"),
        (refused(1, RATE_HZ, f64::NAN), "delay"),
        (refused(1, RATE_HZ, 1e9), "delay"),
    ] {
        assert!(error.contains(expected), "{error}");
    }
    let room = [response(&[1.0]), response(&[1.0])];
    let new = |config| Player::new(Input::Loop(Vec::new()), &room, config, &watch).err().unwrap();
    for channels in [0, 65] {
        assert!(matches!(new(config(channels)), Error::DeviceChannels { found } if found == channels));
    }
    let other_rate = PlayerConfig { sample_rate_hz: 44_100, ..config(2) };
    assert!(matches!(new(other_rate), Error::Reverb(sabine_eqfilter::Error::ResponseRate { .. })));
    assert!(matches!(new(PlayerConfig { wet: f32::NAN, ..config(2) }), Error::Reverb(_)));
}

#[test]
fn a_device_that_vanishes_ends_the_application_with_its_reason() {
    let watch = Arc::new(Watch::default());
    let start = Instant::now();
    let later = |seconds: f64| start + Duration::from_secs_f64(seconds);
    assert!(watch.check(later(1.0)).is_ok(), "devices take a moment");
    let error = watch.check(later(3.0)).unwrap_err();
    assert!(matches!(error, Error::Silent { .. }), "{error}");
    watch.called_back(later(2.9), later(2.9), 480, RATE_HZ);
    watch.gap();
    let figures = watch.check(later(4.0)).unwrap();
    assert_eq!((figures.callbacks, figures.frames, figures.gaps), (1, 480, 1));
    watch.fault("output", "I/O error");
    assert_eq!(watch.check(later(4.5)).unwrap().faults, 1, "it may get over it");
    let error = watch.check(later(5.0)).unwrap_err().to_string();
    assert!(error.contains("no sound for 2.1 s") && error.contains("the output: I/O error"), "{error}");
    watch.end("output", "unplugged".into());
    watch.end("microphone", "unplugged too".into());
    let error = watch.check(later(4.0)).unwrap_err();
    assert_eq!(error.to_string(), "the output has gone: unplugged");
}

#[test]
fn deadlines_are_counted_against_what_a_callback_gives_out() {
    let watch = Watch::default();
    let start = Instant::now();
    // 480 frames last 10 ms.
    for (taken_us, frames) in [(1000, 480), (9000, 480), (11_000, 480), (500, 0)] {
        watch.called_back(start, start + Duration::from_micros(taken_us), frames, RATE_HZ);
    }
    let figures = watch.figures();
    assert_eq!((figures.callbacks, figures.missed), (4, 1));
    assert!((figures.longest - 1.1).abs() < 1e-6, "{}", figures.longest);
    assert!((figures.load - 21.5 / 30.0).abs() < 1e-6, "{}", figures.load);
}

#[test]
fn files_are_brought_to_two_ears_and_to_the_rate() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.wav");
    let write = |channels: &[&[f32]]| {
        write_wav_channels(&path, channels, RATE_HZ, SampleFormat::Float32).unwrap();
        read_room(&path, RATE_HZ)
    };
    let (w, y, z) = ([0.5_f32, 0.25], [0.25_f32, -0.5], [9.0_f32, 9.0]);
    let room = write(&[&w]).unwrap();
    assert_eq!((room[0].samples(), room[1].samples()), (&w[..], &w[..]));
    let room = write(&[&w, &y]).unwrap();
    assert_eq!((room[0].samples(), room[1].samples()), (&w[..], &y[..]));
    let room = write(&[&w, &y, &z, &z]).unwrap();
    assert_eq!((room[0].samples(), room[1].samples()), (&[0.375, -0.125][..], &[0.125, 0.375][..]));
    assert!(matches!(write(&[&w, &y, &z]), Err(Error::RoomChannels { found: 3, .. })));
    assert!(matches!(read_room(&folder.path().join("none.wav"), RATE_HZ), Err(Error::File(_))));

    write_wav(&path, &noise(4410, 1), 44_100, SampleFormat::Float32).unwrap();
    assert_eq!(read_voice(&path, RATE_HZ).unwrap().len(), 4800);
    assert_eq!(read_room(&path, RATE_HZ).unwrap()[0].sample_rate_hz(), RATE_HZ);
}

#[test]
fn what_is_typed_is_obeyed_or_refused() {
    assert_eq!("wet 0.5".parse(), Ok(Command::Wet(0.5)));
    assert_eq!(" dry  -1 ".parse(), Ok(Command::Dry(-1.0)));
    assert_eq!("end".parse(), Ok(Command::End));
    assert_eq!("a hall/wet.wav".parse(), Ok(Command::Room("a hall/wet.wav".into())));
    for line in ["", "wet", "wet loud", "dry nan", "dry inf"] {
        let command = line.parse::<Command>();
        assert!(command.is_err() || command == Ok(Command::Room(line.into())), "{line}: {command:?}");
    }
    assert!("wet loud".parse::<Command>().is_err() && "dry nan".parse::<Command>().is_err());
}
