//! How probable measured arrival times are under places, latency and effects.
//!
//! The direct sound comes when it should, give or take; every later peak belongs to one of the predicted specular reflections or to none
//! (a mixture of normal distributions about the predicted times and an even background).

mod edges;
pub(crate) mod expansion;
mod fit;
mod peak_origins;
mod places;
mod unassigned_peaks;

use crate::effect::Case;
use crate::extend::displaced_surface::{DisplacedSurface, Mirror, mirrors};
use crate::likelihood::laplace::{Model, Prior, Slopes};
use crate::likelihood::parameters::{ArrivalLayout, ModelTerm, ModelTerms};
use crate::observe::observed_response::{Measured, PEAKS_S};
use crate::simulate::traced_pair::Arrival;
use crate::simulate::views::ArrivalView;
use crate::survey::path_stops::{path_stops, stops_over};
use crate::survey::{Survey, SurveyedResponse};
pub(crate) use fit::fit;
use peak_origins::PeakOrigins;
use sabine_scene::TimeZero;
use std::ops::Range;

/// How well the time of a direct sound can be read at [`READ_HZ`]: a third of a sample. Slower recordings are read worse.
const DIRECT_SD_S: f64 = 2.5e-5;
/// The same of a reflection, whose neighbours pull at its peak.
const REFLECTION_SD_S: f64 = 5e-5;
/// Sample rate from which times are read as well as that.
const READ_HZ: f64 = 16e3;
/// Share of responses in which a surface that the mesh lacks is seen.
const SEEN_SHARE: f64 = 0.65;
/// Height of such a peak about what reflectance and distance give: its neighbours, and colour, in dB.
const ADDED_HEIGHT_SD_DB: f64 = 2.5;
/// Share of direct sounds whose time was misread.
const MISREAD_SHARE: f64 = 0.02;
/// Times at which the fit starts to look for partners of a peak, and how it narrows.
const WIDTHS_S: [f64; 3] = [4e-4, 1.2e-4, 0.0];
/// Standard deviations from which a normal density counts as nothing: 5e-32 of its top.
const FAR_SD: f64 = 12.0;
/// Latency of a recording whose time zero means nothing.
const FREE_LATENCY_S: f64 = 1.0;
/// Time zero where the file says that it is the emission: half a sample or so.
const EMISSION_SD_S: f64 = 1e-5;

pub(crate) struct ArrivalData<'a> {
    pub survey: &'a Survey,
    pub measured: &'a [Measured],
    /// Predicted arrivals of each pair, the shortest first; empty where the direct line is blocked.
    pub arrivals: &'a [Vec<Arrival>],
    pub speed_m_s: &'a [f64],
    /// Surfaces that stand elsewhere in the paths as they were traced last; the arrivals are those of the room as stated.
    pub displaced: &'a [(usize, DisplacedSurface)],
}

pub(crate) struct ArrivalModel<'a> {
    data: &'a ArrivalData<'a>,
    pub layout: ArrivalLayout,
    pub terms: Vec<ModelTerm<'a>>,
    priors: Vec<Prior>,
    used: &'a [bool],
    assignment: Vec<usize>,
    /// By pair.
    origins: Vec<PeakOrigins>,
    /// Where each arrival runs ([`path_stops`]), by pair; none where nothing asks.
    stops: Vec<Vec<Vec<[f64; 3]>>>,
    /// Reflections count with this much more than their own width; `None`: only the direct sound counts, and is never misread.
    width_s: Option<f64>,
}

/// Values of all parameters, and the surfaces that they move.
pub(crate) struct At<'v> {
    values: &'v [f64],
    is_sloping: bool,
    mirrors: Vec<Mirror>,
    /// By term, where it does nothing but move a surface.
    moved: Vec<Option<Moved>>,
}

/// A surface that a term moves, and all mirrors a step of each parameter farther and less far.
struct Moved {
    surface: usize,
    steps: Vec<[Vec<Mirror>; 2]>,
}

/// Where all predicted arrivals run, by pair.
fn stops_of_all(data: &ArrivalData<'_>) -> Vec<Vec<Vec<[f64; 3]>>> {
    let of_pair = |(response, arrivals): (&SurveyedResponse, &Vec<Arrival>)| {
        arrivals.iter().map(|a| path_stops(data.survey, response, a.length_m, &a.surfaces)).collect()
    };
    data.survey.responses.iter().zip(data.arrivals).map(of_pair).collect()
}

fn normal(residual: f64, sd: f64) -> f64 {
    let z = residual / sd;
    // Most peaks are far from most reflections; beside the even background their density is less than the last bit.
    if z.abs() > FAR_SD { 0.0 } else { (-0.5 * z * z).exp() / (sd * std::f64::consts::TAU.sqrt()) }
}

impl<'a> ArrivalModel<'a> {
    pub fn new(data: &'a ArrivalData<'a>, cases: &[&'a Case], used: &'a [bool]) -> Self {
        let survey = data.survey;
        let layout = ArrivalLayout::of(survey);
        let mut priors = vec![Prior::normal(0.0, 1.0); layout.latency(0)];
        let sources = survey.sources.iter().enumerate().map(|(i, place)| (layout.source(i), place));
        let receivers = survey.receivers.iter().enumerate().map(|(i, place)| (layout.receiver(i), place));
        for (range, place) in sources.chain(receivers) {
            priors[range].fill(Prior::normal(0.0, place.position_sd_m));
        }
        let latency_sd_s = match survey.measurement.time_zero {
            TimeZero::PerResponse | TimeZero::Common => FREE_LATENCY_S,
            _ => EMISSION_SD_S,
        };
        priors.extend(vec![Prior::normal(0.0, latency_sd_s); layout.latencies()]);
        let cases = cases.iter().copied().enumerate();
        let all = ModelTerms::new(priors, cases, survey, |nuisance| layout.nuisance(nuisance));
        let ModelTerms { priors, terms, assignment, .. } = all;
        let origins = PeakOrigins::of(data, &assignment, used);
        let may_hide = terms.iter().any(|p| p.case.reflection_term().is_some());
        let stops = if may_hide { stops_of_all(data) } else { vec![Vec::new(); survey.responses.len()] };
        Self { data, layout, terms, priors, used, assignment, origins, stops, width_s: None }
    }

    /// Values, with what their terms make of the mirrors; a step farther, too, where slopes are wanted.
    fn at<'v>(&self, values: &'v [f64], is_sloping: bool) -> At<'v> {
        let moved = |(number, placed): (usize, &ModelTerm<'_>)| {
            let mut own = placed.own(values).to_vec();
            let (surface, _) = placed.case.arrival_term()?.displaces(&own)?;
            let mut stepped = |i: usize, step: f64| {
                let value = own[i];
                own[i] = value + step;
                let found = mirrors(&self.displaced(values, Some((number, &own))));
                own[i] = value;
                found
            };
            let count = if is_sloping { placed.case.parameters.len() } else { 0 };
            let steps = (0..count)
                .map(|i| [1.0, -1.0].map(|sign| stepped(i, sign * self.step(placed.first + i))))
                .collect();
            Some(Moved { surface, steps })
        };
        At {
            values,
            is_sloping,
            mirrors: mirrors(&self.displaced(values, None)),
            moved: self.terms.iter().enumerate().map(moved).collect(),
        }
    }

    /// Step of differences of a parameter.
    fn step(&self, index: usize) -> f64 {
        1e-4 * self.priors[index].sd
    }

    fn effect_delay_s(&self, at: &At<'_>, view: &ArrivalView<'_>) -> f64 {
        let delay_s = |(placed, moved): (&ModelTerm<'_>, &Option<Moved>)| {
            let term = placed.case.arrival_term().filter(|_| moved.is_none())?;
            Some(term.delay_s(placed.own(at.values), view))
        };
        self.terms.iter().zip(&at.moved).filter_map(delay_s).sum::<f64>() + view.delay_in_s(&at.mirrors)
    }

    /// All surfaces that the terms move; `instead` are other values of one term (its number).
    fn displaced(&self, values: &[f64], instead: Option<(usize, &[f64])>) -> Vec<(usize, DisplacedSurface)> {
        let one = |(number, placed): (usize, &ModelTerm<'_>)| {
            let own = instead.filter(|(n, _)| *n == number).map_or(placed.own(values), |(_, own)| own);
            placed.case.arrival_term()?.displaces(own)
        };
        self.terms.iter().enumerate().filter_map(one).collect()
    }

    fn view<'v>(&'v self, pair: usize, arrival: &'v Arrival) -> ArrivalView<'v> {
        ArrivalView {
            survey: self.data.survey,
            pair,
            length_m: arrival.length_m,
            speed_m_s: self.data.speed_m_s[pair],
            departure: arrival.departure,
            arrival: arrival.arrival,
            surfaces: &arrival.surfaces,
        }
    }

    /// Time of an arrival in the file.
    fn time_s(&self, at: &At<'_>, pair: usize, arrival: &Arrival) -> f64 {
        let (values, response) = (at.values, &self.data.survey.responses[pair]);
        let speed = self.data.speed_m_s[pair];
        let source = self.layout.source(response.source).start;
        let receiver = self.layout.receiver(response.receiver).start;
        let latency = self.layout.latency(self.assignment[pair]);
        let effects_s = self.effect_delay_s(at, &self.view(pair, arrival));
        let offset = |first: usize| &values[first..first + 3];
        let length_m = arrival.length_m
            + places::longer_m(arrival.length_m, arrival.departure, offset(source))
            + places::longer_m(arrival.length_m, arrival.arrival, offset(receiver));
        length_m / speed + values[latency] + effects_s
    }

    /// Change of that time with each parameter that matters.
    fn time_slopes(&self, at: &At<'_>, pair: usize, arrival: &Arrival) -> Vec<(usize, f64)> {
        let response = &self.data.survey.responses[pair];
        let speed = self.data.speed_m_s[pair];
        let source = self.layout.source(response.source).start;
        let receiver = self.layout.receiver(response.receiver).start;
        let mut found = Vec::with_capacity(8 + 4 * self.terms.len());
        for (first, direction) in [(source, arrival.departure), (receiver, arrival.arrival)] {
            let slopes = places::slopes(arrival.length_m, direction, &at.values[first..first + 3]);
            found.extend(slopes.into_iter().enumerate().map(|(k, slope)| (first + k, slope / speed)));
        }
        found.push((self.layout.latency(self.assignment[pair]), 1.0));
        let view = self.view(pair, arrival);
        for (placed, moved) in self.terms.iter().zip(&at.moved) {
            let mut slope = |i: usize, [later, earlier]: [f64; 2]| {
                let index = placed.first + i;
                found.push((index, (later - earlier) / (2.0 * self.step(index))));
            };
            if let Some(moved) = moved {
                if arrival.surfaces.contains(&moved.surface) {
                    let steps = moved.steps.iter().enumerate();
                    steps.for_each(|(i, both)| slope(i, [0, 1].map(|k| view.delay_in_s(&both[k]))));
                }
                continue;
            }
            let Some(term) = placed.case.arrival_term() else { continue };
            let mut own = placed.own(at.values).to_vec();
            for i in 0..own.len() {
                let value = own[i];
                let both = [1.0, -1.0].map(|sign| {
                    own[i] = value + sign * self.step(placed.first + i);
                    term.delay_s(&own, &view)
                });
                own[i] = value;
                slope(i, both);
            }
        }
        found
    }

    /// When the predicted arrivals of a pair come, in seconds of the file that holds it.
    pub fn times_s(&self, values: &[f64], pair: usize) -> Vec<f64> {
        let at = self.at(values, false);
        self.data.arrivals[pair].iter().map(|arrival| self.time_s(&at, pair, arrival)).collect()
    }

    /// Where one of them runs under fitted values, between places and over surfaces as these were found: source, reflections, receiver. Empty
    /// where that is not known.
    pub fn stops(&self, values: &[f64], pair: usize, arrival: &Arrival) -> Vec<[f64; 3]> {
        let (survey, response) = (self.data.survey, &self.data.survey.responses[pair]);
        let mirrors = self.at(values, false).mirrors;
        let plane = |surface: &usize| {
            let moved = mirrors.iter().rfind(|(moved, _)| moved == surface);
            let own = &survey.surfaces[*surface];
            moved.map_or((own.axes[0], own.centre_m), |(_, plane)| *plane)
        };
        if path_stops(survey, response, arrival.length_m, &arrival.surfaces).is_empty() {
            return Vec::new();
        }
        let moved = |place: [f64; 3], by: Range<usize>| -> [f64; 3] {
            std::array::from_fn(|k| place[k] + values[by.start + k])
        };
        let ends = [
            moved(survey.sources[response.source].position_m, self.layout.source(response.source)),
            moved(survey.receivers[response.receiver].position_m, self.layout.receiver(response.receiver)),
        ];
        stops_over(ends, &arrival.surfaces.iter().map(plane).collect::<Vec<_>>())
    }

    /// What is compared with a pair.
    pub fn compared_with(&self, pair: usize) -> (usize, &Measured) {
        (self.assignment[pair], &self.data.measured[self.assignment[pair]])
    }

    /// The same, for tests of effects.
    #[cfg(test)]
    pub fn arrival_s(&self, values: &[f64], pair: usize, arrival: &Arrival) -> f64 {
        self.time_s(&self.at(values, false), pair, arrival)
    }

    fn pair_likelihood(&self, at: &At<'_>, pair: usize, mut slopes: Option<&mut Slopes>) -> f64 {
        let Some((direct, later)) = self.data.arrivals[pair].split_first() else { return 0.0 };
        let measured = &self.data.measured[self.assignment[pair]];
        let direct_sd_s = DIRECT_SD_S * measured.slowness();
        let sloping = slopes.is_some();
        // Of weighted residuals and their weights.
        let mut push = |found: &[(usize, f64)], [pull, weight]: [f64; 2]| {
            if let Some(slopes) = slopes.as_deref_mut() {
                slopes.add_one(found, pull, weight);
            }
        };
        let weighed = |residual: f64, sd: f64, share: f64| [residual, 1.0].map(|r| r * share / (sd * sd));
        let residual = measured.direct_s - self.time_s(at, pair, direct);
        let found = if sloping { self.time_slopes(at, pair, direct) } else { Vec::new() };
        let Some(width_s) = self.width_s else {
            push(&found, weighed(residual, direct_sd_s, 1.0));
            return -0.5 * (residual / direct_sd_s).powi(2);
        };
        let sd = direct_sd_s.hypot(width_s);
        let hidden = self.hidden(at.values, pair);
        let is_hidden = |arrival: usize| hidden.get(arrival).copied().unwrap_or(false);
        let heard = if is_hidden(0) { 0.0 } else { normal(residual, sd) };
        let (right, wrong) = ((1.0 - MISREAD_SHARE) * heard, MISREAD_SHARE / PEAKS_S);
        push(&found, weighed(residual, sd, right / (right + wrong)));
        let mut value = (right + wrong).ln();

        let sd = (REFLECTION_SD_S * measured.slowness()).hypot(width_s);
        let origins = &self.origins[pair];
        let times_s: Vec<f64> = later.iter().map(|a| self.time_s(at, pair, a)).collect();
        let shown = times_s.iter().copied().zip(0..).filter(|(_, i)| !is_hidden(i + 1));
        let mut in_time: Vec<(f64, usize)> = shown.collect();
        in_time.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Sums over the peaks whose partner each may be.
        let mut sums = vec![[0.0; 2]; later.len()];
        let more = self.added(at, pair);
        // Where it should be seen, and is not.
        value -= SEEN_SHARE * more.len() as f64;
        // What is hidden should not be.
        let worth = |i: usize| if is_hidden(i + 1) { self.worth_of_hiding(pair, i) } else { 0.0 };
        value += (0..later.len()).map(worth).sum::<f64>();
        let mut partners: Vec<(usize, f64)> = Vec::new();
        for (peak, height_db) in measured.peaks_s.iter().zip(&measured.peaks_db) {
            partners.clear();
            let first = in_time.partition_point(|(time_s, _)| *time_s <= peak - FAR_SD * sd);
            let near = in_time[first..].iter().take_while(|(time_s, _)| *time_s < peak + FAR_SD * sd);
            partners.extend(near.map(|&(time_s, i)| {
                let density = normal(peak - time_s, sd);
                (i, origins.predicted(i, *height_db) * density)
            }));
            let added: Vec<f64> = more.iter().map(|m| m.density(*peak, *height_db, sd)).collect();
            let stray = origins.stray(peak - measured.direct_s, *height_db);
            let total =
                partners.iter().map(|(_, density)| density).sum::<f64>() + added.iter().sum::<f64>() + stray;
            value += total.ln();
            if !sloping {
                continue;
            }
            for (i, density) in &partners {
                let share = density / total;
                if share > 1e-3 {
                    let own = weighed(peak - times_s[*i], sd, share);
                    sums[*i].iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
                }
            }
            for (density, m) in added.iter().zip(&more) {
                let share = density / total;
                if share > 1e-3 {
                    push(&m.slopes, weighed(peak - m.time_s, sd, share));
                    push(&m.level_slopes, weighed(height_db - m.level_db, ADDED_HEIGHT_SD_DB, share));
                }
            }
        }
        for (sums, arrival) in sums.into_iter().zip(later).filter(|(sums, _)| sums[1] > 0.0) {
            push(&self.time_slopes(at, pair, arrival), sums);
        }
        value
    }

    pub fn by_pair(&self, values: &[f64]) -> Vec<f64> {
        let at = self.at(values, false);
        (0..self.assignment.len()).map(|pair| self.pair_likelihood(&at, pair, None)).collect()
    }
}

impl Model for ArrivalModel<'_> {
    fn priors(&self) -> &[Prior] {
        &self.priors
    }

    fn log_likelihood(&self, values: &[f64], mut slopes: Option<&mut Slopes>) -> f64 {
        let at = self.at(values, slopes.is_some());
        (0..self.assignment.len())
            .filter(|&pair| self.used[pair])
            .map(|pair| self.pair_likelihood(&at, pair, slopes.as_deref_mut()))
            .sum()
    }
}

impl Measured {
    /// By how much worse times are read than at [`READ_HZ`] or above.
    fn slowness(&self) -> f64 {
        (READ_HZ / f64::from(self.sample_rate_hz)).max(1.0)
    }
}

/// A model that is ready to be looked at with fitted values.
pub(crate) fn at_fit<'a>(
    data: &'a ArrivalData<'a>,
    cases: &[&'a Case],
    used: &'a [bool],
) -> ArrivalModel<'a> {
    ArrivalModel { width_s: Some(0.0), ..ArrivalModel::new(data, cases, used) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::{
        CoordinateShift, PositionError, RoomDimensions, SamplingClock, SoundSpeed, SurfaceDisplacement,
        TemperatureGradient, TimeZeroOffset,
    };
    use crate::hand_made::Tables;
    use sabine_scene::Levels;

    #[test]
    fn the_gradient_is_that_of_central_differences() {
        let effects: [&dyn Effect; 8] = [
            &CoordinateShift,
            &PositionError,
            &RoomDimensions,
            &SamplingClock,
            &SoundSpeed,
            &SurfaceDisplacement,
            &TemperatureGradient,
            &TimeZeroOffset,
        ];
        for time_zero in [TimeZero::Emission, TimeZero::Common, TimeZero::PerResponse] {
            let tables = Tables::new(Levels::Common, time_zero);
            let data = tables.arrival_data();
            let used = [true; 3];
            for effect in effects {
                for case in effect.cases(&tables.survey) {
                    let model = at_fit(&data, &[&case], &used);
                    let values: Vec<f64> = model
                        .priors
                        .iter()
                        .enumerate()
                        .map(|(i, p)| p.mean + 2e-3 * p.sd.min(0.01) * (i as f64).sin())
                        .collect();
                    let mut slopes = Slopes::zero(values.len());
                    model.log_likelihood(&values, Some(&mut slopes));
                    let size = slopes.gradient.iter().zip(&model.priors).map(|(g, p)| (g * p.sd).abs());
                    let size = size.fold(0.0, f64::max);
                    for i in 0..values.len() {
                        let sd = model.priors[i].sd.min(1.0);
                        let at = |offset: f64| {
                            let mut moved = values.clone();
                            moved[i] += offset;
                            model.log_likelihood(&moved, None)
                        };
                        let step = 1e-6 * sd;
                        let (found, expected) = (slopes.gradient[i], (at(step) - at(-step)) / (2.0 * step));
                        // Partners of a peak with less than a thousandth of it are left out of the slopes.
                        let off = (found - expected).abs() * sd;
                        assert!(off < 5e-3 * size + 1e-3, "{} {i}: {found} {expected}", effect.id());
                    }
                }
            }
        }
    }

    #[test]
    fn a_latency_of_all_responses_is_found() {
        let mut tables = Tables::new(Levels::Common, TimeZero::Emission);
        for measured in &mut tables.measured {
            measured.direct_s += 3e-3;
            measured.peaks_s.iter_mut().for_each(|p| *p += 3e-3);
        }
        let data = tables.arrival_data();
        let cases = TimeZeroOffset.cases(&tables.survey);
        let (found, firsts) = fit(&data, &[&cases[0]], &[true; 3]).expect("a fit");
        assert!((found.values[firsts[0]] - 3.0).abs() < 0.05, "{} ms", found.values[firsts[0]]);
        assert!(found.converged);
    }
}
