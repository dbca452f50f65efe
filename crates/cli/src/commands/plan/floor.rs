//! The room from above: expected nats of a microphone at each place as a heat map, and the places chosen.

use crate::outline::outlines;
use crate::page::escape;
use sabine::diagnose::{Plan, PlannedMeasurement};
use sabine::scene::MeasuredRoom;
use std::fmt::Write;

/// Width of the drawing in its own units, the margin about the room, and the height of the legend.
const WIDTH: f64 = 760.0;
const MARGIN: f64 = 46.0;
const LEGEND: f64 = 96.0;
/// Most of the drawing's height that the room takes: a corridor drawn along the page would be as long as the report.
const MAX_DEPTH: f64 = 900.0;
/// Colours from few nats to many: viridis (S. van der Walt, N. Smith 2015), even in lightness.
const COLOURS: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// A colour between those of the scale; 0 to 1.
fn colour(share: f64) -> String {
    let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
    let at = share * (COLOURS.len() - 1) as f64;
    let low = (at as usize).min(COLOURS.len() - 2);
    let mix = |k: usize| COLOURS[low][k] + (at - low as f64) * (COLOURS[low + 1][k] - COLOURS[low][k]);
    format!("rgb({:.0},{:.0},{:.0})", mix(0), mix(1), mix(2))
}

/// Where things are drawn.
struct View {
    low: [f64; 2],
    high: [f64; 2],
    scale: f64,
}

impl View {
    fn of(room: &MeasuredRoom) -> Self {
        let [low, high] = room.scene().bounds_m();
        let (low, high) = ([low[0], low[1]], [high[0], high[1]]);
        let scale = ((WIDTH - 2.0 * MARGIN) / (high[0] - low[0])).min(MAX_DEPTH / (high[1] - low[1]));
        Self { low, high, scale }
    }

    fn at(&self, place: [f64; 3]) -> (f64, f64) {
        (MARGIN + (place[0] - self.low[0]) * self.scale, MARGIN + (self.high[1] - place[1]) * self.scale)
    }

    /// Height of the room in the drawing, both margins included.
    fn depth(&self) -> f64 {
        (self.high[1] - self.low[1]) * self.scale + 2.0 * MARGIN
    }
}

/// The plan as one `<svg>` element for a page, whose inks it takes.
pub fn svg(room: &MeasuredRoom, plan: &Plan) -> String {
    let view = View::of(room);
    let depth = view.depth();
    let mut text = format!(
        "<svg class=\"chart\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH:.0} {:.0}\" font-family=\"sans-serif\" font-size=\"14\" role=\"img\" aria-label=\"The room from above: nats expected of a microphone at each place, and the places chosen\">",
        depth + LEGEND
    );
    let (low, high) = heat(&mut text, &view, plan);
    for [a, b] in outlines(room.scene()) {
        let ((x1, y1), (x2, y2)) = (view.at(a), view.at(b));
        let _ = write!(
            text,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"var(--ink)\" stroke-width=\"1.2\"/>"
        );
    }
    stated(&mut text, &view, room, plan);
    for (number, chosen) in (1..).zip(&plan.chosen) {
        let Some(place) = plan.candidates[chosen.candidate].measurement.position_m() else { continue };
        let (x, y) = view.at(place);
        let _ = write!(
            text,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"13\" fill=\"#fff\" stroke=\"#d55e00\" stroke-width=\"3\"/><text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-weight=\"bold\" fill=\"#222\">{number}</text>",
            y + 5.0
        );
    }
    legend(&mut text, &view, (low, high));
    text.push_str("</svg>\n");
    text
}

/// A square for each place of a microphone; returns the ends of the scale in nats.
fn heat(text: &mut String, view: &View, plan: &Plan) -> (f64, f64) {
    let places: Vec<([f64; 3], f64)> = plan
        .candidates
        .iter()
        .filter_map(|c| match c.measurement {
            PlannedMeasurement::Microphone { position_m } => Some((position_m, c.nats)),
            _ => None,
        })
        .collect();
    let low = places.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let high = places.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
    let side = plan.spacing_m * view.scale;
    for (place, nats) in places {
        let (x, y) = view.at(place);
        let share = if high > low { (nats - low) / (high - low) } else { 0.5 };
        let _ = write!(
            text,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{side:.1}\" height=\"{side:.1}\" fill=\"{}\"><title>({:.2}, {:.2}, {:.2}) m: {nats:.2} nats</title></rect>",
            x - 0.5 * side,
            y - 0.5 * side,
            colour(share),
            place[0],
            place[1],
            place[2]
        );
    }
    (low, high)
}

/// Sources and receivers of the room file.
fn stated(text: &mut String, view: &View, room: &MeasuredRoom, plan: &Plan) {
    // A name on the heat map is read on any of its colours.
    let mut label = |mark: String, (x, y): (f64, f64), name: &str| {
        let _ = write!(
            text,
            "{mark}<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"12\" fill=\"#111\" stroke=\"#fff\" stroke-width=\"3\" paint-order=\"stroke\">{}</text>",
            x + 10.0,
            y - 7.0,
            escape(name)
        );
    };
    for source in room.sources() {
        let (x, y) = view.at(source.position_m);
        let mark = format!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"14\" height=\"14\" fill=\"#222\" stroke=\"#fff\" stroke-width=\"2\"/>",
            x - 7.0,
            y - 7.0
        );
        label(mark, (x, y), &source.id);
    }
    if plan.stated_responses == 0 {
        return;
    }
    for receiver in room.receivers() {
        let (x, y) = view.at(receiver.position_m);
        let mark = format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\" fill=\"#222\" stroke=\"#fff\" stroke-width=\"2\"/>"
        );
        label(mark, (x, y), &receiver.id);
    }
}

fn legend(text: &mut String, view: &View, (low, high): (f64, f64)) {
    let top = view.depth() - 14.0;
    let _ = write!(
        text,
        "<line x1=\"{MARGIN}\" y1=\"{top:.1}\" x2=\"{:.1}\" y2=\"{top:.1}\" stroke=\"var(--ink)\" stroke-width=\"2\"/><text x=\"{:.1}\" y=\"{:.1}\" fill=\"var(--ink)\">1 m</text>",
        MARGIN + view.scale,
        MARGIN + view.scale + 6.0,
        top + 5.0
    );
    let (x, y) = (MARGIN, top + 22.0);
    if high.is_finite() {
        for step in 0..40 {
            let _ = write!(
                text,
                "<rect x=\"{:.1}\" y=\"{y:.1}\" width=\"7.5\" height=\"14\" fill=\"{}\"/>",
                x + 7.0 * f64::from(step),
                colour(f64::from(step) / 39.0)
            );
        }
        let _ = write!(
            text,
            "<text x=\"{x:.1}\" y=\"{0:.1}\" fill=\"var(--ink)\">{low:.1}</text><text x=\"{1:.1}\" y=\"{0:.1}\" text-anchor=\"end\" fill=\"var(--ink)\">{high:.1} nats</text>",
            y + 30.0,
            x + 280.0
        );
    }
    let keys = [
        (
            "<rect x=\"-7\" y=\"-7\" width=\"14\" height=\"14\" fill=\"#222\" stroke=\"#fff\" stroke-width=\"2\"/>",
            "source",
        ),
        ("<circle r=\"6\" fill=\"#222\" stroke=\"#fff\" stroke-width=\"2\"/>", "microphone of the room file"),
        ("<circle r=\"10\" fill=\"#fff\" stroke=\"#d55e00\" stroke-width=\"3\"/>", "chosen, in this order"),
    ];
    for (row, (mark, words)) in keys.into_iter().enumerate() {
        let _ = write!(
            text,
            "<g transform=\"translate({:.1},{:.1})\">{mark}<text x=\"18\" y=\"5\" fill=\"var(--ink)\">{words}</text></g>",
            x + 340.0,
            y + 2.0 + 25.0 * row as f64
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_ends_in_its_outer_colours() {
        assert_eq!(colour(0.0), "rgb(68,1,84)");
        assert_eq!(colour(1.0), "rgb(253,231,37)");
        assert_eq!(colour(0.5), "rgb(33,145,140)");
        assert_eq!(colour(f64::NAN), "rgb(68,1,84)");
    }
}
