//! Room-acoustic parameters of traced paths, with the Monte-Carlo error that the rays leave in them.

mod material_errors;

use crate::conditions::Conditions;
use crate::path_set::PathSet;
use sabine_acoustics::{Bands, EnergyDecayCurve, Error, Estimate, NoReading, PerBand, Reading};

/// Step of the decay curve, in seconds.
const STEP_S: f64 = 1e-3;
/// What is estimated to follow the end of the paths must lie this far below the lowest level that a regression uses, in dB
/// (as noise in ISO 3382-1, 5.3.3).
const TAIL_MARGIN_DB: f64 = 10.0;
/// Share of the time, at its end, over which the decay that follows the paths is read, twice.
const TAIL_SHARE: usize = 8;
/// Energy of such a share over that of the one before, at most: what does not fall shows little of what follows.
const SLOWEST_FALL: f64 = 0.9;
/// What arrives by this much after the first path is direct sound, in seconds (Bryan 2019).
const DIRECT_S: f64 = 2.5e-3;
/// Largest relative standard error of a decay time that is still an answer.
const LARGEST_RELATIVE_ERROR: f64 = 0.5;
/// Less than this share of the energy is rounding of a difference, not sound.
const LEAST_SHARE: f64 = 1e-13;

/// Parameters of ISO 3382-1 of traced paths, per octave, each with its Monte-Carlo standard error or the reason why there is none.
///
/// Times count from the arrival of the shortest path. What comes after the longest paths is added as an exponential decay
/// at the rate of the last quarter; where it would count for more than a tenth of the lowest level of a regression, there is
/// no decay time ([`NoReading::DynamicRange`]: trace longer).
///
/// Standard errors are by the jackknife over the [independent](PathSet::batch_count) batches of rays; exact paths have none. They
/// say how well the rays answer the question, not how well the model describes a room: what the materials' tables leave open
/// is told by [`PathParameters::read_material_errors`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PathParameters {
    /// Early decay time, 0 to -10 dB of the decay curve, in seconds.
    pub edt_s: PerBand<Reading>,
    /// Reverberation time from -5 to -25 dB, in seconds.
    pub t20_s: PerBand<Reading>,
    /// Reverberation time from -5 to -35 dB, in seconds.
    pub t30_s: PerBand<Reading>,
    /// Early-to-late energy ratio at 50 ms, in dB.
    pub c50_db: PerBand<Reading>,
    /// Early-to-late energy ratio at 80 ms, in dB.
    pub c80_db: PerBand<Reading>,
    /// Definition: share of the energy within 50 ms, 0 to 1.
    pub d50: PerBand<Reading>,
    /// Centre time, in seconds after the first arrival.
    pub centre_time_s: PerBand<Reading>,
    /// Direct-to-reverberant energy ratio, in dB: what arrives within 2.5 ms of the shortest path against what follows.
    pub drr_db: PerBand<Reading>,
}

/// Number of quantities of [`PathParameters`].
const QUANTITIES: usize = 8;
/// Those of them, the first, that are decay times.
const DECAY_TIMES: usize = 3;

impl PathParameters {
    /// Reads the parameters of a set of paths.
    ///
    /// ```
    /// use sabine_acoustics::*;
    /// use sabine_paths::*;
    /// use sabine_scene::*;
    /// // Energy that falls by 60 dB in 0.5 s, as 32 batches of rays would report it.
    /// let mut paths = PathSet::new(1, 340.0);
    /// let up = [0.0, 0.0, 1.0];
    /// for i in 0..32_000u32 {
    ///     let length_m = 3.4 + 0.01 * f64::from(i);
    ///     paths.push(Contribution {
    ///         length_m, log_weight: -13.8155 * length_m / 343.2 / 0.5,
    ///         chain: PathSet::DIRECT, tail: PathSet::DIRECT, departure: up, arrival: up,
    ///         batch: Some((i % 32) as u8),
    ///     });
    /// }
    /// let (wall, air) = ([Material::uniform(Bands::octaves(125.0, 125.0)?, 0.1, 0.1)?], Air::default());
    /// let room = PathParameters::read(&paths, &Conditions::new(&wall, &air))?;
    /// let t30_s = room.t30_s.values()[0].clone()?;
    /// assert!((t30_s.value - 0.5).abs() < 1e-3 && t30_s.standard_error < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`PathSet::energies`].
    pub fn read(paths: &PathSet, conditions: &Conditions) -> Result<Self, Error> {
        let energies = paths.energies(conditions)?;
        let bands = conditions.materials[0].bands();
        let (times_s, duration_s) = arrival_times(paths, conditions)?;
        let added = added_energy(paths, conditions, duration_s)?;
        let read: Vec<[Reading; QUANTITIES]> = energies
            .iter()
            .enumerate()
            .map(|(band, energies)| {
                if paths.is_empty() || duration_s <= 0.0 {
                    return std::array::from_fn(|_| Err(NoReading::NoOnset));
                }
                let mut batches = Batches::of(paths, energies, &times_s, duration_s);
                if let Some(added) = &added {
                    batches.exact.add_steps(&added[band]);
                }
                batches.estimates()
            })
            .collect();
        Ok(Self::of(bands, &read))
    }

    fn of(bands: Bands, read: &[[Reading; QUANTITIES]]) -> Self {
        let pick = |quantity: usize| PerBand::from_fn(bands, |band| read[band][quantity].clone());
        Self {
            edt_s: pick(0),
            t20_s: pick(1),
            t30_s: pick(2),
            c50_db: pick(3),
            c80_db: pick(4),
            d50: pick(5),
            centre_time_s: pick(6),
            drr_db: pick(7),
        }
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
        self.t30_s.bands()
    }
}

/// When each path arrives after the first one, and how long paths were looked for after that (s).
fn arrival_times(paths: &PathSet, conditions: &Conditions) -> Result<(Vec<f64>, f64), Error> {
    let first_m = paths.lengths_m().iter().copied().fold(f32::INFINITY, f32::min);
    let speed_m_s = conditions.air.speed_of_sound_m_s();
    let duration_s = (paths.max_length_m() - f64::from(first_m)) / speed_m_s;
    let mut times_s: Vec<f64> =
        paths.lengths_m().iter().map(|&length| f64::from(length - first_m) / speed_m_s).collect();
    if let Some(delays_s) = paths.delays_s(conditions)? {
        times_s.iter_mut().zip(delays_s).for_each(|(time_s, delay_s)| *time_s += delay_s);
        let first_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
        // What a law delays beyond the end never arrives: longer paths would arrive there, too, and were not looked for.
        let arrives = |time_s: f64| if time_s < duration_s + STEP_S { time_s } else { f64::INFINITY };
        times_s.iter_mut().for_each(|time_s| *time_s = arrives(*time_s - first_s));
    }
    Ok((times_s, duration_s))
}

/// Steps of the decay curve.
fn steps_in(duration_s: f64) -> usize {
    ((duration_s / STEP_S).ceil() as usize).max(1)
}

/// Energy that laws add in each step after the first arrival, `[band][step]`.
fn added_energy(
    paths: &PathSet,
    conditions: &Conditions,
    duration_s: f64,
) -> Result<Option<Vec<Vec<f64>>>, Error> {
    if conditions.laws.is_none() || paths.is_empty() || duration_s <= 0.0 {
        return Ok(None);
    }
    let first_s = paths.first_arrival_s(conditions)?;
    paths.added_after(conditions, first_s, (0.0, STEP_S), steps_in(duration_s))
}

/// What the parameters of one band need to know of energy over time; energies of different rays add up.
#[derive(Clone)]
struct Sums {
    /// Energy per step.
    steps: Vec<f64>,
    /// Energy within the direct sound, 50 ms and 80 ms.
    within: [f64; 3],
    /// Energy times time of arrival.
    moment: f64,
}

const LIMITS_S: [f64; 3] = [DIRECT_S, 0.050, 0.080];

impl Sums {
    fn silent(steps: usize) -> Self {
        Self { steps: vec![0.0; steps], within: [0.0; 3], moment: 0.0 }
    }

    fn add(&mut self, time_s: f64, energy: f64) {
        // Paths end with their set's length; rounding may carry the last of them one step further.
        if time_s == f64::INFINITY {
            return;
        }
        let step = ((time_s / STEP_S) as usize).min(self.steps.len() - 1);
        self.steps[step] += energy;
        for (sum, limit_s) in self.within.iter_mut().zip(LIMITS_S) {
            if time_s < limit_s {
                *sum += energy;
            }
        }
        self.moment += energy * time_s;
    }

    /// Adds energy that comes evenly within each step.
    fn add_steps(&mut self, energies: &[f64]) {
        for (step, &energy) in energies.iter().enumerate() {
            self.add((step as f64 + 0.5) * STEP_S, energy);
        }
    }

    fn accumulate(&mut self, other: &Self, factor: f64) {
        self.steps.iter_mut().zip(&other.steps).for_each(|(sum, e)| *sum += factor * e);
        self.within.iter_mut().zip(other.within).for_each(|(sum, e)| *sum += factor * e);
        self.moment += factor * other.moment;
    }

    /// Energy that follows the last step, and how long after it on average (s): the last steps' decay goes on.
    fn tail(&self) -> (f64, f64) {
        let window = (self.steps.len() / TAIL_SHARE).max(1);
        let sum = |from_end: usize| -> f64 {
            let end = self.steps.len().saturating_sub(from_end);
            self.steps[end.saturating_sub(window)..end].iter().sum()
        };
        let (before, last) = (sum(window), sum(0));
        if last <= 0.0 {
            return (0.0, 0.0);
        }
        let fall = (last / before).min(SLOWEST_FALL);
        (last * fall / (1.0 - fall), -(window as f64) * STEP_S / fall.ln())
    }

    /// All quantities, in the order of [`PathParameters`].
    fn quantities(&self) -> [Result<f64, NoReading>; QUANTITIES] {
        let (tail, tail_delay_s) = self.tail();
        let duration_s = self.steps.len() as f64 * STEP_S;
        let total = self.steps.iter().sum::<f64>() + tail;
        if total <= 0.0 {
            return std::array::from_fn(|_| Err(NoReading::NoOnset));
        }
        let curve = EnergyDecayCurve::without_noise(&self.steps, STEP_S, 0.0, tail);
        let decay_time = |start_db: f64, end_db: f64| {
            let (needed_db, available_db) = (TAIL_MARGIN_DB - end_db, 10.0 * (total / tail).log10());
            if available_db < needed_db {
                return Err(NoReading::DynamicRange { needed_db, available_db });
            }
            curve.decay_time_s(start_db, end_db)
        };
        let early_to_late_db = |limit: usize| {
            if duration_s < LIMITS_S[limit] {
                return Err(NoReading::TooShort { needed_s: LIMITS_S[limit], available_s: duration_s });
            }
            let (early, late) = (self.within[limit], total - self.within[limit]);
            let least = LEAST_SHARE * total;
            let below_db = |e: f64| if e > 0.0 { 10.0 * (total / e).log10() } else { f64::INFINITY };
            match early.min(late) {
                faint if faint < least => {
                    let (needed_db, available_db) = (below_db(faint), below_db(least));
                    Err(NoReading::DynamicRange { needed_db, available_db })
                }
                _ => Ok(10.0 * (early / late).log10()),
            }
        };
        let centre_s = (self.moment + tail * (duration_s + tail_delay_s)) / total;
        [
            decay_time(0.0, -10.0),
            decay_time(-5.0, -25.0),
            decay_time(-5.0, -35.0),
            early_to_late_db(1),
            early_to_late_db(2),
            early_to_late_db(1).map(|_| self.within[1] / total),
            Ok(centre_s),
            early_to_late_db(0),
        ]
    }
}

/// The sums of each batch of rays, and of all exact paths.
struct Batches {
    exact: Sums,
    sampled: Vec<Sums>,
}

impl Batches {
    fn of(paths: &PathSet, energies: &[f32], times_s: &[f64], duration_s: f64) -> Self {
        let steps = steps_in(duration_s);
        let sampled = vec![Sums::silent(steps); usize::from(paths.batch_count())];
        let mut batches = Self { exact: Sums::silent(steps), sampled };
        for (i, (&energy, &time_s)) in energies.iter().zip(times_s).enumerate() {
            let sums = match paths.batch(i) {
                None => &mut batches.exact,
                Some(batch) => &mut batches.sampled[usize::from(batch)],
            };
            sums.add(time_s, f64::from(energy));
        }
        batches
    }

    /// The value from all rays, and the jackknife standard error from leaving out one batch after another (Efron 1982): exact
    /// paths stay, the other batches stand in for the one that is left out.
    fn estimates(&self) -> [Reading; QUANTITIES] {
        let n = self.sampled.len() as f64;
        let mut sampled = Sums::silent(self.exact.steps.len());
        self.sampled.iter().for_each(|batch| sampled.accumulate(batch, 1.0));
        let with = |rays: &Sums, factor: f64| {
            let mut sums = self.exact.clone();
            sums.accumulate(rays, factor);
            sums
        };
        let values = with(&sampled, 1.0).quantities();
        let replicates: Vec<_> = self
            .sampled
            .iter()
            .map(|left_out| {
                let mut rest = sampled.clone();
                rest.accumulate(left_out, -1.0);
                // Rounding of the difference.
                rest.steps.iter_mut().for_each(|e| *e = e.max(0.0));
                with(&rest, n / (n - 1.0)).quantities()
            })
            .collect();
        std::array::from_fn(|quantity| {
            let value = values[quantity].clone()?;
            let shift = |replicate: &[Result<f64, NoReading>; QUANTITIES]| {
                replicate[quantity].clone().map(|without| without - value)
            };
            let shifts: Vec<f64> = replicates.iter().map(shift).collect::<Result<_, NoReading>>()?;
            let mean = shifts.iter().sum::<f64>() / n;
            let scatter: f64 = shifts.iter().map(|s| (s - mean) * (s - mean)).sum();
            let estimate = Estimate::new(value, ((n - 1.0) / n * scatter).sqrt());
            let relative_error = estimate.standard_error / value;
            if quantity < DECAY_TIMES && relative_error > LARGEST_RELATIVE_ERROR {
                return Err(NoReading::Uncertain { relative_error, largest: LARGEST_RELATIVE_ERROR });
            }
            Ok(estimate)
        })
    }
}
