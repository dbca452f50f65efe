//! What competes in a search: covariates, and shams of them.

use super::features::Features;
use crate::effects::Grammar;
use sabine_paths::laws::LawTarget;

/// A covariate that is none: it has the same distribution, and stands in no relation to what was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sham {
    /// Each response has that of another position.
    Positions,
    /// Directions turned at each position by an angle of its own.
    Axes,
    /// At each position the surface is another one.
    Surfaces,
    /// The second half of the compared time before the first.
    Times,
}

impl Sham {
    /// What was done, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Positions => "with the positions exchanged",
            Self::Axes => "with directions turned",
            Self::Surfaces => "with surfaces exchanged",
            Self::Times => "with times shifted",
        }
    }
}

/// A covariate (index) as it is, or a sham of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Column {
    pub covariate: usize,
    pub sham: Option<Sham>,
}

/// All covariates, in their order, and behind them their shams. Products have none of their own: their factors do.
pub(crate) fn columns(grammar: &Grammar, pairs: usize) -> Vec<Column> {
    let surfaces = grammar.covariates.iter().filter_map(|c| c.surface.as_deref());
    let mut names: Vec<&str> = surfaces.collect();
    names.dedup();
    let all = grammar.covariates.iter().enumerate();
    let mut columns: Vec<Column> =
        all.clone().map(|(covariate, _)| Column { covariate, sham: None }).collect();
    for (covariate, own) in all.filter(|(_, own)| own.forms.len() == 1) {
        let mut push = |sham| columns.push(Column { covariate, sham: Some(sham) });
        if pairs > 1 {
            push(Sham::Positions);
        }
        if own.has_direction() {
            push(Sham::Axes);
        }
        if own.target == LawTarget::Reflection && names.len() > 1 {
            push(Sham::Surfaces);
        }
        push(Sham::Times);
    }
    columns
}

/// Where shams take their values from.
pub(crate) struct ShamPlaces {
    /// The pair whose values each pair has, `[pair]`: a pair of its own for each, and never itself.
    pub pairs: Vec<usize>,
    /// By how many surfaces each pair's are moved on, from 1 to one less than there are.
    pub surfaces: Vec<usize>,
}

impl Column {
    /// What the column is in the bins of a pair and band; none for a sham that the covariate has not.
    pub fn values(
        self,
        (features, grammar, places): (&Features, &Grammar, &ShamPlaces),
        (pair, band, count): (usize, usize, usize),
    ) -> Option<Vec<f64>> {
        let covariate = self.covariate;
        match self.sham {
            None => Some(features.of(pair, band, covariate, count)),
            Some(Sham::Positions) => Some(features.of(places.pairs[pair], band, covariate, count)),
            Some(Sham::Axes) => features.turned(pair, band, covariate, count),
            Some(Sham::Surfaces) => {
                // Covariates of one form, surface by surface.
                let name = grammar.covariates[covariate].forms[0].name;
                let of_form: Vec<usize> = (0..grammar.covariates.len())
                    .filter(|&c| {
                        grammar.covariates[c].surface.is_some() && grammar.covariates[c].forms[0].name == name
                    })
                    .collect();
                let own = of_form.iter().position(|&c| c == covariate)?;
                let other = of_form[(own + places.surfaces[pair]) % of_form.len()];
                Some(features.of(pair, band, other, count))
            }
            Some(Sham::Times) => {
                let values = features.of(pair, band, covariate, count);
                Some((0..count).map(|bin| values[(bin + count / 2) % count]).collect())
            }
        }
    }
}

impl ShamPlaces {
    /// Draws them for the pairs that are used: the others stay as they are.
    pub fn draw(used: &[usize], pairs: usize, surfaces: usize, seed: u64) -> Self {
        use rand::seq::SliceRandom;
        use rand::{Rng, SeedableRng};
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed ^ 0x5AA3);
        let mut order = used.to_vec();
        order.shuffle(&mut random);
        let mut places: Vec<usize> = (0..pairs).collect();
        // Each takes from the next in a circle: nobody stays.
        for (i, &pair) in order.iter().enumerate() {
            places[pair] = order[(i + 1) % order.len()];
        }
        let moved = |_| if surfaces > 1 { random.random_range(1..surfaces) } else { 0 };
        Self { pairs: places, surfaces: (0..pairs).map(moved).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_keeps_what_is_exchanged() {
        let used = [0, 1, 3, 4, 6];
        let places = ShamPlaces::draw(&used, 7, 4, 9);
        let mut taken: Vec<usize> = used.iter().map(|&p| places.pairs[p]).collect();
        assert!(used.iter().all(|&p| places.pairs[p] != p) && [2, 5].iter().all(|&p| places.pairs[p] == p));
        taken.sort_unstable();
        assert_eq!(taken, used);
        assert!(places.surfaces.iter().all(|s| (1..4).contains(s)));
    }
}
