//! Energy, time, direction and hits of each bin, gathered from the paths.

use super::{
    CELL_S, COHERENT_BANDWIDTH_TIMES, COHERENT_SD, ISOLATED_S, MODEL_SD, NOTHING, TIME_SD_S, TracedPair,
};
use crate::observe::band_pulse::BandPulse;
use crate::observe::time_bins::Bins;
use crate::simulate::band_state::BandState;
use crate::simulate::hit_groups;
use crate::simulate::monte_carlo_modes::deviations;
use crate::simulate::smoothing::smoothed;
use std::collections::BTreeMap;

/// Of a bin: energy, time, departure, its products, arrival, its products.
const COLUMNS: usize = 20;
/// Of a path: the same without its energy, which each band has for itself.
pub(super) type PathFactors = [f64; COLUMNS - 1];

/// Sums over the paths of one band, by bin.
struct Gathered {
    count: usize,
    /// Energy, and energy times each of the other columns, `[bin * COLUMNS + column]`.
    sums: Vec<f64>,
    /// Energy and energy times hits of the groups of each bin, by slice of time and number.
    rows: Vec<BTreeMap<(usize, u8), Vec<f64>>>,
    /// Variance of each bin by what the times of isolated reflections may be off.
    timing_variance: Vec<f64>,
    /// Early exact paths by their very times: two that come together add or cancel as a whole.
    isolated: Vec<Vec<(f64, f64)>>,
    /// Energy of the cells in each bin, exact paths included, and squares of the exact ones: for the variance by interference.
    weighted: Vec<Vec<(usize, f64)>>,
    squares: Vec<f64>,
}

/// Energy that is to be expected in each bin: that of exact paths, and that of each batch of rays, smoothed over time.
pub(crate) struct ExpectedEnergy {
    exact: Vec<f64>,
    /// `[bin * batches + batch]`.
    sampled: Vec<f64>,
    batches: usize,
}

impl ExpectedEnergy {
    /// Energies of the batches of rays in a bin.
    pub fn batches(&self, bin: usize) -> &[f64] {
        &self.sampled[bin * self.batches..(bin + 1) * self.batches]
    }

    /// Number of bins.
    pub fn len(&self) -> usize {
        self.exact.len()
    }

    /// Energy of a bin.
    pub fn sum(&self, bin: usize) -> f64 {
        self.exact[bin] + self.batches(bin).iter().sum::<f64>()
    }
}

/// Sums over the paths that keep no time of their own, by cell.
struct Cells {
    gathered: Vec<f64>,
    grouped: Vec<f64>,
    energy: Vec<f64>,
    exact_squares: Vec<f64>,
}

impl TracedPair {
    /// Predicted energy of one band, without what leaks in from others and without tables.
    pub(super) fn band(
        &self,
        band: usize,
        (energies, factors): (&[f32], &[PathFactors]),
        bins: Bins,
        pulse: &BandPulse,
        duration_s: f64,
    ) -> BandState {
        let gathered = self.gather((energies, factors), bins, pulse, duration_s);
        let expected = self.expected(energies, bins, pulse, duration_s);
        gathered.finish(bins, pulse, pulse.shares[band], self.paths.materials(), &expected)
    }

    /// What is to be expected in each bin.
    pub fn expected(
        &self,
        energies: &[f32],
        bins: Bins,
        kernel: &BandPulse,
        duration_s: f64,
    ) -> ExpectedEnergy {
        let count = bins.count(duration_s);
        let cells = (duration_s / CELL_S).ceil() as usize + 1;
        let batches = usize::from(self.paths.batch_count());
        let mut exact = vec![0.0f64; cells];
        let mut by_batch = vec![0.0f32; cells * batches];
        for (i, (&cell, &e)) in self.cells.iter().zip(energies).enumerate() {
            let cell = usize::from(cell);
            if cell >= cells {
                continue;
            }
            match self.paths.batch(i) {
                Some(batch) => by_batch[cell * batches + usize::from(batch)] += e,
                None => exact[cell] += f64::from(e),
            }
        }
        let mut sums = vec![0.0f64; count];
        for &i in &self.isolated {
            let (time_s, e) = (f64::from(self.times_s[i as usize]), f64::from(energies[i as usize]));
            Self::shares(time_s, bins, kernel, count, |bin, share| sums[bin] += share * e);
        }
        let mut sampled = vec![0.0f64; count * batches];
        for (cell, parts) in by_batch.chunks(batches).enumerate() {
            let time_s = (cell as f64 + 0.5) * CELL_S;
            let own = exact[cell];
            if own > 0.0 || parts.iter().any(|e| *e > 0.0) {
                Self::shares(time_s, bins, kernel, count, |bin, share| {
                    sums[bin] += share * own;
                    let target = &mut sampled[bin * batches..(bin + 1) * batches];
                    target.iter_mut().zip(parts).for_each(|(s, r)| *s += share * f64::from(*r));
                });
            }
        }
        ExpectedEnergy { exact: sums, sampled: smoothed(&sampled, batches), batches }
    }

    fn gather(
        &self,
        (energies, factors): (&[f32], &[PathFactors]),
        bins: Bins,
        pulse: &BandPulse,
        duration_s: f64,
    ) -> Gathered {
        let count = bins.count(duration_s);
        let mut found = Gathered {
            count,
            sums: vec![0.0; count * COLUMNS],
            rows: vec![BTreeMap::new(); count],
            timing_variance: vec![0.0; count],
            isolated: vec![Vec::new(); count],
            weighted: vec![Vec::new(); count],
            squares: vec![0.0; count],
        };
        let width = 1 + self.paths.materials();
        let cells = (duration_s / CELL_S).ceil() as usize + 1;
        let mut in_cells = Cells {
            gathered: vec![0.0; cells * COLUMNS],
            grouped: vec![0.0; cells * hit_groups::MAX_GROUPS * width],
            energy: vec![0.0; cells],
            exact_squares: vec![0.0; cells],
        };
        for (i, &e) in energies.iter().enumerate() {
            let time_s = f64::from(self.times_s[i]);
            let cell = (time_s.max(0.0) / CELL_S) as usize;
            if cell >= cells || e == 0.0 {
                continue;
            }
            if self.paths.is_exact(i) && time_s < ISOLATED_S {
                self.add_isolated((i, &factors[i]), f64::from(e), bins, pulse, &mut found);
            } else {
                self.add_to_cell((i, &factors[i]), f64::from(e), cell, &mut in_cells);
            }
        }
        found.add_cells(&in_cells, width, bins, pulse);
        found
    }

    /// Factors of all paths.
    pub(super) fn factors(&self) -> Vec<PathFactors> {
        let ends = self.departures.iter().zip(&self.arrivals);
        let of_path = |(time_s, (departure, arrival)): (&f32, (&[f32; 3], &[f32; 3]))| {
            let [x, y, z] = departure.map(f64::from);
            let [u, v, w] = arrival.map(f64::from);
            [
                f64::from(*time_s),
                x,
                y,
                z,
                x * x,
                y * y,
                z * z,
                x * y,
                x * z,
                y * z,
                u,
                v,
                w,
                u * u,
                v * v,
                w * w,
                u * v,
                u * w,
                v * w,
            ]
        };
        self.times_s.iter().zip(ends).map(of_path).collect()
    }

    /// An early exact path, which keeps its very time.
    fn add_isolated(
        &self,
        (path, factors): (usize, &PathFactors),
        energy: f64,
        bins: Bins,
        pulse: &BandPulse,
        found: &mut Gathered,
    ) {
        let m = self.paths.materials();
        let (time_s, count) = (f64::from(self.times_s[path]), found.count);
        let mut row = [energy; COLUMNS];
        row[1..].iter_mut().zip(factors).for_each(|(r, factor)| *r *= factor);
        let mut hits_row = vec![energy; 1 + m];
        let hits = &self.hits[path * m..(path + 1) * m];
        hits_row[1..].iter_mut().zip(hits).for_each(|(a, n)| *a = energy * f64::from(*n));
        let (slice, group) = (hit_groups::slice(self.times_s[path]), self.groups[path]);
        let mut moved: BTreeMap<usize, f64> = BTreeMap::new();
        for (shift_s, sign) in [(TIME_SD_S, 0.5), (-TIME_SD_S, -0.5)] {
            Self::shares(time_s + shift_s, bins, pulse, count, |bin, share| {
                *moved.entry(bin).or_default() += sign * share;
            });
        }
        moved.into_iter().for_each(|(bin, change)| found.timing_variance[bin] += (change * energy).powi(2));
        Self::shares(time_s, bins, pulse, count, |bin, share| {
            found.isolated[bin].push((time_s, share * energy));
            add(&mut found.sums[bin * COLUMNS..(bin + 1) * COLUMNS], &row, share);
            let own = found.rows[bin].entry((slice, group)).or_insert_with(|| vec![0.0; 1 + m]);
            add(own, &hits_row, share);
        });
    }

    fn add_to_cell(
        &self,
        (path, factors): (usize, &PathFactors),
        energy: f64,
        cell: usize,
        cells: &mut Cells,
    ) {
        let m = self.paths.materials();
        cells.energy[cell] += energy;
        if self.paths.is_exact(path) {
            cells.exact_squares[cell] += energy * energy;
        }
        let own = &mut cells.gathered[cell * COLUMNS..(cell + 1) * COLUMNS];
        own[0] += energy;
        add(&mut own[1..], factors, energy);
        let group = cell * hit_groups::MAX_GROUPS + usize::from(self.groups[path]);
        let own = &mut cells.grouped[group * (1 + m)..][..1 + m];
        own[0] += energy;
        let hits = &self.hits[path * m..(path + 1) * m];
        own[1..].iter_mut().zip(hits).for_each(|(a, n)| *a += energy * f64::from(*n));
    }
}

impl Gathered {
    /// Spreads the cells over the bins.
    fn add_cells(&mut self, cells: &Cells, width: usize, bins: Bins, pulse: &BandPulse) {
        for cell in 0..cells.energy.len() {
            if cells.energy[cell] == 0.0 {
                continue;
            }
            let time_s = (cell as f64 + 0.5) * CELL_S;
            let slice = hit_groups::slice(time_s as f32);
            TracedPair::shares(time_s, bins, pulse, self.count, |bin, share| {
                self.weighted[bin].push((cell, share * cells.energy[cell]));
                self.squares[bin] += share * share * cells.exact_squares[cell];
                if cells.gathered[cell * COLUMNS] == 0.0 {
                    return;
                }
                let own = &cells.gathered[cell * COLUMNS..(cell + 1) * COLUMNS];
                add(&mut self.sums[bin * COLUMNS..(bin + 1) * COLUMNS], own, share);
                for group in 0..hit_groups::MAX_GROUPS {
                    let own = &cells.grouped[(cell * hit_groups::MAX_GROUPS + group) * width..][..width];
                    if own[0] > 0.0 {
                        let row = self.rows[bin].entry((slice, group as u8));
                        add(row.or_insert_with(|| vec![0.0; width]), own, share);
                    }
                }
            });
        }
    }

    /// The state of the band: means instead of sums, and the variance of each bin.
    fn finish(
        &self,
        bins: Bins,
        pulse: &BandPulse,
        own_share: f64,
        materials: usize,
        expected: &ExpectedEnergy,
    ) -> BandState {
        let count = self.count;
        let floor = NOTHING * (0..count).map(|k| self.sums[k * COLUMNS]).fold(0.0, f64::max).max(1e-30);
        let mut state = BandState::empty(bins, own_share, (count, expected.batches), materials);
        for bin in 0..count {
            let s = &self.sums[bin * COLUMNS..(bin + 1) * COLUMNS];
            let e = s[0].max(floor);
            state.ln_energy.push(e.ln());
            state.time_s.push(if s[0] > floor { s[1] / e } else { bins.centre_s(bin) });
            state.departure.push(std::array::from_fn(|k| s[2 + k] / e));
            state.departure_products.push(std::array::from_fn(|k| s[5 + k] / e));
            state.arrival.push(std::array::from_fn(|k| s[11 + k] / e));
            state.arrival_products.push(std::array::from_fn(|k| s[14 + k] / e));
            let rows = self.rows[bin].values().map(Vec::as_slice).filter(|r| r[0] > 0.0).collect();
            for row in hit_groups::joined(rows) {
                state.group_energy.push(row[0]);
                state.group_hits.iter_mut().zip(&row[1..]).for_each(|(all, h)| all.push(h / row[0]));
            }
            if s[0] <= floor {
                state.group_energy.push(floor);
                state.group_hits.iter_mut().for_each(|all| all.push(0.0));
            }
            state.groups.push(state.group_energy.len());
            let interference = interference(&self.weighted[bin], pulse)
                - 2.0 * pulse.cell_correlation[0] * self.squares[bin]
                + pairwise_interference(&self.isolated[bin], pulse)
                + self.timing_variance[bin];
            let whole = expected.sum(bin).max(floor);
            state.correction.push((whole / e).ln());
            let own = deviations(expected.batches(bin), whole);
            state.batch_deviations.extend(own.map(|d| d as f32));
            let own = &state.batch_deviations[bin * expected.batches..];
            state.monte_carlo.push(own.iter().map(|d| f64::from(d * d)).sum());
            let coherent = bins.centre_s(bin) < COHERENT_BANDWIDTH_TIMES / pulse.bandwidth_hz;
            let model_sd = if coherent { COHERENT_SD } else { MODEL_SD };
            state.variance.push(interference.max(0.0) / (e * e) + model_sd * model_sd);
        }
        state
    }
}

/// Variance of the energy of single pulses of random sign: four times the sum over pairs of w_i w_j r_ij^2.
fn pairwise_interference(isolated_reflections: &[(f64, f64)], kernel: &BandPulse) -> f64 {
    let mut sum = 0.0;
    for (i, &(time_s, energy)) in isolated_reflections.iter().enumerate() {
        for &(other_s, more) in &isolated_reflections[i + 1..] {
            sum += energy * more * kernel.correlation_sq(other_s - time_s);
        }
    }
    4.0 * sum
}

fn add(target: &mut [f64], more: &[f64], share: f64) {
    target.iter_mut().zip(more).for_each(|(t, x)| *t += share * x);
}

/// Variance of the energy in a bin if all pulses had random signs: twice the sum of w_i w_j r_ij^2 over all i and j, two paths of
/// one cell being as alike as two times in it are on the average, a path and itself no more.
fn interference(cells: &[(usize, f64)], kernel: &BandPulse) -> f64 {
    let mut sum = 0.0;
    for (i, &(cell, energy)) in cells.iter().enumerate() {
        sum += energy * energy * kernel.cell_correlation[0];
        for &(other, more) in &cells[i + 1..] {
            match kernel.cell_correlation.get(other - cell) {
                Some(cell_correlation) => sum += 2.0 * energy * more * cell_correlation,
                None => break,
            }
        }
    }
    2.0 * sum
}
