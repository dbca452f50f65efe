//! What uncertain absorption leaves open in the parameters of paths.

use super::{PathParameters, QUANTITIES, Sums, added_energy, arrival_times, steps_in};
use crate::conditions::Conditions;
use crate::parallel::for_each_index;
use crate::path_set::PathSet;
use sabine_acoustics::{Error, Estimate, NoReading, OutOfRange, PerBand, Reading};

/// Standard deviations beyond which a normal distribution holds nothing that counts.
const REACH: f64 = 6.0;
/// Steps in which a cut one is summed up.
const STEPS: usize = 2_000;

/// The quantities of each band.
type Values = Vec<[Result<f64, NoReading>; QUANTITIES]>;

impl PathParameters {
    /// The parameters as [`PathParameters::read`] gives them, but each standard error says what the **materials** leave open, not
    /// the rays: to first order, from weighing the same paths anew with each material's absorption one standard deviation lower and
    /// higher. Half the difference is that material's part; materials are taken as independent, and their parts add as squares.
    /// What is known of an absorption is the normal distribution about the stated value, cut at 0 and 1: it is the mean
    /// and the standard deviation of what is left that count. Scattering is taken as known. Against draws the error is within 10 %
    /// for standard deviations up to a tenth of the absorption, and within 25 % for the guess of an unknown material.
    ///
    /// `absorption_sd` are the standard deviations of each material's absorption ([`sabine_scene::MaterialPrior::absorption_sd`]),
    /// in the order of the materials. Where a change makes a decay so long that it cannot be read, the other side alone counts.
    ///
    /// ```
    /// use sabine_acoustics::*;
    /// use sabine_paths::*;
    /// use sabine_scene::*;
    /// // One wall that each metre of path meets once: energy falls as (1 - absorption)^metres.
    /// let mut paths = PathSet::new(1, 100.0);
    /// let (up, mut chain) = ([0.0, 0.0, 1.0], PathSet::DIRECT);
    /// for metre in 1..=100 {
    ///     chain = paths.reflect(chain, 0, Reflection::Specular);
    ///     let (tail, length_m) = (PathSet::DIRECT, f64::from(metre));
    ///     paths.push(Contribution { length_m, log_weight: 0.0, chain, tail, departure: up, arrival: up, batch: None });
    /// }
    /// let (bands, air) = (Bands::octaves(125.0, 125.0)?, Air::default());
    /// let (wall, sd) = ([Material::uniform(bands, 0.2, 0.0)?], [PerBand::uniform(bands, 0.01)]);
    /// let room = PathParameters::read_material_errors(&paths, &Conditions::new(&wall, &air), &sd)?;
    /// let t30_s = room.t30_s.values()[0].clone()?;
    /// // T is proportional to 1 / -ln(1 - absorption): its relative error is 0.01 / 0.8 / 0.223.
    /// // Paths of whole metres leave the decay in steps of 1 dB: read to 3 %.
    /// assert!((t30_s.standard_error / t30_s.value - 0.056).abs() < 0.03 * 0.056);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`PathSet::energies`]; [`Error::MaterialCount`] unless there is a standard deviation for each material;
    /// [`Error::BandMismatch`] for one on other bands; [`Error::OutOfRange`] for one that is not between 0 and 1.
    pub fn read_material_errors(
        paths: &PathSet,
        conditions: &Conditions,
        absorption_sd: &[PerBand<f64>],
    ) -> Result<Self, Error> {
        let materials = conditions.materials;
        if absorption_sd.len() != materials.len() {
            return Err(Error::MaterialCount { expected: materials.len(), found: absorption_sd.len() });
        }
        for (material, sd) in materials.iter().zip(absorption_sd) {
            if sd.bands() != material.bands() {
                return Err(Error::BandMismatch { left: material.bands(), right: sd.bands() });
            }
            for &sd in sd.values() {
                OutOfRange::check("standard deviation of absorption", sd, 0.0, 1.0, "between 0 and 1")?;
            }
        }
        let values = values(paths, conditions)?;
        let bands = materials[0].bands();
        let shifted = |(index, sign): (usize, f64)| -> Result<Values, Error> {
            let mut materials = materials.to_vec();
            let (mean, sd) = (materials[index].absorption(), absorption_sd[index].values());
            let absorption = PerBand::from_fn(bands, |band| {
                let (mean, sd) = within_bounds(mean.values()[band], sd[band]);
                (mean + sign * sd).clamp(0.0, 1.0)
            });
            materials[index] = materials[index].with_absorption(absorption)?;
            self::values(paths, &Conditions { materials: &materials, ..*conditions })
        };
        let parts =
            for_each_index(materials.len(), |index| Ok([shifted((index, -1.0))?, shifted((index, 1.0))?]))
                .into_iter()
                .collect::<Result<Vec<[Values; 2]>, Error>>()?;
        let read: Vec<[Reading; QUANTITIES]> = (0..bands.len())
            .map(|band| {
                std::array::from_fn(|quantity| {
                    let value = values[band][quantity].clone()?;
                    let part = |[low, high]: &[Values; 2]| match (&low[band][quantity], &high[band][quantity])
                    {
                        (Ok(low), Ok(high)) => Ok(0.5 * (high - low)),
                        (Ok(one), Err(_)) | (Err(_), Ok(one)) => Ok(one - value),
                        (Err(reason), Err(_)) => Err(reason.clone()),
                    };
                    let variance = parts.iter().map(|both| part(both).map(|part| part * part)).sum::<Result<
                        f64,
                        NoReading,
                    >>(
                    )?;
                    Ok(Estimate::new(value, variance.sqrt()))
                })
            })
            .collect();
        Ok(Self::of(bands, &read))
    }
}

/// The parameters of each band without errors.
fn values(paths: &PathSet, conditions: &Conditions) -> Result<Values, Error> {
    let energies = paths.energies(conditions)?;
    let (times_s, duration_s) = arrival_times(paths, conditions)?;
    let added = added_energy(paths, conditions, duration_s)?;
    let of_band = |(band, energies): (usize, &Vec<f32>)| {
        if paths.is_empty() || duration_s <= 0.0 {
            return std::array::from_fn(|_| Err(NoReading::NoOnset));
        }
        let mut sums = Sums::silent(steps_in(duration_s));
        energies.iter().zip(&times_s).for_each(|(&energy, &time_s)| sums.add(time_s, f64::from(energy)));
        if let Some(added) = &added {
            sums.add_steps(&added[band]);
        }
        sums.quantities()
    };
    Ok(energies.iter().enumerate().map(of_band).collect())
}

/// Mean and standard deviation of a normal distribution cut at 0 and 1.
fn within_bounds(mean: f64, sd: f64) -> (f64, f64) {
    if sd <= 0.0 || (mean - REACH * sd >= 0.0 && mean + REACH * sd <= 1.0) {
        return (mean, sd);
    }
    let (low, high) = ((mean - REACH * sd).max(0.0), (mean + REACH * sd).min(1.0));
    let [mut weight, mut first, mut second] = [0.0; 3];
    for i in 0..STEPS {
        let x = low + (high - low) * (i as f64 + 0.5) / STEPS as f64;
        let density = (-0.5 * ((x - mean) / sd).powi(2)).exp();
        weight += density;
        first += density * x;
        second += density * x * x;
    }
    let average = first / weight;
    (average, (second / weight - average * average).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_normal_distribution_has_the_moments_of_its_closed_form() {
        // Far from the bounds nothing is cut; at a bound half is left, whose mean is sd sqrt(2 / pi); a flat one is uniform.
        assert_eq!(within_bounds(0.3, 0.01), (0.3, 0.01));
        assert_eq!(within_bounds(0.0, 0.0), (0.0, 0.0));
        let half = (2.0 / std::f64::consts::PI).sqrt();
        for (found, expected) in [
            (within_bounds(0.0, 0.01), (0.01 * half, 0.01 * (1.0 - half * half).sqrt())),
            (within_bounds(1.0, 0.01), (1.0 - 0.01 * half, 0.01 * (1.0 - half * half).sqrt())),
            (within_bounds(0.5, 1e3), (0.5, 1.0 / 12f64.sqrt())),
        ] {
            assert!(
                (found.0 - expected.0).abs() < 1e-5 && (found.1 - expected.1).abs() < 1e-5,
                "{found:?} {expected:?}"
            );
        }
    }
}
