//! Laws in a room: names become numbers.

use crate::laws::arithmetic::{binary, fault_of, resonance, unary};
use crate::laws::error::{LawError, LawFault, Place, nearest};
use crate::laws::formula::{Binary, Op};
use crate::laws::law::Law;
use crate::laws::target::LawTarget;
use crate::laws::variable::{Named, Variable, scope};
use sabine_acoustics::{Air, Bands};
use sabine_scene::{Receiver, Scene, Source};

/// What laws know of one response: the materials of its room, where and how source and receiver stand, and the air.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LawSite {
    materials: Vec<String>,
    source: Source,
    receiver: Receiver,
    air: Air,
    recording_order: Option<f64>,
    /// Names of all sources and receivers of the room, where it is known which there are.
    ends: Option<[Vec<String>; 2]>,
}

impl LawSite {
    /// A source and a receiver in a scene whose materials are those of the paths, in the same order. A law may name any source and receiver.
    pub fn new(scene: &Scene, source: &Source, receiver: &Receiver, air: &Air) -> Self {
        Self {
            materials: scene.materials().iter().map(|named| named.name.clone()).collect(),
            source: source.clone(),
            receiver: receiver.clone(),
            air: *air,
            recording_order: None,
            ends: None,
        }
    }

    /// The same in a room of these sources and receivers: a law that names another one is refused.
    #[must_use]
    pub fn among(self, sources: &[Source], receivers: &[Receiver]) -> Self {
        let sources = sources.iter().map(|source| source.id.clone()).collect();
        let receivers = receivers.iter().map(|receiver| receiver.id.clone()).collect();
        Self { ends: Some([sources, receivers]), ..self }
    }

    /// The same with a number that rises with the time at which the response was recorded (`MeasuredRoom::recorded_at`); `None`: nobody
    /// said, and a law that asks for it is refused.
    #[must_use]
    pub fn with_recording_order(self, order: impl Into<Option<f64>>) -> Self {
        Self { recording_order: order.into(), ..self }
    }

    /// A variable of pair and response by its name: `distance_m`, `receiver_x_m`, `temperature_c`, `receiver(mic_1)` ...
    pub fn variable(&self, name: &str) -> Option<f64> {
        end_variable(name, [&self.source.id, &self.receiver.id])
            .or_else(|| self.value(Variable::of_name(name)?))
    }

    /// A variable of pair and response.
    fn value(&self, variable: Variable) -> Option<f64> {
        let (source, receiver) = (self.source.position_m, self.receiver.position_m);
        Some(match variable {
            Variable::Distance => (0..3).map(|k| (source[k] - receiver[k]).powi(2)).sum::<f64>().sqrt(),
            Variable::SourceX => source[0],
            Variable::SourceY => source[1],
            Variable::SourceZ => source[2],
            Variable::ReceiverX => receiver[0],
            Variable::ReceiverY => receiver[1],
            Variable::ReceiverZ => receiver[2],
            Variable::Temperature => self.air.temperature_c(),
            Variable::Humidity => self.air.relative_humidity_percent(),
            Variable::RecordingOrder => self.recording_order?,
            _ => return None,
        })
    }

    /// Why a variable of a law has no value here; `None` where it has one.
    fn unknown(&self, variable: Variable) -> Option<&'static str> {
        match variable {
            Variable::MeanHeight | Variable::LeastHeight => Some("traced paths do not record their heights"),
            Variable::IncidenceAzimuth | Variable::Side => {
                Some("traced paths record the angle to the normal alone")
            }
            Variable::Level => Some("laws act before levels are known"),
            Variable::RecordingOrder if self.recording_order.is_none() => {
                Some("nobody said in which order the responses were recorded")
            }
            Variable::DepartureCos if self.source.axis.is_none() => Some("the source has no axis"),
            Variable::ArrivalCos if self.receiver.axis.is_none() => Some("the receiver has no axis"),
            _ => None,
        }
    }

    /// What stands for a name: the number of a material; one for the source or receiver of this pair, zero for another one.
    fn number(&self, (named, name): &(Named, String)) -> Result<usize, LawFault> {
        let (own, end) = match named {
            Named::Hits => return self.material(name),
            Named::Source => (&self.source.id, 0),
            Named::Receiver => (&self.receiver.id, 1),
        };
        let others = self.ends.iter().flat_map(|ends| &ends[end]).map(String::as_str);
        if name == own || self.ends.is_none() || others.clone().any(|other| other == name) {
            return Ok(usize::from(name == own));
        }
        Err(LawFault::UnknownEnd { end: named.word(), name: name.clone(), nearest: nearest(name, others) })
    }

    fn material(&self, name: &str) -> Result<usize, LawFault> {
        if let Some(index) = self.materials.iter().position(|material| material == name) {
            return Ok(index);
        }
        let known = |name: &str| self.materials.iter().any(|material| material == name);
        if name.split_once('@').is_some_and(|(material, _)| known(material)) {
            let why = "traced paths do not tell the planes of one material apart";
            return Err(LawFault::NotKnown { variable: "material@plane", why });
        }
        let nearest = nearest(name, self.materials.iter().map(String::as_str));
        Err(LawFault::UnknownSurface { name: name.to_owned(), nearest })
    }
}

/// Laws whose names have been found in a room, for one source and one receiver: what [`Conditions`](crate::Conditions) carry.
#[derive(Clone, Debug)]
pub struct BoundLaws {
    pub(crate) laws: Vec<BoundLaw>,
}

/// One of them.
#[derive(Clone, Debug)]
pub(crate) struct BoundLaw {
    pub law: Law,
    /// Number of the material whose reflections it changes.
    pub surface: Option<usize>,
    /// What stands for each of [`Formula::names`](crate::laws::formula::Formula): the number of a material whose meetings it counts; one for the
    /// source and the receiver of this pair, zero for others.
    pub named: Vec<usize>,
    /// Values of the variables of pair and response that it uses.
    known: Vec<(Variable, f64)>,
    pub axes: [Option<[f64; 3]>; 2],
}

impl BoundLaws {
    /// Finds the names of laws in a room.
    ///
    /// # Errors
    /// [`LawError`]: two laws of one identifier, more than [`Law::MAX_LAWS`], a material that the mesh lacks, a variable that this room or traced
    /// paths do not tell, a part that is the same for all paths and has no value.
    pub fn new(laws: &[Law], site: &LawSite) -> Result<Self, LawError> {
        Law::check_together(laws)?;
        Ok(Self { laws: laws.iter().map(|law| BoundLaw::new(law, site)).collect::<Result<_, _>>()? })
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.laws.is_empty()
    }

    /// Those of one target.
    pub(crate) fn of(&self, target: LawTarget) -> impl Iterator<Item = &BoundLaw> {
        self.laws.iter().filter(move |bound| bound.law.target() == target)
    }
}

impl BoundLaw {
    fn new(law: &Law, site: &LawSite) -> Result<Self, LawError> {
        let surface = law.surface().map(|name| site.material(name)).transpose();
        let surface = surface.map_err(|fault| law.error(None, fault))?;
        let (mut named, mut known) = (Vec::new(), Vec::new());
        for (at, &op) in law.formula.ops.iter().enumerate() {
            match op {
                // In the order of their first mention, as the formula's names are.
                Op::Named(_, index) if usize::from(index) == named.len() => {
                    let number = site.number(&law.formula.names[usize::from(index)]);
                    named.push(number.map_err(|fault| law.error_at(at, fault))?);
                }
                Op::Variable(variable) => {
                    if let Some(why) = site.unknown(variable) {
                        let variable = variable.name();
                        return Err(law.error_at(at, LawFault::NotKnown { variable, why }));
                    }
                    known.extend(site.value(variable).map(|value| (variable, value)));
                }
                _ => {}
            }
        }
        let bound =
            Self { law: law.clone(), surface, named, known, axes: [site.source.axis, site.receiver.axis] };
        bound.check_constants()?;
        Ok(bound)
    }

    /// Parts that are the same for all paths and bands have values.
    fn check_constants(&self) -> Result<(), LawError> {
        let values = self.values_of(0, Place::default(), |_| f64::NAN)?;
        debug_assert!(values.iter().zip(&self.law.scopes).all(|(v, s)| *s != 0 || v.is_finite()));
        Ok(())
    }

    /// Value of a number, a parameter or a variable of pair and response.
    fn constant(&self, op: Op) -> Option<f64> {
        match op {
            Op::Number(value) => Some(value),
            Op::Parameter(index) => Some(self.law.base_value(usize::from(index))),
            Op::Variable(variable) => {
                self.known.iter().find(|(v, _)| *v == variable).map(|(_, value)| *value)
            }
            Op::Named(Named::Source | Named::Receiver, index) => Some(self.named[usize::from(index)] as f64),
            _ => None,
        }
    }

    /// Values of all operations that depend on nothing but what the bits of `scope` say; others are NaN. `variable` gives what varies within it.
    pub fn values_of(
        &self,
        scope: u8,
        place: Place,
        variable: impl Fn(Op) -> f64,
    ) -> Result<Vec<f64>, LawError> {
        let ops = &self.law.formula.ops;
        let mut values = vec![f64::NAN; ops.len()];
        for (at, &op) in ops.iter().enumerate() {
            if self.law.scopes[at] & !scope != 0 {
                continue;
            }
            let of = |index: u16| values[usize::from(index)];
            let value = match op {
                Op::Unary(function, a) => unary(function, of(a)),
                Op::Binary(function, a, b) => binary(function, of(a), of(b)),
                Op::Resonance([f, f0, q]) => resonance(of(f), of(f0), of(q)),
                leaf => self.constant(leaf).unwrap_or_else(|| variable(leaf)),
            };
            if !value.is_finite() {
                let zero = matches!(op, Op::Binary(Binary::Divide, _, divisor) if of(divisor) == 0.0);
                return Err(self.law.error_at(at, fault_of(&self.law.formula, at, zero, place)));
            }
            values[at] = value;
        }
        Ok(values)
    }

    /// The value of the law where everything is known.
    pub fn value(&self, place: Place, variable: impl Fn(Op) -> f64) -> Result<f64, LawError> {
        let values = self.values_of(u8::MAX, place, variable)?;
        Ok(values.last().copied().unwrap_or(0.0))
    }

    /// Values of what depends on bands alone, `[operation][band]`; NaN where it depends on more.
    pub fn values_by_band(&self, bands: Bands) -> Result<Vec<Vec<f64>>, LawError> {
        let mut table = vec![Vec::with_capacity(bands.len()); self.law.formula.ops.len()];
        for hz in bands.iter_hz() {
            let place = Place { path: None, band_hz: Some(hz) };
            let values = self.values_of(scope::BAND, place, |_| hz)?;
            table.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
        }
        Ok(table)
    }

    /// Whether it asks at which angle its surface is met.
    pub fn asks_for_angle(&self) -> bool {
        self.law.scopes.last().is_some_and(|scope| scope & scope::HIT != 0)
    }
}

/// The value of `source(ID)` or `receiver(ID)` in a response of these ends, source and receiver: 1 if it is one of them, else 0. `None` for other
/// names.
pub fn end_variable(name: &str, [source, receiver]: [&str; 2]) -> Option<f64> {
    let (word, rest) = name.split_once('(')?;
    let own = match Named::of_word(word)? {
        Named::Hits => return None,
        Named::Source => source,
        Named::Receiver => receiver,
    };
    Some(f64::from(u8::from(rest.strip_suffix(')')? == own)))
}
