//! Formulas on blocks of paths.
//!
//! What is the same for all paths is computed once for each band, what is the same in all bands once for each path; only the rest is computed for
//! each path in each band.

use crate::laws::angles::cos_degrees;
use crate::laws::arithmetic::{binary, fault_of, power, resonance, unary};
use crate::laws::bound::BoundLaw;
use crate::laws::columns::{BLOCK, Columns, Slot};
use crate::laws::error::{LawError, Place};
use crate::laws::formula::{Binary, Op, Unary};
use crate::laws::variable::scope;
use crate::parallel::for_each_index;
use crate::reweighting::{LANES, exp};
use sabine_acoustics::Bands;
use std::ops::Range;

/// Paths that one thread prepares at a time.
const STRETCH: usize = 64 * BLOCK;

/// Angles that are brought into one turn without loss.
const MAX_DEGREES: f64 = 1e6;

/// Exponents that single precision holds.
const SINGLE_EXPONENT: f64 = 86.0;

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
    /// Nowhere: nobody asks for it.
    Nowhere,
}

/// A law prepared for bands and for paths.
pub(crate) struct Program<'l> {
    pub bound: &'l BoundLaw,
    /// `[operation][band]`.
    by_band: Vec<Vec<f64>>,
    homes: Vec<Home>,
    slots: usize,
    bands: Bands,
    /// Values of the paths' own parts, the same in all bands, that others are made of: `[stretch][part][path]`.
    parts: Vec<Vec<Vec<f64>>>,
}

/// An argument: one number, or one for each path.
#[derive(Clone, Copy)]
pub(crate) enum Argument<'s> {
    One(f64),
    Many(&'s [f64]),
}

impl Argument<'_> {
    pub fn at(self, path: usize) -> f64 {
        match self {
            Self::One(value) => value,
            Self::Many(values) => values[path],
        }
    }
}

impl<'l> Program<'l> {
    /// Prepares a law and computes what is the same in all bands, on all threads.
    pub fn new(bound: &'l BoundLaw, bands: Bands, columns: &mut Columns<'_>) -> Result<Self, LawError> {
        let (ops, scopes) = (&bound.law.formula.ops, &bound.law.scopes);
        let kind = |scope: u8| (scope & !scope::BAND != 0, scope & scope::BAND != 0);
        let mut slots = 0;
        let mut homes: Vec<Home> = Vec::with_capacity(ops.len());
        for (&op, &depends_on) in ops.iter().zip(scopes) {
            homes.push(match (kind(depends_on), op) {
                ((false, _), _) => Home::Table,
                ((true, true), _) => Home::Nowhere,
                ((true, false), Op::Variable(_) | Op::Named(..)) => Home::Column(columns.place_of(bound, op)),
                ((true, false), _) => {
                    slots += 1;
                    Home::Slot(slots - 1)
                }
            });
        }
        let by_band = bound.values_by_band(bands)?;
        let mut program = Self { bound, by_band, homes, slots, bands, parts: Vec::new() };
        let wanted = program.parts_wanted();
        program.parts = program.computed(columns, &wanted)?;
        program.slots = 0;
        for (at, &depends_on) in scopes.iter().enumerate() {
            program.homes[at] = match kind(depends_on) {
                (false, _) => Home::Table,
                (true, false) => wanted.iter().position(|w| *w == at).map_or(Home::Nowhere, Home::Column),
                (true, true) => {
                    program.slots += LANES;
                    Home::Lanes(program.slots - LANES)
                }
            };
        }
        Ok(program)
    }

    /// Operations of the paths alone that are the result, or an argument of what depends on the band too.
    fn parts_wanted(&self) -> Vec<usize> {
        let (ops, scopes) = (&self.bound.law.formula.ops, &self.bound.law.scopes);
        let is_part = |at: usize| scopes[at] & !scope::BAND != 0 && scopes[at] & scope::BAND == 0;
        let mixed = |at: usize| scopes[at] & !scope::BAND != 0 && !is_part(at);
        let mut wanted: Vec<usize> = (0..ops.len())
            .filter(|&at| mixed(at))
            .flat_map(|at| match ops[at] {
                Op::Unary(_, a) => vec![a],
                Op::Binary(_, a, b) => vec![a, b],
                Op::Resonance(of) => of.to_vec(),
                _ => Vec::new(),
            })
            .map(usize::from)
            .chain([ops.len() - 1])
            .filter(|&at| is_part(at))
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        wanted
    }

    /// The wanted operations for all paths.
    fn computed(&self, columns: &Columns<'_>, wanted: &[usize]) -> Result<Vec<Vec<Vec<f64>>>, LawError> {
        if wanted.is_empty() {
            return Ok(Vec::new());
        }
        let (count, paths) = (columns.len().div_ceil(STRETCH), columns.len());
        let stretch = |stretch: usize| {
            let (mut filled, mut slots) = (columns.new_slots(), self.new_slots());
            let mut parts = vec![Vec::with_capacity(STRETCH); wanted.len()];
            let range = stretch * STRETCH..paths.min((stretch + 1) * STRETCH);
            for start in range.clone().step_by(BLOCK) {
                let block = start..range.end.min(start + BLOCK);
                columns.fill(&block, &mut filled);
                let filled: Vec<&[f64]> = filled.iter().map(|slot| &slot[..]).collect();
                self.run(&filled, &mut slots, (start, block.len()), (0, 1))?;
                for (part, &at) in parts.iter_mut().zip(wanted) {
                    match self.argument(at, &filled, &slots, block.len(), (0, 0)) {
                        Argument::One(value) => part.resize(part.len() + block.len(), value),
                        Argument::Many(values) => part.extend_from_slice(values),
                    }
                }
            }
            Ok(parts)
        };
        for_each_index(count, stretch).into_iter().collect()
    }

    /// A part for some paths of one block.
    fn part(&self, part: usize, range: &Range<usize>) -> &[f64] {
        let (stretch, start) = (range.start / STRETCH, range.start % STRETCH);
        &self.parts[stretch][part][start..start + range.len()]
    }

    /// Slots to compute in.
    pub fn new_slots(&self) -> Vec<Slot> {
        vec![[0.0; BLOCK]; self.slots]
    }

    /// Computes the law for some paths, at most [`BLOCK`], in `lanes` bands from `band` on.
    pub fn in_bands(
        &self,
        slots: &mut [Slot],
        range: &Range<usize>,
        bands: (usize, usize),
    ) -> Result<(), LawError> {
        let columns: Vec<&[f64]> =
            (0..self.parts.first().map_or(0, Vec::len)).map(|part| self.part(part, range)).collect();
        self.run(&columns, slots, (range.start, range.len()), bands)
    }

    /// The value of the law for each of these paths after [`Program::in_bands`], in one band.
    pub fn result<'s>(
        &'s self,
        slots: &'s [Slot],
        range: &Range<usize>,
        (band, lane): (usize, usize),
    ) -> Argument<'s> {
        let last = self.homes.len() - 1;
        match self.homes[last] {
            Home::Column(part) => Argument::Many(self.part(part, range)),
            Home::Lanes(slot) => Argument::Many(&slots[slot + lane][..range.len()]),
            _ => Argument::One(self.by_band[last][band + lane]),
        }
    }

    /// Whether the result is the same for all paths.
    pub fn is_uniform(&self) -> bool {
        self.homes.last() == Some(&Home::Table)
    }

    /// Computes all operations that have slots, for `count` paths, of which the first has the number `path`.
    fn run(
        &self,
        columns: &[&[f64]],
        slots: &mut [Slot],
        (path, count): (usize, usize),
        (band, lanes): (usize, usize),
    ) -> Result<(), LawError> {
        for (at, home) in self.homes.iter().enumerate() {
            let (first, lanes) = match home {
                Home::Table | Home::Column(_) | Home::Nowhere => continue,
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
        columns: &[&'s [f64]],
        slots: &'s [Slot],
        count: usize,
        (band, lane): (usize, usize),
    ) -> Argument<'s> {
        match self.homes[of] {
            Home::Column(column) => Argument::Many(&columns[column][..count]),
            Home::Slot(slot) => Argument::Many(&slots[slot][..count]),
            Home::Lanes(slot) => Argument::Many(&slots[slot + lane][..count]),
            // What is nowhere is asked for by nobody.
            Home::Table | Home::Nowhere => Argument::One(self.by_band[of][band + lane]),
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
                // What lies within single precision is finite.
                Unary::Exp if exponentials(a, out) => return true,
                Unary::CosDegrees if within(a, MAX_DEGREES) => each(a, out, cos_degrees),
                Unary::SinDegrees if within(a, MAX_DEGREES) => each(a, out, |x| cos_degrees(x - 90.0)),
                other => each(a, out, |x| unary(other, x)),
            }
        }
        Op::Binary(function, a, b) => {
            let (a, b) = (argument(a), argument(b));
            match (function, b) {
                (Binary::Add, _) => pairs(a, b, out, |a, b| a + b),
                (Binary::Subtract, _) => pairs(a, b, out, |a, b| a - b),
                (Binary::Multiply, _) => pairs(a, b, out, |a, b| a * b),
                // A division takes as long as several products.
                (Binary::Divide, Argument::One(b)) if (1.0 / b).is_finite() => {
                    let reciprocal = 1.0 / b;
                    each(a, out, |a| a * reciprocal);
                }
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
        Op::Number(_) | Op::Parameter(_) | Op::Variable(_) | Op::Named(..) => {}
    }
    out.iter().fold(true, |finite, value| finite & (value.abs() <= f64::MAX))
}

/// Whether all numbers of an argument are of less than this magnitude.
fn within(a: Argument<'_>, most: f64) -> bool {
    match a {
        Argument::One(a) => a.abs() < most,
        Argument::Many(a) => a.iter().fold(true, |within, x| within & (x.abs() < most)),
    }
}

/// Exponentials, in single precision and four at a time where that holds them, to 2e-7 of their value; false where it does not.
fn exponentials(a: Argument<'_>, out: &mut [f64]) -> bool {
    let Argument::Many(values) = a else { return false };
    if !within(a, SINGLE_EXPONENT) {
        return false;
    }
    let (wholes, rest) = values.as_chunks::<LANES>();
    let (out_wholes, out_rest) = out.as_chunks_mut::<LANES>();
    for (out, x) in out_wholes.iter_mut().zip(wholes) {
        *out = exp(x.map(|x| x as f32)).map(f64::from);
    }
    out_rest.iter_mut().zip(rest).for_each(|(out, x)| *out = x.exp());
    true
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
