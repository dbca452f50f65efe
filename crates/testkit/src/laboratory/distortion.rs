//! A loudspeaker that is driven too hard, measured with an exponential sweep.
//!
//! A. Farina, *Simultaneous measurement of impulse response and distortion with a swept-sine technique*, AES 108th convention, 2000: a
//! sweep sin(phi(t)) whose frequency grows as exp(t / L) becomes, by the powers of its value, harmonics sin(k phi(t)); each is the sweep
//! itself L ln(k) earlier, and so is its response once the sweep has been divided out.

use super::hidden::Hidden;
use super::truth::Truth;
use realfft::num_complex::Complex;
use sabine_acoustics::RealTransforms;
use std::f64::consts::TAU;

/// Harmonics above this share of the sample rate do not pass the converter.
const PASSED: f64 = 0.45;
/// Octaves over which they fade before that.
const FADE_OCTAVES: f64 = 0.1;
/// The sweep begins and ends within this time.
const EDGE_S: f64 = 0.02;
/// What is kept of the harmonics' pulses to either side, in seconds.
const AROUND_S: f64 = 0.05;
/// Lines of the sweep's spectrum so far below the strongest are not divided by (energy): nothing but the ends of the sweep.
const FLOOR: f64 = 1e-9;

/// Adds to each response what the harmonics of the sweep leave of it, before the direct sound.
pub(crate) fn add_harmonics(truth: &Truth, rate_hz: f64, responses: &mut [Vec<f64>]) {
    for effect in &truth.effects {
        if let Hidden::NonlinearDistortion { sweep_s, from_hz, to_hz, quadratic, cubic, .. } = *effect {
            let sweep = Sweep { length_s: sweep_s, from_hz, to_hz };
            let (pulse, lead) = sweep.harmonics([quadratic, cubic], rate_hz);
            responses.iter_mut().for_each(|samples| add_convolved(samples, &pulse, lead));
        }
    }
}

/// An exponential sweep.
struct Sweep {
    length_s: f64,
    from_hz: f64,
    to_hz: f64,
}

impl Sweep {
    /// Time in which the frequency grows by the factor e.
    fn growth_s(&self) -> f64 {
        self.length_s / (self.to_hz / self.from_hz).ln()
    }

    /// What the second and third power of the sweep leave beside its own frequency, the sweep divided out; and the place of time zero.
    fn harmonics(&self, [quadratic, cubic]: [f64; 2], rate_hz: f64) -> (Vec<f64>, usize) {
        let count = (self.length_s * rate_hz) as usize;
        let size = (2 * count).next_power_of_two();
        let growth_s = self.growth_s();
        let (mut sweep, mut harmonics) = (vec![0.0; size], vec![0.0; size]);
        for i in 0..count {
            let time_s = i as f64 / rate_hz;
            let hz = self.from_hz * (time_s / growth_s).exp();
            let phase = TAU * growth_s * (hz - self.from_hz);
            let edge = ((time_s / EDGE_S).min(1.0) * ((self.length_s - time_s) / EDGE_S).min(1.0)).max(0.0);
            let passed =
                |k: f64| ((PASSED * rate_hz / (k * hz)).log2() / FADE_OCTAVES).clamp(0.0, 1.0) * edge;
            sweep[i] = edge * phase.sin();
            // sin^2 x = (1 - cos 2x) / 2, sin^3 x = (3 sin x - sin 3x) / 4.
            harmonics[i] = -0.5 * quadratic * passed(2.0) * (2.0 * phase).cos()
                - 0.25 * cubic * passed(3.0) * (3.0 * phase).sin();
        }
        let RealTransforms { forward, inverse: back } = RealTransforms::<f64>::new(size);
        let spectrum = |samples: &mut Vec<f64>| {
            let mut lines = forward.make_output_vec();
            // The plan made both buffers: their lengths agree.
            let _ = forward.process(samples, &mut lines);
            lines
        };
        let (below, mut lines) = (spectrum(&mut sweep), spectrum(&mut harmonics));
        let most = below.iter().map(Complex::norm_sqr).fold(0.0, f64::max);
        for (i, (line, sweep)) in lines.iter_mut().zip(&below).enumerate() {
            // Where the sweep has not been nothing is known.
            let hz = i as f64 * rate_hz / size as f64;
            let octaves_inside = (hz / self.from_hz).log2().min((self.to_hz / hz).log2());
            let share = (octaves_inside / FADE_OCTAVES).clamp(0.0, 1.0);
            *line *= share * sweep.conj() / (sweep.norm_sqr() + FLOOR * most) / size as f64;
        }
        let mut found = vec![0.0; size];
        // Nothing but rounding is left in what must be real.
        lines[0].im = 0.0;
        lines[size / 2].im = 0.0;
        let _ = back.process(&mut lines, &mut found);
        let lead = ((growth_s * 3f64.ln() + AROUND_S) * rate_hz) as usize;
        let after = (AROUND_S * rate_hz) as usize;
        let mut pulse = found[size - lead..].to_vec();
        pulse.extend_from_slice(&found[..after]);
        (pulse, lead)
    }
}

/// Adds the convolution with a pulse whose time zero stands at `lead`; what falls before the first sample is lost.
fn add_convolved(samples: &mut [f64], pulse: &[f64], lead: usize) {
    let size = (samples.len() + pulse.len()).next_power_of_two();
    let RealTransforms { forward, inverse: back } = RealTransforms::<f64>::new(size);
    let spectrum = |samples: &[f64]| {
        let mut padded = samples.to_vec();
        padded.resize(size, 0.0);
        let mut lines = forward.make_output_vec();
        let _ = forward.process(&mut padded, &mut lines);
        lines
    };
    let mut lines = spectrum(samples);
    lines.iter_mut().zip(spectrum(pulse)).for_each(|(a, b)| *a *= b / size as f64);
    lines[0].im = 0.0;
    lines[size / 2].im = 0.0;
    let mut sum = vec![0.0; size];
    let _ = back.process(&mut lines, &mut sum);
    samples.iter_mut().zip(&sum[lead..]).for_each(|(s, more)| *s += more);
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 48_000.0;

    /// Energy about the times at which theory has the harmonics, against that of flat spectra of their amplitudes.
    #[test]
    fn harmonics_come_as_early_and_as_strong_as_theory_says() {
        let sweep = Sweep { length_s: 2.0, from_hz: 50.0, to_hz: 12_000.0 };
        let (quadratic, cubic) = (0.1, 0.08);
        let (pulse, lead) = sweep.harmonics([quadratic, cubic], RATE_HZ);
        let around = |early_s: f64| -> f64 {
            let at = lead as f64 - early_s * RATE_HZ;
            let reach = 0.03 * RATE_HZ;
            pulse[(at - reach) as usize..(at + reach) as usize].iter().map(|x| x * x).sum()
        };
        let growth_s = sweep.growth_s();
        for (k, amplitude) in [(2.0, 0.5 * quadratic), (3.0, 0.25 * cubic)] {
            // A pulse of this amplitude at all frequencies from k times the lowest to the end of the sweep.
            let expected = amplitude * amplitude * (sweep.to_hz - k * sweep.from_hz) / (0.5 * RATE_HZ);
            let off_db = 10.0 * (around(growth_s * f64::ln(k)) / expected).log10();
            assert!(off_db.abs() < 0.5, "harmonic {k}: {off_db} dB");
        }
        let all: f64 = pulse.iter().map(|x| x * x).sum();
        let both = around(growth_s * 2f64.ln()) + around(growth_s * 3f64.ln());
        assert!(both > 0.97 * all, "{both} of {all}");
    }

    #[test]
    fn a_response_keeps_its_decay_in_its_harmonics() {
        let mut samples = vec![0.0; 2000];
        samples[1000] = 1.0;
        samples[1100] = 0.5;
        let mut pulse = vec![0.0; 700];
        pulse[100] = 0.1;
        add_convolved(&mut samples, &pulse, 600);
        // 500 samples earlier, at a tenth.
        assert!((samples[500] - 0.1).abs() < 1e-12 && (samples[600] - 0.05).abs() < 1e-12);
        assert!((samples[1000] - 1.0).abs() < 1e-12 && samples[700].abs() < 1e-12);
    }
}
