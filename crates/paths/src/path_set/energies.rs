//! What surfaces, air and directivity leave of the energy of each path.

use super::{EXACT, PathSet};
use crate::conditions::Conditions;
use crate::laws::{BLOCK, LawError, PathLaws};
use crate::packed_direction::unpack_direction;
use crate::parallel::for_each_index;
use crate::reweighting::{LANES, Lanes, exp, sums_along, sums_along_angles};
use sabine_acoustics::{Bands, Directivity, EnergyResponse, Error, Material, Orientation, OutOfRange};

impl PathSet {
    /// Logarithm of what the surfaces leave of the energy of each chain in one band.
    ///
    /// # Errors
    /// [`Error::MaterialCount`] if the number of materials is not that of the paths, [`Error::Index`] for an unknown band.
    pub fn log_reflectance(&self, materials: &[Material], band: usize) -> Result<Vec<f32>, Error> {
        self.check_materials(materials)?;
        let count = materials[0].bands().len();
        if band >= count {
            return Err(Error::Index { what: "band", index: band, count });
        }
        let sums = sums_along(&self.parents, &self.events, &log_steps(materials, band, count));
        Ok(sums.into_iter().map(|lanes| lanes[0]).collect())
    }

    /// Energy of each contribution in each band of the materials, `[band][contribution]`.
    ///
    /// # Errors
    /// As [`PathSet::log_reflectance`]; [`Error::BandMismatch`] for a directivity on other bands than the materials;
    /// [`Error::AngleNotRecorded`] for walls that react locally and paths without angles; a law that has no value on some path.
    pub fn energies(&self, conditions: &Conditions) -> Result<Vec<Vec<f32>>, Error> {
        let Conditions { materials, air, attenuation, .. } = *conditions;
        let bands = self.check_materials(materials)?;
        conditions.check_bands(bands)?;
        let exponents = attenuation.unwrap_or(air).energy_exponent_per_m(bands);
        let laws = PathLaws::new(conditions, self, bands)?;
        let groups: Vec<usize> = (0..bands.len()).step_by(LANES).collect();
        let columns = for_each_index(groups.len(), |group| {
            let first = groups[group];
            let exponents = lanes(first, bands.len(), |band| exponents.values()[band] as f32);
            let steps = log_steps(materials, first, bands.len());
            let sums = match laws.as_ref().and_then(PathLaws::reflections) {
                None => sums_along(&self.parents, &self.events, &steps),
                Some(tables) => {
                    let steps = tables.steps(&steps, first);
                    sums_along_angles(&self.parents, &self.events, &self.incidences, &steps)
                }
            };
            let mut laws = laws.as_ref().map(|laws| laws.in_bands(self, first)).transpose()?;
            let mut columns = [const { Vec::new() }; LANES];
            columns.iter_mut().for_each(|column| column.resize(self.len(), 0.0));
            let mut block = [[0.0; LANES]; BLOCK];
            for start in (0..self.len()).step_by(BLOCK) {
                let range = start..self.len().min(start + BLOCK);
                let paths = self.lengths_m[range.clone()].iter().zip(&self.log_weights[range.clone()]);
                let chains = self.chains[range.clone()].iter().zip(&self.tails[range.clone()]);
                for (x, ((&length, &log_weight), (&chain, &tail))) in block.iter_mut().zip(paths.zip(chains))
                {
                    let (out, back) = (sums[chain as usize], sums[tail as usize]);
                    *x = std::array::from_fn(|i| log_weight + out[i] + back[i] - exponents[i] * length);
                }
                if let Some(laws) = &mut laws {
                    laws.add_to_paths(&range, &mut block[..range.len()])?;
                }
                block.iter_mut().for_each(|x| *x = exp(*x));
                for (i, column) in columns.iter_mut().enumerate() {
                    column[range.clone()].iter_mut().zip(&block).for_each(|(e, lanes)| *e = lanes[i]);
                }
            }
            let used = LANES.min(bands.len() - first);
            Ok(columns.into_iter().take(used))
        });
        let columns = columns.into_iter().collect::<Result<Vec<_>, LawError>>()?;
        let mut energies: Vec<Vec<f32>> = columns.into_iter().flatten().collect();
        for (ends, directed) in [(&self.departures, conditions.source), (&self.arrivals, conditions.receiver)]
        {
            if let Some((directivity, orientation)) = directed {
                weigh_directions(&mut energies, ends, directivity, &orientation);
            }
        }
        self.weigh_diffractions(&mut energies, bands, conditions.air.speed_of_sound_m_s());
        Ok(energies)
    }

    fn weigh_diffractions(&self, energies: &mut [Vec<f32>], bands: Bands, speed_m_s: f64) {
        for (contribution, diffraction) in &self.diffractions {
            for (band, column) in energies.iter_mut().enumerate() {
                column[*contribution] *= diffraction.band_energy_gain(bands, band, speed_m_s) as f32;
            }
        }
    }

    /// Energy in time bins, with Monte-Carlo standard errors from the scatter between batches of rays.
    ///
    /// # Errors
    /// As [`PathSet::energies`]; [`Error::OutOfRange`] for a bin width that is not positive.
    pub fn energy_response(&self, conditions: &Conditions, bin_s: f64) -> Result<EnergyResponse, Error> {
        let bands = self.check_materials(conditions.materials)?;
        OutOfRange::check("bin width (s)", bin_s, 1e-6, 10.0, "between 1 us and 10 s")?;
        let speed = conditions.air.speed_of_sound_m_s();
        let bins = (self.max_length_m / speed / bin_s).ceil() as usize;
        let batches = usize::from(self.batch_count);
        let mut energy = Vec::with_capacity(bins * bands.len());
        let mut standard_error = Vec::with_capacity(bins * bands.len());
        let delays_s = self.delays_s(conditions)?;
        let mut added = self.added_energy(conditions, bin_s, bins)?.map(Vec::into_iter);
        for column in self.energies(conditions)? {
            let none = || vec![0.0f64; bins];
            let mut exact = added.as_mut().and_then(Iterator::next).unwrap_or_else(none);
            let mut sampled = vec![0.0f64; bins * batches];
            for (i, &e) in column.iter().enumerate() {
                let late_s = delays_s.as_ref().map_or(0.0, |delays_s| delays_s[i]);
                let bin = ((f64::from(self.lengths_m[i]) / speed + late_s) / bin_s) as usize;
                if bin >= bins {
                    continue;
                }
                match self.batches[i] {
                    EXACT => exact[bin] += f64::from(e),
                    batch => sampled[bin * batches + usize::from(batch)] += f64::from(e),
                }
            }
            for (bin, exact) in exact.into_iter().enumerate() {
                let parts = &sampled[bin * batches..(bin + 1) * batches];
                let sum: f64 = parts.iter().sum();
                let mean = sum / batches as f64;
                let scatter: f64 = parts.iter().map(|p| (p - mean) * (p - mean)).sum();
                energy.push(exact + sum);
                standard_error.push((scatter * batches as f64 / (batches as f64 - 1.0)).sqrt());
            }
        }
        EnergyResponse::new(bands, bin_s, energy, standard_error)
    }

    pub(crate) fn check_materials(&self, materials: &[Material]) -> Result<Bands, Error> {
        if materials.len() != self.materials || materials.is_empty() {
            return Err(Error::MaterialCount { expected: self.materials, found: materials.len() });
        }
        let bands = materials[0].bands();
        match materials.iter().find(|m| m.bands() != bands) {
            Some(other) => Err(Error::BandMismatch { left: bands, right: other.bands() }),
            None => Ok(bands),
        }
    }
}

/// Multiplies energies by the gains of a directivity in packed directions.
fn weigh_directions(
    energies: &mut [Vec<f32>],
    directions: &[u32],
    directivity: &Directivity,
    orientation: &Orientation,
) {
    let mut gains = vec![0.0; energies.len()];
    for (i, &packed) in directions.iter().enumerate() {
        directivity.energy_gains(orientation.to_local(unpack_direction(packed)), &mut gains);
        energies.iter_mut().zip(&gains).for_each(|(column, &gain)| column[i] *= gain as f32);
    }
}

/// A value for each of the bands from `first` on, as far as there are any.
fn lanes(first: usize, bands: usize, value: impl Fn(usize) -> f32) -> Lanes {
    std::array::from_fn(|i| if first + i < bands { value(first + i) } else { 0.0 })
}

/// Logarithm of what each event leaves of the energy, `material * 2 + scattered`, in the bands from `first` on. That of nothing
/// is minus infinity: the path carries nothing, as it should.
fn log_steps(materials: &[Material], first: usize, bands: usize) -> Vec<Lanes> {
    let event = |material: &Material, scattered: bool| {
        lanes(first, bands, |band| {
            let scattering = material.scattering().values()[band];
            let share = if scattered { scattering } else { 1.0 - scattering };
            ((1.0 - material.absorption().values()[band]) * share).ln() as f32
        })
    };
    materials.iter().flat_map(|material| [event(material, false), event(material, true)]).collect()
}
