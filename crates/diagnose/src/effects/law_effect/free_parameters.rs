//! Which parameters of a law are fitted, and what is known of them beforehand.

use crate::effect::{FittedCase, Parameter};
use crate::error::Error;
use crate::extend::model_change::ModelChange;
use crate::found_parameter::HALF_90;
use sabine_paths::laws::{Law, LawError, LawParameter, LawTarget};

/// Most parameters that are fitted.
pub(super) const MAX_FREE: usize = 10;
/// Shares of an interval from which a parameter that is no amplitude is sought.
const SOUGHT: [f64; 3] = [0.5, 0.2, 0.8];
/// Most parameters that start from several places each.
const MAX_SPREAD: usize = 3;
/// Most that a law may add, in dB.
pub(super) const MAX_GAIN_DB: f64 = 200.0;
/// Most combinations of ends of intervals at which a law is looked at beforehand.
const MAX_CORNERS: usize = 256;
/// Shares of the farther end from which an amplitude is sought.
const AMPLITUDE_STARTS: [f64; 2] = [0.1, 0.6];

/// A law and those of its parameters that are fitted: amplitudes first, then others that have an interval.
#[derive(Clone, Debug)]
pub(super) struct FittedLaw {
    pub law: Law,
    /// Places among the parameters of the law.
    free: Vec<usize>,
    /// How many of these are amplitudes.
    pub amplitudes: usize,
    /// Values of all parameters as written.
    written: Vec<f64>,
}

impl FittedLaw {
    /// Takes a law whose amplitudes, by name, are sought about zero.
    pub fn new(law: Law) -> Self {
        let of_target = law.target() != LawTarget::Added;
        let names: Vec<String> =
            if of_target { law.amplitudes().into_iter().map(str::to_owned).collect() } else { Vec::new() };
        let place = |name: &String| law.parameters().position(|(own, _)| own == name);
        let mut free: Vec<usize> = names.iter().filter_map(place).collect();
        let amplitudes = free.len();
        let open = |(_, (name, p)): &(usize, (&str, &LawParameter))| {
            p.low < p.high && !names.iter().any(|n| n == name) && !law.is_edge_of_bands(name)
        };
        free.extend(law.parameters().enumerate().filter(open).map(|(i, _)| i));
        let written = law.parameters().map(|(_, p)| p.value).collect();
        Self { law, free, amplitudes, written }
    }

    /// Whether nothing but one amplitude is fitted; its place among the parameters of the law.
    pub fn amplitude_alone(&self) -> Option<usize> {
        (self.free.len() == 1 && self.amplitudes == 1).then(|| self.free[0])
    }

    /// Names of the parameters that are fitted.
    pub fn names(&self) -> Vec<String> {
        self.fitted().map(|(name, _)| name.to_owned()).collect()
    }

    fn fitted(&self) -> impl Iterator<Item = (&str, &LawParameter)> {
        let all: Vec<(&str, &LawParameter)> = self.law.parameters().collect();
        self.free.iter().map(move |&place| all[place])
    }

    /// Least and greatest value of each: an amplitude's interval reaches to zero.
    pub fn ranges(&self) -> Vec<(f64, f64)> {
        let range = |(i, (_, p)): (usize, (&str, &LawParameter))| {
            if i < self.amplitudes { (p.low.min(0.0), p.high.max(0.0)) } else { (p.low, p.high) }
        };
        self.fitted().enumerate().map(range).collect()
    }

    /// The parameters of the case. Beforehand, 90 % of an amplitude lie about zero within the farther end of its interval, and of others
    /// within their interval, about its middle.
    pub fn parameters(&self) -> Vec<Parameter> {
        let ranges = self.ranges();
        let one = |(i, (name, p)): (usize, (&str, &LawParameter))| {
            let (low, high) = ranges[i];
            let unit = if p.unit == "1" { "" } else { &p.unit }.to_owned();
            if i < self.amplitudes {
                let far = farther((low, high));
                let sd = far.abs() / HALF_90;
                return Parameter::new(name, unit, 0.0, sd, (low, high)).typically(0.5 * far);
            }
            let (middle, sd) = (0.5 * (low + high), 0.5 * (high - low) / HALF_90);
            Parameter::new(name, unit, middle, sd, (low, high)).typically(p.value)
        };
        self.fitted().enumerate().map(one).collect()
    }

    /// Values from which the fit starts: small and large amplitudes, others as written and spread over their intervals.
    pub fn starts(&self) -> Vec<Vec<f64>> {
        let ranges = self.ranges();
        let (amplitudes, others) = ranges.split_at(self.amplitudes);
        let many = amplitudes.len() > 1;
        let shares: &[f64] =
            if many || amplitudes.is_empty() { &AMPLITUDE_STARTS[..1] } else { &AMPLITUDE_STARTS };
        let written: Vec<f64> =
            self.free[self.amplitudes..].iter().map(|&place| self.written[place]).collect();
        let mut of_others = vec![Vec::new()];
        if others.len() <= MAX_SPREAD {
            for &(low, high) in others {
                let sought = |start: &Vec<f64>| {
                    let start = start.clone();
                    SOUGHT.map(move |share| [start.clone(), vec![low + share * (high - low)]].concat())
                };
                of_others = of_others.iter().flat_map(sought).collect();
            }
        }
        if !others.is_empty() {
            of_others.retain(|start| start.len() == others.len() && *start != written);
            of_others.insert(0, written);
        }
        let with = |share: &f64| {
            let own: Vec<f64> = amplitudes.iter().map(|range| share * farther(*range)).collect();
            of_others.iter().map(move |others| [own.clone(), others.clone()].concat()).collect::<Vec<_>>()
        };
        shares.iter().flat_map(with).collect()
    }

    /// Values of all parameters at the ends of all intervals.
    fn corners(&self) -> Vec<Vec<f64>> {
        let mut corners = vec![Vec::new()];
        for (low, high) in self.ranges() {
            let both = |one: &Vec<f64>| [low, high].map(|end| [one.clone(), vec![end]].concat());
            corners = corners.iter().flat_map(both).take(MAX_CORNERS).collect();
        }
        corners
    }

    /// That the law has a value, and adds no more than it may, at all ends of the intervals: `levels_db` says its levels with some values of
    /// the parameters that are fitted.
    pub fn check(&self, hz: f64, levels_db: impl Fn(&[f64]) -> Vec<f64>) -> Result<(), Error> {
        self.corners().iter().try_for_each(|corner| {
            let levels = levels_db(corner);
            let worst = levels.iter().copied().find(|db| !(db.is_finite() && *db <= MAX_GAIN_DB));
            let Some(worst) = worst else { return Ok(()) };
            let at: Vec<String> =
                self.names().iter().zip(corner).map(|(name, value)| format!("{name} = {value}")).collect();
            let what = if worst.is_finite() {
                format!("it adds {worst:.0} dB, more than {MAX_GAIN_DB} dB,")
            } else {
                "it has no value".to_owned()
            };
            let reason = format!("with {} {what} at {hz} Hz: narrow the interval", at.join(", "));
            Err(Error::LawNotWeighed { id: self.law.id().to_owned(), reason })
        })
    }

    /// Values of all parameters of the law where those that are fitted have these.
    pub fn values(&self, fitted: &[f64]) -> Vec<f64> {
        let mut all = self.written.clone();
        self.free.iter().zip(fitted).for_each(|(&place, value)| all[place] = *value);
        all
    }

    /// Values of all parameters at which the law is plain to see: great amplitudes, others as written.
    pub fn plain(&self) -> Vec<f64> {
        let mut all = self.written.clone();
        let great = self.free.iter().zip(self.ranges()).take(self.amplitudes);
        great.for_each(|(&place, range)| all[place] = AMPLITUDE_STARTS[1] * farther(range));
        all
    }

    /// The law with what was found.
    pub fn found(&self, fitted: &FittedCase<'_>) -> Result<Law, LawError> {
        let intervals = |place: usize, own: [f64; 2]| {
            let i = self.free.iter().position(|free| *free == place);
            i.map_or(own, |i| {
                let [low, high] = fitted.interval(i);
                // A value that is moved to see what follows it takes its interval along.
                [low.min(fitted.values()[i]), high.max(fitted.values()[i])]
            })
        };
        let all = self.law.parameters().enumerate();
        let intervals: Vec<[f64; 2]> = all.map(|(place, (_, p))| intervals(place, [p.low, p.high])).collect();
        self.law.with_fitted(&self.values(fitted.values()), &intervals)
    }

    /// The same as a change of the model.
    pub fn changes(&self, fitted: &FittedCase<'_>) -> Vec<ModelChange> {
        self.found(fitted).map_or_else(|_| Vec::new(), |law| vec![ModelChange::Law(Box::new(law))])
    }
}

/// The end of a range that is farther from zero.
fn farther((low, high): (f64, f64)) -> f64 {
    if -low > high { low } else { high }
}
