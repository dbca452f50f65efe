//! `missing_object`: a box-shaped obstacle that the mesh does not have.

mod search;

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{AddedReflection, Case, Effect, FittedCase, Parameter, ReflectionTerm};
use crate::extend::box_object::{BoxObject, BoxShape};
use crate::extend::model_change::ModelChange;
use crate::likelihood::multilateration::UnassignedPeaks;
use crate::survey::Survey;

/// Furniture: a box that stands on the floor, level, its sides at right angles. Each of its upright faces and its top reflects where both ends
/// lie before it and the place of reflection is within it; what it stands in the way of is not there. Once it is named, the room is traced again with
/// it, so that decays have its shadow and its later reflections, too.
///
/// Mark: in some responses peaks that no predicted reflection explains, each face's in a few of them; predicted reflections that are missing.
/// Where predicted reflections are found, no box can be in their way: that leaves little of a room. Mimicked by: a flat surface
/// (`extra_reflector`), if one face alone is seen; more scattering (`scattering`), which makes reflections weaker.
///
/// The reflectance is that of the peaks' height against the direct sound: of high frequencies, where pulses are short. In the model the object
/// is of the material of the room that reflects most nearly so; sound that bends around it is left out.
///
/// Source: images, J. B. Allen and D. A. Berkley, JASA 65, 1979; J. Borish, JASA 75, 1984 (which are visible); faces from distances as lines are
/// found in pictures: R. O. Duda, P. E. Hart, CACM 15, 1972.
#[derive(Clone, Copy, Debug, Default)]
pub struct MissingObject;

/// Usual side and height, with their spread, and their bounds, in metres.
const SIDE_M: (f64, f64) = (1.1, 0.6);
const HEIGHT_M: (f64, f64) = (0.9, 0.4);
const SIDES_M: (f64, f64) = (0.25, 3.0);
const HEIGHTS_M: (f64, f64) = (0.25, 2.4);
/// Spread of the turn against the axes of the file: furniture mostly stands along walls, and these along the axes. In degrees.
const TURN_SD_DEG: f64 = 20.0;
const MAX_TURN_DEG: f64 = 46.0;
/// Usual reflectance and its spread, in dB.
const REFLECTANCE_DB: (f64, f64) = (-2.0, 2.5);
/// Usual reflectance of a floor at high frequencies, in dB.
const FLOOR_DB: f64 = -2.0;
/// Responses that are needed: seven numbers must be contradicted, too.
const MIN_RESPONSES: usize = 6;

impl Effect for MissingObject {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "missing_object",
            "An object that the model lacks",
            "A piece of furniture stands in the room and is missing from the model: a cupboard, a desk, a sofa.",
        )
        .against(&[
            ("extra_reflector", NextMeasurement::ObjectsRemoved),
            ("scattering", NextMeasurement::ObjectsRemoved),
        ])
        .decided_by(19, NextMeasurement::ObjectsRemoved)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        if survey.responses().len() < MIN_RESPONSES {
            return Vec::new();
        }
        let [low, high] = survey.box_m();
        let place = |(name, k): (&str, usize)| {
            let (middle, half) = (0.5 * (low[k] + high[k]), 0.5 * (high[k] - low[k]));
            // As much spread as places all over the room have.
            Parameter::new(format!("place_{name}"), "m", middle, half / 3f64.sqrt(), (low[k], high[k]))
                .typically(middle)
        };
        let side = |name: &'static str| Parameter::new(name, "m", SIDE_M.0, SIDE_M.1, SIDES_M);
        let tallest = HEIGHTS_M.1.min(high[2] - low[2]);
        let [x, y] = [("x", 0), ("y", 1)].map(place);
        let parameters = vec![
            x,
            y,
            side("length"),
            side("depth"),
            Parameter::new("height", "m", HEIGHT_M.0, HEIGHT_M.1, (HEIGHTS_M.0, tallest)),
            Parameter::new("turn", "deg", 0.0, TURN_SD_DEG, (-MAX_TURN_DEG, MAX_TURN_DEG)),
            Parameter::new("reflectance", "dB", REFLECTANCE_DB.0, REFLECTANCE_DB.1, (-20.0, 3.0)),
        ];
        vec![Case::reflection(parameters, OnFloor { floor_m: low[2] }).changing(changes)]
    }
}

/// An object on the floor of a height in metres.
#[derive(Clone, Copy)]
struct OnFloor {
    floor_m: f64,
}

impl OnFloor {
    fn shape(self, values: &[f64]) -> BoxShape {
        BoxShape::new([values[0], values[1], self.floor_m], [values[2], values[3], values[4]], values[5])
    }
}

impl ReflectionTerm for OnFloor {
    fn starts(&self, peaks: &UnassignedPeaks<'_>) -> Vec<Vec<f64>> {
        let found = search::starts(peaks, self.floor_m);
        found.into_iter().map(|box_values| [&box_values[..], &[REFLECTANCE_DB.0]].concat()).collect()
    }

    fn ways(&self) -> usize {
        BoxShape::WAYS
    }

    fn reflection(
        &self,
        values: &[f64],
        survey: &Survey,
        response: usize,
        way: usize,
    ) -> Option<AddedReflection> {
        let pair = &survey.responses()[response];
        let source = survey.sources()[pair.source].position_m;
        let receiver = survey.receivers()[pair.receiver].position_m;
        let found = self.shape(values).reflection(way, source, receiver)?;
        let direct_m = (0..3).map(|k| (source[k] - receiver[k]).powi(2)).sum::<f64>().sqrt();
        let floor_db = if way < BoxShape::OVER_FLOOR { 0.0 } else { FLOOR_DB };
        Some(AddedReflection {
            length_m: found.length_m,
            departure: found.departure,
            arrival: found.arrival,
            level_db: values[6] + floor_db + 20.0 * (direct_m / found.length_m).log10(),
        })
    }

    fn hides(&self, values: &[f64], stops: &[[f64; 3]]) -> bool {
        self.shape(values).blocks(stops)
    }
}

fn changes(fitted: &FittedCase<'_>) -> Vec<ModelChange> {
    let (values, survey) = (fitted.values(), fitted.survey());
    let foot_m = [values[0], values[1], survey.box_m()[0][2]];
    let absorption = 1.0 - 10f64.powf(values[6] / 10.0).min(1.0);
    // Peaks are of high frequencies: the upper half of the bands.
    let of = |material: usize| {
        let all = fitted.materials().get(material).map_or(&[][..], |m| m.absorption().values());
        let upper = &all[all.len() / 2..];
        (upper.iter().sum::<f64>() / upper.len().max(1) as f64 - absorption).abs()
    };
    let nearest = (0..survey.materials().len()).min_by(|&a, &b| of(a).total_cmp(&of(b)));
    let object = |m: usize| {
        let size_m = [values[2], values[3], values[4]];
        ModelChange::Object(BoxObject::new(foot_m, size_m, values[5], survey.materials()[m].clone()))
    };
    nearest.map(object).into_iter().collect()
}
