//! Fits the absorption of a room's materials so that its simulated decay meets what was heard or measured.
//!
//! # Where it stands
//!
//! A tracer hands over a [`PathSet`](sabine_paths::PathSet): every path with its length and the materials it met, free of
//! absorption. This crate finds the absorption with which the energy of these paths decays as it should, **without
//! tracing again**. It knows nothing of geometry, of speech or of pressure responses.
//!
//! It does **not**
//! - invent what the data do not hold. One reverberation time for each octave determines one combination of absorptions. Of
//!   all materials that meet it the fit takes the most probable by the given priors, and names what stays open;
//! - change scattering, geometry or air;
//! - correct levels: only decay is fitted (levels are `sabine-eqfilter`'s part);
//! - trace. [`MaterialFitter::fit_t60_retracing`] asks a closure for more paths until T60 is sure, and holds the fit against
//!   paths that it has not seen.
//!
//! ```toml
//! [dependencies]
//! sabine-optimize = "0.1"
//! ```
//!
//! # Example
//!
//! ```
//! use sabine_acoustics::*;
//! use sabine_paths::*;
//! use sabine_scene::*;
//! use sabine_optimize::*;
//! // A room in which a ray meets a wall every 3 m: thirty batches of rays, 1 s long.
//! let mut paths = PathSet::new(1, 343.2);
//! let up = [0.0, 0.0, 1.0];
//! for ray in 0..32u8 {
//!     let mut chain = PathSet::DIRECT;
//!     for hit in 0..114 {
//!         chain = paths.reflect(chain, 0, Reflection::Specular);
//!         let length_m = 3.0 * f64::from(hit) + 3.0 * f64::from(ray) / 32.0;
//!         paths.push(Contribution {
//!             length_m, log_weight: 0.0, chain, tail: PathSet::DIRECT, departure: up, arrival: up, batch: Some(ray),
//!         });
//!     }
//! }
//! let octaves = Bands::SIMULATION;
//! let wall = Material::uniform(octaves, 0.1, 0.0)?;
//! let prior = AbsorptionPrior::uniform(octaves, 0.1, 0.1);
//! let target_s = PerBand::uniform(Bands::T60, Estimate::exact(0.5));
//! let fit = MaterialFitter::new(FitConfig::default())?
//!     .fit_t60(&[&paths], &FitProblem::new(&[wall], &[prior], &Air::default()), &target_s, &())?;
//!
//! // Eyring at 1 kHz: 60 dB in 0.5 s are 120 dB/s, less 1.6 in the air; 114.4 reflections a second.
//! let eyring = 1.0 - 10f64.powf(-(120.0 - 1.6) / 114.4 / 10.0);
//! assert!((fit.materials[0].absorption().at_hz(1000.0).unwrap() - eyring).abs() < 0.002);
//! assert!((fit.predicted_t60_s.at_hz(1000.0).unwrap().as_ref().unwrap().value - 0.5).abs() < 0.0025);
//! assert!(fit.unreachable.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What you need
//!
//! | type | for |
//! |---|---|
//! | [`MaterialFitter`], [`FitConfig`] | the fit to reverberation times |
//! | [`Retrace`], [`RetraceConfig`], [`RetracedFit`] | the same, traced again until other rays confirm it |
//! | [`MeasuredDecay`], [`MeasuredPair`], [`ResponseFit`] | the fit to measured responses ([`MaterialFitter::fit_responses`]) |
//! | [`MeasuredParameter`], [`MeasuredTable`], [`TableFit`] | the fit to tables of T30, EDT, C80 ... of each pair ([`MaterialFitter::fit_tables`]), or to tables and responses ([`MaterialFitter::fit_measured`]) |
//! | [`TableMisfit`], [`ParameterMisfit`], [`OctaveMisfit`] | a simulation against a table, value by value and octave by octave |
//! | [`DecayMisfit`] | a simulation against a response, for places that were held out |
//! | [`PredictedChange`], [`RoomPrediction`] | what if: T60, C50, D50 before and after a change of materials, and how sure their difference is |
//! | [`AbsorptionPrior`] | what is known of a material beforehand; a standard deviation of zero holds it |
//! | [`MaterialFit`] | the answer, with [`Unreachable`] targets, [`AtBound`], [`Undetermined`] and [`Warning`] beside it; [`Unconverged`] bands have none |
//! | [`SlopeEvaluation`], [`SlopeObjective`] | the cost (m - m')2 of one band with its exact gradient: decay curve, the paper's, Li's |
//! | [`RegularisedSlope`], [`Logit`], [`ForArgmin`], [`minimise`], [`Stop`] | the same for other solvers, argmin's among them |
//!
//! # Units
//!
//! Times in seconds, slopes in dB/s (negative), absorption as share of energy at random incidence, frequencies in Hz as
//! nominal octave centres.
//!
//! # Accuracy
//!
//! | claim | test |
//! |---|---|
//! | gradients equal central differences to 1e-6, inside and near the bounds | `tests/it/gradient.rs` |
//! | argmin's L-BFGS in logit variables reaches the optimum of L-BFGS-B | `tests/it/gradient.rs` |
//! | reachable targets are met within 0.5 %, and Eyring's formula agrees within 0.2 % and the Monte-Carlo error | `tests/it/fit_t60.rs` |
//! | one material: mean absolute error of absorption below 0.0013 from another seed | `tests/it/fit_t60.rs` |
//! | of all materials that meet the target, the most probable | `tests/it/fit_t60.rs` |
//! | standard errors cover: standardised errors have mean square 1 | `tests/it/fit_t60.rs` |
//! | one material from the T60 of another tracer: absorption within 0.0013 | `tests/it/other_tracers.rs` |
//! | responses: the optimum of a compass search over plain sums of all paths, smooth or not | tests of `response_solver` |
//! | what filters pass of a neighbouring octave that rings longer is not taken for the octave's own decay | tests of `response_leaks` |
//! | three materials from two responses: intervals cover, and what is open is named | `tests/it/other_tracers.rs` |
//! | six from twelve: mean absolute error below 0.02 from 2 kHz on, where the Cramer-Rao bound allows it | `tests/it/twelve_pairs.rs` |
//! | a first step to where the cost is infinite is shortened, and T30 of a two-room flat met within 6 % | tests of `response_solver`, `tests/it/two_room_flat.rs` |
//! | weights that follow the materials come to rest, for eight seeds of eight | `tests/it/swinging_weights.rs` |
//! | tables of parameters: the spread of each by interference is that of random responses within 20 %, and of T20 and T30 that of ISO 3382-2 within 30 % | `tests/it/tables.rs` |
//! | three materials from the tables of six pairs: intervals cover, and a wrong value is pointed at | `tests/it/tables.rs` |
//! | what has not converged is an error or a warning, never a result | tests of `bounded` and `assembly` |
//! | arrivals that are off by a millisecond are allowed for where that is said | `tests/it/other_tracers.rs` |
//! | rays are added until T60 is as sure as asked for | `tests/it/retracing.rs` |
//!
//! `docs/validation/optimize.md` has rooms, targets from 0.2 to 2.5 s, and measured responses.
//!
//! These rooms mix perfectly by construction. In a real one the paths are a sample: the T60 of an independent trace differs by
//! the Monte-Carlo errors of both, which [`MaterialFit::predicted_t60_s`] states and which fall with the square root of
//! the number of rays.
//!
//! # References
//!
//! The derivation, with a case worked by hand: `docs/explanation/objective.md`.
//!
//! - Tang, Bryan, Li, Langlois, Manocha, "Scene-aware audio rendering via deep acoustic analysis", IEEE TVCG 26(5), 2020.
//! - Li, Langlois, Zheng, "Scene-aware audio for 360 videos", ACM TOG 37(4), 2018.
//! - Zhu, Byrd, Lu, Nocedal, "Algorithm 778: L-BFGS-B", ACM TOMS 23(4), 1997.
//! - ISO 3382-1:2009, ISO 3382-2:2008: decay curves and reverberation time.
//! - Davy, Dunn, Dubout, "The variance of decay rates in reverberation rooms", Acustica 43, 1979.

mod assembly;
mod bounded;
mod config;
mod decay;
mod decay_slope;
mod error;
mod expansion;
mod fit;
mod fit_problem;
mod fitter;
mod group;
mod history;
mod measured_decay;
mod measured_parameter;
mod misfit;
mod objective;
mod parameter_readings;
mod prediction;
mod pulse;
mod response_band;
mod response_expansion;
mod response_leaks;
mod response_solver;
mod response_spread;
mod responses;
mod retrace;
mod scale;
mod single_paths;
mod slope_evaluation;
mod slope_model;
mod table_band;
mod table_expansion;
mod table_misfit;
mod tables;
mod uncertainty;
mod unknowns;
mod variables;

pub use bounded::{Minimum, Stop, minimise};
pub use config::{AbsorptionPrior, FitConfig, SlopeObjective};
pub use error::Error;
pub use fit::{
    AtBound, MaterialFit, Unconverged, Undetermined, UndeterminedKind, Unreachable, UnreachableReason,
    Warning,
};
pub use fit_problem::FitProblem;
pub use fitter::MaterialFitter;
pub use measured_decay::MeasuredDecay;
pub use measured_parameter::{MeasuredParameter, MeasuredTable};
pub use misfit::DecayMisfit;
pub use objective::Objective;
pub use prediction::{PredictedChange, RoomPrediction};
pub use responses::{MeasuredPair, ResponseFit};
pub use retrace::{NotVerified, Retrace, RetraceConfig, RetracedFit};
pub use slope_evaluation::SlopeEvaluation;
pub use table_misfit::{OctaveMisfit, ParameterMisfit, TableMisfit};
pub use tables::TableFit;
pub use variables::{ForArgmin, Logit, RegularisedSlope};
