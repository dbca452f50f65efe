//! What the gate has no time for.

/// Set by `cargo xtask nightly`.
const WHOLE_CATALOGUE: &str = "SABINE_WHOLE_CATALOGUE";

/// Whether tests run at night: with more rooms, rays and receivers than the gate has time for, and the whole catalogue of effects.
pub fn at_night() -> bool {
    std::env::var_os(WHOLE_CATALOGUE).is_some()
}
