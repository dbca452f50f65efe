//! The same room, more or less absorbent.

use crate::augment::Augment;
use crate::direct::Direct;
use crate::error::{Error, check, check_span};
use crate::labels::decay_times;
use crate::seed::{derive, generator};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use sabine_acoustics::{Bands, DecayFit, FilterBank, ImpulseResponse, NoReading};

/// ln(10^6): power falls by 60 dB in this many time constants.
const LN_MILLION: f64 = 13.815_510_557_964_274;
/// The recorded tail is kept to where it stands this far above its noise, dB: there the noise adds 0.4 dB.
const NOISE_MARGIN_DB: f64 = 10.0;
/// Share of an octave's width that a split band of Gaussian noise effectively has (integral of g^4 squared over that of g^8
/// for the crossovers of [`FilterBank`], about).
const EFFECTIVE_WIDTH: f64 = 0.8;
/// Lengthened responses are multiples of this long, in samples.
const LENGTH_STEP: usize = 2048;
/// Time after the direct sound at which the fit of the full band begins, s.
const FULL_BAND_START_S: f64 = 0.002;
/// The least reverberation time of an octave that is made, s.
const LEAST_OCTAVE_S: f64 = 0.03;
/// The longest one, in lengths of the longest response: 37 dB of it are heard then.
const MOST_LENGTHS: f64 = 1.6;
/// The reverberation time above which the lowest octave is taken for hum in short recordings, s.
const LONGEST_LOWEST_S: f64 = 4.0;
/// Times that the octaves are measured and corrected.
const CORRECTIONS: usize = 2;
/// What is not corrected, as a logarithm: 2 %.
const TOLERANCE: f64 = 0.02;
/// Most that the factor of an octave is corrected by.
const LARGEST_CORRECTION: f64 = 1.5;
/// Octaves (of eight) in which a decay must be found.
const LEAST_OCTAVES: usize = 4;

/// Settings of [`T60Augment`].
#[derive(Clone, Debug, PartialEq)]
pub struct T60Config {
    /// Range of the full-band reverberation time to draw from, in seconds, within 0.05 to 10. Default 0.1 to 1.5
    /// (Bryan 2020).
    pub t60_s: (f64, f64),
    /// Length of the cross-fade from the recorded tail to noise, in seconds, 0.005 to 0.5. Default 0.05.
    pub crossfade_s: f64,
    /// The longest response made, in seconds, 0.1 to 20. Default 2.5.
    pub longest_s: f64,
}

impl Default for T60Config {
    fn default() -> Self {
        Self { t60_s: (0.1, 1.5), crossfade_s: 0.05, longest_s: 2.5 }
    }
}

/// Stretches or shortens the decay of every octave by the same factor, so that the full band gets a drawn reverberation
/// time while the spectral shape stays; the direct sound, 2.5 ms on either side of the largest sample, stays as it is.
///
/// In each octave a decay plus noise is fitted. Where the recording sinks into its noise it is cross-faded into Gaussian
/// noise that goes on decaying; then the late part is multiplied by the ratio of the decay wanted to the decay found (for a
/// single slope, exp(-(t - t0)(tau - tau') / (tau tau')); Bryan 2020). What is added to the response is the difference that
/// this makes, so that where nothing changes nothing is touched.
///
/// The full band begins at 88 Hz: below, the rumble of a recording would be read. An octave in which no decay can be read
/// fades with the nearest octave that has one: where the decay is lengthened it does not grow, but its noise recedes as the
/// neighbour's does.
///
/// The result is measured as labels are, and the factor of an octave that is off corrected: what an octave's filter hears of
/// its neighbours, and the luck of a few modes, would otherwise stay in it.
#[derive(Clone, Debug)]
pub struct T60Augment {
    config: T60Config,
}

impl T60Augment {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn new(config: T60Config) -> Result<Self, Error> {
        check_span("t60_s", config.t60_s, 0.05, 10.0, "a rising range within 0.05 to 10 s")?;
        check("crossfade_s", config.crossfade_s, 0.005, 0.5, "between 5 and 500 ms")?;
        check("longest_s", config.longest_s, 0.1, 20.0, "between 0.1 and 20 s")?;
        Ok(Self { config })
    }

    /// The response with a full-band reverberation time of `target_s`; `seed` draws the noise.
    ///
    /// # Errors
    /// [`Error::NoDirectSound`] and the like for a response that cannot be split, [`Error::NoDecay`] where the decay cannot
    /// be read, [`Error::T60Unreachable`] where an octave would become too long for [`T60Config::longest_s`] or too short.
    pub fn to_s(
        &self,
        response: &ImpulseResponse,
        target_s: f64,
        seed: u64,
    ) -> Result<ImpulseResponse, Error> {
        let factor = target_s / self.full_band_s(response)?;
        self.by_factor(response, factor, seed)
    }

    /// The full-band reverberation time that [`T60Augment::to_s`] changes, in seconds.
    ///
    /// # Errors
    /// As [`T60Augment::to_s`].
    pub fn full_band_s(&self, response: &ImpulseResponse) -> Result<f64, Error> {
        let direct = Direct::find(response)?;
        let rate = f64::from(response.sample_rate_hz());
        let mut late = response.samples().to_vec();
        late[..direct.end].fill(0.0);
        let bank = FilterBank::new(octaves_below(0.5 * rate)?, response.sample_rate_hz())?;
        let parts = bank.split(&late);
        let mut full = vec![0.0_f32; late.len()];
        for part in &parts.values()[1..] {
            full.iter_mut().zip(part).for_each(|(sum, s)| *sum += s);
        }
        let start_s = direct.end as f64 / rate + FULL_BAND_START_S;
        let fit = fit(&full[..heard(&late)], rate, start_s, 0.5 * rate)
            .map_err(|reason| Error::NoDecay { centre_hz: 1000.0, reason })?;
        Ok(fit.t60_s().value)
    }

    /// The response with the reverberation time of every octave times `factor`, as [`crate::Labels::measure`] reads it before and
    /// after: what is off by more than 2 % is corrected, at most twice.
    ///
    /// # Errors
    /// As [`T60Augment::to_s`].
    pub fn by_factor(
        &self,
        response: &ImpulseResponse,
        factor: f64,
        seed: u64,
    ) -> Result<ImpulseResponse, Error> {
        check("factor", factor, 1e-3, 1e3, "between 0.001 and 1000")?;
        let before = decay_times(response)?;
        let octaves = Octaves::new(response, &before.fits)?;
        octaves.check(factor, MOST_LENGTHS * self.config.longest_s)?;
        let mut factors = vec![factor; octaves.parts.len()];
        let length = octaves.length(factor, self.config.longest_s);
        let noises = octaves.noises(length, seed);
        // For each octave the factor that came nearest, and how near.
        let mut best = vec![(f64::INFINITY, factor); factors.len()];
        for _ in 0..=CORRECTIONS {
            let changed = octaves.changed(response, factor, &factors, &noises, self.config.crossfade_s)?;
            let after = decay_times(&changed)?;
            let mut worst = 0.0_f64;
            // The octaves of the labels begin at 125 Hz, those of the change at 62.5 Hz.
            for (octave, (before, after)) in before.t60_s.iter().zip(&after.t60_s).enumerate() {
                let (Ok(before), Ok(after)) = (before, after) else { continue };
                let Some(own) = factors.get_mut(octave + 1) else { continue };
                let ratio = after.value / (before.value * factor);
                let off = ratio.ln().abs();
                worst = worst.max(off);
                if off < best[octave + 1].0 {
                    best[octave + 1] = (off, *own);
                }
                *own = (*own / ratio.clamp(1.0 / LARGEST_CORRECTION, LARGEST_CORRECTION))
                    .clamp(factor / LARGEST_CORRECTION, factor * LARGEST_CORRECTION);
            }
            // What the lowest octave leaks into the next is read there: it is corrected alike.
            factors[0] = factors[1];
            best[0] = best[1];
            if worst < TOLERANCE {
                return Ok(changed);
            }
        }
        let kept: Vec<f64> = best.into_iter().map(|(_, own)| own).collect();
        octaves.changed(response, factor, &kept, &noises, self.config.crossfade_s)
    }
}

impl Augment for T60Augment {
    fn augment(
        &self,
        response: &ImpulseResponse,
        seed: u64,
    ) -> Result<ImpulseResponse, sabine_acoustics::Error> {
        let (low, high) = self.config.t60_s;
        let target_s = generator(seed).random_range(low..=high);
        Ok(self.to_s(response, target_s, derive(seed, 1))?)
    }
}

/// A response taken apart, with the decay of each octave.
struct Octaves {
    bands: Bands,
    bank: FilterBank,
    parts: Vec<Vec<f32>>,
    fits: Vec<Result<DecayFit, NoReading>>,
    direct: Direct,
    rate: f64,
}

impl Octaves {
    /// `measured` are the decays that the labels are read from, from 125 Hz up: what is changed by one reading and labelled by
    /// another would miss its target by their difference. Octaves without one are fitted here.
    fn new(response: &ImpulseResponse, measured: &[Result<DecayFit, NoReading>]) -> Result<Self, Error> {
        let direct = Direct::find(response)?;
        let rate = f64::from(response.sample_rate_hz());
        let bands = octaves_below(0.5 * rate)?;
        let bank = FilterBank::new(bands, response.sample_rate_hz())?;
        let mut late = response.samples().to_vec();
        late[..direct.end].fill(0.0);
        let parts = bank.split(&late).values().to_vec();
        let start_s = direct.end as f64 / rate;
        let heard = heard(&late);
        let fits: Vec<Result<DecayFit, NoReading>> = parts
            .iter()
            .enumerate()
            .map(|(band, part)| {
                if let Some(Ok(found)) = band.checked_sub(1).and_then(|octave| measured.get(octave)) {
                    return Ok(found.clone());
                }
                let (low_hz, high_hz) = bands.edges_hz(band);
                let width_hz = EFFECTIVE_WIDTH * (high_hz.min(0.5 * rate) - low_hz);
                // Past the smearing of the filter, about one over the bandwidth.
                fit(&part[..heard], rate, start_s + 1.0 / width_hz, width_hz)
            })
            .collect();
        Ok(Self { bands, bank, parts, fits, direct, rate })
    }

    /// Refuses what has too few decays, and what would become too short or too long to be heard.
    fn check(&self, factor: f64, most_s: f64) -> Result<(), Error> {
        if self.fits.iter().filter(|f| f.is_ok()).count() < LEAST_OCTAVES {
            let (centre_hz, reason) = self
                .bands
                .iter_hz()
                .zip(&self.fits)
                .find_map(|(hz, f)| f.as_ref().err().map(|reason| (hz, reason.clone())))
                .unwrap_or((1000.0, NoReading::NoDecay));
            return Err(Error::NoDecay { centre_hz, reason });
        }
        // The lowest octave carries no label and is often hum: a decay there that does not fit counts as none.
        for (centre_hz, found) in self.bands.iter_hz().zip(&self.fits).skip(1) {
            let Ok(found) = found else { continue };
            let octave_s = found.t60_s().value * factor;
            if !(LEAST_OCTAVE_S..=most_s).contains(&octave_s) {
                return Err(Error::T60Unreachable { centre_hz, octave_s, least_s: LEAST_OCTAVE_S, most_s });
            }
        }
        Ok(())
    }

    /// Samples of the changed response. A shorter decay needs no fewer; a longer one needs more.
    fn length(&self, factor: f64, longest_s: f64) -> usize {
        let slowest_s = self.fits.iter().flatten().map(|f| f.t60_s().value).fold(0.0, f64::max) * factor;
        let start_s = self.direct.end as f64 / self.rate;
        let (wanted, there) =
            (((start_s + slowest_s).min(longest_s) * self.rate) as usize, self.parts[0].len());
        // Few different lengths, so that few transforms are planned for them.
        if wanted > there { wanted.next_multiple_of(LENGTH_STEP) } else { there }
    }

    fn noises(&self, length: usize, seed: u64) -> Vec<Vec<f32>> {
        let rng = &mut generator(seed);
        let white: Vec<f32> = (0..length).map(|_| StandardNormal.sample(rng)).collect();
        self.bank.split(&white).values().to_vec()
    }

    /// The response with the decay of each octave times its own factor; `factor` is the common one.
    fn changed(
        &self,
        response: &ImpulseResponse,
        factor: f64,
        factors: &[f64],
        noises: &[Vec<f32>],
        crossfade_s: f64,
    ) -> Result<ImpulseResponse, Error> {
        let length = noises[0].len();
        let mut sum: Vec<f64> = response.samples().iter().map(|&s| f64::from(s)).collect();
        sum.resize(length, 0.0);
        for (band, found) in self.fits.iter().enumerate() {
            let own = found.is_ok() && !self.is_hum(band, factor);
            let nearest = (0..self.fits.len())
                .filter(|&other| other == band || !self.is_hum(other, factor))
                .filter(|&other| own || other != band)
                .filter_map(|other| self.fits[other].as_ref().ok().map(|f| (band.abs_diff(other), f)))
                .min_by_key(|(far, _)| *far);
            let Some((_, fit)) = nearest else { continue };
            let change = Change::new(fit, factors[band], crossfade_s, own, &self.parts[band], self.rate);
            change.apply(&self.parts[band], &noises[band], self.direct.end, self.rate, &mut sum);
        }
        let samples = sum.into_iter().map(|s| s as f32).collect();
        Ok(ImpulseResponse::new(samples, response.sample_rate_hz())?)
    }

    /// The lowest octave, if what was found there cannot be the decay of the room.
    fn is_hum(&self, band: usize, factor: f64) -> bool {
        let longest_s = self.parts[0].len() as f64 / self.rate * MOST_LENGTHS;
        band == 0
            && self.fits[0].as_ref().is_ok_and(|f| {
                !(LEAST_OCTAVE_S..=longest_s.max(LONGEST_LOWEST_S)).contains(&(f.t60_s().value * factor))
            })
    }
}

/// Samples up to the digital silence at the end, which says nothing about the noise of the measurement.
fn heard(samples: &[f32]) -> usize {
    samples.iter().rposition(|&s| s != 0.0).map_or(0, |last| last + 1)
}

/// What happens to one octave.
struct Change<'a> {
    fit: &'a DecayFit,
    factor: f64,
    /// Power of the part over that of the fit, which may have been made on a band of another filter.
    level: f64,
    /// Begin and end of the cross-fade to noise, s; none where the recording goes on to its end.
    crossfade_s: Option<(f64, f64)>,
    /// For an octave without a decay of its own that is lengthened: when it begins to fade, s. It must not grow, but neither
    /// must its noise outlast its neighbour, in which it would be read.
    recede_s: Option<f64>,
}

impl<'a> Change<'a> {
    fn new(fit: &'a DecayFit, factor: f64, crossfade_s: f64, own: bool, part: &[f32], rate: f64) -> Self {
        // The fit falls with time: halve the interval until the decay stands the margin above the noise.
        let margin = 10f64.powf(NOISE_MARGIN_DB / 10.0);
        let (mut low, mut high) = (fit.start_s(), fit.knee_s());
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if fit.decay_power_at(middle) > margin * fit.noise_power() { low = middle } else { high = middle }
        }
        let crossfade_s = own.then(|| ((low - crossfade_s).max(fit.start_s()), low));
        let recede_s = (!own && factor > 1.0).then_some(low);
        // The ratio that meets most of the decay best: of each sample's power to that of the fit.
        let first = (fit.start_s() * rate) as usize;
        let last = ((low * rate) as usize).min(part.len());
        let ratios = part.get(first..last).unwrap_or(&[]).iter().enumerate().map(|(i, &s)| {
            let t = (first + i) as f64 / rate;
            f64::from(s).powi(2) / (fit.decay_power_at(t) + fit.noise_power())
        });
        let level = ratios.sum::<f64>() / last.saturating_sub(first).max(1) as f64;
        Self { fit, factor, level, crossfade_s, recede_s }
    }

    /// Power of the decay wanted at a time, on the scale of the fit.
    fn wanted_power_at(&self, time_s: f64) -> f64 {
        let start_s = self.fit.start_s();
        // Times count from the start of the fit, where both decays have the same power.
        self.fit
            .slopes()
            .iter()
            .map(|s| s.power * (-(time_s - start_s) * LN_MILLION / (self.factor * s.t60_s.value)).exp())
            .sum()
    }

    /// Adds to `sum` what changes in this octave after `from`.
    fn apply(&self, part: &[f32], noise: &[f32], from: usize, rate: f64, sum: &mut [f64]) {
        // At the end of the direct sound the gain is one.
        let at_start = self.gain(from as f64 / rate);
        let noise_power =
            noise.iter().map(|&n| f64::from(n).powi(2)).sum::<f64>() / noise.len().max(1) as f64;
        let silent = 1e-14 * self.fit.decay_power_at(self.fit.start_s());
        for (i, total) in sum.iter_mut().enumerate().skip(from) {
            let t = i as f64 / rate;
            let recorded = part.get(i).map_or(0.0, |&s| f64::from(s));
            let fade = match self.crossfade_s {
                Some((begin, end)) => ((t - begin) / (end - begin).max(1e-9)).clamp(0.0, 1.0),
                None => 0.0,
            };
            if let Some(begin) = self.recede_s {
                let gain = (self.wanted_power_at(t.max(begin)) / self.wanted_power_at(begin)).sqrt();
                *total += (gain - 1.0) * recorded;
                continue;
            }
            // Recording and noise are uncorrelated: their powers add up to one.
            let angle = std::f64::consts::FRAC_PI_2 * fade;
            let mut changed = 0.0;
            if fade < 1.0 {
                changed += angle.cos() * recorded * self.gain(t) / at_start;
            }
            if fade > 0.0 {
                let wanted = self.wanted_power_at(t) / (at_start * at_start);
                if wanted > silent {
                    changed += angle.sin() * f64::from(noise[i]) * (self.level * wanted / noise_power).sqrt();
                }
            }
            *total += changed - recorded;
        }
    }

    /// Ratio of the decay wanted to the decay found, in amplitude.
    fn gain(&self, time_s: f64) -> f64 {
        (self.wanted_power_at(time_s) / self.fit.decay_power_at(time_s)).sqrt()
    }
}

fn fit(samples: &[f32], rate: f64, start_s: f64, bandwidth_hz: f64) -> Result<DecayFit, NoReading> {
    let energy: Vec<f64> = samples.iter().map(|&s| f64::from(s).powi(2)).collect();
    DecayFit::fit(&energy, 1.0 / rate, start_s, bandwidth_hz)
}

/// 62.5 Hz up to the last octave that begins well below a frequency.
fn octaves_below(limit_hz: f64) -> Result<Bands, Error> {
    let all = Bands::octaves(62.5, 16_000.0)?;
    let count = (0..all.len()).take_while(|&b| all.edges_hz(b).0 < 0.9 * limit_hz).count().max(1);
    Ok(Bands::octaves(62.5, all.nominal_hz(count - 1))?)
}
