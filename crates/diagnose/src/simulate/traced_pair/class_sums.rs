//! Energy of each bin by class of path, and the mean of what its paths have.

use super::{CELL_S, TracedPair};
use crate::observe::band_pulse::BandPulse;
use crate::observe::time_bins::Bins;

/// Paths by class, and numbers that each of them has.
pub(crate) struct ClassedPaths {
    /// The class of each path, below `count`.
    pub classes: Vec<u16>,
    pub count: usize,
    /// `[number][path]`.
    pub numbers: Vec<Vec<f32>>,
}

impl ClassedPaths {
    /// Sums of a class: energy, and energy times each number.
    pub fn width(&self) -> usize {
        1 + self.numbers.len()
    }
}

impl TracedPair {
    /// Energy of each class of paths in each bin of a band, followed by energy times each of their numbers, `[bin][class * width + column]`.
    pub fn class_sums(
        &self,
        energies: &[f32],
        paths: &ClassedPaths,
        (bins, kernel): (Bins, &BandPulse),
        duration_s: f64,
    ) -> Vec<Vec<f64>> {
        let (count, width) = (bins.count(duration_s), paths.width());
        let row = paths.count * width;
        let cells = (duration_s / CELL_S).ceil() as usize + 1;
        let mut in_cells = vec![0.0f64; cells * row];
        let mut sums = vec![vec![0.0f64; row]; count];
        let add = |target: &mut [f64], path: usize, share: f64| {
            let energy = share * f64::from(energies[path]);
            let own = &mut target[usize::from(paths.classes[path]) * width..][..width];
            own[0] += energy;
            let numbers = paths.numbers.iter().map(|column| f64::from(column[path]));
            own[1..].iter_mut().zip(numbers).for_each(|(sum, x)| *sum += energy * x);
        };
        for (path, &cell) in self.cells.iter().enumerate() {
            if usize::from(cell) < cells && energies[path] > 0.0 {
                add(&mut in_cells[usize::from(cell) * row..][..row], path, 1.0);
            }
        }
        for &path in &self.isolated {
            let path = path as usize;
            Self::shares(f64::from(self.times_s[path]), bins, kernel, count, |bin, share| {
                add(&mut sums[bin], path, share);
            });
        }
        for (cell, own) in in_cells.chunks(row).enumerate() {
            if own.iter().all(|x| *x == 0.0) {
                continue;
            }
            let time_s = (cell as f64 + 0.5) * CELL_S;
            Self::shares(time_s, bins, kernel, count, |bin, share| {
                sums[bin].iter_mut().zip(own).for_each(|(sum, x)| *sum += share * x);
            });
        }
        sums
    }
}
