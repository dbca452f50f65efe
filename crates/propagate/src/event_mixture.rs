//! How likely a tracer was to draw a chain of reflections, when each ray draws for one octave and serves all of them.

use sabine_acoustics::Material;

/// Most octaves that a run can have.
const MAX_BANDS: usize = 10;
/// Below this the densities are rescaled.
const RESCALE: f64 = 1e-100;

/// Probability of scattering at each material in each class of octaves, within which no material scatters differently.
#[derive(Clone, Debug)]
pub(crate) struct EventProbabilities {
    classes: usize,
    /// `[material][class]`
    scattering: Vec<[f64; MAX_BANDS]>,
    mean_scattering: Vec<f64>,
}

impl EventProbabilities {
    pub fn new<'a>(materials: impl Iterator<Item = &'a Material>) -> Self {
        let rows: Vec<&[f64]> = materials.map(|material| material.scattering().values()).collect();
        let bands = rows.first().map_or(0, |row| row.len().min(MAX_BANDS));
        let mut representatives: Vec<usize> = Vec::new();
        for band in 0..bands {
            if !representatives.iter().any(|&other| rows.iter().all(|row| row[band] == row[other])) {
                representatives.push(band);
            }
        }
        let scattering = rows.iter().map(|row| {
            let mut values = [0.0; MAX_BANDS];
            values.iter_mut().zip(&representatives).for_each(|(value, &band)| *value = row[band]);
            values
        });
        Self {
            classes: representatives.len().max(1),
            scattering: scattering.collect(),
            mean_scattering: rows.iter().map(|row| row.iter().sum::<f64>() / row.len() as f64).collect(),
        }
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// Scattering coefficient of a material, mean over the octaves.
    pub fn mean_scattering(&self, material: u32) -> f64 {
        self.mean_scattering[material as usize]
    }

    /// Scattering coefficient that a ray drawn for class `hero` obeys.
    pub fn scattering(&self, material: u32, hero: usize) -> f64 {
        self.scattering[material as usize][hero]
    }
}

/// Density of the events so far: the mean over the hero classes of the product of their probabilities (hero sampling with
/// the balance heuristic: Wilkie et al. 2014, Veach 1997, section 9.2). Dividing by it makes every band unbiased, and no
/// band's weight exceeds the number of classes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventMixture {
    /// Products, up to a common factor. Those that vanish beside the largest are lost, and never missed: that the ray's own
    /// band should be among them is as improbable as they are small.
    products: [f64; MAX_BANDS],
    /// Natural logarithm of that factor.
    log_scale: f64,
    classes: usize,
}

impl EventMixture {
    pub fn new(classes: usize) -> Self {
        Self { products: [1.0; MAX_BANDS], log_scale: 0.0, classes }
    }

    pub fn apply(&mut self, probabilities: &EventProbabilities, material: u32, scattered: bool) {
        let row = &probabilities.scattering[material as usize];
        let mut largest = 0.0f64;
        for (product, &s) in self.products[..self.classes].iter_mut().zip(row) {
            *product *= if scattered { s } else { 1.0 - s };
            largest = largest.max(*product);
        }
        if largest < RESCALE && largest > 0.0 {
            for product in &mut self.products[..self.classes] {
                *product /= largest;
            }
            self.log_scale += largest.ln();
        }
    }

    /// Natural logarithm of the density of the events so far.
    pub fn log_density(&self) -> f64 {
        let sum: f64 = self.products[..self.classes].iter().sum();
        (sum / self.classes as f64).ln() + self.log_scale
    }

    /// Natural logarithm of the density of these events and the other ones, both drawn for the same class.
    pub fn joint_log_density(&self, other: &Self) -> f64 {
        let products = self.products[..self.classes].iter().zip(&other.products);
        let sum: f64 = products.map(|(a, b)| a * b).sum();
        (sum / self.classes as f64).ln() + self.log_scale + other.log_scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::{Bands, PerBand};

    #[test]
    fn two_halves_are_as_likely_as_the_whole() {
        let bands = Bands::octaves(125.0, 500.0).unwrap();
        let scattering = PerBand::new(bands, vec![0.1, 0.4, 0.9]).unwrap();
        let material = Material::new(PerBand::uniform(bands, 0.1), scattering).unwrap();
        let probabilities = EventProbabilities::new([&material].into_iter());
        let (mut whole, mut halves) = (EventMixture::new(3), [EventMixture::new(3); 2]);
        for event in 0..700 {
            whole.apply(&probabilities, 0, event % 3 == 0);
            halves[event % 2].apply(&probabilities, 0, event % 3 == 0);
        }
        let joint = halves[0].joint_log_density(&halves[1]);
        assert!((joint / whole.log_density() - 1.0).abs() < 1e-12, "{joint}");
    }

    #[test]
    fn hundreds_of_events_neither_overflow_nor_vanish() {
        let bands = Bands::octaves(125.0, 500.0).unwrap();
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
