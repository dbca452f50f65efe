//! The values of one law for any parameters, at many places at once: for fits.

use crate::laws::arithmetic::{binary, resonance, unary};
use crate::laws::bound::BoundLaws;
use crate::laws::columns::{BLOCK, Columns};
use crate::laws::error::{LawError, LawFault};
use crate::laws::formula::Op;
use crate::laws::law::Law;
use crate::laws::variable::{Named, Variable, scope};
use crate::path_set::PathSet;

/// A variable at many places.
#[derive(Clone, Copy, Debug)]
pub enum LawVariable<'v> {
    /// The same at all of them.
    Same(f64),
    /// One value for each.
    Each(&'v [f64]),
}

/// A variable that laws ask of paths.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PathVariable {
    /// Its name; meetings with a material are `hits(NAME)`.
    pub name: String,
    /// Its value on each path, in the unit that its name ends in.
    pub values: Vec<f32>,
    /// Whether it follows from the time of arrival.
    pub is_time: bool,
}

/// The values of an operation.
enum Held<'v> {
    Same(f64),
    Given(&'v [f64]),
    Computed(Vec<f64>),
}

impl Held<'_> {
    fn at(&self, place: usize) -> f64 {
        match self {
            Self::Same(value) => *value,
            Self::Given(values) => values[place],
            Self::Computed(values) => values[place],
        }
    }
}

impl Law {
    /// Values in dB, or in ms for a delay, at `count` places, for values of the parameters (in their order and units) that may lie outside
    /// their intervals. Variables are in the unit that their name ends in; what has a name is asked for with it: `hits(NAME)`, `receiver(NAME)`. Where the
    /// law has no value, the result is not finite.
    ///
    /// ```
    /// use sabine_paths::laws::{Law, LawParameter, LawTarget, LawVariable};
    /// let parameters = [("a", LawParameter::new(1.0, [0.0, 4.0], "dB")), ("l", LawParameter::new(2.0, [1.0, 3.0], "m"))];
    /// let law = Law::new("fog", LawTarget::Path, None, "-a * length_m / l", parameters)?;
    /// let found = law.values(&[3.0, 0.5], 2, |_| Some(LawVariable::Each(&[1.0, 2.0])))?;
    /// assert_eq!(found, [-6.0, -12.0]);
    /// # Ok::<(), sabine_paths::laws::LawError>(())
    /// ```
    ///
    /// # Errors
    /// [`LawFault::NotKnown`] for a variable without a value.
    ///
    /// # Panics
    /// If there are not as many values as parameters, or fewer of a variable than places.
    pub fn values<'v>(
        &self,
        parameters: &[f64],
        count: usize,
        variable: impl Fn(&str) -> Option<LawVariable<'v>>,
    ) -> Result<Vec<f64>, LawError> {
        assert_eq!(
            parameters.len(),
            self.parameters().len(),
            "values of the parameters of law {}",
            self.id()
        );
        let ops = &self.formula.ops;
        let mut held: Vec<Held<'v>> = Vec::with_capacity(ops.len());
        for (at, &op) in ops.iter().enumerate() {
            let of = |index: u16| &held[usize::from(index)];
            let found = match op {
                Op::Number(value) => Held::Same(value),
                Op::Parameter(index) => {
                    Held::Same(parameters[usize::from(index)] * self.scale(usize::from(index)))
                }
                Op::Variable(_) | Op::Named(..) => {
                    let name = self.variable_of(op);
                    match variable(&name) {
                        Some(LawVariable::Same(value)) => Held::Same(value),
                        Some(LawVariable::Each(values)) => Held::Given(&values[..count]),
                        None => {
                            let name = match op {
                                Op::Variable(known) => known.name(),
                                Op::Named(named, _) => named.word(),
                                _ => "",
                            };
                            let why = "nobody gave its value";
                            return Err(self.error_at(at, LawFault::NotKnown { variable: name, why }));
                        }
                    }
                }
                Op::Unary(function, a) => mapped(count, &[of(a)], |[x, ..]| unary(function, x)),
                Op::Binary(function, a, b) => {
                    mapped(count, &[of(a), of(b)], |[x, y, _]| binary(function, x, y))
                }
                Op::Resonance([f, f0, q]) => {
                    mapped(count, &[of(f), of(f0), of(q)], |[f, f0, q]| resonance(f, f0, q))
                }
            };
            held.push(found);
        }
        let factor = self.factor();
        let last = held.last();
        Ok((0..count).map(|place| factor * last.map_or(0.0, |held| held.at(place))).collect())
    }

    /// Whether it gives the same at all paths, angles and times.
    pub fn is_uniform(&self) -> bool {
        self.scopes.last().is_none_or(|scope| scope & !scope::BAND == 0)
    }

    /// The names of the variables in its formula, each once.
    pub fn variables(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for &op in &self.formula.ops {
            if matches!(op, Op::Variable(_) | Op::Named(..)) {
                let name = self.variable_of(op);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        names
    }

    fn variable_of(&self, op: Op) -> String {
        match op {
            Op::Variable(variable) => variable.name().to_owned(),
            Op::Named(_, index) => self.formula.named(index),
            _ => String::new(),
        }
    }
}

/// A function of up to three operations, place by place.
fn mapped<'v>(count: usize, of: &[&Held<'v>], function: impl Fn([f64; 3]) -> f64) -> Held<'v> {
    let at = |place: usize| std::array::from_fn(|i| of.get(i).map_or(0.0, |held| held.at(place)));
    if of.iter().all(|held| matches!(held, Held::Same(_))) {
        return Held::Same(function(at(0)));
    }
    Held::Computed((0..count).map(|place| function(at(place))).collect())
}

impl BoundLaws {
    /// What laws of paths and of the recorder ask of paths: each variable once, with its value on each path at a speed of sound. Files begin at
    /// the emission.
    pub fn path_variables(&self, paths: &PathSet, speed_m_s: f64) -> Vec<PathVariable> {
        let mut columns = Columns::new(paths, speed_m_s);
        let mut wanted: Vec<(String, usize, bool)> = Vec::new();
        for bound in &self.laws {
            for &op in &bound.law.formula.ops {
                let is_time = match op {
                    Op::Variable(
                        Variable::Length | Variable::Time | Variable::TimeAfterDirect | Variable::FileTime,
                    ) => true,
                    Op::Variable(other) if other.scope() & scope::PATH == 0 => continue,
                    Op::Variable(_) | Op::Named(Named::Hits, _) => false,
                    _ => continue,
                };
                let name = bound.law.variable_of(op);
                if wanted.iter().all(|(known, ..)| *known != name) {
                    wanted.push((name, columns.place_of(bound, op), is_time));
                }
            }
        }
        let mut values = vec![Vec::with_capacity(paths.len()); wanted.len()];
        let mut slots = columns.new_slots();
        for start in (0..paths.len()).step_by(BLOCK) {
            let block = start..paths.len().min(start + BLOCK);
            columns.fill(&block, &mut slots);
            for (values, (_, column, _)) in values.iter_mut().zip(&wanted) {
                values.extend(slots[*column][..block.len()].iter().map(|x| *x as f32));
            }
        }
        let named = values.into_iter().zip(wanted);
        named.map(|(values, (name, _, is_time))| PathVariable { name, values, is_time }).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::laws::{LawParameter, LawTarget};

    fn law(target: LawTarget, formula: &str, names: &[(&'static str, &str)]) -> Law {
        let parameters = names.iter().map(|(name, unit)| (*name, LawParameter::new(1.5, [0.5, 3.0], *unit)));
        Law::new("x", target, None, formula, parameters).unwrap()
    }

    /// One place at a time, by the code that random formulas are tested with.
    #[test]
    fn many_places_have_the_values_of_each() {
        let path = LawTarget::Path;
        let laws = [
            law(
                path,
                "-a * exp(-length_m / l) * resonance(frequency_hz, f0, q)",
                &[("a", "dB"), ("l", "km"), ("f0", "kHz"), ("q", "1")],
            ),
            law(
                path,
                "a * above(length_m, l) * hits(wall)^2 - min(a, 2 * a) * sin(departure_azimuth_deg)",
                &[("a", "dB"), ("l", "m")],
            ),
            law(LawTarget::Delay, "d * abs(departure_azimuth_deg / p)", &[("d", "us"), ("p", "deg")]),
        ];
        let numbers = [0.3, 1.7, 2.9, 40.0];
        for law in &laws {
            let given: Vec<f64> = law.parameters().map(|(_, p)| p.value).collect();
            let many = |name: &str| {
                Some(if name == "frequency_hz" {
                    LawVariable::Same(500.0)
                } else {
                    LawVariable::Each(&numbers)
                })
            };
            let found = law.values(&given, numbers.len(), many).unwrap();
            for (found, x) in found.iter().zip(numbers) {
                let one = law.value(|name| Some(if name == "frequency_hz" { 500.0 } else { x })).unwrap();
                assert!((found - one).abs() <= 1e-12 * one.abs(), "{}: {found} {one}", law.formula());
            }
            // Other values of the parameters are those of the law with these values.
            let other: Vec<f64> = given.iter().map(|x| 0.6 * x).collect();
            let moved = law.with_values(&other).unwrap();
            assert_eq!(law.values(&other, 4, many).unwrap(), moved.values(&other, 4, many).unwrap());
            let one = moved.value(|name| Some(if name == "frequency_hz" { 500.0 } else { 2.9 })).unwrap();
            assert!((law.values(&other, 4, many).unwrap()[2] - one).abs() <= 1e-12 * one.abs());
        }
        let error = laws[0].values(&[1.0; 4], 1, |_| None).unwrap_err();
        assert_eq!(
            error.to_string(),
            "law `x`, column 11 of its formula: `length_m` is not known: nobody gave its value"
        );
    }

    #[test]
    fn edges_of_bands_do_nothing_but_stand_between_them() {
        let edge = |formula: &str, unit: &str| {
            law(LawTarget::Path, formula, &[("a", "dB"), ("f0", unit)]).is_edge_of_bands("f0")
        };
        assert!(edge("a * above(frequency_hz, f0)", "kHz"));
        assert!(edge("a * (above(frequency_hz, f0) - 2 * below(frequency_hz, f0))", "Hz"));
        assert!(!edge("a * above(f0, frequency_hz)", "kHz"));
        assert!(!edge("a * above(frequency_hz, 2 * f0)", "kHz"));
        assert!(!edge("a * above(frequency_hz, f0) * frequency_hz / f0", "kHz"));
        assert!(!edge("a * above(length_m, f0)", "m"));
        assert!(!law(LawTarget::Delay, "f0", &[("f0", "s")]).is_edge_of_bands("f0"));
    }

    #[test]
    fn amplitudes_are_the_fewest_that_make_a_law_vanish() {
        let of = |formula: &str, names: &[(&'static str, &str)]| -> Vec<String> {
            law(LawTarget::Path, formula, names).amplitudes().into_iter().map(str::to_owned).collect()
        };
        let db = [("a", "dB"), ("b", "dB"), ("c", "1")];
        assert_eq!(of("a^2 / b", &db[..2]), [] as [&str; 0]);
        assert_eq!(of("(a + b * ln(c)) * departure_cos", &db), ["a", "b"]);
        assert_eq!(of("a * c + 0 * a", &[("a", "dB"), ("c", "1")]), ["a"]);
        assert_eq!(of("a + 1 * b - b", &db[..2]), ["a", "b"]);
    }
}
