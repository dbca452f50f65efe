//! `source_directivity`: the source does not radiate alike in all directions.

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, FittedCase, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::views::BandView;
use crate::survey::{Place, Survey};

/// A pattern of first order, 1 - d + d cos(angle to the axis), d rising by so much an octave; radiated power as without it.
/// The axis is the room file's; where it states none, azimuth (from x towards y) and elevation are fitted, all directions being as
/// likely beforehand. All sources share the pattern.
///
/// Mark: residuals of the direct sound and of early reflections that follow the angle at which they leave the source; later
/// ones vanish. Mimicked by: something in the way, directional receivers. Turning the source tells them apart.
///
/// Source: first-order patterns as in Kuttruff, Room Acoustics, 6th ed., 10.1; that directivity rises with frequency:
/// Beranek and Mellow, Acoustics, 2012, chapter 4.
#[derive(Clone, Copy, Debug, Default)]
pub struct SourceDirectivity;

const MAX_SHARE: f64 = 0.9;
/// Standard deviations of the angles of a direction that may be any, in degrees: 180 / sqrt 3, and sqrt(pi^2 / 4 - 2) radians.
const AZIMUTH_SD_DEG: f64 = 103.9;
const ELEVATION_SD_DEG: f64 = 39.2;
/// Directions that a fit starts from: azimuth and elevation in degrees. At the poles the azimuth would mean nothing.
const STARTS_DEG: [[f64; 2]; 6] =
    [[0.0, 0.0], [90.0, 0.0], [180.0, 0.0], [-90.0, 0.0], [0.0, 70.0], [0.0, -70.0]];

impl Effect for SourceDirectivity {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "source_directivity",
            "Directional loudspeaker",
            "The loudspeaker radiates more to the front than to the sides, increasingly so at high frequencies.",
        )
        .decided_by(3, NextMeasurement::TurnedSource)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        let case = Case::decay(Self::parameters(survey), *self).starting(Self::starts(survey));
        vec![case.changing(Self::changes)]
    }
}

impl SourceDirectivity {
    fn axes_are_stated(survey: &Survey) -> bool {
        survey.sources().iter().all(|s| s.axis.is_some())
    }

    /// The axis of a source, a unit vector.
    fn axis(values: &[f64], survey: &Survey, source: usize) -> [f64; 3] {
        if let Some(axis) = survey.sources()[source].axis.filter(|_| Self::axes_are_stated(survey)) {
            return axis;
        }
        let [azimuth, elevation] = [values[2 + 2 * source], values[3 + 2 * source]].map(f64::to_radians);
        [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()]
    }

    fn parameters(survey: &Survey) -> Vec<Parameter> {
        let mut found = vec![
            Parameter::new("directed_share_1_khz", "", 0.0, 0.3, (0.0, MAX_SHARE)).typically(0.3),
            Parameter::new("directed_share_per_octave", "", 0.0, 0.1, (-0.3, 0.3)).typically(0.05),
        ];
        if !Self::axes_are_stated(survey) {
            for source in survey.sources() {
                let (azimuth, elevation) =
                    (format!("axis_azimuth_{}", source.id), format!("axis_elevation_{}", source.id));
                found.push(
                    Parameter::new(azimuth, "deg", 0.0, AZIMUTH_SD_DEG, (-360.0, 360.0)).typically(45.0),
                );
                found.push(Parameter::new(elevation, "deg", 0.0, ELEVATION_SD_DEG, (-90.0, 90.0)));
            }
        }
        found
    }

    fn starts(survey: &Survey) -> Vec<Vec<f64>> {
        if Self::axes_are_stated(survey) {
            return vec![vec![0.3, 0.05]];
        }
        let one = |direction: [f64; 2]| {
            let axes = survey.sources().iter().flat_map(|_| direction);
            [0.3, 0.05].into_iter().chain(axes).collect()
        };
        STARTS_DEG.into_iter().map(one).collect()
    }

    fn changes(fitted: &FittedCase<'_>) -> Vec<ModelChange> {
        let (values, survey) = (fitted.values(), fitted.survey());
        let share = |b: usize| (values[0] + values[1] * survey.octaves_from_1khz(b)).clamp(0.0, MAX_SHARE);
        let axis = |(i, source): (usize, &Place)| (source.id.clone(), Self::axis(values, survey, i));
        vec![ModelChange::SourcePattern {
            directed_share: fitted.per_band(share),
            axis: survey.sources().iter().enumerate().map(axis).collect(),
        }]
    }
}

impl DecayTerm for SourceDirectivity {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let survey = view.survey();
        let d = (values[0] + values[1] * survey.octaves_from_1khz(view.band())).clamp(0.0, MAX_SHARE);
        if d == 0.0 {
            return;
        }
        let axis = Self::axis(values, survey, view.pair().source);
        let q = 1.0 - d;
        let power = q * q + d * d / 3.0;
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            let (mean, products) = view.departures(bin);
            let along: f64 = mean.iter().zip(axis).map(|(m, a)| m * a).sum();
            let [x, y, z] = axis;
            let [xx, yy, zz, xy, xz, yz] = products;
            let squared = x * x * xx + y * y * yy + z * z * zz + 2.0 * (x * y * xy + x * z * xz + y * z * yz);
            let gain = (q * q + 2.0 * q * d * along + d * d * squared) / power;
            *l += gain.max(1e-4).ln();
        }
    }
}
