//! Reflections that causes of arrival times bring to peaks of the responses.

use crate::effect::{Effect, Observable};
use crate::effects::{CoordinateShift, RoomDimensions};
use crate::infer::search::{Search, State};
use crate::likelihood::arrivals::at_fit;
use crate::report::diagnosis::MovedReflection;

/// A reflection and a peak so near to each other belong together, in seconds: three deviations with which a reflection is read.
const NEAR_S: f64 = 1.5e-4;
/// Reflections that are told, at most: those that moved farthest.
const MOST_TOLD: usize = 60;

/// Those that come to a peak under the causes, which none does without: what the causes were named for, as far as predicted reflections tell it. The
/// farthest moved come first.
pub(crate) fn moved_reflections(search: &Search<'_>, base: &State, state: &State) -> Vec<MovedReflection> {
    let (baseline, survey) = (search.baseline, search.baseline.survey());
    let data = baseline.arrival_data();
    let cases = search.cases_of(&state.chosen, Observable::Arrivals);
    if cases.is_empty() {
        return Vec::new();
    }
    // Walls and places that move all together are not in the mirrors and offsets of the fit: where paths run between them is not told.
    let moves_all = |&c: &usize| {
        [CoordinateShift.id(), RoomDimensions.id()].iter().any(|id| id == search.candidates[c].id)
    };
    let is_followed = !state.chosen.iter().any(moves_all);
    let (without, with) = (at_fit(&data, &[], &search.used), at_fit(&data, &cases, &search.used));
    let mut found: Vec<MovedReflection> = Vec::new();
    for (pair, arrivals) in baseline.simulation.arrivals.iter().enumerate().filter(|(p, _)| search.used[*p]) {
        let stated_s = without.times_s(&base.arrivals.values, pair);
        let found_s = with.times_s(&state.arrivals.values, pair);
        let (response, measured) = with.compared_with(pair);
        let nearest = |times_s: &[f64], peak_s: f64| {
            let off = |i: &usize| (times_s[*i] - peak_s).abs();
            let first = (1..times_s.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
            first.filter(|i| off(i) < NEAR_S)
        };
        let one = |&peak_s: &f64| {
            let i = nearest(&found_s, peak_s).filter(|_| nearest(&stated_s, peak_s).is_none())?;
            Some(MovedReflection {
                response: survey.responses[response].name.clone(),
                order: arrivals[i].surfaces.len(),
                stops_m: if is_followed {
                    with.stops(&state.arrivals.values, pair, &arrivals[i])
                } else {
                    Vec::new()
                },
                stated_ms: 1e3 * stated_s[i],
                found_ms: 1e3 * found_s[i],
                measured_ms: 1e3 * peak_s,
            })
        };
        found.extend(measured.peaks_s.iter().filter_map(one));
    }
    let by_ms = |one: &MovedReflection| (one.found_ms - one.stated_ms).abs();
    found.sort_by(|a, b| by_ms(b).total_cmp(&by_ms(a)));
    found.truncate(MOST_TOLD);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Effect;
    use crate::effects::SurfaceDisplacement;
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use sabine_scene::{Levels, TimeZero};

    /// What is told in a room whose ceiling stands so much higher than stated, `found` of it (a part of the subject).
    fn told(higher_m: f64, found: &str) -> (Vec<MovedReflection>, Vec<(String, Vec<f64>)>) {
        let stated_m = 2.5;
        let mut tables = Tables::new(Levels::Common, TimeZero::Emission);
        for (pair, arrivals) in tables.arrivals.iter().enumerate() {
            let response = &tables.survey.responses[pair];
            let (from, to) = (
                tables.survey.sources[response.source].position_m,
                tables.survey.receivers[response.receiver].position_m,
            );
            let by_ceiling = arrivals[1..].iter().position(|a| a.surfaces == [1]).expect("a reflection");
            // The image of the source in the ceiling as it is.
            let rise = 2.0 * (stated_m + higher_m) - from[2] - to[2];
            let length_m = (from[0] - to[0]).hypot(from[1] - to[1]).hypot(rise);
            tables.measured[pair].peaks_s[by_ceiling] = length_m / response.air.speed_of_sound_m_s();
        }
        let name = |pair: usize| tables.survey.responses[pair].name.clone();
        let peaks =
            tables.measured.iter().enumerate().map(|(pair, m)| (name(pair), m.peaks_s.clone())).collect();
        let baseline = tables.baseline(DiagnoseConfig::default());
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(SurfaceDisplacement)];
        let all = cases(&effects, baseline.survey());
        let search = Search::new(&baseline, &all, 1, vec![true; 3]);
        let base = search.state(&[], None).expect("a fit");
        let is = |subject: &Option<String>| {
            subject.as_deref().is_some_and(|s| s.starts_with(found) && s.ends_with(')'))
        };
        let chosen: Vec<usize> = all.iter().position(|own| is(&own.case.subject)).into_iter().collect();
        let state = search.state(&chosen, Some(&base)).expect("a fit");
        (moved_reflections(&search, &base, &state), peaks)
    }

    #[test]
    fn reflections_from_a_higher_ceiling_are_told_with_the_way_by_it() {
        let (all, peaks) = told(0.5, "ceiling");
        assert_eq!(all.len(), 3, "{all:?}");
        for one in all {
            let of_response = peaks.iter().find(|(name, _)| *name == one.response).expect("a response");
            let is_peak = of_response.1.iter().any(|p| (1e3 * p - one.measured_ms).abs() < 1e-9);
            assert!(is_peak && one.order == 1, "{one:?}");
            assert!(
                (one.found_ms - one.measured_ms).abs() < 0.15 && one.stated_ms < one.found_ms - 0.3,
                "{one:?}"
            );
            let [_, met, _] = one.stops_m[..] else { panic!("{one:?}") };
            assert!((met[2] - 3.0).abs() < 0.02, "{met:?}");
        }
        // Nothing is told without a cause, nor where the room is as stated.
        assert!(told(0.5, "no surface").0.is_empty());
        assert!(told(0.0, "ceiling").0.is_empty());
    }
}
