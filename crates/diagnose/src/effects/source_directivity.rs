//! `source_directivity`: the source does not radiate alike in all directions.

use crate::{BandView, Case, Effect, Parameter, Survey};

/// A pattern of first order, 1 - d + d cos(angle to the axis), d rising by so much an octave; radiated power as without it.
/// The axis is the room file's, or fitted where it states none. All sources share the pattern.
///
/// Mark: residuals of the direct sound and of early reflections that follow the angle at which they leave the source; later
/// ones vanish. Mimicked by: something in the way, directional receivers. Turning the source tells them apart.
///
/// Source: first-order patterns as in Kuttruff, Room Acoustics, 6th ed., 10.1; that directivity rises with frequency:
/// Beranek and Mellow, Acoustics, 2012, chapter 4.
#[derive(Clone, Copy, Debug, Default)]
pub struct SourceDirectivity;

const MOST: f64 = 0.9;

impl Effect for SourceDirectivity {
    fn id(&self) -> &'static str {
        "source_directivity"
    }

    fn explanation(&self) -> &'static str {
        "The loudspeaker radiates more to the front than to the sides, the more so the higher the frequency."
    }

    fn cases(&self, _: &Survey) -> Vec<Box<dyn Case>> {
        vec![Box::new(*self)]
    }
}

impl SourceDirectivity {
    fn axes_are_stated(survey: &Survey) -> bool {
        survey.sources().iter().all(|s| s.axis.is_some())
    }
}

impl Case for SourceDirectivity {
    fn parameters(&self, survey: &Survey) -> Vec<Parameter> {
        let mut found = vec![
            Parameter::new("directed_share_1_khz", "", 0.0, 0.3, (0.0, MOST)).typically(0.3),
            Parameter::new("directed_share_per_octave", "", 0.0, 0.1, (-0.3, 0.3)).typically(0.05),
        ];
        if !Self::axes_are_stated(survey) {
            for source in survey.sources() {
                for axis in ["x", "y", "z"] {
                    let name = format!("axis_{axis}_{}", source.id);
                    found.push(Parameter::new(name, "", 0.0, 1.0, (-3.0, 3.0)).typically(0.6));
                }
            }
        }
        found
    }

    fn starts(&self, survey: &Survey) -> Vec<Vec<f64>> {
        if Self::axes_are_stated(survey) {
            return vec![vec![0.3, 0.05]];
        }
        let mut starts = Vec::new();
        for k in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut start = vec![0.3, 0.05];
                for _ in survey.sources() {
                    start.extend((0..3).map(|i| if i == k { sign } else { 0.1 }));
                }
                starts.push(start);
            }
        }
        starts
    }

    fn energy(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let survey = view.survey();
        let d = (values[0] + values[1] * survey.octaves_from_1khz(view.band())).clamp(0.0, MOST);
        if d == 0.0 {
            return;
        }
        let source = view.pair().source;
        let axis =
            survey.sources()[source].axis.filter(|_| Self::axes_are_stated(survey)).unwrap_or_else(|| {
                let own = &values[2 + 3 * source..5 + 3 * source];
                let length = own.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-6);
                [own[0] / length, own[1] / length, own[2] / length]
            });
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
