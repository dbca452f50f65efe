//! Arrival times of one response, expanded about some values.

use super::peak_origins::PeakOrigins;
use super::{ArrivalModel, DIRECT_SD_S, MISREAD_SHARE, READ_HZ, REFLECTION_SD_S, normal};
use crate::likelihood::expansion::Expansion;
use crate::observe::observed_response::{MAX_PEAKS, PEAK_DISTANCE_S, PEAK_FLOOR_DB, PEAKS_S};
use crate::simulate::traced_pair::Arrival;
use nalgebra::{DMatrix, DVector};

/// Reflections (indices, ascending) that will be found as peaks: loud enough beside the direct sound, which comes first, and apart from
/// louder ones. None where the direct line is blocked.
pub(crate) fn heard(arrivals: &[Arrival], speed_m_s: f64) -> Vec<usize> {
    let Some((direct, later)) = arrivals.split_first() else { return Vec::new() };
    let floor = direct.energy * 10f64.powf(-PEAK_FLOOR_DB / 10.0);
    let after_s = |a: &Arrival| (a.length_m - direct.length_m) / speed_m_s;
    let mut loud: Vec<usize> = (0..later.len())
        .filter(|&i| later[i].energy > floor && (PEAK_DISTANCE_S..PEAKS_S).contains(&after_s(&later[i])))
        .collect();
    loud.sort_by(|&a, &b| later[b].energy.total_cmp(&later[a].energy).then(a.cmp(&b)));
    let mut found: Vec<usize> = Vec::new();
    for i in loud {
        let apart = |other: &usize| (after_s(&later[i]) - after_s(&later[*other])).abs() > PEAK_DISTANCE_S;
        if found.len() < MAX_PEAKS && found.iter().all(apart) {
            found.push(i);
        }
    }
    found.sort_unstable();
    found.into_iter().map(|i| i + 1).collect()
}

impl ArrivalModel<'_> {
    /// The times of the direct sound and of the reflections `heard` of a pair, each as sure as its share: it may be misread, or be
    /// somebody else's. No data where the direct line is blocked.
    pub fn expansion(&self, values: &[f64], pair: usize, heard: &[usize], rate_hz: f64) -> Expansion {
        let all = &self.data.arrivals[pair];
        let at = self.at(values, true);
        let slowness = (READ_HZ / rate_hz).max(1.0);
        let origins = PeakOrigins::expected(all, heard, rate_hz);
        let sure = |i: usize| {
            if i == 0 {
                return (1.0 - MISREAD_SHARE) / (DIRECT_SD_S * slowness).powi(2);
            }
            let sd = REFLECTION_SD_S * slowness;
            let level_db = origins.level_db(i - 1);
            let own = origins.predicted(i - 1, level_db) * normal(0.0, sd);
            let after_s = (all[i].length_m - all[0].length_m) / self.data.speed_m_s[pair];
            own / (own + origins.stray(after_s, level_db)) / (sd * sd)
        };
        let timed: Vec<usize> = (0..all.len().min(1)).chain(heard.iter().copied()).collect();
        let mut slopes = DMatrix::zeros(timed.len(), self.priors.len());
        for (datum, &i) in timed.iter().enumerate() {
            for (parameter, slope) in self.time_slopes(&at, pair, &all[i]) {
                slopes[(datum, parameter)] += slope;
            }
        }
        let times = timed.iter().map(|&i| self.time_s(&at, pair, &all[i]));
        Expansion {
            predicted: DVector::from_iterator(timed.len(), times),
            weights: DVector::from_iterator(timed.len(), timed.iter().map(|&i| sure(i))),
            shared: DMatrix::zeros(timed.len(), 0),
            slopes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::effects::SoundSpeed;
    use crate::hand_made::Tables;
    use crate::likelihood::arrivals::at_fit;
    use crate::likelihood::laplace::{Model, Slopes};
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn what_the_times_say_is_the_information_of_the_likelihood() {
        let mut tables = Tables::new(Levels::Common, TimeZero::Emission);
        // As predicted: all peaks are where they should be.
        for pair in 0..3 {
            let speed = tables.survey.responses[pair].air.speed_of_sound_m_s();
            let heard = heard(&tables.arrivals[pair], speed);
            let s = |i: &usize| tables.arrivals[pair][*i].length_m / speed;
            tables.measured[pair].peaks_s = heard.iter().map(s).collect();
            let origins = PeakOrigins::expected(&tables.arrivals[pair], &heard, 48_000.0);
            tables.measured[pair].peaks_db = heard.iter().map(|i| origins.level_db(i - 1)).collect();
            tables.measured[pair].direct_s = s(&0);
        }
        let data = tables.arrival_data();
        let cases = SoundSpeed.cases(&tables.survey);
        let mut count = 0;
        for pair in 0..3 {
            let used: Vec<bool> = (0..3).map(|p| p == pair).collect();
            let model = at_fit(&data, &[&cases[0]], &used);
            let values: Vec<f64> = model.priors().iter().map(|p| p.mean).collect();
            let mut slopes = Slopes::zero(values.len());
            model.log_likelihood(&values, Some(&mut slopes));
            let heard = heard(&tables.arrivals[pair], data.speed_m_s[pair]);
            count += heard.len();
            let one = model.expansion(&values, pair, &heard, 48_000.0);
            let found = one.products(&one.slopes);
            let size = slopes.information.amax();
            // Other reflections have a share in a peak.
            assert!((found - &slopes.information).amax() < 0.02 * size, "{pair}");
        }
        assert!(count > 5, "{count}");
    }

    #[test]
    fn weak_and_close_reflections_are_not_heard() {
        let one = |length_m: f64, energy: f64| Arrival {
            length_m,
            energy,
            departure: [1.0, 0.0, 0.0],
            arrival: [-1.0, 0.0, 0.0],
            surfaces: Vec::new(),
        };
        // 0.1 m are 0.29 ms; 26 dB below 1 is 0.0025.
        let all =
            [one(3.0, 1.0), one(5.0, 0.1), one(5.1, 0.2), one(6.0, 0.002), one(7.0, 0.01), one(20.0, 0.1)];
        assert_eq!(heard(&all, 343.0), [2, 4]);
        assert!(heard(&[], 343.0).is_empty());
    }
}
