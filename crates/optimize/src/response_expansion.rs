//! The measured bins of one band against the paths near given materials.

use crate::expansion::Bins;
use crate::history::variance_of_sum;
use crate::response_band::{Arrival, BandResponse, ResponseBand, Window};
use crate::table_expansion::TableExpansion;
use sabine_scene::Levels;

/// A measured bin and what the paths give for it near an absorption.
#[derive(Clone)]
pub(crate) struct Bin {
    /// Gain group; `None` for a gain of 1.
    pub group: Option<usize>,
    /// Its response, and the window of it, by their places.
    pub place: usize,
    window: usize,
    measured: f64,
    /// Relative variance of the measurement by chance.
    pub chance: f64,
    /// Inverse relative variance of the measurement and of the rays.
    pub weight: f64,
    /// Logarithm of the energy of the band's own paths.
    log_energy: f64,
    /// Energy that leaks in from other bands.
    leak: f64,
    /// Mean hits of each material by the band's own paths, weighted by energy.
    hits: Vec<f64>,
    /// Share of each batch of rays in the energy, leaks and all.
    pub batches: Vec<f64>,
}

/// A band, expanded about an absorption.
pub(crate) struct ResponseExpansion<'b> {
    pub band: &'b ResponseBand<'b>,
    about: Vec<f64>,
    pub bins: Vec<Bin>,
    pub tables: Vec<TableExpansion<'b>>,
    /// How much farther the values of the tables lie from the paths than chance puts them, as a variance ratio; at least 1, and held while
    /// the materials move.
    pub table_dispersion: f64,
}

impl<'b> ResponseExpansion<'b> {
    /// Sums the paths into the measured bins. `path_error` is the relative standard deviation of the energy of an exact path.
    pub fn about(band: &'b ResponseBand<'b>, absorption: &[f64], path_error: f64) -> Self {
        let mut expansion = Self::without_weights(band, absorption, path_error);
        for bin in &mut expansion.bins {
            let response = &band.responses[bin.place];
            let (history, weights) = &response.traces[0];
            let window = &response.windows[bin.window];
            let mut functional = vec![0.0; history.bins()];
            functional[window.from..window.from + window.shares.len()].copy_from_slice(&window.shares);
            bin.batches = history.batch_sums(weights, absorption, &functional);
            let energy = bin.log_energy.exp() + bin.leak;
            bin.batches.iter_mut().for_each(|p| *p /= energy);
            bin.weight = 1.0 / (bin.chance + variance_of_sum(&bin.batches));
        }
        let tables = band.tables.iter().filter(|table| !table.values.is_empty());
        // What cannot be read at the start was left out, and no step is taken to where it cannot be read.
        expansion.tables =
            tables.filter_map(|table| TableExpansion::about(table, absorption, path_error)).collect();
        expansion
    }

    /// The same about another absorption, the bins weighing what they weigh here; `None` where some have lost all energy.
    pub fn moved_to(&self, absorption: &[f64], path_error: f64) -> Option<Self> {
        let mut moved = Self::without_weights(self.band, absorption, path_error);
        if moved.bins.len() != self.bins.len() {
            return None;
        }
        for (bin, old) in moved.bins.iter_mut().zip(&self.bins) {
            bin.weight = old.weight;
        }
        moved.tables = self.tables.iter().map(|table| table.moved_to(absorption)).collect::<Option<_>>()?;
        moved.table_dispersion = self.table_dispersion;
        Some(moved)
    }

    fn without_weights(band: &'b ResponseBand<'b>, absorption: &[f64], path_error: f64) -> Self {
        let mut bins = Vec::new();
        for (place, response) in band.responses.iter().enumerate() {
            if response.fitted == 0 {
                continue;
            }
            let fine = Bins::of(&response.traces, absorption);
            let exact = exact_energies(response, absorption);
            for (j, window) in response.windows[..response.fitted].iter().enumerate() {
                let bin = Bin::of(window, &fine, &exact, path_error);
                let group = band.gain_group(response.index);
                bins.extend(bin.map(|bin| Bin { group, place, window: j, ..bin }));
            }
        }
        Self { band, about: absorption.to_vec(), bins, tables: Vec::new(), table_dispersion: 1.0 }
    }

    /// ln E of a bin at an absorption, and the share of the band's own paths in E.
    fn log_energy(&self, bin: &Bin, absorption: &[f64]) -> (f64, f64) {
        let change = absorption.iter().zip(&self.about).zip(&bin.hits);
        let own = bin.log_energy + change.map(|((a, a0), h)| h * ((-a).ln_1p() - (-a0).ln_1p())).sum::<f64>();
        if bin.leak == 0.0 {
            return (own, 1.0);
        }
        // Own energy over that which leaks, as a logarithm: far from the expansion it exceeds any number.
        let over = own - bin.leak.ln();
        let share = 1.0 / (1.0 + (-over).exp());
        (if over > 0.0 { own - share.ln() } else { bin.leak.ln() + over.exp().ln_1p() }, share)
    }

    /// Derivative of ln E of a bin by the absorption of each material, at an absorption.
    pub fn slopes(&self, bin: &Bin, absorption: &[f64]) -> Vec<f64> {
        let share = self.log_energy(bin, absorption).1;
        bin.hits.iter().zip(absorption).map(|(h, a)| -share * h / (1.0 - a)).collect()
    }

    pub fn groups(&self) -> usize {
        self.bins.iter().filter_map(|b| b.group).max().map_or(0, |g| g + 1)
    }

    /// Logarithm of measured over expected energy of each bin, at an absorption and the most likely gains: the weighted mean
    /// ratios.
    fn log_ratios(&self, absorption: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let raw: Vec<f64> =
            self.bins.iter().map(|b| b.measured.ln() - self.log_energy(b, absorption).0).collect();
        // Far from the expansion ratios exceed any number: they are summed relative to the greatest.
        let mut greatest = vec![f64::NEG_INFINITY; self.groups()];
        for (bin, raw) in self.bins.iter().zip(&raw) {
            if let Some(group) = bin.group {
                greatest[group] = greatest[group].max(*raw);
            }
        }
        let mut sums = vec![(0.0, 0.0); self.groups()];
        for (bin, raw) in self.bins.iter().zip(&raw) {
            if let Some(group) = bin.group {
                sums[group].0 += bin.weight * (raw - greatest[group]).exp();
                sums[group].1 += bin.weight;
            }
        }
        let mean = |((ratio, weight), greatest): ((f64, f64), f64)| greatest + (ratio / weight).ln();
        let gains: Vec<f64> = sums.into_iter().zip(greatest).map(mean).collect();
        let of = |(bin, raw): (&Bin, f64)| raw - bin.group.map_or(0.0, |g| gains[g]);
        (self.bins.iter().zip(raw).map(of).collect(), gains)
    }

    /// Logarithm of the most likely gain of each group.
    pub fn log_gains(&self, absorption: &[f64]) -> Vec<f64> {
        self.log_ratios(absorption).1
    }

    /// Half the deviance: the negative logarithm of the likelihood, less its least value for these bins. `gradient` receives
    /// its derivative by each absorption.
    pub fn cost(&self, absorption: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let (log_ratios, _) = self.log_ratios(absorption);
        let mut cost = 0.0;
        for (bin, log_ratio) in self.bins.iter().zip(log_ratios) {
            cost += bin.weight * (log_ratio.exp_m1() - log_ratio);
            // At its most likely value a gain takes no part in the gradient.
            let by = -bin.weight * log_ratio.exp_m1();
            for (g, slope) in gradient.iter_mut().zip(self.slopes(bin, absorption)) {
                *g += by * slope;
            }
        }
        cost
    }

    /// Half the squared distance of the values of the tables, over their dispersion. `gradient` receives its derivative by each absorption,
    /// added to what is there.
    pub fn table_cost(&self, absorption: &[f64], gradient: &mut [f64]) -> f64 {
        let share = 1.0 / self.table_dispersion;
        self.tables.iter().map(|table| table.cost(absorption, gradient, share)).sum()
    }

    /// Takes the dispersion of the tables at an absorption.
    pub fn weigh_tables(&mut self, absorption: &[f64]) {
        let sums = self.tables.iter().map(|table| table.chi_squared(absorption));
        let (chi_squared, values) = sums.fold((0.0, 0.0), |(c, n), (chi, count)| (c + chi, n + count));
        self.table_dispersion = if values > 0.0 { (chi_squared / values).max(1.0) } else { 1.0 };
    }

    /// Mean deviance of the bins, in what it would be by chance; at least 1.
    pub fn dispersion(&self, absorption: &[f64]) -> f64 {
        let deviance = 2.0 * self.cost(absorption, &mut vec![0.0; absorption.len()]);
        // Where the levels are known, there are no gains to be estimated.
        let gains = if self.band.levels == Levels::Absolute { 0 } else { self.groups() };
        let free = (self.bins.len() as f64 - gains as f64).max(1.0);
        (deviance / free).max(1.0)
    }
}

/// Energy and hits of the exact paths of a response, by their place.
pub(crate) fn exact_energies<'r>(
    response: &'r BandResponse<'_>,
    absorption: &[f64],
) -> Vec<(f64, &'r [u16])> {
    let history = response.traces[0].0;
    let k = absorption.len();
    let of = |&(i, weight): &(usize, f64)| {
        let hits = &history.counts[i * k..(i + 1) * k];
        let log: f64 = hits.iter().zip(absorption).map(|(&n, a)| f64::from(n) * (-a).ln_1p()).sum();
        (weight * log.exp(), hits)
    };
    response.exact.iter().map(of).collect()
}

impl Bin {
    /// `None` for a bin without energy; where it belongs, weight and batches are left to the caller.
    fn of(window: &Window, fine: &Bins, exact: &[(f64, &[u16])], path_error: f64) -> Option<Self> {
        let materials = fine.hits.len() / fine.energy.len().max(1);
        let (mut sampled, mut hits) = (0.0, vec![0.0; materials]);
        for (i, share) in (window.from..).zip(&window.shares) {
            let e = share * fine.energy[i];
            sampled += e;
            let row = &fine.hits[i * materials..(i + 1) * materials];
            hits.iter_mut().zip(row).for_each(|(h, n)| *h += e * n);
        }
        let mut single = 0.0;
        for &Arrival { place, share, .. } in &window.exact {
            let (e, counts) = exact[place];
            single += share * e;
            hits.iter_mut().zip(counts).for_each(|(h, &n)| *h += share * e * f64::from(n));
        }
        let energy = sampled + single;
        if energy <= 0.0 {
            return None;
        }
        hits.iter_mut().for_each(|h| *h /= energy);
        // Arrivals interfere. Of random sign they add 2 sum e_i e_j G^2 over i != j to the variance, G being what pulses so far
        // apart have in common; in a diffuse field that is E^2 / (bandwidth x duration).
        let mut variance = (2.0 * single * sampled + sampled * sampled) / window.values;
        let whole = |n: usize| exact[window.exact[n].place].0;
        variance += 2.0 * window.overlaps.iter().map(|&(n, m, o)| o * whole(n) * whole(m)).sum::<f64>();
        // A reflection is not known perfectly, neither how strong it is nor on which side of an edge it arrives.
        let known = |a: &Arrival| exact[a.place].0.powi(2) * ((path_error * a.share).powi(2) + a.variance);
        variance += window.exact.iter().map(known).sum::<f64>();
        Some(Self {
            group: None,
            place: 0,
            window: 0,
            measured: window.energy,
            chance: variance / (energy * energy) + window.noise,
            weight: 0.0,
            log_energy: energy.ln(),
            leak: window.leak,
            hits,
            batches: Vec::new(),
        })
    }
}
