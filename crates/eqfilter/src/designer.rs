//! The linear-phase design that corrects for its own smoothing.

use crate::grid::{Grid, kaiser_half};
use crate::octave::active_bands;
use crate::solve::{Problem, solve};
use crate::{EqFilter, EqFilterConfig, Error};
use sabine_acoustics::{Bands, PerBand};

/// Parts that an octave is made of.
const PARTS_PER_OCTAVE: i32 = 5;

/// Designs linear-phase filters for one set of bands, sample rate and delay; planned once, run many times.
///
/// A filter is a sum of narrow windowed band-passes, five to an octave. The power that it passes in an octave is then a quadratic
/// form in the amplitudes of these parts, and the amplitudes that *realise* the wanted gains, after all smoothing by the
/// finite length, solve one small equation for each octave. The design starts from gains joined by straight lines in
/// dB over the logarithm of frequency and makes the least smooth change to them that solves the equations (Newton steps, three as
/// a rule). Where nothing does, it comes near, and [`EqFilter::realised_db`] says what it gives.
///
/// ```
/// use sabine_acoustics::{Bands, PerBand};
/// use sabine_eqfilter::{EqDesigner, EqFilterConfig};
/// let designer = EqDesigner::new(Bands::T60, 48_000, EqFilterConfig::default())?;
/// for tilt_db in [-3.0, 0.0, 3.0] {
///     let gains = PerBand::from_fn(designer.bands(), |band| tilt_db * band as f64);
///     let filter = designer.design(&gains)?;
///     assert!((filter.realised_db().at_hz(125.0).unwrap().unwrap() - 0.0).abs() < 0.01);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct EqDesigner {
    bands: Bands,
    sample_rate_hz: u32,
    config: EqFilterConfig,
    /// Samples on either side of the middle tap.
    half: usize,
    /// Centre of each part, in octaves above the lowest band; rising.
    centres_octaves: Vec<f64>,
    /// Number of bands whose gain is set.
    active: usize,
    /// Right half, middle tap first, of each part; the last is the part above the bands if there is one.
    parts: Vec<Vec<f64>>,
    problem: Problem,
}

impl EqDesigner {
    /// Plans designs for gains at these bands.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting out of its range, [`Error::AboveOverlaps`] if `config.above` starts at a band that
    /// is among `bands`, [`Error::NothingBelowNyquist`] if no band's centre lies below half the sample rate,
    /// [`Error::Acoustics`] for an unknown octave.
    pub fn new(bands: Bands, sample_rate_hz: u32, config: EqFilterConfig) -> Result<Self, Error> {
        let half = config.check(bands, sample_rate_hz)?;
        let active = active_bands(bands, sample_rate_hz);
        let (lowest_hz, nyquist_hz) = (bands.exact_hz(0), f64::from(sample_rate_hz) / 2.0);
        let octave = bands.edges_hz(0).1 / bands.edges_hz(0).0;
        let to_hz = |octaves: f64| lowest_hz * octave.powf(octaves);
        // One part below the lowest octave, so that it has a slope on either side.
        let from = -(PARTS_PER_OCTAVE / 2) - 1;
        let to = PARTS_PER_OCTAVE * (active as i32 - 1) + PARTS_PER_OCTAVE / 2;
        let mut centres_octaves: Vec<f64> = (from..=to)
            .map(|i| f64::from(i) / f64::from(PARTS_PER_OCTAVE))
            .filter(|&octaves| to_hz(octaves) < nyquist_hz)
            .collect();
        let free = centres_octaves.len();
        if let Some(above) = config.above {
            let from_hz = Bands::octaves(above.from_band_hz, above.from_band_hz)?.exact_hz(0);
            // It begins where the lowest part of its lowest octave would lie.
            let octaves = (from_hz / lowest_hz).ln() / octave.ln() - 2.0 / f64::from(PARTS_PER_OCTAVE);
            if to_hz(octaves) < nyquist_hz {
                centres_octaves.push(octaves);
            }
        }
        let centres_hz: Vec<f64> = centres_octaves.iter().map(|&octaves| to_hz(octaves)).collect();
        let grid = Grid::new(half, sample_rate_hz);
        let window = kaiser_half(half);
        let (parts, responses): (Vec<_>, Vec<_>) =
            (0..centres_hz.len()).map(|i| grid.part(&centres_hz, i, &window)).unzip();
        let power = (0..active).map(|b| grid.power_form(bands, b, &responses)).collect();
        let problem = Problem::new(power, &centres_octaves, free);
        Ok(Self { bands, sample_rate_hz, config, half, centres_octaves, active, parts, problem })
    }

    /// Whether it was planned for these.
    pub(crate) fn is_for(&self, bands: Bands, sample_rate_hz: u32, config: EqFilterConfig) -> bool {
        self.bands == bands && self.sample_rate_hz == sample_rate_hz && self.config == config
    }

    /// The bands that it takes gains for.
    pub fn bands(&self) -> Bands {
        self.bands
    }

    /// Taps of the filters that it designs: odd.
    pub fn taps(&self) -> usize {
        2 * self.half + 1
    }

    /// The filter whose octave-band gains are these, in dB. Gains of bands whose centre lies above half the sample rate have
    /// no effect.
    ///
    /// # Errors
    /// [`Error::Bands`] for other bands than planned, [`Error::Gain`] for a gain that is not finite or beyond 120 dB.
    pub fn design(&self, gains_db: &PerBand<f64>) -> Result<EqFilter, Error> {
        if gains_db.bands() != self.bands {
            return Err(Error::Bands {
                planned: self.bands.len(),
                planned_first_hz: self.bands.nominal_hz(0),
                given: gains_db.bands().len(),
                given_first_hz: gains_db.bands().nominal_hz(0),
            });
        }
        check_gains(gains_db)?;
        let wanted_db = &gains_db.values()[..self.active];
        let start_db: Vec<f64> = self
            .centres_octaves
            .iter()
            .enumerate()
            .map(|(i, &octaves)| match self.config.above {
                Some(above) if i >= self.problem.free() => above.gain_db,
                _ => between(wanted_db, octaves),
            })
            .collect();
        let solution = solve(&self.problem, wanted_db, &start_db);
        let mut right = vec![0.0; self.half + 1];
        for (part, &amplitude) in self.parts.iter().zip(&solution.amplitudes) {
            for (sum, &tap) in right.iter_mut().zip(part) {
                *sum += amplitude * tap;
            }
        }
        let taps = right[1..].iter().rev().chain(&right).map(|&tap| tap as f32).collect();
        let realised = PerBand::from_fn(self.bands, |b| solution.realised_db.get(b).copied());
        Ok(EqFilter::linear(taps, self.sample_rate_hz, gains_db.clone(), realised))
    }
}

/// Values at 0, 1, 2, ... joined by straight lines, level beyond them.
fn between(values: &[f64], at: f64) -> f64 {
    let at = at.clamp(0.0, (values.len() - 1) as f64);
    let before = at as usize;
    let next = (before + 1).min(values.len() - 1);
    values[before] + (values[next] - values[before]) * (at - before as f64)
}

/// Checks each gain.
pub(crate) fn check_gains(gains_db: &PerBand<f64>) -> Result<(), Error> {
    match gains_db.iter().find(|(_, gain_db)| !(-120.0..=120.0).contains(*gain_db)) {
        Some((band_hz, &gain_db)) => Err(Error::Gain { band_hz, gain_db }),
        None => Ok(()),
    }
}
