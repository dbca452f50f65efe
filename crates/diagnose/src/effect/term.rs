//! What a case does to a prediction.

use crate::effect::reflection_gate::ReflectionGate;
use crate::extend::displaced_surface::DisplacedSurface;
use crate::found_parameter::FoundParameter;
use crate::likelihood::multilateration::UnassignedPeaks;
use crate::observe::pre_arrival::PreArrival;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::{ArrivalView, BandView};
use crate::survey::Survey;

/// What a case does to a prediction, and with that the data that it bears on.
#[non_exhaustive]
pub enum Term {
    /// Changes energies over time.
    Decay(Box<dyn DecayTerm>),
    /// Moves the direct sound and reflections in time.
    Arrivals(Box<dyn ArrivalTerm>),
    /// Adds a reflection that the mesh does not have.
    Reflection(Box<dyn ReflectionTerm>),
    /// Exchanges two responses, or inverts one.
    Channels(ChannelChange),
    /// Shows before the direct sound.
    PreArrival(Box<dyn PreArrivalTerm>),
    /// Nothing but what the relaxed priors allow.
    PriorOnly,
}

/// A change of energies.
pub trait DecayTerm: Send + Sync {
    /// What it computes from the traced paths beforehand, once for each set of materials about which predictions are expanded:
    /// [`BandView::table`] then holds its own table. None by default.
    ///
    /// # Errors
    /// [`Unprepared`].
    fn prepare(&self, _room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        Ok(Tables::default())
    }

    /// Whether its tables change with absorption by more than fits allow for, which follow energies along the traced paths: predictions are
    /// then expanded about the fit again and again until absorption stays. Not by default.
    fn depends_on_expansion(&self) -> bool {
        false
    }

    /// Whether it adds sound of the source that does not come along the traced paths: the gain of the response acts on it too
    /// ([`BandView::gain`]).
    fn adds_sound_of_source(&self) -> bool {
        false
    }

    /// A table without traced paths, for unit tests of likelihoods.
    #[cfg(test)]
    fn by_hand(&self, _bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        None
    }

    /// Changes the natural logarithm of the predicted energy in the time bins of one band and pair. Each bin must depend on its own
    /// energy alone.
    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]);

    /// Changes the expected variance of the bins of one band and pair, as a share of their energy squared: it is less where the
    /// case predicts what else is left to chance.
    fn variance(&self, _values: &[f64], _view: &BandView<'_>, _variance: &mut [f64]) {}

    /// What each batch of rays moves the logarithm of the paths' energy in each bin of one band and pair by, `[bin * batches + batch]`
    /// ([`PathSet::batch_count`](sabine_paths::PathSet::batch_count)), where other paths count with the case than without. Energy that is added
    /// beside the paths needs no word here. `None` where all count as stated.
    fn chance(&self, _values: &[f64], _view: &BandView<'_>) -> Option<Vec<f64>> {
        None
    }

    /// What single first-order reflections say for it, where they are to be asked.
    fn reflection_evidence(&self) -> Option<&dyn ReflectionEvidence> {
        None
    }
}

/// Evidence of a decay term from single first-order reflections. What they weigh does not change what they are expected to hold.
pub trait ReflectionEvidence {
    /// What they say for it, given its parameters (value and standard deviation) from the fit of the decays.
    fn weigh(&self, own: &[(f64, f64)], gates: &[ReflectionGate]) -> Option<AuxiliaryEvidence>;
}

/// A change of arrival times.
pub trait ArrivalTerm: Send + Sync {
    /// Seconds by which an arrival comes later.
    fn delay_s(&self, values: &[f64], arrival: &ArrivalView<'_>) -> f64;

    /// The surface (index into [`Survey::surfaces`]) that it moves, and how, if it does nothing else: where several terms move surfaces,
    /// the delay is that of the path in all mirrors as they stand, for which their own delays are no sum. None by default.
    fn displaces(&self, _values: &[f64]) -> Option<(usize, DisplacedSurface)> {
        None
    }
}

/// Reflections that the mesh does not have. Their fit starts from the peaks that nothing predicted explains.
pub trait ReflectionTerm: Send + Sync {
    /// Values to start from.
    fn starts(&self, peaks: &UnassignedPeaks<'_>) -> Vec<Vec<f64>>;

    /// Reflections that it may add to one response: one by default.
    fn ways(&self) -> usize {
        1
    }

    /// A reflection (index below [`ReflectionTerm::ways`]) in a response (index), where there is one.
    fn reflection(
        &self,
        values: &[f64],
        survey: &Survey,
        response: usize,
        way: usize,
    ) -> Option<AddedReflection>;

    /// Whether it stands in the way of a predicted path, given the places in metres from each of which to the next that goes straight on: source,
    /// reflections, receiver. Nothing is hidden by default.
    fn hides(&self, _values: &[f64], _stops: &[[f64; 3]]) -> bool {
        false
    }
}

/// Something that shows before the direct sound.
pub trait PreArrivalTerm: Send + Sync {
    /// What the responses that count (a flag for each) say for it, its parameters included.
    fn weigh(&self, responses: &PreArrival, used: &[bool]) -> Option<AuxiliaryEvidence>;
}

/// A change of channels; responses are indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelChange {
    /// Two responses were exchanged.
    Exchanged(usize, usize),
    /// The sign of a response is inverted.
    Inverted(usize),
}

/// What single reflections, or the time before the direct sound, say for a cause.
#[derive(Clone, Debug, PartialEq)]
pub struct AuxiliaryEvidence {
    /// Logarithm of how much more probable they are with the cause than without, its parameters summed over.
    pub nats: f64,
    /// Its parameters as they and the fit together give them.
    pub parameters: Vec<FoundParameter>,
}

/// A reflection that the mesh does not have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AddedReflection {
    /// Length of its path in metres.
    pub length_m: f64,
    /// Unit vector in which it leaves the source.
    pub departure: [f64; 3],
    /// Unit vector from the receiver towards where it comes from.
    pub arrival: [f64; 3],
    /// Height of its peak over that of the direct sound, in dB.
    pub level_db: f64,
}
