//! draft
mod arrival_model;
mod bins;
mod config;
mod diagnoser;
mod diagnosis;
mod discrepancy;
mod effect;
mod effects;
mod energy_model;
mod error;
mod extended_model;
mod extension;
mod gauss_newton;
mod hit_groups;
mod isolability;
mod kernel;
mod lack_of_fit;
mod measured;
mod prediction;
mod recording_chain;
mod rendering;
mod search;
mod survey;
mod traced_pair;
mod views;
mod workbench;

pub use config::DiagnoseConfig;
pub use diagnoser::Diagnoser;
pub use diagnosis::{
    CandidateScore, Cause, DecayCurves, Diagnosis, FittedMaterial, FoundParameter, HeldOut, HeldOutGain,
    Isolability, LackOfFit, ResidualCell, Verdict,
};
pub use effect::{Case, Effect, Evidence, Nuisance, Parameter, Stage};
pub use effects::*;
pub use error::Error;
pub use extended_model::{CoupledDecay, Dimensions, ExtendedModel};
pub use rendering::ExtendedRoom;
pub use survey::{Place, Survey, SurveyedResponse};
pub use views::{ArrivalView, BandView};
