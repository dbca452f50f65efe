//! A recording or the microphone in a room, live on the sound card.
//!
//! ```text
//! cargo run --release --manifest-path examples/integrations/cpal/app/Cargo.toml -- --help
//! ```

mod arguments;
mod devices;

use arguments::{Arguments, USAGE};
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use sabine_eqfilter::RoomReverbControl;
use sabine_with_cpal::{Command, Input, Player, PlayerConfig, Watch, microphone, read_room, read_voice};
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Longest room, in seconds.
const LONGEST_S: f64 = 10.0;

fn main() -> ExitCode {
    match arguments::parse(std::env::args().skip(1)).and_then(run) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Box<dyn Error>> {
    let host = cpal::default_host();
    if arguments.help {
        println!("{USAGE}");
        return Ok(());
    }
    if arguments.list {
        for device in host.output_devices()? {
            println!("{}  {device}", device.id()?);
        }
        return Ok(());
    }
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../../fixtures"));
    let output = devices::output(&host, arguments.device.as_deref())?;
    let config = devices::config(&output, true, arguments.rate_hz)?;
    let rate_hz = config.sample_rate();
    let room = arguments.room.unwrap_or_else(|| fixtures.join("room/ir/talker_microphone.wav"));
    let room = read_room(&room, rate_hz)?;

    let watch = Arc::new(Watch::default());
    let mut recording = None;
    let input = if arguments.microphone {
        let device = host.default_input_device().ok_or("the system has no microphone")?;
        let config = devices::config(&device, false, Some(rate_hz))?;
        let delay_s = arguments.delay_s.unwrap_or(0.05);
        let (writer, reader) = microphone(config.channels(), config.sample_rate(), rate_hz, delay_s, &watch)?;
        println!("microphone: {device}, {} channels, {}", config.channels(), config.sample_format());
        recording = Some(devices::record_stream(&device, &config, writer, &watch)?);
        Input::Microphone(reader)
    } else {
        let voice = arguments.voice.unwrap_or_else(|| fixtures.join("speech/dry_guest.wav"));
        Input::Loop(read_voice(&voice, rate_hz)?)
    };
    let player = Player::new(
        input,
        &room,
        PlayerConfig {
            sample_rate_hz: rate_hz,
            channels: config.channels(),
            wet: arguments.wet.unwrap_or(0.5),
            dry: arguments.dry.unwrap_or(if arguments.microphone { 0.0 } else { 1.0 }),
            longest_s: LONGEST_S,
        },
        &watch,
    )?;
    let (control, late) = (player.control(), player.latency_samples());
    let playing = devices::play_stream(&output, &config, player, &watch)?;
    println!("output: {output}, {rate_hz} Hz, {} channels, {}", config.channels(), config.sample_format());
    println!("the room adds {:.1} ms to the delay of the devices", 1e3 * late as f64 / f64::from(rate_hz));
    if let Some(recording) = &recording {
        recording.play()?;
    }
    playing.play()?;
    let outcome = look_after(&watch, &control, &typed_lines(), arguments.seconds, rate_hz);
    print_figures(&watch, rate_hz);
    outcome
}

/// Lines of the keyboard, from a thread that waits for them.
fn typed_lines() -> Receiver<String> {
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    lines
}

/// Obeys what is typed until the end, or until a device has gone.
fn look_after(
    watch: &Watch,
    control: &RoomReverbControl,
    lines: &Receiver<String>,
    seconds: Option<f64>,
    rate_hz: u32,
) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    loop {
        watch.check(Instant::now())?;
        if seconds.is_some_and(|seconds| start.elapsed().as_secs_f64() >= seconds) {
            return Ok(());
        }
        while let Ok(line) = lines.try_recv() {
            let done = line.parse().map_err(Box::from).and_then(
                |command: Command| -> Result<bool, Box<dyn Error>> {
                    match command {
                        Command::End => return Ok(true),
                        Command::Wet(gain) => control.set_wet(gain)?,
                        Command::Dry(gain) => control.set_dry(gain)?,
                        Command::Room(path) => control.exchange(&read_room(&path, rate_hz)?)?,
                    }
                    Ok(false)
                },
            );
            match done {
                Ok(true) => return Ok(()),
                Ok(false) => println!("{line}"),
                Err(error) => println!("{line}: {error}"),
            }
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn print_figures(watch: &Watch, rate_hz: u32) {
    let figures = watch.figures();
    println!(
        "{:.1} s of sound in {} callbacks; {} missed their deadline, the longest took {:.1} % of it; {:.2} % of a core",
        figures.frames as f64 / f64::from(rate_hz),
        figures.callbacks,
        figures.missed,
        100.0 * figures.longest,
        100.0 * figures.load,
    );
    println!(
        "the microphone was short {} times, {} of its frames were left out",
        figures.microphone_short, figures.microphone_left_out
    );
    println!("the sound system reported {} gaps and {} faults", figures.gaps, figures.faults);
    if let Some(fault) = watch.last_fault() {
        println!("the last fault: {fault}");
    }
}
