//! Where the decay meets the noise: a first guess, from which the fit starts.

use crate::estimate::NoReading;

/// A first guess of where the decay meets the noise (after Lundeby et al. 1995).
pub(super) struct NoiseFloor {
    pub(super) power: f64,
    pub(super) knee_s: f64,
    pub(super) rate_per_s: f64,
    pub(super) start_power: f64,
}

impl NoiseFloor {
    pub(super) fn find(samples: &[f64], step_s: f64, bandwidth_hz: f64) -> Result<Self, NoReading> {
        // Blocks of about eight independent values: 1.5 dB of scatter.
        let block = ((8.0 / (bandwidth_hz * step_s)).ceil() as usize).clamp(1, samples.len() / 2);
        let block = block.max(samples.len() / 400);
        let power: Vec<f64> =
            samples.chunks_exact(block).map(|chunk| chunk.iter().sum::<f64>() / block as f64).collect();
        let block_s = block as f64 * step_s;
        let loudest = (0..power.len()).max_by(|&a, &b| power[a].total_cmp(&power[b])).unwrap_or(0);
        if power[loudest] <= 0.0 {
            return Err(NoReading::NoOnset);
        }
        let mean_from = |from: usize| {
            let tail = &power[from.min(power.len() - power.len().div_ceil(10))..];
            tail.iter().sum::<f64>() / tail.len() as f64
        };
        let mut noise = mean_from(power.len()).max(1e-20 * power[loudest]);
        let mut found = None;
        for _ in 0..6 {
            let above = noise * 10f64.powf(0.5);
            let end =
                (loudest..power.len()).find(|&i| power[i] < above).unwrap_or(power.len()).max(loudest + 2);
            let Some((level, rate)) = log_line(&power, loudest, end.min(power.len()), block_s) else { break };
            if rate <= 0.0 {
                break;
            }
            let knee_s = ((level - noise.ln()) / rate).clamp(block_s, power.len() as f64 * block_s);
            found = Some((level, rate, knee_s));
            // The floor is read 7 dB of decay after the knee.
            noise = mean_from(((knee_s + 1.6 / rate) / block_s) as usize).max(1e-20 * power[loudest]);
        }
        let (level, rate_per_s, knee_s) = found.ok_or(NoReading::NoDecay)?;
        Ok(Self { power: noise, knee_s, rate_per_s, start_power: level.exp() })
    }
}

/// Least-squares line through the logarithm of powers `from..to`: its value at time zero and how fast it falls.
fn log_line(power: &[f64], from: usize, to: usize, block_s: f64) -> Option<(f64, f64)> {
    let (mut n, mut t1, mut y1, mut tt, mut ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (i, &p) in power.iter().enumerate().take(to).skip(from).filter(|(_, p)| **p > 0.0) {
        let (t, y) = ((i as f64 + 0.5) * block_s, p.ln());
        n += 1.0;
        t1 += t;
        y1 += y;
        tt += t * t;
        ty += t * y;
    }
    let slope = (n * ty - t1 * y1) / (n * tt - t1 * t1);
    slope.is_finite().then(|| ((y1 - slope * t1) / n, -slope))
}
