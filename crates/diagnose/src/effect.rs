//! A named physical cause of a misfit, and its fit.

use crate::{Error, Misfit};
use nalgebra::{DMatrix, DVector};
use sabine_acoustics::{EnergyResponse, OctaveBands};

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name, with the band where it belongs to one.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Value at which the effect is absent.
    pub neutral: f64,
    /// Standard deviation of the prior about the neutral value.
    pub prior_sd: f64,
    /// Least and greatest value.
    pub bounds: (f64, f64),
}

/// One named physical cause: a small parametric extension of the prediction.
pub trait Effect: Send + Sync {
    /// Identifier in the catalogue.
    fn id(&self) -> &'static str;

    /// Parameters, given the bands of the data.
    fn parameters(&self, bands: OctaveBands) -> Vec<Parameter>;

    /// The prediction with the effect at work; `values` in the order of [`Effect::parameters`].
    ///
    /// # Errors
    /// Where the vocabulary refuses the result.
    fn apply(&self, values: &[f64], predicted: &EnergyResponse) -> Result<EnergyResponse, Error>;
}

/// Measured and predicted energy of one source-receiver pair.
#[derive(Clone, Debug)]
pub struct Pair {
    /// What was measured.
    pub measured: EnergyResponse,
    /// What the simulation says.
    pub predicted: EnergyResponse,
}

/// What an effect found and what it gains.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// Identifier of the effect.
    pub effect: &'static str,
    /// Fitted values, in the order of [`Effect::parameters`].
    pub values: Vec<f64>,
    /// Standard error of each.
    pub standard_errors: Vec<f64>,
    /// Root mean square residual on the held-out pairs without the effect, in dB.
    pub held_out_before_db: f64,
    /// The same with the effect, its parameters fitted to the other pairs only.
    pub held_out_after_db: f64,
}

/// Range below the strongest bin that is compared, in dB.
const RANGE_DB: f64 = 40.0;
/// Gauss-Newton steps; the effects are mild enough for a handful.
const STEPS: usize = 25;

/// Fits an effect to some pairs and scores it on others, which it has not seen.
///
/// Gauss-Newton on residuals in dB, weighted by their expected spread, with the prior as one more residual a parameter.
///
/// # Errors
/// [`Error::NoPairs`] without pairs to fit or to test, [`Error::Singular`] if the step cannot be solved for, and the
/// errors of [`Misfit::between`].
pub fn explain(effect: &dyn Effect, fit: &[Pair], held_out: &[Pair]) -> Result<Explanation, Error> {
    let first = fit.first().ok_or(Error::NoPairs { what: "pairs to fit" })?;
    if held_out.is_empty() {
        return Err(Error::NoPairs { what: "held-out pairs" });
    }
    let parameters = effect.parameters(first.measured.bands());
    let n = parameters.len();
    let mut values: Vec<f64> = parameters.iter().map(|p| p.neutral).collect();
    let mut covariance = DMatrix::identity(n, n);
    for _ in 0..STEPS {
        let mut normal = DMatrix::zeros(n, n);
        let mut right = DVector::zeros(n);
        for (i, p) in parameters.iter().enumerate() {
            normal[(i, i)] += p.prior_sd.powi(-2);
            right[i] += (p.neutral - values[i]) * p.prior_sd.powi(-2);
        }
        for pair in fit {
            accumulate(effect, &parameters, &values, pair, &mut normal, &mut right)?;
        }
        let inverse = normal.cholesky().ok_or(Error::Singular { effect: effect.id() })?.inverse();
        let step = &inverse * right;
        let mut moved = 0.0f64;
        for (i, p) in parameters.iter().enumerate() {
            let next = (values[i] + step[i]).clamp(p.bounds.0, p.bounds.1);
            moved = moved.max(((next - values[i]) / p.prior_sd).abs());
            values[i] = next;
        }
        covariance = inverse;
        if moved < 1e-6 {
            break;
        }
    }
    Ok(Explanation {
        effect: effect.id(),
        standard_errors: (0..n).map(|i| covariance[(i, i)].sqrt()).collect(),
        held_out_before_db: rmse_db(held_out, |p| Ok(p.clone()))?,
        held_out_after_db: rmse_db(held_out, |p| effect.apply(&values, p))?,
        values,
    })
}

fn rmse_db(
    pairs: &[Pair],
    extend: impl Fn(&EnergyResponse) -> Result<EnergyResponse, Error>,
) -> Result<f64, Error> {
    let (mut sum, mut count) = (0.0, 0.0);
    for pair in pairs {
        let misfit = Misfit::between(&pair.measured, &extend(&pair.predicted)?, RANGE_DB)?;
        let n = misfit.residuals().len() as f64;
        sum += misfit.rmse_db().powi(2) * n;
        count += n;
    }
    Ok((sum / count).sqrt())
}

/// Adds one pair's part of the normal equations; the Jacobian by central differences of the predicted level.
fn accumulate(
    effect: &dyn Effect,
    parameters: &[Parameter],
    values: &[f64],
    pair: &Pair,
    normal: &mut DMatrix<f64>,
    right: &mut DVector<f64>,
) -> Result<(), Error> {
    let predicted = effect.apply(values, &pair.predicted)?;
    let misfit = Misfit::between(&pair.measured, &predicted, RANGE_DB)?;
    let mut shifted = Vec::with_capacity(parameters.len());
    for (i, p) in parameters.iter().enumerate() {
        let step = 1e-4 * p.prior_sd;
        let at = |offset: f64| {
            let mut moved = values.to_vec();
            moved[i] += offset;
            effect.apply(&moved, &pair.predicted)
        };
        shifted.push((at(step)?, at(-step)?, 2.0 * step));
    }
    for r in misfit.residuals() {
        let weight = r.expected_sd_db.powi(-2);
        let row: Vec<f64> = shifted
            .iter()
            .map(|(up, down, width)| {
                10.0 * (up.band(r.band)[r.bin] / down.band(r.band)[r.bin]).log10() / width
            })
            .collect();
        for (i, a) in row.iter().enumerate() {
            right[i] += weight * a * r.level_db;
            for (j, b) in row.iter().enumerate() {
                normal[(i, j)] += weight * a * b;
            }
        }
    }
    Ok(())
}
