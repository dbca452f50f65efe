//! Traces a room: its response as sound, its parameters per octave with what chance leaves in them, and its first reflections
//! on a plan.
//!
//! Without arguments it runs on the built-in demo. See docs/how-to/trace-a-room.md.

mod draws;
mod plan;
mod waves;

use crate::bar::Bar;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::laws::naming_laws;
use crate::output::OutputFolder;
use crate::room::{PlaceArguments, RoomArguments};
use clap::{Args, ValueEnum};
use draws::{Drawing, Draws};
use sabine::acoustics::{
    Directivity, Orientation, PerBand, Reading, SampleFormat, Signal, encode_wav, write_atomically,
};
use sabine::diagnose::{ExtendedModel, read_laws};
use sabine::paths::laws::{BoundLaws, LawSite};
use sabine::paths::{Conditions, PathParameters, PathSet, Propagator};
use sabine::propagate::{
    AmbisonicRenderer, MeshReport, PathTracer, PressureRenderer, RenderConfig, TracerConfig,
};
use sabine::scene::{DiffuseRoom, MeasuredRoom, Receiver, RoomNote, Source};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;
use waves::{WaveRoomBelow, Waves};

/// Longest time that is traced unless another is asked for, in seconds.
const LONGEST_S: f64 = 20.0;

/// Trace the paths of sound between a source and a receiver of a room.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    room: RoomArguments,
    /// extended_model.toml of `diagnose`: the room, the sources' pattern and impulse_response.wav are as it says; ambisonics,
    /// plan and parameters are those of the room, without loudspeaker response, noise and recorder
    #[arg(long, value_name = "F.toml")]
    model: Option<PathBuf>,
    /// Render so many draws from how sure the numbers of --model are, too: what that leaves open in T30 and, in the folder, decay_band.csv
    /// and decay_band.svg; of paths alone, without --wave-below
    #[arg(long, value_name = "N", requires = "model", value_parser = clap::value_parser!(u32).range(5..=1000))]
    draws: Option<u32>,
    /// Formulas that change what paths carry, `[[laws]]` in TOML: response, ambisonics, plan and parameters are those under them; beside
    /// those of --model. See docs/how-to/own-law.md
    #[arg(long, value_name = "F.toml")]
    laws: Option<PathBuf>,
    #[command(flatten)]
    place: PlaceArguments,
    /// Number of rays
    #[arg(long, default_value_t = 40_000)]
    rays: usize,
    /// Order up to which image sources are found exactly
    #[arg(long, value_name = "N", default_value_t = 3)]
    order: usize,
    /// Length of the response in seconds [default: until T30 can be read]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    duration: Option<f64>,
    /// How the source radiates, along its orientation in the room file or else towards the receiver
    #[arg(long, value_enum, default_value = "omni", conflicts_with = "model")]
    pattern: Pattern,
    /// Add sound diffracted over edges to receivers in a shadow
    #[arg(long)]
    diffraction: bool,
    /// Below this frequency impulse_response.wav is a solution of the wave equation, from an omnidirectional source. Its time
    /// grows with the fourth power of the frequency. Parameters and ambisonics are those of the paths [default: as --model says]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, conflicts_with = "pattern")]
    wave_below: Option<f64>,
    /// Go on although more than one ray in a thousand escapes through holes of the mesh
    #[arg(long)]
    allow_leaks: bool,
    /// Threads [default: all cores]; the result does not depend on it
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Sample rate of the responses
    #[arg(long, value_name = "HZ", default_value_t = 48_000)]
    rate: u32,
    /// Order of the ambisonic response (ACN, SN3D), 1 to 3
    #[arg(long, value_name = "N", default_value_t = 1)]
    ambisonics: usize,
    /// Folder for impulse_response.wav, ambisonics.wav, plan.svg and parameters.json
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the parameters as JSON
    #[arg(long, value_name = "F.json")]
    json: Option<PathBuf>,
}

/// Patterns of first order.
#[derive(Clone, Copy, ValueEnum)]
enum Pattern {
    Omni,
    Subcardioid,
    Cardioid,
    Supercardioid,
    Hypercardioid,
    FigureOfEight,
}

/// Threads for each processor beyond which more of them only cost memory and time.
const MOST_THREADS_EACH: usize = 8;

/// More threads were asked for than could be of use.
#[derive(Debug, thiserror::Error)]
#[error(
    "--threads is {asked}; at most {most} are started here, {MOST_THREADS_EACH} for each of {processors} processors"
)]
struct TooManyThreads {
    asked: usize,
    most: usize,
    processors: usize,
}

/// Computes on so many threads; 0 for one on each processor.
fn use_threads(asked: usize) -> Result<(), Failure> {
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let most = MOST_THREADS_EACH * processors;
    if asked > most {
        return Err(TooManyThreads { asked, most, processors }.into());
    }
    Ok(rayon::ThreadPoolBuilder::new().num_threads(asked).build_global()?)
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = arguments.laws.as_ref().or(arguments.model.as_ref());
    trace_room(arguments).map_err(|failure| naming_laws(failure, file.map(PathBuf::as_path)))
}

fn trace_room(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(threads) = arguments.threads {
        use_threads(threads)?;
    }
    // A folder that cannot be written to should not cost the user a computation first.
    let out = arguments.out.as_deref().map(OutputFolder::create).transpose()?;
    let (stated, room_name) = arguments.room.read(&mut Demo::default())?;
    let model = arguments.model.as_ref();
    let own_laws = arguments.laws.as_ref().map(read_laws).transpose()?.unwrap_or_default();
    let with_laws =
        |path| ExtendedModel::read(path).map(|m| own_laws.iter().cloned().fold(m, ExtendedModel::with_law));
    let modelled = model.map(with_laws).transpose()?;
    let extended = modelled.as_ref().map(|model| model.room(&stated)).transpose()?;
    let room = extended.as_ref().map_or_else(|| Ok(stated.clone()), |model| model.measured_room(&stated))?;
    let (source, receiver) = arguments.place.of(&room)?;
    let renderer =
        RenderConfig { sample_rate_hz: arguments.rate, seed: arguments.seed, ..Default::default() };
    let (mono, ambisonic) =
        (PressureRenderer::new(renderer.clone())?, AmbisonicRenderer::new(arguments.ambisonics, renderer)?);

    let materials: Vec<_> = room.scene().materials().iter().map(|named| named.material.clone()).collect();
    let air = room.air();
    let pattern = pattern(arguments.pattern)?;
    let from = room.sources().iter().position(|s| s.id == source.id);
    let to = room.receivers().iter().position(|r| r.id == receiver.id);
    let mut conditions = match (&extended, from, to) {
        (Some(model), Some(from), Some(to)) => model.conditions(&materials, from, to),
        _ => Conditions::new(&materials, &air),
    };
    let recorded_at = from.zip(to).and_then(|(from, to)| room.recorded_at(from, to));
    let laws = match &extended {
        None => {
            let site = LawSite::new(room.scene(), source, receiver, &air)
                .among(room.sources(), room.receivers())
                .with_recording_order(recorded_at);
            Some(BoundLaws::new(&own_laws, &site)?)
        }
        // The model has them.
        Some(_) => None,
    };
    if let Some(laws) = laws.as_ref().filter(|laws| !laws.is_empty()) {
        conditions = conditions.with_laws(laws);
    }
    let towards = |from: [f64; 3], to: [f64; 3]| Orientation::towards([0, 1, 2].map(|i| to[i] - from[i]));
    if let Some(pattern) = &pattern {
        let axis =
            source.axis.map_or_else(|| towards(source.position_m, receiver.position_m), Orientation::towards);
        conditions = conditions.with_source(pattern, axis?);
    }
    let facing = receiver.axis.map_or_else(|| Ok(Orientation::default()), Orientation::towards)?;

    let below_hz = arguments.wave_below.or(extended.as_ref().and_then(|model| model.wave_below_hz));
    let below = below_hz.map(|hz| WaveRoomBelow::new(hz, arguments.rate, &room, source)).transpose()?;
    let bar = Bar::new();
    let start = Instant::now();
    let tracer = TracerConfig {
        rays: arguments.rays,
        image_order: arguments.order,
        seed: arguments.seed,
        diffraction: arguments.diffraction || extended.as_ref().is_some_and(|model| model.diffraction),
        cuboid_paths: extended.as_ref().map_or(0, |model| model.cuboid_paths),
        allow_leaks: arguments.allow_leaks,
        ..TracerConfig::default()
    };
    let (paths, parameters) = trace(arguments.duration, &tracer, &room, source, receiver, &conditions, &bar)?;
    let trace_s = start.elapsed().as_secs_f64();
    bar.finish();
    let start = Instant::now();
    let mut response = mono.render(&paths, &conditions)?;
    let render_s = start.elapsed().as_secs_f64();
    let joined = |below: WaveRoomBelow| below.join(source, receiver, &conditions, &response, &bar);
    let waves = below.map(joined).transpose()?;
    bar.finish();
    if let Some(waves) = &waves {
        response = waves.joined.response.clone();
    }
    let start = Instant::now();
    if let Some(model) = &extended {
        response = model.finish(&source.id, &receiver.id, response, arguments.seed)?;
    }
    let directional = ambisonic.render(&paths, &conditions, facing)?;
    let render_s = render_s + start.elapsed().as_secs_f64();

    let drawn = match (arguments.draws, &modelled, from.zip(to)) {
        (Some(count), Some(model), Some(pair)) => {
            let duration_s = paths.max_length_m() / air.speed_of_sound_m_s();
            let tracer = TracerConfig { duration_s, ..tracer };
            let drawing =
                Drawing { model, room: &stated, pair, tracer, renderer: &mono, seed: arguments.seed };
            Some(drawing.render(count as usize, &bar)?)
        }
        _ => None,
    };
    bar.finish();

    let absorption_sd: Vec<PerBand<f64>> =
        room.priors().iter().map(|prior| prior.absorption_sd.clone()).collect();
    let by_materials = PathParameters::read_material_errors(&paths, &conditions, &absorption_sd)?;

    for warning in MeshReport::inspect(room.scene(), source.position_m)?.warnings() {
        println!("note: {warning}");
    }
    print!("{}", table(&parameters, &by_materials));
    if let Some(line) = headline(&parameters, &by_materials) {
        println!("{line}");
    }
    println!("{} paths; traced in {trace_s:.2} s, rendered in {render_s:.2} s", paths.len());
    if let Some(waves) = &waves {
        println!("{}", waves.line());
    }
    if let Some(draws) = &drawn {
        println!("{}", draws.line());
    }
    let mut result = as_json(&parameters, &by_materials);
    let [low, high] = room.scene().bounds_m();
    result["size_m"] = json!([0, 1, 2].map(|k| high[k] - low[k]));
    result["volume_m3"] = json!(room.scene().volume_m3());
    result["surface_m2"] = json!(room.scene().surface_m2());
    result["guessed_materials"] = guessed(&room);
    result["waves"] = json!(waves.as_ref().map(Waves::as_json));
    result["draws"] = json!(drawn.as_ref().map(Draws::as_json));
    result["room"] = json!(room_name);
    result["model"] = json!(model.map(|path| path.display().to_string()));
    result["laws"] = json!(arguments.laws.as_ref().map(|path| path.display().to_string()));
    result["source"] = json!(source.id);
    result["receiver"] = json!(receiver.id);
    result["contributions"] = json!(paths.len());
    result["duration_s"] = json!(paths.max_length_m() / air.speed_of_sound_m_s());
    result["seconds"] = json!({ "trace": trace_s, "render": render_s });
    let text = serde_json::to_string_pretty(&result)?;
    if let (Some(mut out), Some(folder)) = (out, &arguments.out) {
        let response = Signal::from(response);
        out.write("impulse_response.wav", &encode_wav(&response, SampleFormat::Float32)?)?;
        out.write("ambisonics.wav", &directional.encode_wav(SampleFormat::Float32)?)?;
        out.write("plan.svg", plan::svg(&room, source, receiver, &paths, &conditions)?.as_bytes())?;
        if let Some(draws) = &drawn {
            out.write("decay_band.csv", draws.csv().as_bytes())?;
            out.write("decay_band.svg", draws.svg()?.as_bytes())?;
        }
        out.write("parameters.json", text.as_bytes())?;
        out.finish()?;
        println!("listen to and look at {}", folder.display());
    }
    if let Some(path) = &arguments.json {
        write_atomically(path, |file| writeln!(file, "{text}"))?;
    }
    Ok(())
}

fn pattern(pattern: Pattern) -> Result<Option<Directivity>, sabine::acoustics::Error> {
    let omni_share = match pattern {
        Pattern::Omni => return Ok(None),
        Pattern::Subcardioid => Directivity::SUBCARDIOID,
        Pattern::Cardioid => Directivity::CARDIOID,
        Pattern::Supercardioid => Directivity::SUPERCARDIOID,
        Pattern::Hypercardioid => Directivity::HYPERCARDIOID,
        Pattern::FigureOfEight => Directivity::FIGURE_OF_EIGHT,
    };
    Directivity::first_order(omni_share).map(Some)
}

/// Traces for as long as asked, or until T30 can be read in every octave.
fn trace(
    asked_s: Option<f64>,
    tracer: &TracerConfig,
    room: &MeasuredRoom,
    source: &Source,
    receiver: &Receiver,
    conditions: &Conditions,
    bar: &Bar,
) -> Result<(PathSet, PathParameters), Failure> {
    let (scene, air) = (room.scene(), room.air());
    let with = |duration_s| PathTracer::new(TracerConfig { duration_s, ..tracer.clone() });
    let Some(asked_s) = asked_s else {
        return Ok(with(LONGEST_S)?.trace_until_t30(scene, source, receiver, conditions, bar)?);
    };
    // Refuses volumes that no room has, as a mesh in another unit.
    DiffuseRoom::of_scene(scene, &air, room.bands())?;
    let paths = with(asked_s)?.trace(scene, source, receiver, &air, bar)?;
    let parameters = PathParameters::read(&paths, conditions)?;
    Ok((paths, parameters))
}

/// The quantities that are read per band: name, unit, values.
fn quantities(parameters: &PathParameters) -> [(&'static str, &'static str, &PerBand<Reading>); 8] {
    [
        ("edt", "_s", &parameters.edt_s),
        ("t20", "_s", &parameters.t20_s),
        ("t30", "_s", &parameters.t30_s),
        ("c50", "_db", &parameters.c50_db),
        ("c80", "_db", &parameters.c80_db),
        ("d50", "", &parameters.d50),
        ("centre_time", "_s", &parameters.centre_time_s),
        ("drr", "_db", &parameters.drr_db),
    ]
}

/// A table for the terminal: each value with the standard error of the rays, below it what the materials leave open; a dash
/// stands for what cannot be read.
fn table(parameters: &PathParameters, by_materials: &PathParameters) -> String {
    let mut text = format!("{:<14}", "");
    for hz in parameters.bands().iter_hz() {
        let label = if hz < 1000.0 { format!("{hz}") } else { format!("{}k", hz / 1000.0) };
        let _ = write!(text, "{label:>17}");
    }
    text.push('\n');
    let mut reasons = Vec::new();
    let materials = quantities(by_materials);
    for ((name, unit, per_band), (_, _, open)) in quantities(parameters).into_iter().zip(materials) {
        let _ = write!(text, "{:<14}", format!("{name}{unit}"));
        for (hz, reading) in per_band.iter() {
            let cell = match reading {
                Ok(estimate) => format!("{:.3} ± {:.3}", estimate.value, estimate.standard_error),
                Err(reason) => {
                    reasons.push(format!("  - {name} at {hz} Hz: {reason}\n"));
                    "-".to_owned()
                }
            };
            let _ = write!(text, "{cell:>17}");
        }
        let _ = write!(text, "\n{:<14}", "  materials");
        for reading in open.values() {
            let cell = reading.as_ref().map_or("-".to_owned(), |e| format!("± {:.3}", e.standard_error));
            let _ = write!(text, "{cell:>17}");
        }
        text.push('\n');
    }
    text.extend(reasons);
    text
}

/// The reverberation time at 1 kHz, or in the band next to it, with both of its uncertainties.
fn headline(parameters: &PathParameters, by_materials: &PathParameters) -> Option<String> {
    let bands = parameters.bands();
    let near = |hz: &f64| (hz / 1000.0).ln().abs();
    let (band, hz) = bands.iter_hz().enumerate().min_by(|a, b| near(&a.1).total_cmp(&near(&b.1)))?;
    let (rays, materials) = (&parameters.t30_s.values()[band], &by_materials.t30_s.values()[band]);
    let (rays, materials) = (rays.as_ref().ok()?, materials.as_ref().ok());
    let open = materials.map_or("unknown".to_owned(), |e| format!("{:.3}", e.standard_error));
    Some(format!(
        "T30 at {hz} Hz: {:.3} s ± {:.3} (rays) ± {open} (materials)",
        rays.value, rays.standard_error
    ))
}

/// The materials without a table.
fn guessed(room: &MeasuredRoom) -> Value {
    let entry = |note: RoomNote| match note {
        RoomNote::GuessedAbsorption { material, area_m2, share: (low, high) } => {
            json!({ "material": material, "area_m2": area_m2, "share_of_absorption": [low, high] })
        }
        other => json!(other.to_string()),
    };
    room.guessed().into_iter().map(entry).collect()
}

fn as_json(parameters: &PathParameters, by_materials: &PathParameters) -> Value {
    let mut result = json!({ "bands_hz": parameters.bands().iter_hz().collect::<Vec<_>>() });
    let mut reasons = vec![serde_json::Map::new(); parameters.bands().len()];
    let materials = quantities(by_materials);
    for ((name, unit, per_band), (_, _, open)) in quantities(parameters).into_iter().zip(materials) {
        let pick = |readings: &PerBand<Reading>, value: fn(&sabine::acoustics::Estimate) -> f64| -> Value {
            readings.values().iter().map(|r| r.as_ref().map_or(Value::Null, |e| json!(value(e)))).collect()
        };
        result[format!("{name}{unit}")] = pick(per_band, |e| e.value);
        result[format!("{name}_sd{unit}")] = pick(per_band, |e| e.standard_error);
        result[format!("{name}_materials_sd{unit}")] = pick(open, |e| e.standard_error);
        for (reasons, reading) in reasons.iter_mut().zip(per_band.values()) {
            if let Err(reason) = reading {
                reasons.insert(format!("{name}{unit}"), json!(reason.to_string()));
            }
        }
    }
    result["reasons"] = reasons.into_iter().map(Value::Object).collect();
    result
}
