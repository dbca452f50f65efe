//! Parameters of a response (ISO 3382-1) and its decay curves.

use crate::error::Error;
use crate::readings::Row;
use sabine_acoustics::{Bands, EnergyDecayCurve, FilterBank, ImpulseResponse, RoomParameters};
use serde::Serialize;

/// Octaves that are measured: 125 Hz to 8 kHz.
pub(crate) const OCTAVES: Bands = Bands::T60;
/// Step of the decay curves in seconds.
pub(crate) const STEP_S: f64 = 0.005;

/// What is read from a response.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Nominal centres of the octaves.
    pub bands_hz: Vec<f64>,
    /// The quantities.
    pub rows: Vec<Row>,
    /// When the direct sound comes, in seconds from the first sample.
    pub onset_s: Option<f64>,
    /// For each octave the level of the energy still to come, in dB, from the onset to where the decay meets the noise.
    pub decay_db: Vec<Vec<f64>>,
    /// Step of the curves in seconds.
    pub decay_step_s: f64,
}

impl Measured {
    /// Reads a response.
    ///
    /// # Errors
    /// As [`RoomParameters::measure`].
    pub fn read(response: &ImpulseResponse) -> Result<Self, Error> {
        let room = RoomParameters::measure(response, OCTAVES)?;
        let rows = vec![
            Row::new("T60", "s", &room.t60_s),
            Row::new("T30", "s", &room.t30_s),
            Row::new("T20", "s", &room.t20_s),
            Row::new("EDT", "s", &room.edt_s),
            Row::new("C50", "dB", &room.c50_db),
            Row::new("C80", "dB", &room.c80_db),
            Row::new("D50", "", &room.d50),
            Row::new("Ts", "s", &room.centre_time_s),
            Row::new("DRR", "dB", &room.drr_db),
        ];
        let (bands_hz, decay_step_s) = (OCTAVES.iter_hz().collect(), STEP_S);
        let onset_s = room.onset.as_ref().ok().map(|onset| onset.time_s);
        Ok(Self { bands_hz, rows, onset_s, decay_db: curves(response, &room)?, decay_step_s })
    }
}

fn curves(response: &ImpulseResponse, room: &RoomParameters) -> Result<Vec<Vec<f64>>, Error> {
    let Ok(onset) = &room.onset else { return Ok(vec![Vec::new(); OCTAVES.len()]) };
    let rate = f64::from(response.sample_rate_hz());
    let split = FilterBank::new(OCTAVES, response.sample_rate_hz())?.analyse(response.samples());
    let step = ((STEP_S * rate) as usize).max(1);
    let curve = |(samples, fit): (&Vec<f32>, &Result<sabine_acoustics::DecayFit, _>)| {
        let Ok(fit) = fit else { return Vec::new() };
        let end = ((fit.knee_s() * rate) as usize).clamp(onset.index, samples.len());
        let energy = |chunk: &[f32]| chunk.iter().map(|&x| f64::from(x).powi(2)).sum();
        let energy: Vec<f64> = samples[onset.index.min(end)..end].chunks(step).map(energy).collect();
        let levels = EnergyDecayCurve::from_energy(&energy, STEP_S).level_db();
        // JSON has no infinity.
        levels.into_iter().take_while(|level| level.is_finite()).collect()
    };
    Ok(split.values().iter().zip(room.fits.values()).map(curve).collect())
}
