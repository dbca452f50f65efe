//! A walk from room to room while somebody talks: paths and responses anew many times a second, the sound block by block.

mod route;

use crate::bar::Bar;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::modelled::{ModelArguments, PathModel};
use crate::room::read_room;
use clap::{Args, ValueEnum};
use route::{Walk, read_corners};
use sabine::acoustics::{
    Air, Bands, Channel, Material, Orientation, PerBand, SampleFormat, read_audio, resample,
    write_wav_channels,
};
use sabine::eqfilter::{PartitionedConfig, PartitionedConvolver, ResponsePreparer};
use sabine::paths::Conditions;
use sabine::propagate::{
    AmbisonicRenderer, HeadResponses, MovingConfig, MovingTracer, PressureRenderer, RenderConfig,
    TracerConfig,
};
use sabine::scene::{NamedMaterial, Receiver, Scene, Source, Triangle};
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Blocks that the convolver may take to start a cross-fade.
const BLOCKS_BEFORE_FADE: usize = 32;
/// Walls in the way that are listed.
const LISTED: usize = 3;

/// Render a walk through two rooms joined by a doorway, or through a room of your own.
#[derive(Args)]
pub struct Arguments {
    /// Room folder instead of the two rooms; its first source talks, the walk goes from receiver to receiver
    #[arg(long, value_name = "DIR")]
    room: Option<PathBuf>,
    /// Read a mesh outside the room's folder, too: only for rooms that you trust
    #[arg(long)]
    allow_outside: bool,
    /// Walk on where a wall or furniture is in the way
    #[arg(long)]
    through_walls: bool,
    /// Tables of materials instead of the room's: a materials.toml as `fit` and `match` write it
    #[arg(long, value_name = "F", requires = "room")]
    materials: Option<PathBuf>,
    #[command(flatten)]
    model: ModelArguments,
    /// Corners of the walk, a line each: x y z in metres
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// Walking speed in m/s
    #[arg(long, default_value_t = 1.2)]
    speed: f64,
    /// Dry speech, repeated for as long as the walk takes
    #[arg(long, value_name = "F.wav")]
    speech: Option<PathBuf>,
    /// The sound to be written
    #[arg(long, value_name = "F.wav", default_value = "walk.wav")]
    out: PathBuf,
    /// Channels: one; those of ambisonics (ACN, SN3D); or two ears
    #[arg(long, value_enum, default_value_t = Mode::Mono)]
    mode: Mode,
    /// Ambisonic order, 1 to 3, also that behind the two ears
    #[arg(long, default_value_t = 3)]
    order: usize,
    /// Head-related impulse responses for `--mode binaural`
    #[arg(long, value_name = "F.sofa")]
    head: Option<PathBuf>,
    /// Rays for each update
    #[arg(long, default_value_t = 300)]
    rays: usize,
    /// Seconds between updates
    #[arg(long, default_value_t = 0.15)]
    update: f64,
    /// Length of the responses in seconds
    #[arg(long, default_value_t = 0.8)]
    duration: f64,
    /// Sample rate in Hz
    #[arg(long, default_value_t = 24_000)]
    rate: u32,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Mode {
    Mono,
    Ambisonic,
    Binaural,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let ((scene, air, source, mut corners), model) = match &arguments.room {
        Some(folder) => furnished(folder, arguments)?,
        None if arguments.model.is_given() => {
            return Err("--model changes the room of --room, and there is none".into());
        }
        None => (two_rooms()?, PathModel::default()),
    };
    if let Some(path) = &arguments.path {
        corners = read_corners(path)?;
    }
    let walk = Walk::new(corners, arguments.speed)?;
    let walls = walk.walls_in_the_way(&scene)?;
    if let Some(wall) = walls.first().filter(|_| !arguments.through_walls) {
        return Err(
            format!("{wall}; walk around it (corners by --path), or go on with --through-walls").into()
        );
    }
    for wall in walls.iter().take(LISTED) {
        println!("note: {wall}");
    }
    if walls.len() > LISTED {
        println!("note: so do {} legs more", walls.len() - LISTED);
    }
    let mut demo = Demo::default();
    let speech = demo.or(arguments.speech.as_deref(), "speech/dry_reader.wav")?;
    let speech = resample(&read_audio(speech, Channel::Index(0))?, arguments.rate)?;
    let renderer = Renderer::new(arguments)?;
    walk.check_size(arguments.rate, renderer.channels(arguments))?;
    println!("{}", walk.line());
    let materials: Vec<Material> = scene.materials().iter().map(|named| named.material.clone()).collect();
    let tracer = model.tracer(TracerConfig {
        rays: arguments.rays,
        duration_s: arguments.duration,
        image_order: 2,
        seed: arguments.seed,
        ..Default::default()
    });
    let mut tracer = MovingTracer::new(scene.clone(), air, MovingConfig { tracer, ..Default::default() })?;

    let rate = f64::from(arguments.rate);
    let block = (arguments.rate as usize / 375).next_power_of_two().max(16);
    let update_blocks = ((arguments.update * rate / block as f64) as usize).max(BLOCKS_BEFORE_FADE + 2);
    let config = PartitionedConfig {
        block,
        longest_response: renderer.longest_response(arguments),
        fade_blocks: update_blocks - BLOCKS_BEFORE_FADE,
    };
    let blocks = (walk.duration_s() * rate / block as f64).ceil() as usize;
    let mut work = Work::default();
    // A response for a place, and how long it took to find.
    let mut respond = |time_s: f64, work: &mut Work| -> Result<Vec<Vec<f32>>, Failure> {
        let receiver = Receiver::omni("listener", walk.place_m(time_s))?;
        let start = Instant::now();
        let frame = tracer.update(&source, &receiver)?;
        work.trace_s.push(start.elapsed().as_secs_f64());
        work.effective_rays = frame.effective_rays;
        let start = Instant::now();
        let own = model.between(&scene, (&source, &receiver), &air)?;
        let between = own.conditions(&materials, &air);
        let response = renderer.response(&frame.paths, &between, walk.facing(time_s)?)?;
        work.render_s.push(start.elapsed().as_secs_f64());
        Ok(response)
    };
    let mut channels = respond(0.0, &mut work)?
        .iter()
        .map(|response| Stream::new(response, config, blocks))
        .collect::<Result<Vec<_>, Failure>>()?;
    let bar = Bar::new();
    let whole = Instant::now();
    // Where no bar is drawn, lines say how far it is.
    let terminal = std::io::stderr().is_terminal();
    let mut input = speech.samples().iter().copied().cycle();
    let mut samples = vec![0.0; block];
    for index in 0..blocks {
        if index % update_blocks == 0 && index > 0 {
            // The fade to the new response begins so much later.
            let due_s = ((index + BLOCKS_BEFORE_FADE) * block) as f64 / rate;
            for (channel, response) in channels.iter_mut().zip(respond(due_s, &mut work)?) {
                channel.exchange(&response)?;
            }
            sabine::acoustics::report(&bar, "walking", index as u64, blocks as u64)?;
            if !terminal && (10 * index / blocks) > (10 * (index - update_blocks) / blocks) {
                let left_s = whole.elapsed().as_secs_f64() * (blocks as f64 / index as f64 - 1.0);
                eprintln!("walked {} %, about {left_s:.0} s left", 100 * index / blocks);
            }
        }
        samples.iter_mut().for_each(|s| *s = input.next().unwrap_or(0.0));
        for channel in &mut channels {
            channel.process(&samples)?;
        }
    }
    bar.finish();
    let seconds = whole.elapsed().as_secs_f64();
    let mut sound: Vec<Vec<f32>> = channels.into_iter().map(|channel| channel.output).collect();
    let peak = sound.iter().flatten().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    sound.iter_mut().flatten().for_each(|s| *s *= 0.5 / peak);
    let sound: Vec<&[f32]> = sound.iter().map(Vec::as_slice).collect();
    write_wav_channels(&arguments.out, &sound, arguments.rate, SampleFormat::Float32)?;
    let length_s = (blocks * block) as f64 / rate;
    println!("{}: {} channels, {length_s:.1} s", arguments.out.display(), sound.len());
    println!(
        "{} updates of {} rays (counting as {:.0} with the older ones), every {:.0} ms: {:.1} ms for the paths, {:.1} ms for the response",
        work.trace_s.len(),
        arguments.rays,
        work.effective_rays,
        1e3 * (update_blocks * block) as f64 / rate,
        1e3 * mean(&work.trace_s),
        1e3 * mean(&work.render_s),
    );
    println!("real-time factor {:.2} (below 1 keeps pace with the sound)", seconds / length_s);
    Ok(())
}

/// Time spent on updates.
#[derive(Default)]
struct Work {
    trace_s: Vec<f64>,
    render_s: Vec<f64>,
    effective_rays: f64,
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// One output channel.
struct Stream {
    convolver: PartitionedConvolver,
    preparer: ResponsePreparer,
    block: usize,
    output: Vec<f32>,
}

impl Stream {
    fn new(response: &[f32], config: PartitionedConfig, blocks: usize) -> Result<Self, Failure> {
        let convolver = PartitionedConvolver::new(response, config)?;
        let output = Vec::with_capacity(blocks * config.block);
        Ok(Self { preparer: convolver.preparer(), convolver, block: config.block, output })
    }

    fn exchange(&mut self, response: &[f32]) -> Result<(), Failure> {
        self.convolver.take_retired();
        let prepared = self.preparer.prepare(response)?;
        self.convolver
            .exchange(prepared)
            .map_err(|_| "the last cross-fade has not ended: update less often".into())
    }

    fn process(&mut self, input: &[f32]) -> Result<(), Failure> {
        let from = self.output.len();
        self.output.resize(from + self.block, 0.0);
        Ok(self.convolver.process_block(input, &mut self.output[from..])?)
    }
}

/// From paths to the channels asked for.
enum Renderer {
    Mono(PressureRenderer),
    Ambisonic(AmbisonicRenderer),
    Binaural(AmbisonicRenderer, HeadResponses),
}

impl Renderer {
    fn new(arguments: &Arguments) -> Result<Self, Failure> {
        // The same noise in all responses: between two of them only its envelope changes.
        let config = RenderConfig {
            sample_rate_hz: arguments.rate,
            duration_s: Some(arguments.duration),
            seed: arguments.seed,
            ..Default::default()
        };
        Ok(match arguments.mode {
            Mode::Mono => Self::Mono(PressureRenderer::new(config)?),
            Mode::Ambisonic => Self::Ambisonic(AmbisonicRenderer::new(arguments.order, config)?),
            Mode::Binaural => {
                let path =
                    arguments.head.as_ref().ok_or("--mode binaural: give the head by --head F.sofa")?;
                let head = HeadResponses::read_sofa(path)?.resampled(arguments.rate)?;
                Self::Binaural(AmbisonicRenderer::new(arguments.order, config)?, head)
            }
        })
    }

    fn channels(&self, arguments: &Arguments) -> usize {
        match self {
            Self::Mono(_) => 1,
            Self::Ambisonic(_) => (arguments.order + 1) * (arguments.order + 1),
            Self::Binaural(..) => 2,
        }
    }

    fn longest_response(&self, arguments: &Arguments) -> usize {
        let taps = if let Self::Binaural(_, head) = self { head.pair(0)[0].len() } else { 1 };
        (arguments.duration * f64::from(arguments.rate)).ceil() as usize + taps
    }

    fn response(
        &self,
        paths: &sabine::paths::PathSet,
        conditions: &Conditions,
        facing: Orientation,
    ) -> Result<Vec<Vec<f32>>, Failure> {
        Ok(match self {
            Self::Mono(renderer) => vec![renderer.render(paths, conditions)?.into_samples()],
            Self::Ambisonic(renderer) => renderer.render(paths, conditions, facing)?.channels().to_vec(),
            Self::Binaural(renderer, head) => {
                let heard = head.binaural(&renderer.render(paths, conditions, facing)?)?;
                heard.map(|ear| ear.into_samples()).to_vec()
            }
        })
    }
}

type Setting = (Scene, Air, Source, Vec<[f64; 3]>);

fn furnished(folder: &Path, arguments: &Arguments) -> Result<(Setting, PathModel), Failure> {
    let room = read_room(folder, arguments.allow_outside, arguments.materials.as_deref())?;
    let (room, model) = arguments.model.apply(room)?;
    let source = room.sources().first().ok_or("the room has no source")?.clone();
    let corners = room.receivers().iter().map(|receiver| receiver.position_m).collect();
    Ok(((room.scene().clone(), room.air(), source, corners), model))
}

/// A hard room of 6 x 5 x 3 m and a soft one of 5 x 4 x 3 m, joined by a doorway 1 m wide and 2.1 m high.
fn two_rooms() -> Result<Setting, Failure> {
    let bands = Bands::SIMULATION;
    let named = |name: &str, absorption: [f64; 8], scattering: f64| -> Result<NamedMaterial, Failure> {
        let absorption = PerBand::new(bands, absorption.to_vec())?;
        let material = Material::new(absorption, PerBand::uniform(bands, scattering))?;
        Ok(NamedMaterial { name: name.to_owned(), material })
    };
    let materials = vec![
        named("hard", [0.10, 0.08, 0.06, 0.05, 0.06, 0.07, 0.08, 0.09], 0.2)?,
        named("soft", [0.15, 0.20, 0.35, 0.50, 0.60, 0.65, 0.65, 0.65], 0.3)?,
    ];
    let lines_m = [vec![0.0, 6.0, 6.2, 11.2], vec![0.0, 2.0, 3.0, 4.0, 5.0], vec![0.0, 2.1, 3.0]];
    // Which cells between these lines are air.
    let is_air = |cell: [isize; 3]| matches!(cell, [0, 0..4, 0..2] | [2, 0..3, 0..2] | [1, 1, 0]);
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let mut numbers = BTreeMap::new();
    for x in 0..3isize {
        for y in 0..4isize {
            for z in 0..2isize {
                let cell = [x, y, z];
                for axis in (0..3).filter(|_| is_air(cell)) {
                    for side in [0, 1] {
                        let mut neighbour = cell;
                        neighbour[axis] += if side == 1 { 1 } else { -1 };
                        if is_air(neighbour) {
                            continue;
                        }
                        // The face between air and wall, shared corners and all.
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(along_u, along_v)| {
                            let mut corner = cell;
                            corner[axis] += side;
                            corner[u] += along_u;
                            corner[v] += along_v;
                            *numbers.entry(corner).or_insert_with(|| {
                                vertices.push(std::array::from_fn(|i| lines_m[i][corner[i] as usize]));
                                vertices.len() as u32 - 1
                            })
                        });
                        let material = u32::from(x > 0);
                        let [a, b, c, d] = if side == 0 {
                            corners
                        } else {
                            [corners[3], corners[2], corners[1], corners[0]]
                        };
                        triangles.push(Triangle { vertices: [a, b, c], material });
                        triangles.push(Triangle { vertices: [a, c, d], material });
                    }
                }
            }
        }
    }
    let scene = Scene::new(vertices, triangles, materials)?;
    let source = Source::omni("talker", [1.3, 3.4, 1.5])?;
    let corners = vec![[3.5, 1.2, 1.6], [5.0, 2.5, 1.6], [7.2, 2.5, 1.6], [9.8, 1.2, 1.6]];
    Ok((scene, Air::default(), source, corners))
}
