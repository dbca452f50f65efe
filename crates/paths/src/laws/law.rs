//! A law: one formula with its parameters.

use crate::laws::arithmetic::{Dual, evaluate, fault_of};
use crate::laws::check::check;
use crate::laws::error::{LawError, LawFault, Place};
use crate::laws::formula::{Binary, Formula, Op};
use crate::laws::parser::{is_name, is_reserved, parse};
use crate::laws::target::LawTarget;
use crate::laws::unit::{Dimension, Unit};
use crate::laws::variable::Named;
use std::collections::BTreeMap;

/// Longest identifier.
const MAX_ID: usize = 64;
/// Most parameters with an interval among which those are looked for in proportion to which a law goes.
const MAX_TOGETHER: usize = 10;

/// A parameter of a law: its value, the interval that it lies in (a 90 % interval where it was fitted) and its unit.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LawParameter {
    /// The value, in its unit.
    pub value: f64,
    /// Lower end of the interval, in the same unit.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// The unit, as it is written: `dB/m`.
    pub unit: String,
}

impl LawParameter {
    /// A value in an interval, in a unit.
    pub fn new(value: f64, [low, high]: [f64; 2], unit: impl Into<String>) -> Self {
        Self { value, low, high, unit: unit.into() }
    }
}

/// A short formula that changes what the model predicts.
///
/// The grammar is closed: numbers, parameters, the variables of the target, `+ - * / ^`, `sqrt ln exp abs cos sin min max`,
/// `above(x, x0)` (1 from `x0` on, else 0), `below(x, x0)` (the rest), `resonance(f, f0, q)` = 1 / (1 + q² (f/f0 - f0/f)²), `hits(MATERIAL)`,
/// `source(ID)` and `receiver(ID)` (1 in responses of that source or receiver, else 0).
/// Units are checked: sums need the same unit, `exp`, `ln`, exponents a pure number, `cos` and `sin` degrees or a pure number (radians), and the
/// whole has the unit of the target. Variables are in the unit that their name ends in; a frequency is one over a time.
///
/// ```
/// use sabine_paths::laws::{Law, LawParameter, LawTarget};
/// let parameters = [("a", LawParameter::new(4.1, [2.9, 5.4], "dB")), ("f0", LawParameter::new(2.0, [1.0, 2.8], "kHz"))];
/// let law = Law::new(
///     "floor_takes_grazing_sound", LawTarget::Reflection, Some("floor"),
///     "-a * (1 - cos_incidence)^2 * above(frequency_hz, f0)", parameters)?;
/// let at = |cosine: f64, hz: f64| law.value(|name| Some(if name == "frequency_hz" { hz } else { cosine }));
/// assert_eq!(at(0.0, 2000.0)?, -4.1);
/// assert_eq!(at(0.0, 1000.0)?, 0.0);
/// let error = Law::new("wrong", LawTarget::Path, None, "a * lenght_m", [("a", LawParameter::new(1.0, [0.0, 2.0], "dB/m"))]);
/// assert_eq!(error.unwrap_err().to_string(),
///     "law `wrong`, column 5 of its formula: `lenght_m` is neither a variable nor a parameter of this law; the nearest name is `length_m`");
/// # Ok::<(), sabine_paths::laws::LawError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Law {
    id: String,
    target: LawTarget,
    surface: Option<String>,
    text: String,
    words: String,
    names: Vec<String>,
    parameters: Vec<LawParameter>,
    units: Vec<Unit>,
    pub(crate) formula: Formula,
    /// What each operation depends on.
    pub(crate) scopes: Vec<u8>,
}

/// The same law as text: identifier, target, surface, formula, words and parameters.
impl PartialEq for Law {
    fn eq(&self, other: &Self) -> bool {
        (&self.id, self.target, &self.surface, &self.text, &self.words, &self.names, &self.parameters)
            == (
                &other.id,
                other.target,
                &other.surface,
                &other.text,
                &other.words,
                &other.names,
                &other.parameters,
            )
    }
}

impl Law {
    /// Maximum number of laws applied together.
    pub const MAX_LAWS: usize = 32;

    /// Reads and checks a law. Parameters are kept by name, in the order of the alphabet.
    ///
    /// # Errors
    /// [`LawError`]: whatever is wrong with the formula, with its column; with a parameter; with the surface, which a law of reflections needs and
    /// no other may have.
    pub fn new<N: Into<String>>(
        id: impl Into<String>,
        target: LawTarget,
        surface: Option<&str>,
        formula: &str,
        parameters: impl IntoIterator<Item = (N, LawParameter)>,
    ) -> Result<Self, LawError> {
        let id: String = id.into();
        let wrong = |fault| LawError { law: id.chars().take(MAX_ID).collect(), column: None, fault };
        let letters = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
        if id.is_empty() || id.len() > MAX_ID || !id.chars().all(letters) {
            return Err(wrong(LawFault::BadIdentifier));
        }
        match (surface, target) {
            (None, LawTarget::Reflection) => return Err(wrong(LawFault::NoSurface)),
            (Some(_), other) if other != LawTarget::Reflection => {
                return Err(wrong(LawFault::SurfaceNotWanted(other)));
            }
            _ => {}
        }
        let table: BTreeMap<String, LawParameter> =
            parameters.into_iter().map(|(name, parameter)| (name.into(), parameter)).collect();
        let (names, parameters): (Vec<String>, Vec<LawParameter>) = table.into_iter().unzip();
        let mut units = Vec::with_capacity(names.len());
        for (name, parameter) in names.iter().zip(&parameters) {
            if !is_name(name) || is_reserved(name) {
                return Err(wrong(LawFault::BadParameterName(name.clone())));
            }
            check_interval(name, parameter).map_err(wrong)?;
            let unit = Unit::parse(&parameter.unit).ok_or_else(|| {
                wrong(LawFault::UnknownUnit { parameter: name.clone(), unit: parameter.unit.clone() })
            })?;
            units.push(unit);
        }
        let located = |(column, fault)| LawError { law: id.clone(), column, fault };
        let mut tree = parse(formula, &names).map_err(located)?;
        let dimensions: Vec<Dimension> = units.iter().map(|unit| unit.dimension).collect();
        let scopes = check(&mut tree, target, &dimensions).map_err(located)?;
        let uses = |index: usize| tree.ops.contains(&Op::Parameter(index as u16));
        if let Some(unused) = (0..names.len()).find(|&index| !uses(index)) {
            return Err(wrong(LawFault::UnusedParameter(names[unused].clone())));
        }
        let (text, surface) = (formula.to_owned(), surface.map(str::to_owned));
        Ok(Self {
            id,
            target,
            surface,
            text,
            words: String::new(),
            names,
            parameters,
            units,
            formula: tree,
            scopes,
        })
    }

    /// Checks that laws can be applied together.
    ///
    /// # Errors
    /// [`LawFault::TooMany`] and [`LawFault::Twice`].
    pub fn check_together(laws: &[Self]) -> Result<(), LawError> {
        if let Some(last) = laws.get(Self::MAX_LAWS) {
            return Err(last.error(None, LawFault::TooMany { max: Self::MAX_LAWS }));
        }
        let twice = |(i, law): (usize, &Self)| laws[..i].iter().any(|other| other.id == law.id);
        match laws.iter().enumerate().find(|place| twice(*place)) {
            Some((_, law)) => Err(law.error(None, LawFault::Twice)),
            None => Ok(()),
        }
    }

    /// The same law with an explanation in plain words.
    #[must_use]
    pub fn with_words(self, words: impl Into<String>) -> Self {
        Self { words: words.into(), ..self }
    }

    /// The same law with other values of its parameters, in their order and units; intervals stay.
    ///
    /// # Errors
    /// [`LawFault::OutsideInterval`].
    ///
    /// # Panics
    /// If there are not as many values as parameters.
    pub fn with_values(&self, values: &[f64]) -> Result<Self, LawError> {
        assert_eq!(values.len(), self.parameters.len(), "values of the parameters of law {}", self.id);
        let mut law = self.clone();
        for ((name, parameter), &value) in law.names.iter().zip(&mut law.parameters).zip(values) {
            parameter.value = value;
            check_interval(name, parameter).map_err(|fault| self.error(None, fault))?;
        }
        Ok(law)
    }

    /// The same law with other values and intervals of its parameters, in their order; units stay: what a fit found.
    ///
    /// # Errors
    /// [`LawFault::OutsideInterval`] and [`LawFault::BadInterval`].
    ///
    /// # Panics
    /// If there are not as many values and intervals as parameters.
    pub fn with_fitted(&self, values: &[f64], intervals: &[[f64; 2]]) -> Result<Self, LawError> {
        assert_eq!(intervals.len(), self.parameters.len(), "intervals of the parameters of law {}", self.id);
        let mut law = self.clone();
        for (parameter, [low, high]) in law.parameters.iter_mut().zip(intervals) {
            (parameter.low, parameter.high) = (*low, *high);
        }
        law.with_values(values)
    }

    /// The parameter in proportion to which the whole law goes, so that it says how strong the law is: the first by name, where there is one.
    ///
    /// ```
    /// use sabine_paths::laws::{Law, LawParameter, LawTarget};
    /// let per_metre = LawParameter::new(0.1, [0.0, 0.5], "dB/m");
    /// let law = Law::new("fog", LawTarget::Path, None, "-a * length_m * reflections", [("a", per_metre)])?;
    /// assert_eq!(law.amplitude(), Some("a"));
    /// # Ok::<(), sabine_paths::laws::LawError>(())
    /// ```
    pub fn amplitude(&self) -> Option<&str> {
        let index = (0..self.names.len()).find(|&i| self.formula.is_proportional_to(&[i as u16]))?;
        Some(&self.names[index])
    }

    /// The parameters that say together how strong the law is: [`Law::amplitude`] where there is one, else the fewest that have an interval
    /// and in proportion to which, taken together, the whole law goes. None where no such are seen.
    ///
    /// ```
    /// use sabine_paths::laws::{Law, LawParameter, LawTarget};
    /// let db = |value| LawParameter::new(value, [-6.0, 6.0], "dB");
    /// let f = LawParameter::new(1.0, [1.0, 1.0], "kHz");
    /// let law = Law::new("tilt", LawTarget::Path, None, "a + b * ln(frequency_hz / f)", [("a", db(1.0)), ("b", db(0.0)), ("f", f)])?;
    /// assert_eq!(law.amplitudes(), ["a", "b"]);
    /// # Ok::<(), sabine_paths::laws::LawError>(())
    /// ```
    pub fn amplitudes(&self) -> Vec<&str> {
        if let Some(one) = self.amplitude() {
            return vec![one];
        }
        let has_interval = |i: &usize| self.parameters[*i].low < self.parameters[*i].high;
        let open: Vec<u16> = (0..self.names.len()).filter(has_interval).map(|i| i as u16).collect();
        // Few have more: a set of these would be looked for too long.
        if open.len() > MAX_TOGETHER {
            return Vec::new();
        }
        let mut sets: Vec<Vec<u16>> = (0..1u32 << open.len())
            .map(|bits| {
                open.iter().enumerate().filter(|(i, _)| bits >> i & 1 == 1).map(|(_, p)| *p).collect()
            })
            .collect();
        sets.sort_by_key(Vec::len);
        let found = sets.into_iter().find(|set| self.formula.is_proportional_to(set));
        found.unwrap_or_default().iter().map(|i| self.names[usize::from(*i)].as_str()).collect()
    }

    /// Whether all that a parameter does is to say where steps over the frequency stand, as `f0` in `above(frequency_hz, f0)`: between the
    /// centres of two bands it changes nothing.
    pub fn is_edge_of_bands(&self, parameter: &str) -> bool {
        let index = self.names.iter().position(|name| name == parameter);
        index.is_some_and(|i| self.formula.is_edge_of_bands(i as u16))
    }

    /// The same law times a pure number, which becomes a parameter of this name.
    ///
    /// # Errors
    /// As [`Law::new`]: the name may be taken, the formula become too long.
    pub fn times(&self, name: &str, factor: LawParameter) -> Result<Self, LawError> {
        if self.names.iter().any(|own| own == name) {
            return Err(self.error(None, LawFault::BadParameterName(name.to_owned())));
        }
        let own = self.names.iter().cloned().zip(self.parameters.iter().cloned());
        let formula = format!("{name} * ({})", self.text);
        let parameters = own.chain([(name.to_owned(), factor)]);
        let law = Self::new(self.id.clone(), self.target, self.surface(), &formula, parameters)?;
        Ok(law.with_words(self.words.clone()))
    }

    /// The same law of another material, under another identifier.
    ///
    /// ```
    /// use sabine_paths::laws::{Law, LawParameter, LawTarget};
    /// let a = [("a", LawParameter::new(3.0, [0.0, 9.0], "dB"))];
    /// let law = Law::new("carpet", LawTarget::Reflection, Some("carpet"), "-a * (1 - cos_incidence)", a)?;
    /// assert_eq!(law.on_surface("curtain", "heavy curtain")?.surface(), Some("heavy curtain"));
    /// # Ok::<(), sabine_paths::laws::LawError>(())
    /// ```
    ///
    /// # Errors
    /// As [`Law::new`]: for an identifier that is none, and for a law of anything but reflections, which has no surface.
    pub fn on_surface(&self, id: &str, surface: &str) -> Result<Self, LawError> {
        let own = self.names.iter().cloned().zip(self.parameters.iter().cloned());
        Ok(Self::new(id, self.target, Some(surface), &self.text, own)?.with_words(self.words.clone()))
    }

    /// The receiver at which alone the law does anything, as its form shows it: `receiver(ID)` multiplies the whole.
    ///
    /// ```
    /// use sabine_paths::laws::{Law, LawParameter, LawTarget};
    /// let gain = |formula| {
    ///     let a = [("a", LawParameter::new(3.0, [-9.0, 9.0], "dB"))];
    ///     Law::new("gain", LawTarget::Path, None, formula, a)
    /// };
    /// assert_eq!(gain("a * receiver(mic 1)")?.only_receiver(), Some("mic 1"));
    /// assert_eq!(gain("a * (1 - receiver(mic 1))")?.only_receiver(), None);
    /// # Ok::<(), sabine_paths::laws::LawError>(())
    /// ```
    pub fn only_receiver(&self) -> Option<&str> {
        let names = self.formula.names.iter().enumerate();
        let mut all = names.filter(|(i, (named, _))| {
            *named == Named::Receiver && self.formula.is_proportional_to_named(*i as u16)
        });
        all.next().map(|(_, (_, name))| name.as_str())
    }

    /// The same law of another receiver, under another identifier: each `receiver(...)` of its formula becomes that of this one.
    ///
    /// ```
    /// use sabine_paths::laws::{Law, LawParameter, LawTarget};
    /// let a = [("a", LawParameter::new(3.0, [-9.0, 9.0], "dB"))];
    /// let law = Law::new("first", LawTarget::Path, None, "a * receiver(mic 1)", a)?;
    /// assert_eq!(law.of_receiver("second", "mic 2")?.formula(), "a * receiver(mic 2)");
    /// # Ok::<(), sabine_paths::laws::LawError>(())
    /// ```
    ///
    /// # Errors
    /// As [`Law::new`]: for an identifier that is none, and for a receiver whose name a formula cannot hold (empty, or with brackets).
    pub fn of_receiver(&self, id: &str, receiver: &str) -> Result<Self, LawError> {
        let mut formula = self.formula.clone();
        let own = formula.names.iter_mut().filter(|(named, _)| *named == Named::Receiver);
        own.for_each(|(_, name)| receiver.clone_into(name));
        let parameters = self.names.iter().cloned().zip(self.parameters.iter().cloned());
        let law = Self::new(id, self.target, self.surface(), &formula.print(&self.names), parameters)?;
        Ok(law.with_words(self.words.clone()))
    }

    /// Its identifier.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// What it changes.
    pub fn target(&self) -> LawTarget {
        self.target
    }

    /// The surface whose reflections it changes.
    pub fn surface(&self) -> Option<&str> {
        self.surface.as_deref()
    }

    /// The formula as it was written.
    pub fn formula(&self) -> &str {
        &self.text
    }

    /// The formula without needless brackets and blanks; it reads as the same formula.
    pub fn printed(&self) -> String {
        self.formula.print(&self.names)
    }

    /// What it says in plain words; empty where nobody said it.
    pub fn words(&self) -> &str {
        &self.words
    }

    /// Its parameters by name.
    pub fn parameters(&self) -> impl ExactSizeIterator<Item = (&str, &LawParameter)> {
        self.names.iter().map(String::as_str).zip(&self.parameters)
    }

    /// The value in dB, or in ms for a delay, where variables have these values, in the unit that their name ends in. Meetings with a material
    /// are asked for as `hits(NAME)`, whether a response has a source or a receiver as `source(ID)` and `receiver(ID)`.
    ///
    /// # Errors
    /// [`LawFault::NotKnown`] for a variable without a value, [`LawFault::DivisionByZero`], [`LawFault::NotFinite`].
    pub fn value(&self, variable: impl Fn(&str) -> Option<f64>) -> Result<f64, LawError> {
        Ok(self.evaluated(&variable, None)?.value)
    }

    /// The value, and its derivative by each parameter in the parameter's unit (forward mode; exact but for rounding). Steps have derivative zero.
    ///
    /// # Errors
    /// As [`Law::value`].
    pub fn value_and_gradient(
        &self,
        variable: impl Fn(&str) -> Option<f64>,
    ) -> Result<(f64, Vec<f64>), LawError> {
        let by = |index| Ok(self.evaluated(&variable, Some(index))?.slope);
        Ok((self.value(&variable)?, (0..self.names.len()).map(by).collect::<Result<_, LawError>>()?))
    }

    fn evaluated(
        &self,
        variable: &impl Fn(&str) -> Option<f64>,
        by: Option<usize>,
    ) -> Result<Dual, LawError> {
        let values = self.variable_values(variable)?;
        let leaf = |op: Op| {
            let (value, slope) = match op {
                Op::Number(value) => (value, 0.0),
                Op::Parameter(index) => {
                    let index = usize::from(index);
                    (self.base_value(index), if by == Some(index) { self.units[index].scale } else { 0.0 })
                }
                other => (values.iter().find(|(op, _)| *op == other).map_or(f64::NAN, |(_, v)| *v), 0.0),
            };
            Dual { value, slope }
        };
        let factor = self.factor();
        match evaluate(&self.formula, leaf) {
            Ok(found) => Ok(Dual { value: factor * found.value, slope: factor * found.slope }),
            Err(at) => {
                let zero = self.divisor_is_zero(at, leaf);
                Err(self.error_at(at, fault_of(&self.formula, at, zero, Place::default())))
            }
        }
    }

    /// Whether the division at this place divides by zero.
    fn divisor_is_zero(&self, at: usize, leaf: impl Fn(Op) -> Dual) -> bool {
        let Op::Binary(Binary::Divide, _, divisor) = self.formula.ops[at] else { return false };
        let part =
            Formula { ops: self.formula.ops[..=usize::from(divisor)].to_vec(), ..self.formula.clone() };
        evaluate(&part, leaf).is_ok_and(|divisor| divisor.value == 0.0)
    }

    fn variable_values(&self, variable: &impl Fn(&str) -> Option<f64>) -> Result<Vec<(Op, f64)>, LawError> {
        let mut values = Vec::new();
        for (at, &op) in self.formula.ops.iter().enumerate() {
            let (name, known) = match op {
                Op::Variable(of) => (of.name(), variable(of.name())),
                Op::Named(named, index) => (named.word(), variable(&self.formula.named(index))),
                _ => continue,
            };
            let why = "nobody gave its value";
            let value = known.ok_or_else(|| self.error_at(at, LawFault::NotKnown { variable: name, why }))?;
            values.push((op, value));
        }
        Ok(values)
    }

    /// Value of a parameter in base units.
    pub(crate) fn base_value(&self, index: usize) -> f64 {
        self.parameters[index].value * self.units[index].scale
    }

    /// Base units in the unit of a parameter.
    pub(crate) fn scale(&self, index: usize) -> f64 {
        self.units[index].scale
    }

    /// From base units to the unit of the target.
    pub(crate) fn factor(&self) -> f64 {
        if self.target == LawTarget::Delay { 1e3 } else { 1.0 }
    }

    pub(crate) fn error(&self, column: Option<usize>, fault: LawFault) -> LawError {
        LawError { law: self.id.clone(), column, fault }
    }

    /// An error of the operation at this place.
    pub(crate) fn error_at(&self, at: usize, fault: LawFault) -> LawError {
        self.error(Some(usize::from(self.formula.columns[at])), fault)
    }
}

fn check_interval(name: &str, parameter: &LawParameter) -> Result<(), LawFault> {
    let LawParameter { value, low, high, .. } = *parameter;
    if !(low.is_finite() && high.is_finite() && low <= high) {
        return Err(LawFault::BadInterval(name.to_owned()));
    }
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(LawFault::OutsideInterval { parameter: name.to_owned(), value, low, high })
    }
}
