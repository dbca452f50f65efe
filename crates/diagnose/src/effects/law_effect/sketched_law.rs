//! A law of several parameters, evaluated on a few classes of paths in each bin.

use super::free_parameters::FittedLaw;
#[cfg(test)]
use super::path_classes::COSINES;
use super::path_classes::{at_cosines, sketched};
use crate::effect::DecayTerm;
use crate::error::Error;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::{TracedPairView, TracedRoomView};
use crate::simulate::views::BandView;
use crate::statistics::exp_all;
use sabine_acoustics::Error as Cause;
use sabine_paths::laws::{BoundLaws, LawTarget, LawVariable};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Natural logarithm of the energy per decibel.
pub(super) const NEPERS_PER_DB: f64 = std::f64::consts::LN_10 / 10.0;
/// Least logarithm of a share of energy that counts.
const LEAST_NEPERS: f64 = -600.0;

/// A law of paths, reflections or the recorder whose parameters are fitted, whatever their part in the formula.
#[derive(Clone, Debug)]
pub(super) struct SketchedLaw(pub FittedLaw);

/// What one band of one pair has of a law's variables.
struct Sketch {
    /// Variables of pair and response.
    site: Arc<BTreeMap<String, f64>>,
    names: Arc<Vec<String>>,
    /// Cells of each bin: `starts[bin]..starts[bin + 1]`.
    starts: Vec<usize>,
    /// Share of each cell in the energy of its bin.
    shares: Vec<f64>,
    /// `[number][cell]`: means of variables, or meetings at each cosine.
    numbers: Vec<Vec<f64>>,
}

impl SketchedLaw {
    /// Sketches of all bands of a pair. Where the law has no value on some path as it was written, or at an end of an interval, is an error.
    fn sketches(&self, pair: &TracedPairView<'_>) -> Result<Vec<Sketch>, Error> {
        let (law, survey) = (&self.0.law, pair.room().survey());
        let site = pair.law_site();
        let bound = BoundLaws::new(std::slice::from_ref(law), &site).map_err(Cause::from)?;
        pair.energies_under(&bound)?;
        let known = |name: String| site.variable(&name).map(|value| (name, value));
        let known: BTreeMap<String, f64> = law.variables().into_iter().filter_map(known).collect();
        let sketched = sketched(law, &self.0.plain(), &bound, pair)?;
        let (site, names) = (Arc::new(known), Arc::new(sketched.names));
        let energies = pair.expanded_energies()?;
        let of_band = |(band, energies): (usize, &Vec<f32>)| {
            let width = sketched.paths.width();
            let (site, names) = (Arc::clone(&site), Arc::clone(&names));
            let mut sketch = Sketch {
                site,
                names,
                starts: vec![0],
                shares: Vec::new(),
                numbers: vec![Vec::new(); width - 1],
            };
            let hz = survey.bands().nominal_hz(band);
            let checked = |sketch: Sketch| {
                self.0.check(hz, |corner| self.levels_db(&sketch, corner, hz))?;
                Ok(sketch)
            };
            if width == 1 && sketched.paths.count == 1 {
                return checked(sketch);
            }
            for row in pair.class_sums(band, energies, &sketched.paths) {
                let whole: f64 = row.chunks(width).map(|class| class[0]).sum();
                for class in row.chunks(width).filter(|class| class[0] > 0.0) {
                    sketch.shares.push(class[0] / whole);
                    let means = class[1..].iter().map(|sum| sum / class[0]);
                    sketch.numbers.iter_mut().zip(means).for_each(|(column, mean)| column.push(mean));
                }
                sketch.starts.push(sketch.shares.len());
            }
            checked(sketch)
        };
        energies.iter().enumerate().map(of_band).collect()
    }

    /// The level of the law in each cell, in dB; one number where it is the same in all; none where a variable is not known.
    fn levels_db(&self, sketch: &Sketch, fitted: &[f64], hz: f64) -> Vec<f64> {
        let (law, values) = (&self.0.law, self.0.values(fitted));
        let cells = sketch.shares.len();
        if law.target() == LawTarget::Reflection {
            let site = |name: &str| sketch.site.get(name).copied();
            let Ok(levels) = at_cosines(law, &values, hz, &site) else { return Vec::new() };
            let mut sums = vec![0.0; cells];
            for (column, level) in sketch.numbers.iter().zip(levels) {
                sums.iter_mut().zip(column).for_each(|(sum, n)| *sum += n * level);
            }
            return sums;
        }
        let variable = |name: &str| {
            if name == "frequency_hz" {
                return Some(LawVariable::Same(hz));
            }
            let column = sketch.names.iter().position(|own| own == name);
            column
                .map(|column| LawVariable::Each(&sketch.numbers[column]))
                .or_else(|| sketch.site.get(name).map(|value| LawVariable::Same(*value)))
        };
        law.values(&values, if law.is_uniform() { 1 } else { cells }, variable).unwrap_or_default()
    }
}

impl DecayTerm for SketchedLaw {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        Ok(Tables::of_bins(room.by_pair(|pair| self.sketches(pair))?))
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        let names =
            self.0.law.variables().into_iter().filter(|name| name != "frequency_hz").collect::<Vec<_>>();
        let reflections = self.0.law.target() == LawTarget::Reflection;
        let columns = if reflections { COSINES } else { names.len() };
        let cells = 2 * bins;
        let number =
            |k: usize| (0..cells).map(|cell| 1.0 + 0.5 * ((k + 1) as f64 * cell as f64).sin()).collect();
        Some(Box::new(Sketch {
            site: Arc::default(),
            names: Arc::new(names),
            starts: (0..=bins).map(|bin| 2 * bin).collect(),
            shares: (0..cells).map(|cell| if cell % 2 == 0 { 0.7 } else { 0.3 }).collect(),
            numbers: (0..columns).map(number).collect(),
        }))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(sketch) = view.table::<Sketch>() else { return };
        let hz = view.survey().bands().nominal_hz(view.band());
        let mut levels = self.levels_db(sketch, values, hz);
        levels.iter_mut().for_each(|db| *db = (*db * NEPERS_PER_DB).max(LEAST_NEPERS));
        if sketch.shares.is_empty() {
            let same = levels.first().copied().unwrap_or(0.0);
            ln_energy.iter_mut().for_each(|ln| *ln += same);
            return;
        }
        if levels.len() < sketch.shares.len() {
            return;
        }
        exp_all(&mut levels);
        for (ln, ends) in ln_energy.iter_mut().zip(sketch.starts.windows(2)) {
            let cells = ends[0]..ends[1];
            if !cells.is_empty() {
                let kept: f64 = cells.map(|cell| sketch.shares[cell] * levels[cell]).sum();
                *ln += kept.max(1e-300).ln();
            }
        }
    }
}
