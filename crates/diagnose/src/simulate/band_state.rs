//! What is predicted of one band of a response.

use crate::observe::stated_parameter::StatedParameter;
use crate::observe::time_bins::Bins;
use crate::simulate::modes::Modes;
use crate::simulate::table_chance::TableChance;
use crate::simulate::table_readings::TimeAxis;
#[cfg(test)]
use sabine_paths::PathSet;

/// Predicted energy of one band in time bins, at the materials of the expansion, and how it changes.
#[derive(Clone, Debug)]
pub(crate) struct BandState {
    pub bins: Bins,
    pub ln_energy: Vec<f64>,
    /// Share of the octave's own energy that its filter takes.
    pub own_share: f64,
    /// What it lets in of neighbouring octaves: their index, share, and the logarithm of their energy in these bins.
    pub leaks: Vec<(usize, f64, Vec<f64>)>,
    /// Groups of paths with like hits: those of bin k are `groups[k]..groups[k + 1]`.
    pub groups: Vec<usize>,
    /// Energy of each group.
    pub group_energy: Vec<f64>,
    /// Its mean number of hits, `[material][group]`.
    pub group_hits: Vec<Vec<f64>>,
    /// Energy-weighted mean time after the direct sound.
    pub time_s: Vec<f64>,
    pub departure: Vec<[f64; 3]>,
    pub departure_products: Vec<[f64; 6]>,
    pub arrival: Vec<[f64; 3]>,
    pub arrival_products: Vec<[f64; 6]>,
    /// Expected variance of a measured bin about the prediction, as a share of its energy squared: what each bin scatters for itself.
    /// Without the tracer's part until modes are found.
    pub variance: Vec<f64>,
    /// The tracer's own part of it; once modes are found, that which a prediction pays for on average: what they leave, and what they hold
    /// as far as they are narrow.
    pub monte_carlo: Vec<f64>,
    /// What the tracer's chance moves together.
    pub modes: Modes,
    /// The same of the values that a table states of the pair; `None` of a pair without a table, and where a value cannot be read.
    pub table: Option<TableChance>,
    /// By how much the logarithm of the energy that is to be expected lies above that of what the rays have found in the bin: these are
    /// smoothed, and corrected for what chance does to logarithms.
    pub correction: Vec<f64>,
    /// What each batch of rays moves the logarithm of the energy by, `[bin * batches + batch]`: modes are made of it.
    pub batch_deviations: Vec<f32>,
    /// Number of these batches.
    pub batches: usize,
}

impl BandState {
    /// Without any bin; room for so many, and so many batches of rays.
    pub fn empty(bins: Bins, own_share: f64, (count, batches): (usize, usize), materials: usize) -> Self {
        Self {
            bins,
            ln_energy: Vec::with_capacity(count),
            own_share,
            leaks: Vec::new(),
            groups: vec![0],
            group_energy: Vec::new(),
            group_hits: vec![Vec::new(); materials],
            time_s: Vec::with_capacity(count),
            departure: Vec::with_capacity(count),
            departure_products: Vec::with_capacity(count),
            arrival: Vec::with_capacity(count),
            arrival_products: Vec::with_capacity(count),
            variance: Vec::with_capacity(count),
            monte_carlo: Vec::with_capacity(count),
            modes: Modes::default(),
            table: None,
            correction: Vec::with_capacity(count),
            batch_deviations: Vec::with_capacity(count * batches),
            batches,
        }
    }

    /// Finds how chance moves what a table states of the pair.
    pub fn find_table_chance(&mut self, stated: &[StatedParameter]) {
        let axis = TimeAxis { bins: self.bins, time_s: &self.time_s };
        let ln_energy: Vec<f64> = self.ln_energy.iter().zip(&self.correction).map(|(l, c)| l + c).collect();
        self.table = TableChance::of(stated, axis, (&ln_energy, &self.variance), &self.modes);
    }

    /// Nats of log-likelihood that the tracer's chance costs on average in each bin; variances exceed what is expected by `dispersion`.
    pub fn weights_of_chance(&self, dispersion: f64) -> impl Iterator<Item = f64> {
        self.monte_carlo
            .iter()
            .zip(&self.variance)
            .map(move |(chance, variance)| 0.5 * chance / (variance * dispersion))
    }
}

#[cfg(test)]
impl BandState {
    /// A decay that falls by a neper in four bins: two groups of paths in each bin, whose hits grow with time.
    pub fn by_hand(bins: Bins, count: usize, materials: usize, offset: f64) -> Self {
        let early = |bin: usize| (-0.25 * bin as f64 - offset).exp();
        let group_energy: Vec<f64> =
            (0..count).flat_map(|bin| [0.7 * early(bin), 0.3 * early(bin)]).collect();
        let hits = |group: usize, m: usize| 0.3 * (group / 2) as f64 + (group % 2 + m) as f64;
        Self {
            bins,
            ln_energy: (0..count).map(|bin| early(bin).ln()).collect(),
            own_share: 1.0,
            leaks: Vec::new(),
            groups: (0..=count).map(|bin| 2 * bin).collect(),
            group_hits: (0..materials).map(|m| (0..2 * count).map(|g| hits(g, m)).collect()).collect(),
            group_energy,
            time_s: (0..count).map(|bin| bins.centre_s(bin)).collect(),
            departure: (0..count).map(|bin| [0.5 - 0.1 * bin as f64, 0.2, -0.1]).collect(),
            departure_products: vec![[0.4, 0.3, 0.3, 0.05, 0.0, -0.02]; count],
            arrival: (0..count).map(|bin| [-0.2, 0.4 - 0.05 * bin as f64, 0.1]).collect(),
            arrival_products: vec![[0.3, 0.4, 0.3, -0.04, 0.03, 0.0]; count],
            variance: (0..count).map(|bin| 0.15 + 0.02 * bin as f64).collect(),
            monte_carlo: vec![0.0; count],
            modes: Modes::new(
                2,
                (0..count).flat_map(|bin| [0.1 * (0.7 * bin as f64).sin(), 0.004 * bin as f64]).collect(),
            ),
            table: None,
            correction: (0..count).map(|bin| 0.002 * bin as f64).collect(),
            batch_deviations: (0..count * usize::from(PathSet::BATCHES))
                .map(|i| 0.02 * (1.7 * i as f32).sin())
                .collect(),
            batches: usize::from(PathSet::BATCHES),
        }
    }
}
