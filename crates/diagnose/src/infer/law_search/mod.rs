//! The search for a law that no catalogue lists: a grammar of formulas is screened by score tests, the best few are fitted beside the
//! catalogue, and what is chosen must stand trial.

pub(crate) mod best;
mod columns;
mod family;
mod features;
mod law_screen;
mod null_model;
pub(crate) mod plot;
pub(crate) mod rival;
mod screen;
pub(crate) mod shortlist;
pub(crate) mod trial;
pub(crate) mod vault;
pub(crate) mod visible;
