//! A law of delay as a cause.

use super::added_law::of_survey;
use super::free_parameters::FittedLaw;
use crate::effect::ArrivalTerm;
use crate::simulate::views::ArrivalView;
use sabine_paths::laws::LawVariable;

/// Variables that the arrivals which are compared do not tell: some cannot be followed from surface to surface.
pub(super) fn is_untold(name: &str) -> bool {
    name == "reflections" || name.starts_with("hits(")
}

/// Arrivals that come later by a formula.
#[derive(Clone, Debug)]
pub(super) struct DelayLaw(pub FittedLaw);

impl ArrivalTerm for DelayLaw {
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64 {
        let (survey, pair) = (arrival.survey(), arrival.pair());
        let azimuth = |v: [f64; 3]| v[1].atan2(v[0]).to_degrees();
        let elevation = |v: [f64; 3]| v[2].clamp(-1.0, 1.0).asin().to_degrees();
        let along = |v: [f64; 3], axis: [f64; 3]| v.iter().zip(axis).map(|(a, b)| a * b).sum::<f64>();
        let variable = |name: &str| {
            let found = match name {
                "length_m" => Some(arrival.length_m()),
                "time_s" => Some(arrival.time_s()),
                // What is compared is specular.
                "scatterings" => Some(0.0),
                "departure_azimuth_deg" => Some(azimuth(arrival.departure())),
                "departure_elevation_deg" => Some(elevation(arrival.departure())),
                "arrival_azimuth_deg" => Some(azimuth(arrival.arrival())),
                "arrival_elevation_deg" => Some(elevation(arrival.arrival())),
                "departure_cos" => survey.sources()[pair.source].axis.map(|a| along(arrival.departure(), a)),
                "arrival_cos" => survey.receivers()[pair.receiver].axis.map(|a| along(arrival.arrival(), a)),
                "recording_order" => pair.recorded_at,
                other => of_survey(survey, (pair.source, pair.receiver), other),
            };
            found.map(LawVariable::Same)
        };
        let found = self.0.law.values(&self.0.values(values), 1, variable);
        // Laws of delay give milliseconds.
        found.ok().and_then(|ms| ms.first().copied()).filter(|ms| ms.is_finite()).map_or(0.0, |ms| 1e-3 * ms)
    }
}
