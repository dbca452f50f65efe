//! An effect of one's own in the catalogue: a recorder whose automatic gain rises and falls while it records.
//!
//! ```text
//! cargo run --example own_effect [-- ROOM_FOLDER]
//! ```
//!
//! The laboratory of the tests hides it in a small room; the catalogue explains the responses without it, then with it. It prints
//! ```text
//! without the effect: unexplained
//! with it: explained
//! gain_drift (1064 nats): The gain rises and falls while a response is recorded: is an automatic gain control on?
//! ...
//! ```
//! What must hold for an effect, line by line: `docs/how-to/own-effect.md`. With the effects of the project: `sabine diagnose`.

use sabine::diagnose::{
    BandView, Case, DecayTerm, DiagnoseConfig, Diagnoser, Effect, EffectInfo, FittedCase, GainOverTime,
    ModelChange, Parameter, Stage, Survey, catalogue,
};
use sabine::scene::MeasuredRoom;
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use std::f64::consts::{LN_10, TAU};

/// Gain in dB over the time of the file: a sine and a cosine of one period, alike in all octaves and responses.
///
/// Mark: residuals that follow the time of the file. Mimicked by: a cut, if less than half a period is heard.
#[derive(Clone, Copy)]
struct GainDrift;

impl Effect for GainDrift {
    fn info(&self) -> EffectInfo {
        let text = "The gain rises and falls while a response is recorded: is an automatic gain control on?";
        EffectInfo::new("gain_drift", "Recorder gain drifts", text)
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let parameters = vec![
            Parameter::new("sine", "dB", 0.0, 3.0, (-20.0, 20.0)).typically(3.0),
            Parameter::new("cosine", "dB", 0.0, 3.0, (-20.0, 20.0)),
            Parameter::new("period", "s", 0.3, 0.3, (0.05, 2.0)),
        ];
        // Sine and cosine are found from anywhere; the period only from near by.
        let starts = [0.1, 0.15, 0.2, 0.3, 0.45, 0.7].map(|period_s| vec![0.5, 0.5, period_s]).to_vec();
        let case = Case::decay(parameters, *self).at(Stage::Recorder).starting(starts);
        vec![case.changing(changes)]
    }
}

impl DecayTerm for GainDrift {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        for (bin, ln) in ln_energy.iter_mut().enumerate() {
            let (sin, cos) = (TAU * view.file_time_s(bin) / values[2]).sin_cos();
            *ln += LN_10 / 10.0 * (values[0] * sin + values[1] * cos);
        }
    }
}

/// What renders: the same gain, in steps of a 32nd of a period, until the longest file ends.
fn changes(fitted: &FittedCase<'_>) -> Vec<ModelChange> {
    let values = fitted.values();
    let end_s = fitted.survey().responses().iter().map(|r| r.duration_s).fold(0.0, f64::max);
    let steps = (32.0 * end_s / values[2]).ceil() as usize;
    let time_s: Vec<f64> = (0..=steps).map(|k| values[2] * k as f64 / 32.0).collect();
    let db = |t: &f64| values[0] * (TAU * t / values[2]).sin() + values[1] * (TAU * t / values[2]).cos();
    let gain_db = time_s.iter().map(db).collect();
    vec![ModelChange::GainOverTime(GainOverTime::new(time_s, gain_db))]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let hidden = Hidden::GainDrift { depth_db: 3.0, period_s: 0.2, phase_rad: 1.0 };
    let lab = Laboratory::new(LabConfig { seed: 11, receivers: 4, ..LabConfig::default() })?;
    let room = match std::env::args_os().nth(1) {
        Some(room) => MeasuredRoom::read(room)?,
        None => lab.write(&[hidden], &folder.path().join("room"), None)?,
    };
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    let own: [Box<dyn Effect>; 1] = [Box::new(GainDrift)];
    let more = catalogue().into_iter().chain(own).collect();
    for (what, effects) in [("without the effect", catalogue()), ("with it", more)] {
        let found = Diagnoser::new(config.clone())?.with_effects(effects).diagnose(&room, &[], &())?;
        println!("{what}: {}", found.verdict);
        for cause in &found.causes {
            println!("{} ({:.0} nats): {}", cause.effect, cause.nats, cause.explanation);
            for p in &cause.parameters {
                println!("  {} {:.3} {} (90 %: {:.3} to {:.3})", p.name, p.value, p.unit, p.low, p.high);
            }
        }
    }
    Ok(())
}
