//! Octave and third-octave bands as a value.

mod construction;

use std::ops::Range;

/// Nominal octave centres of IEC 61260-1 (Annex E), from 31.5 Hz to 16 kHz.
const OCTAVES_HZ: [f64; 10] = [31.5, 62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0];
/// Nominal third-octave centres of IEC 61260-1 (Annex E), from 25 Hz to 20 kHz.
const THIRD_OCTAVES_HZ: [f64; 30] = [
    25.0, 31.5, 40.0, 50.0, 62.5, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0, 315.0, 400.0, 500.0, 630.0, 800.0,
    1000.0, 1250.0, 1600.0, 2000.0, 2500.0, 3150.0, 4000.0, 5000.0, 6300.0, 8000.0, 10000.0, 12500.0,
    16000.0, 20000.0,
];
/// What a nominal centre may be off by, as a share: 62.5 and 63 Hz name the same band, as do 31.5 and 31.25 Hz.
const SAME_CENTRE: f64 = 0.01;

/// How wide the bands of a run are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Width {
    Octave,
    Third,
}

impl Width {
    fn nominal_hz(self) -> &'static [f64] {
        match self {
            Self::Octave => &OCTAVES_HZ,
            Self::Third => &THIRD_OCTAVES_HZ,
        }
    }

    /// Position of 1 kHz among the nominal centres.
    fn reference(self) -> i32 {
        match self {
            Self::Octave => 5,
            Self::Third => 16,
        }
    }

    /// Decades from one centre to the next (IEC 61260-1, 5.2, base ten).
    fn decades(self) -> f64 {
        match self {
            Self::Octave => 0.3,
            Self::Third => 0.1,
        }
    }

    /// The place of a nominal centre among all of this width.
    fn position(self, centre_hz: f64) -> Option<usize> {
        let same = |hz: &f64| (hz / centre_hz - 1.0).abs() < SAME_CENTRE;
        self.nominal_hz().iter().position(same)
    }
}

/// A contiguous run of octave or third-octave bands, named by their nominal centres (62.5 Hz stands for the nominal 63 Hz).
///
/// ```
/// use sabine_acoustics::Bands;
/// let octaves = Bands::octaves(125.0, 8000.0)?;
/// assert_eq!(octaves.len(), 7);
/// assert_eq!(octaves.nominal_hz(2), 500.0);
/// // IEC 61260-1: exact centres are powers of 10^(3/10) about 1 kHz, or of 10^(1/10).
/// assert!((octaves.exact_hz(0) - 125.89).abs() < 0.01);
/// let thirds = Bands::third_octaves(100.0, 10000.0)?;
/// assert_eq!(thirds.len(), 21);
/// assert!((thirds.edges_hz(0).0 / octaves.edges_hz(0).0 - 1.0).abs() < 1e-12);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bands {
    width: Width,
    first: u8,
    count: u8,
}

impl Bands {
    /// 125 Hz to 8 kHz: the seven octaves of the reverberation-time targets (Tang et al. 2020, section 3.3).
    pub const T60: Self = Self { width: Width::Octave, first: 2, count: 7 };
    /// 62.5 Hz to 4 kHz: the octaves of the equalisation targets; the value at 1 kHz is 0 dB by definition.
    pub const EQ: Self = Self { width: Width::Octave, first: 1, count: 7 };
    /// 62.5 Hz to 8 kHz: the eight octaves that are traced and rendered.
    pub const SIMULATION: Self = Self { width: Width::Octave, first: 1, count: 8 };

    /// The bands with these indices, as a run of its own.
    ///
    /// # Panics
    /// If there are none, or not all of them exist.
    #[must_use]
    pub fn part(&self, indices: Range<usize>) -> Self {
        assert!(
            indices.start < indices.end && indices.end <= self.len(),
            "bands {indices:?} of {}",
            self.len()
        );
        Self { first: self.first + indices.start as u8, count: indices.len() as u8, ..*self }
    }

    /// Bands in an octave: one or three.
    pub fn per_octave(&self) -> usize {
        match self.width {
            Width::Octave => 1,
            Width::Third => 3,
        }
    }

    /// Number of bands, at least one.
    #[allow(clippy::len_without_is_empty)] // never empty by construction
    pub fn len(&self) -> usize {
        usize::from(self.count)
    }

    /// Nominal centre of band `index` in Hz.
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn nominal_hz(&self, index: usize) -> f64 {
        assert!(index < self.len(), "band {index} of {}", self.len());
        self.width.nominal_hz()[usize::from(self.first) + index]
    }

    /// Exact mid-band frequency of band `index` in Hz (IEC 61260-1, 5.2, base ten).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn exact_hz(&self, index: usize) -> f64 {
        assert!(index < self.len(), "band {index} of {}", self.len());
        let steps = i32::from(self.first) + index as i32 - self.width.reference();
        1000.0 * 10f64.powf(self.width.decades() * f64::from(steps))
    }

    /// Lower and upper band-edge frequencies of band `index` in Hz (IEC 61260-1, 5.4).
    ///
    /// # Panics
    /// If `index >= self.len()`.
    pub fn edges_hz(&self, index: usize) -> (f64, f64) {
        let (centre, half) = (self.exact_hz(index), 10f64.powf(0.5 * self.width.decades()));
        (centre / half, centre * half)
    }

    /// Nominal centres in Hz, rising.
    pub fn iter_hz(&self) -> impl ExactSizeIterator<Item = f64> + Clone + use<> {
        self.width.nominal_hz()[usize::from(self.first)..][..self.len()].iter().copied()
    }

    /// Index of the band with this nominal centre, if it belongs to the run.
    pub fn index_of(&self, centre_hz: f64) -> Option<usize> {
        let index = self.width.position(centre_hz)?.checked_sub(usize::from(self.first))?;
        (index < self.len()).then_some(index)
    }

    /// Index of the band whose centre is nearest to a frequency, in the logarithm.
    pub fn nearest(&self, frequency_hz: f64) -> usize {
        let steps = (frequency_hz / self.exact_hz(0)).log10() / self.width.decades();
        // As a float at the ends: no frequency is out of range.
        steps.round().clamp(0.0, (self.len() - 1) as f64) as usize
    }
}
