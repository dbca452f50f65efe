//! What formulas ask of paths, column by column.

use crate::laws::angles::azimuth_degrees;
use crate::laws::bound::BoundLaw;
use crate::laws::formula::Op;
use crate::laws::variable::{Named, Variable};
use crate::path_set::PathSet;
use std::ops::Range;

/// Paths that are worked on together.
pub(crate) const BLOCK: usize = 256;

/// A number for each path of a block.
pub(crate) type Slot = [f64; BLOCK];

/// One column.
#[derive(Clone, Debug, PartialEq)]
enum Column {
    Length,
    Time,
    /// Since the arrival of the shortest path.
    SinceFirst,
    /// Meetings with one material, or with any; or scatterings.
    Count(Counted, Vec<u16>),
    /// Angles of departure (0) or arrival (1).
    Azimuth(usize),
    Elevation(usize),
    Cosine(usize, [f64; 3]),
}

/// What is counted along a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Counted {
    Reflections,
    Scatterings,
    Material(usize),
}

/// The columns that laws ask for.
pub(crate) struct Columns<'p> {
    paths: &'p PathSet,
    speed_m_s: f64,
    first_m: f64,
    columns: Vec<Column>,
}

impl<'p> Columns<'p> {
    pub fn new(paths: &'p PathSet, speed_m_s: f64) -> Self {
        let first_m = paths.lengths_m().iter().copied().fold(f32::INFINITY, f32::min);
        Self { paths, speed_m_s, first_m: f64::from(first_m), columns: Vec::new() }
    }

    /// Number of the column of a variable, which is made if there is none yet.
    pub fn place_of(&mut self, bound: &BoundLaw, op: Op) -> usize {
        let counted = match op {
            Op::Named(Named::Hits, index) => Some(Counted::Material(bound.named[usize::from(index)])),
            Op::Variable(Variable::Reflections) => Some(Counted::Reflections),
            Op::Variable(Variable::Scatterings) => Some(Counted::Scatterings),
            _ => None,
        };
        if let Some(counted) = counted {
            let known = self.columns.iter().position(|c| matches!(c, Column::Count(of, _) if *of == counted));
            return known.unwrap_or_else(|| {
                self.columns.push(Column::Count(counted, self.paths.counts(counted)));
                self.columns.len() - 1
            });
        }
        let axis = |end: usize| bound.axes[end].unwrap_or([0.0; 3]);
        let column = match op {
            Op::Variable(Variable::Length) => Column::Length,
            Op::Variable(Variable::DepartureAzimuth) => Column::Azimuth(0),
            Op::Variable(Variable::ArrivalAzimuth) => Column::Azimuth(1),
            Op::Variable(Variable::DepartureElevation) => Column::Elevation(0),
            Op::Variable(Variable::ArrivalElevation) => Column::Elevation(1),
            Op::Variable(Variable::DepartureCos) => Column::Cosine(0, axis(0)),
            Op::Variable(Variable::ArrivalCos) => Column::Cosine(1, axis(1)),
            Op::Variable(Variable::TimeAfterDirect) => Column::SinceFirst,
            // Files of rendered responses begin at the emission. What paths do not tell was refused when names were looked for.
            _ => Column::Time,
        };
        let known = self.columns.iter().position(|c| *c == column);
        known.unwrap_or_else(|| {
            self.columns.push(column);
            self.columns.len() - 1
        })
    }

    /// Number of paths.
    pub fn len(&self) -> usize {
        self.paths.len()
    }

    /// Slots to fill.
    pub fn new_slots(&self) -> Vec<Slot> {
        vec![[0.0; BLOCK]; self.columns.len()]
    }

    /// Fills the slots with what is known of some paths.
    pub fn fill(&self, range: &Range<usize>, slots: &mut [Slot]) {
        let lengths_m = &self.paths.lengths_m()[range.clone()];
        let direction =
            |end: usize, i: usize| if end == 0 { self.paths.departure(i) } else { self.paths.arrival(i) };
        for (column, slot) in self.columns.iter().zip(slots) {
            let out = slot[..range.len()].iter_mut();
            match column {
                Column::Length => out.zip(lengths_m).for_each(|(out, &m)| *out = f64::from(m)),
                Column::Time => {
                    out.zip(lengths_m).for_each(|(out, &m)| *out = f64::from(m) / self.speed_m_s);
                }
                Column::SinceFirst => out
                    .zip(lengths_m)
                    .for_each(|(out, &m)| *out = (f64::from(m) - self.first_m) / self.speed_m_s),
                Column::Count(_, counts) => {
                    out.zip(&counts[range.clone()]).for_each(|(out, &n)| *out = f64::from(n));
                }
                Column::Azimuth(end) => out.zip(range.clone()).for_each(|(out, i)| {
                    let [x, y, _] = direction(*end, i);
                    *out = azimuth_degrees(x, y);
                }),
                Column::Elevation(end) => out.zip(range.clone()).for_each(|(out, i)| {
                    *out = direction(*end, i)[2].clamp(-1.0, 1.0).asin().to_degrees();
                }),
                Column::Cosine(end, axis) => out.zip(range.clone()).for_each(|(out, i)| {
                    let direction = direction(*end, i);
                    *out = (0..3).map(|k| axis[k] * direction[k]).sum();
                }),
            }
        }
    }
}
