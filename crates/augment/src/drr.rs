//! Nearer to the source, or farther from it.

use crate::augment::Augment;
use crate::direct::{Direct, HALF_DIRECT_S};
use crate::error::{Error, check_span};
use crate::seed::generator;
use rand::Rng;
use sabine_acoustics::{BandParameters, ImpulseResponse};

/// Readings of the ratio before it is given up, and what is near enough, dB.
const ROUNDS: usize = 5;
const TOLERANCE_DB: f64 = 0.1;

/// Settings of [`DrrAugment`].
#[derive(Clone, Debug, PartialEq)]
pub struct DrrConfig {
    /// Range of the ratio of direct to reverberant energy to draw from, in dB, within -40 to 60. Default -6 to 18
    /// (Bryan 2020).
    pub drr_db: (f64, f64),
}

impl Default for DrrConfig {
    fn default() -> Self {
        Self { drr_db: (-6.0, 18.0) }
    }
}

/// Scales the direct sound until its energy has a drawn ratio to that of the late part, which stays as it is.
///
/// The direct sound is what lies within 2.5 ms of the largest sample; a Hann window of that length fades the gain to 1 at
/// its edges (Bryan 2020).
#[derive(Clone, Debug, PartialEq)]
pub struct DrrAugment {
    config: DrrConfig,
}

impl DrrAugment {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn new(config: DrrConfig) -> Result<Self, Error> {
        check_span("drr_db", config.drr_db, -40.0, 60.0, "a rising range within -40 to 60 dB")?;
        Ok(Self { config })
    }

    /// The response with this ratio.
    ///
    /// ```
    /// use sabine_acoustics::{BandParameters, ImpulseResponse};
    /// use sabine_augment::{DrrAugment, DrrConfig};
    /// // A direct sound, and a late part that falls by 60 dB in 0.4 s.
    /// let mut samples: Vec<f32> =
    ///     (0..8000).map(|i| if i % 2 == 0 { 0.05 } else { -0.05 } * (-6.9078 * i as f32 / 6400.0).exp()).collect();
    /// samples[..100].fill(0.0);
    /// samples[100] = 1.0;
    /// let near = DrrAugment::new(DrrConfig::default())?.to_db(&ImpulseResponse::new(samples, 16_000)?, 16.0)?;
    /// assert!((BandParameters::full_band(&near).drr_db.unwrap().value - 16.0).abs() < 0.1);
    /// # Ok::<(), sabine_augment::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NoDirectSound`] and the like for a response that cannot be split, [`Error::DrrUnreachable`] where the direct
    /// peak would sink below the largest sample of the late part, or the ratio that [`BandParameters::full_band`] reads
    /// does not come within 0.1 dB.
    pub fn to_db(&self, response: &ImpulseResponse, target_db: f64) -> Result<ImpulseResponse, Error> {
        // What is read as late is free of the noise of the recording, what is summed here is not: ask for more or less
        // until the reading is right.
        let mut asked_db = target_db;
        for _ in 0..ROUNDS {
            let changed = Self::to_raw_db(response, asked_db, target_db)?;
            let Ok(found) = BandParameters::full_band(&changed).drr_db else { return Ok(changed) };
            let missing_db = target_db - found.value;
            if missing_db.abs() < TOLERANCE_DB {
                return Ok(changed);
            }
            asked_db += missing_db;
        }
        Err(Error::DrrUnreachable { target_db })
    }

    /// The response whose direct sound has `asked_db` more energy than all that follows, noise included.
    fn to_raw_db(
        response: &ImpulseResponse,
        asked_db: f64,
        target_db: f64,
    ) -> Result<ImpulseResponse, Error> {
        let direct = Direct::find(response)?;
        let rate = f64::from(response.sample_rate_hz());
        let mut samples = response.samples().to_vec();
        let window = |i: usize| {
            let t = (i as f64 - direct.peak as f64) / rate / HALF_DIRECT_S;
            0.5 * (1.0 + (std::f64::consts::PI * t.clamp(-1.0, 1.0)).cos())
        };
        let late = &samples[direct.end..];
        let late_energy: f64 = late.iter().map(|&s| f64::from(s).powi(2)).sum();
        let late_peak = late.iter().fold(0.0_f32, |p, s| p.max(s.abs()));
        // The energy of (alpha w + 1 - w) h as a quadratic in alpha.
        let (mut a, mut b, mut c) = (0.0, 0.0, -(10f64.powf(asked_db / 10.0)) * late_energy);
        for (i, &s) in samples.iter().enumerate().take(direct.end).skip(direct.start) {
            let (w, energy) = (window(i), f64::from(s).powi(2));
            a += w * w * energy;
            b += 2.0 * (1.0 - w) * w * energy;
            c += (1.0 - w) * (1.0 - w) * energy;
        }
        let unreachable = Error::DrrUnreachable { target_db };
        let discriminant = b * b - 4.0 * a * c;
        // Written so that NaN fails.
        if !(discriminant >= 0.0 && a > 0.0) {
            return Err(unreachable);
        }
        let alpha = (-b + discriminant.sqrt()) / (2.0 * a);
        if !(alpha > 0.0 && alpha * f64::from(samples[direct.peak].abs()) >= f64::from(late_peak)) {
            return Err(unreachable);
        }
        for (i, s) in samples.iter_mut().enumerate().take(direct.end).skip(direct.start) {
            let w = window(i);
            *s = ((alpha * w + 1.0 - w) * f64::from(*s)) as f32;
        }
        Ok(ImpulseResponse::new(samples, response.sample_rate_hz())?)
    }
}

impl Augment for DrrAugment {
    fn augment(
        &self,
        response: &ImpulseResponse,
        seed: u64,
    ) -> Result<ImpulseResponse, sabine_acoustics::Error> {
        let (low, high) = self.config.drr_db;
        let target_db = generator(seed).random_range(low..=high);
        Ok(self.to_db(response, target_db)?)
    }
}
