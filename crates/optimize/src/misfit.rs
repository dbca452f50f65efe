//! How far the decay of a simulation is from that of a measured response.

use crate::history::{History, check_paths};
use crate::responses::latencies_s;
use crate::{Error, MeasuredDecay, MeasuredPair};
use sabine_acoustics::{Air, EnergyDecayCurve, EnergyResponse, Material, NoReading, PerBand, Reading};
use sabine_paths::Conditions;
use sabine_scene::TimeZero;

/// Levels below this, re the start, are not compared, in dB: T30 ends there.
const LOWEST_DB: f64 = -35.0;
/// Width of the time bins, in seconds.
const BIN_S: f64 = 1e-3;

/// One measured response against the paths between its source and receiver, in each band.
#[derive(Clone, Debug, PartialEq)]
pub struct DecayMisfit {
    /// T30 of the response, in seconds.
    pub measured_t30_s: PerBand<Reading>,
    /// T30 of the paths, in seconds, as the filters of the measurement pass them: with what leaks in from neighbouring bands.
    pub simulated_t30_s: PerBand<Reading>,
    /// Root mean square difference of the two decay curves, in dB: both start just after the direct sound at 0 dB and are
    /// compared down to -35 dB or the noise, every second of the decay counting alike.
    pub rmse_db: PerBand<Result<f64, NoReading>>,
    /// The curves compared: time after emission in seconds, measured and simulated level in dB; empty where there are none.
    pub curves: PerBand<Vec<(f64, f64, f64)>>,
}

impl DecayMisfit {
    /// Compares a response with what its paths give with these materials.
    ///
    /// # Errors
    /// For paths and materials that do not belong together or have other bands than the response.
    pub fn new(
        pair: MeasuredPair<'_>,
        time_zero: TimeZero,
        materials: &[Material],
        air: &Air,
    ) -> Result<Self, Error> {
        Self::under(pair, time_zero, &Conditions::new(materials, air))
    }

    /// The same under conditions: laws, another attenuation, directional ends.
    ///
    /// # Errors
    /// As [`DecayMisfit::new`]; a law that has no value on some path.
    pub fn under(
        pair: MeasuredPair<'_>,
        time_zero: TimeZero,
        conditions: &Conditions<'_>,
    ) -> Result<Self, Error> {
        let Conditions { materials, air, .. } = *conditions;
        check_paths(&[pair.paths], materials)?;
        let bands = pair.measured.bands();
        if materials[0].bands() != bands {
            let (left, right) = (bands, materials[0].bands());
            return Err(sabine_acoustics::Error::BandMismatch { left, right }.into());
        }
        let delays_s = pair.paths.delays_s(conditions)?;
        let history = History::delayed(pair.paths, air, delays_s.as_deref(), BIN_S);
        let latency_s = latencies_s(&[pair], std::slice::from_ref(&history), time_zero)[0];
        let energy = pair.paths.energy_response(conditions, BIN_S)?;
        let filtered = filtered(pair.measured, &energy, latency_s);
        let simulated_t30_s = PerBand::from_fn(bands, |b| {
            let t30 = EnergyDecayCurve::from_energy(&filtered[b], BIN_S).decay_time_s(-5.0, -35.0)?;
            Ok(sabine_acoustics::Estimate::exact(t30))
        });
        let curves = |b: usize| -> Result<Vec<(f64, f64, f64)>, NoReading> {
            let decay = pair.measured.band(b).as_ref().map_err(NoReading::clone)?;
            let remaining = EnergyDecayCurve::from_energy(&filtered[b], BIN_S);
            let at = |t: f64| energy_after(&remaining, t);
            let start = at(decay.edges_s[0] - latency_s);
            let level = decay.level_db();
            let points = decay.edges_s.iter().zip(level).map(|(t, measured)| {
                let t = t - latency_s;
                (t, measured, 10.0 * (at(t) / start).log10())
            });
            Ok(points.take_while(|p| p.1 >= LOWEST_DB && p.2.is_finite()).collect())
        };
        let rmse = |b: usize| {
            let points = curves(b)?;
            if points.len() < 3 {
                return Err(NoReading::NoDecay);
            }
            let square = |p: &[(f64, f64, f64)]| {
                let at = |i: usize| (p[i].1 - p[i].2).powi(2);
                0.5 * (at(0) + at(1)) * (p[1].0 - p[0].0)
            };
            let duration_s = points[points.len() - 1].0 - points[0].0;
            Ok((points.windows(2).map(square).sum::<f64>() / duration_s).sqrt())
        };
        Ok(Self {
            measured_t30_s: pair.measured.t30_s().clone(),
            simulated_t30_s,
            rmse_db: PerBand::from_fn(bands, rmse),
            curves: PerBand::from_fn(bands, |b| curves(b).unwrap_or_default()),
        })
    }
}

/// Energy still to come at a time after the emission, straight between the edges of bins.
fn energy_after(curve: &EnergyDecayCurve, time_s: f64) -> f64 {
    let place = (time_s / BIN_S).max(0.0);
    let of = |i: usize| curve.remaining().get(i).copied().unwrap_or(0.0);
    let (i, part) = (place as usize, place.fract());
    of(i) * (1.0 - part) + of(i + 1) * part
}

/// Energies of all bands as the filters pass them, each in the units of its own paths. How much louder a neighbour is measured to be than
/// the paths say counts; where it cannot be read, it is taken to be as loud as the band itself.
fn filtered(measured: &MeasuredDecay, energy: &EnergyResponse, latency_s: f64) -> Vec<Vec<f64>> {
    let count = measured.bands().len();
    let gain = |b: usize| -> Option<f64> {
        let decay = measured.band(b).as_ref().ok()?;
        let curve = EnergyDecayCurve::from_energy(energy.band(b), BIN_S);
        let [from_s, to_s] = [decay.edges_s.first()?, decay.edges_s.last()?].map(|t| t - latency_s);
        let simulated = energy_after(&curve, from_s) - energy_after(&curve, to_s);
        (simulated > 0.0).then(|| decay.energy.iter().sum::<f64>() / simulated)
    };
    let gains: Vec<Option<f64>> = (0..count).map(gain).collect();
    (0..count)
        .map(|b| {
            let mut sum = energy.band(b).to_vec();
            let leaks = measured.band(b).as_ref().map_or(&[][..], |decay| &decay.leaks);
            for &(other, share) in leaks {
                let louder = gains[other].zip(gains[b]).map_or(1.0, |(other, own)| other / own);
                sum.iter_mut().zip(energy.band(other)).for_each(|(s, e)| *s += share * louder * e);
            }
            sum
        })
        .collect()
}
