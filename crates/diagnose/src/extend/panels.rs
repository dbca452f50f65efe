//! Flat sheets that stand for surfaces that the mesh lacks: panels, and holes in walls.

use crate::effect::Observable;
use crate::extend::extended_model::ThinPanel;
use crate::infer::search::{Search, State};
use crate::likelihood::arrivals;
use crate::likelihood::multilateration::{mirrored, panel_axes};
use crate::report::diagnosis::FoundParameter;
use crate::survey::planes::Plane;

/// A reflection belongs to the panel if its peak comes within this of its instant, in seconds.
const NEAR_S: f64 = 1.5e-4;
/// The panel reaches beyond the outermost places where it was seen to reflect, in metres.
const MARGIN_M: f64 = 0.25;
/// A hole lies so far before its wall, in metres.
const BEFORE_WALL_M: f64 = 5e-3;

fn rectangle(centre: [f64; 3], axes: [[f64; 3]; 2], half_m: [f64; 2]) -> [[f64; 3]; 4] {
    [[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]].map(|[a, b]| {
        std::array::from_fn(|k| centre[k] + a * half_m[0] * axes[0][k] + b * half_m[1] * axes[1][k])
    })
}

/// The panel that a fit has found: it spans the places at which it was seen to reflect, and a little more.
pub(crate) fn panel(search: &Search<'_>, state: &State, values: &[f64]) -> Option<ThinPanel> {
    let baseline = search.baseline;
    let survey = baseline.survey();
    let data = baseline.arrival_data();
    let cases = search.cases_of(&state.chosen, Observable::Arrivals);
    let model = arrivals::at_fit(&data, &cases, &search.used);
    let first = survey.sources[survey.responses.first()?.source].position_m;
    let image = [values[0], values[1], values[2]];
    let axes = panel_axes(first, image);
    let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (first[k] + image[k]));
    let mut reach = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for (pair, response) in survey.responses.iter().enumerate() {
        let source = survey.sources[response.source].position_m;
        let receiver = survey.receivers[response.receiver].position_m;
        let Some(way) = mirrored(first, image, source, receiver, survey.box_m) else { continue };
        let seen = model
            .added_s(&state.arrivals.values, pair)
            .iter()
            .any(|t| baseline.observations.measured[pair].peaks_s.iter().any(|p| (p - t).abs() < NEAR_S));
        if seen {
            for (extent, axis) in reach.iter_mut().zip(axes) {
                let x: f64 = (0..3).map(|k| axis[k] * (way.place_m[k] - middle[k])).sum();
                *extent = [extent[0].min(x), extent[1].max(x)];
            }
        }
    }
    if reach.iter().any(|[low, high]| low > high) {
        return None;
    }
    let at = reach.map(|[low, high]| 0.5 * (low + high));
    let centre = std::array::from_fn(|k| middle[k] + at[0] * axes[0][k] + at[1] * axes[1][k]);
    let half_m = reach.map(|[low, high]| 0.5 * (high - low) + MARGIN_M);
    let absorption = (1.0 - 10f64.powf(values[3] / 10.0)).clamp(0.0, 1.0);
    Some(ThinPanel { corners_m: rectangle(centre, axes, half_m), absorption })
}

/// A hole: a square sheet that swallows all, just before its wall on the side of `inside`.
pub(crate) fn hole(plane: &Plane, inside: [f64; 3], found: &[FoundParameter]) -> Option<ThinPanel> {
    let value = |name: &str| found.iter().find(|p| p.name == name).map(|p| p.value);
    let centre = [value("centre_x")?, value("centre_y")?, value("centre_z")?];
    let normal = plane.axes[0];
    let towards: f64 = (0..3).map(|k| normal[k] * (inside[k] - centre[k])).sum();
    let off = BEFORE_WALL_M * towards.signum();
    let half = 0.5 * value("area")?.max(0.0).sqrt();
    let before = std::array::from_fn(|k| centre[k] + off * normal[k]);
    Some(ThinPanel {
        corners_m: rectangle(before, [plane.axes[1], plane.axes[2]], [half; 2]),
        absorption: 1.0,
    })
}
