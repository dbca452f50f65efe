//! How visible a law is in the decays of a room.

use crate::effect::{Case, Effect};
use crate::effects::LawEffect;
use crate::error::Error;
use crate::infer::baseline::Baseline;
use crate::infer::candidates::CatalogueCase;
use crate::likelihood::decay::EnergyModel;
use crate::likelihood::laplace::LaplaceFit;
use nalgebra::{DMatrix, DVector};
use sabine_paths::laws::Law;

/// How far a law, as written, moves the decays, in standard deviations, beside a fitted baseline.
pub(crate) fn d_prime(baseline: &mut Baseline, law: &Law, used: &[bool]) -> Result<f64, Error> {
    let effect = LawEffect::with_edges_as_written(law)?;
    let Some(mut case) = effect.cases(baseline.survey()).into_iter().next() else {
        return Ok(0.0);
    };
    case.slot = Some(0);
    let value = |name: &str| law.parameters().find(|(own, _)| *own == name).map_or(1.0, |(_, p)| p.value);
    let own: Vec<f64> = case.parameters.iter().map(|p| value(&p.name)).collect();
    let cases = [CatalogueCase {
        effect: 0,
        id: law.id().to_owned().into(),
        case,
        formula: None,
        inherited_nats: 0.0,
    }];
    baseline.prepare(&cases)?;
    baseline.calibrate_scatter(&[], used)?;
    let (fit, _) = baseline.fit_energy(&[], used, None)?;
    Ok(projected(baseline, &fit, used, (&cases[0].case, &own)))
}

/// The same of a case at some values of its parameters: what absorption within its tables, gains, levels, drift and the tracer's chance can
/// make up for is projected out.
fn projected(baseline: &Baseline, fit: &LaplaceFit, used: &[bool], (case, own): (&Case, &[f64])) -> f64 {
    let data = baseline.energy_data();
    let (cases, plain) = ([case], EnergyModel::new(&data, &[], used));
    let model = EnergyModel::new(&data, &cases, used);
    let changed = [&fit.values[..], own].concat();
    let mut along = DVector::zeros(fit.values.len());
    let mut square = 0.0;
    for pair in (0..used.len()).filter(|&pair| used[pair]) {
        let expansion = plain.expansion(&fit.values, pair);
        let change: DVector<f64> = model.prediction(&changed, pair) - &expansion.predicted;
        let change = DMatrix::from_column_slice(change.len(), 1, change.as_slice());
        let over = expansion.over_covariance(&change);
        square += change.dot(&over);
        along += expansion.slopes.tr_mul(&over).column(0);
    }
    (square - along.dot(&(&fit.covariance * &along))).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::config::DiagnoseConfig;
    use crate::effect::Parameter;
    use crate::effects::TransducerResponse;
    use crate::hand_made::Tables;
    use crate::infer::candidates::cases;
    use crate::infer::search::Search;
    use sabine_scene::{Levels, TimeZero};

    /// The oracle is a fit: what the right cause gains in measurements that hold it and no chance, over what it gains where nothing is hidden.
    #[test]
    fn the_square_of_its_size_is_twice_what_a_fit_gains() {
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TransducerResponse)];
        let used = [true; 3];
        let plain = Tables::new(Levels::Absolute, TimeZero::Emission).baseline(DiagnoseConfig::default());
        let all = cases(&effects, plain.survey());
        let (fit, _) = plain.fit_energy(&[], &used, None).unwrap();
        let own = |size: f64| vec![size, -size];
        let gained = |size: f64| -> f64 {
            let (data, cases) = (plain.energy_data(), [&all[0].case]);
            let model = EnergyModel::new(&data, &cases, &used);
            let changed = [&fit.values[..], &own(size)].concat();
            let mut hidden = Tables::new(Levels::Absolute, TimeZero::Emission);
            for (pair, measured) in hidden.measured.iter_mut().enumerate() {
                for (band, energies) in measured.energies.iter_mut().enumerate() {
                    let Some(count) = energies.as_ref().map(Vec::len) else { continue };
                    let predicted = model.predicted(&changed, pair, band, count);
                    *energies = Some(predicted.iter().map(|l| l.exp()).collect());
                }
            }
            let baseline = hidden.baseline(DiagnoseConfig::default());
            let search = Search::new(&baseline, &all, 1, used.to_vec());
            let (with, without) = (search.state(&[0], None).unwrap(), search.state(&[], None).unwrap());
            // What its parameters cost because they are expected to be small is no part of it.
            let fitted = &with.energy.values[fit.values.len()..];
            let of_parameter = |(x, p): (&f64, &Parameter)| 0.5 * (x / p.prior_sd).powi(2);
            let cost: f64 = fitted.iter().zip(&all[0].case.parameters).map(of_parameter).sum();
            with.energy.log_posterior + cost - without.energy.log_posterior
        };
        // What is known of absorption pulls at the fit even where nothing is hidden, and the parameters follow.
        let pulled = (2.0 * gained(0.0)).sqrt();
        for size in [1.0, 2.0] {
            let found = projected(&plain, &fit, &used, (&all[0].case, &own(size)));
            let expected = (2.0 * gained(size)).sqrt() - pulled;
            assert!((found / expected - 1.0).abs() < 0.1, "{size}: {found} {expected}");
        }
    }
}
