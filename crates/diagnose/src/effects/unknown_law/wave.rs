//! Courses along a recording: a gain that swells and sinks. A sum of few waves says any course.

use super::covariate::{Form, Scale, form};
use crate::effect::{DecayTerm, Parameter};
use crate::simulate::views::BandView;
use crate::survey::Survey;
use sabine_paths::laws::{Law, LawError, LawParameter, LawTarget};
use std::f64::consts::{PI, TAU};

/// `w` is its angular frequency, `p` its phase.
pub(super) const WAVE: Form = form("wave", "sin(w * file_time_s + p)");
/// Half periods within the time for which a recording sounds, at most. What is compared ends before that.
const MOST_HALF_PERIODS: usize = 10;
/// Phases in radians: a sine and a cosine first, and what is made of both.
const PHASES: [f64; 4] = [0.0, 0.5 * PI, 0.25 * PI, 0.75 * PI];
/// How far a fit may go from a wave towards the next, in steps between them.
const REACH: f64 = 0.6;

/// One of the waves that are screened; a fit moves its period and its phase, by a little more than half of the way to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wave {
    rad_per_s: f64,
    phase_rad: f64,
    /// By how much the angular frequency of the next wave is higher.
    step_rad_per_s: f64,
}

impl Wave {
    /// All of a room, those of one period together: the time for which most recordings sound holds whole numbers of half periods.
    pub fn all(survey: &Survey) -> Vec<Self> {
        let mut sounds_s: Vec<f64> =
            survey.responses().iter().map(|r| r.sounds_until_s).filter(|s| *s > 0.0).collect();
        sounds_s.sort_by(f64::total_cmp);
        let Some(usual_s) = sounds_s.get(sounds_s.len() / 2) else { return Vec::new() };
        let step_rad_per_s = PI / usual_s;
        let of_period = |halves: usize| {
            let rad_per_s = halves as f64 * step_rad_per_s;
            PHASES.map(|phase_rad| Self { rad_per_s, phase_rad, step_rad_per_s })
        };
        (1..=MOST_HALF_PERIODS).flat_map(of_period).collect()
    }

    pub fn period_s(self) -> f64 {
        TAU / self.rad_per_s
    }

    /// The periods that a fit may find, in seconds: the shortest and the longest.
    pub(super) fn periods_s(self) -> [f64; 2] {
        [REACH, -REACH].map(|steps| TAU / (self.rad_per_s + steps * self.step_rad_per_s))
    }

    /// What it has of the sine and of the cosine of its period.
    pub fn of_sine_and_cosine(self) -> [f64; 2] {
        [self.phase_rad.cos(), self.phase_rad.sin()]
    }

    /// Its numbers in a formula.
    pub(super) fn scales(self) -> [Scale; 2] {
        [("w", self.rad_per_s, "rad/s"), ("p", self.phase_rad, "rad")]
    }

    /// What tells its law from those of other waves.
    pub(super) fn id(self) -> String {
        format!("_{:.0}_ms_{:.0}_deg", 1000.0 * self.period_s(), self.phase_rad.to_degrees())
    }

    /// Parameters of its fit behind the amplitude. Beforehand they are anywhere between this wave and the next.
    pub(super) fn parameters(self) -> [Parameter; 2] {
        let about = |name, unit, middle: f64, step: f64| {
            let (reach, even_sd) = (REACH * step, step / 12f64.sqrt());
            Parameter::new(name, unit, middle, even_sd, (middle - reach, middle + reach))
                .with_floor()
                .with_ceiling()
        };
        let step_rad = PI / PHASES.len() as f64;
        [
            about("angular_frequency", "rad/s", self.rad_per_s, self.step_rad_per_s),
            about("phase", "rad", self.phase_rad, step_rad),
        ]
    }

    /// The law of fitted parameters: amplitude, angular frequency, phase.
    pub(super) fn law(self, [a, w, p]: [LawParameter; 3]) -> Result<Law, LawError> {
        // Less than nothing is half a period later.
        let [low, high] = if a.value < 0.0 { [-a.high, -a.low] } else { [a.low, a.high] };
        let size = format!("{:.1} dB [{low:.1}, {high:.1}]", a.value.abs());
        let period = format!("{:.2} s [{:.2}, {:.2}]", TAU / w.value, TAU / w.high, TAU / w.low);
        let words = format!("The gain of the recording swells and sinks by {size}, once in {period}.");
        let formula = format!("-a * {}", WAVE.text);
        let (id, own) = (format!("{}{}", WAVE.name, self.id()), [("a", a), ("w", w), ("p", p)]);
        Ok(Law::new(id, LawTarget::Recorder, None, &formula, own)?.with_words(words))
    }
}

/// A wave whose amplitude, period and phase are fitted.
pub(super) struct FittedWave;

impl DecayTerm for FittedWave {
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let taken = -super::formula::LN_PER_DB * values[0];
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += taken * (values[1] * view.time_s(bin) + values[2]).sin();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::baseline::Baseline;

    #[test]
    fn the_sine_and_the_cosine_of_each_period_make_its_waves() {
        let baseline = Baseline::of_laboratory(32);
        let waves = Wave::all(baseline.survey());
        assert_eq!(waves.len(), 4 * MOST_HALF_PERIODS);
        for of_period in waves.chunks(4) {
            assert!(of_period.iter().all(|wave| wave.period_s() == of_period[0].period_s()));
            let at = |wave: &Wave, time_s: f64| (TAU * time_s / wave.period_s() + wave.phase_rad).sin();
            for time_s in [0.0, 0.13, 0.61] {
                let own = of_period.iter().map(|wave| {
                    let [sine, cosine] = wave.of_sine_and_cosine();
                    (sine * at(&of_period[0], time_s) + cosine * at(&of_period[1], time_s) - at(wave, time_s))
                        .abs()
                });
                assert!(own.fold(0.0, f64::max) < 1e-12);
            }
        }
    }
}
