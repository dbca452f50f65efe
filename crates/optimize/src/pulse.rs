//! Impulse response of an octave filter.

use std::f64::consts::FRAC_2_PI;

/// What lies outside is this share of a pulse's energy, on either side.
const CUT_OFF: f64 = 1e-4;

/// A unit impulse after a filter without delay.
#[derive(Clone, Debug)]
pub(crate) struct Pulse {
    rate_hz: f64,
    /// Samples on either side of the impulse.
    half: usize,
    /// Share of the energy before the start of each sample, 0 to 1.
    cumulated: Vec<f64>,
    /// Pressure and its Hilbert transform, of unit energy each.
    analytic: Vec<[f64; 2]>,
}

impl Pulse {
    /// From the filtered impulse at the sample `middle`.
    pub fn new(filtered: &[f32], middle: usize, rate_hz: f64) -> Self {
        let energy = |x: &f32| f64::from(*x) * f64::from(*x);
        let total: f64 = filtered.iter().map(energy).sum();
        let mut outside = 0.0;
        let silent = filtered.iter().take_while(|x| {
            outside += energy(x);
            outside < CUT_OFF * total
        });
        let half = middle.saturating_sub(silent.count()).max(1);
        let samples = &filtered[middle - half..=middle + half];
        let mut sum = 0.0;
        let mut cumulated = vec![0.0];
        // The instant of a sample is the middle of the interval it stands for.
        for x in samples {
            sum += energy(x);
            cumulated.push(sum);
        }
        cumulated.iter_mut().for_each(|c| *c /= sum);
        // The discrete Hilbert transform: 2 / (pi n) for odd n, and nothing for even ones.
        let quadrature = |i: usize| -> f64 {
            let other = (0..samples.len()).filter(|j| i.abs_diff(*j) % 2 == 1);
            other.map(|j| FRAC_2_PI * f64::from(samples[j]) / (i as f64 - j as f64)).sum()
        };
        let scale = sum.sqrt().recip();
        let analytic =
            (0..samples.len()).map(|i| [f64::from(samples[i]), quadrature(i)].map(|x| scale * x)).collect();
        Self { rate_hz, half, cumulated, analytic }
    }

    /// Share of the energy earlier than a time after the impulse, in seconds.
    pub fn before(&self, time_s: f64) -> f64 {
        let place = time_s * self.rate_hz + self.half as f64 + 0.5;
        if place <= 0.0 {
            return 0.0;
        }
        let (i, part) = (place as usize, place.fract());
        let at = |i: usize| self.cumulated.get(i).copied().unwrap_or(1.0);
        at(i) + part * (at(i + 1) - at(i))
    }

    /// Time on either side within which all of it lies, in seconds.
    pub fn half_s(&self) -> f64 {
        (self.half as f64 + 0.5) / self.rate_hz
    }

    /// Twice the mean square, over all phases, of what two pulses of unit energy have in common between two edges: 1 for the
    /// same pulse between distant edges. All times in seconds.
    pub fn overlap(&self, edges_s: &[f64], first_s: f64, second_s: f64) -> f64 {
        let at = |time_s: f64| (time_s * self.rate_hz).round() as i64;
        let (one, other, half) = (at(first_s), at(second_s), self.half as i64);
        let from = at(edges_s[0]).max(one.max(other) - half);
        let to = at(edges_s[1]).min(one.min(other) + half + 1);
        let (mut real, mut imaginary) = (0.0, 0.0);
        for n in from..to {
            let [a, b] = self.analytic[(n - one + half) as usize];
            let [c, d] = self.analytic[(n - other + half) as usize];
            real += a * c + b * d;
            imaginary += b * c - a * d;
        }
        0.25 * (real * real + imaginary * imaginary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::{Bands, FilterBank};

    /// The 1 kHz octave at 16 kHz.
    fn octave() -> (Vec<f32>, Pulse) {
        let mut impulse = vec![0.0; 8001];
        impulse[4000] = 1.0;
        let bands = Bands::octaves(1000.0, 1000.0).unwrap();
        let filtered = FilterBank::new(bands, 16_000).unwrap().analyse(&impulse).values()[0].clone();
        let pulse = Pulse::new(&filtered, 4000, 16_000.0);
        (filtered, pulse)
    }

    #[test]
    fn its_energy_is_that_of_the_filtered_impulse() {
        let (filtered, pulse) = octave();
        let energy = |x: &f32| f64::from(x * x);
        let total: f64 = filtered.iter().map(energy).sum();
        for offset in [-40i32, -7, -1, 0, 3, 12, 60] {
            let to = (4000 + offset) as usize;
            let share = filtered[..to].iter().map(energy).sum::<f64>() / total;
            let found = pulse.before((f64::from(offset) - 0.5) / 16_000.0);
            assert!((found - share).abs() < 1e-3, "{offset}: {found} {share}");
        }
    }

    #[test]
    fn overlaps_are_the_variance_of_two_arrivals_of_any_phase() {
        let (filtered, pulse) = octave();
        // Arrivals a few samples apart: phases differ by what a sample is at 1 kHz, so that a period of delays has them all.
        for (delay, from, to) in [(0usize, -200i32, 200i32), (16, -200, 200), (24, -10, 14), (40, 10, 30)] {
            let total: f64 = filtered.iter().map(|x| f64::from(x * x)).sum();
            let common = |shift: usize| -> f64 {
                let range = (4000 + from) as usize..(4000 + to) as usize;
                range.map(|i| f64::from(filtered[i] * filtered[i - shift])).sum::<f64>() / total
            };
            let around = (delay.saturating_sub(8)..delay + 8).filter(|s| delay > 0 || *s < 8);
            let squares: Vec<f64> = around.map(|shift| common(shift).powi(2)).collect();
            let direct = 2.0 * squares.iter().sum::<f64>() / squares.len() as f64;
            let edges = [f64::from(from) / 16_000.0, f64::from(to) / 16_000.0];
            let steps: Vec<f64> = (delay.saturating_sub(8)..delay + 8)
                .filter(|s| delay > 0 || *s < 8)
                .map(|shift| pulse.overlap(&edges, 0.0, shift as f64 / 16_000.0))
                .collect();
            let found = steps.iter().sum::<f64>() / steps.len() as f64;
            assert!((found - direct).abs() < 0.15 * direct + 1e-3, "{delay}: {found} {direct}");
        }
    }
}
