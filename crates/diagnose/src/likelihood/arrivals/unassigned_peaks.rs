//! Reflections that the mesh does not have: what effects add, where peaks point, and the fit from there.

use super::edges;
use super::places::longer_m;
use super::{
    ADDED_HEIGHT_SD_DB, ArrivalData, ArrivalModel, At, REFLECTION_SD_S, SEEN_SHARE, WIDTHS_S, at_fit, normal,
    stops_of_all,
};
use crate::effect::{Case, FittedCase, Nuisance, ReflectionTerm};
use crate::error::Error;
use crate::extend::model_change::ModelChange;
use crate::likelihood::laplace::{LaplaceFit, maximise};
use crate::likelihood::multilateration::{PredictedPath, UnassignedPeak, UnassignedPeaks};
use crate::likelihood::parameters::ModelTerm;
use crate::simulate::traced_pair::{Arrival, IsolatedReflection};
use crate::simulate::views::ArrivalView;
use crate::survey::Survey;
use crate::survey::planes::apart_m;

/// Of the peaks that hidden reflections would have been so many are missing because of that: others lie beside a louder one.
const MISSING_SHARE: f64 = 0.5;
/// What it costs at most that a peak has lost its origin, and what it costs that the direct sound has, in nats.
const LOST_NATS: f64 = 6.0;
const LOST_DIRECT_NATS: f64 = 20.0;
/// Images nearer to each other than this are one, in metres.
const SAME_M: f64 = 0.3;

/// A reflection that an effect adds, and, where slopes are wanted, how its time and its height change with parameters.
pub(super) struct AddedArrival {
    pub time_s: f64,
    pub slopes: Vec<(usize, f64)>,
    pub level_db: f64,
    pub level_slopes: Vec<(usize, f64)>,
}

impl AddedArrival {
    /// How probable it is as the origin of a peak, for each second and dB.
    pub(super) fn density(&self, peak_s: f64, height_db: f64, sd_s: f64) -> f64 {
        SEEN_SHARE
            * normal(peak_s - self.time_s, sd_s)
            * normal(height_db - self.level_db, ADDED_HEIGHT_SD_DB)
    }
}

impl<'a> ArrivalModel<'a> {
    /// Reflections that effects add to a pair.
    pub(super) fn added(&self, at: &At<'_>, pair: usize) -> Vec<AddedArrival> {
        let values = at.values;
        let one = |(placed, way): (&ModelTerm<'_>, usize)| {
            let (term, survey) = (placed.case.reflection_term()?, self.data.survey);
            let range = placed.range();
            let added = term.reflection(&values[range.clone()], survey, pair, way)?;
            // What comes from where a predicted reflection comes from is that one: a wall must not be found a second time.
            let image = |direction: [f64; 3], length_m: f64| direction.map(|d| d * length_m);
            let own = image(added.arrival, added.length_m);
            if self.data.arrivals[pair].iter().any(|a| apart_m(own, image(a.arrival, a.length_m)) < SAME_M) {
                return None;
            }
            let arrival = Arrival {
                length_m: added.length_m,
                departure: added.departure,
                arrival: added.arrival,
                energy: 0.0,
                surfaces: Vec::new(),
            };
            let time_s = self.time_s(at, pair, &arrival);
            if !at.is_sloping {
                return Some(AddedArrival {
                    time_s,
                    slopes: Vec::new(),
                    level_db: added.level_db,
                    level_slopes: Vec::new(),
                });
            }
            let mut slopes = self.time_slopes(at, pair, &arrival);
            let mut level_slopes = Vec::new();
            for index in range.clone() {
                let step = self.step(index);
                let moved = |offset: f64| {
                    let mut own = values[range.clone()].to_vec();
                    own[index - range.start] += offset;
                    term.reflection(&own, survey, pair, way)
                };
                if let (Some(up), Some(down)) = (moved(step), moved(-step)) {
                    slopes.push((
                        index,
                        (up.length_m - down.length_m) / (2.0 * step) / self.data.speed_m_s[pair],
                    ));
                    level_slopes.push((index, (up.level_db - down.level_db) / (2.0 * step)));
                }
            }
            Some(AddedArrival { time_s, slopes, level_db: added.level_db, level_slopes })
        };
        let ways = |placed| std::iter::repeat(placed).zip(0..ways_of(placed));
        self.terms.iter().flat_map(ways).filter_map(one).collect()
    }

    /// What it is worth in nats that a predicted reflection (its place after the direct sound) is hidden, its peaks apart.
    pub(super) fn worth_of_hiding(&self, pair: usize, reflection: usize) -> f64 {
        MISSING_SHARE * self.origins[pair].found(reflection)
    }

    /// Which of a pair's predicted arrivals an effect hides, the direct sound among them.
    pub(super) fn hidden(&self, values: &[f64], pair: usize) -> Vec<bool> {
        let terms: Vec<_> =
            self.terms.iter().filter_map(|p| Some((p.case.reflection_term()?, p.own(values)))).collect();
        let is_hidden = |stops: &Vec<[f64; 3]>| terms.iter().any(|(term, own)| term.hides(own, stops));
        self.stops[pair].iter().map(is_hidden).collect()
    }

    /// When reflections that effects add come, in seconds of the file.
    pub fn added_s(&self, values: &[f64], pair: usize) -> Vec<f64> {
        self.added(&self.at(values, false), pair).iter().map(|m| m.time_s).collect()
    }

    /// Peaks with the length of their way and the probability that nothing predicted explains them.
    fn strays(&self, values: &[f64]) -> UnassignedPeaks<'a> {
        let at = self.at(values, false);
        let stops = stops_of_all(self.data);
        let mut paths = Vec::new();
        let peaks = (0..self.assignment.len())
            .map(|pair| {
                let Some((direct, later)) = self.data.arrivals[pair].split_first() else { return Vec::new() };
                if !self.used[pair] {
                    return Vec::new();
                }
                let origins = &self.origins[pair];
                let times: Vec<f64> = later.iter().map(|a| self.time_s(&at, pair, a)).collect();
                let direct_s = self.time_s(&at, pair, direct);
                let measured = &self.data.measured[self.assignment[pair]];
                let mut lost_nats = vec![0.0; later.len()];
                let one = |(peak, height_db): (&f64, &f64)| {
                    let predicted: Vec<f64> = times
                        .iter()
                        .enumerate()
                        .map(|(i, t)| origins.predicted(i, *height_db) * normal(peak - t, REFLECTION_SD_S))
                        .collect();
                    let stray = origins.stray(peak - measured.direct_s, *height_db);
                    let all = stray + predicted.iter().sum::<f64>();
                    for (lost, own) in lost_nats.iter_mut().zip(predicted) {
                        *lost += (all / (all - own)).ln().min(LOST_NATS);
                    }
                    UnassignedPeak {
                        length_m: direct.length_m + (peak - direct_s) * self.data.speed_m_s[pair],
                        stray: stray / all,
                    }
                };
                let peaks = measured.peaks_s.iter().zip(&measured.peaks_db).map(one).collect();
                let costs =
                    lost_nats.iter().enumerate().map(|(i, lost)| lost - self.worth_of_hiding(pair, i));
                let costs = std::iter::once(LOST_DIRECT_NATS).chain(costs);
                paths.extend(stops[pair].iter().zip(costs).filter(|(stops, _)| !stops.is_empty()).map(
                    |(stops, hidden_nats)| PredictedPath { stops: stops.clone(), hidden_nats: -hidden_nats },
                ));
                peaks
            })
            .collect();
        UnassignedPeaks { survey: self.data.survey, peaks, paths }
    }

    /// How much later than its way says a path comes under fitted values, in seconds, latency left out. Places and temperatures
    /// that were found are in the ways already: what is fitted for them does not count again.
    pub fn later_s(&self, values: &[f64], pair: usize, single: &IsolatedReflection) -> f64 {
        let response = &self.data.survey.responses[pair];
        let speed_m_s = self.data.speed_m_s[pair];
        let view = ArrivalView {
            survey: self.data.survey,
            pair,
            length_m: single.length_m,
            speed_m_s,
            departure: single.departure,
            arrival: single.arrival,
            surfaces: &single.surfaces,
        };
        let moved: Vec<Nuisance> =
            self.terms.iter().flat_map(|p| &p.case.relaxes).map(|(nuisance, _)| *nuisance).collect();
        // Surfaces that stand elsewhere are in the ways as far as these were traced anew.
        let displaced = self.displaced(values, None);
        let mut later_s =
            view.delay_by_displaced_s(&displaced) - view.delay_by_displaced_s(self.data.displaced);
        for placed in &self.terms {
            let own = placed.own(values);
            let term = placed.case.arrival_term().filter(|term| term.displaces(own).is_none());
            if let Some(term) = term.filter(|_| !is_in_the_ways(placed.case, own, self.data.survey)) {
                later_s += term.delay_s(own, &view);
            }
        }
        for (place, first, direction) in [
            (
                Nuisance::SourcePosition(response.source),
                self.layout.source(response.source).start,
                single.departure,
            ),
            (
                Nuisance::ReceiverPosition(response.receiver),
                self.layout.receiver(response.receiver).start,
                single.arrival,
            ),
        ] {
            if !moved.contains(&place) {
                later_s += longer_m(single.length_m, direction, &values[first..first + 3]) / speed_m_s;
            }
        }
        later_s
    }
}

/// Reflections that a term may add to a response.
fn ways_of(placed: &ModelTerm<'_>) -> usize {
    placed.case.reflection_term().map_or(0, ReflectionTerm::ways)
}

/// Whether a case changes the temperature or the room's size, or moves all places: that is in the times of paths once they are traced again.
fn is_in_the_ways(case: &Case, own: &[f64], survey: &Survey) -> bool {
    let stated = survey.air.temperature_c();
    let changes = case.model_changes(&FittedCase::of_values(survey, own));
    changes.iter().any(|change| match change {
        ModelChange::Temperature(celsius) => *celsius != stated,
        ModelChange::CoordinateShift(_) | ModelChange::Dimensions(_) => true,
        _ => false,
    })
}

/// Fits without the case at `place`, then with it from wherever the peaks that are left point; the best end counts.
pub(super) fn fit(
    data: &ArrivalData<'_>,
    cases: &[&Case],
    used: &[bool],
    place: usize,
) -> Result<(LaplaceFit, Vec<usize>), Error> {
    let mut others = cases.to_vec();
    let sought = others.remove(place);
    let (known, known_firsts) = super::fit(data, &others, used)?;
    let starts = sought
        .reflection_term()
        .map_or_else(Vec::new, |term| term.starts(&at_fit(data, &others, used).strays(&known.values)));
    let mut model = ArrivalModel::new(data, cases, used);
    let mut origin: Vec<f64> = model.priors.iter().map(|p| p.mean).collect();
    let nuisances = known_firsts.first().copied().unwrap_or(known.values.len());
    origin[..nuisances].copy_from_slice(&known.values[..nuisances]);
    for (i, placed) in model.terms.iter().enumerate().filter(|(i, _)| *i != place) {
        let first = known_firsts[if i < place { i } else { i - 1 }];
        let count = placed.case.parameters.len();
        origin[placed.range()].copy_from_slice(&known.values[first..first + count]);
    }
    let own = model.terms[place].first;
    let mut best: Option<LaplaceFit> = None;
    // Where nothing points anywhere, the case is fitted where it does no harm.
    let nowhere = vec![model.terms[place].own(&origin).to_vec()];
    for start in if starts.is_empty() { &nowhere } else { &starts } {
        let mut x = origin.clone();
        x[own..own + start.len()].copy_from_slice(start);
        let mut found = None;
        for width_s in &WIDTHS_S[1..] {
            model.width_s = Some(*width_s);
            let top = maximise(&model, &x, "arrival times")?;
            x = top.values.clone();
            found = Some(top);
        }
        // Where a plane reflects to a receiver changes little about its top; whether a small face does, changes at its edges.
        let has_edges = model.terms[place].case.reflection_term().is_some_and(|term| term.ways() > 1);
        if let Some(found) = found.as_mut().filter(|f| has_edges && f.log_evidence > known.log_evidence) {
            edges::take_in(&model, found, model.terms[place].range());
        }
        if let Some(found) = found.filter(|f| best.as_ref().is_none_or(|b| f.log_evidence > b.log_evidence)) {
            best = Some(found);
        }
    }
    let firsts = model.terms.iter().map(|p| p.first).collect();
    best.map(|b| (b, firsts)).ok_or(Error::Singular { what: "arrival times" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::{CoordinateShift, RoomDimensions, SamplingClock};
    use crate::hand_made::Tables;
    use crate::likelihood::laplace::Model;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn what_paths_are_traced_with_is_not_counted_a_second_time() {
        let tables = Tables::new(Levels::Common, TimeZero::Emission);
        let data = tables.arrival_data();
        let way = &data.arrivals[0][2];
        let single = IsolatedReflection {
            length_m: way.length_m,
            after_direct_s: 0.0,
            departure: way.departure,
            arrival: way.arrival,
            order: 1,
            surfaces: way.surfaces.clone(),
        };
        let effects: [(&dyn Effect, bool); 3] =
            [(&RoomDimensions, true), (&CoordinateShift, true), (&SamplingClock, false)];
        for (effect, is_traced) in effects {
            let case = &effect.cases(&tables.survey)[0];
            let model = at_fit(&data, &[case], &[true; 3]);
            let mut values: Vec<f64> = model.priors().iter().map(|p| p.mean).collect();
            values[model.terms[0].range()].fill(0.5);
            let delay_s = model.arrival_s(&values, 0, way) - way.length_m / data.speed_m_s[0];
            assert!(delay_s.abs() > 1e-9, "{}: {delay_s}", effect.id());
            let later_s = model.later_s(&values, 0, &single);
            let expected = if is_traced { 0.0 } else { delay_s };
            assert!((later_s - expected).abs() < 1e-12, "{}: {later_s} {expected}", effect.id());
        }
    }
}
