//! What every measured peak may belong to, and when paths come: for causes that are sought among boxes, not by slopes.

use super::{ArrivalModel, PEAKS_S, REFLECTION_SD_S, SEEN_SHARE, STRAY_SHARE, normal};
use crate::simulate::traced_pair::Arrival;

/// Partners with a smaller share of a peak's density than this are nobody's.
const LEAST_SHARE: f64 = 1e-3;

/// A measured peak.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PeakPartners {
    /// Seconds of the file.
    pub time_s: f64,
    /// Height over the direct sound in dB.
    pub height_db: f64,
    /// Density of each predicted path (index among those after the direct sound) at the peak.
    pub partners: Vec<(usize, f64)>,
    /// That of everything else: reflections that other causes add, and strays.
    pub other: f64,
}

/// When a path of a pair comes: linear in its length and in the directions at both ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TimeAxis {
    pub zero_s: f64,
    pub per_m_s: f64,
    /// By how much source and receiver stand elsewhere than stated, as times.
    pub source_s: [f64; 3],
    pub receiver_s: [f64; 3],
}

impl TimeAxis {
    /// Seconds of the file at which a path comes that leaves and arrives (towards where it comes from) in these directions.
    pub fn at_s(&self, length_m: f64, departure: [f64; 3], arrival: [f64; 3]) -> f64 {
        let moved: f64 =
            (0..3).map(|k| departure[k] * self.source_s[k] + arrival[k] * self.receiver_s[k]).sum();
        self.zero_s + length_m * self.per_m_s - moved
    }
}

impl ArrivalModel<'_> {
    /// Times of paths of a pair under fitted values.
    pub fn time_axis(&self, values: &[f64], pair: usize) -> TimeAxis {
        let at = self.at(values, false);
        let path = |length_m: f64| Arrival {
            length_m,
            departure: [0.0; 3],
            arrival: [0.0; 3],
            energy: 0.0,
            surfaces: Vec::new(),
        };
        let [zero_s, one_s] = [0.0, 1.0].map(|length_m| self.time_s(&at, pair, &path(length_m)));
        let (response, speed) = (&self.data.survey.responses[pair], self.data.speed_m_s[pair]);
        let place = |first: usize| std::array::from_fn(|k| values[first + k] / speed);
        TimeAxis {
            zero_s,
            per_m_s: one_s - zero_s,
            source_s: place(self.layout.source(response.source).start),
            receiver_s: place(self.layout.receiver(response.receiver).start),
        }
    }

    /// The peaks of a pair and what they may belong to; none where the direct line is blocked.
    pub fn peak_partners(&self, values: &[f64], pair: usize) -> Vec<PeakPartners> {
        let Some((_, later)) = self.data.arrivals[pair].split_first() else { return Vec::new() };
        let at = self.at(values, false);
        let measured = &self.data.measured[self.assignment[pair]];
        let sd = REFLECTION_SD_S * measured.slowness();
        let amplitude: f64 = later.iter().map(|a| a.energy.sqrt()).sum();
        let times_s: Vec<f64> = later.iter().map(|a| self.time_s(&at, pair, a)).collect();
        let added = self.added(&at, pair);
        let each = SEEN_SHARE / measured.peaks_s.len().max(1) as f64;
        let rest = 1.0 - each * added.len() as f64;
        let one = |(time_s, height_db): (&f64, &f64)| {
            let density = |(i, a): (usize, &Arrival)| {
                let own = rest * (1.0 - STRAY_SHARE) * a.energy.sqrt() / amplitude.max(1e-300);
                (i, own * normal(time_s - times_s[i], sd))
            };
            let others: f64 = added.iter().map(|m| each * m.density(*time_s, *height_db, sd)).sum();
            let other = others + rest * STRAY_SHARE / PEAKS_S;
            let partners = later.iter().enumerate().map(density);
            let partners = partners.filter(|(_, d)| *d > LEAST_SHARE * other).collect();
            PeakPartners { time_s: *time_s, height_db: *height_db, partners, other }
        };
        measured.peaks_s.iter().zip(&measured.peaks_db).map(one).collect()
    }
}
