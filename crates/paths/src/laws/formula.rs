//! A formula as a list of operations, arguments before what uses them, and its printing.

use crate::laws::variable::{Named, Variable};
use std::fmt::Write;

/// Longest formula in characters.
pub(crate) const MAX_LENGTH: usize = 2_000;
/// Deepest nesting of brackets, functions, signs and powers.
pub(crate) const MAX_DEPTH: usize = 64;

/// Place of an operation in its formula.
pub(crate) type Index = u16;

/// Functions of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unary {
    Negate,
    Sqrt,
    Ln,
    Exp,
    Abs,
    Cos,
    Sin,
    /// Cosine and sine of degrees: the check of units tells which.
    CosDegrees,
    SinDegrees,
}

/// Operators, and functions of two arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Min,
    Max,
    /// One where the first is not below the second, else zero.
    Above,
    /// One where the first is below the second, else zero.
    Below,
}

/// One operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Op {
    Number(f64),
    Parameter(Index),
    Variable(Variable),
    /// A variable of the name of this number among [`Formula::names`].
    Named(Named, Index),
    Unary(Unary, Index),
    Binary(Binary, Index, Index),
    /// 1 / (1 + q^2 (f/f0 - f0/f)^2) of f, f0 and q.
    Resonance([Index; 3]),
}

impl Unary {
    pub fn name(self) -> &'static str {
        match self {
            Self::Negate => "-",
            Self::Sqrt => "sqrt",
            Self::Ln => "ln",
            Self::Exp => "exp",
            Self::Abs => "abs",
            Self::Cos | Self::CosDegrees => "cos",
            Self::Sin | Self::SinDegrees => "sin",
        }
    }
}

impl Binary {
    pub fn name(self) -> &'static str {
        match self {
            Self::Add => "+",
            Self::Subtract => "-",
            Self::Multiply => "*",
            Self::Divide => "/",
            Self::Power => "^",
            Self::Min => "min",
            Self::Max => "max",
            Self::Above => "above",
            Self::Below => "below",
        }
    }

    /// How tightly an operator binds; `None` for a function.
    fn binding(self) -> Option<u8> {
        match self {
            Self::Add | Self::Subtract => Some(1),
            Self::Multiply | Self::Divide => Some(2),
            Self::Power => Some(4),
            Self::Min | Self::Max | Self::Above | Self::Below => None,
        }
    }
}

/// Binding of a sign: below that of a power, above that of a product.
const SIGN: u8 = 3;

/// How a part of a formula changes with a parameter.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Growth {
    Constant,
    Proportional,
    Other,
}

impl Growth {
    /// That of a function of it.
    fn through(self) -> Self {
        if self == Self::Constant { self } else { Self::Other }
    }
}

/// A formula: operations, each after its arguments; the last is the result.
#[derive(Clone, Debug)]
pub(crate) struct Formula {
    pub ops: Vec<Op>,
    /// Where each stands in the text, the first character being 1.
    pub columns: Vec<u16>,
    /// Materials, sources and receivers that it names, each once.
    pub names: Vec<(Named, String)>,
}

impl Formula {
    /// Whether the whole goes in proportion to some parameters together: twice each of them is twice the whole, as far as its form shows it,
    /// without reordering.
    pub fn is_proportional_to(&self, parameters: &[Index]) -> bool {
        self.goes_with(|op| matches!(op, Op::Parameter(index) if parameters.contains(&index)))
    }

    /// Whether the whole goes in proportion to a variable of a name, so that it is zero where that is zero.
    pub fn is_proportional_to_named(&self, name: Index) -> bool {
        self.goes_with(|op| matches!(op, Op::Named(_, index) if index == name))
    }

    /// Whether the whole goes in proportion to some leaves together.
    fn goes_with(&self, leaf: impl Fn(Op) -> bool) -> bool {
        let mut grows: Vec<Growth> = Vec::with_capacity(self.ops.len());
        for &op in &self.ops {
            let of = |index: Index| grows[usize::from(index)];
            grows.push(match op {
                own if leaf(own) => Growth::Proportional,
                Op::Number(_) | Op::Parameter(_) | Op::Variable(_) | Op::Named(..) => Growth::Constant,
                Op::Unary(Unary::Negate, a) => of(a),
                Op::Unary(_, a) => of(a).through(),
                Op::Binary(Binary::Add | Binary::Subtract, a, b) if of(a) == of(b) => of(a),
                Op::Binary(Binary::Multiply, a, b) if of(a) == Growth::Constant => of(b),
                Op::Binary(Binary::Multiply | Binary::Divide, a, b) if of(b) == Growth::Constant => of(a),
                Op::Binary(_, a, b) => of(a).through().max(of(b).through()),
                Op::Resonance(arguments) => {
                    arguments.map(|a| of(a).through()).into_iter().fold(Growth::Constant, Growth::max)
                }
            });
        }
        grows.last() == Some(&Growth::Proportional)
    }

    /// Whether all that a parameter does is to say where steps over the frequency stand: `above(frequency_hz, f0)`.
    pub fn is_edge_of_bands(&self, parameter: Index) -> bool {
        let is = |index: Index| self.ops[usize::from(index)] == Op::Parameter(parameter);
        let is_frequency = |index: Index| self.ops[usize::from(index)] == Op::Variable(Variable::Frequency);
        let uses = |op: &Op| match *op {
            Op::Unary(_, a) => is(a),
            Op::Binary(Binary::Above | Binary::Below, a, b) if is_frequency(a) && is(b) => false,
            Op::Binary(_, a, b) => is(a) || is(b),
            Op::Resonance(of) => of.into_iter().any(is),
            _ => false,
        };
        self.ops.contains(&Op::Parameter(parameter))
            && !self.ops.last().is_some_and(|op| *op == Op::Parameter(parameter))
            && !self.ops.iter().any(uses)
    }

    /// A variable of a name as it is written.
    pub fn named(&self, index: Index) -> String {
        let (named, name) = &self.names[usize::from(index)];
        format!("{}({name})", named.word())
    }

    /// The formula as text that reads as the same formula.
    pub fn print(&self, parameters: &[String]) -> String {
        let mut text = String::new();
        self.print_op(self.ops.len() - 1, 0, parameters, &mut text);
        text
    }

    fn print_op(&self, at: usize, outside: u8, parameters: &[String], text: &mut String) {
        let arguments = |name: &str, of: &[Index], text: &mut String| {
            text.push_str(name);
            text.push('(');
            for (i, &argument) in of.iter().enumerate() {
                if i > 0 {
                    text.push_str(", ");
                }
                self.print_op(argument.into(), 0, parameters, text);
            }
            text.push(')');
        };
        match self.ops[at] {
            Op::Number(value) => text.push_str(&number(value)),
            Op::Parameter(index) => text.push_str(&parameters[usize::from(index)]),
            Op::Variable(variable) => text.push_str(variable.name()),
            Op::Named(_, index) => text.push_str(&self.named(index)),
            Op::Unary(Unary::Negate, of) => self.bracketed(outside > SIGN, text, |text| {
                text.push('-');
                self.print_op(of.into(), SIGN, parameters, text);
            }),
            Op::Unary(function, of) => arguments(function.name(), &[of], text),
            Op::Binary(binary, a, b) => match binary.binding() {
                None => arguments(binary.name(), &[a, b], text),
                Some(binding) => self.bracketed(outside > binding, text, |text| {
                    // Powers bind to the right and take a sign on that side, the others bind to the left.
                    let power = binary == Binary::Power;
                    let (left, right) = if power { (binding + 1, SIGN) } else { (binding, binding + 1) };
                    self.print_op(a.into(), left, parameters, text);
                    let blank = if power { "" } else { " " };
                    let _ = write!(text, "{blank}{}{blank}", binary.name());
                    self.print_op(b.into(), right, parameters, text);
                }),
            },
            Op::Resonance(of) => arguments("resonance", &of, text),
        }
    }

    #[allow(clippy::unused_self)] // reads as the other printing does
    fn bracketed(&self, brackets: bool, text: &mut String, inside: impl FnOnce(&mut String)) {
        if brackets {
            text.push('(');
        }
        inside(text);
        if brackets {
            text.push(')');
        }
    }
}

/// A number as the shortest text that reads as it.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-5..1e15).contains(&value) { format!("{value}") } else { format!("{value:e}") }
}
