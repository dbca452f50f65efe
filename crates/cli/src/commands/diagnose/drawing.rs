//! The room as stated and as found, from above and from two sides: where a person with a tape measure would look.

use crate::outline::{Point, key, outlines};
use crate::page::escape;
use sabine::diagnose::{ExtendedModel, ExtendedRoom, MovedReflection};
use sabine::scene::MeasuredRoom;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Width of the drawing in its own units, the margin about each view, and the height of a line of the legend.
const WIDTH: f64 = 760.0;
const MARGIN: f64 = 40.0;
const LINE: f64 = 22.0;
/// Most receivers whose names are drawn: of more, one name would lie on another.
const MOST_NAMES: usize = 12;
/// Length of an axis of a directional source or microphone, in metres.
const AXIS_M: f64 = 0.5;
/// What moved less than this, in metres, is where it is stated.
const MOVED_M: f64 = 0.002;
/// A line that is no farther from another than this, in metres, lies on it.
const BESIDE_M: f64 = 1e-4;
/// Most lines of each kind that are drawn, the longest: a scan has more than a page holds, and a person sees.
const MOST_LINES: usize = 2000;
/// Most reflections whose paths are drawn: of more, one path would lie on another.
const MOST_PATHS: usize = 24;
/// Lines of the mesh as stated, as it is found, of reflections, and of what it does not have there.
const STATED: &str = "stroke=\"var(--ink)\" stroke-width=\"1\"";
const GONE: &str = "stroke=\"var(--ink)\" stroke-width=\"1\" stroke-dasharray=\"3 4\" opacity=\"0.6\"";
const FOUND: &str = "stroke=\"#d55e00\" stroke-width=\"2.5\"";
const PATH: &str = "stroke=\"#0072b2\" stroke-width=\"1\" opacity=\"0.8\"";
const ADDED: &str = "fill=\"#d55e00\" fill-opacity=\"0.3\"";

/// Whether what was found has a place in the room.
pub fn has_a_place(model: &ExtendedModel) -> bool {
    let model = model.applied();
    let axes = model.axis.is_empty() && model.receiver_axis.is_empty();
    let places = model.position_m.is_empty() && model.surfaces.is_empty() && model.sheets.is_empty();
    let size = model.dimensions.is_none() && model.objects.is_empty();
    !(axes && places && size && model.coordinate_shift.is_none())
}

/// One view: the axes of the room that go to the right and up, and where it lies in the drawing.
struct View {
    name: &'static str,
    axes: [usize; 2],
    left: f64,
    bottom: f64,
    low: Point,
    scale: f64,
}

impl View {
    fn at(&self, place: Point) -> (f64, f64) {
        let [right, up] = self.axes.map(|axis| (place[axis] - self.low[axis]) * self.scale);
        (self.left + right, self.bottom - up)
    }

    fn line(&self, text: &mut String, ends: [Point; 2], look: &str) {
        let [(x1, y1), (x2, y2)] = ends.map(|p| self.at(p));
        // A line along the view is a point.
        if (x1 - x2).abs() + (y1 - y2).abs() > 0.1 {
            let _ = write!(
                text,
                "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke-linecap=\"round\" {look}/>"
            );
        }
    }
}

/// A source or receiver, as stated and as found.
struct Placed<'a> {
    id: &'a str,
    is_source: bool,
    stated_m: Point,
    found_m: Point,
    /// Its axis, if it has a pattern.
    axis: Option<Point>,
}

impl Placed<'_> {
    fn is_moved(&self) -> bool {
        (0..3).map(|k| (self.stated_m[k] - self.found_m[k]).powi(2)).sum::<f64>().sqrt() > MOVED_M
    }

    fn mark(&self, (x, y): (f64, f64), colour: &str) -> String {
        match self.is_source {
            true => format!(
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"9\" height=\"9\" fill=\"{colour}\"/>",
                x - 4.5,
                y - 4.5
            ),
            false => format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\"/>"),
        }
    }
}

/// The drawing as one `<svg>` element for a page, whose inks it takes, with the paths of single reflections among those that came where causes put them.
pub fn svg(room: &MeasuredRoom, found: &ExtendedRoom, moved: &[MovedReflection]) -> String {
    let (lines, placed) = (Lines::of(room, found), all_placed(room, found));
    let single = moved.iter().filter(|one| one.order == 1 && !one.stops_m.is_empty()).take(MOST_PATHS);
    let paths: Vec<&[Point]> = single.map(|one| &one.stops_m[..]).collect();
    let [stated, now] = [room.scene(), &found.scene].map(sabine::scene::Scene::bounds_m);
    let low: Point = std::array::from_fn(|k| stated[0][k].min(now[0][k]));
    let size: Point = std::array::from_fn(|k| stated[1][k].max(now[1][k]) - low[k]);
    let scale = (WIDTH - 4.0 * MARGIN) / (size[0] + size[1]);
    let [x, y, z] = size.map(|s| s * scale);
    let view = |name, axes, left, bottom| View { name, axes, left, bottom, low, scale };
    let upper = 2.0 * MARGIN + z;
    let lower = upper + 1.5 * MARGIN + y;
    let views = [
        view("from the front", [0, 2], MARGIN, upper - MARGIN),
        view("from the right", [1, 2], 3.0 * MARGIN + x, upper - MARGIN),
        view("from above", [0, 1], MARGIN, lower - MARGIN),
    ];
    let keys = keys(&lines, &placed, !paths.is_empty());
    let height = lower + LINE * (keys.len() as f64 + 1.5);
    let mut text = format!(
        "<svg class=\"chart\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"13\" role=\"img\" aria-label=\"The room as stated and as found\">"
    );
    for view in &views {
        draw(&mut text, view, &lines, &placed);
        let legs = paths.iter().flat_map(|stops| stops.windows(2));
        legs.for_each(|leg| view.line(&mut text, [leg[0], leg[1]], PATH));
    }
    let (left, top) = (MARGIN, lower + 6.0);
    let _ = write!(
        text,
        "<line x1=\"{left}\" y1=\"{top:.1}\" x2=\"{:.1}\" y2=\"{top:.1}\" stroke=\"var(--ink)\" stroke-width=\"2\"/><text x=\"{:.1}\" y=\"{:.1}\" fill=\"var(--ink)\">1 m</text>",
        left + scale,
        left + scale + 6.0,
        top + 5.0
    );
    for (row, (mark, words)) in (1..).zip(keys) {
        let _ = write!(
            text,
            "<g transform=\"translate({left},{:.1})\">{mark}<text x=\"34\" y=\"5\" fill=\"var(--ink)\">{words}</text></g>",
            top + LINE * f64::from(row)
        );
    }
    text.push_str("</svg>\n");
    text
}

/// Lines of the mesh: those that stay, those that are not where they were stated, and where they are instead.
struct Lines {
    kept: Vec<[Point; 2]>,
    gone: Vec<[Point; 2]>,
    found: Vec<[Point; 2]>,
    /// Triangles that the mesh as stated does not have, behind all that it has: panels, holes and objects.
    added: Vec<[Point; 3]>,
}

impl Lines {
    fn of(room: &MeasuredRoom, found: &ExtendedRoom) -> Self {
        let (stated, now) = (outlines(room.scene()), outlines(&found.scene));
        let keys = |lines: &[[Point; 2]]| lines.iter().map(|l| key(*l)).collect::<BTreeSet<_>>();
        let (before, after) = (keys(&stated), keys(&now));
        let (kept, gone): (Vec<_>, Vec<_>) = stated.into_iter().partition(|l| after.contains(&key(*l)));
        let (mut kept, gone) = (longest(kept), longest(gone));
        // A wall that only grew or shrank along itself, beside one that moved, is where it was.
        let moved = longest(now.into_iter().filter(|l| !before.contains(&key(*l))).collect());
        let (longer, elsewhere): (Vec<_>, Vec<_>) =
            moved.into_iter().partition(|l| gone.iter().any(|stated| is_along(*stated, *l)));
        kept.extend(longer);
        let added = room.scene().triangles().len()..found.scene.triangles().len();
        Self { kept, gone, found: elsewhere, added: added.map(|i| found.scene.corners_m(i)).collect() }
    }
}

/// The longest lines, [`MOST_LINES`] of them.
fn longest(mut lines: Vec<[Point; 2]>) -> Vec<[Point; 2]> {
    let length2 = |[a, b]: &[Point; 2]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    lines.sort_by(|a, b| length2(b).total_cmp(&length2(a)));
    lines.truncate(MOST_LINES);
    lines
}

/// Whether two lines lie on one and overlap.
fn is_along(stated: [Point; 2], line: [Point; 2]) -> bool {
    let minus = |a: Point, b: Point| -> Point { std::array::from_fn(|k| a[k] - b[k]) };
    let dot = |a: Point, b: Point| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let way = minus(stated[1], stated[0]);
    let length2 = dot(way, way);
    if length2 == 0.0 {
        return false;
    }
    // How far along the stated line each end is, as a share of its length, and how far beside it.
    let ends = line.map(|p| {
        let from = minus(p, stated[0]);
        let share = dot(from, way) / length2;
        (share, (dot(from, from) - share * share * length2).max(0.0).sqrt())
    });
    let shares = ends.map(|(share, _)| share);
    ends.iter().all(|(_, beside_m)| *beside_m < BESIDE_M)
        && shares[0].max(shares[1]) > 0.0
        && shares[0].min(shares[1]) < 1.0
}

fn all_placed<'a>(room: &'a MeasuredRoom, found: &'a ExtendedRoom) -> Vec<Placed<'a>> {
    let sources = room.sources().iter().zip(&found.sources).zip(&found.directivities);
    let sources = sources.map(|((stated, now), pattern)| Placed {
        id: &stated.id,
        is_source: true,
        stated_m: stated.position_m,
        found_m: now.position_m,
        axis: pattern.as_ref().and(now.axis),
    });
    let receivers = room.receivers().iter().zip(&found.receivers).zip(&found.receiver_directivities);
    let receivers = receivers.map(|((stated, now), pattern)| Placed {
        id: &stated.id,
        is_source: false,
        stated_m: stated.position_m,
        found_m: now.position_m,
        axis: pattern.as_ref().and(now.axis),
    });
    sources.chain(receivers).collect()
}

fn draw(text: &mut String, view: &View, lines: &Lines, placed: &[Placed<'_>]) {
    let (x, y) = (view.left, view.bottom + 20.0);
    let _ = write!(text, "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"var(--ink)\">{}</text>", view.name);
    for (all, look) in [(&lines.kept, STATED), (&lines.gone, GONE), (&lines.found, FOUND)] {
        all.iter().for_each(|line| view.line(text, *line, look));
    }
    for corners in &lines.added {
        let points = corners.map(|c| view.at(c)).map(|(x, y)| format!("{x:.1},{y:.1}")).join(" ");
        let _ = write!(text, "<polygon points=\"{points}\" {ADDED}/>");
    }
    let names = placed.iter().filter(|p| !p.is_source).count() <= MOST_NAMES;
    for one in placed {
        let here = view.at(one.found_m);
        if one.is_moved() {
            view.line(text, [one.stated_m, one.found_m], FOUND);
            text.push_str(&one.mark(view.at(one.stated_m), "var(--ink)"));
        }
        if let Some(axis) = one.axis {
            let tip = std::array::from_fn(|k| one.found_m[k] + AXIS_M * axis[k]);
            view.line(text, [one.found_m, tip], FOUND);
        }
        let is_found = one.is_moved() || one.axis.is_some();
        text.push_str(&one.mark(here, if is_found { "#d55e00" } else { "var(--ink)" }));
        if one.is_source || names || one.is_moved() {
            let _ = write!(
                text,
                "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\" fill=\"var(--ink)\">{}</text>",
                here.0 + 7.0,
                here.1 - 5.0,
                escape(one.id)
            );
        }
    }
}

/// Marks of the legend with their words: only of what is drawn.
fn keys(lines: &Lines, placed: &[Placed<'_>], has_paths: bool) -> Vec<(String, &'static str)> {
    let line = |look: &str| format!("<line x1=\"0\" y1=\"0\" x2=\"24\" y2=\"0\" {look}/>");
    let sheet = format!("<rect x=\"2\" y=\"-6\" width=\"20\" height=\"12\" {ADDED}/>");
    let of =
        |is_source: bool| Placed { id: "", is_source, stated_m: [0.0; 3], found_m: [0.0; 3], axis: None };
    let marks = of(true).mark((6.0, 0.0), "var(--ink)") + &of(false).mark((19.0, 0.0), "var(--ink)");
    let moves = !lines.gone.is_empty();
    [
        (true, marks, "source, microphone"),
        (moves, line(GONE), "the mesh as stated, where it stands elsewhere"),
        (!lines.found.is_empty() && moves, line(FOUND), "the mesh as found"),
        (!lines.added.is_empty(), sheet, "what the mesh lacks: a surface, an object; or a hole"),
        (has_paths, line(PATH), "reflections that were measured where the room as found has them"),
        (placed.iter().any(Placed::is_moved), line(FOUND), "from where it is stated to where it was found"),
        (placed.iter().any(|p| p.axis.is_some()), line(FOUND), "axis of a directional source or microphone"),
    ]
    .into_iter()
    .filter_map(|(shown, mark, words)| shown.then_some((mark, words)))
    .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::demo::Demo;
    use crate::room::read_room;
    use sabine::diagnose::{BoxObject, Dimensions, ModelCause, ModelChange, RigidMotion, ThinPanel};
    use serde_json::json;

    #[test]
    fn places_that_moved_together_are_drawn_where_they_are() {
        let mut demo = Demo::default();
        let room = read_room(&demo.or(None, "room").unwrap(), false, None).unwrap();
        let mut model = ExtendedModel::default();
        model.centres_hz = room.bands().iter_hz().collect();
        let motion = RigidMotion::new([0.05, -0.05, 0.02], 1.0, room.sources()[0].position_m);
        model.causes.push(ModelCause::new("coordinate_shift", vec![ModelChange::CoordinateShift(motion)]));
        let drawn = svg(&room, &model.room(&room).unwrap(), &[]);
        assert!(has_a_place(&model) && drawn.contains("from where it is stated"));
        // Each place twice, in three views.
        let (sources, receivers) = (room.sources().len(), room.receivers().len());
        let count = |shape: &str| drawn.matches(shape).count();
        assert!(count("<circle") >= 6 * receivers && count("<rect") >= 6 * sources);
    }

    #[test]
    fn an_object_that_the_mesh_lacks_is_drawn_where_it_stands() {
        let mut demo = Demo::default();
        let room = read_room(&demo.or(None, "room").unwrap(), false, None).unwrap();
        let mut model = ExtendedModel::default();
        model.centres_hz = room.bands().iter_hz().collect();
        let [[x, y, z], _] = room.scene().bounds_m();
        let material = room.scene().materials()[0].name.clone();
        let object = BoxObject::new([x + 0.4, y + 0.4, z], [0.4, 0.4, 0.3], 0.0, material);
        model.causes.push(ModelCause::new("missing_object", vec![ModelChange::Object(object)]));
        let drawn = svg(&room, &model.room(&room).unwrap(), &[]);
        assert!(has_a_place(&model) && drawn.contains("what the mesh lacks"));
        // Two triangles on each of six sides, in three views.
        assert_eq!(drawn.matches("<polygon").count(), 36);
        assert!(!drawn.contains("the mesh as stated"));
    }

    #[test]
    fn what_was_found_is_drawn_where_it_is() {
        let mut demo = Demo::default();
        let room = read_room(&demo.or(None, "room").unwrap(), false, None).unwrap();
        let mut model = ExtendedModel::default();
        model.centres_hz = room.bands().iter_hz().collect();
        assert!(!has_a_place(&model));
        let [low, high] = room.scene().bounds_m();
        let source = &room.sources()[0];
        let mut there = source.position_m;
        there[0] += 0.2 * (0.5 * (low[0] + high[0]) - there[0]).signum();
        model.causes.push(ModelCause::new(
            "a",
            vec![ModelChange::Position { id: source.id.clone(), position_m: there }],
        ));
        let unaltered = svg(&room, &model.room(&room).unwrap(), &[]);
        assert!(has_a_place(&model) && unaltered.contains("from where it is stated"));
        assert!(!unaltered.contains("<polygon") && !unaltered.contains("the mesh as found"));

        let panel = ThinPanel::rectangle(there, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [0.2, 0.1], 0.1);
        let size = Dimensions::new([1.05, 1.0, 1.0], [0.0; 3]);
        model
            .causes
            .push(ModelCause::new("b", vec![ModelChange::Panel(panel), ModelChange::Dimensions(size)]));
        let drawn = svg(&room, &model.room(&room).unwrap(), &[]);
        // Two triangles in each of three views.
        assert_eq!(drawn.matches("<polygon").count(), 6);
        let lines = (0..=MOST_LINES).map(|i| [[0.0; 3], [i as f64, 0.0, 0.0]]).collect();
        let drawn_first = longest(lines);
        assert_eq!((drawn_first.len(), drawn_first[0][1][0]), (MOST_LINES, MOST_LINES as f64));
        assert!(is_along([[0.0; 3], [1.0, 0.0, 0.0]], [[1.5, 0.0, 0.0], [0.2, 0.0, 0.0]]));
        assert!(!is_along([[0.0; 3], [1.0, 0.0, 0.0]], [[1.5, 0.0, 0.0], [1.2, 0.0, 0.0]]));
        assert!(!is_along([[0.0; 3], [1.0, 0.0, 0.0]], [[0.0; 3], [1.0, 0.01, 0.0]]));
        assert!(!drawn.contains("reflections that were measured"));
        let [low, high] = [low, high].map(|corner| corner.to_vec());
        let moved = |order: usize| -> MovedReflection {
            let text = json!({ "response": "a", "order": order, "stops_m": [there, low, high], "stated_ms": 1.0, "found_ms": 2.0, "measured_ms": 2.0 });
            serde_json::from_value(text).unwrap()
        };
        let found = model.room(&room).unwrap();
        let paths = svg(&room, &found, &[moved(1), moved(2)]);
        // Two legs of one path in three views, and its mark in the legend.
        assert_eq!(paths.matches(PATH).count(), 7);
        assert!(paths.contains("reflections that were measured"));
        for part in ["the mesh as stated", "the mesh as found", "what the mesh lacks", &source.id] {
            assert!(drawn.contains(part), "{part}");
        }
        assert!(!drawn.contains("NaN") && !drawn.contains("inf"));
    }
}
