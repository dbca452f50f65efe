//! How the energy of a measured response decays, in every band, as far as the noise lets one see.

use crate::Error;
use crate::pulse::Pulse;
use sabine_acoustics::{
    Bands, DecayFit, FilterBank, ImpulseResponse, NoReading, PerBand, Reading, RoomParameters,
};

/// What follows the onset by less than this is direct sound, which the source's directivity changes, not decay; in seconds.
const DIRECT_S: f64 = 0.0025;
/// The filter rings for about this long, in units of one over the bandwidth: the decay starts so much later, and no time
/// bin is narrower.
const RINGING: f64 = 1.5;
/// Most time bins. The first are as narrow as the filter allows, for early on single reflections tell single walls; the later
/// ones grow in a geometric series.
const BINS: usize = 64;
/// Fewest time bins that a decay is read from.
const LEAST_BINS: usize = 6;
/// Bands of which a filter passes less than this, as a share of what it passes of its own, are left out: -70 dB.
const MIN_LEAK: f64 = 1e-7;
/// Noise may not exceed this share of what a bin holds.
const MOST_NOISE: f64 = 0.5;

/// A measured response, ready to be fitted: the energy of each octave in time bins from just after the direct sound to where it
/// sinks into the noise, free of that noise, with the number of independent values that each bin holds.
#[derive(Clone, Debug)]
pub struct MeasuredDecay {
    bands: Bands,
    onset_s: f64,
    t30_s: PerBand<Reading>,
    decays: Vec<Result<BinnedDecay, NoReading>>,
}

/// Energy of one band.
#[derive(Clone, Debug)]
pub(crate) struct BinnedDecay {
    /// Edges of the bins in seconds from the first sample, one more than bins.
    pub edges_s: Vec<f64>,
    /// Energy of each bin less the noise; what a unit impulse has within the edges of the band is 1.
    pub energy: Vec<f64>,
    /// Independent values of the band in each bin.
    pub values: Vec<f64>,
    /// Share of the signal in what was measured in each bin, 0 to 1.
    pub signal: Vec<f64>,
    /// How the filter spreads the energy of an instant.
    pub pulse: Pulse,
    /// Other bands, and what the filter passes of the energy of each, as a share of what it passes of the band's own.
    pub leaks: Vec<(usize, f64)>,
    /// Energy after the last bin, by the decay fit.
    pub tail: f64,
}

impl MeasuredDecay {
    /// Measures a response in `bands`. A band that cannot be read keeps the reason and is left out of the fit.
    ///
    /// # Errors
    /// [`Error::NoOnset`] for a response without a direct sound that stands out.
    pub fn new(response: &ImpulseResponse, bands: Bands) -> Result<Self, Error> {
        let parameters = RoomParameters::measure(response, bands)?;
        let onset_s = parameters.onset.clone().map_err(|source| Error::NoOnset { source })?.time_s;
        let rate = f64::from(response.sample_rate_hz());
        let bank = FilterBank::new(bands, response.sample_rate_hz())?;
        let filtered = bank.analyse(response.samples());
        // What the filters leave of a unit impulse, whose energy counts as one in every band.
        let mut impulse = vec![0.0; response.sample_rate_hz() as usize];
        let middle = impulse.len() / 2;
        impulse[middle] = 1.0;
        let impulses = bank.analyse(&impulse);
        let of_band = |b: usize| {
            let fit = parameters.fits.values()[b].as_ref().map_err(NoReading::clone)?;
            let (lower_hz, upper_hz) = bands.edges_hz(b);
            BinnedDecay::new(
                &filtered.values()[b],
                rate,
                onset_s,
                upper_hz - lower_hz,
                (&impulses.values()[b], middle),
                (b, &bank.shares(b)),
                fit,
            )
        };
        let decays = (0..bands.len()).map(of_band).collect();
        Ok(Self { bands, onset_s, t30_s: parameters.t30_s, decays })
    }

    /// The bands.
    pub fn bands(&self) -> Bands {
        self.bands
    }

    /// When the direct sound begins, in seconds from the first sample.
    pub fn onset_s(&self) -> f64 {
        self.onset_s
    }

    /// T30 of the response (ISO 3382-1), in seconds.
    pub fn t30_s(&self) -> &PerBand<Reading> {
        &self.t30_s
    }

    pub(crate) fn band(&self, band: usize) -> &Result<BinnedDecay, NoReading> {
        &self.decays[band]
    }
}

impl BinnedDecay {
    fn new(
        samples: &[f32],
        rate_hz: f64,
        onset_s: f64,
        bandwidth_hz: f64,
        (impulse, middle): (&[f32], usize),
        (band, shares): (usize, &PerBand<f64>),
        fit: &DecayFit,
    ) -> Result<Self, NoReading> {
        let from_s = onset_s + DIRECT_S.max(RINGING / bandwidth_hz);
        let to_s = fit.knee_s().min(samples.len() as f64 / rate_hz);
        let own_share = shares.values()[band];
        let unit_energy = own_share * impulse.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>();
        let leaks = shares.values().iter().map(|share| share / own_share).enumerate();
        let first_s = RINGING / bandwidth_hz;
        let growth = growth((to_s - from_s) / first_s);
        let mut width_s = first_s;
        let mut decay = Self {
            edges_s: Vec::new(),
            energy: Vec::new(),
            values: Vec::new(),
            signal: Vec::new(),
            pulse: Pulse::new(impulse, middle, rate_hz),
            leaks: leaks.filter(|&(other, share)| other != band && share > MIN_LEAK).collect(),
            tail: 0.0,
        };
        let mut end = (from_s * rate_hz).round() as usize;
        loop {
            let from = end;
            let to = from + (width_s * rate_hz).ceil() as usize;
            if to > samples.len() || to as f64 > to_s * rate_hz {
                break;
            }
            let gross: f64 = samples[from..to].iter().map(|&x| f64::from(x) * f64::from(x)).sum();
            let noise = fit.noise_power() * (to - from) as f64;
            if noise > MOST_NOISE * gross {
                break;
            }
            let signal = 1.0 - noise / gross;
            decay.edges_s.push(from as f64 / rate_hz);
            decay.energy.push((gross - noise) / unit_energy);
            // Two degrees of freedom for each independent value of the band, of which there are B dt.
            decay.values.push(bandwidth_hz * (to - from) as f64 / rate_hz);
            decay.signal.push(signal);
            end = to;
            width_s *= growth;
        }
        if decay.energy.len() < LEAST_BINS {
            let (needed_s, available_s) = (LEAST_BINS as f64 * first_s, (to_s - from_s).max(0.0));
            return Err(NoReading::TooShort { needed_s, available_s });
        }
        decay.edges_s.push(end as f64 / rate_hz);
        // 60 dB are ln(10^6) time constants.
        let after = |slope: &sabine_acoustics::Slope| {
            let tau_s = slope.t60_s.value / 1e6f64.ln();
            slope.power * (-(end as f64 / rate_hz - fit.start_s()) / tau_s).exp() * tau_s * rate_hz
        };
        decay.tail = fit.slopes().iter().map(after).sum::<f64>() / unit_energy;
        Ok(decay)
    }

    /// The same in bins of at least this width, in seconds: neighbours are joined from the start on, and what is left over at the end
    /// joins the last.
    pub fn widened(&self, least_s: f64) -> Self {
        let mut wide = Self {
            edges_s: vec![self.edges_s[0]],
            energy: Vec::new(),
            values: Vec::new(),
            signal: Vec::new(),
            pulse: self.pulse.clone(),
            leaks: self.leaks.clone(),
            tail: self.tail,
        };
        let bins = self.energy.len();
        let mut from = 0;
        while from < bins {
            // Half a sample forgives rounding.
            let enough = |to: usize| self.edges_s[to] - self.edges_s[from] >= least_s * (1.0 - 1e-6);
            let to = (from + 1..=bins).find(|&to| enough(to)).unwrap_or(bins);
            let to = if self.edges_s[bins] - self.edges_s[to] < least_s { bins } else { to };
            let sum = |of: &[f64]| of[from..to].iter().sum::<f64>();
            let gross: f64 = (from..to).map(|j| self.energy[j] / self.signal[j]).sum();
            wide.edges_s.push(self.edges_s[to]);
            wide.energy.push(sum(&self.energy));
            wide.values.push(sum(&self.values));
            wide.signal.push(sum(&self.energy) / gross);
            from = to;
        }
        wide
    }

    /// Level in dB of the energy still to come at the start of each bin, relative to that at the first.
    pub fn level_db(&self) -> Vec<f64> {
        let mut sum = self.tail;
        let mut level: Vec<f64> = self
            .energy
            .iter()
            .rev()
            .map(|e| {
                sum += e;
                10.0 * sum.log10()
            })
            .collect();
        level.reverse();
        let first = level[0];
        level.iter().map(|l| l - first).collect()
    }
}

/// Factor from one bin's width to the next with which [`BINS`] of them fill a duration, given in widths of the first.
fn growth(duration: f64) -> f64 {
    let filled = |growth: f64| (0..BINS).fold(0.0, |sum, _| 1.0 + growth * sum);
    if duration <= BINS as f64 {
        return 1.0;
    }
    let (mut low, mut high) = (1.0, 2.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if filled(middle) < duration { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_bins_hold_what_the_narrow_ones_held() {
        let narrow = BinnedDecay {
            edges_s: vec![0.0, 0.001, 0.002, 0.003, 0.005, 0.009, 0.0095],
            energy: vec![8.0, 4.0, 3.0, 2.0, 1.0, 0.1],
            values: vec![1.0, 1.0, 1.0, 2.0, 4.0, 0.5],
            signal: vec![1.0, 0.8, 1.0, 0.5, 0.5, 0.5],
            pulse: Pulse::new(&[0.0, 1.0, 0.0], 1, 1e4),
            leaks: Vec::new(),
            tail: 0.05,
        };
        let wide = narrow.widened(0.002);
        // The last half millisecond is too short to stand alone.
        assert_eq!(wide.edges_s, [0.0, 0.002, 0.005, 0.0095]);
        assert_eq!(wide.energy, [12.0, 5.0, 1.1]);
        assert_eq!(wide.values, [2.0, 3.0, 4.5]);
        // 8 + 5 were measured for 12 of signal, 3 + 4 for 5, and 2.2 for 1.1.
        for (found, expected) in wide.signal.iter().zip([12.0 / 13.0, 5.0 / 7.0, 0.5]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert_eq!(narrow.widened(0.0).edges_s, narrow.edges_s);
        assert_eq!(narrow.widened(1.0).edges_s, [0.0, 0.0095]);
    }
}
