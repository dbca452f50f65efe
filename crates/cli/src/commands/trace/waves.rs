//! `--wave-below`: the low end of the response from the wave equation.

use crate::failure::Failure;
use sabine::acoustics::{ImpulseResponse, Observer};
use sabine::paths::Conditions;
use sabine::propagate::wave::{Crossover, JoinedResponse, WaveConfig, WaveRoom, WaveSolver};
use sabine::scene::{MeasuredRoom, Receiver, Source};
use serde_json::{Value, json};
use std::time::Instant;

/// A room cut into voxels for waves up to half an octave above the crossover.
pub struct WaveRoomBelow {
    crossover_hz: f64,
    config: WaveConfig,
    room: WaveRoom,
    prepare_s: f64,
}

impl WaveRoomBelow {
    /// What can go wrong with a mesh does so here, before anything is traced.
    pub fn new(
        crossover_hz: f64,
        sample_rate_hz: u32,
        room: &MeasuredRoom,
        source: &Source,
    ) -> Result<Self, Failure> {
        let start = Instant::now();
        let limit_hz = Crossover::new(crossover_hz)?.limit_hz();
        let config = WaveConfig { limit_hz, sample_rate_hz, ..WaveConfig::default() };
        let room = WaveSolver::new(config.clone())?.prepare(room.scene(), source, &room.air())?;
        Ok(Self { crossover_hz, config, room, prepare_s: start.elapsed().as_secs_f64() })
    }

    /// Solves for as long as the paths last, and joins the two.
    pub fn join(
        self,
        source: &Source,
        receiver: &Receiver,
        conditions: &Conditions,
        paths: &ImpulseResponse,
        observer: &dyn Observer,
    ) -> Result<Waves, Failure> {
        let start = Instant::now();
        let solver = WaveSolver::new(WaveConfig { duration_s: paths.duration_s(), ..self.config })?;
        let receivers = std::slice::from_ref(receiver);
        let (materials, air) = (conditions.materials, conditions.air);
        let heard = solver.solve(&self.room, materials, source, receivers, air, observer)?;
        Ok(Waves {
            joined: Crossover::new(self.crossover_hz)?.join(&heard[0], paths)?,
            crossover_hz: self.crossover_hz,
            voxels: self.room.voxels(),
            volume_m3: self.room.volume_m3(),
            solve_s: self.prepare_s + start.elapsed().as_secs_f64(),
        })
    }
}

/// The response with waves below a frequency, and what they took.
pub struct Waves {
    pub joined: JoinedResponse,
    crossover_hz: f64,
    voxels: usize,
    volume_m3: f64,
    solve_s: f64,
}

impl Waves {
    /// A line for the terminal.
    pub fn line(&self) -> String {
        format!(
            "waves below {} Hz: {} voxels, {:.1} m3, solved in {:.2} s; {:+.1} dB against the paths about there, joined with {:+.1} dB",
            self.crossover_hz,
            self.voxels,
            self.volume_m3,
            self.solve_s,
            self.joined.level_difference_db,
            self.joined.gain_db,
        )
    }

    pub fn as_json(&self) -> Value {
        json!({
            "below_hz": self.crossover_hz,
            "voxels": self.voxels,
            "volume_m3": self.volume_m3,
            "seconds": self.solve_s,
            "level_difference_db": self.joined.level_difference_db,
            "gain_db": self.joined.gain_db,
        })
    }
}
