//! What is to be diagnosed: a laboratory room, what is hidden in it, and how it is asked.

use crate::sham::{IDS, Sham};
use sabine::acoustics::Bands;
use sabine::diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, catalogue};
use sabine_testkit::{Hidden, LabConfig, Laboratory};
use sabine_validation::{AnyError, hiding};
use serde::Serialize;
use std::path::Path;

/// What is to be diagnosed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Task {
    /// Effects to hide; none in a null room.
    pub hidden: Vec<String>,
    pub strength: f64,
    pub seed: u64,
    pub receivers: usize,
    pub sources: usize,
    pub sample_rate_hz: u32,
    /// Sessions in air of their own.
    pub sessions: usize,
    /// Whether reflections keep their sign.
    pub positive_reflections: bool,
    /// Bands in an octave: 1 or 3.
    pub bands_per_octave: usize,
    pub rays: usize,
    pub range_db: f64,
    pub position_sd_m: f64,
    /// Effects without meaning that stand beside the catalogue.
    pub shams: usize,
    /// Whether a law that no catalogue lists is looked for.
    pub discover: bool,
    /// Whether a set is followed up by the measurement that it asks for, and by another.
    pub decide: bool,
}

impl Task {
    /// Name of what is hidden, as the record has it.
    pub fn name(&self) -> String {
        hiding::name(&self.hidden)
    }

    /// The laboratory room that it is done in.
    pub fn lab(&self) -> Result<LabConfig, AnyError> {
        let all =
            if self.bands_per_octave == 1 { Bands::T60 } else { Bands::third_octaves(100.0, 10_000.0)? };
        let highest = (0..all.len()).rfind(|&b| 2.0 * all.edges_hz(b).1 <= f64::from(self.sample_rate_hz));
        let highest = highest.ok_or("the sample rate leaves no band")?;
        Ok(LabConfig {
            seed: self.seed,
            sources: self.sources,
            receivers: self.receivers,
            sessions: self.sessions,
            sample_rate_hz: self.sample_rate_hz,
            bands: all.part(0..highest + 1),
            time_zero: hiding::time_zero(&self.hidden),
            positive_reflections: self.positive_reflections,
            ..LabConfig::default()
        })
    }

    /// Hides the effects in a room and diagnoses it. The folder is used for the room and cleared afterwards.
    pub fn diagnose(
        &self,
        lab: &Laboratory,
        hidden: &[Hidden],
        folder: &Path,
    ) -> Result<Diagnosis, AnyError> {
        let room = lab.write(hidden, folder, None)?;
        let config = DiagnoseConfig {
            rays: self.rays,
            range_db: self.range_db,
            position_sd_m: self.position_sd_m,
            seed: self.seed,
            ..DiagnoseConfig::default()
        };
        let mut effects = catalogue();
        effects.extend((0..self.shams.min(IDS.len())).map(|n| Box::new(Sham::new(n)) as _));
        let diagnoser = Diagnoser::new(config)?.with_effects(effects);
        let diagnoser = if self.discover { diagnoser.discovering() } else { diagnoser };
        let found = diagnoser.diagnose(&room, &[], &())?;
        std::fs::remove_dir_all(folder)?;
        Ok(found)
    }
}
