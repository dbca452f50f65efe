//! `extra_reflector`: a flat surface that the mesh does not have.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{AddedReflection, Case, Effect, FittedCase, Parameter, ReflectionTerm};
use crate::extend::applied_changes::ThinPanel;
use crate::extend::model_change::ModelChange;
use crate::likelihood::multilateration::{UnassignedPeaks, mirrored, panel_axes};
use crate::survey::Survey;

/// One plane more: a table, a screen, a cabinet. It is found by where it mirrors the first source (the image of any other source follows).
/// It reflects for those pairs whose angles are equal at a place within the room; that it does so for all of them is not required,
/// for it has edges.
///
/// Mark: in many responses, a peak that no predicted reflection explains; their distances meet in one image, and their levels agree.
/// Mimicked by: a wall that stands elsewhere (`room_dimensions`), which takes its predicted reflection away.
///
/// The reflectance is that of the peaks' height against the direct sound: of high frequencies, where pulses are short.
///
/// Source: I. Dokmanić, R. Parhizkar, A. Walther, Y. M. Lu, M. Vetterli, Acoustic echoes reveal room shape, PNAS 110, 2013 (images from
/// distances); M. A. Fischler, R. C. Bolles, Random sample consensus, CACM 24, 1981.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExtraReflector;

/// Standard deviation of an image's distance from the source along each axis, in metres.
const IMAGE_SD_M: f64 = 2.0;
/// Farthest image along an axis, in metres.
const FARTHEST_M: f64 = 20.0;
/// The panel reaches beyond the outermost places where it was seen to reflect, in metres.
const MARGIN_M: f64 = 0.25;
/// Usual reflectance and its spread, in dB.
const REFLECTANCE_DB: (f64, f64) = (-3.0, 3.0);

impl Effect for ExtraReflector {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "extra_reflector",
            "A reflecting surface that the model lacks",
            "A flat surface in the room is missing from the model: a table, a screen, a cabinet.",
        )
        .decided_by(12, NextMeasurement::ObjectsRemoved)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        // Three distances leave two places, a fourth decides, and fewer than five cannot contradict.
        if survey.responses().len() < 5 {
            return Vec::new();
        }
        let source = first_m(survey);
        let axis = |(name, at): (&str, f64)| {
            let bounds = (at - FARTHEST_M, at + FARTHEST_M);
            Parameter::new(format!("image_{name}"), "m", at, IMAGE_SD_M, bounds).typically(at + 1.0)
        };
        let level = Parameter::new("reflectance", "dB", REFLECTANCE_DB.0, REFLECTANCE_DB.1, (-30.0, 6.0));
        let parameters = ["x", "y", "z"].into_iter().zip(source).map(axis).chain([level]).collect();
        let changes = |fitted: &FittedCase<'_>| panel(fitted).map(ModelChange::Panel).into_iter().collect();
        vec![Case::reflection(parameters, *self).changing(changes)]
    }
}

/// The source whose image is sought.
fn first_m(survey: &Survey) -> [f64; 3] {
    survey.responses().first().map_or([0.0; 3], |r| survey.sources()[r.source].position_m)
}

impl ReflectionTerm for ExtraReflector {
    fn starts(&self, peaks: &UnassignedPeaks<'_>) -> Vec<Vec<f64>> {
        peaks.images().into_iter().map(|[x, y, z]| vec![x, y, z, REFLECTANCE_DB.0]).collect()
    }

    fn reflection(
        &self,
        values: &[f64],
        survey: &Survey,
        response: usize,
        _way: usize,
    ) -> Option<AddedReflection> {
        let pair = &survey.responses()[response];
        let source = survey.sources()[pair.source].position_m;
        let receiver = survey.receivers()[pair.receiver].position_m;
        let image = [values[0], values[1], values[2]];
        let way = mirrored(first_m(survey), image, source, receiver, survey.box_m())?;
        let direct_m = (0..3).map(|k| (source[k] - receiver[k]).powi(2)).sum::<f64>().sqrt();
        Some(AddedReflection {
            length_m: way.length_m,
            departure: way.departure,
            arrival: way.arrival,
            level_db: values[3] + 20.0 * (direct_m / way.length_m).log10(),
        })
    }
}

/// The panel spans the places at which it was seen to reflect, and a little more.
fn panel(fitted: &FittedCase<'_>) -> Option<ThinPanel> {
    let (survey, values) = (fitted.survey(), fitted.values());
    let first = first_m(survey);
    let image = [values[0], values[1], values[2]];
    let axes = panel_axes(first, image);
    let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (first[k] + image[k]));
    let mut reach = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for response in fitted.confirmed_responses().iter().map(|&r| &survey.responses()[r]) {
        let source = survey.sources()[response.source].position_m;
        let receiver = survey.receivers()[response.receiver].position_m;
        let Some(way) = mirrored(first, image, source, receiver, survey.box_m()) else { continue };
        for (extent, axis) in reach.iter_mut().zip(axes) {
            let x: f64 = (0..3).map(|k| axis[k] * (way.place_m[k] - middle[k])).sum();
            *extent = [extent[0].min(x), extent[1].max(x)];
        }
    }
    if reach.iter().any(|[low, high]| low > high) {
        return None;
    }
    let at = reach.map(|[low, high]| 0.5 * (low + high));
    let centre = std::array::from_fn(|k| middle[k] + at[0] * axes[0][k] + at[1] * axes[1][k]);
    let half_m = reach.map(|[low, high]| 0.5 * (high - low) + MARGIN_M);
    let absorption = (1.0 - 10f64.powf(values[3] / 10.0)).clamp(0.0, 1.0);
    Some(ThinPanel::rectangle(centre, axes, half_m, absorption))
}
