//! What a term computes from the traced paths before a fit, once for each expansion of the prediction.

use std::any::Any;

/// A table of one band of one pair, of a type that its term knows.
pub(crate) type Table = Box<dyn Any + Send + Sync>;

/// The tables of one term, `[pair][band]`: for the time bins and, where it acts on them, for single early reflections.
#[derive(Default)]
pub struct Tables {
    bins: Vec<Vec<Table>>,
    reflections: Vec<Vec<Table>>,
}

fn boxed<T: Any + Send + Sync>(tables: Vec<Vec<T>>) -> Vec<Vec<Table>> {
    let one = |table: T| -> Table { Box::new(table) };
    tables.into_iter().map(|bands| bands.into_iter().map(one).collect()).collect()
}

impl Tables {
    /// Tables for the time bins, `[pair][band]`.
    pub fn of_bins<T: Any + Send + Sync>(bins: Vec<Vec<T>>) -> Self {
        Self { bins: boxed(bins), reflections: Vec::new() }
    }

    /// The same, with tables of the same type in which each early reflection has the place of a bin.
    #[must_use]
    pub fn with_reflections<T: Any + Send + Sync>(self, reflections: Vec<Vec<T>>) -> Self {
        Self { reflections: boxed(reflections), ..self }
    }

    #[cfg(test)]
    pub(crate) fn boxed(bins: Vec<Vec<Table>>) -> Self {
        Self { bins, reflections: Vec::new() }
    }

    /// The table of a pair and band.
    pub(crate) fn of(&self, pair: usize, band: usize, reflections: bool) -> Option<&(dyn Any + Send + Sync)> {
        let all = if reflections { &self.reflections } else { &self.bins };
        all.get(pair)?.get(band).map(|table| &**table)
    }
}

/// Why a term has no tables.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Unprepared {
    /// The term takes no part in this diagnosis, for a reason that becomes a note: one sentence.
    #[error("{0}")]
    Refused(String),
    /// The diagnosis cannot go on.
    #[error(transparent)]
    Failed(#[from] crate::error::Error),
}

/// Between which place of a grid and the next a value lies, and which share of the way from the one to the other; outside, at its end.
pub(crate) fn place_in(grid: &[f64], x: f64) -> (usize, f64) {
    let x = x.clamp(grid[0], grid[grid.len() - 1]);
    let upper = grid.iter().position(|&g| g >= x).unwrap_or(1).max(1);
    let (low, high) = (grid[upper - 1], grid[upper]);
    (upper - 1, (x - low) / (high - low))
}

/// What a table, `[grid][bin]`, says between the places of its grid.
pub(crate) fn between(grid: &[f64], table: &[Vec<f64>], bin: usize, x: f64) -> f64 {
    let (lower, share) = place_in(grid, x);
    table[lower][bin] * (1.0 - share) + table[lower + 1][bin] * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_found_by_pair_band_and_kind_and_only_as_what_it_is() {
        let tables = Tables::of_bins(vec![vec![1u8, 2], vec![3, 4]]).with_reflections(vec![vec![5u8]]);
        let of = |pair, band, reflections| {
            tables.of(pair, band, reflections).and_then(|t| t.downcast_ref::<u8>()).copied()
        };
        assert_eq!([of(1, 0, false), of(0, 1, false), of(0, 0, true)], [Some(3), Some(2), Some(5)]);
        assert_eq!([of(1, 0, true), of(2, 0, false)], [None, None]);
        assert!(tables.of(0, 0, false).is_some_and(|t| t.downcast_ref::<f64>().is_none()));
    }

    #[test]
    fn straight_lines_join_the_places_of_a_grid() {
        let (grid, table) = ([-1.0, 0.0, 2.0], [vec![4.0], vec![0.0], vec![6.0]]);
        for (x, expected) in [(-2.0, 4.0), (-0.5, 2.0), (0.0, 0.0), (1.0, 3.0), (9.0, 6.0)] {
            assert!((between(&grid, &table, 0, x) - expected).abs() < 1e-12, "{x}");
        }
    }
}
