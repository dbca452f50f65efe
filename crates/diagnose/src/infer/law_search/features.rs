//! What each covariate is in each bin: the change of a bin's energy with the coefficient of a law is the energy-weighted mean of what the
//! law takes from its paths. All are gathered in one pass, so that formulas cost nothing more.

use crate::effects::{Covariate, Grammar};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::simulate::traced_pair::class_sums::ClassedPaths;
use crate::simulate::traced_views::TracedPairView;
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::Error as Cause;
use sabine_paths::laws::{BoundLaws, Law, LawTarget, LawVariable};

/// Angles through which directions are turned for a sham, in degrees: neither nearly as they are nor nearly opposite throughout.
const TURNED_DEG: (f64, f64) = (60.0, 300.0);

/// Means of all covariates in the bins of each pair and band.
pub(crate) struct Features {
    /// `[pair][band]`, `(bin, column)`: what is taken by the law that takes 1 dB where its covariate is 1. Columns are the covariates, and
    /// after them those whose directions are turned.
    of: Vec<Vec<DMatrix<f64>>>,
    covariates: usize,
    /// The covariate of each column behind the covariates.
    turned: Vec<usize>,
}

impl Features {
    /// Gathers them from the traced paths, at the materials about which predictions are expanded.
    pub fn gather(baseline: &Baseline, grammar: &Grammar) -> Result<Self, Error> {
        let room = baseline.room_view()?;
        let all = grammar.covariates.iter().enumerate();
        let turned: Vec<usize> =
            all.filter(|(_, c)| c.forms.len() == 1 && c.has_direction()).map(|(i, _)| i).collect();
        let seed = baseline.config.seed;
        let of = room.by_pair(|pair| {
            let mut random =
                Pcg64Mcg::seed_from_u64(seed ^ (pair.index() as u64 + 1).wrapping_mul(0x9E37_79B9));
            let turn = Turn {
                azimuth_deg: random.random_range(TURNED_DEG.0..TURNED_DEG.1),
                upside_down: pair.index() % 2 == 1,
            };
            of_pair(pair, grammar, (&turned, turn))
        })?;
        Ok(Self { of, covariates: grammar.covariates.len(), turned })
    }

    /// A covariate in the first `count` bins of a pair and band.
    pub fn of(&self, pair: usize, band: usize, covariate: usize, count: usize) -> Vec<f64> {
        let column = self.of[pair][band].column(covariate);
        (0..count).map(|bin| if bin < column.len() { column[bin] } else { 0.0 }).collect()
    }

    /// The same where directions are turned, for covariates that have one.
    pub fn turned(&self, pair: usize, band: usize, covariate: usize, count: usize) -> Option<Vec<f64>> {
        let place = self.turned.iter().position(|&own| own == covariate)?;
        Some(self.of(pair, band, self.covariates + place, count))
    }
}

/// How directions are turned at one pair.
#[derive(Clone, Copy)]
struct Turn {
    azimuth_deg: f64,
    upside_down: bool,
}

/// `[band]`, `(bin, column)`.
fn of_pair(
    pair: &TracedPairView<'_>,
    grammar: &Grammar,
    (turned, turn): (&[usize], Turn),
) -> Result<Vec<DMatrix<f64>>, Error> {
    let mut numbers: Vec<Vec<f32>> = Vec::new();
    for covariate in &grammar.covariates {
        numbers.push(on_paths(pair, covariate, None)?);
    }
    for &covariate in turned {
        numbers.push(on_paths(pair, &grammar.covariates[covariate], Some(turn))?);
    }
    let columns = numbers.len();
    let paths = ClassedPaths { classes: vec![0; pair.paths().len()], count: 1, numbers };
    let energies = pair.energies(pair.room().materials())?;
    let of_band = |(band, energies): (usize, &Vec<f32>)| {
        let rows = pair.class_sums(band, energies, &paths);
        let mean = |bin: usize, column: usize| {
            let row: &Vec<f64> = &rows[bin];
            if row[0] > 0.0 { row[1 + column] / row[0] } else { 0.0 }
        };
        DMatrix::from_fn(rows.len(), columns, mean)
    };
    Ok(energies.iter().enumerate().map(of_band).collect())
}

/// What the unit law of a covariate takes from each path, in dB.
fn on_paths(pair: &TracedPairView<'_>, covariate: &Covariate, turn: Option<Turn>) -> Result<Vec<f32>, Error> {
    let law = covariate.unit_law().map_err(Cause::from)?;
    if covariate.target == LawTarget::Reflection {
        of_reflections(pair, &law)
    } else {
        of_variables(pair, &law, turn)
    }
}

fn of_reflections(pair: &TracedPairView<'_>, law: &Law) -> Result<Vec<f32>, Error> {
    let materials = pair.room().survey().materials();
    let Some(own) = materials.iter().position(|name| Some(name.as_str()) == law.surface()) else {
        return Ok(vec![0.0; pair.paths().len()]);
    };
    let taken =
        |cosine: f64| law.value(|name| (name == "cos_incidence").then_some(cosine)).map_or(0.0, |db| -db);
    let sums =
        pair.paths().sums_by_angle(|material, cosine| [if material == own { taken(cosine) } else { 0.0 }]);
    Ok(sums.into_iter().map(|[sum]| sum).collect())
}

fn of_variables(pair: &TracedPairView<'_>, law: &Law, turn: Option<Turn>) -> Result<Vec<f32>, Error> {
    let site = pair.law_site();
    let bound = BoundLaws::new(std::slice::from_ref(law), &site).map_err(Cause::from)?;
    let moved = |name: &str, value: f64| match turn {
        Some(turn) if name.ends_with("azimuth_deg") => value + turn.azimuth_deg,
        Some(turn) if name.ends_with("elevation_deg") && turn.upside_down => -value,
        _ => value,
    };
    let variables = bound.path_variables(pair.paths(), pair.air().speed_of_sound_m_s());
    let known: Vec<(String, Vec<f64>)> = variables
        .into_iter()
        .map(|v| {
            let values = v.values.iter().map(|x| moved(&v.name, f64::from(*x))).collect();
            (v.name, values)
        })
        .collect();
    let parameters: Vec<f64> = law.parameters().map(|(_, p)| p.value).collect();
    let variable = |name: &str| {
        let each = known.iter().find(|(own, _)| own == name).map(|(_, values)| LawVariable::Each(values));
        each.or_else(|| site.variable(name).map(LawVariable::Same))
    };
    let taken = law.values(&parameters, pair.paths().len(), variable).map_err(Cause::from)?;
    Ok(taken.into_iter().map(|db| if db.is_finite() { -db as f32 } else { 0.0 }).collect())
}
