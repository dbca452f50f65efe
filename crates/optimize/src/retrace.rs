//! The fit on one set of rays, held against other rays.

use crate::fit_problem::FitProblem;
use crate::history::{Trace, check_paths};
use crate::prediction::t60_of_traces;
use crate::{Error, MaterialFit, MaterialFitter, Unreachable, UnreachableReason};
use sabine_acoustics::{Bands, Estimate, Material, Observer, OutOfRange, PerBand, Reading, report};
use sabine_paths::PathSet;
use web_time::Instant;

/// What traces a room again, with other random numbers and as many rays as are asked for.
///
/// Any closure of two arguments does; implement the trait to say as well how reverberation is read in the end.
///
/// ```
/// use sabine_acoustics::Error;
/// use sabine_paths::PathSet;
/// use sabine_optimize::Retrace;
/// fn takes(room: &dyn Retrace) -> Result<usize, Error> {
///     Ok(room.trace(7, 2.0)?.len())
/// }
/// // A tracer would cast 2.0 times its usual number of rays here, with seed 7.
/// assert_eq!(takes(&|_seed: u64, _effort: f64| Ok(vec![PathSet::new(1, 10.0)]))?, 1);
/// # Ok::<(), Error>(())
/// ```
pub trait Retrace {
    /// The paths of every source-receiver pair, always the same pairs in the same order and to the same length; `effort` is the number of rays
    /// as a multiple of what is usual. Traces of different seeds must be independent of each other.
    ///
    /// # Errors
    /// Those of the tracer.
    fn trace(&self, seed: u64, effort: f64) -> Result<Vec<PathSet>, sabine_acoustics::Error>;

    /// Reverberation time as it is read in the end, for instance from a response rendered from these paths, in seconds per octave;
    /// `None` where that of the paths' own decay curves is meant. Where the two differ (filters ring, early reflections
    /// interfere), the fit aims so that this one meets the target.
    ///
    /// # Errors
    /// Those of whatever renders and reads.
    fn read_t60_s(
        &self,
        paths: &[PathSet],
        materials: &[Material],
    ) -> Result<Option<PerBand<Reading>>, sabine_acoustics::Error> {
        let _ = (paths, materials);
        Ok(None)
    }
}

impl<F: Fn(u64, f64) -> Result<Vec<PathSet>, sabine_acoustics::Error>> Retrace for F {
    fn trace(&self, seed: u64, effort: f64) -> Result<Vec<PathSet>, sabine_acoustics::Error> {
        self(seed, effort)
    }
}

/// Settings of [`MaterialFitter::fit_t60_retracing`].
#[derive(Clone, Debug, PartialEq)]
pub struct RetraceConfig {
    /// Seed of the first trace; the following take the following seeds.
    pub seed: u64,
    /// Relative Monte-Carlo standard error of T60 that is aimed at, 0.0001 to 0.5: more rays are traced until it is reached.
    pub t60_error: f64,
    /// Most rays that the fit may rest on, as a multiple of those of the first trace, 1 to 1e6: what patience allows. The rays on
    /// which it is verified come on top, half as many.
    pub max_effort: f64,
    /// Most contributions that the fit may rest on, over all pairs, at least 1: what memory allows.
    pub max_paths: usize,
    /// Most fits, at least 1.
    pub max_rounds: usize,
}

impl Default for RetraceConfig {
    /// T60 to 1 %, 16 times the rays of the first trace and three million paths (some 200 MB with six materials), six rounds.
    fn default() -> Self {
        Self { seed: 0, t60_error: 0.01, max_effort: 16.0, max_paths: 3_000_000, max_rounds: 6 }
    }
}

impl RetraceConfig {
    fn check(&self) -> Result<(), OutOfRange> {
        let within = OutOfRange::check;
        within("t60_error", self.t60_error, 1e-4, 0.5, "between 0.0001 and 0.5")?;
        within("max_effort", self.max_effort, 1.0, 1e6, "between 1 and a million")?;
        within("max_paths", self.max_paths as f64, 1.0, 4e9, "between 1 and 4 billion")?;
        within("max_rounds", self.max_rounds as f64, 1.0, 100.0, "between 1 and 100")
    }
}

/// A fit and what other rays say of it.
#[derive(Clone, Debug)]
pub struct RetracedFit {
    /// The fit, on all paths but the independent ones.
    pub fit: MaterialFit,
    /// T60 of the decay curves of [`independent_paths`](Self::independent_paths) with the fitted materials, in seconds; the standard
    /// error is that of these paths alone.
    pub verified_t60_s: PerBand<Reading>,
    /// What [`Retrace::read_t60_s`] reads from them; the same as `verified_t60_s` where it reads nothing of its own.
    pub read_t60_s: PerBand<Reading>,
    /// Paths that the fit has not seen: what a response should be rendered from.
    pub independent_paths: Vec<PathSet>,
    /// Paths that the fit rests on: one set for each trace and pair, with the share of the trace in the sum.
    pub fitted_paths: Vec<(f64, Vec<PathSet>)>,
    /// Octaves that are not verified: other rays say otherwise, or too few rays were allowed to say anything.
    pub not_verified: Vec<NotVerified>,
    /// Number of fits that it took.
    pub rounds: usize,
    /// Seconds spent tracing and reading, and fitting.
    pub seconds: (f64, f64),
}

/// An octave whose target the fit meets on its own paths, but not beyond doubt on others.
#[derive(Clone, Debug, PartialEq)]
pub struct NotVerified {
    /// Nominal centre of the band, in Hz.
    pub band_hz: f64,
    /// The target, in seconds.
    pub target_s: f64,
    /// What is read from independent paths.
    pub read_s: Reading,
    /// Standard error of T60 on the paths of the fit, as a share of it.
    pub relative_error: f64,
}

impl std::fmt::Display for NotVerified {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { band_hz, target_s, read_s, relative_error } = self;
        match read_s {
            Ok(read) => write!(
                f,
                "{band_hz} Hz: other rays give {:.2} +- {:.2} s where {target_s:.2} s were fitted",
                read.value, read.standard_error
            )?,
            Err(reason) => write!(f, "{band_hz} Hz: T60 cannot be read from other rays: {reason}")?,
        }
        write!(f, "; the rays of the fit leave it uncertain by {:.1} %", 100.0 * relative_error)
    }
}

/// Name of this work to an observer.
const STAGE: &str = "fit and verify";
/// Rays are added only where they are missing by this factor: errors of errors are as large.
const WORTHWHILE: f64 = 1.5;
/// Deviation of independent rays, in standard errors, that is no accident.
const NO_ACCIDENT: f64 = 3.0;
/// Deviation of what is read from the target, as a share of it, that is corrected.
const OFF: f64 = 0.015;
/// Deviation that is said not to be verified: one just-noticeable difference (ISO 3382-1, annex A).
const MISSED: f64 = 0.05;
/// Most by which the aim is moved to meet the target in what is read, as a factor.
const LARGEST_CORRECTION: f64 = 1.5;

impl MaterialFitter {
    /// As [`MaterialFitter::fit_t60`], tracing until the rays are enough, and verified on rays that the fit has not seen.
    ///
    /// Paths hold for any absorption, so no trace is lost: a new one is added to those before, and the fit rests on all. What
    /// makes old paths too few is that absorption changes which of them carry the decay. Each round fits, and
    /// 1. traces more, as much as the standard errors of T60 ask for; else
    /// 2. traces other rays, half as many as the fit has, and reads T60 from them. Where they contradict the fit by more
    ///    than chance allows, they join it, and others take their place; where what is read in the end differs from the decay curve of the same paths
    ///    ([`Retrace::read_t60_s`]), the aim moves by as much.
    ///
    /// # Errors
    /// As [`MaterialFitter::fit_t60`], those of the tracer, and [`Error::OutOfRange`] for a setting out of range.
    pub fn fit_t60_retracing(
        &self,
        room: &dyn Retrace,
        problem: &FitProblem<'_>,
        target_t60_s: &PerBand<Estimate>,
        config: &RetraceConfig,
        observer: &dyn Observer,
    ) -> Result<RetracedFit, Error> {
        let FitProblem { materials, priors, air, .. } = *problem;
        config.check()?;
        // Before anything is traced; how long the paths are is known only then.
        if let Some(material) = materials.first() {
            self.check_priors(materials, priors)?;
            self.check_t60(target_t60_s, material.bands(), air, f64::INFINITY)?;
        }
        let mut clock = Clock::default();
        let mut seed = config.seed;
        let mut trace = |effort: f64, clock: &mut Clock| {
            seed = seed.wrapping_add(1);
            clock.tracing(|| room.trace(seed.wrapping_sub(1), effort))
        };
        let first = trace(1.0, &mut clock)?;
        check_paths(&first.iter().collect::<Vec<_>>(), materials)?;
        let paths_per_effort = first.iter().map(PathSet::len).sum::<usize>() as f64;
        let largest_effort = config.max_effort.min(config.max_paths as f64 / paths_per_effort).max(1.0);
        let mut pool = Pool { traces: vec![(1.0, first)] };
        let bands = materials.first().map_or(target_t60_s.bands(), Material::bands);
        let target = target_t60_s.resampled(bands);
        let mut aim = target.clone();
        let mut rounds = 0;
        // Stays unseen by the fit until it contradicts it.
        let mut unseen: Option<(f64, Vec<PathSet>)> = None;
        loop {
            rounds += 1;
            report(observer, STAGE, rounds as u64 - 1, config.max_rounds as u64)?;
            let mut fit = clock.fitting(|| self.fit_traces(&pool.shares(), problem, &aim, observer))?;
            for unreachable in &mut fit.unreachable {
                unreachable.as_read(&aim, &target);
            }
            let last = rounds == config.max_rounds;
            let wanted = fit.effort_for(config.t60_error, pool.effort()).min(largest_effort);
            if wanted > WORTHWHILE * pool.effort() && !last {
                let effort = wanted - pool.effort();
                pool.traces.push((effort, trace(effort, &mut clock)?));
                continue;
            }
            let effort = (0.5 * pool.effort()).max(1.0);
            let (effort, independent) = match unseen.take().filter(|(had, _)| *had * WORTHWHILE > effort) {
                Some(unseen) => unseen,
                None => (effort, trace(effort, &mut clock)?),
            };
            let fitted = FitProblem { materials: &fit.materials, ..*problem };
            let verified = self.t60_of(&independent, &fitted)?;
            let read = clock.tracing(|| room.read_t60_s(&independent, &fit.materials))?;
            let verdicts = verdicts(&fit, &aim, &target, &verified, read.as_ref());
            let settled =
                verdicts.iter().flatten().all(|v| !v.contradicted && (v.correction - 1.0).abs() < OFF);
            if last || settled {
                report(observer, STAGE, config.max_rounds as u64, config.max_rounds as u64)?;
                let read_t60_s = read.unwrap_or_else(|| verified.clone());
                let not_verified = not_verified(&fit, &target, &read_t60_s, &verdicts, config.t60_error);
                let fitted_paths = pool.into_shares();
                let seconds = (clock.tracing_s, clock.fitting_s);
                return Ok(RetracedFit {
                    fit,
                    verified_t60_s: verified,
                    read_t60_s,
                    independent_paths: independent,
                    fitted_paths,
                    not_verified,
                    rounds,
                    seconds,
                });
            }
            let moved = |b: usize| {
                let (aim, target) = (aim.values()[b], target.values()[b]);
                let Some(verdict) = &verdicts[b] else { return aim };
                let limits = (target.value / LARGEST_CORRECTION, target.value * LARGEST_CORRECTION);
                let value = (aim.value * verdict.correction).clamp(limits.0, limits.1);
                Estimate::new(value, aim.standard_error)
            };
            aim = PerBand::from_fn(bands, moved);
            let contradicted = verdicts.iter().flatten().any(|v| v.contradicted);
            if contradicted {
                pool.traces.push((effort, independent));
            } else {
                unseen = Some((effort, independent));
            }
        }
    }

    fn t60_of(&self, paths: &[PathSet], problem: &FitProblem<'_>) -> Result<PerBand<Reading>, Error> {
        check_paths(&paths.iter().collect::<Vec<_>>(), problem.materials)?;
        let traces: Vec<Trace<'_>> =
            paths.iter().enumerate().map(|(pair, paths)| Trace { pair, paths, share: 1.0 }).collect();
        let config = self.config();
        t60_of_traces(&traces, problem, config.bin_s, config.range_db)
    }
}

impl MaterialFit {
    fn is_reachable(&self, band_hz: f64) -> bool {
        self.unreachable.iter().all(|u| u.band_hz != band_hz)
    }

    /// Effort with which every reachable T60 has a standard error, if `effort` gave what it has.
    fn effort_for(&self, t60_error: f64, effort: f64) -> f64 {
        let needed =
            self.predicted_t60_s.iter().filter(|(hz, _)| self.is_reachable(*hz)).map(|(_, reading)| {
                let relative = reading.as_ref().map_or(0.0, |t| t.standard_error / t.value);
                effort * (relative / t60_error).powi(2)
            });
        needed.fold(1.0, f64::max)
    }
}

impl Unreachable {
    /// Names the target itself where the aim was another, and what would be read with the closest that was reached.
    fn as_read(&mut self, aim: &PerBand<Estimate>, target: &PerBand<Estimate>) {
        let (Some(aim), Some(target)) = (aim.at_hz(self.band_hz), target.at_hz(self.band_hz)) else { return };
        let factor = target.value / aim.value;
        match &mut self.reason {
            UnreachableReason::AirLimit { limit_s: reached_s, target_s }
            | UnreachableReason::AbsorptionAtUpperBound { reached_s, target_s }
            | UnreachableReason::AbsorptionAtLowerBound { reached_s, target_s }
            | UnreachableReason::AllHeld { reached_s, target_s }
            | UnreachableReason::NothingCloser { reached_s, target_s } => {
                *reached_s *= factor;
                *target_s = target.value;
            }
            UnreachableReason::NoEnergy => {}
        }
    }
}

/// Traces that a fit rests on, each with its effort.
struct Pool {
    traces: Vec<(f64, Vec<PathSet>)>,
}

impl Pool {
    fn effort(&self) -> f64 {
        self.traces.iter().map(|(effort, _)| effort).sum()
    }

    fn shares(&self) -> Vec<Trace<'_>> {
        let total = self.effort();
        self.traces
            .iter()
            .flat_map(|(effort, sets)| {
                let share = effort / total;
                sets.iter().enumerate().map(move |(pair, paths)| Trace { pair, paths, share })
            })
            .collect()
    }

    fn into_shares(self) -> Vec<(f64, Vec<PathSet>)> {
        let total = self.effort();
        self.traces.into_iter().map(|(effort, paths)| (effort / total, paths)).collect()
    }
}

/// What independent rays say of a band.
struct Verdict {
    /// They contradict the fit by more than chance allows.
    contradicted: bool,
    /// Factor by which the aim should move.
    correction: f64,
}

/// One for each band of the fit; `None` where the target is out of reach, or nothing can be said.
fn verdicts(
    fit: &MaterialFit,
    aim: &PerBand<Estimate>,
    target: &PerBand<Estimate>,
    verified: &PerBand<Reading>,
    read: Option<&PerBand<Reading>>,
) -> Vec<Option<Verdict>> {
    let verdict = |(b, (band_hz, verified)): (usize, (f64, &Reading))| {
        let predicted =
            fit.predicted_t60_s.values()[b].as_ref().ok().filter(|_| fit.is_reachable(band_hz))?;
        let verified = verified.as_ref().ok()?;
        let error = predicted.standard_error.hypot(verified.standard_error);
        let off = (verified.value - predicted.value).abs();
        // What is read against the decay curve of the same paths: the accidents of the rays cancel.
        let reading = read.and_then(|r| r.at_hz(band_hz)).and_then(|r| r.as_ref().ok());
        let wanted_s = target.values()[b].value;
        let correction = reading.map_or(1.0, |r| {
            let expected = aim.values()[b].value * r.value / verified.value;
            wanted_s / expected
        });
        let contradicted = off > NO_ACCIDENT * error && off > OFF * predicted.value;
        Some(Verdict { contradicted, correction })
    };
    verified.iter().enumerate().map(verdict).collect()
}

fn not_verified(
    fit: &MaterialFit,
    target: &PerBand<Estimate>,
    read: &PerBand<Reading>,
    verdicts: &[Option<Verdict>],
    t60_error: f64,
) -> Vec<NotVerified> {
    let mut found = Vec::new();
    let octaves: Bands = target.bands();
    for (b, verdict) in verdicts.iter().enumerate() {
        let band_hz = octaves.nominal_hz(b);
        if !fit.is_reachable(band_hz) {
            continue;
        }
        let target_s = target.values()[b].value;
        let Some(read_s) = read.at_hz(band_hz) else { continue };
        let predicted = &fit.predicted_t60_s.values()[b];
        let relative_error = predicted.as_ref().map_or(f64::INFINITY, |t| t.standard_error / t.value);
        let off = read_s.as_ref().map_or(f64::INFINITY, |r| (r.value / target_s - 1.0).abs());
        let contradicted = verdict.as_ref().is_some_and(|v| v.contradicted);
        if contradicted || off > MISSED || relative_error > WORTHWHILE * t60_error {
            found.push(NotVerified { band_hz, target_s, read_s: read_s.clone(), relative_error });
        }
    }
    found
}

#[derive(Default)]
struct Clock {
    tracing_s: f64,
    fitting_s: f64,
}

impl Clock {
    fn tracing<T>(&mut self, work: impl FnOnce() -> T) -> T {
        timed(&mut self.tracing_s, work)
    }

    fn fitting<T>(&mut self, work: impl FnOnce() -> T) -> T {
        timed(&mut self.fitting_s, work)
    }
}

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds += start.elapsed().as_secs_f64();
    result
}
