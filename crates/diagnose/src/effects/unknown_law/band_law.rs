//! How the amplitude of a law goes with the octave.

use crate::survey::Survey;
use sabine_acoustics::Bands;
use sabine_paths::laws::LawParameter;

/// Standard deviation of the prior of an amplitude, in dB: 90 % lie within ten.
const AMPLITUDE_SD_DB: f64 = 6.0;
/// The same of its change from octave to octave.
const PER_OCTAVE_SD_DB: f64 = 1.5;
/// Frequency at which an amplitude that changes by octaves is stated.
const AT_HZ: f64 = 1000.0;
/// Quality of a resonance: half of its greatest value a third of an octave from its middle.
const QUALITY: f64 = 2.0;

/// The amplitude over the bands of a room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BandLaw {
    /// The same in all.
    Same,
    /// Nothing at 1 kHz, up or down evenly from octave to octave.
    Octaves,
    /// Both: two terms.
    SameAndOctaves,
    /// In bands from this one on.
    Above(usize),
    /// In bands below this one.
    Below(usize),
    /// With the square of the frequency.
    Square,
    /// About the middle of this band.
    Resonance(usize),
}

/// One parameter of a band law: name, unit, standard deviation beforehand, greatest value, and its share in each band.
pub(crate) struct BandTerm {
    pub name: &'static str,
    pub sd_db: f64,
    pub most_db: f64,
    pub shares: Vec<f64>,
}

impl BandLaw {
    /// All of these bands, each with its share of the probability beforehand; the shares sum to one.
    pub fn all(bands: usize) -> Vec<(Self, f64)> {
        if bands < 2 {
            return vec![(Self::Same, 1.0)];
        }
        let edges = (bands - 1) as f64;
        let mut all =
            vec![(Self::Same, 0.3), (Self::Octaves, 0.1), (Self::SameAndOctaves, 0.15), (Self::Square, 0.1)];
        all.extend((1..bands).map(|k| (Self::Above(k), 0.15 / edges)));
        all.extend((1..bands).map(|k| (Self::Below(k), 0.1 / edges)));
        all.extend((0..bands).map(|k| (Self::Resonance(k), 0.1 / bands as f64)));
        all
    }

    /// Its parameters.
    pub fn terms(self, survey: &Survey) -> Vec<BandTerm> {
        let bands = survey.bands();
        let over = |share: &dyn Fn(usize) -> f64| (0..bands.len()).map(share).collect();
        let amplitude = |name: &'static str, shares: Vec<f64>| BandTerm {
            name,
            sd_db: AMPLITUDE_SD_DB,
            most_db: super::MOST_DB,
            shares,
        };
        let flat = |share: &dyn Fn(usize) -> f64| vec![amplitude("amplitude", over(share))];
        let by_octave = || BandTerm {
            name: "amplitude_per_octave",
            sd_db: PER_OCTAVE_SD_DB,
            most_db: super::MOST_PER_OCTAVE_DB,
            // Nominal centres are what a formula knows.
            shares: over(&|band| (bands.nominal_hz(band) / AT_HZ).log2()),
        };
        match self {
            Self::Same => flat(&|_| 1.0),
            Self::Octaves => vec![by_octave()],
            Self::SameAndOctaves => vec![amplitude("amplitude_1_khz", over(&|_| 1.0)), by_octave()],
            Self::Above(edge) => flat(&|band| f64::from(u8::from(band >= edge))),
            Self::Below(edge) => flat(&|band| f64::from(u8::from(band < edge))),
            Self::Square => flat(&|band| (bands.nominal_hz(band) / top_hz(bands)).powi(2)),
            Self::Resonance(own) => {
                let ratio = |band: usize| bands.nominal_hz(band) / bands.nominal_hz(own);
                flat(&|band| 1.0 / (1.0 + QUALITY.powi(2) * (ratio(band) - 1.0 / ratio(band)).powi(2)))
            }
        }
    }

    /// The factor before the covariate in a formula, and its parameters, given those that were fitted (in dB) and the range of the
    /// amplitude.
    pub fn factor(
        self,
        bands: Bands,
        fitted: &[LawParameter],
        (low, high): (f64, f64),
    ) -> (String, Vec<(&'static str, LawParameter)>) {
        let known = |value: f64, unit: &str| LawParameter::new(value, [value; 2], unit);
        let amplitude = ("a", fitted[0].clone());
        let edge = |above: usize| {
            let ends = [bands.nominal_hz(above - 1), bands.nominal_hz(above)];
            ("f0", LawParameter::new((ends[0] * ends[1]).sqrt(), ends, "Hz"))
        };
        // As far as amplitudes are sought, so that what renders is what was fitted.
        let limited = |text: &str| format!("-min(max({text}, low), high)");
        let limits =
            || vec![("low", known(low, "dB")), ("high", known(high, "dB")), ("f", known(AT_HZ, "Hz"))];
        let octaves = "ln(frequency_hz / f) / 0.6931471805599453";
        match self {
            Self::Same => ("-a".to_owned(), vec![amplitude]),
            Self::Octaves => {
                let mut parameters = limits();
                parameters.push(("b", fitted[0].clone()));
                (limited(&format!("b * {octaves}")), parameters)
            }
            Self::SameAndOctaves => {
                let mut parameters = limits();
                parameters.extend([amplitude, ("b", fitted[1].clone())]);
                (limited(&format!("a + b * {octaves}")), parameters)
            }
            Self::Above(k) => ("-a * above(frequency_hz, f0)".to_owned(), vec![amplitude, edge(k)]),
            Self::Below(k) => ("-a * below(frequency_hz, f0)".to_owned(), vec![amplitude, edge(k)]),
            Self::Square => {
                ("-a * (frequency_hz / f)^2".to_owned(), vec![amplitude, ("f", known(top_hz(bands), "Hz"))])
            }
            Self::Resonance(own) => {
                let (f0, q) = (known(bands.nominal_hz(own), "Hz"), known(QUALITY, "1"));
                ("-a * resonance(frequency_hz, f0, q)".to_owned(), vec![amplitude, ("f0", f0), ("q", q)])
            }
        }
    }

    /// Where it acts, in words that follow a sentence; empty where it acts everywhere.
    pub fn words(self, bands: Bands) -> String {
        let hz = |band: usize| bands.nominal_hz(band);
        match self {
            Self::Same | Self::SameAndOctaves => String::new(),
            Self::Octaves => ", up and down from octave to octave about 1 kHz".to_owned(),
            Self::Above(k) => format!(", from {} Hz up", hz(k)),
            Self::Below(k) => format!(", up to {} Hz", hz(k - 1)),
            Self::Square => ", with the square of the frequency".to_owned(),
            Self::Resonance(own) => format!(", about {} Hz", hz(own)),
        }
    }
}

fn top_hz(bands: Bands) -> f64 {
    bands.nominal_hz(bands.len() - 1)
}
