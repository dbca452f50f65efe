//! A room as an extended model has it, for commands that trace and fit: everything of the model that bears on paths.

use crate::failure::Failure;
use clap::Args;
use sabine::acoustics::{Air, Error as ValueError, Material};
use sabine::diagnose::ExtendedModel;
use sabine::paths::Conditions;
use sabine::paths::laws::{BoundLaws, Law, LawSite, LawTarget};
use sabine::propagate::TracerConfig;
use sabine::scene::{MeasuredRoom, Receiver, Scene, Source};
use std::path::PathBuf;

/// The option of these commands.
#[derive(Args, Debug, Default)]
pub struct ModelArguments {
    /// extended_model.toml of `diagnose`: the room is as it says in all that bears on paths (absorption, air, dimensions, places, surfaces,
    /// laws). Loudspeaker, microphones, noise and recorder are left out
    #[arg(long = "model", value_name = "F.toml")]
    file: Option<PathBuf>,
}

/// What a model says of paths beside the room itself.
#[derive(Clone, Debug, Default)]
pub struct PathModel {
    /// Formulas under which paths carry sound; none that adds sound or goes with the order of the recordings.
    pub laws: Vec<Law>,
    /// By which share walls react locally; 0 is absorption that is the same at all angles.
    pub locally_reacting_share: f64,
    /// Below this frequency in Hz responses are those of the wave equation.
    pub wave_below_hz: Option<f64>,
    diffraction: bool,
    cuboid_paths: usize,
}

impl ModelArguments {
    /// Whether there is one.
    pub fn is_given(&self) -> bool {
        self.file.is_some()
    }

    /// The room as the model has it, and the rest of what bears on paths; the room as stated without one. What is left out is printed.
    ///
    /// # Errors
    /// The model cannot be read or does not fit the room: the error names file or field.
    pub fn apply(&self, stated: MeasuredRoom) -> Result<(MeasuredRoom, PathModel), Failure> {
        let Some(file) = &self.file else { return Ok((stated, PathModel::default())) };
        let mut model = ExtendedModel::read(file)?;
        // What drifts over the recordings is no matter of the room, and another room may not say in which order they were made.
        let drifts = |law: &&Law| law.variables().iter().any(|name| name == "recording_order");
        for place in (0..model.causes.len()).rev() {
            let Some(law) = model.causes[place].law().filter(drifts) else { continue };
            let (law, file) = (law.id(), file.display());
            println!("note: the law {law} of {file} goes with the order of the recordings and is left out");
            model = model.without(place);
        }
        let extended = model.room(&stated)?;
        let all = model.causes.iter().filter_map(|cause| cause.law().cloned());
        let (added, laws): (Vec<Law>, Vec<Law>) = all.partition(|law| law.target() == LawTarget::Added);
        for law in added {
            println!("note: the law {} of {} adds sound and is left out", law.id(), file.display());
        }
        let own = PathModel {
            laws,
            locally_reacting_share: extended.locally_reacting_share,
            wave_below_hz: extended.wave_below_hz,
            diffraction: extended.diffraction,
            cuboid_paths: extended.cuboid_paths,
        };
        Ok((extended.measured_room(&stated)?, own))
    }
}

impl PathModel {
    /// Settings of a tracer that finds the paths of the model.
    #[must_use]
    pub fn tracer(&self, config: TracerConfig) -> TracerConfig {
        TracerConfig {
            diffraction: config.diffraction || self.diffraction,
            cuboid_paths: config.cuboid_paths.max(self.cuboid_paths),
            ..config
        }
    }

    /// What the model says of paths between a source and a receiver.
    ///
    /// # Errors
    /// A law that does not fit the room.
    pub fn between(
        &self,
        scene: &Scene,
        (source, receiver): (&Source, &Receiver),
        air: &Air,
    ) -> Result<PairModel, ValueError> {
        let laws = BoundLaws::new(&self.laws, &LawSite::new(scene, source, receiver, air))?;
        Ok(PairModel { laws, locally_reacting_share: self.locally_reacting_share })
    }
}

/// What a model says of paths between one source and one receiver.
#[derive(Clone, Debug)]
pub struct PairModel {
    laws: BoundLaws,
    locally_reacting_share: f64,
}

impl PairModel {
    /// Whether it says nothing.
    pub fn is_plain(&self) -> bool {
        self.laws.is_empty() && self.locally_reacting_share == 0.0
    }

    /// Surfaces and air under it.
    pub fn conditions<'a>(&'a self, materials: &'a [Material], air: &'a Air) -> Conditions<'a> {
        let mut conditions = Conditions::new(materials, air);
        if !self.laws.is_empty() {
            conditions = conditions.with_laws(&self.laws);
        }
        if self.locally_reacting_share != 0.0 {
            conditions = conditions.with_local_reaction(self.locally_reacting_share, materials);
        }
        conditions
    }
}
