//! From the recording of a sweep to the response (ISO 18233:2006).

mod alignment;
mod clipping;
mod repetitions;

use crate::error::Error;
use crate::signal::{ImpulseResponse, Signal};
use crate::spectrum::{Spectrum, fast_len};
use crate::strength::check_rates;
use crate::sweep::ExponentialSweep;
use crate::sweep_error::SweepError;
use realfft::num_complex::Complex;
use repetitions::Repetitions;

/// Regularisation within the range of the sweep, as a share of its power there: 0.0004 dB.
const WITHIN: f64 = 1e-4;
/// The regularisation rises to the power of the sweep itself over this factor of frequency at both ends of its range.
const EDGE: f64 = 1.122_462_048_309_373; // a sixth of an octave
/// What a response keeps before its onset, in seconds.
const BEFORE_S: f64 = 0.05;
/// The onset lies within this of the largest sample.
const ONSET_SHARE: f64 = 0.1;
/// How far the onset may lie before the largest sample, in seconds.
const ONSET_REACH_S: f64 = 0.2;
/// Least reverberation after the last sweep, in seconds.
const LEAST_TAIL_S: f64 = 0.1;

/// What [`deconvolve`] does about repetitions and clocks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DeconvolutionConfig {
    /// Leaves repetitions out of the mean that are not like the others, where at least two stay, in place of an error.
    pub leave_out_differing: bool,
    /// Takes the response as it is where the clocks of playback and recording differ, in place of an error. Its octaves are
    /// shifted against each other then, and the mean of several repetitions loses high frequencies.
    pub allow_clock_drift: bool,
}

/// The responses of a recording, one for each channel.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SweepMeasurement {
    /// Recording divided by sweep: a chain that passes the sweep as it is gives a pulse of 1, but for what lies outside the
    /// sweep's range. All channels have one length and one time axis.
    pub responses: Vec<ImpulseResponse>,
    /// Time in the recording, less the time in the playback, of the first sample: 50 ms before the onset, or where the recording begins.
    /// Where playback and recording started together, what is added to times in the response to count from the emission, latency included.
    pub start_s: f64,
    /// Difference of each repetition from the one most like it, in dB relative to the response's energy; empty for a single
    /// sweep.
    pub differences_db: Vec<f64>,
    /// Repetitions that were left out, from 0.
    pub left_out: Vec<usize>,
    /// By how much the recording is longer than the playback, in parts per million; known from several repetitions.
    pub clock_drift_ppm: Option<f64>,
}

/// Makes impulse responses of a recording of a sweep: one signal for each channel.
///
/// The spectrum of the recording is divided by that of the sweep, with a regularisation that is 40 dB below the sweep within
/// its range and as strong as the sweep outside. The division is linear: nothing wraps around, and harmonic distortion, which comes at
/// negative times, is cut off. The response is flat from 1.12 times the first frequency of the sweep to the last one over
/// 1.12. Repetitions are deconvolved one by one, compared and averaged; each response is as long as the silence between
/// them. A single sweep gives what the recording holds after the sweep.
///
/// ```
/// use sabine_acoustics::{ExponentialSweep, Signal, SweepConfig, deconvolve};
/// let sweep = ExponentialSweep::new(SweepConfig { duration_s: 1.0, silence_s: 0.5, ..SweepConfig::default() })?;
/// // A loopback with half the amplitude and 20 ms of latency.
/// let mut recorded = vec![0.0; 960];
/// recorded.extend(sweep.playback()?.samples().iter().map(|x| 0.5 * x));
/// let found = deconvolve(&[Signal::new(recorded, 48_000)?], &sweep, &Default::default())?;
/// let response = &found.responses[0];
/// let peak = (0..response.samples().len()).max_by(|&a, &b| response.samples()[a].total_cmp(&response.samples()[b]));
/// let arrival_s = found.start_s + peak.unwrap() as f64 / 48e3;
/// assert!((arrival_s - 0.02).abs() < 1e-4);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
///
/// # Errors
/// [`Error::Empty`] without channels, [`Error::Length`] where their lengths differ, [`Error::SampleRates`] where the rate is not
/// that of the sweep; [`Error::Sweep`] for a recording that is silent, clipped, too short, begun too late, not one of this sweep, or of another
/// clock, and where repetitions differ ([`SweepError`]). Of several channels the loudest decides about sweep, clock and
/// repetitions. From a single sweep a difference of the clocks is told if it stretches the sweep by at least 1 ms, from several if
/// they drift by a quarter of a sample from first to last. Two repetitions must agree within -20 dB; of more, one must not differ by 6 dB
/// more than is usual among them.
pub fn deconvolve(
    channels: &[Signal],
    sweep: &ExponentialSweep,
    config: &DeconvolutionConfig,
) -> Result<SweepMeasurement, Error> {
    let loudest = check(channels, sweep)?;
    let rate = f64::from(sweep.config().sample_rate_hz);
    let samples: Vec<Vec<f64>> =
        channels.iter().map(|c| c.samples().iter().copied().map(f64::from).collect()).collect();
    let start = locate(&samples[loudest], sweep)?;
    let recorded = samples[0].len();
    let count = sweep.config().repetitions;
    let last = start + (count - 1) * sweep.period();
    let one = sweep.samples().len();
    let tail = (LEAST_TAIL_S * rate) as usize;
    let needed = last + one + (BEFORE_S * rate) as usize + tail;
    if recorded < needed {
        return Err(too_short(needed, recorded, rate));
    }
    // Between repetitions what follows belongs to the next one.
    let length = if count == 1 { recorded - start } else { sweep.period().min(recorded - last) };
    let inverse = Inverse::new(sweep, length + one);
    let of_channel = |samples: &[f64]| -> Vec<Vec<f64>> {
        (0..count)
            .map(|k| {
                let from = start + k * sweep.period();
                let mut response = inverse.deconvolve(&samples[from..from + length]);
                response.truncate(length - one);
                response
            })
            .collect()
    };
    let judged = Repetitions::judge(&of_channel(&samples[loudest]), sweep, config)?;
    if count == 1 && !config.allow_clock_drift {
        alignment::check_clock(&of_channel(&samples[loudest])[0], sweep)?;
    }
    let responses = samples
        .iter()
        .map(|samples| ImpulseResponse::new(judged.mean(&of_channel(samples)), sweep.config().sample_rate_hz))
        .collect::<Result<_, _>>()?;
    Ok(SweepMeasurement {
        responses,
        start_s: start as f64 / rate,
        differences_db: judged.differences_db,
        left_out: judged.left_out,
        clock_drift_ppm: judged.clock_drift_ppm,
    })
}

/// Checks what does not need a deconvolution, and says which channel is the loudest.
fn check(channels: &[Signal], sweep: &ExponentialSweep) -> Result<usize, Error> {
    let first = channels.first().ok_or(Error::Empty { what: "the list of channels" })?;
    let energy = |c: &Signal| c.samples().iter().map(|&x| f64::from(x).powi(2)).sum::<f64>();
    let mut loudest = (0, 0.0);
    for (i, channel) in channels.iter().enumerate() {
        check_rates(sweep.config().sample_rate_hz, channel.sample_rate_hz())?;
        let (expected, found) = (first.samples().len(), channel.samples().len());
        if found != expected {
            return Err(Error::Length { expected, found });
        }
        clipping::check(i, channel.samples())?;
        let energy = energy(channel);
        if energy > loudest.1 {
            loudest = (i, energy);
        }
    }
    if loudest.1 <= 0.0 {
        return Err(SweepError::Silent.into());
    }
    let rate = f64::from(sweep.config().sample_rate_hz);
    let tail = (LEAST_TAIL_S * rate) as usize;
    let needed = (sweep.config().repetitions - 1) * sweep.period() + sweep.samples().len() + tail;
    let recorded = first.samples().len();
    if recorded < needed { Err(too_short(needed, recorded, rate)) } else { Ok(loudest.0) }
}

fn too_short(needed: usize, recorded: usize, rate: f64) -> Error {
    SweepError::TooShort { needed_s: needed as f64 / rate, available_s: recorded as f64 / rate }.into()
}

/// Sample of the recording at which what belongs to the first sweep begins: 50 ms before its onset.
fn locate(samples: &[f64], sweep: &ExponentialSweep) -> Result<usize, Error> {
    let rate = f64::from(sweep.config().sample_rate_hz);
    let one = sweep.samples().len();
    let inverse = Inverse::new(sweep, samples.len() + one);
    let mut deconvolved = inverse.deconvolve(samples);
    // Negative times first: as many as the sweep has samples.
    let negative = one.min(deconvolved.len() - samples.len());
    let end = deconvolved.len();
    deconvolved.rotate_right(negative);
    deconvolved.truncate((samples.len() + negative).min(end));
    let peak = first_peak(&deconvolved, sweep, rate);
    let threshold = ONSET_SHARE * deconvolved[peak].abs();
    let earliest = peak.saturating_sub((ONSET_REACH_S * rate) as usize);
    let onset = (earliest..=peak).find(|&i| deconvolved[i].abs() >= threshold).unwrap_or(peak);
    // The first sweep alone: the others arrive where they should not.
    let alone = &deconvolved[..(peak + sweep.period() / 2).max(one).min(deconvolved.len())];
    let several = sweep.config().repetitions > 1;
    alignment::check_arrivals(if several { alone } else { &deconvolved }, sweep)?;
    // A pulse of the sweep's bandwidth B rings before its peak within an envelope 1 / (pi B t): what has no latency begins early.
    let bandwidth_hz = sweep.config().to_hz - sweep.config().from_hz;
    let ringing = (rate / (std::f64::consts::PI * ONSET_SHARE * bandwidth_hz)).ceil() as usize;
    if onset + ringing < negative {
        return Err(SweepError::StartsLate { late_s: (negative - onset) as f64 / rate }.into());
    }
    Ok(onset.saturating_sub(negative + (BEFORE_S * rate) as usize))
}

/// The largest sample of the first repetition's response, in the deconvolved recording of all.
fn first_peak(deconvolved: &[f64], sweep: &ExponentialSweep, rate: f64) -> usize {
    let magnitude = |i: &usize| deconvolved[*i].abs();
    let Some(largest) = (0..deconvolved.len()).max_by(|a, b| magnitude(a).total_cmp(&magnitude(b))) else {
        return 0;
    };
    let around = (0.002 * rate) as usize;
    let near = |centre: usize| {
        let range = centre.saturating_sub(around)..(centre + around + 1).min(deconvolved.len());
        range.max_by(|a, b| magnitude(a).total_cmp(&magnitude(b)))
    };
    let (count, period) = (sweep.config().repetitions, sweep.period());
    // The largest may be that of any repetition: the right one has all others at their places.
    let candidates = (0..count).filter_map(|k| largest.checked_sub(k * period));
    let score = |first: usize| -> f64 {
        (0..count).filter_map(|k| near(first + k * period)).map(|i| deconvolved[i].abs()).sum()
    };
    let best = candidates.max_by(|&a, &b| score(a).total_cmp(&score(b))).unwrap_or(largest);
    near(best).unwrap_or(best)
}

/// What a recording's spectrum is multiplied by.
struct Inverse {
    bins: Vec<Complex<f64>>,
    length: usize,
    rate_hz: u32,
}

impl Inverse {
    /// For recordings and responses of so many samples together.
    fn new(sweep: &ExponentialSweep, samples: usize) -> Self {
        let rate_hz = sweep.config().sample_rate_hz;
        let length = fast_len(samples);
        let signal: Vec<f64> = sweep.samples().iter().copied().map(f64::from).collect();
        let spectrum = Spectrum::with_length(&signal, rate_hz, length);
        let (from_hz, to_hz) = (sweep.config().from_hz, sweep.config().to_hz);
        let bins = spectrum
            .bins()
            .map(|(hz, bin)| {
                // 0 at the ends of the range and beyond, 1 within.
                let inside = (hz / from_hz).min(to_hz / hz).max(1.0).ln() / EDGE.ln();
                let share = WITHIN.powf(inside.min(1.0));
                bin.conj() / (bin.norm_sqr() + share * sweep.spectrum_power(hz))
            })
            .collect();
        Self { bins, length, rate_hz }
    }

    /// The recording over the sweep; negative times at the end.
    fn deconvolve(&self, recorded: &[f64]) -> Vec<f64> {
        Spectrum::with_length(recorded, self.rate_hz, self.length).changed(|i, _, bin| bin * self.bins[i])
    }
}
