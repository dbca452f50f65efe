//! What if this surface were another? Predicts T60, C50 and D50 before and after, and renders a voice in both rooms.
//!
//! Without arguments it puts acoustic plaster on the ceiling of the built-in demo. The room is traced once: the change is heard on
//! the same paths.

mod report;

use crate::bar::Bar;
use crate::channel::channel;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::modelled::ModelArguments;
use crate::output::OutputFolder;
use crate::room::{PlaceArguments, RoomArguments};
use clap::Args;
use report::Voices;
use sabine::acoustics::{
    Bands, Channel, Material, PerBand, Reading, SampleFormat, Signal, encode_wav, library_material,
    material_library, read_audio, resample,
};
use sabine::eqfilter::convolve;
use sabine::optimize::{PredictedChange, RoomPrediction};
use sabine::paths::Propagator;
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use serde::Serialize;
use std::path::PathBuf;

/// Octaves of the prediction: 125 Hz to 8 kHz.
const OCTAVES: Bands = Bands::T60;

/// The voice is heard for so long at most, in seconds.
const EXCERPT_S: f64 = 20.0;
/// Highest magnitude of the louder of the two voices.
const FULL_SCALE: f32 = 0.95;

/// Replace a material of a room and predict what changes.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    room: RoomArguments,
    /// Material of the room to replace
    #[arg(long, default_value = "ceiling")]
    material: String,
    /// Name of a surface of the library that takes its place; `list` lists them
    #[arg(long, default_value = "acoustic_plaster", conflicts_with = "absorption")]
    with: String,
    /// Or its absorption at 125 Hz to 8 kHz; scattering stays as it is
    #[arg(long, value_delimiter = ',', value_name = "A,...")]
    absorption: Option<Vec<f64>>,
    #[command(flatten)]
    place: PlaceArguments,
    #[command(flatten)]
    model: ModelArguments,
    /// Dry voice to hear in both rooms, its first 20 s (WAV) [default: the built-in demo]
    #[arg(long, value_name = "F.wav")]
    dry: Option<PathBuf>,
    /// Channel of the voice if it has several, from 0, or `mean`
    #[arg(long, value_name = "N|mean", value_parser = channel)]
    channel: Option<Channel>,
    /// Rays to trace
    #[arg(long, default_value_t = 40_000)]
    rays: usize,
    /// Length of the responses, in seconds; at least the reverberation time
    #[arg(long, default_value_t = 3.0)]
    duration_s: f64,
    /// Seed of rays and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/replace")]
    out: PathBuf,
}

/// One quantity, per octave; a value that cannot be read is null.
#[derive(Serialize)]
struct Row {
    quantity: &'static str,
    before: Vec<Option<f64>>,
    before_se: Vec<Option<f64>>,
    after: Vec<Option<f64>>,
    after_se: Vec<Option<f64>>,
    difference: Vec<Option<f64>>,
    difference_se: Vec<Option<f64>>,
}

#[derive(Serialize)]
struct Summary {
    bands_hz: Vec<f64>,
    material: String,
    replaced_by: String,
    rows: Vec<Row>,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.with == "list" {
        for surface in material_library() {
            println!("{:24}{}", surface.name, surface.description);
        }
        return Ok(());
    }
    let mut out = OutputFolder::create(&arguments.out)?;
    let mut demo = Demo::default();
    let (room, room_name) = arguments.room.read(&mut demo)?;
    let (room, model) = arguments.model.apply(room)?;
    let dry_path = demo.or(arguments.dry.as_deref(), "speech/dry_guest.wav")?;
    let dry = excerpt(&read_audio(&dry_path, arguments.channel.unwrap_or_default())?)?;
    let (source, receiver) = arguments.place.of(&room)?;
    let named = room.scene().materials();
    let Some(replaced) = named.iter().position(|m| m.name == arguments.material) else {
        let names: Vec<&str> = named.iter().map(|m| m.name.as_str()).collect();
        return Err(format!("--material {}: the room has {}", arguments.material, names.join(", ")).into());
    };
    let before: Vec<Material> = named.iter().map(|m| m.material.resampled(OCTAVES)).collect();
    let (new, name) = match &arguments.absorption {
        Some(values) => (
            before[replaced].with_absorption(PerBand::new(OCTAVES, values.clone())?)?,
            "the absorption given".to_owned(),
        ),
        None => (library_material(&arguments.with)?.material(OCTAVES)?, arguments.with.clone()),
    };
    let mut after = before.clone();
    after[replaced] = new;

    // Traced with the scattering half-way between the two, which samples both kinds of reflection.
    let mut middle = before.clone();
    middle[replaced] = between(&before[replaced], &after[replaced])?;
    let scene = room.scene().with_materials(middle)?;
    let config = model.tracer(TracerConfig {
        rays: arguments.rays,
        duration_s: arguments.duration_s,
        seed: arguments.seed,
        ..TracerConfig::default()
    });
    let bar = Bar::new();
    let air = room.air();
    let paths = PathTracer::new(config)?.trace(&scene, source, receiver, &air, &bar)?;
    bar.finish();
    let own = model.between(&scene, (source, receiver), &air)?;
    let change = if own.is_plain() {
        PredictedChange::new(&paths, &before, &after, &air)?
    } else {
        PredictedChange::under(&paths, &own.conditions(&before, &air), &after)?
    };
    let render = RenderConfig { seed: arguments.seed, ..RenderConfig::default() };
    let renderer_rate_hz = render.sample_rate_hz;
    let renderer = PressureRenderer::new(render)?;
    let mut voices = Vec::new();
    for (file, materials) in [("before.wav", &before), ("after.wav", &after)] {
        let response = Signal::from(renderer.render(&paths, &own.conditions(materials, &air))?);
        out.write(file, &encode_wav(&response, SampleFormat::Float32)?)?;
        voices.push(convolve(resample(&dry, response.sample_rate_hz())?.samples(), response.samples()));
    }
    let [before, after] = in_one_scale(&voices, renderer_rate_hz)?;
    out.write("voice_before.wav", &encode_wav(&before, SampleFormat::Int24)?)?;
    out.write("voice_after.wav", &encode_wav(&after, SampleFormat::Int24)?)?;
    let summary = Summary::new(&arguments.material, name, &change);
    out.write("change.json", serde_json::to_string_pretty(&summary)?.as_bytes())?;
    let voices = Voices { name: &demo.name(&dry_path), dry: &dry, before: &before, after: &after };
    out.write("report.html", report::html(&summary, &room_name, &voices)?.as_bytes())?;
    out.finish()?;
    summary.print();
    println!("{}", summary.sentence());
    println!("listen to and look at {}", arguments.out.join("report.html").display());
    Ok(())
}

/// The beginning of a recording.
fn excerpt(sound: &Signal) -> Result<Signal, Failure> {
    let rate_hz = sound.sample_rate_hz();
    let most = (EXCERPT_S * f64::from(rate_hz)) as usize;
    Ok(Signal::new(sound.samples().iter().copied().take(most).collect(), rate_hz)?)
}

/// Two sounds scaled alike, so that the difference of their levels stays what it is.
fn in_one_scale(sounds: &[Vec<f32>], rate_hz: u32) -> Result<[Signal; 2], Failure> {
    let peak = sounds.iter().flatten().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    let scaled = |i: usize| Signal::new(sounds[i].iter().map(|s| s * FULL_SCALE / peak).collect(), rate_hz);
    Ok([scaled(0)?, scaled(1)?])
}

/// A material whose scattering lies half-way between those of two.
fn between(one: &Material, other: &Material) -> Result<Material, Failure> {
    let scattering = one.scattering().zip_with(other.scattering(), |a, b| 0.5 * (a + b))?;
    Ok(Material::new(one.absorption().clone(), scattering)?)
}

impl Row {
    /// As a heading.
    fn title(&self) -> &'static str {
        match self.quantity {
            "T60 s" => "Reverberation time",
            "C50 dB" => "Clarity (C50)",
            _ => "Definition (D50)",
        }
    }

    /// As the title of an axis.
    fn axis(&self) -> &'static str {
        match self.quantity {
            "T60 s" => "T60 (s)",
            "C50 dB" => "C50 (dB)",
            _ => "D50",
        }
    }
}

impl Summary {
    /// What changes, in one sentence: at mid frequencies, where it can be read.
    fn sentence(&self) -> String {
        let mut parts = Vec::new();
        for hz in [500.0, 1000.0] {
            let Some(band) = self.bands_hz.iter().position(|b| *b == hz) else { continue };
            let t60 = &self.rows[0];
            if let (Some(before), Some(after), Some(error)) =
                (t60.before[band], t60.after[band], t60.difference_se[band])
            {
                parts.push(format!("from {before:.2} s to {after:.2} s (± {error:.2} s) at {hz} Hz"));
            }
        }
        if parts.is_empty() {
            return "The reverberation time cannot be read at 500 Hz and 1 kHz: trace more rays or a longer response.".into();
        }
        format!("The reverberation time goes {}.", parts.join(" and "))
    }

    fn new(material: &str, replaced_by: String, change: &PredictedChange) -> Self {
        let row = |quantity, of: fn(&RoomPrediction) -> &PerBand<Reading>| {
            let column = |prediction: &RoomPrediction| {
                let read = of(prediction).values().iter().map(|r| r.as_ref().ok());
                read.map(|r| (r.map(|e| e.value), r.map(|e| e.standard_error))).unzip()
            };
            let ((before, before_se), (after, after_se)) = (column(&change.before), column(&change.after));
            let (difference, difference_se) = column(&change.difference);
            Row { quantity, before, before_se, after, after_se, difference, difference_se }
        };
        Self {
            bands_hz: OCTAVES.iter_hz().collect(),
            material: material.to_owned(),
            replaced_by,
            rows: vec![row("T60 s", |p| &p.t60_s), row("C50 dB", |p| &p.c50_db), row("D50", |p| &p.d50)],
        }
    }

    fn print(&self) {
        println!("{} replaced by {}", self.material, self.replaced_by);
        println!("{:16}{}", "octave", self.bands_hz.iter().map(|hz| format!("{hz:>13}")).collect::<String>());
        for row in &self.rows {
            let line = |values: &[Option<f64>], errors: &[Option<f64>]| -> String {
                let cell = |(v, e): (&Option<f64>, &Option<f64>)| match (v, e) {
                    (Some(v), Some(e)) => format!("{v:>7.2} ±{e:.2}"),
                    _ => format!("{:>13}", "-"),
                };
                values.iter().zip(errors).map(|pair| format!("{:>13}", cell(pair))).collect()
            };
            println!("{:16}{}", format!("{} before", row.quantity), line(&row.before, &row.before_se));
            println!("{:>16}{}", "after", line(&row.after, &row.after_se));
            println!("{:>16}{}", "difference", line(&row.difference, &row.difference_se));
        }
    }
}
