//! How likely a tracer was to draw a chain of reflections, when each ray draws for one octave and serves all of them.

use sabine_acoustics::Material;

/// Most octaves that a run can have.
const MAX_BANDS: usize = 10;
/// Below this the densities are rescaled.
const RESCALE: f64 = 1e-100;

/// Probability of scattering at each material in each class of octaves, within which no material scatters differently.
#[derive(Clone, Debug)]
pub(crate) struct EventProbabilities {
    /// Class for which each ray of a round draws, and how many of the round did so before it.
    round: Vec<(usize, usize)>,
    /// Share of the rays that draw for each class: that of the octaves which it holds.
    shares: Vec<f64>,
    /// `[material][class]`
    scattering: Vec<[f64; MAX_BANDS]>,
    mean_scattering: Vec<f64>,
}

impl EventProbabilities {
    pub fn new<'a>(materials: impl Iterator<Item = &'a Material>) -> Self {
        let rows: Vec<&[f64]> = materials.map(|material| material.scattering().values()).collect();
        let bands = rows.first().map_or(0, |row| row.len().min(MAX_BANDS));
        // The first octave of each class, and the class of each octave.
        let (mut firsts, mut classes) = (Vec::new(), Vec::new());
        for band in 0..bands {
            let same = |&first: &usize| rows.iter().all(|row| row[band] == row[first]);
            classes.push(firsts.iter().position(same).unwrap_or(firsts.len()));
            if classes[band] == firsts.len() {
                firsts.push(band);
            }
        }
        let scattering = rows.iter().map(|row| {
            let mut values = [0.0; MAX_BANDS];
            values.iter_mut().zip(&firsts).for_each(|(value, &band)| *value = row[band]);
            values
        });
        let round = shortest_round(&classes);
        let share = |class| round.iter().filter(|turn| turn.0 == class).count() as f64 / round.len() as f64;
        Self {
            shares: (0..firsts.len().max(1)).map(share).collect(),
            round,
            scattering: scattering.collect(),
            mean_scattering: rows.iter().map(|row| row.iter().sum::<f64>() / row.len() as f64).collect(),
        }
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.shares.len()
    }

    /// Number of rays after which every class has had its share.
    pub fn round(&self) -> usize {
        self.round.len()
    }

    /// Class for which a ray draws, and how many rays drew for it before.
    pub fn turn(&self, ray: usize) -> (usize, usize) {
        let (class, before) = self.round[ray % self.round.len()];
        let each_round = (self.shares[class] * self.round.len() as f64).round() as usize;
        (class, ray / self.round.len() * each_round + before)
    }

    /// Probability that two rays draw for the same class.
    pub fn same_class(&self) -> f64 {
        self.shares.iter().map(|share| share * share).sum()
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

/// Each class as often as it has octaves, over what their numbers have in common; with it how often it came before.
fn shortest_round(classes: &[usize]) -> Vec<(usize, usize)> {
    let count = |class: usize| classes.iter().filter(|&&other| other == class).count();
    let common = classes.iter().fold(0, |common, &class| gcd(count(class), common)).max(1);
    let mut round = Vec::new();
    for &class in classes {
        let before = round.iter().filter(|turn: &&(usize, usize)| turn.0 == class).count();
        if before < count(class) / common {
            round.push((class, before));
        }
    }
    if round.is_empty() { vec![(0, 0)] } else { round }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Density of the events so far: the mean over the hero classes, each by its share of the rays, of the product of their probabilities (hero
/// sampling with the balance heuristic: Wilkie et al. 2014, Veach 1997, section 9.2). Dividing by it makes every band unbiased, and no
/// band's weight exceeds one over the share of its class.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventMixture {
    /// Products, up to a common factor. Those that vanish beside the largest are lost, and never missed: that the ray's own
    /// band should be among them is as improbable as they are small.
    products: [f64; MAX_BANDS],
    /// Natural logarithm of that factor.
    log_scale: f64,
}

/// How likely events are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventDensity {
    /// Natural logarithm of their density among rays, or pairs of rays that draw for the same class.
    pub log: f64,
    /// Share of all rays that draw for the same class as one which these events befell.
    pub same_class: f64,
}

impl EventMixture {
    /// No events.
    pub const NONE: Self = Self { products: [1.0; MAX_BANDS], log_scale: 0.0 };

    pub fn apply(&mut self, probabilities: &EventProbabilities, material: u32, scattered: bool) {
        let row = &probabilities.scattering[material as usize];
        let products = &mut self.products[..probabilities.classes()];
        let mut largest = 0.0f64;
        for (product, &s) in products.iter_mut().zip(row) {
            *product *= if scattered { s } else { 1.0 - s };
            largest = largest.max(*product);
        }
        if largest < RESCALE && largest > 0.0 {
            products.iter_mut().for_each(|product| *product /= largest);
            self.log_scale += largest.ln();
        }
    }

    /// Of the events so far.
    pub fn density(&self, probabilities: &EventProbabilities) -> EventDensity {
        self.joint_density(&Self::NONE, probabilities)
    }

    /// Of these events and the other ones, both drawn for the same class.
    pub fn joint_density(&self, other: &Self, probabilities: &EventProbabilities) -> EventDensity {
        let (mut sum, mut same) = (0.0, 0.0);
        for ((a, b), share) in self.products.iter().zip(&other.products).zip(&probabilities.shares) {
            let product = share * a * b;
            sum += product;
            same += share * product;
        }
        EventDensity { log: f64::ln(sum) + self.log_scale + other.log_scale, same_class: same / sum }
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
        let (mut whole, mut halves) = (EventMixture::NONE, [EventMixture::NONE; 2]);
        for event in 0..700 {
            whole.apply(&probabilities, 0, event % 3 == 0);
            halves[event % 2].apply(&probabilities, 0, event % 3 == 0);
        }
        let joint = halves[0].joint_density(&halves[1], &probabilities);
        let whole = whole.density(&probabilities);
        assert!((joint.log / whole.log - 1.0).abs() < 1e-12, "{joint:?}");
        assert!((joint.same_class - whole.same_class).abs() < 1e-12, "{joint:?}");
    }

    #[test]
    fn hundreds_of_events_neither_overflow_nor_vanish() {
        let bands = Bands::octaves(125.0, 500.0).unwrap();
        let scattering = PerBand::new(bands, vec![0.001, 0.5, 1.0]).unwrap();
        let material = Material::new(PerBand::uniform(bands, 0.1), scattering).unwrap();
        let probabilities = EventProbabilities::new([&material].into_iter());
        let mut mixture = EventMixture::NONE;
        for _ in 0..900 {
            mixture.apply(&probabilities, 0, true);
        }
        // Only the third band can do this for sure: one third.
        assert!((mixture.density(&probabilities).log - (1.0f64 / 3.0).ln()).abs() < 1e-12);
        mixture.apply(&probabilities, 0, false);
        // Now the third band is out, and 0.5^901 remains besides nothing of 0.001^900.
        for _ in 0..5000 {
            mixture.apply(&probabilities, 0, true);
        }
        let expected = 5901.0 * 0.5f64.ln() - 3f64.ln();
        assert!(
            (mixture.density(&probabilities).log / expected - 1.0).abs() < 1e-12,
            "{}",
            mixture.density(&probabilities).log
        );
    }

    #[test]
    fn octaves_that_scatter_as_others_do_draw_with_them() {
        let bands = Bands::octaves(125.0, 8000.0).unwrap();
        let scattering = PerBand::new(bands, vec![0.1, 0.4, 0.1, 0.9, 0.1, 0.4, 0.1]).unwrap();
        let material = Material::new(PerBand::uniform(bands, 0.1), scattering).unwrap();
        let probabilities = EventProbabilities::new([&material].into_iter());
        assert_eq!((probabilities.classes(), probabilities.round()), (3, 7));
        let turns: Vec<_> = (0..9).map(|ray| probabilities.turn(ray)).collect();
        let expected = [(0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1), (0, 3), (0, 4), (1, 2)];
        assert_eq!(turns, expected);
        assert!((probabilities.same_class() - 21.0 / 49.0).abs() < 1e-12);
        let mut mixture = EventMixture::NONE;
        mixture.apply(&probabilities, 0, true);
        let density = mixture.density(&probabilities);
        assert!((density.log - f64::ln((0.4 + 0.8 + 0.9) / 7.0)).abs() < 1e-12, "{density:?}");
        // One that scattered drew for 0.1 with a probability of 4 in 21, and so on.
        let same_class = (0.4 * 4.0 + 0.8 * 2.0 + 0.9) / 2.1 / 7.0;
        assert!((density.same_class - same_class).abs() < 1e-12, "{density:?}");
    }

    #[test]
    fn a_round_is_as_short_as_the_shares_allow() {
        let round =
            |classes: &[usize]| -> Vec<usize> { shortest_round(classes).iter().map(|turn| turn.0).collect() };
        assert_eq!(round(&[0, 0, 0, 0]), [0]);
        assert_eq!(round(&[0, 1, 0, 1, 2, 2]), [0, 1, 2]);
        assert_eq!(round(&[0, 0, 1, 0, 0, 1]), [0, 0, 1]);
        assert_eq!(round(&[]), [0]);
    }
}
