//! The room from above, with the direct sound and the first reflections.

use crate::outline::outlines;
use crate::page::escape;
use sabine::paths::{Conditions, PathSet, Reflection};
use sabine::scene::{MeasuredRoom, Receiver, Source};
use std::fmt::Write;

/// Width of the drawing in its own units, and the margin about the room.
const WIDTH: f64 = 720.0;
const MARGIN: f64 = 50.0;
/// The weakest reflection drawn, below the strongest (dB).
const RANGE_DB: f64 = 30.0;

type Point = [f64; 3];

/// A reflection of first order.
struct FirstReflection {
    point: Point,
    surface: String,
    delay_ms: f64,
    level_db: f64,
}

/// The plan as an SVG that follows its viewer into dark mode.
pub fn svg(
    room: &MeasuredRoom,
    source: &Source,
    receiver: &Receiver,
    paths: &PathSet,
    conditions: &Conditions,
) -> Result<String, sabine::acoustics::Error> {
    let vertices = room.scene().vertices();
    let bound =
        |axis: usize, pick: fn(f64, f64) -> f64, from: f64| vertices.iter().map(|v| v[axis]).fold(from, pick);
    let low = [0, 1].map(|axis| bound(axis, f64::min, f64::INFINITY));
    let high = [0, 1].map(|axis| bound(axis, f64::max, f64::NEG_INFINITY));
    let scale = (WIDTH - 2.0 * MARGIN) / (high[0] - low[0]).max(high[1] - low[1]);
    let at = |p: Point| (MARGIN + (p[0] - low[0]) * scale, MARGIN + (high[1] - p[1]) * scale);
    let (width, depth) =
        ((high[0] - low[0]) * scale + 2.0 * MARGIN, (high[1] - low[1]) * scale + 2.0 * MARGIN);
    let (direct, reflections) = first_reflections(room, source, receiver, paths, conditions)?;

    let legend = 24.0 * (reflections.len() as f64 + 2.0);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" font-family=\"sans-serif\" font-size=\"14\">\
         <style>:root{{color-scheme:light dark;--ink:#222;--paper:#fff;--soft:#999;--ray:#0072b2;--direct:#d55e00}}\
         @media (prefers-color-scheme: dark){{:root{{--ink:#e4e4e4;--paper:#161616;--soft:#777;--ray:#4da3dc;--direct:#ff8a3c}}}}\
         .paper{{fill:var(--paper)}}.wall{{stroke:var(--ink)}}text{{fill:var(--ink)}}.ray{{stroke:var(--ray);fill:none}}\
         .direct{{stroke:var(--direct)}}.spot{{fill:var(--ray)}}.end{{fill:var(--ink)}}.scale{{stroke:var(--soft);stroke-width:2}}</style>\
         <rect class=\"paper\" width=\"100%\" height=\"100%\"/>",
        width.max(520.0),
        depth + legend + 30.0
    );
    for [a, b] in outlines(room.scene()) {
        let ((x1, y1), (x2, y2)) = (at(a), at(b));
        let _ = write!(
            text,
            "<line class=\"wall\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/>"
        );
    }
    let (s, r) = (at(source.position_m), at(receiver.position_m));
    let loudest = reflections.iter().map(|f| f.level_db).fold(f64::NEG_INFINITY, f64::max);
    for (number, reflection) in reflections.iter().enumerate() {
        let (x, y) = at(reflection.point);
        let strength = (1.0 + (reflection.level_db - loudest) / RANGE_DB).clamp(0.0, 1.0);
        let _ = write!(
            text,
            "<polyline class=\"ray\" stroke-width=\"{:.1}\" opacity=\"{:.2}\" points=\"{:.1},{:.1} {x:.1},{y:.1} {:.1},{:.1}\"/>\
             <circle class=\"spot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            0.8 + 2.0 * strength,
            0.35 + 0.65 * strength,
            s.0,
            s.1,
            r.0,
            r.1,
            x + 5.0,
            y - 5.0,
            number + 1
        );
    }
    if direct {
        let _ = write!(
            text,
            "<line class=\"direct\" stroke-width=\"3\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>",
            s.0, s.1, r.0, r.1
        );
    }
    for ((x, y), name) in [(s, &source.id), (r, &receiver.id)] {
        let _ = write!(
            text,
            "<circle class=\"end\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\"/><text x=\"{:.1}\" y=\"{:.1}\" font-weight=\"bold\">{}</text>",
            x + 9.0,
            y + 18.0,
            escape(name)
        );
    }
    let _ = write!(
        text,
        "<line class=\"scale\" x1=\"{MARGIN}\" y1=\"{0:.1}\" x2=\"{1:.1}\" y2=\"{0:.1}\"/><text x=\"{2:.1}\" y=\"{3:.1}\">1 m</text>",
        depth - 16.0,
        MARGIN + scale,
        MARGIN + scale + 6.0,
        depth - 11.0
    );
    let mut line = depth + 16.0;
    let head = match direct {
        true => {
            "direct sound in orange; first reflections in blue: delay after the shortest path, level re direct sound at 1 m"
        }
        false => {
            "no direct sound; first reflections in blue: delay after the shortest path, level re direct sound at 1 m"
        }
    };
    let _ = write!(text, "<text x=\"{MARGIN}\" y=\"{line:.0}\" font-size=\"12\">{head}</text>");
    for (number, f) in reflections.iter().enumerate() {
        line += 22.0;
        let _ = write!(
            text,
            "<text x=\"{MARGIN}\" y=\"{line:.0}\">{}  {}  {:.1} ms  {:.1} dB at {} Hz</text>",
            number + 1,
            escape(&f.surface),
            f.delay_ms,
            f.level_db,
            room.bands().nominal_hz(reference_band(room))
        );
    }
    text.push_str("</svg>\n");
    Ok(text)
}

/// The octave in which levels are given: 1 kHz, or the highest one.
fn reference_band(room: &MeasuredRoom) -> usize {
    let bands = room.bands();
    bands.iter_hz().position(|hz| hz == 1000.0).unwrap_or(bands.len() - 1)
}

/// Whether there is direct sound, and the exact paths of one reflection, the earliest first.
fn first_reflections(
    room: &MeasuredRoom,
    source: &Source,
    receiver: &Receiver,
    paths: &PathSet,
    conditions: &Conditions,
) -> Result<(bool, Vec<FirstReflection>), sabine::acoustics::Error> {
    let energies = paths.energies(conditions)?;
    let energies = &energies[reference_band(room)];
    let speed_m_s = conditions.air.speed_of_sound_m_s();
    let first_m = paths.lengths_m().iter().copied().fold(f32::INFINITY, f32::min);
    let line: Point = std::array::from_fn(|i| receiver.position_m[i] - source.position_m[i]);
    let distance2 = line.iter().map(|c| c * c).sum::<f64>();
    let (mut direct, mut found) = (false, Vec::new());
    for i in (0..paths.len()).filter(|&i| paths.is_exact(i)) {
        let Some((before, material, Reflection::Specular)) = paths.last_reflection(paths.chains()[i]) else {
            direct |= paths.is_direct(i);
            continue;
        };
        if before != PathSet::DIRECT {
            continue;
        }
        // The point at which the legs from source and receiver meet: |S + a u - R| = length - a.
        let (length, u) = (f64::from(paths.lengths_m()[i]), paths.departure(i));
        let along: f64 = (0..3).map(|k| u[k] * line[k]).sum();
        let leg = (length * length - distance2) / (2.0 * (length - along));
        found.push(FirstReflection {
            point: std::array::from_fn(|k| source.position_m[k] + leg * u[k]),
            surface: room.scene().materials()[material as usize].name.clone(),
            delay_ms: 1e3 * f64::from(paths.lengths_m()[i] - first_m) / speed_m_s,
            level_db: 10.0 * f64::from(energies[i]).log10(),
        });
    }
    found.sort_by(|a, b| a.delay_ms.total_cmp(&b.delay_ms));
    Ok((direct, found))
}
