//! What each covariate is in each bin: the change of a bin's energy with the coefficient of a law is the energy-weighted mean of what the
//! law takes from its paths. All are gathered in one pass, so that formulas cost nothing more.

use crate::effects::{Covariate, Grammar, Wave};
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::simulate::traced_pair::class_sums::ClassedPaths;
use crate::simulate::traced_views::TracedPairView;
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::Error as Cause;
use sabine_paths::laws::{BoundLaws, Law, LawSite, LawTarget, LawVariable};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

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

    /// Numbers without meaning, other ones in each bin.
    #[cfg(test)]
    pub fn by_hand(grammar: &Grammar, (pairs, bands, bins): (usize, usize, usize)) -> Self {
        let turned: Vec<usize> =
            (0..grammar.covariates.len()).filter(|&c| grammar.covariates[c].has_direction()).collect();
        let columns = grammar.covariates.len() + turned.len();
        let value = |pair: usize, band: usize, bin: usize, column: usize| {
            (1.0 + 1.7 * bin as f64 + 2.3 * column as f64 + 3.1 * pair as f64 + 4.7 * band as f64).sin().abs()
        };
        let of_band = |pair, band| DMatrix::from_fn(bins, columns, |bin, c| value(pair, band, bin, c));
        let of = (0..pairs).map(|pair| (0..bands).map(|band| of_band(pair, band)).collect()).collect();
        Self { of, covariates: grammar.covariates.len(), turned }
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

impl Turn {
    /// A variable of a path whose ends are turned.
    fn moved(self, name: &str, value: f64) -> f64 {
        if name.ends_with("azimuth_deg") {
            value + self.azimuth_deg
        } else if name.ends_with("elevation_deg") && self.upside_down {
            -value
        } else {
            value
        }
    }
}

/// Covariates of reflections whose sums are taken along the paths together.
const TOGETHER: usize = 4;

/// `[band]`, `(bin, column)`.
fn of_pair(
    pair: &TracedPairView<'_>,
    grammar: &Grammar,
    (turned, turn): (&[usize], Turn),
) -> Result<Vec<DMatrix<f64>>, Error> {
    let mut quantities = Quantities { pair, site: pair.law_site(), known: BTreeMap::new() };
    // Those of reflections come first, waves last.
    let count = grammar.covariates.iter().take_while(|c| c.target == LawTarget::Reflection).count();
    let (of_reflections, others) = grammar.covariates.split_at(count);
    let (others, waves) =
        others.split_at(others.iter().position(|c| c.wave.is_some()).unwrap_or(others.len()));
    let mut numbers = of_surfaces(pair, of_reflections)?;
    // A product is that of its forms.
    let mut forms: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for covariate in others {
        let mut product: Vec<f64> = Vec::new();
        for form in &covariate.forms {
            let own = match forms.entry(form.name) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(place) => place.insert(quantities.taken(&covariate.of_form(*form), None)?),
            };
            if product.is_empty() {
                product.clone_from(own);
            } else {
                product.iter_mut().zip(own).for_each(|(p, x)| *p *= *x);
            }
        }
        numbers.push(product.into_iter().map(|x| x as f32).collect());
    }
    // Each column as a sum of numbers of paths: waves of one period are made of its sine and its cosine.
    let mut made_of: Vec<Vec<(usize, f64)>> = (0..numbers.len()).map(|n| vec![(n, 1.0)]).collect();
    let period_s = |wave: &Covariate| wave.wave.map(Wave::period_s);
    for of_period in waves.chunk_by(|a, b| period_s(a) == period_s(b)) {
        let [sine, cosine] = [numbers.len(), numbers.len() + 1];
        for wave in of_period.iter().take(2) {
            numbers.push(quantities.taken(wave, None)?.into_iter().map(|x| x as f32).collect());
        }
        let shares = of_period.iter().filter_map(|w| w.wave).map(Wave::of_sine_and_cosine);
        made_of.extend(shares.map(|[of_sine, of_cosine]| vec![(sine, of_sine), (cosine, of_cosine)]));
    }
    for &covariate in turned {
        let own = quantities.taken(&grammar.covariates[covariate], Some(turn))?;
        made_of.push(vec![(numbers.len(), 1.0)]);
        numbers.push(own.into_iter().map(|x| x as f32).collect());
    }
    let paths = ClassedPaths { classes: vec![0; pair.paths().len()], count: 1, numbers };
    let energies = pair.expanded_energies()?;
    let of_band = |(band, energies): (usize, &Vec<f32>)| {
        let rows = pair.class_sums(band, energies, &paths);
        let mean = |bin: usize, column: usize| {
            let row: &Vec<f64> = &rows[bin];
            let sum: f64 = made_of[column].iter().map(|&(number, share)| share * row[1 + number]).sum();
            if row[0] > 0.0 { sum / row[0] } else { 0.0 }
        };
        DMatrix::from_fn(rows.len(), made_of.len(), mean)
    };
    Ok(energies.iter().enumerate().map(of_band).collect())
}

/// What the unit laws of covariates of reflections take from each path, in dB.
fn of_surfaces(pair: &TracedPairView<'_>, covariates: &[Covariate]) -> Result<Vec<Vec<f32>>, Error> {
    let materials = pair.room().survey().materials();
    let mut numbers = Vec::with_capacity(covariates.len());
    for own in covariates.chunks(TOGETHER) {
        let laws: Vec<Law> =
            own.iter().map(Covariate::unit_law).collect::<Result<_, _>>().map_err(Cause::from)?;
        let surfaces: Vec<Option<usize>> = laws
            .iter()
            .map(|law| materials.iter().position(|name| Some(name.as_str()) == law.surface()))
            .collect();
        let taken = |law: &Law, cosine: f64| {
            law.value(|name| (name == "cos_incidence").then_some(cosine)).map_or(0.0, |db| -db)
        };
        let step = |material: usize, cosine: f64| -> [f64; TOGETHER] {
            std::array::from_fn(|i| match surfaces.get(i) {
                Some(&surface) if surface == Some(material) => taken(&laws[i], cosine),
                _ => 0.0,
            })
        };
        let sums = pair.paths().sums_by_angle(step);
        numbers.extend((0..own.len()).map(|i| sums.iter().map(|sum| sum[i]).collect::<Vec<f32>>()));
    }
    Ok(numbers)
}

/// What laws ask of the paths of a pair, each variable looked up once.
struct Quantities<'a> {
    pair: &'a TracedPairView<'a>,
    site: LawSite,
    known: BTreeMap<String, Vec<f64>>,
}

impl Quantities<'_> {
    /// What the unit law of a covariate takes from each path, in dB.
    fn taken(&mut self, covariate: &Covariate, turn: Option<Turn>) -> Result<Vec<f64>, Error> {
        let (pair, law) = (self.pair, covariate.unit_law().map_err(Cause::from)?);
        let names = law.variables();
        if names.iter().any(|name| !self.known.contains_key(name) && self.site.variable(name).is_none()) {
            let bound = BoundLaws::new(std::slice::from_ref(&law), &self.site).map_err(Cause::from)?;
            for v in bound.path_variables(pair.paths(), pair.air().speed_of_sound_m_s()) {
                self.known.entry(v.name).or_insert_with(|| v.values.iter().map(|x| f64::from(*x)).collect());
            }
        }
        let turned: BTreeMap<&String, Vec<f64>> = turn.map_or_else(BTreeMap::new, |turn| {
            let own = self.known.iter().filter(|(name, _)| names.contains(name));
            own.map(|(name, values)| (name, values.iter().map(|x| turn.moved(name, *x)).collect())).collect()
        });
        let parameters: Vec<f64> = law.parameters().map(|(_, p)| p.value).collect();
        let variable = |name: &str| {
            let each = turned.iter().find(|(own, _)| own.as_str() == name).map(|(_, values)| values);
            let each = each.or_else(|| self.known.get(name));
            each.map(|values| LawVariable::Each(values))
                .or_else(|| self.site.variable(name).map(LawVariable::Same))
        };
        let values = law.values(&parameters, pair.paths().len(), variable).map_err(Cause::from)?;
        Ok(values.into_iter().map(|db| if db.is_finite() { -db } else { 0.0 }).collect())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_paths::laws::LawParameter;

    /// Against energies under the law itself, a hundredth of a decibel up and down: energies are rounded by up to
    /// 1e-7, which is 5e-5 of their change.
    #[test]
    fn each_column_is_the_slope_of_energies_under_its_law() {
        let (step_db, band) = (0.01, 3);
        let baseline = Baseline::of_laboratory(32);
        let grammar = Grammar::of(baseline.survey());
        let features = Features::gather(&baseline, &grammar).unwrap();
        let room = baseline.room_view().unwrap();
        let pair = room.pair(1);
        let mut waves = 0;
        for (place, covariate) in grammar.covariates.iter().enumerate() {
            let [less, more] = [step_db, -step_db].map(|db| {
                let a = LawParameter::new(db, [-1.0, 1.0], "dB");
                let law = covariate.law("-a", vec![("a", a)]).unwrap();
                let bound = BoundLaws::new(std::slice::from_ref(&law), &pair.law_site()).unwrap();
                pair.ln_changes(band, &pair.energies_under(&bound).unwrap()[band])
            });
            let found = features.of(1, band, place, less.len());
            let taken_db = |(less, more): (&f64, &f64)| (more - less) * 10.0 / std::f64::consts::LN_10;
            let expected: Vec<f64> =
                less.iter().zip(&more).map(|own| taken_db(own) / (2.0 * step_db)).collect();
            let most = |own: &mut dyn Iterator<Item = f64>| own.fold(0.0f64, |most, x| most.max(x.abs()));
            let size = most(&mut expected.iter().copied());
            let off = most(&mut found.iter().zip(&expected).map(|(x, y)| x - y));
            assert!(off < 1e-3 * size + 5e-4, "{}: off by {off}, {size} at most", covariate.words());
            waves += usize::from(covariate.wave.is_some() && size > 0.3);
        }
        assert_eq!(waves, 40);
    }
}
