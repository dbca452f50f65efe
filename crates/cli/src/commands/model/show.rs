//! A model in words.

use crate::commands::diagnose::words;
use sabine::diagnose::{ExtendedModel, ModelCause, ModelChange};
use std::collections::BTreeMap;
use std::fmt::Write;

/// What a model changes, and how sure its numbers are.
pub fn in_words(model: &ExtendedModel) -> String {
    let mut text = String::new();
    if model.causes.is_empty() {
        text.push_str("nothing but absorption is changed\n");
    }
    for (number, cause) in model.causes.iter().enumerate() {
        let _ = writeln!(text, "{}. {}   [{}]", number + 1, title(cause), cause.name());
        for p in &cause.parameters {
            let (name, value) = (words::parameter(&p.name), words::number(p.value, p.high - p.low));
            let _ =
                writeln!(text, "  {name:<28} {value:>8} {:<6} 90 %: {}", p.unit, words::interval(p, "to"));
        }
        for change in &cause.changes {
            let _ = writeln!(text, "  changes {}", changed(change));
        }
        if cause.changes.is_empty() {
            text.push_str("  changes absorption alone, or nothing that is rendered\n");
        }
    }
    if !model.absorption.is_empty() {
        absorption(&mut text, model);
    }
    match &model.uncertainty {
        Some(uncertainty) => {
            let count = uncertainty.numbers.len();
            let _ = writeln!(text, "{count} numbers vary together: `sabine model sample` draws from them");
        }
        None => text.push_str("how sure its numbers are, the model does not say\n"),
    }
    text
}

/// The title of a cause; a law speaks for itself.
fn title(cause: &ModelCause) -> String {
    match cause.law() {
        Some(law) if !law.words().is_empty() => law.words().to_owned(),
        Some(law) => law.printed(),
        None => words::effect_of(&cause.id, cause.subject.as_deref()),
    }
}

/// Absorption by octave, with half the width of the 90 % interval.
fn absorption(text: &mut String, model: &ExtendedModel) {
    let known: BTreeMap<&str, [f64; 2]> = model.intervals_90().into_iter().collect();
    let _ = write!(text, "absorption{:<18}", "");
    for &hz in &model.centres_hz {
        let _ = write!(text, "{:>14}", words::hertz(hz));
    }
    text.push('\n');
    for (material, values) in &model.absorption {
        let _ = write!(text, "  {material:<26}");
        let name = material.replace('~', "~0").replace('/', "~1");
        for (band, value) in values.iter().enumerate() {
            let half = known.get(format!("/absorption/{name}/{band}").as_str());
            let half = half.map_or(String::new(), |[low, high]| format!(" ± {:.3}", 0.5 * (high - low)));
            let _ = write!(text, "{:>14}", format!("{value:.3}{half}"));
        }
        text.push('\n');
    }
}

/// What a change concerns.
fn changed(change: &ModelChange) -> String {
    let of = |what: &str, name: &str| format!("{what} of {name}");
    match change {
        ModelChange::BandGains(_) => "the gain of loudspeaker and microphone by octave".into(),
        ModelChange::RelativeHumidity(percent) => format!("the humidity of the air to {percent:.0} %"),
        ModelChange::Temperature(celsius) => format!("the temperature of the air to {celsius:.1} C"),
        ModelChange::SourcePattern { axis, .. } => {
            let names: Vec<&str> = axis.keys().map(String::as_str).collect();
            of("the directivity", &names.join(", "))
        }
        ModelChange::ReceiverPattern { directed_share, .. } => {
            let names: Vec<&str> = directed_share.keys().map(String::as_str).collect();
            of("the directivity", &names.join(", "))
        }
        ModelChange::Scattering(materials) => {
            let names: Vec<&str> = materials.keys().map(String::as_str).collect();
            of("the scattering", &names.join(", "))
        }
        ModelChange::Noise(_) => "the recording: background noise joins".into(),
        ModelChange::CoupledVolume(_) => "the decay: sound of a coupled volume joins".into(),
        ModelChange::WaveBelow(hz) => format!("responses below {hz:.0} Hz: the wave equation's"),
        ModelChange::Truncation([end_s, _]) => format!("the end of the recording to {end_s:.2} s"),
        ModelChange::Clock(ppm) => format!("the sampling clock by {ppm:.0} ppm"),
        ModelChange::Dimensions(size) => {
            let [x, y, z] = size.scale;
            format!("the size of the room: {x:.3} x {y:.3} x {z:.3} times as large")
        }
        ModelChange::SurfaceDisplacement(surface) => {
            let [x, y, z] = surface.point_m;
            format!("the surface about ({x:.2}, {y:.2}, {z:.2}) m: {:+.3} m farther out", surface.offset_m)
        }
        ModelChange::Panel(panel) => {
            let [x, y, z] = panel.corners_m[0];
            format!("the mesh: a panel with a corner at ({x:.2}, {y:.2}, {z:.2}) m joins")
        }
        ModelChange::Object(object) => {
            let ([x, y, _], [length, depth, height]) = (object.foot_m, object.size_m);
            format!(
                "the mesh: a box of {length:.2} x {depth:.2} x {height:.2} m about ({x:.2}, {y:.2}) m joins"
            )
        }
        ModelChange::Diffraction => "paths: sound bends around edges".into(),
        ModelChange::CoherentReflections => "reflections: their pressures add".into(),
        ModelChange::LocalReaction(share) => {
            format!(
                "absorption by the angle of incidence: walls react locally by {share:.2} (0: the same at all angles)"
            )
        }
        ModelChange::Latency(seconds) => format!("the latency of all responses to {:.3} ms", 1e3 * seconds),
        ModelChange::CoordinateShift(motion) => {
            let ([x, y, z], [east, north, _]) = (motion.shift_m, motion.about_m);
            let turned = format!("turned by {:+.2} degrees about ({east:.2}, {north:.2})", motion.turn_deg);
            format!("all places: by ({x:+.3}, {y:+.3}, {z:+.3}) m, {turned} m")
        }
        ModelChange::Position { id, position_m: [x, y, z] } => {
            format!("the place of {id} to ({x:.3}, {y:.3}, {z:.3}) m")
        }
        ModelChange::Inverted(response) => of("the sign", response),
        ModelChange::ResponseGain { response, gain_db } => {
            format!("the gain of {response} by {gain_db:+.2} dB")
        }
        ModelChange::ResponseBandGains { response, .. } => of("the gain by octave", response),
        ModelChange::Exchanged([one, other]) => format!("names: {one} and {other} were exchanged"),
        ModelChange::GainOverTime(_) => "the gain of the recorder over time".into(),
        ModelChange::Law(law) => format!("what paths carry: {}", law.printed()),
        other => format!("{other:?}"),
    }
}
