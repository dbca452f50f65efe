//! What the assessors hear: Tang et al. 2020, section 5.4.

use crate::failure::Failure;
use ebur128::{EbuR128, Mode};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use sabine::acoustics::{
    BandParameters, Bands, EnergyDecayCurve, ImpulseResponse, Onset, PerBand, Reading, RoomParameters,
    Signal, resample, resample_response,
};
use sabine::eqfilter::{EqFilter, convolve};
use sabine::{Recording, RoomMatch};
use serde::Serialize;

/// The stimuli of each item, in the order of [`Item::stimuli`]; `reference` is the explicit one and the hidden one.
pub const CONDITIONS: [&str; 5] = ["reference", "low_anchor", "mid_anchor", "t60", "t60_eq"];

/// Reverberation time of the mid-range anchor in every octave, in seconds: a typical conference room (section 5.4).
const MID_ANCHOR_T60_S: f64 = 0.5;
/// Length of its response: 120 dB of decay.
const MID_ANCHOR_S: f64 = 1.0;
/// What belongs to the direct sound of a response, in seconds after its peak (as [`BandParameters::drr_db`]).
const DIRECT_S: f64 = 0.0025;
/// Kept before the onset, in seconds.
const LEAD_S: f64 = 0.001;
/// Silence in the end belongs to the stimulus: the room rings on for its reverberation time, but not longer than this.
const LONGEST_TAIL_S: f64 = 2.0;
/// Fade at the end, in seconds.
const FADE_S: f64 = 0.05;
/// Loudness of every stimulus, in LUFS (EBU R 128).
const LOUDNESS_LUFS: f64 = -23.0;
/// Largest sample: the loudness of all stimuli of an item gives way to it.
const FULL_SCALE: f32 = 0.95;
/// Longest stimulus that webMUSHRA takes, in seconds; ITU-R BS.1534-3 advises about ten.
const LONGEST_S: f64 = 12.0;

/// A stimulus that would make no fair test.
#[derive(Debug, thiserror::Error)]
pub enum StimulusError {
    /// Dry speech that is too long.
    #[error(
        "{recording}: with its reverberation {duration_s:.1} s long; at most {LONGEST_S} s are allowed in a test"
    )]
    TooLong { recording: String, duration_s: f64 },
    /// Dry speech without loudness.
    #[error("{recording}: {condition} has no loudness: it is silent or shorter than 0.4 s")]
    NoLoudness { recording: String, condition: &'static str },
    /// The loudness cannot be measured.
    #[error("{recording}: {source}")]
    Loudness { recording: String, source: ebur128::Error },
    /// A response in which the direct sound cannot be found.
    #[error("{response}: {reason}")]
    NoOnset { response: &'static str, reason: sabine::acoustics::NoReading },
}

/// Responses behind the conditions, each beginning just before its direct sound, at one sample rate.
pub struct Responses {
    measured: ImpulseResponse,
    mid_anchor: ImpulseResponse,
    t60: ImpulseResponse,
    eq_filter: EqFilter,
    sample_rate_hz: u32,
}

/// One page of the test.
pub struct Item {
    /// Name in the configuration.
    pub name: String,
    /// In the order of [`CONDITIONS`], of one length and loudness.
    pub stimuli: Vec<Signal>,
    loudness_lufs: f64,
}

/// What was made, in numbers.
#[derive(Serialize)]
pub struct Summary {
    bands_hz: Vec<f64>,
    /// Reverberation time (T30) of the response behind each condition; null where it cannot be read.
    t60_s: Vec<(&'static str, Vec<Option<f64>>)>,
    sample_rate_hz: u32,
    items: Vec<ItemSummary>,
}

#[derive(Serialize)]
struct ItemSummary {
    name: String,
    duration_s: f64,
    loudness_lufs: f64,
    largest_sample: Vec<f32>,
}

impl Responses {
    /// Takes the measured response as the truth; `seed` draws the noise of the mid-range anchor.
    pub fn new(measured: ImpulseResponse, matched: &RoomMatch, seed: u64) -> Result<Self, Failure> {
        let sample_rate_hz = matched.response.sample_rate_hz();
        let measured = from_onset(&resample_response(&measured, sample_rate_hz)?, "measured response")?;
        let t60 = from_onset(&matched.response, "simulated response")?;
        let drr_db = BandParameters::full_band(&measured).drr_db.map_or(0.0, |drr| drr.value);
        let mid_anchor = decaying_noise(drr_db, sample_rate_hz, seed)?;
        Ok(Self { measured, mid_anchor, t60, eq_filter: matched.eq_filter.clone(), sample_rate_hz })
    }

    /// The numbers of the responses and of the items made with them.
    pub fn summary(&self, items: &[Item]) -> Result<Summary, Failure> {
        let read = |response: &ImpulseResponse| -> Result<Vec<Option<f64>>, Failure> {
            let t30_s: PerBand<Reading> = RoomParameters::measure(response, Bands::T60)?.t30_s;
            Ok(t30_s.values().iter().map(|t| t.as_ref().ok().map(|t| t.value)).collect())
        };
        let t60 = read(&self.t60)?;
        Ok(Summary {
            bands_hz: Bands::T60.iter_hz().collect(),
            t60_s: vec![
                ("reference", read(&self.measured)?),
                ("mid_anchor", read(&self.mid_anchor)?),
                ("t60", t60.clone()),
                ("t60_eq", t60),
            ],
            sample_rate_hz: self.sample_rate_hz,
            items: items.iter().map(Item::summary).collect(),
        })
    }

    /// Seconds after which nothing of the measured room is left to hear.
    fn tail_s(&self) -> f64 {
        let samples = self.measured.samples();
        let energy: Vec<f64> = samples.iter().map(|&s| f64::from(s) * f64::from(s)).collect();
        let decay = EnergyDecayCurve::from_energy(&energy, 1.0 / f64::from(self.sample_rate_hz));
        let levels_db = decay.level_db();
        let heard = levels_db.iter().position(|&db| db < -60.0).unwrap_or(samples.len());
        (heard as f64 / f64::from(self.sample_rate_hz)).min(LONGEST_TAIL_S)
    }
}

/// The response from just before its direct sound.
fn from_onset(response: &ImpulseResponse, name: &'static str) -> Result<ImpulseResponse, Failure> {
    let rate = response.sample_rate_hz();
    let onset = Onset::find(response.samples(), rate)
        .map_err(|reason| StimulusError::NoOnset { response: name, reason })?;
    let first = onset.index.saturating_sub((LEAD_S * f64::from(rate)) as usize);
    Ok(ImpulseResponse::new(response.samples()[first..].to_vec(), rate)?)
}

/// A pulse, and white noise that decays by 60 dB in [`MID_ANCHOR_T60_S`]: one decay and no colour in all octaves. The ratio
/// of pulse to noise is that of the room, so that the anchor differs from it in what the test is about.
fn decaying_noise(drr_db: f64, sample_rate_hz: u32, seed: u64) -> Result<ImpulseResponse, Failure> {
    let rate = f64::from(sample_rate_hz);
    let lead = (LEAD_S * rate) as usize;
    let mut random = Pcg64::seed_from_u64(seed);
    let mut tail: Vec<f64> = (0..(MID_ANCHOR_S * rate) as usize)
        .map(|i| {
            let noise: f64 = StandardNormal.sample(&mut random);
            noise * 10f64.powf(-3.0 * i as f64 / rate / MID_ANCHOR_T60_S)
        })
        .collect();
    let energy: f64 = tail.iter().map(|s| s * s).sum();
    let gain = (10f64.powf(-drr_db / 10.0) / energy).sqrt();
    tail.iter_mut().for_each(|s| *s *= gain);
    let mut samples = vec![0.0; lead + (DIRECT_S * rate) as usize + 1];
    samples[lead] = 1.0;
    samples.extend(tail.into_iter().map(|s| s as f32));
    Ok(ImpulseResponse::new(samples, sample_rate_hz)?)
}

impl Item {
    /// Renders one piece of dry speech in all conditions.
    pub fn new(name: &str, dry: &Recording<'_>, responses: &Responses) -> Result<Self, Failure> {
        dry.check_not_silent()?;
        let rate = responses.sample_rate_hz;
        let speech = resample(dry.signal, rate)?;
        let length = speech.samples().len() + (responses.tail_s() * f64::from(rate)) as usize;
        let duration_s = length as f64 / f64::from(rate);
        if duration_s > LONGEST_S {
            return Err(StimulusError::TooLong { recording: dry.name.to_owned(), duration_s }.into());
        }
        let mut anechoic = vec![0.0; (LEAD_S * f64::from(rate)) as usize];
        anechoic.extend_from_slice(speech.samples());
        let simulated = convolve(speech.samples(), responses.t60.samples());
        let equalised = responses.eq_filter.apply(&Signal::new(simulated.clone(), rate)?)?.into_samples();
        let sounds = [
            convolve(speech.samples(), responses.measured.samples()),
            anechoic,
            convolve(speech.samples(), responses.mid_anchor.samples()),
            simulated,
            equalised,
        ];
        let mut levelled = Vec::new();
        for (condition, mut sound) in CONDITIONS.into_iter().zip(sounds) {
            sound.resize(length, 0.0);
            fade(&mut sound, (FADE_S * f64::from(rate)) as usize);
            let loudness = loudness_lufs(&sound, rate)
                .map_err(|source| StimulusError::Loudness { recording: dry.name.to_owned(), source })?;
            if !loudness.is_finite() {
                return Err(StimulusError::NoLoudness { recording: dry.name.to_owned(), condition }.into());
            }
            let gain = 10f64.powf((LOUDNESS_LUFS - loudness) / 20.0) as f32;
            sound.iter_mut().for_each(|s| *s *= gain);
            levelled.push(sound);
        }
        // One gain for all, so that they stay equally loud.
        let peak = levelled.iter().flatten().fold(0.0f32, |peak, s| peak.max(s.abs()));
        let gain = (FULL_SCALE / peak).min(1.0);
        let stimuli = levelled
            .into_iter()
            .map(|sound| Signal::new(sound.into_iter().map(|s| s * gain).collect(), rate))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            name: name.to_owned(),
            stimuli,
            loudness_lufs: LOUDNESS_LUFS + 20.0 * f64::from(gain).log10(),
        })
    }

    fn summary(&self) -> ItemSummary {
        ItemSummary {
            name: self.name.clone(),
            duration_s: self.stimuli[0].duration_s(),
            loudness_lufs: self.loudness_lufs,
            largest_sample: self.stimuli.iter().map(Signal::peak).collect(),
        }
    }
}

/// Integrated loudness with gating (ITU-R BS.1770-4); minus infinity where nothing passes the gate.
fn loudness_lufs(sound: &[f32], sample_rate_hz: u32) -> Result<f64, ebur128::Error> {
    let mut meter = EbuR128::new(1, sample_rate_hz, Mode::I)?;
    meter.add_frames_f32(sound)?;
    meter.loudness_global()
}

fn fade(sound: &mut [f32], length: usize) {
    let length = length.min(sound.len());
    for (i, s) in sound.iter_mut().rev().take(length).enumerate() {
        *s *= (0.5 - 0.5 * (std::f64::consts::PI * i as f64 / length as f64).cos()) as f32;
    }
}

impl Summary {
    /// The table of what each condition decays like.
    pub fn print(&self) {
        let centres: String = self.bands_hz.iter().map(|hz| format!("{hz:>7}")).collect();
        println!("{:14}{centres}", "octave");
        for (condition, t60_s) in &self.t60_s {
            let cell = |t: &Option<f64>| t.map_or_else(|| format!("{:>7}", "-"), |t| format!("{t:>7.2}"));
            println!("T60 {condition:10}{} s", t60_s.iter().map(cell).collect::<String>());
        }
        for item in &self.items {
            let (name, stimuli) = (&item.name, item.largest_sample.len());
            println!(
                "item {name}: {stimuli} stimuli of {:.1} s at {} Hz, each {:.1} LUFS",
                item.duration_s, self.sample_rate_hz, item.loudness_lufs
            );
        }
    }
}
