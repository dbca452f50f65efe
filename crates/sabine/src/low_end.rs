//! The low end of a match from the wave equation.

use crate::Error;
use sabine_acoustics::{Air, ImpulseResponse, Material, Observer};
use sabine_propagate::wave::{Crossover, WaveConfig, WaveRoom, WaveSolver};
use sabine_scene::{MeasuredRoom, Receiver, Source};
use serde::Serialize;

/// What joining waves to paths found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct JoinedWaves {
    /// Middle of the crossover in Hz.
    pub below_hz: f64,
    /// Voxels of the room.
    pub voxels: usize,
    /// Energy of the waves over that of the paths in the octave about the crossover, in dB.
    pub level_difference_db: f64,
    /// Gain at the crossover in dB.
    pub gain_db: f64,
}

/// A room cut into voxels for waves up to half an octave above a crossover.
pub(crate) struct LowEnd {
    crossover: Crossover,
    below_hz: f64,
    config: WaveConfig,
    room: WaveRoom,
}

impl LowEnd {
    /// What can go wrong with a mesh does so here, before anything is traced.
    pub fn new(
        below_hz: f64,
        sample_rate_hz: u32,
        room: &MeasuredRoom,
        source: &Source,
    ) -> Result<Self, Error> {
        let crossover = Crossover::new(below_hz)?;
        let config = WaveConfig { limit_hz: crossover.limit_hz(), sample_rate_hz, ..WaveConfig::default() };
        let room = WaveSolver::new(config.clone())?.prepare(room.scene(), source, &room.air())?;
        Ok(Self { crossover, below_hz, config, room })
    }

    /// Solves for as long as the paths last, and joins the two.
    pub fn join(
        &self,
        (source, receiver): (&Source, &Receiver),
        materials: &[Material],
        air: &Air,
        paths: &ImpulseResponse,
        observer: &dyn Observer,
    ) -> Result<(ImpulseResponse, JoinedWaves), Error> {
        let solver = WaveSolver::new(WaveConfig { duration_s: paths.duration_s(), ..self.config.clone() })?;
        let hearing = std::slice::from_ref(receiver);
        let heard = solver.solve(&self.room, materials, source, hearing, air, observer)?;
        let joined = self.crossover.join(&heard[0], paths)?;
        let found = JoinedWaves {
            below_hz: self.below_hz,
            voxels: self.room.voxels(),
            level_difference_db: joined.level_difference_db,
            gain_db: joined.gain_db,
        };
        Ok((joined.response, found))
    }
}
