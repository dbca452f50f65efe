//! Formulas on blocks of paths.
//!
//! What is the same for all paths is computed once for each band, what is the same in all bands once for each path; only the rest is computed for
//! each path in each band.

use crate::laws::arithmetic::{binary, fault_of, power, resonance, unary};
use crate::laws::bound::BoundLaw;
use crate::laws::error::{LawError, Place};
use crate::laws::formula::{Binary, Op, Unary};
use crate::laws::variable::scope;
use crate::reweighting::LANES;
use sabine_acoustics::Bands;

/// Paths that are worked on together.
pub(crate) const BLOCK: usize = 256;

/// A number for each path of a block.
pub(crate) type Slot = [f64; BLOCK];

/// Where the value of an operation is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Home {
    /// In the table by band: the same for all paths.
    Table,
    /// In a column of the paths.
    Column(usize),
    /// In a slot: the same in all bands.
    Slot(usize),
    /// In as many slots as there are lanes.
    Lanes(usize),
}

/// A law prepared for bands and for columns of paths.
pub(crate) struct Program<'l> {
    pub bound: &'l BoundLaw,
    /// `[operation][band]`.
    by_band: Vec<Vec<f64>>,
    homes: Vec<Home>,
    slots: usize,
    bands: Bands,
}

/// An argument: one number, or one for each path.
#[derive(Clone, Copy)]
enum Argument<'s> {
    One(f64),
    Many(&'s [f64]),
}

impl Argument<'_> {
    fn at(self, path: usize) -> f64 {
        match self {
            Self::One(value) => value,
            Self::Many(values) => values[path],
        }
    }
}

impl<'l> Program<'l> {
    /// Prepares a law. `column` gives the number of the column that holds a variable.
    pub fn new(
        bound: &'l BoundLaw,
        bands: Bands,
        mut column: impl FnMut(Op) -> usize,
    ) -> Result<Self, LawError> {
        let mut slots = 0;
        let mut homes = Vec::with_capacity(bound.law.scopes.len());
        for (&op, &depends_on) in bound.law.formula.ops.iter().zip(&bound.law.scopes) {
            homes.push(match (op, depends_on & !scope::BAND, depends_on & scope::BAND) {
                (_, 0, _) => Home::Table,
                (Op::Variable(_) | Op::Hits(_), ..) => Home::Column(column(op)),
                (_, _, 0) => {
                    slots += 1;
                    Home::Slot(slots - 1)
                }
                _ => {
                    slots += LANES;
                    Home::Lanes(slots - LANES)
                }
            });
        }
        Ok(Self { bound, by_band: bound.values_by_band(bands)?, homes, slots, bands })
    }

    /// Slots to compute in.
    pub fn new_slots(&self) -> Vec<Slot> {
        vec![[0.0; BLOCK]; self.slots]
    }

    /// Computes the law for the first `count` paths of a block, of which the first has the number `path`, in `lanes` bands from `band` on.
    pub fn run(
        &self,
        columns: &[Slot],
        slots: &mut [Slot],
        (path, count): (usize, usize),
        (band, lanes): (usize, usize),
    ) -> Result<(), LawError> {
        for (at, home) in self.homes.iter().enumerate() {
            let (first, lanes) = match home {
                Home::Table | Home::Column(_) => continue,
                Home::Slot(slot) => (*slot, 1),
                Home::Lanes(slot) => (*slot, lanes),
            };
            for lane in 0..lanes {
                let (before, own) = slots.split_at_mut(first + lane);
                let out = &mut own[0][..count];
                let argument = |index: u16| self.argument(index.into(), columns, before, count, (band, lane));
                if !compute(self.bound.law.formula.ops[at], argument, out) {
                    let wrong = out.iter().position(|v| !v.is_finite()).unwrap_or(0);
                    let in_band = matches!(home, Home::Lanes(_)).then(|| self.bands.nominal_hz(band + lane));
                    let place = Place { path: Some(path + wrong), band_hz: in_band };
                    let zero = match self.bound.law.formula.ops[at] {
                        Op::Binary(Binary::Divide, _, divisor) => argument(divisor).at(wrong) == 0.0,
                        _ => false,
                    };
                    let fault = fault_of(&self.bound.law.formula, at, zero, place);
                    return Err(self.bound.law.error_at(at, fault));
                }
            }
        }
        Ok(())
    }

    fn argument<'s>(
        &'s self,
        of: usize,
        columns: &'s [Slot],
        slots: &'s [Slot],
        count: usize,
        (band, lane): (usize, usize),
    ) -> Argument<'s> {
        match self.homes[of] {
            Home::Table => Argument::One(self.by_band[of][band + lane]),
            Home::Column(column) => Argument::Many(&columns[column][..count]),
            Home::Slot(slot) => Argument::Many(&slots[slot][..count]),
            Home::Lanes(slot) => Argument::Many(&slots[slot + lane][..count]),
        }
    }

    /// The value of the law for each path after [`Program::run`], in one lane.
    pub fn result(
        &self,
        columns: &[Slot],
        slots: &[Slot],
        count: usize,
        (band, lane): (usize, usize),
        mut take: impl FnMut(usize, f64),
    ) {
        match self.argument(self.homes.len() - 1, columns, slots, count, (band, lane)) {
            Argument::One(value) => (0..count).for_each(|i| take(i, value)),
            Argument::Many(values) => values.iter().enumerate().for_each(|(i, &value)| take(i, value)),
        }
    }
}

/// Computes one operation for all paths of a block; false where a result is not finite.
fn compute<'s>(op: Op, argument: impl Fn(u16) -> Argument<'s>, out: &mut [f64]) -> bool {
    match op {
        Op::Unary(function, a) => {
            let a = argument(a);
            match function {
                Unary::Negate => each(a, out, |x| -x),
                Unary::Abs => each(a, out, f64::abs),
                Unary::Sqrt => each(a, out, f64::sqrt),
                other => each(a, out, |x| unary(other, x)),
            }
        }
        Op::Binary(function, a, b) => {
            let (a, b) = (argument(a), argument(b));
            match (function, b) {
                (Binary::Add, _) => pairs(a, b, out, |a, b| a + b),
                (Binary::Subtract, _) => pairs(a, b, out, |a, b| a - b),
                (Binary::Multiply, _) => pairs(a, b, out, |a, b| a * b),
                // Not by the reciprocal: the same number as one path at a time.
                (Binary::Divide, _) => pairs(a, b, out, |a, b| a / b),
                (Binary::Power, Argument::One(2.0)) => each(a, out, |x| x * x),
                (Binary::Power, Argument::One(exponent)) => each(a, out, |x| power(x, exponent)),
                (Binary::Above, _) => pairs(a, b, out, |a, b| if a >= b { 1.0 } else { 0.0 }),
                (Binary::Below, _) => pairs(a, b, out, |a, b| if a < b { 1.0 } else { 0.0 }),
                (other, _) => pairs(a, b, out, |a, b| binary(other, a, b)),
            }
        }
        Op::Resonance([f, f0, q]) => {
            let (f, f0, q) = (argument(f), argument(f0), argument(q));
            out.iter_mut().enumerate().for_each(|(i, out)| *out = resonance(f.at(i), f0.at(i), q.at(i)));
        }
        // Leaves have no slot.
        Op::Number(_) | Op::Parameter(_) | Op::Variable(_) | Op::Hits(_) => {}
    }
    out.iter().fold(true, |finite, value| finite & (value.abs() <= f64::MAX))
}

#[inline]
fn each(a: Argument<'_>, out: &mut [f64], function: impl Fn(f64) -> f64) {
    match a {
        Argument::One(a) => out.fill(function(a)),
        Argument::Many(a) => out.iter_mut().zip(a).for_each(|(out, &a)| *out = function(a)),
    }
}

#[inline]
fn pairs(a: Argument<'_>, b: Argument<'_>, out: &mut [f64], function: impl Fn(f64, f64) -> f64) {
    match (a, b) {
        (Argument::One(a), Argument::One(b)) => out.fill(function(a, b)),
        (Argument::One(a), Argument::Many(b)) => {
            out.iter_mut().zip(b).for_each(|(out, &b)| *out = function(a, b));
        }
        (Argument::Many(a), Argument::One(b)) => {
            out.iter_mut().zip(a).for_each(|(out, &a)| *out = function(a, b));
        }
        (Argument::Many(a), Argument::Many(b)) => {
            out.iter_mut().zip(a.iter().zip(b)).for_each(|(out, (&a, &b))| *out = function(a, b));
        }
    }
}
