//! Given measured responses, says what a simulation of the room gets wrong, names the cause, extends the model, and measures
//! the gain at positions that it has not seen.
//!
//! # Where it stands
//! At the end of the workspace, after the crates of rooms, responses and paths. [`Diagnoser`] takes a
//! [`MeasuredRoom`](sabine_scene::MeasuredRoom) and returns a [`Diagnosis`]: a [`Verdict`], the [`Cause`]s with parameters and 90 %
//! intervals, which causes cannot be told apart and which measurement would decide, and an [`ExtendedModel`] that renders. As a
//! document ([`serde::Serialize`]) a diagnosis has the keys that `docs/versioning.md` promises.
//!
//! # Seams
//! - [`Effect`]: a cause of one's own, with its texts ([`EffectInfo`]). Its [`Case`]s are data; the [`Term`] of each says what it does to
//!   a prediction, and [`Case::changing`] what it changes in the model: that is traced again and rendered, for effects of your own too.
//! - [`SceneTracer`]: another tracer ([`Diagnoser::with_tracer`]); [`EachScene`] makes one of any
//!   [`Propagator`](sabine_paths::Propagator).
//!
//! # How
//! Decays are compared as energy in octaves and time bins, relative to the direct sound; each bin with the spread that interference of
//! the traced paths and their Monte-Carlo error give it. Arrival times of the direct sound and of early reflections are compared
//! by themselves; so is the energy of single first reflections, for holes in walls. Of a room that has no responses its tables of parameters
//! are compared instead ([`MeasuredRoom::parameters`](sabine_scene::MeasuredRoom::parameters)): they tell of decays alone. Absorption stays free within its stated uncertainty beside every cause, gains, latencies and places within
//! theirs: otherwise a cause is credited with what absorption could have explained. Each cause is weighed by its evidence, all
//! parameters integrated out, against every other and against a smooth discrepancy without a name; details at [`Diagnoser`], the
//! reasoning in `docs/explanation/diagnosis.md`.
//!
//! # Does not
//! - see what is not in its [`catalogue`]: then the verdict is [`Verdict::Unexplained`] and the residuals show where it sits, unless
//!   [`Diagnoser::discovering`] finds a law that it goes with ([`Verdict::Law`]).
//! - follow sound around more than one edge. Waves are solved for the octaves below the Schroeder frequency alone.
//! - change scattering, geometry or air to make a fit look better: only what is named changes.
//! - tell apart what the data cannot: a sampling clock and a temperature scale all times alike, and come out as a set.
//!
//! # Example
//! A latency of 5 ms that the room file denies, hidden by the laboratory of the tests and found:
//! ```
//! use sabine_diagnose::{DiagnoseConfig, Diagnoser, Verdict};
//! use sabine_testkit::{Hidden, LabConfig, Laboratory};
//! let lab = Laboratory::new(LabConfig { seed: 3, receivers: 4, ..LabConfig::default() })?;
//! let folder = tempfile::tempdir()?;
//! let room = lab.write(&[Hidden::TimeZero { latency_s: 5e-3 }], &folder.path().join("room"), None)?;
//! let config = DiagnoseConfig { rays: 500, simulations: 10, ..DiagnoseConfig::default() };
//! let only = ["time_zero".to_owned(), "position_error".to_owned()];
//! let found = Diagnoser::new(config)?.with_only(&only)?.diagnose(&room, &[], &())?;
//! assert_eq!(found.verdict, Verdict::Explained);
//! assert_eq!(found.causes[0].effect, "time_zero");
//! let latency = &found.causes[0].parameters[0];
//! assert!((latency.value - 5.0).abs() < 0.05 && latency.unit == "ms");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Units
//! Energies relative to the direct sound at 1 m, seconds, metres, dB; evidence in nats (3 nats are odds of 20 to 1).
//!
//! # Accuracy
//! | claim | test |
//! |---|---|
//! | hidden effects are named, null rooms are not | `tests/it/hidden_effects.rs` |
//! | harmonics before the direct sound are found, noise there is not taken for them | `tests/it/hidden_distortion.rs` |
//! | panels and holes are found and located | `tests/it/hidden_surfaces.rs` |
//! | evidence and bounds of the fit against closed forms | unit tests of `likelihood/laplace.rs` |
//! | gradients of both likelihoods against central differences | unit tests of `likelihood/decay/tests.rs`, `likelihood/arrivals.rs` |
//! | any tracer serves | `tests/it/any_tracer.rs` |
//! | variances, groups of paths, octave shares against closed forms | unit tests of their modules |
//! | diffraction around a screen is found in finite differences of the wave equation, and not where sound goes straight | `tests/it/hidden_edges.rs` |
//! | rendering from the extended model against closed forms | `tests/it/rendering.rs` |
//!
//! `docs/validation/diagnose.md` has the figures, `cargo run --release -p sabine-validation --bin effect_atlas` makes them.
//!
//! # References
//! - D. J. C. MacKay: Information Theory, Inference, and Learning Algorithms, 2003, chapters 27 and 28 (evidence, Laplace).
//! - H. Kuttruff: Room Acoustics, 6th edition, 2017 (statistics of responses).
//! - I. Dokmanić et al.: Acoustic echoes reveal room shape. PNAS 110, 2013 (images from distances).
//! - J. B. Allen, D. A. Berkley: Image method for efficiently simulating small-room acoustics. JASA 65, 1979.

mod config;
mod diagnoser;
mod effect;
mod effects;
mod error;
mod extend;
mod found_parameter;
#[cfg(test)]
mod hand_made;
mod infer;
mod likelihood;
mod observe;
mod plan;
mod report;
mod simulate;
mod statistics;
mod survey;

pub use config::DiagnoseConfig;
pub use diagnoser::Diagnoser;
pub use effect::info::discriminating_measurement;
pub use effect::next_measurement::NextMeasurement;
pub use effect::reflection_gate::ReflectionGate;
pub use effect::{
    AddedReflection, ArrivalTerm, AuxiliaryEvidence, Case, ChannelChange, DecayTerm, Effect, EffectInfo,
    FittedCase, Nuisance, Parameter, PreArrivalTerm, ReflectionEvidence, ReflectionTerm, Stage, Term,
};
pub use effects::*;
pub use error::Error;
pub use extend::applied_changes::{AppliedChanges, CoupledDecay, Dimensions, GainOverTime, ThinPanel};
pub use extend::box_object::BoxObject;
pub use extend::displaced_surface::DisplacedSurface;
pub use extend::extended_model::{ExtendedModel, ModelCause};
pub use extend::extended_room::ExtendedRoom;
pub use extend::law_file::{absorption_by_angle, channel_response, laws_of_toml, read_laws, shipped_laws};
pub use extend::model_change::ModelChange;
pub use extend::moved_mesh::DisplacementError;
pub use extend::rigid_motion::RigidMotion;
pub use extend::uncertainty::Uncertainty;
pub use found_parameter::FoundParameter;
pub use likelihood::multilateration::{PredictedPath, UnassignedPeak, UnassignedPeaks};
pub use observe::pre_arrival::PreArrival;
pub use plan::config::PlanConfig;
pub use plan::cost::CostTable;
pub use plan::error::PlanError;
pub use plan::hypothesis::{Hypothesis, OpenQuestion};
pub use plan::measurement::PlannedMeasurement;
pub use plan::open_question::QuestionError;
pub use plan::outcome::{Chosen, Decision, EffectSize, LookAlikes, Plan, Weighing};
pub use plan::planner::Planner;
pub use report::compared_values::ComparedValue;
pub use report::diagnosis::{
    CandidateScore, Cause, DecayCurves, Diagnosis, FallenLaw, FitTest, FittedMaterial, FoundLaw, HeldOut,
    HeldOutGain, Isolability, LackOfFit, LawPoint, LawSearch, MovedReflection, RayDependence, ResidualCell,
    Verdict, VisibleLaw,
};
pub use simulate::scene_tracer::{EachScene, PreparedTracer, SceneTracer};
pub use simulate::tables::{Tables, Unprepared};
pub use simulate::traced_views::{ExpectedBins, TracedPairView, TracedRoomView};
pub use simulate::views::{ArrivalView, BandView};
pub use survey::planes::Plane;
pub use survey::surfaces::Surface;
pub use survey::{Place, Survey, SurveyedResponse};
