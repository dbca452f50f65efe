//! What a receiver hears with given materials, read from the paths.

use crate::Error;
use crate::decay::{DB_PER_NEPER, slope_with_sensitivity};
use crate::expansion::Bins;
use crate::fit_problem::FitProblem;
use crate::history::{History, variance_of_sum};
use crate::history::{Trace, Traces, Unabsorbed, by_pair, check_paths, rigid};
use rayon::prelude::*;
use sabine_acoustics::{Air, EnergyDecayCurve, Estimate, Material, NoReading, PerBand, Reading};
use sabine_paths::{Conditions, PathSet};

/// Early sound ends this long after the direct sound, in seconds (ISO 3382-1, A.2.3: speech).
const EARLY_S: f64 = 0.05;

/// One side of a [`PredictedChange`], or the difference of both; standard errors are those of the paths (Monte Carlo). For a single
/// set of materials `sabine_paths::PathParameters` reads more.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomPrediction {
    /// Reverberation time over -5 to -35 dB of the decay curve, in seconds.
    pub t60_s: PerBand<Reading>,
    /// Early-to-late energy ratio at 50 ms after the direct sound, in dB.
    pub c50_db: PerBand<Reading>,
    /// Share of the energy within 50 ms after the direct sound, 0 to 1.
    pub d50: PerBand<Reading>,
}

/// A prediction before and after a change of materials on the same paths, and the difference.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedChange {
    /// With the first materials.
    pub before: RoomPrediction,
    /// With the second.
    pub after: RoomPrediction,
    /// After less before. As both are read from the same paths, their errors partly cancel: the standard error of the
    /// difference is smaller than those of its parts suggest.
    pub difference: RoomPrediction,
}

impl PredictedChange {
    /// Compares two sets of materials, which may differ in scattering too where the tracer sampled both kinds of reflection.
    ///
    /// # Errors
    /// For paths and materials that do not belong together.
    pub fn new(paths: &PathSet, before: &[Material], after: &[Material], air: &Air) -> Result<Self, Error> {
        check_paths(&[paths], before)?;
        let unabsorbed = || Unabsorbed::Air(air.energy_exponent_per_m(before[0].bands()));
        Self::between(History::new(paths, air, BIN_S), paths, (before, &unabsorbed()), (after, &unabsorbed()))
    }

    /// The same under conditions, with their materials before and others after: laws, another attenuation, directional ends.
    ///
    /// # Errors
    /// As [`PredictedChange::new`]; a law that has no value on some path.
    pub fn under(paths: &PathSet, before: &Conditions<'_>, after: &[Material]) -> Result<Self, Error> {
        check_paths(&[paths], before.materials)?;
        let unabsorbed = |materials: &[Material]| -> Result<Unabsorbed, Error> {
            Ok(Unabsorbed::Under(paths.energies(&before.with_materials(&rigid(materials)?))?))
        };
        let delays_s = paths.delays_s(before)?;
        let history = History::delayed(paths, before.air, delays_s.as_deref(), BIN_S);
        let sides = (unabsorbed(before.materials)?, unabsorbed(after)?);
        Self::between(history, paths, (before.materials, &sides.0), (after, &sides.1))
    }

    /// Between two sets of materials, each with the energies of the paths if it absorbed nothing.
    fn between(
        history: History,
        paths: &PathSet,
        (before, unabsorbed_before): (&[Material], &Unabsorbed),
        (after, unabsorbed_after): (&[Material], &Unabsorbed),
    ) -> Result<Self, Error> {
        check_paths(&[paths], after)?;
        let bands = before[0].bands();
        if after[0].bands() != bands {
            let (left, right) = (bands, after[0].bands());
            return Err(sabine_acoustics::Error::BandMismatch { left, right }.into());
        }
        let direct_s = history.times_s.iter().fold(f64::INFINITY, |first, t| first.min(*t));
        let read = |materials: &[Material],
                    unabsorbed: &Unabsorbed,
                    b: usize|
         -> Result<[Linear; 3], Error> {
            let weights = history.weights(paths, materials, unabsorbed, b, 1.0)?;
            let absorption: Vec<f64> = materials.iter().map(|m| m.absorption().values()[b]).collect();
            let bins = Bins::of(&vec![(&history, weights.clone())], &absorption);
            Ok(functionals(&bins, direct_s).map(|reading| Linear {
                value: reading.as_ref().map(|(value, _)| *value).map_err(NoReading::clone),
                parts: reading
                    .map_or_else(|_| Vec::new(), |(_, by)| history.batch_sums(&weights, &absorption, &by)),
            }))
        };
        let all = (0..bands.len())
            .into_par_iter()
            .map(|b| Ok((read(before, unabsorbed_before, b)?, read(after, unabsorbed_after, b)?)))
            .collect::<Result<Vec<_>, Error>>()?;
        let collect = |of: &dyn Fn(&Both, usize) -> Reading| {
            let column = |i: usize| PerBand::from_fn(bands, |b| of(&all[b], i));
            RoomPrediction { t60_s: column(0), c50_db: column(1), d50: column(2) }
        };
        Ok(Self {
            before: collect(&|(before, _), i| before[i].reading()),
            after: collect(&|(_, after), i| after[i].reading()),
            difference: collect(&|(before, after), i| after[i].less(&before[i])),
        })
    }
}

/// Width of the time bins, in seconds.
const BIN_S: f64 = 1e-3;

/// T60, C50 and D50 with the materials before and after.
type Both = ([Linear; 3], [Linear; 3]);

/// A number read from energies, and what each batch of rays adds to it to first order.
struct Linear {
    value: Result<f64, NoReading>,
    parts: Vec<f64>,
}

impl Linear {
    fn reading(&self) -> Reading {
        Ok(Estimate::new(self.value.clone()?, variance_of_sum(&self.parts).sqrt()))
    }

    fn less(&self, other: &Self) -> Reading {
        let difference = self.value.clone()? - other.value.clone()?;
        let parts: Vec<f64> = self.parts.iter().zip(&other.parts).map(|(a, b)| a - b).collect();
        Ok(Estimate::new(difference, variance_of_sum(&parts).sqrt()))
    }
}

/// T60, C50 and D50 with their derivatives by the energy of each bin.
fn functionals(bins: &Bins, direct_s: f64) -> [Result<(f64, Vec<f64>), NoReading>; 3] {
    let count = bins.energy.len();
    let t60 = || {
        // ISO's own reading says whether there is one.
        EnergyDecayCurve::from_energy(&bins.energy, bins.bin_s).decay_time_s(-5.0, -35.0)?;
        let mut by = vec![0.0; count];
        let slope = slope_with_sensitivity(&bins.energy, bins.bin_s, (-5.0, -35.0), &mut by)
            .ok_or(NoReading::NoDecay)?;
        by.iter_mut().for_each(|b| *b *= 60.0 / (slope * slope));
        Ok((-60.0 / slope, by))
    };
    // The bin in which early sound ends counts in part.
    let edge = (direct_s + EARLY_S) / bins.bin_s;
    let early_share = |j: usize| (edge - j as f64).clamp(0.0, 1.0);
    let early: f64 = bins.energy.iter().enumerate().map(|(j, e)| early_share(j) * e).sum();
    let total: f64 = bins.energy.iter().sum();
    let late = total - early;
    let needed_s = direct_s + EARLY_S;
    let available_s = count as f64 * bins.bin_s;
    let ratios = if total.is_nan() || total <= 0.0 {
        Err(NoReading::NoOnset)
    } else if available_s <= needed_s {
        Err(NoReading::TooShort { needed_s, available_s })
    } else if late <= 0.0 {
        Err(NoReading::NoDecay)
    } else {
        Ok(())
    };
    let c50 = ratios.clone().map(|()| {
        let by = |j: usize| DB_PER_NEPER * (early_share(j) / early - (1.0 - early_share(j)) / late);
        (DB_PER_NEPER * (early / late).ln(), (0..count).map(by).collect())
    });
    let d50 = ratios.map(|()| {
        let by = |j: usize| (early_share(j) - early / total) / total;
        (early / total, (0..count).map(by).collect())
    });
    [t60(), c50, d50]
}

/// Reverberation time of the decay curves of several traces, in every band, the mean over pairs.
pub(crate) fn t60_of_traces(
    traces: &[Trace<'_>],
    problem: &FitProblem<'_>,
    bin_s: f64,
    range_db: (f64, f64),
) -> Result<PerBand<Reading>, Error> {
    let materials = problem.materials;
    let bands = materials[0].bands();
    let (histories, unabsorbed) = problem.histories(traces, bin_s)?;
    let readings = (0..bands.len())
        .into_par_iter()
        .map(|b| {
            let weighted = histories
                .iter()
                .zip(&unabsorbed)
                .zip(traces)
                .map(|((h, u), t)| Ok((h, h.weights(t.paths, materials, u, b, t.share)?)))
                .collect::<Result<Vec<_>, Error>>()?;
            let pairs: Vec<Traces<&History>> = by_pair(traces, weighted);
            let curve = crate::decay_slope::DecaySlope::new(pairs, range_db);
            let absorption: Vec<f64> = materials.iter().map(|m| m.absorption().values()[b]).collect();
            Ok(curve.reading(&curve.expand(&absorption)))
        })
        .collect::<Result<Vec<Reading>, Error>>()?;
    Ok(PerBand::new(bands, readings)?)
}
