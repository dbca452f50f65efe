//! Which causes the observations support.

pub(crate) mod arrival_fits;
pub(crate) mod baseline;
pub(crate) mod candidates;
pub(crate) mod confirmation;
pub(crate) mod cross_validation;
pub(crate) mod direct_evidence;
pub(crate) mod isolability;
pub(crate) mod lack_of_fit;
pub(crate) mod law_search;
pub(crate) mod naming;
pub(crate) mod prediction;
pub(crate) mod ranking;
pub(crate) mod ray_dependence;
pub(crate) mod search;
pub(crate) mod selection;
pub(crate) mod visibility;
