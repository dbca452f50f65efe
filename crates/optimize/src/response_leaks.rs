//! What the filters let into each band of its neighbours' energy, and the fit of all bands that takes it into account.
//!
//! An octave filter passes some per cent of the neighbouring octaves. Where a neighbour rings longer, that is the late decay that is
//! measured: taken for the band's own it asks for less absorption than there is. What a band receives depends on the absorption of
//! others, which is found in turn: fit every band, compute the leaks of what was found, fit again, until the materials stay.

use crate::expansion::Bins;
use crate::fit::Unconverged;
use crate::response_band::{BandResponse, ResponseBand, Window};
use crate::response_expansion::exact_energies;
use crate::response_solver::{Solved, solve, solve_where_explained};
use crate::{Error, FitConfig};
use rayon::prelude::*;

/// Most fits of all bands.
const ROUNDS: usize = 24;
/// Relative change of any leak from one fit to the next below which they have converged: 0.01 dB. How far the materials move would say
/// little: in small steps they may go a long way.
const SETTLED: f64 = 0.002;
/// Fits in which it is decided again whether a late decay is left out. Then it stands: near the threshold leaks and decision could make
/// each other change for ever.
const DECIDING: usize = 4;
/// Least and greatest step towards new leaks, 1 being the whole way.
const LEAST_STEP: f64 = 0.3;
const GREATEST_STEP: f64 = 8.0;
/// A gain by which a band's paths have more than this many times the energy that was measured in it is that of paths which do not explain it:
/// it is a mean of ratios, and late bins without energy make it as large as they like.
const MOST_OVER_MEASURED: f64 = 4.0;
/// Change of any material in the last fit, in standard deviations of its prior, that is accepted where leaks have not converged.
const TOLERANCE: f64 = 0.01;

/// Fits groups of this many bands until leaks and materials agree.
pub(crate) fn solve_with_leaks(
    bands: &mut [ResponseBand<'_>],
    together: usize,
    config: &FitConfig,
) -> Result<Vec<Solved>, Error> {
    let mut solved: Vec<Solved> = bands
        .par_chunks_mut(together)
        .map(|bands| solve_where_explained(bands, config, None))
        .collect::<Result<_, Error>>()?;
    let leaking = |band: &ResponseBand<'_>| band.responses.iter().any(|r| !r.leaks.is_empty());
    if !bands.iter().any(leaking) {
        return Ok(solved);
    }
    let mut moved = vec![f64::INFINITY; solved.len()];
    let mut steps = vec![Relaxation::default(); bands.len()];
    for round in 1..ROUNDS {
        let absorption: Vec<Vec<f64>> = solved.iter().flat_map(|s| s.absorption.clone()).collect();
        let gains_db: Vec<Vec<(usize, f64)>> = solved.iter().flat_map(|s| s.gains_db.clone()).collect();
        if set_leaks(bands, &absorption, &gains_db, &mut steps) < SETTLED {
            return Ok(solved);
        }
        let next: Vec<Solved> = bands
            .par_chunks_mut(together)
            .zip(&solved)
            .map(|(bands, before)| {
                let start = Some(&before.absorption[..]);
                if round < DECIDING {
                    return solve_where_explained(bands, config, start);
                }
                Ok(Solved { confined: before.confined.clone(), ..solve(bands, config, start)? })
            })
            .collect::<Result<_, Error>>()?;
        moved = bands
            .chunks(together)
            .zip(solved.iter().zip(&next))
            .map(|(bands, (before, after))| distance(bands, before, after))
            .collect();
        let iterations = solved.iter().map(|s| s.iterations).collect::<Vec<_>>();
        solved = next;
        solved.iter_mut().zip(iterations).for_each(|(s, before)| s.iterations += before);
    }
    for (group, moved) in solved.iter_mut().zip(moved).filter(|(_, moved)| *moved >= TOLERANCE) {
        group.unconverged = group.unconverged.or(Some(Unconverged::StillMoving { deviations: moved }));
    }
    Ok(solved)
}

/// Greatest change of a material, in standard deviations of its prior.
fn distance(bands: &[ResponseBand<'_>], before: &Solved, after: &Solved) -> f64 {
    let of_band = |(band, (before, after)): (&ResponseBand<'_>, (&Vec<f64>, &Vec<f64>))| {
        let change = |k: usize| (after[k] - before[k]).abs() / band.prior.standard_deviation[k];
        band.prior.free().map(change).fold(0.0, f64::max)
    };
    bands.iter().zip(before.absorption.iter().zip(&after.absorption)).map(of_band).fold(0.0, f64::max)
}

/// Energies of a response in one band at an absorption: of the sampled paths by time, of the exact ones one by one.
struct Energies {
    sampled: Vec<f64>,
    exact: Vec<f64>,
    /// Measured over expected energy, where the band was fitted.
    gain: Option<f64>,
}

impl Energies {
    fn of(response: &BandResponse<'_>, absorption: &[f64], gains_db: &[(usize, f64)]) -> Self {
        let gain_db = gains_db.iter().find(|(index, _)| *index == response.index);
        let mut energies = Self {
            sampled: Bins::of(&response.traces, absorption).energy,
            exact: exact_energies(response, absorption).iter().map(|(energy, _)| *energy).collect(),
            gain: None,
        };
        let fitted = &response.windows[..response.fitted];
        let measured: f64 = fitted.iter().map(|window| window.energy).sum();
        let expected: f64 = fitted.iter().map(|window| energies.within(window)).sum();
        // What is not in a band does not leak out of it.
        energies.gain = gain_db.map(|(_, db)| {
            let (gain, by_energy) = (10f64.powf(db / 10.0), measured / expected);
            if gain > MOST_OVER_MEASURED * by_energy { by_energy } else { gain }
        });
        energies
    }

    /// What falls into a bin.
    fn within(&self, window: &Window) -> f64 {
        let sampled = self.sampled[window.from..].iter().zip(&window.shares);
        let exact = window.exact.iter().map(|a| a.share * self.exact[a.place]);
        sampled.map(|(e, share)| e * share).sum::<f64>() + exact.sum::<f64>()
    }
}

/// Takes what other bands have at these absorptions (by band and material) and gains (by band: response, dB) into the bins. The greatest
/// relative change of any of them, as a logarithm.
fn set_leaks(
    bands: &mut [ResponseBand<'_>],
    absorption: &[Vec<f64>],
    gains_db: &[Vec<(usize, f64)>],
    steps: &mut [Relaxation],
) -> f64 {
    let mut greatest = 0.0f64;
    let energies: Vec<Vec<Energies>> = bands
        .par_iter()
        .zip(absorption.par_iter().zip(gains_db))
        .map(|(band, (a, gains))| band.responses.iter().map(|r| Energies::of(r, a, gains)).collect())
        .collect();
    for ((b, band), step) in bands.iter_mut().enumerate().zip(steps) {
        let mut found = Vec::new();
        for (place, response) in band.responses.iter_mut().enumerate() {
            let own = energies[b][place].gain;
            let neighbours: Vec<(f64, &Energies)> = response
                .leaks
                .iter()
                .map(|&(other, share)| {
                    let energies = &energies[other][place];
                    // A source radiates octaves unequally. Where it is not known how much in another one, as much as in this.
                    let louder = energies.gain.zip(own).map_or(1.0, |(other, own)| other / own);
                    (share * louder, energies)
                })
                .collect();
            for window in &response.windows {
                found.push(neighbours.iter().map(|(share, energies)| share * energies.within(window)).sum());
            }
        }
        let windows = band.responses.iter_mut().flat_map(|response| &mut response.windows);
        greatest = greatest.max(step.take(windows.map(|window| &mut window.leak), &found));
    }
    greatest
}

/// How far the leaks of a band go towards those that were computed last: its own gain falls as they rise, and so they are approached
/// slowly. Vector form of Aitken's extrapolation (Irons and Tuck, International Journal for Numerical Methods in Engineering 1 (1969) 275).
#[derive(Clone, Default)]
struct Relaxation {
    /// Step and what was wanted then, as logarithms.
    before: Option<(f64, Vec<f64>)>,
}

impl Relaxation {
    /// Moves leaks towards those found; the greatest distance from one to the other, as a logarithm, infinite where there was none before.
    fn take<'w>(&mut self, leaks: impl Iterator<Item = &'w mut f64>, found: &[f64]) -> f64 {
        let leaks: Vec<&mut f64> = leaks.collect();
        let wanted: Vec<f64> = leaks
            .iter()
            .zip(found)
            .map(|(from, to)| if **from > 0.0 && *to > 0.0 { (to / **from).ln() } else { 0.0 })
            .collect();
        let step = self.before.as_ref().map_or(1.0, |(step, before)| {
            let change = || wanted.iter().zip(before).map(|(now, before)| now - before);
            let along: f64 = change().zip(before).map(|(change, before)| change * before).sum();
            let square: f64 = change().map(|change| change * change).sum();
            if square > 0.0 { (-step * along / square).clamp(LEAST_STEP, GREATEST_STEP) } else { 1.0 }
        });
        let fresh = leaks.iter().zip(found).any(|(from, to)| **from == 0.0 && *to > 0.0);
        let distance =
            if fresh { f64::INFINITY } else { wanted.iter().fold(0.0, |w: f64, x| w.max(x.abs())) };
        for ((leak, to), wanted) in leaks.into_iter().zip(found).zip(&wanted) {
            // The first time there is nothing to start from.
            *leak = if *leak > 0.0 && *to > 0.0 { *leak * (step * wanted).exp() } else { *to };
        }
        self.before = Some((step, wanted)).filter(|(_, wanted)| wanted.iter().any(|w| *w != 0.0));
        distance
    }
}

#[cfg(test)]
mod tests;
