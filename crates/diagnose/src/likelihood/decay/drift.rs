//! How far single responses drift from the prediction along their decay: a variance component, estimated from the data.
//!
//! Bins scatter by themselves where sound has random phase. Where reflections keep theirs (between parallel walls that reflect equally, or
//! below the Schroeder frequency) the decay of a response runs above and below the mean of its energies for many bins together. A hundred
//! bins would then agree on an effect that is none.

use super::offsets::{BandBins, Directions};
use super::pair_likelihood::ComparedBand;
use super::{EnergyModel, LN_PER_DB};
use rayon::prelude::*;

/// Standard deviations that are tried, in dB.
const TRIED_DB: [f64; 9] = [0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0];
/// What a drift must gain over none, in nats.
const LEAST_NATS: f64 = 2.0;

impl EnergyModel<'_> {
    /// The most probable drift in each band under these values (standard deviation of the first cosine, as a logarithm of energy), from
    /// all pairs that count: one band after the other, those of the model being where the others stand.
    pub fn most_probable_drift(&self, values: &[f64]) -> Vec<f64> {
        let pairs: Vec<usize> = (0..self.assignment.len()).filter(|&p| self.used[p]).collect();
        let compared: Vec<Vec<ComparedBand<'_>>> =
            pairs.par_iter().map(|&pair| self.compared_bands(values, pair, false)).collect();
        let mut found = self.data.drift_sd.to_vec();
        for band in 0..found.len() {
            let evidence = |drift_sd: f64| -> f64 {
                let of_pair = |bands: &Vec<ComparedBand<'_>>| self.evidence(bands, &found, (band, drift_sd));
                // Collected before they are summed: the same on any number of threads.
                compared.par_iter().map(of_pair).collect::<Vec<f64>>().iter().sum()
            };
            let none = evidence(0.0);
            let tried = TRIED_DB.map(|db| (db * LN_PER_DB, evidence(db * LN_PER_DB)));
            let best = tried.into_iter().fold((0.0, none + LEAST_NATS), |a, b| if b.1 > a.1 { b } else { a });
            found[band] = best.0;
        }
        found
    }

    /// Evidence of one response for drifts `found`, but for this one of one band.
    fn evidence(&self, bands: &[ComparedBand<'_>], found: &[f64], (band, drift_sd): (usize, f64)) -> f64 {
        let together = bands.iter().any(|one| one.bins().modes.count() > 0);
        let bins: Vec<BandBins<'_>> = bands
            .iter()
            // Bands that share no mode have nothing to say on each other.
            .filter(|one| together || one.band == band)
            .map(|one| BandBins {
                drift_sd: if one.band == band { drift_sd } else { found[one.band] },
                ..one.bins()
            })
            .collect();
        Directions::new(&bins).log_evidence()
    }
}
