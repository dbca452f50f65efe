//! How likely a tracer was to draw a chain of reflections, when each ray draws for one octave and serves all of them.

use sabine_acoustics::Material;

/// Most octaves that a run can have.
const MAX_BANDS: usize = 10;
/// Below this the densities are rescaled.
const RESCALE: f64 = 1e-100;

/// Probability of each event at each material, per band: `[material][band]`.
#[derive(Clone, Debug)]
pub(crate) struct EventProbabilities {
    bands: usize,
    scattering: Vec<[f64; MAX_BANDS]>,
}

impl EventProbabilities {
    pub fn new<'a>(materials: impl Iterator<Item = &'a Material>) -> Self {
        let mut bands = 1;
        let scattering = materials
            .map(|material| {
                let values = material.scattering().values();
                bands = values.len().min(MAX_BANDS);
                let mut row = [0.0; MAX_BANDS];
                row[..bands].copy_from_slice(&values[..bands]);
                row
            })
            .collect();
        Self { bands, scattering }
    }

    pub fn bands(&self) -> usize {
        self.bands
    }

    /// Scattering coefficient that a ray drawn for band `hero` obeys.
    pub fn scattering(&self, material: u32, hero: usize) -> f64 {
        self.scattering[material as usize][hero]
    }
}

/// Density of the events so far: the mean over the hero bands of the product of their probabilities (hero sampling with
/// the balance heuristic: Wilkie et al. 2014, Veach 1997, section 9.2). Dividing by it makes every band unbiased, and no
/// band's weight exceeds the number of bands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventMixture {
    /// Products, up to a common factor. Those that vanish beside the largest are lost, and never missed: that the ray's own
    /// band should be among them is as improbable as they are small.
    products: [f64; MAX_BANDS],
    /// Natural logarithm of that factor.
    log_scale: f64,
    bands: usize,
}

impl EventMixture {
    pub fn new(bands: usize) -> Self {
        Self { products: [1.0; MAX_BANDS], log_scale: 0.0, bands }
    }

    pub fn apply(&mut self, probabilities: &EventProbabilities, material: u32, scattered: bool) {
        let row = &probabilities.scattering[material as usize];
        let mut largest = 0.0f64;
        for (product, &s) in self.products[..self.bands].iter_mut().zip(row) {
            *product *= if scattered { s } else { 1.0 - s };
            largest = largest.max(*product);
        }
        if largest < RESCALE && largest > 0.0 {
            for product in &mut self.products[..self.bands] {
                *product /= largest;
            }
            self.log_scale += largest.ln();
        }
    }

    /// Natural logarithm of the density of the events so far.
    pub fn log_density(&self) -> f64 {
        let sum: f64 = self.products[..self.bands].iter().sum();
        (sum / self.bands as f64).ln() + self.log_scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::{OctaveBands, PerBand};

    #[test]
    fn hundreds_of_events_neither_overflow_nor_vanish() {
        let bands = OctaveBands::new(125.0, 500.0).unwrap();
        let scattering = PerBand::new(bands, vec![0.001, 0.5, 1.0]).unwrap();
        let material = Material::new(PerBand::uniform(bands, 0.1), scattering).unwrap();
        let probabilities = EventProbabilities::new([&material].into_iter());
        let mut mixture = EventMixture::new(3);
        for _ in 0..900 {
            mixture.apply(&probabilities, 0, true);
        }
        // Only the third band can do this for sure: one third.
        assert!((mixture.log_density() - (1.0f64 / 3.0).ln()).abs() < 1e-12);
        mixture.apply(&probabilities, 0, false);
        // Now the third band is out, and 0.5^901 remains besides nothing of 0.001^900.
        for _ in 0..5000 {
            mixture.apply(&probabilities, 0, true);
        }
        let expected = 5901.0 * 0.5f64.ln() - 3f64.ln();
        assert!((mixture.log_density() / expected - 1.0).abs() < 1e-12, "{}", mixture.log_density());
    }
}
