//! How probable the observations are under parameters, and the fits of them.

pub(crate) mod arrivals;
pub(crate) mod decay;
pub(crate) mod discrepancy;
pub(crate) mod expansion;
pub(crate) mod laplace;
pub(crate) mod multilateration;
pub(crate) mod parameters;
pub(crate) mod polarity;
pub(crate) mod reflection_gates;
