//! The laws of a model between each source and each receiver.

use sabine_acoustics::{Air, Error as Cause};
use sabine_paths::laws::{BoundLaws, Law, LawError, LawSite};
use sabine_scene::{Receiver, Scene, Source};

/// Laws bound to each pair, `[source][receiver]`; empty where there are no laws.
pub(crate) fn bound_laws(
    laws: &[Law],
    scene: &Scene,
    (sources, receivers): (&[Source], &[Receiver]),
    air: &Air,
) -> Result<Vec<Vec<BoundLaws>>, (String, Cause)> {
    if laws.is_empty() {
        return Ok(Vec::new());
    }
    let between = |source: &Source, receiver: &Receiver| {
        BoundLaws::new(laws, &LawSite::new(scene, source, receiver, air))
    };
    let from = |source| receivers.iter().map(|receiver| between(source, receiver)).collect();
    sources.iter().map(from).collect::<Result<_, _>>().map_err(in_laws)
}

/// Checks that the laws can be applied together.
pub(crate) fn check_laws(laws: &[Law]) -> Result<(), (String, Cause)> {
    Law::check_together(laws).map_err(in_laws)
}

/// The field of a model and its fault.
fn in_laws(error: LawError) -> (String, Cause) {
    ("laws".to_owned(), error.into())
}
