//! Effects that mean nothing: a control. Whatever names one of them names by chance.

use sabine::diagnose::{BandView, Case, DecayTerm, Effect, EffectInfo, Parameter, Survey};

/// Identifiers of the shams.
pub const IDS: [&str; 14] = [
    "sham_01", "sham_02", "sham_03", "sham_04", "sham_05", "sham_06", "sham_07", "sham_08", "sham_09",
    "sham_10", "sham_11", "sham_12", "sham_13", "sham_14",
];
/// Standard deviation of a sham's size in dB: that of effects which are real.
const SIZE_DB: f64 = 3.0;

/// A wave over octaves and time of arbitrary direction and phase; every other sham also has a sign of its own at each receiver.
#[derive(Clone, Copy, Debug)]
pub struct Sham {
    number: usize,
}

impl Sham {
    /// The sham with an index into [`IDS`].
    pub fn new(number: usize) -> Self {
        Self { number: number % IDS.len() }
    }

    /// A number between 0 and 1 that belongs to this sham: the fractional parts of multiples of the golden section.
    fn arbitrary(self, which: usize) -> f64 {
        (0.618_033_988_749_895 * (31 * (self.number + 1) + 7 * which) as f64).fract()
    }

    fn db(self, octave: f64, time_s: f64, receiver: usize) -> f64 {
        let cycles_per_octave = 0.4 * self.arbitrary(0) - 0.2;
        let cycles_per_second = 6.0 * self.arbitrary(1) - 3.0;
        let phase = self.arbitrary(2) + cycles_per_octave * octave + cycles_per_second * time_s;
        let sign = if self.number % 2 == 1 && self.arbitrary(3 + receiver) < 0.5 { -1.0 } else { 1.0 };
        sign * (std::f64::consts::TAU * phase).cos()
    }
}

impl Effect for Sham {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(IDS[self.number], "Control", "Nothing: this is a control.")
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let size = Parameter::new("size", "dB", 0.0, SIZE_DB, (-20.0, 20.0)).typically(SIZE_DB);
        vec![Case::decay(vec![size], *self)]
    }
}

impl DecayTerm for Sham {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let octave = view.survey().octaves_from_1khz(view.band());
        let receiver = view.pair().receiver;
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += values[0] * self.db(octave, view.time_s(bin), receiver) * std::f64::consts::LN_10 / 10.0;
        }
    }
}
