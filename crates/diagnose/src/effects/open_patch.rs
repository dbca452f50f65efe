//! `open_patch`: a wall has a hole.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::reflection_gate::ReflectionGate;
use crate::effect::{AuxiliaryEvidence, Case, DecayTerm, Effect, FittedCase, Parameter, ReflectionEvidence};
use crate::extend::applied_changes::ThinPanel;
use crate::extend::model_change::ModelChange;
use crate::found_parameter::FoundParameter;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use crate::survey::planes::Plane;

/// A rectangle of one surface absorbs all sound: an open door or window, a duct, a curtain before a recess. One case for each flat
/// surface of the mesh.
///
/// Decays give the area (each meeting with the material survives with one less the share of its area); single first-order reflections
/// say where it is: those whose mirror points lie in the patch are missing. The two are combined: what decays say of the area is
/// the prior under which places and sizes are summed over.
///
/// Mark: the reflections of some pairs at one wall are missing, those of others are not. Mimicked by: the absorption of that wall
/// (`surface_absorption`), which weakens all of its reflections alike; a source that hardly radiates towards the wall.
///
/// Source: the image of a source in a finite surface is seen only where the line to it crosses the surface (Allen and Berkley 1979; Borish 1984);
/// edges are not sharp but blurred over some 0.15 m, half a Fresnel zone at 4 kHz.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenPatch;

/// Usual area in square metres: one standard deviation.
const AREA_SD_M2: f64 = 2.0;
/// Share of a surface that may be open at most.
const MAX_SHARE: f64 = 0.7;
/// The panel that stands for a hole lies so far before its wall, in metres.
const BEFORE_WALL_M: f64 = 5e-3;
/// Half the blur of an edge in metres.
const EDGE_M: f64 = 0.15;
/// Steps of the centre along each side of the surface.
const STEPS: usize = 24;
/// Sides of the patch relative to that of a square, and areas that are tried in square metres.
const ASPECTS: [f64; 3] = [0.75, 1.0, 1.33];
const AREAS_M2: [f64; 12] = [0.3, 0.5, 0.75, 1.0, 1.4, 1.8, 2.3, 2.9, 3.6, 4.4, 5.4, 6.6];
/// Mass of the 90 % interval to either side.
const TAIL: f64 = 0.05;

impl Effect for OpenPatch {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "open_patch",
            "An opening in a wall",
            "Part of a wall is open (a door, a window, a niche): sound that meets it does not return.",
        )
        .decided_by(11, NextMeasurement::PatchClosed)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let one = |(index, plane): (usize, &Plane)| OneWall { index, plane: plane.clone() }.case();
        survey.planes().iter().enumerate().map(one).collect()
    }
}

#[derive(Clone)]
struct OneWall {
    index: usize,
    plane: Plane,
}

impl OneWall {
    fn case(self) -> Case {
        let plane = &self.plane;
        let [x, y, z] = plane.place_m(plane.extent_m.map(|[low, high]| 0.5 * (low + high)));
        let most = MAX_SHARE * plane.area_m2;
        let area = Parameter::new("area", "m2", 0.0, AREA_SD_M2, (0.0, most)).typically(1.5f64.min(most));
        let starts = vec![vec![0.5], vec![2.0f64.min(0.5 * plane.area_m2)]];
        let wall = self.clone();
        let changes = move |fitted: &FittedCase<'_>| {
            let survey = fitted.survey();
            let inside = survey.responses().first().map(|r| survey.sources()[r.source].position_m);
            inside.and_then(|inside| wall.hole(inside, fitted)).map(ModelChange::Panel).into_iter().collect()
        };
        Case::decay(vec![area], self)
            .about(format!("surface about {x:.1}, {y:.1}, {z:.1} m"))
            .starting(starts)
            .changing(changes)
    }

    /// The hole: a square panel that absorbs everything, just before its wall on the side of `inside`.
    fn hole(&self, inside: [f64; 3], fitted: &FittedCase<'_>) -> Option<ThinPanel> {
        let centre = [fitted.found("centre_x")?, fitted.found("centre_y")?, fitted.found("centre_z")?];
        let [normal, along, across] = self.plane.axes;
        let towards: f64 = (0..3).map(|k| normal[k] * (inside[k] - centre[k])).sum();
        let off = BEFORE_WALL_M * towards.signum();
        let half = 0.5 * fitted.found("area")?.max(0.0).sqrt();
        let before = std::array::from_fn(|k| centre[k] + off * normal[k]);
        Some(ThinPanel::rectangle(before, [along, across], [half; 2], 1.0))
    }
}

impl DecayTerm for OneWall {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let open = (values[0] / view.survey().material_area_m2(self.plane.material)).min(0.95);
        if open <= 0.0 {
            return;
        }
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += view.reflection_reweighting(bin, self.plane.material, (1.0 - open).ln());
        }
    }

    fn reflection_evidence(&self) -> Option<&dyn ReflectionEvidence> {
        Some(self)
    }
}

impl ReflectionEvidence for OneWall {
    fn weigh(&self, own: &[(f64, f64)], gates: &[ReflectionGate]) -> Option<AuxiliaryEvidence> {
        let here: Vec<([f64; 2], f64, f64)> = gates
            .iter()
            .filter(|g| g.plane == self.index)
            .map(|g| (self.plane.within(g.place_m), g.present_nats, g.missing_nats))
            .collect();
        let (area, sd) = *own.first()?;
        let base: f64 = here.iter().map(|g| g.1).sum();
        let mut all: Vec<Hypothesis> = Vec::new();
        let mut prior_sum = 0.0;
        for (i, &tried) in AREAS_M2.iter().enumerate() {
            if tried > MAX_SHARE * self.plane.area_m2 {
                break;
            }
            let low = if i == 0 { 0.0 } else { AREAS_M2[i - 1] };
            let prior = (-0.5 * ((tried - area) / sd.max(0.05)).powi(2)).exp() * (tried - low);
            let mut fitting: Vec<Hypothesis> = Vec::new();
            for aspect in ASPECTS {
                let sides = [tried.sqrt() * aspect, tried.sqrt() / aspect];
                let fits =
                    self.plane.extent_m.iter().zip(sides).all(|([low, high], side)| side <= high - low);
                if !fits {
                    continue;
                }
                let step_m = [0, 1].map(|k| {
                    let [low, high] = self.plane.extent_m[k];
                    (high - low - sides[k]) / STEPS as f64
                });
                for step in 0..STEPS * STEPS {
                    let place = [step / STEPS, step % STEPS].map(|n| n as f64 + 0.5);
                    let centre =
                        [0, 1].map(|k| self.plane.extent_m[k][0] + 0.5 * sides[k] + place[k] * step_m[k]);
                    let ln_weight: f64 = here
                        .iter()
                        .map(|(place, present, missing)| {
                            let inside = within(*place, centre, sides);
                            mixed(*present, *missing, inside) - present
                        })
                        .sum();
                    fitting.push(Hypothesis { ln_weight, centre, step_m, area: i });
                }
            }
            if !fitting.is_empty() {
                prior_sum += prior;
                let each = (prior / fitting.len() as f64).max(1e-300).ln();
                fitting.iter_mut().for_each(|h| h.ln_weight += each);
                all.append(&mut fitting);
            }
        }
        let most = all.iter().map(|h| h.ln_weight).fold(f64::NEG_INFINITY, f64::max);
        if !most.is_finite() || prior_sum <= 0.0 || !base.is_finite() {
            return None;
        }
        let sum: f64 = all.iter().map(|h| (h.ln_weight - most).exp()).sum();
        let nats = most + sum.ln() - prior_sum.ln();
        let weights: Vec<f64> = all.iter().map(|h| (h.ln_weight - most).exp() / sum).collect();
        let areas = all.iter().map(|h| Cell::of_area(h.area));
        let mut parameters = vec![interval("area", "m2", areas.zip(&weights))];
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            let along = |h: &Hypothesis| {
                let half = (0..2).map(|i| 0.5 * h.step_m[i] * self.plane.axes[i + 1][k].abs()).sum::<f64>();
                let value = self.plane.place_m(h.centre)[k];
                Cell { value, low: value - half, high: value + half }
            };
            parameters.push(interval(&format!("centre_{axis}"), "m", all.iter().map(along).zip(&weights)));
        }
        Some(AuxiliaryEvidence { nats, parameters })
    }
}

/// A patch that is tried.
struct Hypothesis {
    ln_weight: f64,
    centre: [f64; 2],
    /// From its centre to its neighbours'.
    step_m: [f64; 2],
    /// Which of [`AREAS_M2`].
    area: usize,
}

/// A value that is tried, and all those for which it stands.
struct Cell {
    value: f64,
    low: f64,
    high: f64,
}

impl Cell {
    fn of_area(index: usize) -> Self {
        let value = AREAS_M2[index];
        let before = if index == 0 { 0.5 * value } else { AREAS_M2[index - 1] };
        let after = AREAS_M2.get(index + 1).copied().unwrap_or(value * value / before);
        Self { value, low: (before * value).sqrt(), high: (value * after).sqrt() }
    }
}

/// Mean and 90 % interval of weighted cells: no end is known more closely than the grid.
fn interval<'w>(name: &str, unit: &str, weighted: impl Iterator<Item = (Cell, &'w f64)>) -> FoundParameter {
    let mut sorted: Vec<(Cell, f64)> = weighted.map(|(cell, weight)| (cell, *weight)).collect();
    sorted.sort_by(|a, b| a.0.value.total_cmp(&b.0.value));
    let at = |mass: f64| {
        let mut left = mass;
        let place = sorted.iter().position(|(_, weight)| {
            left -= weight;
            left <= 0.0
        });
        &sorted[place.unwrap_or(sorted.len() - 1)].0
    };
    // The mean of a skewed distribution may lie beyond either end.
    let mean: f64 = sorted.iter().map(|(cell, weight)| cell.value * weight).sum();
    FoundParameter {
        name: name.to_owned(),
        value: mean,
        low: at(TAIL).low.min(mean),
        high: at(1.0 - TAIL).high.max(mean),
        unit: unit.to_owned(),
    }
}

/// How much of a reflection at a place a patch takes.
fn within(place: [f64; 2], centre: [f64; 2], sides: [f64; 2]) -> f64 {
    (0..2)
        .map(|k| {
            let inside = 0.5 * sides[k] - (place[k] - centre[k]).abs();
            (0.5 + 0.5 * inside / EDGE_M).clamp(0.0, 1.0)
        })
        .product()
}

/// Log-probability where it is missing with this probability.
fn mixed(present: f64, missing: f64, inside: f64) -> f64 {
    if inside <= 0.0 {
        present
    } else if inside >= 1.0 {
        missing
    } else {
        crate::statistics::add(present + (1.0 - inside).ln(), missing + inside.ln())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::survey::planes::planes;
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::Scene;

    fn wall() -> OneWall {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let scene = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| hard.clone())).unwrap();
        OneWall { index: 0, plane: planes(&scene).0[0].clone() }
    }

    fn gate(wall: &OneWall, u: f64, v: f64, missing: bool) -> ReflectionGate {
        let [low_u, low_v] = [wall.plane.extent_m[0][0], wall.plane.extent_m[1][0]];
        let (present_nats, missing_nats) = if missing { (-6.0, 0.0) } else { (0.0, -6.0) };
        ReflectionGate {
            response: 0,
            place_m: wall.plane.place_m([low_u + u, low_v + v]),
            plane: 0,
            present_nats,
            missing_nats,
        }
    }

    #[test]
    fn missing_neighbours_are_a_hole_and_scattered_ones_are_not() {
        let wall = wall();
        let own = [(2.0, 1.5)];
        let near = [(1.0, 1.0), (1.4, 1.5), (1.6, 0.9)];
        let far = [(2.8, 3.0), (1.2, 3.6), (2.8, 0.4), (2.9, 2.1)];
        let hole: Vec<ReflectionGate> = near
            .iter()
            .map(|g| gate(&wall, g.0, g.1, true))
            .chain(far.iter().map(|g| gate(&wall, g.0, g.1, false)))
            .collect();
        let found = wall.weigh(&own, &hole).unwrap();
        assert!(found.nats > 10.0, "{}", found.nats);
        let centre: Vec<f64> = found.parameters[1..].iter().map(|p| p.value).collect();
        let [u, v] = wall.plane.within([centre[0], centre[1], centre[2]]);
        assert!(
            (u - wall.plane.extent_m[0][0] - 1.3).abs() < 0.4
                && (v - wall.plane.extent_m[1][0] - 1.1).abs() < 0.4
        );

        // As many are missing, but others between them are there.
        let odd: Vec<ReflectionGate> = [(0.4, 0.4, true), (2.8, 3.6, true), (0.5, 3.5, true)]
            .into_iter()
            .chain([(0.5, 0.9, false), (1.5, 2.0, false), (2.6, 3.2, false), (0.8, 3.2, false)])
            .map(|(u, v, missing)| gate(&wall, u, v, missing))
            .collect();
        assert!(wall.weigh(&own, &odd).unwrap().nats < 4.0);
        let none: Vec<ReflectionGate> =
            near.iter().chain(&far).map(|g| gate(&wall, g.0, g.1, false)).collect();
        assert!(wall.weigh(&own, &none).unwrap().nats < 0.0);
    }
}
