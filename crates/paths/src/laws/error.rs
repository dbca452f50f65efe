//! What is wrong with a law.

use crate::laws::target::LawTarget;
use std::fmt;

/// What is wrong with a law: which law, where in its formula, and what.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LawError {
    /// Identifier of the law.
    pub law: String,
    /// Character of the formula, the first being 1; `None` where the fault lies outside the formula.
    pub column: Option<usize>,
    /// What is wrong.
    pub fault: LawFault,
}

/// What can be wrong with a law.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LawFault {
    /// A character that no formula has.
    UnknownCharacter(char),
    /// A number that cannot be read or is not finite.
    BadNumber(String),
    /// Something else was expected.
    Expected {
        /// What the grammar allows here.
        expected: &'static str,
        /// What stands here.
        found: String,
    },
    /// A name that is neither a variable nor a parameter of the law.
    UnknownName {
        /// The name.
        name: String,
        /// The most alike of the names that are known.
        nearest: Option<String>,
    },
    /// A function that the grammar lacks.
    UnknownFunction(String),
    /// A function with too many or too few arguments.
    ArgumentCount {
        /// The function.
        function: &'static str,
        /// Arguments that it takes.
        expected: usize,
        /// Arguments found.
        found: usize,
    },
    /// Brackets or signs nested deeper than `MAX_DEPTH`.
    TooDeep {
        /// The limit.
        max: usize,
    },
    /// A formula of more than `MAX_LENGTH` characters.
    TooLong {
        /// The limit.
        max: usize,
    },
    /// A variable that the target does not have.
    NotOfTarget {
        /// The variable.
        variable: &'static str,
        /// The target.
        target: LawTarget,
    },
    /// Two quantities of different units are added or compared.
    UnitsDiffer {
        /// Unit of the left one.
        left: String,
        /// Unit of the right one.
        right: String,
    },
    /// A quantity where a pure number is needed.
    NotPure {
        /// What needs it.
        what: &'static str,
        /// The unit found.
        found: String,
    },
    /// A power of a quantity that is no number written out, or gives a unit beyond twelfths.
    PowerOfUnit(String),
    /// The formula has another unit than the target.
    WrongUnit {
        /// The target.
        target: LawTarget,
        /// Unit of the formula.
        found: String,
    },
    /// A unit that cannot be read.
    UnknownUnit {
        /// The parameter.
        parameter: String,
        /// Its unit as it stands.
        unit: String,
    },
    /// A parameter whose interval is empty or not finite.
    BadInterval(String),
    /// A parameter outside its interval.
    OutsideInterval {
        /// The parameter.
        parameter: String,
        /// Its value.
        value: f64,
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// A parameter whose name is that of a variable or function, or no name.
    BadParameterName(String),
    /// A parameter that the formula does not use.
    UnusedParameter(String),
    /// An identifier that is empty or has other characters than letters, digits, `_`, `-` and `.`.
    BadIdentifier,
    /// Two laws of the same identifier.
    Twice,
    /// More laws than `MAX_LAWS`.
    TooMany {
        /// The limit.
        max: usize,
    },
    /// A law of reflections without a surface.
    NoSurface,
    /// A surface where the target has none.
    SurfaceNotWanted(LawTarget),
    /// A material that the mesh lacks.
    UnknownSurface {
        /// Its name.
        name: String,
        /// The most alike of those that the mesh has.
        nearest: Option<String>,
    },
    /// A source or a receiver that the room lacks.
    UnknownEnd {
        /// `source` or `receiver`.
        end: &'static str,
        /// Its name.
        name: String,
        /// The most alike of those that the room has.
        nearest: Option<String>,
    },
    /// A variable that this room or these paths do not tell.
    NotKnown {
        /// The variable.
        variable: &'static str,
        /// Why.
        why: &'static str,
    },
    /// A division by zero.
    DivisionByZero(Place),
    /// A result that is no finite number, of arguments outside a function's domain or too great.
    NotFinite {
        /// The operation.
        what: &'static str,
        /// Where.
        place: Place,
    },
    /// A level beyond what a law may add.
    TooLoud {
        /// The sum of the laws in dB.
        found_db: f64,
        /// The limit in dB.
        max_db: f64,
        /// Where.
        place: Place,
    },
    /// A delay that brings a path before the emission.
    BeforeEmission(Place),
}

/// Where a formula has no value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Place {
    /// Number of the path, from 0, where it depends on the path.
    pub path: Option<usize>,
    /// Centre of the band in Hz, where it depends on the band.
    pub band_hz: Option<f64>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(path) = self.path {
            write!(f, " on path {path}")?;
        }
        match self.band_hz {
            Some(hz) => write!(f, " at {hz} Hz"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for LawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "law `{}`", self.law)?;
        if let Some(column) = self.column {
            write!(f, ", column {column} of its formula")?;
        }
        write!(f, ": {}", self.fault)
    }
}

impl fmt::Display for LawFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownCharacter(c) => write!(f, "no formula has the character {c:?}"),
            Self::BadNumber(text) => write!(f, "`{text}` is no finite number"),
            Self::Expected { expected, found } => write!(f, "{expected} is expected, not {found}"),
            Self::UnknownName { name, nearest } => {
                write!(f, "`{name}` is neither a variable nor a parameter of this law")?;
                perhaps(f, nearest.as_ref())
            }
            Self::UnknownFunction(name) => write!(f, "there is no function `{name}`"),
            Self::ArgumentCount { function, expected, found } => {
                write!(f, "`{function}` takes {expected} arguments, not {found}")
            }
            Self::TooDeep { max } => write!(f, "nested deeper than {max}"),
            Self::TooLong { max } => write!(f, "longer than {max} characters"),
            Self::NotOfTarget { variable, target } => {
                write!(f, "a law of `{target}` has no variable `{variable}`")
            }
            Self::UnitsDiffer { left, right } => write!(f, "{left} and {right} do not go together"),
            Self::NotPure { what, found } => {
                write!(f, "{what} needs a pure number, not {found}: divide by a parameter of the same unit")
            }
            Self::PowerOfUnit(unit) => {
                write!(f, "a power of {unit} needs a number written out, and whole units (or roots of them)")
            }
            Self::WrongUnit { target, found } => {
                write!(f, "a law of `{target}` gives {}; this formula gives {found}", target.unit_text())
            }
            Self::UnknownUnit { parameter, unit } => {
                write!(
                    f,
                    "parameters.{parameter}.unit: `{unit}` is no unit; known are 1, ppm, dB, m, cm, mm, km, s, ms, us, Hz, kHz, deg, rad, C, %, and their powers, products and quotients: dB/m, s^2"
                )
            }
            other => other.fmt_of_table(f),
        }
    }
}

/// What is said of a nearest name, where there is one.
fn perhaps(f: &mut fmt::Formatter<'_>, nearest: Option<&String>) -> fmt::Result {
    match nearest {
        Some(nearest) => write!(f, "; the nearest name is `{nearest}`"),
        None => Ok(()),
    }
}

impl LawFault {
    /// Faults of the table around a formula.
    fn fmt_of_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BadInterval(name) => {
                write!(f, "parameters.{name}: low and high must be finite, low not above high")
            }
            Self::OutsideInterval { parameter, value, low, high } => {
                write!(f, "parameters.{parameter}: {value} lies outside its interval from {low} to {high}")
            }
            Self::BadParameterName(name) => {
                write!(
                    f,
                    "parameters.{name}: a parameter needs a name of letters, digits and _ that is no variable or function"
                )
            }
            Self::UnusedParameter(name) => write!(f, "parameters.{name}: the formula does not use it"),
            Self::BadIdentifier => {
                write!(f, "id: 1 to 64 letters, digits, `_`, `-` and `.` are needed")
            }
            Self::Twice => write!(f, "id: two laws have it"),
            Self::TooMany { max } => write!(f, "more than {max} laws"),
            Self::NoSurface => write!(f, "surface: a law of `reflection` needs the name of a material"),
            Self::SurfaceNotWanted(target) => write!(f, "surface: a law of `{target}` has none"),
            other => other.fmt_at_work(f),
        }
    }

    /// Faults of a law applied in a room.
    fn fmt_at_work(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownSurface { name, nearest } => {
                write!(f, "the mesh has no material `{name}`")?;
                perhaps(f, nearest.as_ref())
            }
            Self::UnknownEnd { end, name, nearest } => {
                write!(f, "the room has no {end} `{name}`")?;
                perhaps(f, nearest.as_ref())
            }
            Self::NotKnown { variable, why } => write!(f, "`{variable}` is not known: {why}"),
            Self::DivisionByZero(place) => write!(f, "division by zero{place}"),
            Self::NotFinite { what, place } => write!(f, "{what} gives no finite number{place}"),
            Self::TooLoud { found_db, max_db, place } if *found_db > 1e6 => {
                write!(f, "the laws add {found_db:.1e} dB, more than {max_db} dB{place}")
            }
            Self::TooLoud { found_db, max_db, place } => {
                write!(f, "the laws add {found_db:.1} dB, more than {max_db} dB{place}")
            }
            Self::BeforeEmission(place) => write!(f, "sound would arrive before it is emitted{place}"),
            // The two above said all others.
            other => write!(f, "{other:?}"),
        }
    }
}

impl std::error::Error for LawError {}

impl From<LawError> for sabine_acoustics::Error {
    fn from(error: LawError) -> Self {
        Self::implementation("a law cannot be applied", error)
    }
}

/// A fault and the column of the formula in which it lies.
pub(crate) type Located = (Option<usize>, LawFault);

/// The name that is most like this one, if any is: by the number of characters to change.
pub(crate) fn nearest<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> Option<String> {
    let best = known.map(|k| (edits(name, k), k)).min()?;
    (best.0 <= 1 + name.len() / 3).then(|| best.1.to_owned())
}

/// Levenshtein's distance.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let changed = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
