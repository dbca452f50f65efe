//! A law whose amplitude varies, tabulated for the bins of a traced room.

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

    /// Tables of all bands. The decibels of a law go with its amplitude: each twelfth multiplies the energy of a path by the same factor.
    fn tables(&self, pair: &TracedPairView<'_>) -> Result<Vec<LawTable>, Error> {
        let without = pair.energies(pair.room().materials())?;
        let zero = self.grid.iter().position(|x| *x == 0.0).unwrap_or(0);
        let (below, above) = (self.grid[..zero].iter().rev(), self.grid[zero + 1..].iter());
        let one_side = |amplitudes: Vec<f64>| -> Result<Vec<Vec<Vec<f64>>>, Error> {
            let (Some(&first), Some(&last)) = (amplitudes.first(), amplitudes.last()) else {
                return Ok(vec![Vec::new(); without.len()]);
            };
            // Where the law would be too loud is an error, not a number.
            self.energies(pair, last)?;
            let stepped = self.energies(pair, first)?;
            let in_band = |band: usize| {
                let mut energies = without[band].clone();
                let factors: Vec<f32> = energies
                    .iter()
                    .zip(&stepped[band])
                    .map(|(e, s)| if *e > 0.0 { s / e } else { 0.0 })
                    .collect();
                let mut done = 0;
                let step = |to: i32| {
                    let more = to - std::mem::replace(&mut done, to);
                    energies.iter_mut().zip(&factors).for_each(|(e, factor)| *e *= factor.powi(more));
                    pair.ln_changes(band, &energies)
                };
                STEPS.into_iter().map(step).collect()
            };
            Ok((0..without.len()).map(in_band).collect())
        };
        let (below, above) = (one_side(below.copied().collect())?, one_side(above.copied().collect())?);
        let joined = |(mut below, above): (Vec<Vec<f64>>, Vec<Vec<f64>>)| {
            below.reverse();
            below.push(vec![0.0; above.first().or(below.first()).map_or(0, Vec::len)]);
            below.extend(above);
            LawTable { grid: self.grid.clone(), ln_changes: below }
        };
        Ok(below.into_iter().zip(above).map(joined).collect())
    }
}

/// Logarithm of the change of the energy of each bin of one band and pair, `[grid][bin]`.
#[derive(Clone)]
struct LawTable {
    grid: Vec<f64>,
    ln_changes: Vec<Vec<f64>>,
}
