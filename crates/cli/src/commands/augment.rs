//! Makes a training set of reverberant speech: `sabine augment --help`.

use crate::failure::Failure;
use clap::Args;
use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use sabine::acoustics::{Air, Bands, Material, Observer};
use sabine::augment::{
    Built, DatasetBuilder, DatasetConfig, DatasetSources, Error, Manifest, NoiseCorpus, Partition,
    PolyhedralRoomConfig, ResponseCorpus, ResponseFilter, RoomCache, SpeechCorpus, TracedRooms, Worker,
};
use sabine::paths::{Conditions, PathSet, Propagator};
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::{DiffuseRoom, Receiver, Scene, Source};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Instant;

/// Speech x rooms x noise -> clips of log-mel features with labels, in shards.
#[derive(Args)]

pub struct Arguments {
    /// Folder of speech, one speaker a file-name prefix (`103-1240-0000.flac`, `p225_003.wav`).
    #[arg(long)]
    speech: PathBuf,
    /// Folder of measured responses (WAV), one room a folder. May be given several times.
    #[arg(long, required = true)]
    rir: Vec<PathBuf>,
    /// Folder of noise.
    #[arg(long)]
    noise: Option<PathBuf>,
    /// Polyhedral rooms to draw and trace as a further source of responses: none, or three at least. Their responses are
    /// kept in OUT/rooms for other workers and for the next time.
    #[arg(long, default_value_t = 0)]
    rooms: usize,
    /// Rays for each of these rooms.
    #[arg(long, default_value_t = 3000)]
    rays: usize,
    /// Folder to write to.
    #[arg(long)]
    out: PathBuf,
    /// Number of clips of all partitions together, dealt out as 56,500 : 19,500 : 18,500.
    #[arg(long, conflicts_with = "counts")]
    count: Option<usize>,
    /// Numbers of clips for training, validation and test.
    #[arg(long, value_delimiter = ',', num_args = 3)]
    counts: Option<Vec<usize>>,
    /// Clips in a shard.
    #[arg(long, default_value_t = 512)]
    shard_size: usize,
    /// Clips (other speech, other noise) that share a response.
    #[arg(long, default_value_t = 4)]
    clips_per_response: usize,
    /// Make only every N-th shard, from the I-th (I from 1): `--worker 2/8`.
    #[arg(long, default_value = "1/1")]
    worker: WorkerArgument,
    /// Keep the shards that are there and whole.
    #[arg(long)]
    resume: bool,
    /// Seed of everything.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rooms (folders of responses) for the test only.
    #[arg(long, value_delimiter = ',')]
    test_rooms: Vec<String>,
    /// Rooms for validation only.
    #[arg(long, value_delimiter = ',')]
    validation_rooms: Vec<String>,
    /// Rooms to leave out.
    #[arg(long, value_delimiter = ',')]
    exclude_rooms: Vec<String>,
    /// Folders in which every file is a room of its own.
    #[arg(long, value_delimiter = ',')]
    rooms_by_file: Vec<String>,
    /// Fractions of measured (against simulated) responses in training, validation and test.
    #[arg(long, value_delimiter = ',', num_args = 3)]
    measured: Option<Vec<f64>>,
}

#[derive(Clone)]
struct WorkerArgument(Worker);

impl FromStr for WorkerArgument {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parse = || {
            let (index, of) = text.split_once('/')?;
            Some(Self(Worker { index: index.parse().ok()?, of: of.parse().ok()? }))
        };
        parse().ok_or("a worker is I/N, such as 2/8")
    }
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let bar = ProgressBar::new(0);
    // A template that is wrong would be a defect of this file; the default one serves then.
    if let Ok(style) = ProgressStyle::with_template("{msg:18} {bar:30} {pos}/{len}  {per_sec}  {eta} left") {
        bar.set_style(style);
    }
    let observer = |stage: &str, done: u64, total: u64| {
        bar.set_message(stage.to_owned());
        bar.set_length(total);
        bar.set_position(done);
        ControlFlow::Continue(())
    };
    let rate_hz = 16_000;
    let mut config = DatasetConfig {
        seed: arguments.seed,
        shard_clips: arguments.shard_size,
        clips_per_response: arguments.clips_per_response,
        ..DatasetConfig::default()
    };
    if let Some(counts) = &arguments.counts {
        config.clips = [counts[0], counts[1], counts[2]];
    } else if let Some(count) = arguments.count {
        let share = |part: usize| (count as f64 * config.clips[part] as f64 / 94_500.0).round() as usize;
        let (validation, test) = (share(1), share(2));
        config.clips = [count.saturating_sub(validation + test), validation, test];
    }
    if let Some(measured) = &arguments.measured {
        config.measured_fraction = [measured[0], measured[1], measured[2]];
    }
    config.rooms.test = arguments.test_rooms.clone();
    config.rooms.validation = arguments.validation_rooms.clone();

    let speech = SpeechCorpus::read(&arguments.speech, rate_hz, config.clip.duration_s, &observer)?;
    let filter =
        ResponseFilter { excluded_rooms: arguments.exclude_rooms.clone(), ..ResponseFilter::default() };
    let mut responses = ResponseCorpus::default();
    for folder in &arguments.rir {
        responses.extend(ResponseCorpus::read(
            folder,
            rate_hz,
            &filter,
            &arguments.rooms_by_file,
            &observer,
        )?);
    }
    // Before rooms are traced, which takes long.
    config.check(&speech, &responses)?;
    let noise = match &arguments.noise {
        Some(folder) => NoiseCorpus::read(folder, rate_hz, &observer)?,
        None => NoiseCorpus::default(),
    };
    let traced = traced_rooms(arguments, rate_hz, &filter, &observer)?;
    for (what, left_out) in
        [("speech", speech.left_out()), ("response", responses.left_out()), ("room", traced.left_out())]
    {
        for file in left_out {
            bar.suspend(|| eprintln!("left out: {what} {}: {}", file.path, file.reason));
        }
    }
    let builder = DatasetBuilder::new(config, DatasetSources { speech, responses, traced, noise })?;
    for partition in Partition::ALL {
        let of = |dealt: &std::collections::BTreeMap<String, Partition>| {
            dealt
                .iter()
                .filter(|(_, p)| **p == partition)
                .map(|(name, _)| name.as_str())
                .collect::<Vec<_>>()
                .join(" ")
        };
        bar.suspend(|| eprintln!("{partition}: rooms {}", of(builder.room_partitions())));
    }
    let start = Instant::now();
    let built = builder.build(&arguments.out, arguments.worker.0, arguments.resume, &observer)?;
    bar.finish_and_clear();
    tell(&built, start);
    Ok(())
}

/// A path tracer that follows each room's paths for as long as the room needs.
struct RoomTracer {
    config: TracerConfig,
}

/// Paths are followed for so many reverberation times by Eyring: uneven rooms ring longer than he says.
const TIMES_EYRING: f64 = 1.2;
/// Range of that duration, s.
const DURATION_S: (f64, f64) = (0.3, 2.4);

impl Propagator for RoomTracer {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, sabine::acoustics::Error> {
        let rooms = DiffuseRoom::of_scene(scene, air, Bands::SIMULATION)?;
        let longest_s = rooms.values().iter().map(DiffuseRoom::eyring_t60_s).fold(0.0, f64::max);
        let duration_s = (TIMES_EYRING * longest_s).clamp(DURATION_S.0, DURATION_S.1);
        PathTracer::new(TracerConfig { duration_s, ..self.config.clone() })?
            .trace(scene, source, receiver, air, observer)
    }
}

/// Draws, traces and renders the rooms of `--rooms`.
fn traced_rooms(
    arguments: &Arguments,
    rate_hz: u32,
    filter: &ResponseFilter,
    observer: &dyn Observer,
) -> Result<ResponseCorpus, Error> {
    if arguments.rooms == 0 {
        return Ok(ResponseCorpus::default());
    }
    let tracer = RoomTracer { config: TracerConfig { rays: arguments.rays, ..TracerConfig::default() } };
    let rendering = RenderConfig { sample_rate_hz: rate_hz, ..RenderConfig::default() };
    let render = |paths: &PathSet, scene: &Scene, air: &Air, seed: u64| {
        let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
        let renderer = PressureRenderer::new(RenderConfig { seed, ..rendering.clone() })?;
        Ok(renderer.render(paths, &Conditions::new(&materials, air))?)
    };
    let cache = RoomCache {
        folder: arguments.out.join("rooms"),
        tracer: format!("{:?} {rendering:?} {TIMES_EYRING} {DURATION_S:?}", tracer.config),
    };
    TracedRooms::new(PolyhedralRoomConfig::default(), &tracer, &render)?.corpus(
        arguments.rooms,
        arguments.seed,
        filter,
        Some(&cache),
        observer,
    )
}

fn tell(built: &Built, start: Instant) {
    let Built { made, kept, mended, refused, manifest, .. } = built;
    println!(
        "{made} shards made, {kept} kept, {mended} mended in {}; {refused} augmentations refused and drawn again",
        HumanDuration(start.elapsed())
    );
    match manifest {
        Some(manifest) => print_statistics(manifest),
        None => println!("no manifest yet: shards of other workers are missing"),
    }
}

fn print_statistics(manifest: &Manifest) {
    for (partition, statistics) in &manifest.statistics {
        println!("{partition}");
        for (hz, d) in manifest.t60_bands_hz.iter().zip(&statistics.t60_s) {
            let missing: u64 = d.missing.values().sum();
            println!(
                "  T60 {hz:>6} Hz  {:6.3} +- {:5.3} s, {missing} missing",
                d.mean(),
                d.standard_deviation()
            );
        }
        for (hz, d) in manifest.eq_bands_hz.iter().zip(&statistics.eq_db) {
            let missing: u64 = d.missing.values().sum();
            println!(
                "  EQ  {hz:>6} Hz  {:6.2} +- {:5.2} dB, {missing} missing",
                d.mean(),
                d.standard_deviation()
            );
        }
        let (drr, snr) = (&statistics.drr_db, &statistics.snr_db);
        println!(
            "  DRR {:.1} +- {:.1} dB, SNR {:.1} +- {:.1} dB",
            drr.mean(),
            drr.standard_deviation(),
            snr.mean(),
            snr.standard_deviation()
        );
    }
}
