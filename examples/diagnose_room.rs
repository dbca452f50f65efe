//! Why is my simulation wrong? Somebody has left 5 ms of latency in the recordings: it is found, named and put into the model.
//!
//! ```text
//! cargo run --example diagnose_room
//! ```
//!
//! Few rays and four suspects, for a quick look; it works in a temporary folder. It prints
//! ```text
//! explained
//! time_zero (40 nats): The recording does not start with the emission: a latency was not removed.
//!   latency 5.01 ms (90 %: 4.98 to 5.04)
//!   gain at places not fitted: 0.097 nats for each time bin (90 %: -0.004 to 0.198)
//! direct sound, in milliseconds after the start of the file:
//!   measured        18.6
//!   model           13.7
//!   extended model  18.8
//! ```
//!
//! In full, against the whole catalogue: `sabine diagnose --room DIR --hold-out r3 --out DIR`. How a cause is weighed:
//! `docs/explanation/diagnosis.md`; what it found in real rooms: `docs/validation/diagnose.md`.

use sabine::acoustics::{ImpulseResponse, Material, Onset};
use sabine::diagnose::{DiagnoseConfig, Diagnoser};
use sabine::paths::Propagator;
use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine::scene::{MeasuredRoom, NewResponse, NewRoom};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let folder = tempfile::tempdir()?;
    let room = late(&MeasuredRoom::read(fixtures.join("room"))?, 0.005, folder.path())?;

    let config = DiagnoseConfig { rays: 1000, simulations: 10, ..DiagnoseConfig::default() };
    let suspects = ["time_zero", "sound_speed", "position_error", "channel_fault"];
    let diagnoser = Diagnoser::new(config)?.with_only(&suspects.map(str::to_owned))?;
    let found = diagnoser.diagnose(&room, &[], &())?;
    println!("{}", found.verdict);
    for cause in &found.causes {
        println!("{} ({:.0} nats): {}", cause.effect, cause.nats, cause.explanation);
        for p in &cause.parameters {
            println!("  {} {:.2} {} (90 %: {:.2} to {:.2})", p.name, p.value, p.unit, p.low, p.high);
        }
        if let Some(gain) = &cause.held_out_gain {
            println!(
                "  gain at places not fitted: {:.3} nats for each time bin (90 %: {:.3} to {:.3})",
                gain.nats_per_bin, gain.low, gain.high
            );
        }
    }

    // The model with the cause at work renders what the microphone should have recorded.
    let extended = found.model.room(&room)?;
    let model = extended.measured_room(&room)?;
    let (source, receiver) = (model.source("talker")?, model.receiver("microphone")?);
    let tracer = PathTracer::new(TracerConfig { rays: 5_000, ..TracerConfig::default() })?;
    let paths = tracer.trace(model.scene(), source, receiver, &model.air(), &())?;
    let measured = room.load_response(0)?;
    let config = RenderConfig { sample_rate_hz: measured.sample_rate_hz(), ..RenderConfig::default() };
    let materials: Vec<Material> = model.scene().materials().iter().map(|m| m.material.clone()).collect();
    let stated = PressureRenderer::new(config)?.render(&paths, &extended.conditions(&materials, 0, 0))?;
    let mended = extended.finish(&source.id, &receiver.id, stated.clone(), 1)?;
    println!("direct sound, in milliseconds after the start of the file:");
    for (what, response) in [("measured", &measured), ("model", &stated), ("extended model", &mended)] {
        let onset = Onset::find(response.samples(), response.sample_rate_hz())?;
        println!("  {what:<16}{:.1}", 1e3 * onset.time_s);
    }
    Ok(())
}

/// The same room, its recordings late by a latency of which its file knows nothing.
fn late(room: &MeasuredRoom, latency_s: f64, folder: &Path) -> Result<MeasuredRoom, sabine::scene::Error> {
    let responses = room.responses().iter().enumerate().map(|(i, entry)| {
        let response = room.load_response(i)?;
        let rate_hz = response.sample_rate_hz();
        let mut samples = vec![0.0; (latency_s * f64::from(rate_hz)).round() as usize];
        samples.extend(response.samples());
        let [source, receiver] =
            [room.sources()[entry.source].id.clone(), room.receivers()[entry.receiver].id.clone()];
        let name = format!("{source}_{receiver}");
        let samples = ImpulseResponse::new(samples, rate_hz)?;
        Ok(NewResponse { source, receiver, name, air: None, session: None, recorded_at: None, samples })
    });
    let late = NewRoom {
        scene: room.scene().clone(),
        priors: room.priors().to_vec(),
        air: Some(room.air()),
        measurement: room.measurement(),
        position_sd: room.position_sd().clone(),
        sources: room.sources().to_vec(),
        receivers: room.receivers().to_vec(),
        responses: responses.collect::<Result<_, sabine::scene::Error>>()?,
    };
    late.write(folder.join("room"))
}
