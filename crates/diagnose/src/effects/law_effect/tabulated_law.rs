//! A law whose amplitude varies, tabulated for the bins of a traced room.

use super::free_parameters::MAX_GAIN_DB;
use super::sketched_law::NEPERS_PER_DB;
use crate::error::Error;
use crate::simulate::tables::{Tables, Unprepared, between};
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use crate::simulate::views::BandView;
use sabine_acoustics::Error as Cause;
use sabine_paths::laws::{BoundLaws, Law, LawError};

/// Amplitudes at which energies are tabulated, on each side of zero, in twelfths of the end: closer where most of them lie.
const STEPS: [i32; 9] = [1, 2, 3, 4, 5, 6, 8, 10, 12];

/// A law and the amplitudes at which it is tabulated.
#[derive(Clone, Debug)]
pub(crate) struct TabulatedLaw {
    pub law: Law,
    /// Which parameter of the law is its amplitude.
    amplitude: usize,
    /// The same steps on each side of zero.
    grid: Vec<f64>,
}

impl TabulatedLaw {
    /// A law, which of its parameters is its amplitude, and the range of that, which holds zero.
    pub fn new(law: Law, amplitude: usize, (low, high): (f64, f64)) -> Self {
        let side = |end: f64| STEPS.into_iter().map(move |i| end * f64::from(i) / 12.0).filter(|x| *x != 0.0);
        let mut grid: Vec<f64> = side(low).chain([0.0]).chain(side(high)).collect();
        grid.sort_by(f64::total_cmp);
        Self { law, amplitude, grid }
    }

    /// Tables for all bins.
    pub fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        Ok(Tables::of_bins(room.by_pair(|pair| self.tables(pair))?))
    }

    /// Changes the bins of a view by the law at an amplitude.
    pub fn apply(&self, amplitude: f64, view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(table) = view.table::<LawTable>() else { return };
        for (bin, ln) in ln_energy.iter_mut().enumerate() {
            *ln += between(&table.grid, &table.ln_changes, bin, amplitude);
        }
    }

    /// A table without traced paths, for unit tests of likelihoods.
    #[cfg(test)]
    pub fn by_hand(&self, bins: usize) -> Box<dyn std::any::Any + Send + Sync> {
        let at = |x: &f64| (0..bins).map(|bin| 0.3 * x * (1.1 * bin as f64 + 1.0).sin()).collect();
        Box::new(LawTable { grid: self.grid.clone(), ln_changes: self.grid.iter().map(at).collect() })
    }

    /// The law at an amplitude, in an interval of it.
    pub fn at(&self, amplitude: f64, interval: [f64; 2]) -> Result<Law, LawError> {
        let (mut values, mut intervals): (Vec<f64>, Vec<[f64; 2]>) =
            self.law.parameters().map(|(_, p)| (p.value, [p.low, p.high])).unzip();
        values[self.amplitude] = amplitude;
        intervals[self.amplitude] = interval;
        self.law.with_fitted(&values, &intervals)
    }

    /// Energies of a pair's paths at an amplitude.
    fn energies(&self, pair: &TracedPairView<'_>, amplitude: f64) -> Result<Vec<Vec<f32>>, Error> {
        let law = self.at(amplitude, [amplitude; 2]).map_err(Cause::from)?;
        let bound = BoundLaws::new(&[law], &pair.law_site()).map_err(Cause::from)?;
        pair.energies_under(&bound)
    }

    /// Tables of all bands. The decibels of a law go with its amplitude: what it leaves of the energy of a path at one amplitude says what it
    /// leaves at all others.
    fn tables(&self, pair: &TracedPairView<'_>) -> Result<Vec<LawTable>, Error> {
        let zero = self.grid.iter().position(|x| *x == 0.0).unwrap_or(0);
        let (below, above) = (&self.grid[..zero], &self.grid[zero + 1..]);
        let without = pair.expanded_energies()?;
        let nothing = |band: usize| vec![vec![0.0; pair.ln_energy(band).len()]];
        let table = |band: usize| LawTable { grid: self.grid.clone(), ln_changes: nothing(band) };
        let mut tables: Vec<LawTable> = (0..without.len()).map(table).collect();
        let Some(&tried) = above.first().or(below.last()) else { return Ok(tables) };
        let kept = KeptEnergy::new(without, &self.energies(pair, tried)?);
        for last in below.first().into_iter().chain(above.last()) {
            // Where the law would be too loud is an error, not a number.
            if kept.greatest_nepers(last / tried) > 0.5 * MAX_GAIN_DB * NEPERS_PER_DB {
                self.energies(pair, *last)?;
            }
        }
        for (band, table) in tables.iter_mut().enumerate() {
            let side = |first: Option<&f64>| -> Vec<Vec<f64>> {
                let Some(first) = first else { return Vec::new() };
                let factors = kept.in_band(band, first / tried);
                let mut energies = without[band].clone();
                let mut done = 0;
                let step = |to: i32| {
                    let more = to - std::mem::replace(&mut done, to);
                    energies.iter_mut().zip(&factors).for_each(|(e, factor)| *e *= factor.powi(more));
                    pair.ln_changes(band, &energies)
                };
                STEPS.into_iter().map(step).collect()
            };
            let (below, above) = (side(below.last()), side(above.first()));
            table.ln_changes.splice(..0, below.into_iter().rev());
            table.ln_changes.extend(above);
        }
        Ok(tables)
    }
}

/// What a law leaves of the energy of each path at one amplitude.
struct KeptEnergy {
    /// `[band][path]`; 0 where too little is left to tell, or was there before.
    shares: Vec<Vec<f32>>,
    least: f32,
    greatest: f32,
}

impl KeptEnergy {
    fn new(without: &[Vec<f32>], with: &[Vec<f32>]) -> Self {
        let (mut least, mut greatest) = (1.0f32, 1.0f32);
        let mut share = |(before, after): (&f32, &f32)| {
            if !before.is_normal() {
                return 0.0;
            }
            let share = if after.is_normal() { after / before } else { 0.0 };
            (least, greatest) = (least.min(share), greatest.max(share));
            share
        };
        let shares =
            without.iter().zip(with).map(|(a, b)| a.iter().zip(b).map(&mut share).collect()).collect();
        Self { shares, least, greatest }
    }

    /// The shares of a band at so many times that amplitude.
    fn in_band(&self, band: usize, times: f64) -> Vec<f32> {
        let one = |&share: &f32| match share {
            0.0 => 0.0,
            _ if times == 1.0 => share,
            _ if times == -1.0 => share.recip(),
            _ => share.powf(times as f32),
        };
        self.shares[band].iter().map(one).collect()
    }

    /// By how much the law lifts the logarithm of a path's energy at most at so many times that amplitude; infinite where that cannot be told.
    fn greatest_nepers(&self, times: f64) -> f64 {
        let nepers = |share: f32| times * f64::from(share).ln();
        nepers(self.least).max(nepers(self.greatest))
    }
}

/// Logarithm of the change of the energy of each bin of one band and pair, `[grid][bin]`.
#[derive(Clone)]
struct LawTable {
    grid: Vec<f64>,
    ln_changes: Vec<Vec<f64>>,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::infer::baseline::Baseline;
    use sabine_paths::laws::{LawParameter, LawTarget};

    #[test]
    fn every_place_of_the_grid_holds_what_the_law_does_there_and_what_is_too_loud_is_an_error() {
        let baseline = Baseline::of_laboratory(32);
        let view = baseline.room_view().unwrap();
        let pair = view.pair(1);
        let of_range = |low: f64, high: f64| {
            let a = LawParameter::new(high, [low, high], "dB");
            let formula = "a * reflections / (reflections + 3)";
            TabulatedLaw::new(
                Law::new("x", LawTarget::Path, None, formula, [("a", a)]).unwrap(),
                0,
                (low, high),
            )
        };
        for (low, high) in [(-12.0, 12.0), (-3.0, 24.0), (-30.0, 0.0), (0.0, 6.0)] {
            let law = of_range(low, high);
            let tables = law.tables(&pair).unwrap();
            for (place, &amplitude) in law.grid.iter().enumerate() {
                let energies = law.energies(&pair, amplitude).unwrap();
                for (band, table) in tables.iter().enumerate() {
                    assert_eq!(table.ln_changes.len(), law.grid.len());
                    let expected = pair.ln_changes(band, &energies[band]);
                    let off = table.ln_changes[place].iter().zip(&expected).map(|(a, b)| (a - b).abs());
                    let off = off.fold(0.0, f64::max);
                    assert!(off < 1e-4, "{low} to {high}, {amplitude} in band {band}: off by {off}");
                }
            }
        }
        // A law may take what it will, and add 200 dB.
        for (low, high) in [(-1500.0, 1.0), (-1.0, 1500.0), (-1500.0, 0.0)] {
            let refused = of_range(low, high).tables(&pair);
            assert_eq!(refused.is_err(), high > 1.0, "{low} to {high}");
        }
    }
}
