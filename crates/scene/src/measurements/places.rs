//! Places that a list of measurements names again and again, each once.

use crate::scene::{Receiver, Source};
use std::collections::{HashMap, HashSet};

/// Steps in which places are compared: 1 um. Below it lies the rounding of angles into coordinates.
const STEPS_PER_M: f64 = 1e6;

/// Where something stands and looks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    /// Its name, where the file has one.
    pub id: Option<String>,
    /// Position in metres.
    pub position_m: [f64; 3],
    /// Unit vector, where it is stated.
    pub axis: Option<[f64; 3]>,
}

/// What makes a place another one.
type Key = (Option<String>, [i64; 3], Option<[i64; 3]>);

/// Distinct places in order of first mention.
pub(super) struct Places {
    letter: &'static str,
    places: Vec<Place>,
    index: HashMap<Key, usize>,
}

impl Places {
    /// Places without a name are called `letter` and a number from 1.
    pub(super) fn new(letter: &'static str) -> Self {
        Self { letter, places: Vec::new(), index: HashMap::new() }
    }

    /// Index of a place, which is new or has been mentioned.
    pub(super) fn index(&mut self, place: Place) -> usize {
        let steps = |point: [f64; 3]| point.map(|c| (c * STEPS_PER_M).round() as i64);
        let key = (place.id.clone(), steps(place.position_m), place.axis.map(steps));
        let places = &mut self.places;
        *self.index.entry(key).or_insert_with(|| {
            places.push(place);
            places.len() - 1
        })
    }

    /// The places, each with a name of its own. An axis that is (1, 0, 0) everywhere is taken as not stated: SOFA demands one.
    pub(super) fn finish(self) -> Vec<Receiver> {
        let usual = self.places.iter().all(|place| place.axis == Some([1.0, 0.0, 0.0]));
        let taken: HashSet<String> = self.places.iter().filter_map(|place| place.id.clone()).collect();
        // Names that do not tell places apart are no names.
        let named = taken.len() == self.places.len() && taken.iter().all(|id| !id.trim().is_empty());
        let name = |(index, place): (usize, Place)| Receiver {
            id: place.id.filter(|_| named).unwrap_or_else(|| format!("{}{}", self.letter, index + 1)),
            position_m: place.position_m,
            axis: place.axis.filter(|_| !usual),
        };
        self.places.into_iter().enumerate().map(name).collect()
    }
}

impl From<Receiver> for Source {
    fn from(Receiver { id, position_m, axis }: Receiver) -> Self {
        Self { id, position_m, axis }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(id: Option<&str>, x: f64, axis: [f64; 3]) -> Place {
        Place { id: id.map(str::to_owned), position_m: [x, 0.0, 0.0], axis: Some(axis) }
    }

    #[test]
    fn places_are_counted_once() {
        let mut places = Places::new("r");
        let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let found = [(1.0, x), (2.0, x), (1.0 + 1e-9, x), (1.0, y)]
            .map(|(at, axis)| places.index(place(None, at, axis)));
        assert_eq!(found, [0, 1, 0, 2], "a head that turns is another receiver");
        let places = places.finish();
        assert_eq!(places.iter().map(|p| p.id.as_str()).collect::<Vec<_>>(), ["r1", "r2", "r3"]);
        assert_eq!(places[2].axis, Some(y));
    }

    #[test]
    fn a_view_that_is_the_usual_one_everywhere_is_none() {
        let mut places = Places::new("s");
        places.index(place(Some("stage"), 0.0, [1.0, 0.0, 0.0]));
        places.index(place(Some("stage"), 1.0, [1.0, 0.0, 0.0]));
        let places = places.finish();
        assert!(places.iter().all(|p| p.axis.is_none()));
        assert_eq!(places[1].id, "s2", "one name for two places is none");
    }
}
