//! Which effects a test weighs: in the gate those that could pass for the hidden one, at night the whole catalogue.

use sabine_diagnose::{DiagnoseConfig, Diagnoser};
use sabine_testkit::at_night;

/// Weighs these effects, or the whole catalogue at night.
pub(crate) fn diagnoser_among(config: DiagnoseConfig, effects: &[&str]) -> Diagnoser {
    let whole = Diagnoser::new(config).expect("settings of a test are in their ranges");
    if at_night() {
        return whole;
    }
    let effects: Vec<String> = effects.iter().map(ToString::to_string).collect();
    whole.with_only(&effects).expect("effects of a test are in the catalogue")
}
