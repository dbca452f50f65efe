//! What responses hold before their direct sound.

use crate::survey::Survey;

/// Shortest bin, in seconds.
const BIN_S: f64 = 0.02;
/// Length of a bin in units of one over the bandwidth.
const BANDWIDTH_TIMES: f64 = 2.0;
/// The filters' ringing before the direct sound, in units of one over the bandwidth: nothing is compared so late.
const RINGING_BANDWIDTH_TIMES: f64 = 6.0;
/// Nor within so long before it, in seconds: steep filters of converters and of whoever prepared the recording ring, too.
const GUARD_S: f64 = 0.06;
/// Bins that a band of a response must have before its direct sound to count.
const MIN_BINS: usize = 4;
/// A copy of a decay is never predicted better, as a share of its energy.
const MODEL_SD: f64 = 0.15;
/// A bin with less than this share of the energy of the whole decay counts as having so much: nobody minds harmonics at -65 dB, and
/// filters without phase shift that a recording has been through leave as much long before the direct sound.
const SILENCE: f64 = 3e-7;

/// One band of one response: energy before the direct sound, and the decay after it.
#[derive(Clone, Debug)]
pub(crate) struct PreArrivalBand {
    pub octaves_from_1khz: f64,
    /// Energy of each bin, the last before the direct sound first.
    pub energies: Vec<f64>,
    /// Where the first of them ends, in seconds before the direct sound, and how long they are.
    end_s: f64,
    bin_s: f64,
    /// Degrees of freedom of the energy of a bin, halved.
    pub shape: f64,
    /// Energy between the end of the lead-in and each sample after it.
    after: Vec<f64>,
    rate_hz: f64,
}

impl PreArrivalBand {
    /// None where too little comes before the direct sound. `samples` are those of the band, `direct` the direct sound's place among them.
    pub fn new(
        samples: &[f32],
        direct: f64,
        rate_hz: f64,
        bandwidth_hz: f64,
        octaves_from_1khz: f64,
    ) -> Option<Self> {
        let bin_s = BIN_S.max(BANDWIDTH_TIMES / bandwidth_hz);
        let end_s = GUARD_S.max(RINGING_BANDWIDTH_TIMES / bandwidth_hz);
        let count = ((direct / rate_hz - end_s) / bin_s).floor();
        if count < MIN_BINS as f64 {
            return None;
        }
        let first = (direct - end_s * rate_hz).round() as usize;
        let square = |x: &f32| f64::from(*x).powi(2);
        let length = (bin_s * rate_hz) as usize;
        let energies = (1..=count as usize)
            .map(|k| samples.get(first.checked_sub(k * length)?..first - (k - 1) * length))
            .map(|bin| bin.map(|bin| bin.iter().map(square).sum()))
            .collect::<Option<Vec<f64>>>()?;
        let mut sum = 0.0;
        let after = std::iter::once(0.0)
            .chain(samples.get(first..)?.iter().map(|x| {
                sum += square(x);
                sum
            }))
            .collect();
        let bin_s = length as f64 / rate_hz;
        let shape = 1.0 / (1.0 / (bandwidth_hz * bin_s) + MODEL_SD * MODEL_SD);
        Some(Self { octaves_from_1khz, energies, end_s, bin_s, shape, after, rate_hz })
    }

    pub fn length_s(&self) -> f64 {
        self.end_s + self.bin_s * self.energies.len() as f64
    }

    /// Energy that the decay would have in a bin if it came so much earlier.
    pub fn earlier(&self, bin: usize, lead_s: f64) -> f64 {
        let until = |time_s: f64| {
            let at = (time_s * self.rate_hz).clamp(0.0, (self.after.len() - 1) as f64);
            let index = (at as usize).min(self.after.len().saturating_sub(2));
            let low = self.after[index];
            low + (self.after.get(index + 1).unwrap_or(&low) - low) * (at - index as f64)
        };
        // Times of the copy after the end of the lead-in.
        let end_s = lead_s - self.bin_s * bin as f64;
        until(end_s) - until(end_s - self.bin_s)
    }

    /// Energy of a bin that counts as nothing.
    pub fn silence(&self) -> f64 {
        SILENCE * self.after.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE)
    }

    pub fn quiet(&self) -> f64 {
        let mut sorted = self.energies.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 4].max(self.silence())
    }
}

/// What responses hold before their direct sound, by octave.
#[derive(Debug, Default)]
pub struct PreArrival {
    /// `[response][band]`; bands in which too little precedes the direct sound are left out.
    pub(crate) responses: Vec<Vec<PreArrivalBand>>,
}

impl PreArrival {
    /// Whether any response has enough before its direct sound.
    pub(crate) fn any(survey: &Survey) -> bool {
        let bands = survey.bands();
        let (low, high) = bands.edges_hz(bands.len() - 1);
        let least_s = GUARD_S.max(RINGING_BANDWIDTH_TIMES / (high - low)) + BIN_S * MIN_BINS as f64;
        survey.responses().iter().any(|r| r.direct_s > least_s)
    }
}

/// The lead-in of every band of a response, given its filtered samples.
pub(crate) fn of_response(
    filtered: &[Vec<f32>],
    complete: &dyn Fn(usize) -> bool,
    bands: sabine_acoustics::Bands,
    direct: f64,
    rate_hz: f64,
) -> Vec<PreArrivalBand> {
    (0..bands.len())
        .filter(|&band| complete(band))
        .filter_map(|band| {
            let (low, high) = bands.edges_hz(band);
            let octaves = (bands.exact_hz(band) / 1000.0).log2();
            PreArrivalBand::new(&filtered[band], direct, rate_hz, high - low, octaves)
        })
        .collect()
}
