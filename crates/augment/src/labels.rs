//! What a training clip is labelled with.

use crate::direct::HALF_DIRECT_S;
use crate::error::Error;
use sabine_acoustics::{DecayFit, Estimate, FilterBank, ImpulseResponse, NoReading, OctaveBands, Onset, PerBand, Reading};

/// What is measured on a response: reverberation time, equalisation and ratio of direct to reverberant energy, each a
/// reading with its standard error or the reason why there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    t60_s: PerBand<Reading>,
    eq_db: PerBand<Reading>,
    drr_db: Reading,
}
