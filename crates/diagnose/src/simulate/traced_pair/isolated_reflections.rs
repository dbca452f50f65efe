//! Early paths one by one.

use super::{BandState, TracedPair};
use crate::observe::time_bins::Bins;
use crate::simulate::modes::Modes;
use sabine_acoustics::Bands;

/// An early path that was found exactly.
#[derive(Clone, Debug)]
pub(crate) struct IsolatedReflection {
    pub length_m: f64,
    pub after_direct_s: f64,
    pub departure: [f64; 3],
    pub arrival: [f64; 3],
    /// Reflections.
    pub order: usize,
    /// Surfaces (indices) that it meets, from the source on; none where it could not be followed.
    pub surfaces: Vec<usize>,
}

fn products([x, y, z]: [f64; 3]) -> [f64; 6] {
    [x * x, y * y, z * z, x * y, x * z, y * z]
}

impl TracedPair {
    /// The early exact paths, the shortest first, each as a bin of its own in the state of each band, from the energies of all
    /// paths. Which surfaces they meet is not filled in.
    pub fn isolated_reflections(
        &self,
        energies: &[Vec<f32>],
        bands: Bands,
        within_s: f64,
    ) -> (Vec<IsolatedReflection>, Vec<BandState>) {
        let m = self.paths.materials();
        let mut chosen: Vec<usize> = (0..self.paths.len())
            .filter(|&i| self.paths.is_exact(i) && f64::from(self.times_s[i]) <= within_s)
            .collect();
        chosen.sort_by(|&a, &b| self.paths.lengths_m()[a].total_cmp(&self.paths.lengths_m()[b]));
        let order = |i: usize| self.hits[i * m..(i + 1) * m].iter().sum::<f32>().round() as usize;
        let isolated_reflections: Vec<IsolatedReflection> = chosen
            .iter()
            .map(|&i| IsolatedReflection {
                length_m: f64::from(self.paths.lengths_m()[i]),
                after_direct_s: f64::from(self.times_s[i]),
                departure: self.paths.departure(i),
                arrival: self.paths.arrival(i),
                order: order(i),
                surfaces: Vec::new(),
            })
            .collect();
        let states = energies
            .iter()
            .enumerate()
            .map(|(band, energies)| BandState {
                bins: Bins::new(bands, band),
                ln_energy: chosen.iter().map(|&i| f64::from(energies[i]).max(1e-30).ln()).collect(),
                own_share: 1.0,
                leaks: Vec::new(),
                groups: (0..=chosen.len()).collect(),
                group_energy: chosen.iter().map(|&i| f64::from(energies[i]).max(1e-30)).collect(),
                group_hits: (0..m)
                    .map(|material| chosen.iter().map(|&i| f64::from(self.hits[i * m + material])).collect())
                    .collect(),
                time_s: isolated_reflections.iter().map(|s| s.after_direct_s).collect(),
                departure: isolated_reflections.iter().map(|s| s.departure).collect(),
                departure_products: isolated_reflections.iter().map(|s| products(s.departure)).collect(),
                arrival: isolated_reflections.iter().map(|s| s.arrival).collect(),
                arrival_products: isolated_reflections.iter().map(|s| products(s.arrival)).collect(),
                variance: vec![0.0; isolated_reflections.len()],
                monte_carlo: Vec::new(),
                modes: Modes::default(),
                table: None,
                correction: Vec::new(),
                batch_deviations: Vec::new(),
                batches: usize::from(self.paths.batch_count()),
            })
            .collect();
        (isolated_reflections, states)
    }
}
