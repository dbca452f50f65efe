//! What a fit found, and what it could not.

use sabine_acoustics::{Material, PerBand, Reading};
use sabine_scene::{MaterialTable, Materials};
use std::fmt;

/// Fitted materials and everything that must be said about them.
#[derive(Clone, Debug)]
pub struct MaterialFit {
    /// The materials with fitted absorption; scattering as given.
    pub materials: Vec<Material>,
    /// Standard error of each fitted absorption: what the target's own error, the Monte-Carlo error of the paths and the
    /// prior leave open (linearised; see [`MaterialFitter`](crate::MaterialFitter)). A material that the data say nothing about keeps the
    /// standard deviation of its prior; one that was held has none.
    pub absorption_standard_error: Vec<PerBand<f64>>,
    /// Reverberation time of the decay curves over the fitted range with the fitted materials, in seconds; the standard
    /// error is that of the paths (Monte Carlo). The slope is ISO's whichever objective was fitted.
    pub predicted_t60_s: PerBand<Reading>,
    /// Targets that are not met, and why.
    pub unreachable: Vec<Unreachable>,
    /// Absorptions that stand at a bound of the fit.
    pub at_bounds: Vec<AtBound>,
    /// Absorptions, or differences between them, that the data leave open.
    pub not_determined: Vec<Undetermined>,
    /// Answers to be taken with care, and bands without one ([`Warning::NotConverged`]).
    pub warnings: Vec<Warning>,
    /// Iterations of the solver, over all bands and rounds.
    pub iterations: usize,
    /// Half the sum of squared deviations from the priors in standard deviations, smoothness included: how improbable the
    /// answer is beforehand. A few tenths for each material and band is usual.
    pub cost: f64,
}

/// A target that the fit does not meet.
#[derive(Clone, Debug, PartialEq)]
pub struct Unreachable {
    /// Nominal centre of the band, in Hz.
    pub band_hz: f64,
    /// Why.
    pub reason: UnreachableReason,
}

/// Why a target is not met.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum UnreachableReason {
    /// Air absorbs so much that even rigid walls would not do.
    AirLimit {
        /// Reverberation time between rigid walls, in seconds.
        limit_s: f64,
        /// The target, in seconds.
        target_s: f64,
    },
    /// Every material that matters stands at its upper bound and the sound still rings too long.
    AbsorptionAtUpperBound {
        /// What the bound gives, in seconds.
        reached_s: f64,
        /// The target, in seconds.
        target_s: f64,
    },
    /// Every material that matters stands at its lower bound and the sound still dies too fast.
    AbsorptionAtLowerBound {
        /// What the bound gives, in seconds.
        reached_s: f64,
        /// The target, in seconds.
        target_s: f64,
    },
    /// Every material that matters is held by its prior.
    AllHeld {
        /// What they give, in seconds.
        reached_s: f64,
        /// The target, in seconds.
        target_s: f64,
    },
    /// The solver found nothing closer, though some absorption is off its bounds.
    NothingCloser {
        /// The closest found, in seconds; infinite where the level does not fall.
        reached_s: f64,
        /// The target, in seconds.
        target_s: f64,
    },
    /// No energy arrives in the band, or all at once: its decay cannot be read.
    NoEnergy,
}

impl fmt::Display for UnreachableReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::AirLimit { limit_s, target_s } => write!(
                f,
                "air alone limits T60 to {limit_s:.2} s; the target of {target_s:.2} s cannot be reached"
            ),
            Self::AbsorptionAtUpperBound { reached_s, target_s } => write!(
                f,
                "with absorption at its upper bound T60 is still {reached_s:.2} s; the target of {target_s:.2} s cannot be reached"
            ),
            Self::AbsorptionAtLowerBound { reached_s, target_s } => write!(
                f,
                "with absorption at its lower bound T60 is only {reached_s:.2} s; the target of {target_s:.2} s cannot be reached"
            ),
            Self::AllHeld { reached_s, target_s } => write!(
                f,
                "the materials are held where they give {reached_s:.2} s; the target of {target_s:.2} s is not met"
            ),
            Self::NothingCloser { reached_s, target_s } => write!(
                f,
                "nothing closer than {reached_s:.2} s was found; the target of {target_s:.2} s is not met"
            ),
            Self::NoEnergy => f.write_str("no decaying energy arrives; nothing can be fitted"),
        }
    }
}

impl fmt::Display for Unreachable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} Hz: {}", self.band_hz, self.reason)
    }
}

/// An absorption that stands at a bound of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtBound {
    /// Index of the material.
    pub material: usize,
    /// Nominal centre of the band, in Hz.
    pub band_hz: f64,
    /// The bound.
    pub absorption: f64,
    /// Whether it is the upper one.
    pub upper: bool,
}

impl AtBound {
    /// The finding in words, with a name for each material; one without a name is called by its number.
    pub fn describe(&self, names: &[&str]) -> String {
        let side = if self.upper { "upper" } else { "lower" };
        let (name, absorption) = (name_of(self.material, names), self.absorption);
        format!("{} Hz: {name} stands at the {side} bound of absorption, {absorption}", self.band_hz)
    }
}

impl fmt::Display for AtBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.describe(&[]))
    }
}

/// What the data leave open.
#[derive(Clone, Debug, PartialEq)]
pub struct Undetermined {
    /// Indices of the materials, rising.
    pub materials: Vec<usize>,
    /// Nominal centres of the bands in which this holds, in Hz, rising.
    pub bands_hz: Vec<f64>,
    /// In what way they are open.
    pub kind: UndeterminedKind,
}

/// In what way absorption is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum UndeterminedKind {
    /// Only a combination of them shows in the decay: one may absorb more if another absorbs less.
    Together,
    /// It hardly shows in the decay; the value is the prior's.
    Insensitive,
    /// No path meets it; the value is the prior's.
    NeverHit,
}

impl Undetermined {
    /// The finding in words, with a name for each material: "floor and ceiling cannot be told apart at 2 kHz".
    /// A material without a name is called by its number.
    pub fn describe(&self, names: &[&str]) -> String {
        let materials = in_words(&self.materials.iter().map(|&m| name_of(m, names)).collect::<Vec<_>>());
        let bands = bands_in_words(&self.bands_hz);
        let several = self.materials.len() > 1;
        match self.kind {
            UndeterminedKind::Together => format!("{materials} cannot be told apart at {bands}"),
            UndeterminedKind::Insensitive => {
                format!(
                    "{materials} hardly {} in the decay at {bands}",
                    if several { "show" } else { "shows" }
                )
            }
            UndeterminedKind::NeverHit => format!("no path meets {materials}"),
        }
    }
}

impl fmt::Display for Undetermined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.describe(&[]))
    }
}

/// Something that makes an answer doubtful.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// To meet the target a material had to move far from what was known of it.
    FarFromPrior {
        /// Index of the material.
        material: usize,
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// Fitted absorption less the prior's mean, in standard deviations.
        deviations: f64,
    },
    /// The fit of this band has not converged: its absorptions are where the solver stopped, not a result. Their standard errors are
    /// no less than those of the priors.
    NotConverged {
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// Why.
        reason: Unconverged,
    },
    /// The measured decay is not what the paths explain with any absorption, so that only what lies above the end of the fitted range
    /// and 10 dB below it was fitted: the late decay of an octave bends where its lower edge rings longer, or another room is coupled.
    LateDecayLeftOut {
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
    },
    /// So few paths carry the decay that T60 is uncertain by more than 3 %: the fit follows their accidents, and other
    /// rays will decay otherwise, most likely longer.
    FewPaths {
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// Monte-Carlo standard error of T60, as a share of it.
        relative_error: f64,
    },
    /// The paths end so early that the fitted range of the decay is bent: T60 is read short.
    ShortPaths {
        /// Nominal centre of the band, in Hz.
        band_hz: f64,
        /// Duration for which paths were traced, in seconds.
        traced_s: f64,
        /// Duration that would bend T60 by about 1 % at most, in seconds.
        advised_s: f64,
    },
}

/// Why a fit has not converged.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Unconverged {
    /// The iterations ran out while a material still moved.
    StillMoving {
        /// Greatest change of a material in the last round, in standard deviations of its prior.
        deviations: f64,
    },
    /// The solver found no step that lowers the cost, though the gradient is not zero.
    NoDescent,
}

impl fmt::Display for Unconverged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StillMoving { deviations } => write!(
                f,
                "the iterations ran out while a material still moved by {deviations:.2} standard deviations of its prior"
            ),
            Self::NoDescent => f.write_str("the solver found no step that lowers the cost"),
        }
    }
}

impl MaterialFit {
    /// The materials as tables by these names, one for each: what a room file and [`Materials::write`] take.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::MaterialCount`] for another number of names; else as [`Materials::new`].
    pub fn tables(&self, names: &[&str]) -> Result<Materials, sabine_scene::Error> {
        let (expected, found) = (self.materials.len(), names.len());
        if expected != found {
            return Err(sabine_acoustics::Error::MaterialCount { expected, found }.into());
        }
        let table = |((name, material), error): ((&&str, &Material), &PerBand<f64>)| {
            MaterialTable::new(*name, material, &error.map(|sd| sd.min(1.0)))
        };
        let tables = names.iter().zip(&self.materials).zip(&self.absorption_standard_error).map(table);
        Materials::new(tables.collect::<Result<_, _>>()?)
    }

    /// Nominal centres of the bands in which the fit has not converged, in Hz; empty for a result.
    pub fn unconverged_hz(&self) -> Vec<f64> {
        let of = |warning: &Warning| match warning {
            Warning::NotConverged { band_hz, .. } => Some(*band_hz),
            _ => None,
        };
        self.warnings.iter().filter_map(of).collect()
    }
}

impl Warning {
    /// The warning in words, with a name for each material; one without a name is called by its number.
    pub fn describe(&self, names: &[&str]) -> String {
        match self {
            Self::FarFromPrior { material, band_hz, deviations } => format!(
                "{band_hz} Hz: {} had to move {deviations:+.1} standard deviations from its prior",
                name_of(*material, names)
            ),
            Self::NotConverged { band_hz, reason } => {
                format!("{band_hz} Hz: the fit has not converged, this is no result: {reason}")
            }
            Self::LateDecayLeftOut { band_hz } => format!(
                "{band_hz} Hz: the late decay is not what the simulation explains; only its first part was fitted"
            ),
            Self::FewPaths { band_hz, relative_error } => format!(
                "{band_hz} Hz: the rays leave T60 uncertain by {:.0} %; trace more of them",
                100.0 * relative_error
            ),
            Self::ShortPaths { band_hz, traced_s, advised_s } => format!(
                "{band_hz} Hz: paths end after {traced_s:.2} s; {advised_s:.2} s are advised, or T60 is read short"
            ),
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.describe(&[]))
    }
}

fn name_of(material: usize, names: &[&str]) -> String {
    names.get(material).map_or_else(|| format!("material {material}"), |&name| name.to_owned())
}

fn in_words(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [rest @ .., last] => format!("{} and {last}", rest.join(", ")),
    }
}

fn bands_in_words(bands_hz: &[f64]) -> String {
    let band = |hz: f64| if hz >= 1000.0 { format!("{} kHz", hz / 1000.0) } else { format!("{hz} Hz") };
    let octaves = bands_hz.windows(2).all(|w| (w[1] / w[0] - 2.0).abs() < 0.1);
    match bands_hz {
        [first, _, .., last] if octaves => format!("{} to {}", band(*first), band(*last)),
        _ => in_words(&bands_hz.iter().map(|&hz| band(hz)).collect::<Vec<_>>()),
    }
}

/// Whether an absorption stands at a bound, but for a rounding error.
pub(crate) fn at_bound(absorption: f64, bound: f64) -> bool {
    (absorption - bound).abs() < 1e-7
}

impl AtBound {
    pub(crate) fn find(
        standard_deviation: &[f64],
        absorption: &[f64],
        band_hz: f64,
        bounds: (f64, f64),
    ) -> Vec<Self> {
        let free = absorption.iter().enumerate().filter(|&(k, _)| standard_deviation[k] > 0.0);
        free.flat_map(|(material, &a)| {
            [(bounds.0, false), (bounds.1, true)]
                .into_iter()
                .filter(move |&(bound, _)| at_bound(a, bound))
                .map(move |(absorption, upper)| Self { material, band_hz, absorption, upper })
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_read_as_sentences() {
        let open = |materials: &[usize], bands: &[f64], kind| Undetermined {
            materials: materials.to_vec(),
            bands_hz: bands.to_vec(),
            kind,
        };
        let names = ["floor", "ceiling", "door"];
        assert_eq!(
            open(&[0, 1], &[2000.0], UndeterminedKind::Together).describe(&names),
            "floor and ceiling cannot be told apart at 2 kHz"
        );
        assert_eq!(
            open(&[0, 1, 2], &[62.5, 125.0, 250.0], UndeterminedKind::Together).describe(&names),
            "floor, ceiling and door cannot be told apart at 62.5 Hz to 250 Hz"
        );
        assert_eq!(
            open(&[2], &[125.0, 500.0], UndeterminedKind::Insensitive).to_string(),
            "material 2 hardly shows in the decay at 125 Hz and 500 Hz"
        );
        let air = UnreachableReason::AirLimit { limit_s: 1.664, target_s: 2.1 };
        assert_eq!(
            Unreachable { band_hz: 8000.0, reason: air }.to_string(),
            "8000 Hz: air alone limits T60 to 1.66 s; the target of 2.10 s cannot be reached"
        );
    }
}
