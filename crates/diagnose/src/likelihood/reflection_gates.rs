//! IsolatedReflection early reflections: their energy in a short gate about the instant at which they should come.
//!
//! What a gate holds is predicted from all exact paths that reach into it, each spread as the octave's filter spreads a pulse; its scatter is that
//! of pulses with random signs, as for the time bins. Both are relative to the direct sound, gated in the same way.

use crate::effect::reflection_gate::ReflectionGate;
use crate::effect::{Case, Stage};
use crate::likelihood::parameters::{DecayLayout, assignment};
use crate::observe::band_pulse::BandPulse;
use crate::observe::early_energy::is_fast;
use crate::observe::observations::Observations;
use crate::observe::observed_response::Measured;
use crate::simulate::band_state::BandState;
use crate::simulate::reflection_reweighting::HitChanges;
use crate::simulate::simulation::Simulation;
use crate::simulate::traced_pair::IsolatedReflection;
use crate::simulate::views::BandView;
use crate::statistics::{add, ln_gamma_density};
use crate::survey::Survey;
use sabine_scene::PositionSd;

/// Half of a gate, in units of one over the bandwidth.
const HALF_BANDWIDTH_TIMES: f64 = 0.7;
/// Paths are known this well in time, in seconds: a centimetre of way, which is how well places are known unless the room file says that
/// they are known worse.
const TIME_SD_S: f64 = 3e-5;
/// What a single reflection may be off by for other reasons, as a share of its energy: materials, edges of the gate.
const MODEL_SD: f64 = 0.25;
/// A gate in which the reflection has less than this share of the energy cannot tell whether it is there.
const MIN_SHARE: f64 = 0.5;
/// Share of reflections that are missing, or are of any strength, for reasons of their own.
const ODD_SHARE: f64 = 0.02;
/// Range of the logarithm of energy in which odd ones lie evenly.
const ODD_RANGE: f64 = 9.0;
/// What is left of a reflection that is missing, as a share of its energy: 13 dB.
const LEFT: f64 = 0.05;
/// Relative variance of the energy of Gaussian noise in a gate: one over twice bandwidth and length (S. O. Rice, Bell Syst. Tech. J. 23, 1944).
const GATE_VARIANCE: f64 = 1.0 / (2.0 * HALF_BANDWIDTH_TIMES);
/// Attenuations of a reflection for which gates are weighed, in dB.
pub(crate) const STEPS_DB: [f64; 6] = [0.0, 3.0, 6.0, 10.0, 15.0, 20.0];

/// One reflection of a response that can be told apart, of any order, and how probable what was measured is if something stands in its way.
#[derive(Clone, Debug)]
pub(crate) struct AttenuatedGate {
    /// Its index among the isolated reflections of its pair.
    pub reflection: usize,
    /// Index of its surface among the planes of the survey, if it is the only one.
    pub plane: Option<usize>,
    /// Logarithms, in nats, for each of [`STEPS_DB`].
    pub nats: [f64; STEPS_DB.len()],
}

/// A direct sound as it should be, where that in the response is another sound: its instant in seconds of the file, and its energy in the gate of
/// each band.
#[derive(Clone, Debug)]
pub(crate) struct ExpectedDirect {
    pub time_s: f64,
    pub energy: Vec<f64>,
}

/// What fits say of the reflections: fitted absorption, and how much later than predicted the direct sound and each isolated reflection of a
/// pair come.
#[derive(Clone, Copy)]
pub(crate) struct FittedReflections<'a> {
    pub absorption: &'a [f64],
    pub shift_s: &'a [Vec<f64>],
}

/// Gates of each pair under fitted absorption and the causes at work, weighed for reflections that are attenuated.
pub(crate) fn attenuated(
    observations: &Observations,
    simulation: &Simulation,
    (cases, values): (&[&Case], &[Vec<f64>]),
    fitted: FittedReflections<'_>,
    expected_directs: &[Option<ExpectedDirect>],
) -> Vec<Vec<AttenuatedGate>> {
    let survey = &observations.survey;
    let assignment = assignment(survey.responses.len(), cases.iter().copied());
    let lefts = STEPS_DB.map(|db| 10f64.powf(-0.1 * db));
    let of_pair = |(pair, (reflections, _)): (usize, &(Vec<IsolatedReflection>, Vec<BandState>))| {
        let shift_s = &fitted.shift_s[pair];
        if reflections.first().is_none_or(|s| s.order > 0) || shift_s.len() != reflections.len() {
            return Vec::new();
        }
        let measured = &observations.measured[assignment[pair]];
        let at = (pair, assignment[pair]);
        let energies = fast_energies(survey, simulation, at, (cases, values), fitted.absorption);
        let expected = expected_directs[pair].as_ref();
        let direct_s = expected.map_or(measured.direct_s, |direct| direct.time_s);
        let times = times_s(direct_s, reflections, shift_s);
        let scattered: Vec<Scattered<'_>> =
            (0..survey.bands.len()).map(|band| scattered(simulation, pair, band, direct_s)).collect();
        let one = |(own, reflection): (usize, &IsolatedReflection)| {
            let plane = place_and_plane(survey, pair, reflection).filter(|_| reflection.order == 1);
            let time_sd_s = time_sd_s(survey, pair);
            let source = Weighed {
                observations,
                measured,
                energies: &energies,
                times: &times,
                expected,
                scattered_per_s: &scattered,
            };
            let (by_left, told) = source.by_left(own, time_sd_s, &lefts)?;
            let even = -(told as f64) * ODD_RANGE.ln();
            let odd = add(by_left[STEPS_DB.len() - 1], even) + (0.5 * ODD_SHARE).ln();
            let nats = std::array::from_fn(|i| add(by_left[i] + (1.0 - ODD_SHARE).ln(), odd));
            Some(AttenuatedGate { reflection: own, plane: plane.map(|(_, plane)| plane), nats })
        };
        reflections.iter().enumerate().filter(|(_, s)| s.order > 0).filter_map(one).collect()
    };
    simulation.isolated_reflections.iter().enumerate().map(of_pair).collect()
}

/// Energies of the isolated reflections of a pair over that of the direct sound, in bands in which they can be told apart; empty in others.
fn fast_energies(
    survey: &Survey,
    simulation: &Simulation,
    (pair, response): (usize, usize),
    cases: (&[&Case], &[Vec<f64>]),
    absorption: &[f64],
) -> Vec<Vec<f64>> {
    let one = |band: usize| {
        if !is_fast(survey.bands, band) {
            return Vec::new();
        }
        relative_energies(survey, simulation, (pair, response, band), cases, absorption)
    };
    (0..survey.bands.len()).map(one).collect()
}

/// What comes on no exact path: the predicted energy of a time bin without that of the isolated reflections in it, over that of the direct
/// sound and per second. In the first bin they leave too little to tell: it takes that of the second.
fn scattered(simulation: &Simulation, pair: usize, band: usize, direct_s: f64) -> Scattered<'_> {
    let state = &simulation.states[pair][band];
    let (reflections, alone) = &simulation.isolated_reflections[pair];
    let direct = alone[band].ln_energy.first().map_or(1.0, |ln| ln.exp());
    Box::new(move |time_s| {
        let bins = state.bins;
        let bin = bins.count((time_s - direct_s).max(0.0)).max(1);
        let (begin_s, end_s) = (bins.edge_s(bin), bins.edge_s(bin + 1));
        let Some(all) = state.ln_energy.get(bin) else { return 0.0 };
        let within = |s: &IsolatedReflection| (begin_s..end_s).contains(&s.after_direct_s);
        let exact: f64 = reflections
            .iter()
            .zip(&alone[band].ln_energy)
            .filter(|(s, _)| within(s))
            .map(|(_, ln)| ln.exp())
            .sum();
        ((all.exp() - exact) / direct / bins.width_s).max(0.0)
    })
}

/// Times in the file, given that of the direct sound.
fn times_s(direct_s: f64, reflections: &[IsolatedReflection], shift_s: &[f64]) -> Vec<f64> {
    let one = |(s, shift): (&IsolatedReflection, &f64)| direct_s + s.after_direct_s + shift - shift_s[0];
    reflections.iter().zip(shift_s).map(one).collect()
}

/// Half of the gate of a band, in seconds.
pub(crate) fn half_gate_s(pulse: &BandPulse) -> f64 {
    HALF_BANDWIDTH_TIMES / pulse.bandwidth_hz
}

/// Where the straight lines of departure and arrival meet: the reflection's place.
fn meeting(source: [f64; 3], receiver: [f64; 3], single: &IsolatedReflection) -> [f64; 3] {
    // With s + x d = r + (L - x) a in the mean over both lines.
    let (d, a) = (single.departure, single.arrival);
    let sum: [f64; 3] = std::array::from_fn(|k| d[k] + a[k]);
    let rest: [f64; 3] = std::array::from_fn(|k| receiver[k] - source[k] + single.length_m * a[k]);
    let (up, down) = (0..3).fold((0.0, 0.0), |(u, w), k| (u + sum[k] * rest[k], w + sum[k] * sum[k]));
    let x = up / down.max(1e-12);
    std::array::from_fn(|k| 0.5 * (source[k] + x * d[k] + receiver[k] + (single.length_m - x) * a[k]))
}

/// Gates of all first-order reflections of the pairs that count, under fitted absorption and the causes at work. `shift_s` is how much later
/// than predicted the direct sound and each isolated reflection of a pair come by the fit of the arrival times.
pub(crate) fn gates(
    observations: &Observations,
    simulation: &Simulation,
    cases: &[&Case],
    values: &[Vec<f64>],
    absorption: &[f64],
    shift_s: &[Vec<f64>],
) -> Vec<ReflectionGate> {
    let survey = &observations.survey;
    let assignment = assignment(survey.responses.len(), cases.iter().copied());
    let mut found = Vec::new();
    for (pair, (reflections, _)) in simulation.isolated_reflections.iter().enumerate() {
        if reflections.first().is_none_or(|s| s.order > 0) || shift_s[pair].len() != reflections.len() {
            continue;
        }
        let measured = &observations.measured[assignment[pair]];
        let at = (pair, assignment[pair]);
        let energies = fast_energies(survey, simulation, at, (cases, values), absorption);
        let times = times_s(measured.direct_s, reflections, &shift_s[pair]);
        for (own, reflection) in reflections.iter().enumerate().filter(|(_, s)| s.order == 1) {
            let Some((place_m, plane)) = place_and_plane(survey, pair, reflection) else { continue };
            let source = Weighed {
                observations,
                measured,
                energies: &energies,
                times: &times,
                expected: None,
                scattered_per_s: &[],
            };
            let told = source.present_or_missing(own, time_sd_s(survey, pair));
            if let Some((present_nats, missing_nats)) = told {
                found.push(ReflectionGate { response: pair, place_m, plane, present_nats, missing_nats });
            }
        }
    }
    found
}

/// Energies of the isolated reflections of a pair in one band, over that of the direct sound.
fn relative_energies(
    survey: &Survey,
    simulation: &Simulation,
    (pair, response, band): (usize, usize, usize),
    (cases, values): (&[&Case], &[Vec<f64>]),
    absorption: &[f64],
) -> Vec<f64> {
    let state = &simulation.isolated_reflections[pair].1[band];
    let hit_changes = HitChanges::default();
    let view = BandView {
        survey,
        pair,
        response,
        band,
        state,
        direct_s: simulation.direct_s[pair],
        reference: simulation.reference[band],
        gain: 1.0,
        hit_changes: &hit_changes,
        tables: &simulation.tables,
        own_band: band,
        reflections: true,
        table: None,
    };
    let mut ln = fitted(state, survey, simulation, absorption, band);
    for (case, own) in cases.iter().zip(values).filter(|(c, _)| c.stage == Stage::Room) {
        if let Some(term) = case.decay_term() {
            term.apply(own, &view.with_table(case.slot), &mut ln);
        }
    }
    let direct = ln[0];
    ln.iter().map(|l| (l - direct).exp()).collect()
}

/// How well a pair's paths are known in time.
fn time_sd_s(survey: &Survey, pair: usize) -> f64 {
    let response = &survey.responses[pair];
    let places = [&survey.sources[response.source], &survey.receivers[response.receiver]];
    let worse = places.iter().map(|place| place.position_sd_m / PositionSd::DEFAULT_M).fold(1.0, f64::max);
    worse * TIME_SD_S
}

/// Where a path is reflected, and the plane in which that is; none if it is in no plane of the survey.
fn place_and_plane(
    survey: &Survey,
    pair: usize,
    reflection: &IsolatedReflection,
) -> Option<([f64; 3], usize)> {
    let response = &survey.responses[pair];
    let source = survey.sources[response.source].position_m;
    let receiver = survey.receivers[response.receiver].position_m;
    let place_m = meeting(source, receiver, reflection);
    let normal: [f64; 3] = std::array::from_fn(|k| reflection.departure[k] + reflection.arrival[k]);
    let size = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    let plane = survey.planes.iter().position(|p| {
        let along: f64 = (0..3).map(|k| normal[k] * p.axes[0][k]).sum::<f64>() / size.max(1e-9);
        let [u, v] = p.within(place_m);
        p.distance_m(place_m) < 0.03
            && along.abs() > 0.999
            && (p.extent_m[0][0]..=p.extent_m[0][1]).contains(&u)
            && (p.extent_m[1][0]..=p.extent_m[1][1]).contains(&v)
    })?;
    Some((place_m, plane))
}

/// What gates of a response are weighed by.
struct Weighed<'a> {
    observations: &'a Observations,
    measured: &'a Measured,
    /// Over the direct sound, by band and reflection.
    energies: &'a [Vec<f64>],
    times: &'a [f64],
    /// The direct sound, where it is not in the response.
    expected: Option<&'a ExpectedDirect>,
    /// Scattered energy over that of the direct sound, per second, at an instant of the file, by band; none where it is not asked for.
    scattered_per_s: &'a [Scattered<'a>],
}

type Scattered<'a> = Box<dyn Fn(f64) -> f64 + 'a>;

impl Weighed<'_> {
    /// How probable (logarithms, in nats) what a gate holds is if so much of its reflection is left, and in how many bands; none where no band
    /// can tell.
    fn by_left(&self, own: usize, time_sd_s: f64, lefts: &[f64]) -> Option<(Vec<f64>, usize)> {
        let (mut nats, mut told) = (vec![0.0; lefts.len()], 0usize);
        for (band, energies) in self.energies.iter().enumerate().filter(|(_, e)| !e.is_empty()) {
            let pulse = &self.observations.pulses[band];
            let half_s = half_gate_s(pulse);
            let early = &self.measured.early;
            let at_direct = self.expected.map_or_else(
                || early.gate(band, self.measured.direct_s, half_s),
                |direct| Some(direct.energy[band]),
            );
            let at_own = early.gate(band, self.times[own], half_s);
            let (Some(reference), Some(energy)) = (at_direct.filter(|e| *e > 0.0), at_own) else { continue };
            let widths = (half_s, time_sd_s);
            let left = (lefts, self.scattered_per_s.get(band).map_or(0.0, |of| of(self.times[own])));
            let Some(expected) = expected(pulse, energies, self.times, own, widths, left) else { continue };
            let of_direct = pulse.before(half_s) - pulse.before(-half_s);
            let ratio = energy / reference * of_direct;
            nats.iter_mut().zip(expected).for_each(|(n, e)| *n += ln_gamma_density(ratio, e));
            told += 1;
        }
        (told > 0).then_some((nats, told))
    }

    /// The same with the reflection and without it, odd ones allowed for.
    fn present_or_missing(&self, own: usize, time_sd_s: f64) -> Option<(f64, f64)> {
        let (nats, told) = self.by_left(own, time_sd_s, &[1.0, LEFT])?;
        let (there, gone) = (nats[0], nats[1]);
        let even = -(told as f64) * ODD_RANGE.ln();
        let odd = add(gone, even) + (0.5 * ODD_SHARE).ln();
        let present_nats = add(there + (1.0 - ODD_SHARE).ln(), odd);
        Some((present_nats, add(gone + (1.0 - ODD_SHARE).ln(), even + ODD_SHARE.ln())))
    }
}

/// Logarithms of the isolated reflections' energies at fitted absorption.
fn fitted(
    state: &BandState,
    survey: &Survey,
    simulation: &Simulation,
    absorption: &[f64],
    band: usize,
) -> Vec<f64> {
    let (materials, layout) = (simulation.absorption.len(), DecayLayout::of(survey));
    let change: Vec<f64> = (0..materials)
        .map(|m| {
            ((1.0 - absorption[layout.absorption(m, band)]) / (1.0 - simulation.absorption[m][band])).ln()
        })
        .collect();
    let one = |(i, l): (usize, &f64)| {
        let hits = &state.group_hits[i * materials..(i + 1) * materials];
        l + hits.iter().zip(&change).map(|(n, c)| n * c).sum::<f64>()
    };
    state.ln_energy.iter().enumerate().map(one).collect()
}

/// Mean and variance of the energy in the gate of a single of which so much is left; none where it would hardly be missed.
fn expected(
    kernel: &BandPulse,
    energies: &[f64],
    times: &[f64],
    own: usize,
    (half_s, time_sd_s): (f64, f64),
    (lefts, scattered_per_s): (&[f64], f64),
) -> Option<Vec<(f64, f64)>> {
    let scattered = scattered_per_s * 2.0 * half_s;
    let share = |time_s: f64| {
        let from = times[own] - time_s;
        kernel.before(from + half_s) - kernel.before(from - half_s)
    };
    let mut reach: Vec<(f64, f64, bool)> = Vec::new();
    let (mut timing_variance, mut own_timing) = (0.0, 0.0);
    for (i, (&energy, &time_s)) in energies.iter().zip(times).enumerate() {
        if (time_s - times[own]).abs() > half_s + kernel.reach_s() {
            continue;
        }
        let inside = share(time_s) * energy;
        if inside > 1e-6 * energies[own] {
            reach.push((time_s, inside, i == own));
            let moved = 0.5 * (share(time_s + time_sd_s) - share(time_s - time_sd_s)) * energy;
            *(if i == own { &mut own_timing } else { &mut timing_variance }) += moved * moved;
        }
    }
    let within = reach.iter().find(|r| r.2).map_or(0.0, |r| r.1);
    let all: f64 = reach.iter().map(|r| r.1).sum();
    if within < MIN_SHARE * (all + scattered) {
        return None;
    }
    let one = |&left: &f64| {
        let scaled: Vec<(f64, f64)> =
            reach.iter().map(|r| (r.0, if r.2 { r.1 * left } else { r.1 })).collect();
        let alone: f64 = scaled.iter().map(|r| r.1).sum();
        let mean = alone + scattered;
        // What is as good as missing has no time.
        let moved = if left > LEFT { left * left * own_timing } else { 0.0 };
        let mut variance = timing_variance + moved + (MODEL_SD * mean).powi(2);
        // Noise within the gate, and its interference with what comes alone.
        variance += GATE_VARIANCE * scattered * (scattered + 2.0 * alone);
        for (i, &(time_s, energy)) in scaled.iter().enumerate() {
            for &(other_s, more) in &scaled[i + 1..] {
                variance += 4.0 * energy * more * kernel.correlation_sq(other_s - time_s);
            }
        }
        (mean, (variance / (mean * mean)).min(2.0))
    };
    Some(lefts.iter().map(one).collect())
}
