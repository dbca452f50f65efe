//! Units and scope of a formula.

use crate::laws::error::{LawFault, Located};
use crate::laws::formula::{Binary, Formula, Op, Unary};
use crate::laws::target::LawTarget;
use crate::laws::unit::{Dimension, Unit};
use crate::laws::variable::has;

/// What is known of a part of a formula.
#[derive(Clone, Copy)]
struct Part {
    dimension: Dimension,
    /// The number zero, written out: it is zero of any unit.
    zero: bool,
    /// A number written out, with its sign.
    written: Option<f64>,
}

/// Checks that all units go together and all variables are the target's; says what each operation depends on (bits of [`scope`]), and makes
/// cosines and sines of degrees such.
pub(crate) fn check(
    formula: &mut Formula,
    target: LawTarget,
    parameters: &[Dimension],
) -> Result<Vec<u8>, Located> {
    let mut parts: Vec<Part> = Vec::with_capacity(formula.ops.len());
    let mut scopes: Vec<u8> = Vec::with_capacity(formula.ops.len());
    for at in 0..formula.ops.len() {
        let column = Some(usize::from(formula.columns[at]));
        let op = formula.ops[at];
        let scope = scope_of(op, &scopes);
        let (variable, name) = match op {
            Op::Variable(variable) => (Some(variable), variable.name()),
            Op::Named(named, _) => (None, named.word()),
            _ => (None, ""),
        };
        if matches!(op, Op::Variable(_) | Op::Named(..)) && !has(target, variable, scope) {
            return Err((column, LawFault::NotOfTarget { variable: name, target }));
        }
        if let Op::Unary(function @ (Unary::Cos | Unary::Sin), of) = op
            && parts[usize::from(of)].dimension == Unit::DEGREE
        {
            let degrees = if function == Unary::Cos { Unary::CosDegrees } else { Unary::SinDegrees };
            formula.ops[at] = Op::Unary(degrees, of);
        }
        let part = part_of(formula.ops[at], &parts, parameters).map_err(|fault| (column, fault))?;
        parts.push(part);
        scopes.push(scope);
    }
    let result = parts[parts.len() - 1];
    if result.dimension != target.dimension() && !result.zero {
        let column = formula.columns.last().map(|&c| usize::from(c));
        return Err((column, LawFault::WrongUnit { target, found: result.dimension.to_string() }));
    }
    Ok(scopes)
}

fn scope_of(op: Op, before: &[u8]) -> u8 {
    match op {
        Op::Number(_) | Op::Parameter(_) => 0,
        Op::Variable(variable) => variable.scope(),
        Op::Named(named, _) => named.scope(),
        Op::Unary(_, of) => before[usize::from(of)],
        Op::Binary(_, a, b) => before[usize::from(a)] | before[usize::from(b)],
        Op::Resonance(of) => of.iter().fold(0, |scope, &i| scope | before[usize::from(i)]),
    }
}

fn part_of(op: Op, before: &[Part], parameters: &[Dimension]) -> Result<Part, LawFault> {
    let of = |dimension| Part { dimension, zero: false, written: None };
    let pure = |index: u16, what: &'static str| match before[usize::from(index)].dimension {
        Dimension::PURE => Ok(()),
        found => Err(LawFault::NotPure { what, found: found.to_string() }),
    };
    let same = |a: u16, b: u16| {
        let (a, b) = (before[usize::from(a)], before[usize::from(b)]);
        match (a.zero, b.zero) {
            (true, _) => Ok(b.dimension),
            (_, true) => Ok(a.dimension),
            _ if a.dimension == b.dimension => Ok(a.dimension),
            _ => Err(LawFault::UnitsDiffer { left: a.dimension.to_string(), right: b.dimension.to_string() }),
        }
    };
    Ok(match op {
        Op::Number(value) => Part { dimension: Dimension::PURE, zero: value == 0.0, written: Some(value) },
        Op::Parameter(index) => of(parameters[usize::from(index)]),
        Op::Variable(variable) => of(variable.dimension()),
        Op::Named(..) => of(Dimension::PURE),
        Op::Unary(Unary::Negate, a) => {
            let part = before[usize::from(a)];
            Part { written: part.written.map(|value| -value), ..part }
        }
        Op::Unary(Unary::Abs, a) => of(before[usize::from(a)].dimension),
        Op::Unary(Unary::Sqrt, a) => {
            let dimension = before[usize::from(a)].dimension;
            of(dimension.power(0.5).ok_or_else(|| LawFault::PowerOfUnit(dimension.to_string()))?)
        }
        Op::Unary(Unary::CosDegrees | Unary::SinDegrees, _) => of(Dimension::PURE),
        Op::Unary(function, a) => {
            pure(a, function.name())?;
            of(Dimension::PURE)
        }
        Op::Binary(Binary::Add | Binary::Subtract | Binary::Min | Binary::Max, a, b) => of(same(a, b)?),
        Op::Binary(Binary::Above | Binary::Below, a, b) => {
            same(a, b)?;
            of(Dimension::PURE)
        }
        Op::Binary(binary @ (Binary::Multiply | Binary::Divide), a, b) => {
            let sign = if binary == Binary::Multiply { 1 } else { -1 };
            of(before[usize::from(a)].dimension.times(before[usize::from(b)].dimension, sign))
        }
        Op::Binary(Binary::Power, a, b) => {
            pure(b, "an exponent")?;
            let base = before[usize::from(a)].dimension;
            if base == Dimension::PURE {
                return Ok(of(Dimension::PURE));
            }
            let power = before[usize::from(b)].written.and_then(|exponent| base.power(exponent));
            of(power.ok_or_else(|| LawFault::PowerOfUnit(base.to_string()))?)
        }
        Op::Resonance([f, f0, q]) => {
            same(f, f0)?;
            pure(q, "the quality of a resonance")?;
            of(Dimension::PURE)
        }
    })
}
