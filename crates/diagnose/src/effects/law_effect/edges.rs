//! Edges of bands in a law: where one lies between two centres, nothing changes with it.

use sabine_acoustics::Bands;
use sabine_paths::laws::{Law, LawError, LawParameter, Unit};

/// Most combinations of edges that are told apart.
pub(super) const MAX_COMBINATIONS: usize = 64;

/// A law with each edge of bands ([`Law::is_edge_of_bands`]) in one place, and what that is in words.
pub(super) struct PlacedEdges {
    pub law: Law,
    /// Empty where the law has one place for its edges.
    pub words: String,
}

/// Names of the edges of bands in a law that have an interval.
fn open_edges(law: &Law) -> Vec<String> {
    let is_open = |(name, p): &(&str, &LawParameter)| p.low < p.high && law.is_edge_of_bands(name);
    law.parameters().filter(is_open).map(|(name, _)| name.to_owned()).collect()
}

/// The interval of an edge, cut where a band has its centre.
fn cut(own: &LawParameter, bands: Bands) -> Vec<f64> {
    let per_unit = Unit::parse(&own.unit).map_or(1.0, |unit| unit.scale());
    let mut ends = vec![own.low];
    ends.extend(bands.iter_hz().map(|hz| hz / per_unit).filter(|f| *f > own.low && *f < own.high));
    ends.push(own.high);
    ends
}

/// That no more combinations of places are to be told apart than can be: how many there are.
pub(super) fn check(law: &Law, bands: Bands) -> Result<(), usize> {
    let edges = open_edges(law);
    let own = law.parameters().filter(|(name, _)| edges.iter().any(|edge| edge == name));
    let count = own.map(|(_, p)| cut(p, bands).len() - 1).fold(1, usize::saturating_mul);
    if count > MAX_COMBINATIONS { Err(count) } else { Ok(()) }
}

/// The law with its edges in every place that the bands tell apart.
pub(super) fn placed(law: &Law, bands: Bands) -> Vec<PlacedEdges> {
    let mut all = vec![PlacedEdges { law: law.clone(), words: String::new() }];
    for edge in &open_edges(law) {
        all = all.iter().flat_map(|one| one.with(edge, bands)).collect();
    }
    all
}

impl PlacedEdges {
    /// The same with one edge in each of its places.
    fn with(&self, edge: &str, bands: Bands) -> Vec<Self> {
        let Some((place, (_, own))) = self.law.parameters().enumerate().find(|(_, (name, _))| *name == edge)
        else {
            return Vec::new();
        };
        let ends = cut(own, bands);
        let several = ends.len() > 2;
        let one = |ends: &[f64]| -> Result<Self, LawError> {
            let [low, high] = [ends[0], ends[1]];
            let (mut values, mut intervals): (Vec<f64>, Vec<[f64; 2]>) =
                self.law.parameters().map(|(_, p)| (p.value, [p.low, p.high])).unzip();
            // A band whose centre is the edge lies above it: its upper end is one of the values between the two.
            values[place] = if own.value > low && own.value <= high { own.value } else { high };
            intervals[place] = [low, high];
            let comma = if self.words.is_empty() { "" } else { ", " };
            let words = if several {
                format!("{}{comma}{edge} from {low} to {high} {}", self.words, own.unit)
            } else {
                self.words.clone()
            };
            Ok(Self { law: self.law.with_fitted(&values, &intervals)?, words })
        };
        ends.windows(2).filter_map(|ends| one(ends).ok()).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_paths::laws::LawTarget;

    #[test]
    fn an_edge_has_one_place_between_each_two_centres_of_bands() {
        let bands = Bands::octaves(250.0, 4000.0).unwrap();
        let law = |low: f64, value: f64, high: f64| {
            let parameters = [
                ("a", LawParameter::new(1.0, [0.0, 2.0], "dB")),
                ("f0", LawParameter::new(value, [low, high], "kHz")),
            ];
            Law::new("x", LawTarget::Path, None, "-a * above(frequency_hz, f0)", parameters).unwrap()
        };
        let places = |law: &Law| -> Vec<(f64, String)> {
            let value = |law: &Law| law.parameters().nth(1).unwrap().1.value;
            placed(law, bands).into_iter().map(|one| (value(&one.law), one.words)).collect()
        };
        let found = places(&law(0.4, 0.7, 2.0));
        let words = ["f0 from 0.4 to 0.5 kHz", "f0 from 0.5 to 1 kHz", "f0 from 1 to 2 kHz"];
        assert_eq!(found, [(0.5, words[0].into()), (0.7, words[1].into()), (2.0, words[2].into())]);
        // Each place is that of another law: what is above it in the bands differs.
        let above = |law: &Law| -> Vec<bool> {
            bands.iter_hz().map(|hz| law.value(|_| Some(hz)).unwrap() != 0.0).collect()
        };
        let all = placed(&law(0.4, 0.7, 2.0), bands);
        assert_eq!(above(&all[0].law), [false, true, true, true, true]);
        assert_eq!(above(&all[1].law), [false, false, true, true, true]);
        assert_eq!(above(&all[2].law), [false, false, false, true, true]);
        assert_eq!(places(&law(0.6, 0.7, 0.9)), [(0.7, String::new())]);
        assert_eq!(places(&law(0.7, 0.7, 0.7)), [(0.7, String::new())]);
    }

    #[test]
    fn too_many_combinations_are_counted_and_not_made() {
        let bands = Bands::octaves(125.0, 8000.0).unwrap();
        let edges = |count: usize| {
            let parameter = |i: usize| (format!("f{i}"), LawParameter::new(1.0, [0.1, 9.0], "kHz"));
            let names: Vec<(String, LawParameter)> = (0..count).map(parameter).collect();
            let formula: Vec<String> =
                names.iter().map(|(name, _)| format!("above(frequency_hz, {name})")).collect();
            let a = ("a".to_owned(), LawParameter::new(1.0, [0.0, 2.0], "dB"));
            let formula = format!("-a * ({})", formula.join(" + "));
            Law::new("x", LawTarget::Path, None, &formula, names.into_iter().chain([a])).unwrap()
        };
        // Seven octaves cut an interval into eight.
        assert_eq!((check(&edges(1), bands), check(&edges(2), bands)), (Ok(()), Ok(())));
        assert_eq!(check(&edges(3), bands), Err(512));
    }
}
