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
        if measured.table.is_some() {
            continue;
        }
        // Energies relative to the direct sound, by band and reflection.
        let energies: Vec<Vec<f64>> = (0..survey.bands.len())
            .map(|band| {
                let one = || {
                    relative_energies(
                        survey,
                        simulation,
                        (pair, assignment[pair], band),
                        (cases, values),
                        absorption,
                    )
                };
                if is_fast(survey.bands, band) { one() } else { Vec::new() }
            })
            .collect();
        // Times in the file, the direct sound where it was found.
        let times: Vec<f64> = reflections
            .iter()
            .zip(&shift_s[pair])
            .map(|(s, shift)| measured.direct_s + s.after_direct_s + shift - shift_s[pair][0])
            .collect();
        for (own, reflection) in reflections.iter().enumerate().filter(|(_, s)| s.order == 1) {
            let Some((place_m, plane)) = place_and_plane(survey, pair, reflection) else { continue };
            let told = weigh((observations, measured), &energies, &times, own, time_sd_s(survey, pair));
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

/// How probable (logarithms, in nats) what a gate holds is with its reflection and without it; none where no band can tell.
fn weigh(
    (observations, measured): (&Observations, &Measured),
    energies: &[Vec<f64>],
    times: &[f64],
    own: usize,
    time_sd_s: f64,
) -> Option<(f64, f64)> {
    let (mut there, mut gone, mut told) = (0.0, 0.0, 0usize);
    for (band, energies) in energies.iter().enumerate().filter(|(_, e)| !e.is_empty()) {
        let pulse = &observations.pulses[band];
        let half_s = HALF_BANDWIDTH_TIMES / pulse.bandwidth_hz;
        let at_direct = measured.early.gate(band, measured.direct_s, half_s);
        let at_own = measured.early.gate(band, times[own], half_s);
        let (Some(reference), Some(energy)) = (at_direct.filter(|e| *e > 0.0), at_own) else { continue };
        let Some([present, missing]) = expected(pulse, energies, times, own, (half_s, time_sd_s)) else {
            continue;
        };
        let of_direct = pulse.before(half_s) - pulse.before(-half_s);
        let ratio = energy / reference * of_direct;
        there += ln_gamma_density(ratio, present);
        gone += ln_gamma_density(ratio, missing);
        told += 1;
    }
    if told == 0 {
        return None;
    }
    let even = -(told as f64) * ODD_RANGE.ln();
    let odd = add(gone, even) + (0.5 * ODD_SHARE).ln();
    let present_nats = add(there + (1.0 - ODD_SHARE).ln(), odd);
    Some((present_nats, add(gone + (1.0 - ODD_SHARE).ln(), even + ODD_SHARE.ln())))
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
        l + state.group_hits.iter().zip(&change).map(|(hits, c)| hits[i] * c).sum::<f64>()
    };
    state.ln_energy.iter().enumerate().map(one).collect()
}

/// Mean and variance of the energy in the gate of a single, with it and without; none where it would hardly be missed.
fn expected(
    kernel: &BandPulse,
    energies: &[f64],
    times: &[f64],
    own: usize,
    (half_s, time_sd_s): (f64, f64),
) -> Option<[(f64, f64); 2]> {
    let share = |time_s: f64| {
        let from = times[own] - time_s;
        kernel.before(from + half_s) - kernel.before(from - half_s)
    };
    let mut reach: Vec<(f64, f64, bool)> = Vec::new();
    let mut timing_variance = [0.0; 2];
    for (i, (&energy, &time_s)) in energies.iter().zip(times).enumerate() {
        if (time_s - times[own]).abs() > half_s + kernel.reach_s() {
            continue;
        }
        let inside = share(time_s) * energy;
        if inside > 1e-6 * energies[own] {
            reach.push((time_s, inside, i == own));
            let moved = 0.5 * (share(time_s + time_sd_s) - share(time_s - time_sd_s)) * energy;
            timing_variance[0] += moved * moved;
            timing_variance[1] += if i == own { 0.0 } else { moved * moved };
        }
    }
    let within = reach.iter().find(|r| r.2).map_or(0.0, |r| r.1);
    let all: f64 = reach.iter().map(|r| r.1).sum();
    if within < MIN_SHARE * all {
        return None;
    }
    Some([1.0, LEFT].map(|left| {
        let scaled: Vec<(f64, f64)> =
            reach.iter().map(|r| (r.0, if r.2 { r.1 * left } else { r.1 })).collect();
        let mean: f64 = scaled.iter().map(|r| r.1).sum();
        let mut variance = timing_variance[usize::from(left < 1.0)] + (MODEL_SD * mean).powi(2);
        for (i, &(time_s, energy)) in scaled.iter().enumerate() {
            for &(other_s, more) in &scaled[i + 1..] {
                variance += 4.0 * energy * more * kernel.correlation_sq(other_s - time_s);
            }
        }
        (mean, (variance / (mean * mean)).min(2.0))
    }))
}
