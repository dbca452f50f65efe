//! A room matched while somebody speaks in it: estimates from a stream, materials and equalisation after them, and sound
//! that is heard in the room all the while.
//!
//! Without arguments it listens to the built-in demo in real time; `--fast` does not wait. See docs/how-to/live-match.md.

mod matcher;
mod session;

use crate::demo::Demo;
use crate::failure::Failure;
use crate::modelled::ModelArguments;
use crate::room::{PlaceArguments, RoomArguments};
use clap::Args;
use matcher::Matcher;
use sabine::Recording;
use sabine::acoustics::{
    Bands, Channel, ImpulseResponse, RoomParameters, SampleFormat, read_audio, resample, write_wav,
};
use sabine::estimator::{Estimator, LiveEstimator};
use session::{Pace, Session};
use std::path::{Path, PathBuf};

/// Match a simulated room to speech as it comes in.
#[derive(Args)]
pub struct Arguments {
    /// Reverberant speech (WAV), at least one second [default: the built-in demo]
    #[arg(long, value_name = "F.wav")]
    speech: Option<PathBuf>,
    #[command(flatten)]
    room: RoomArguments,
    #[command(flatten)]
    model: ModelArguments,
    #[command(flatten)]
    place: PlaceArguments,
    /// Sound that is heard in the room meanwhile, again and again (WAV) [default: the built-in demo]
    #[arg(long, value_name = "F.wav")]
    dry: Option<PathBuf>,
    /// Length of the blocks in which sound comes and goes, in milliseconds
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=200))]
    block_ms: u32,
    /// Windows of four seconds that count, the newest ones: fewer follow a change of room faster
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    windows: u32,
    /// As fast as it goes instead of in real time
    #[arg(long)]
    fast: bool,
    /// Rays to trace
    #[arg(long, default_value_t = 10_000)]
    rays: usize,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write the matched response, equalisation included, when the stream ends (WAV)
    #[arg(long, value_name = "F.wav")]
    out: Option<PathBuf>,
    /// Write what was heard meanwhile (WAV)
    #[arg(long, value_name = "F.wav")]
    heard: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut demo = Demo::default();
    let speech_path = demo.or(arguments.speech.as_deref(), "speech/recording.wav")?;
    let dry_path = demo.or(arguments.dry.as_deref(), "speech/dry_guest.wav")?;
    let speech = read_audio(&speech_path, Channel::Mono)?;
    Recording { name: &demo.name(&speech_path), signal: &speech }.check()?;
    let dry = read_audio(&dry_path, Channel::Mono)?;
    Recording { name: &demo.name(&dry_path), signal: &dry }.check_not_silent()?;
    let (room, _) = arguments.room.read(&mut demo)?;
    let (room, model) = arguments.model.apply(room)?;
    let (source, receiver) = arguments.place.of(&room)?;

    let estimator = Estimator::pretrained()?;
    let live = LiveEstimator::with_windows(&estimator, arguments.windows as usize);
    // A sound card delivers the rate that it is asked for; a file is brought to it before it is streamed.
    let speech = resample(&speech, live.sample_rate_hz())?;
    let dry = resample(&dry, matcher::SAMPLE_RATE_HZ)?;
    let matcher = Matcher::new(&room, source, receiver, &model, (arguments.rays, arguments.seed))?;
    println!(
        "room of the file: traced and rendered in {:.2} s; listening in blocks of {} ms",
        matcher.start_s(),
        arguments.block_ms
    );
    println!("{:>7}  {:50}EQ in dB at", "", "T60 in s at");
    println!("{:>7}  {}{}", "", row(Bands::T60.iter_hz(), 0), row(Bands::EQ.iter_hz(), 0));
    let pace = if arguments.fast { Pace::Fast } else { Pace::RealTime };
    let mut session = Session::new(live, matcher, arguments.block_ms, pace)?;
    let end = session.run(speech.samples(), dry.samples())?;

    let reached = RoomParameters::measure(&end.response, Bands::T60)?.t30_s;
    let t60_s = end.targets.t60_s();
    println!("T60 heard    {} s", row(t60_s.values().iter().map(|t| t.value), 2));
    println!(
        "T60 reached  {} s",
        row(reached.values().iter().map(|t| t.as_ref().map_or(f64::NAN, |t| t.value)), 2)
    );
    session.timing().print();
    write(arguments.out.as_deref(), &end.equalised)?;
    if let Some(path) = &arguments.heard {
        write_wav(path, session.heard(), matcher::SAMPLE_RATE_HZ, SampleFormat::Float32)?;
    }
    Ok(())
}

fn write(path: Option<&Path>, response: &ImpulseResponse) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    write_wav(path, response.samples(), response.sample_rate_hz(), SampleFormat::Float32)?;
    println!("matched response: {}", path.display());
    Ok(())
}

/// Numbers in columns of seven.
pub(crate) fn row(values: impl Iterator<Item = f64>, digits: usize) -> String {
    values.map(|v| if v.is_nan() { format!("{:>7}", "-") } else { format!("{v:>7.digits$}") }).collect()
}
