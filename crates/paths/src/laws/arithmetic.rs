//! What the operations of a formula do to numbers, and to numbers with a slope.

use crate::laws::error::{LawFault, Place};
use crate::laws::formula::{Binary, Formula, Op, Unary};

/// A function of one number.
#[inline]
pub(crate) fn unary(function: Unary, x: f64) -> f64 {
    match function {
        Unary::Negate => -x,
        Unary::Sqrt => x.sqrt(),
        Unary::Ln => x.ln(),
        Unary::Exp => x.exp(),
        Unary::Abs => x.abs(),
        Unary::Cos => x.cos(),
        Unary::Sin => x.sin(),
        Unary::CosDegrees => x.to_radians().cos(),
        Unary::SinDegrees => x.to_radians().sin(),
    }
}

/// A power: small whole ones by multiplication, which is several times as fast.
#[inline]
pub(crate) fn power(base: f64, exponent: f64) -> f64 {
    if exponent == 2.0 {
        base * base
    } else if exponent.fract() == 0.0 && exponent.abs() <= 16.0 {
        base.powi(exponent as i32)
    } else {
        base.powf(exponent)
    }
}

/// A function of two numbers.
#[inline]
pub(crate) fn binary(function: Binary, a: f64, b: f64) -> f64 {
    match function {
        Binary::Add => a + b,
        Binary::Subtract => a - b,
        Binary::Multiply => a * b,
        Binary::Divide => a / b,
        Binary::Power => power(a, b),
        Binary::Min => a.min(b),
        Binary::Max => a.max(b),
        Binary::Above => f64::from(u8::from(a >= b)),
        Binary::Below => f64::from(u8::from(a < b)),
    }
}

/// A resonance of quality `q` at `f0`; not a number where either frequency is zero.
#[inline]
pub(crate) fn resonance(f: f64, f0: f64, q: f64) -> f64 {
    let ratio = f / f0 - f0 / f;
    let detuning = q * ratio;
    if ratio.is_finite() { 1.0 / (1.0 + detuning * detuning) } else { f64::NAN }
}

/// A number and its derivative by one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dual {
    pub value: f64,
    pub slope: f64,
}

/// A slope times a derivative; a number that does not vary has none, whatever the derivative.
fn chain(slope: f64, derivative: impl FnOnce() -> f64) -> f64 {
    if slope == 0.0 { 0.0 } else { slope * derivative() }
}

impl Dual {
    fn unary(function: Unary, x: Self) -> Self {
        let value = unary(function, x.value);
        let slope = chain(x.slope, || match function {
            Unary::Negate => -1.0,
            Unary::Sqrt => 0.5 / value,
            Unary::Ln => 1.0 / x.value,
            Unary::Exp => value,
            Unary::Abs if x.value < 0.0 => -1.0,
            Unary::Abs => 1.0,
            Unary::Cos => -x.value.sin(),
            Unary::Sin => x.value.cos(),
            Unary::CosDegrees => -x.value.to_radians().sin().to_radians(),
            Unary::SinDegrees => x.value.to_radians().cos().to_radians(),
        });
        Self { value, slope }
    }

    fn binary(function: Binary, a: Self, b: Self) -> Self {
        let value = binary(function, a.value, b.value);
        let slope = match function {
            Binary::Add => a.slope + b.slope,
            Binary::Subtract => a.slope - b.slope,
            Binary::Multiply => chain(a.slope, || b.value) + chain(b.slope, || a.value),
            Binary::Divide => chain(a.slope, || 1.0 / b.value) - chain(b.slope, || value / b.value),
            Binary::Power => {
                chain(a.slope, || b.value * power(a.value, b.value - 1.0))
                    + chain(b.slope, || if value == 0.0 { 0.0 } else { value * a.value.ln() })
            }
            Binary::Min if a.value <= b.value => a.slope,
            Binary::Max if a.value >= b.value => a.slope,
            Binary::Min | Binary::Max => b.slope,
            Binary::Above | Binary::Below => 0.0,
        };
        Self { value, slope }
    }

    fn resonance([f, f0, q]: [Self; 3]) -> Self {
        let value = resonance(f.value, f0.value, q.value);
        let detuning = f.value / f0.value - f0.value / f.value;
        let of_detuning = chain(f.slope, || 1.0 / f0.value + f0.value / (f.value * f.value))
            - chain(f0.slope, || f.value / (f0.value * f0.value) + 1.0 / f.value);
        let of_product = chain(q.slope, || detuning) + chain(of_detuning, || q.value);
        Self { value, slope: chain(of_product, || -2.0 * value * value * q.value * detuning) }
    }
}

/// The values of all operations of a formula, each with its slope, given those of its parameters and variables. Stops with the first
/// that is not finite and says which.
pub(crate) fn evaluate(formula: &Formula, leaf: impl Fn(Op) -> Dual) -> Result<Dual, usize> {
    let mut results: Vec<Dual> = Vec::with_capacity(formula.ops.len());
    for (at, &op) in formula.ops.iter().enumerate() {
        let of = |index: u16| results[usize::from(index)];
        let result = match op {
            Op::Unary(function, a) => Dual::unary(function, of(a)),
            Op::Binary(function, a, b) => Dual::binary(function, of(a), of(b)),
            Op::Resonance(arguments) => Dual::resonance(arguments.map(of)),
            leaf_op => leaf(leaf_op),
        };
        if !(result.value.is_finite() && result.slope.is_finite()) {
            return Err(at);
        }
        results.push(result);
    }
    results.last().copied().ok_or(0)
}

/// What went wrong in an operation that gave no finite number.
pub(crate) fn fault_of(formula: &Formula, at: usize, zero_divisor: bool, place: Place) -> LawFault {
    match formula.ops[at] {
        Op::Binary(Binary::Divide, ..) if zero_divisor => LawFault::DivisionByZero(place),
        Op::Binary(function, ..) => LawFault::NotFinite { what: function.name(), place },
        Op::Unary(function, _) => LawFault::NotFinite { what: function.name(), place },
        Op::Resonance(_) => LawFault::NotFinite { what: "resonance", place },
        Op::Variable(variable) => LawFault::NotFinite { what: variable.name(), place },
        Op::Number(_) | Op::Parameter(_) | Op::Named(..) => LawFault::NotFinite { what: "a value", place },
    }
}
