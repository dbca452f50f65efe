//! A gain that a loud first sound has turned down, and that comes up again: an automatic gain control, a limiter.

use super::covariate::{Form, Scale, scaled};
use crate::effect::{DecayTerm, Parameter};
use crate::simulate::views::BandView;
use sabine_paths::laws::{Law, LawError, LawParameter, LawTarget};

/// How far a fit may move a time constant, as a factor either way: as far as the next that is screened. Which of two is screened best says
/// little of where between them the fit comes to rest.
const REACH: f64 = 2.0;

/// One of the releases that are screened; a fit moves its time constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Release {
    form: Form,
    time_s: f64,
}

/// `t` is its time constant.
const TEXT: &str = "exp(-time_after_direct_s / t)";

const fn release(name: &'static str, scales: &'static [Scale]) -> Release {
    Release { form: scaled(name, TEXT, scales), time_s: scales[0].1 }
}

impl Release {
    /// All that are screened, each of twice the time constant of the one before.
    pub const ALL: [Self; 4] = [
        release("release_60_ms", &[("t", 0.06, "s")]),
        release("release_120_ms", &[("t", 0.12, "s")]),
        release("release_240_ms", &[("t", 0.24, "s")]),
        release("release_480_ms", &[("t", 0.48, "s")]),
    ];

    pub fn form(self) -> Form {
        self.form
    }

    /// The time constants that a fit may find, in seconds.
    pub(super) fn times_s(self) -> [f64; 2] {
        [self.time_s / REACH, self.time_s * REACH]
    }

    /// Parameter of its fit behind the amplitude. Beforehand it is anywhere in its range.
    pub(super) fn parameter(self) -> Parameter {
        let [low, high] = self.times_s();
        Parameter::new("time_constant", "s", self.time_s, (high - low) / 12f64.sqrt(), (low, high))
            .with_floor()
            .with_ceiling()
    }

    /// The law of fitted parameters: amplitude, time constant.
    pub(super) fn law(self, [a, t]: [LawParameter; 2]) -> Result<Law, LawError> {
        let (verb, then) = if a.value < 0.0 { ("raised", "sinks") } else { ("turned down", "comes up") };
        let [low, high] = if a.value < 0.0 { [-a.high, -a.low] } else { [a.low, a.high] };
        let words = format!(
            "The gain of the recording is {verb} by {:.1} dB [{low:.1}, {high:.1}] at the direct sound and {then} again with a time constant of {:.2} s [{:.2}, {:.2}].",
            a.value.abs(),
            t.value,
            t.low,
            t.high
        );
        let own = [("a", a), ("t", t)];
        let law =
            Law::new(self.form.name.to_owned(), LawTarget::Recorder, None, &format!("-a * {TEXT}"), own)?;
        Ok(law.with_words(words))
    }
}

/// A release whose amplitude and time constant are fitted.
pub(super) struct FittedRelease;

impl DecayTerm for FittedRelease {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let taken = -super::formula::LN_PER_DB * values[0];
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += taken * (-view.after_direct_s(bin) / values[1]).exp();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn each_range_reaches_the_next_time_constant_that_is_screened() {
        for pair in Release::ALL.windows(2) {
            assert!(pair[0].times_s()[1] >= 0.999 * pair[1].time_s);
            assert!(pair[1].times_s()[0] <= 1.001 * pair[0].time_s);
        }
    }

    #[test]
    fn a_gain_that_is_turned_down_is_told_from_one_that_is_raised() {
        let law = |a: f64| {
            let [amplitude, time] =
                [(a, "dB"), (0.1, "s")].map(|(x, unit)| LawParameter::new(x, [x - 0.01, x + 0.01], unit));
            Release::ALL[1].law([amplitude, time]).unwrap()
        };
        assert!(law(6.0).words().contains("turned down by 6.0 dB [6.0, 6.0]"), "{}", law(6.0).words());
        assert!(law(-6.0).words().contains("raised by 6.0 dB [6.0, 6.0]"), "{}", law(-6.0).words());
        let db = law(6.0).value(|name| (name == "time_after_direct_s").then_some(0.1)).unwrap();
        assert!((db + 6.0 / std::f64::consts::E).abs() < 1e-9, "{db}");
    }
}
