//! Where the peaks of a response come from: which predicted reflections are found among them and how high those stand, and how many peaks of
//! what height no predicted reflection explains.
//!
//! Peaks are points of a Poisson process in time and height. How many strays there are, and when, the other responses say: paths of higher
//! order than are predicted one by one come late and low; an early, loud peak that nothing explains is rare, unless it is as common in all of
//! them, as in a furnished room.

use super::{ArrivalData, READ_HZ, REFLECTION_SD_S, normal};
use crate::observe::observed_response::{MAX_PEAKS, PEAK_FLOOR_DB, PEAKS_S};
use crate::simulate::traced_pair::Arrival;

/// Share of predicted reflections far above the lowest peak that are found as peaks: the others lie beside a louder one.
const FOUND_SHARE: f64 = 0.9;
/// A reflection that is predicted just as high as the lowest peak stands is found half as often as one far above it; the logistic curve
/// between has this scale, in dB.
const FOUND_SLOPE_DB: f64 = 2.5;
/// Height of a found peak about what reflectances and distance give, in dB: its neighbours, and colour.
const HEIGHT_SD_DB: f64 = 3.0;
/// Share of peaks whose height says nothing, down to the floor: loudspeakers and microphones are not the same in all directions.
const ANY_HEIGHT_SHARE: f64 = 0.3;
/// Share of peaks that are strays, at least, before other responses are looked at.
const STRAY_SHARE: f64 = 0.25;
/// The same in recordings at less than [`READ_HZ`].
const SLOW_STRAY_SHARE: f64 = 0.4;
/// Intervals after the direct sound in which strays are counted.
const INTERVALS: usize = 8;
/// Mean height of strays above the lowest peak, in dB, before others are looked at: as much as [`STRAYS_BEFORE`] of them say.
const STRAY_HEIGHT_DB: f64 = 5.0;
const STRAYS_BEFORE: f64 = 4.0;
/// Rounds in which strays and how many there are settle.
const ROUNDS: usize = 3;

/// Strays of one or several responses: how many in each interval, and the sum of their heights above the lowest peak.
struct Strays {
    counts: [f64; INTERVALS],
    heights_db: f64,
}

impl Strays {
    const NONE: Self = Self { counts: [0.0; INTERVALS], heights_db: 0.0 };

    fn add(&mut self, other: &Self) {
        self.counts.iter_mut().zip(other.counts).for_each(|(own, other)| *own += other);
        self.heights_db += other.heights_db;
    }

    fn all(&self) -> f64 {
        self.counts.iter().sum()
    }
}

pub(super) struct PeakOrigins {
    /// For each predicted reflection how often it is found ...
    found: Vec<f64>,
    /// ... and its level over the direct sound, in dB.
    levels_db: Vec<f64>,
    /// Where the lowest peak may stand.
    least_db: f64,
    /// Strays in each interval.
    strays: [f64; INTERVALS],
    stray_height_db: f64,
    /// Share of peaks whose height says nothing.
    any_height_share: f64,
}

impl PeakOrigins {
    /// Of all pairs, where each takes the measured response that is assigned to it. Responses that are not used say nothing about strays.
    pub fn of(data: &ArrivalData<'_>, assignment: &[usize], used: &[bool]) -> Vec<Self> {
        let mut found: Vec<Self> = assignment
            .iter()
            .zip(data.arrivals)
            .map(|(&m, arrivals)| {
                let (peaks_db, rate_hz) = (&data.measured[m].peaks_db, data.measured[m].sample_rate_hz);
                let least_db = lowest(peaks_db.iter().copied());
                Self::without_others(arrivals, peaks_db.len(), least_db, f64::from(rate_hz))
            })
            .collect();
        let responses = &data.survey.responses;
        for _ in 0..ROUNDS {
            let counted: Vec<Strays> =
                (0..found.len()).map(|pair| found[pair].counted(data, assignment[pair], pair)).collect();
            for (pair, origins) in found.iter_mut().enumerate() {
                let is_other = |&q: &usize| {
                    used[q]
                        && responses[q].receiver != responses[pair].receiver
                        && !data.arrivals[q].is_empty()
                };
                let mut others = Strays::NONE;
                let mut count = 0.0;
                (0..counted.len()).filter(is_other).for_each(|q| {
                    others.add(&counted[q]);
                    count += 1.0;
                });
                if count > 0.0 && origins.any_height_share < 1.0 {
                    origins.learn(&others, count, data.measured[assignment[pair]].peaks_s.len());
                }
            }
        }
        found
    }

    /// Of a response in which just these reflections will be found as peaks (their places among the arrivals, which begin with the direct
    /// sound).
    pub fn expected(arrivals: &[Arrival], heard: &[usize], rate_hz: f64) -> Self {
        let levels_db = heard.iter().map(|&i| level_db(&arrivals[i], &arrivals[0]));
        Self::without_others(arrivals, heard.len(), lowest(levels_db), rate_hz)
    }

    fn without_others(arrivals: &[Arrival], peaks: usize, least_db: f64, rate_hz: f64) -> Self {
        let levels_db: Vec<f64> = arrivals.iter().skip(1).map(|a| level_db(a, &arrivals[0])).collect();
        let is_slow = rate_hz < READ_HZ;
        let found = if is_slow { slowly_found(&levels_db, peaks) } else { found(&levels_db, least_db) };
        let rest = peaks as f64 - found.iter().sum::<f64>();
        let strays = [rest.max(least_strays(peaks)) / INTERVALS as f64; INTERVALS];
        let any_height_share = if is_slow { 1.0 } else { ANY_HEIGHT_SHARE };
        Self { found, levels_db, least_db, strays, stray_height_db: STRAY_HEIGHT_DB, any_height_share }
    }

    /// Peaks of a pair as far as they are strays, everything being where it is stated.
    fn counted(&self, data: &ArrivalData<'_>, measured: usize, pair: usize) -> Strays {
        let (survey, measured) = (data.survey, &data.measured[measured]);
        let Some((direct, later)) = data.arrivals[pair].split_first() else { return Strays::NONE };
        let (response, speed_m_s) = (&survey.responses[pair], data.speed_m_s[pair]);
        let place_m = survey.sources[response.source]
            .position_sd_m
            .hypot(survey.receivers[response.receiver].position_sd_m);
        let sd_s = (REFLECTION_SD_S * measured.slowness()).hypot(place_m / speed_m_s);
        let mut sum = Strays::NONE;
        for (peak_s, &height_db) in measured.peaks_s.iter().zip(&measured.peaks_db) {
            let after_s = peak_s - measured.direct_s;
            let predicted = later.iter().enumerate().map(|(i, arrival)| {
                let off_s = after_s - (arrival.length_m - direct.length_m) / speed_m_s;
                self.predicted(i, height_db) * normal(off_s, sd_s)
            });
            let stray = self.stray(after_s, height_db);
            let share = stray / (stray + predicted.sum::<f64>());
            sum.counts[interval(after_s)] += share;
            sum.heights_db += share * (height_db - self.least_db).max(0.0);
        }
        sum
    }

    /// Takes over what so many other responses say, as if one more had its strays at any time.
    fn learn(&mut self, others: &Strays, responses: f64, peaks: usize) {
        let even = (others.all() / responses).max(least_strays(peaks)) / INTERVALS as f64;
        self.strays = others.counts.map(|count| (count + even) / (responses + 1.0));
        self.stray_height_db =
            (others.heights_db + STRAYS_BEFORE * STRAY_HEIGHT_DB) / (others.all() + STRAYS_BEFORE);
    }

    /// Level of a predicted reflection (its place after the direct sound) over the direct sound, in dB.
    pub fn level_db(&self, reflection: usize) -> f64 {
        self.levels_db[reflection]
    }

    /// How often a predicted reflection (its place after the direct sound) is found as a peak.
    pub fn found(&self, reflection: usize) -> f64 {
        self.found[reflection]
    }

    /// How many peaks of a height a predicted reflection is, for each dB.
    pub fn predicted(&self, reflection: usize, height_db: f64) -> f64 {
        let own = normal(height_db - self.levels_db[reflection], HEIGHT_SD_DB);
        self.found[reflection] * self.with_any_height(own)
    }

    /// How many strays of a height there are so long after the direct sound, for each dB and second.
    pub fn stray(&self, after_s: f64, height_db: f64) -> f64 {
        let above_db = (height_db - self.least_db).max(0.0);
        let low = (-above_db / self.stray_height_db).exp() / self.stray_height_db;
        self.strays[interval(after_s)] * INTERVALS as f64 / PEAKS_S * self.with_any_height(low)
    }

    fn with_any_height(&self, density: f64) -> f64 {
        (1.0 - self.any_height_share) * density + self.any_height_share / PEAK_FLOOR_DB
    }
}

/// How often each of the predicted reflections is found.
fn found(levels_db: &[f64], least_db: f64) -> Vec<f64> {
    let one = |level_db: &f64| FOUND_SHARE / (1.0 + ((least_db - level_db) / FOUND_SLOPE_DB).exp());
    levels_db.iter().map(one).collect()
}

/// The same at a slow rate. Pulses are so long there that neighbours merge: heights say nothing, strays are as likely at any time, and what is
/// not a stray is a reflection in proportion to its amplitude.
fn slowly_found(levels_db: &[f64], peaks: usize) -> Vec<f64> {
    let amplitudes: Vec<f64> = levels_db.iter().map(|level_db| 10f64.powf(level_db / 20.0)).collect();
    let all = amplitudes.iter().sum::<f64>().max(1e-30);
    amplitudes.iter().map(|a| (1.0 - SLOW_STRAY_SHARE) * peaks as f64 * a / all).collect()
}

fn least_strays(peaks: usize) -> f64 {
    STRAY_SHARE * peaks.max(1) as f64
}

fn interval(after_s: f64) -> usize {
    ((after_s / PEAKS_S * INTERVALS as f64).max(0.0) as usize).min(INTERVALS - 1)
}

fn level_db(arrival: &Arrival, direct: &Arrival) -> f64 {
    10.0 * (arrival.energy / direct.energy).max(1e-30).log10()
}

/// Where the lowest peak may stand: at the floor, or higher where there are as many peaks as are kept.
fn lowest(levels_db: impl ExactSizeIterator<Item = f64>) -> f64 {
    if levels_db.len() < MAX_PEAKS { -PEAK_FLOOR_DB } else { levels_db.fold(f64::INFINITY, f64::min) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_made::Tables;
    use sabine_scene::{Levels, TimeZero};

    fn arrival(length_m: f64, energy: f64) -> Arrival {
        Arrival {
            length_m,
            energy,
            departure: [1.0, 0.0, 0.0],
            arrival: [-1.0, 0.0, 0.0],
            surfaces: Vec::new(),
        }
    }

    #[test]
    fn a_peak_as_high_as_predicted_says_more_and_none_counts_twice() {
        let arrivals = [arrival(3.0, 1.0), arrival(5.0, 0.25), arrival(6.0, 1e-4)];
        let origins = PeakOrigins::expected(&arrivals, &[1, 2], 48_000.0);
        assert!((origins.level_db(0) + 6.02).abs() < 0.01);
        // Four and a half sd off, nothing but the share of any height is left: 0.3 over 26 dB.
        let ratio = origins.predicted(0, -6.02) / origins.predicted(0, -19.5);
        let expected = (0.7 / (3.0 * std::f64::consts::TAU.sqrt()) + 0.3 / 26.0) / (0.3 / 26.0);
        assert!((ratio / expected - 1.0).abs() < 1e-3, "{ratio} {expected}");
        // What is far below the floor is hardly found; the density over all heights is the share that is.
        let all = |i: usize| (-600..600).map(|k| origins.predicted(i, 0.1 * f64::from(k)) * 0.1).sum::<f64>();
        let any = 0.3 / 26.0 * (120.0 - 26.0);
        for (i, share) in [(0, 0.9), (1, 0.9 / (1.0 + (14.0f64 / 2.5).exp()))] {
            assert!((all(i) - share * (1.0 + any)).abs() < 1e-3, "{i}: {}", all(i));
        }
    }

    #[test]
    fn in_a_slow_recording_heights_say_nothing() {
        let arrivals = [arrival(3.0, 1.0), arrival(5.0, 0.25)];
        let slow = PeakOrigins::expected(&arrivals, &[1], 6000.0);
        assert_eq!(slow.predicted(0, -6.0), slow.predicted(0, -25.0));
        assert_eq!(slow.stray(1e-3, -6.0), slow.stray(39e-3, -25.0));
    }

    #[test]
    fn how_many_strays_there_are_the_other_responses_say() {
        let mut tables = Tables::new(Levels::Common, TimeZero::Emission);
        let speed_m_s = tables.survey.responses[0].air.speed_of_sound_m_s();
        for pair in 0..3 {
            let (arrivals, measured) = (&tables.arrivals[pair], &mut tables.measured[pair]);
            measured.direct_s = arrivals[0].length_m / speed_m_s;
            let after = |a: &Arrival| (a.length_m - arrivals[0].length_m) / speed_m_s;
            let early: Vec<&Arrival> = arrivals[1..].iter().filter(|a| after(a) < PEAKS_S).collect();
            measured.peaks_s = early.iter().map(|a| measured.direct_s + after(a)).collect();
            measured.peaks_db = early.iter().map(|a| level_db(a, &arrivals[0])).collect();
            // Two more at the end of the third response, and two early ones.
            if pair == 2 {
                for after_s in [1.1e-3, 1.7e-3, 36e-3, 38e-3] {
                    measured.peaks_s.push(measured.direct_s + after_s);
                    measured.peaks_db.push(-20.0);
                }
            }
        }
        let data = tables.arrival_data();
        let all = PeakOrigins::of(&data, &[0, 1, 2], &[true; 3]);
        // The third does not count for itself, and counts for the others.
        let even = |pair: usize| least_strays(data.measured[pair].peaks_s.len()) / INTERVALS as f64;
        assert!((all[2].strays[0] - even(2) / 3.0).abs() < 0.05, "{:?}", all[2].strays);
        assert!((all[0].strays[0] - (2.0 + even(0)) / 3.0).abs() < 0.1, "{:?}", all[0].strays);
        assert!((all[0].strays[INTERVALS - 1] - (2.0 + even(0)) / 3.0).abs() < 0.1, "{:?}", all[0].strays);
        assert!(all[0].strays[4] < 0.2, "{:?}", all[0].strays);
        // A response that is not used says nothing.
        let without = PeakOrigins::of(&data, &[0, 1, 2], &[true, true, false]);
        assert!(without[0].strays[0] < 0.3, "{:?}", without[0].strays);
    }
}
