//! A law as a cause: a formula that somebody wrote, weighed beside the catalogue.

use crate::effect::{Case, DecayTerm, Effect, EffectInfo, FittedCase, Parameter, Stage};
use crate::error::Error;
use crate::extend::model_change::ModelChange;
use crate::simulate::tables::{Tables, Unprepared, between};
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_acoustics::Error as Cause;
use sabine_paths::laws::{BoundLaws, Law, LawError, LawParameter, LawTarget};

/// Amplitudes at which energies are tabulated, on each side of zero.
const STEPS: usize = 6;
/// Name of the amplitude of a law that has none of its own.
const STRENGTH: &str = "strength";
/// A strength of so much on either side is tried: the law as it was written, half as much again, or turned about.
const STRENGTHS: [f64; 2] = [-1.5, 1.5];
/// Half the width of a 90 % interval in standard deviations.
const HALF_90: f64 = 1.645;

/// A law whose amplitude is fitted: the parameter in proportion to which the whole law goes ([`Law::amplitude`]), or else a `strength` that
/// multiplies the formula and is 1 where the law holds as it was written. Other parameters keep the values that were written.
///
/// The amplitude is sought over its interval and zero, under a normal prior about zero whose 90 % interval reaches to the farther end: a law
/// must speak for itself, however sure its author is. Energies of the traced paths are tabulated at six amplitudes on each side and joined
/// by straight lines; single reflections and arrival times stay as they are.
///
/// Laws of paths, reflections and the recorder are weighed. Laws of delay and of added sound are not.
///
/// ```
/// use sabine_diagnose::{DiagnoseConfig, Diagnoser, LawEffect, Effect};
/// use sabine_paths::laws::{Law, LawParameter, LawTarget};
/// let a = LawParameter::new(0.1, [0.0, 0.4], "dB/m");
/// let fog = Law::new("fog", LawTarget::Path, None, "-a * length_m", [("a", a)])?;
/// assert_eq!(LawEffect::new(fog.clone())?.id(), "fog");
/// let diagnoser = Diagnoser::new(DiagnoseConfig::default())?.with_laws(vec![fog])?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct LawEffect {
    law: Law,
    /// Which parameter of the law is its amplitude.
    amplitude: usize,
    name: String,
    unit: String,
    /// Amplitudes at which energies are tabulated, as far apart on each side of zero.
    grid: Vec<f64>,
}

impl LawEffect {
    /// Takes a law.
    ///
    /// # Errors
    /// [`Error::LawNotWeighed`] for a law of delay or of added sound, for one whose amplitude has no range but zero, and for one that has no
    /// amplitude and cannot be multiplied by a `strength`.
    pub fn new(law: Law) -> Result<Self, Error> {
        let id = law.id().to_owned();
        let refused = |reason: String| Error::LawNotWeighed { id: id.clone(), reason };
        match law.target() {
            LawTarget::Path | LawTarget::Reflection | LawTarget::Recorder => {}
            other => {
                return Err(refused(format!(
                    "a law of target `{other}` is rendered, not weighed as a cause"
                )));
            }
        }
        let strengthened = || law.times(STRENGTH, LawParameter::new(1.0, STRENGTHS, "1"));
        let law = if law.amplitude().is_some() {
            law
        } else {
            strengthened().map_err(|error| {
                refused(format!("no parameter says how strong it is, and none can be added: {error}"))
            })?
        };
        let named = law.parameters().enumerate().find(|(_, (name, _))| Some(*name) == law.amplitude());
        let Some((amplitude, (name, parameter))) = named else {
            return Err(refused("no parameter says how strong it is".to_owned()));
        };
        let (low, high) = (parameter.low.min(0.0), parameter.high.max(0.0));
        if low == high {
            return Err(refused(format!("the interval of `{name}` is zero alone: nothing is left to fit")));
        }
        let side = |end: f64| (1..=STEPS).map(move |i| end * i as f64 / STEPS as f64).filter(|x| *x != 0.0);
        let mut grid: Vec<f64> = side(low).chain([0.0]).chain(side(high)).collect();
        grid.sort_by(f64::total_cmp);
        let (name, unit) =
            (name.to_owned(), if parameter.unit == "1" { "" } else { &parameter.unit }.to_owned());
        Ok(Self { law, amplitude, name, unit, grid })
    }

    /// The law at an amplitude, in an interval of it.
    fn at(&self, amplitude: f64, interval: [f64; 2]) -> Result<Law, LawError> {
        let (mut values, mut intervals): (Vec<f64>, Vec<[f64; 2]>) =
            self.law.parameters().map(|(_, p)| (p.value, [p.low, p.high])).unzip();
        values[self.amplitude] = amplitude;
        intervals[self.amplitude] = interval;
        self.law.with_fitted(&values, &intervals)
    }

    /// Energies of a pair's paths at an amplitude.
    fn energies(&self, pair: &TracedPairView<'_>, amplitude: f64) -> Result<Vec<Vec<f32>>, Error> {
        let law = self.at(amplitude, [amplitude; 2]).map_err(Cause::from)?;
        let bound = BoundLaws::new(&[law], &pair.law_site()).map_err(Cause::from)?;
        pair.energies_under(&bound)
    }

    /// Tables of all bands. The decibels of a law go with its amplitude: each step multiplies the energy of a path by the same factor.
    fn tables(&self, pair: &TracedPairView<'_>) -> Result<Vec<LawTable>, Error> {
        let without = pair.energies(pair.room().materials())?;
        let zero = self.grid.iter().position(|x| *x == 0.0).unwrap_or(0);
        let (below, above) = (self.grid[..zero].iter().rev(), self.grid[zero + 1..].iter());
        let one_side = |amplitudes: Vec<f64>| -> Result<Vec<Vec<Vec<f64>>>, Error> {
            let (Some(&first), Some(&last)) = (amplitudes.first(), amplitudes.last()) else {
                return Ok(vec![Vec::new(); without.len()]);
            };
            // Where the law would be too loud is an error, not a number.
            self.energies(pair, last)?;
            let stepped = self.energies(pair, first)?;
            let in_band = |band: usize| {
                let mut energies = without[band].clone();
                let factors: Vec<f32> = energies
                    .iter()
                    .zip(&stepped[band])
                    .map(|(e, s)| if *e > 0.0 { s / e } else { 0.0 })
                    .collect();
                let mut step = || {
                    energies.iter_mut().zip(&factors).for_each(|(e, factor)| *e *= factor);
                    pair.ln_changes(band, &energies)
                };
                amplitudes.iter().map(|_| step()).collect()
            };
            Ok((0..without.len()).map(in_band).collect())
        };
        let (below, above) = (one_side(below.copied().collect())?, one_side(above.copied().collect())?);
        let joined = |(mut below, above): (Vec<Vec<f64>>, Vec<Vec<f64>>)| {
            below.reverse();
            below.push(vec![0.0; above.first().or(below.first()).map_or(0, Vec::len)]);
            below.extend(above);
            LawTable { grid: self.grid.clone(), ln_changes: below }
        };
        Ok(below.into_iter().zip(above).map(joined).collect())
    }
}

impl Effect for LawEffect {
    fn info(&self) -> EffectInfo {
        let printed = self.law.printed();
        let words = self.law.words();
        let explanation = if words.is_empty() {
            format!("The law `{printed}` is at work on each {}.", self.law.target())
        } else {
            words.to_owned()
        };
        EffectInfo::new(self.law.id().to_owned(), format!("Law {}: {printed}", self.law.id()), explanation)
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let (low, high) = (self.grid[0], self.grid[self.grid.len() - 1]);
        let farther = if -low > high { low } else { high };
        let amplitude =
            Parameter::new(self.name.clone(), self.unit.clone(), 0.0, farther.abs() / HALF_90, (low, high));
        let starts = [0.1 * farther, 0.6 * farther].map(|start| vec![start]).to_vec();
        let own = self.clone();
        let changes = move |fitted: &FittedCase<'_>| {
            let value = fitted.values()[0];
            // What was fitted lies in its interval.
            own.at(value, fitted.interval(0))
                .map_or_else(|_| Vec::new(), |law| vec![ModelChange::Law(Box::new(law))])
        };
        let stage = if self.law.target() == LawTarget::Recorder { Stage::Recorder } else { Stage::Room };
        let case = Case::decay(vec![amplitude.typically(0.5 * farther)], self.clone());
        vec![case.at(stage).starting(starts).changing(changes)]
    }
}

/// Logarithm of the change of the energy of each bin of one band and pair, `[grid][bin]`.
#[derive(Clone)]
struct LawTable {
    grid: Vec<f64>,
    ln_changes: Vec<Vec<f64>>,
}

impl DecayTerm for LawEffect {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        Ok(Tables::of_bins(room.by_pair(|pair| self.tables(pair))?))
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        let at = |x: &f64| (0..bins).map(|bin| 0.3 * x * (1.1 * bin as f64 + 1.0).sin()).collect();
        Some(Box::new(LawTable { grid: self.grid.clone(), ln_changes: self.grid.iter().map(at).collect() }))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(table) = view.table::<LawTable>() else { return };
        for (bin, ln) in ln_energy.iter_mut().enumerate() {
            *ln += between(&table.grid, &table.ln_changes, bin, values[0]);
        }
    }
}
