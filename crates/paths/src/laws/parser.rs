//! From text to a formula.
//!
//! ```text
//! sum     = product { ("+" | "-") product }
//! product = signed { ("*" | "/") signed }
//! signed  = "-" signed | power
//! power   = atom [ "^" signed ]
//! atom    = number | name | name "(" sum { "," sum } ")" | ("hits" | "source" | "receiver") "(" id ")" | "(" sum ")"
//! ```

use crate::laws::error::{LawFault, Located, nearest};
use crate::laws::formula::{Binary, Formula, Index, MAX_DEPTH, MAX_LENGTH, Op, Unary};
use crate::laws::variable::{Named, Variable};

/// Functions, with the number of their arguments.
const FUNCTIONS: [(&str, usize); 11] = [
    ("sqrt", 1),
    ("ln", 1),
    ("exp", 1),
    ("abs", 1),
    ("cos", 1),
    ("sin", 1),
    ("min", 2),
    ("max", 2),
    ("above", 2),
    ("below", 2),
    ("resonance", 3),
];

/// Whether a name stands for something in every formula, so that no parameter may have it.
pub(crate) fn is_reserved(name: &str) -> bool {
    Named::of_word(name).is_some()
        || Variable::of_name(name).is_some()
        || FUNCTIONS.iter().any(|(known, _)| *known == name)
}

/// Whether this can be read as the name of a parameter.
pub(crate) fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Reads a formula in which these parameters may stand.
pub(crate) fn parse(text: &str, parameters: &[String]) -> Result<Formula, Located> {
    // Counted no further than needed: the text may be of any length.
    let characters: Vec<char> = text.chars().take(MAX_LENGTH + 1).collect();
    if characters.len() > MAX_LENGTH {
        return Err((Some(MAX_LENGTH + 1), LawFault::TooLong { max: MAX_LENGTH }));
    }
    let formula = Formula { ops: Vec::new(), columns: Vec::new(), names: Vec::new() };
    let mut parser = Parser { characters, at: 0, depth: 0, parameters, formula };
    parser.sum()?;
    match parser.peek() {
        None => Ok(parser.formula),
        Some(_) => Err(parser.expected("an operator or the end")),
    }
}

struct Parser<'p> {
    characters: Vec<char>,
    at: usize,
    depth: usize,
    parameters: &'p [String],
    formula: Formula,
}

impl Parser<'_> {
    /// The next character that is no blank, which then stands at `at`.
    fn peek(&mut self) -> Option<char> {
        while self.characters.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.characters.get(self.at).copied()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    fn here(&self) -> Option<usize> {
        Some(self.at + 1)
    }

    fn expected(&mut self, expected: &'static str) -> Located {
        let fault = match self.peek() {
            None => LawFault::Expected { expected, found: "the end".to_owned() },
            Some(c) if c.is_ascii_alphanumeric() || "+-*/^(),._".contains(c) => {
                LawFault::Expected { expected, found: format!("`{c}`") }
            }
            Some(c) => LawFault::UnknownCharacter(c),
        };
        (self.here(), fault)
    }

    fn push(&mut self, op: Op, column: usize) -> Index {
        self.formula.ops.push(op);
        self.formula.columns.push(column as u16);
        (self.formula.ops.len() - 1) as Index
    }

    fn deeper(&mut self, inside: impl FnOnce(&mut Self) -> Result<Index, Located>) -> Result<Index, Located> {
        if self.depth == MAX_DEPTH {
            return Err((self.here(), LawFault::TooDeep { max: MAX_DEPTH }));
        }
        self.depth += 1;
        let result = inside(self);
        self.depth -= 1;
        result
    }

    fn sum(&mut self) -> Result<Index, Located> {
        self.chain(&[('+', Binary::Add), ('-', Binary::Subtract)], Self::product)
    }

    fn product(&mut self) -> Result<Index, Located> {
        self.chain(&[('*', Binary::Multiply), ('/', Binary::Divide)], Self::signed)
    }

    fn chain(
        &mut self,
        operators: &[(char, Binary)],
        operand: fn(&mut Self) -> Result<Index, Located>,
    ) -> Result<Index, Located> {
        let mut left = operand(self)?;
        loop {
            let next = self.peek();
            let Some((_, binary)) = operators.iter().find(|(c, _)| Some(*c) == next) else { return Ok(left) };
            self.at += 1;
            let column = self.at;
            let right = operand(self)?;
            left = self.push(Op::Binary(*binary, left, right), column);
        }
    }

    fn signed(&mut self) -> Result<Index, Located> {
        if !self.take('-') {
            return self.power();
        }
        let column = self.at;
        let of = self.deeper(Self::signed)?;
        Ok(self.push(Op::Unary(Unary::Negate, of), column))
    }

    fn power(&mut self) -> Result<Index, Located> {
        let base = self.atom()?;
        if !self.take('^') {
            return Ok(base);
        }
        let column = self.at;
        let exponent = self.deeper(Self::signed)?;
        Ok(self.push(Op::Binary(Binary::Power, base, exponent), column))
    }

    fn atom(&mut self) -> Result<Index, Located> {
        match self.peek() {
            Some('(') => {
                let inside = self.deeper(|parser| {
                    parser.at += 1;
                    parser.sum()
                })?;
                self.close()?;
                Ok(inside)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.named(),
            _ => Err(self.expected("a number, a name, `-` or `(`")),
        }
    }

    fn close(&mut self) -> Result<(), Located> {
        if self.take(')') { Ok(()) } else { Err(self.expected("`)` or an operator")) }
    }

    fn number(&mut self) -> Result<Index, Located> {
        let start = self.at;
        let mut text = String::new();
        while let Some(&c) = self.characters.get(self.at) {
            let exponent = matches!(c, 'e' | 'E') && !text.contains(['e', 'E']);
            let sign = matches!(c, '+' | '-') && text.ends_with(['e', 'E']);
            if !(c.is_ascii_digit() || c == '.' || exponent || sign) {
                break;
            }
            text.push(c);
            self.at += 1;
        }
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(self.push(Op::Number(value), start + 1)),
            _ => Err((Some(start + 1), LawFault::BadNumber(text))),
        }
    }

    fn named(&mut self) -> Result<Index, Located> {
        let start = self.at;
        let is_part = |c: &char| c.is_ascii_alphanumeric() || *c == '_';
        let name: String = self.characters[start..].iter().take_while(|c| is_part(c)).collect();
        self.at += name.len();
        let column = start + 1;
        if let Some(named) = Named::of_word(&name) {
            return self.with_name(named, column);
        }
        if let Some(&(function, expected)) = FUNCTIONS.iter().find(|(known, _)| *known == name) {
            return self.call(function, expected, column);
        }
        if let Some(index) = self.parameters.iter().position(|known| *known == name) {
            return Ok(self.push(Op::Parameter(index as Index), column));
        }
        if let Some(variable) = Variable::of_name(&name) {
            return Ok(self.push(Op::Variable(variable), column));
        }
        if self.peek() == Some('(') {
            return Err((Some(column), LawFault::UnknownFunction(name)));
        }
        let variables = Variable::ALL.iter().map(|variable| variable.name());
        let nearest = nearest(&name, variables.chain(self.parameters.iter().map(String::as_str)));
        Err((Some(column), LawFault::UnknownName { name, nearest }))
    }

    /// The name of a material, a source or a receiver, up to the closing bracket.
    fn with_name(&mut self, named: Named, column: usize) -> Result<Index, Located> {
        let (opened, wanted) = match named {
            Named::Hits => ("`(` and the name of a material", "the name of a material"),
            Named::Source => ("`(` and the name of a source", "the name of a source"),
            Named::Receiver => ("`(` and the name of a receiver", "the name of a receiver"),
        };
        if !self.take('(') {
            return Err(self.expected(opened));
        }
        let name: String = self.characters[self.at..].iter().take_while(|c| **c != ')').collect();
        if name.trim().is_empty() || name.contains('(') {
            return Err(self.expected(wanted));
        }
        self.at += name.chars().count();
        self.close()?;
        let own = (named, name.trim().to_owned());
        let known = self.formula.names.iter().position(|known| *known == own);
        let index = known.unwrap_or_else(|| {
            self.formula.names.push(own);
            self.formula.names.len() - 1
        });
        Ok(self.push(Op::Named(named, index as Index), column))
    }

    fn call(&mut self, function: &'static str, expected: usize, column: usize) -> Result<Index, Located> {
        if self.peek() != Some('(') {
            return Err(self.expected("`(`"));
        }
        let mut arguments: Vec<Index> = Vec::new();
        self.deeper(|parser| {
            parser.at += 1;
            loop {
                arguments.push(parser.sum()?);
                if !parser.take(',') {
                    return Ok(0);
                }
            }
        })?;
        self.close()?;
        let unary = |unary| match arguments[..] {
            [a] => Some(Op::Unary(unary, a)),
            _ => None,
        };
        let binary = |binary| match arguments[..] {
            [a, b] => Some(Op::Binary(binary, a, b)),
            _ => None,
        };
        let op = match function {
            "sqrt" => unary(Unary::Sqrt),
            "ln" => unary(Unary::Ln),
            "exp" => unary(Unary::Exp),
            "abs" => unary(Unary::Abs),
            "cos" => unary(Unary::Cos),
            "sin" => unary(Unary::Sin),
            "min" => binary(Binary::Min),
            "max" => binary(Binary::Max),
            "above" => binary(Binary::Above),
            "below" => binary(Binary::Below),
            _ => <[Index; 3]>::try_from(arguments.as_slice()).ok().map(Op::Resonance),
        };
        let wrong = LawFault::ArgumentCount { function, expected, found: arguments.len() };
        op.map(|op| self.push(op, column)).ok_or((Some(column), wrong))
    }
}
