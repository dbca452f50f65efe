//! The laws of a model between each source and each receiver.

use sabine_acoustics::{Air, Error as Cause};
use sabine_paths::laws::{BoundLaws, Law, LawError, LawSite};
use sabine_scene::{MeasuredRoom, Receiver, Scene, Source};

/// Laws bound to each pair, `[source][receiver]`, at the places of a model; empty where there are no laws. `room` knows the order of recordings.
pub(crate) fn bound_laws(
    laws: &[Law],
    scene: &Scene,
    (sources, receivers): (&[Source], &[Receiver]),
    (air, room): (&Air, &MeasuredRoom),
) -> Result<Vec<Vec<BoundLaws>>, (String, Cause)> {
    if laws.is_empty() {
        return Ok(Vec::new());
    }
    let between = |from: usize, to: usize| {
        let site = LawSite::new(scene, &sources[from], &receivers[to], air).among(sources, receivers);
        BoundLaws::new(laws, &site.with_recording_order(room.recorded_at(from, to)))
    };
    let of_source = |from| (0..receivers.len()).map(|to| between(from, to)).collect();
    (0..sources.len()).map(of_source).collect::<Result<_, _>>().map_err(in_laws)
}

/// Checks that the laws can be applied together.
pub(crate) fn check_laws(laws: &[Law]) -> Result<(), (String, Cause)> {
    Law::check_together(laws).map_err(in_laws)
}

/// The field of a model and its fault.
fn in_laws(error: LawError) -> (String, Cause) {
    ("laws".to_owned(), error.into())
}
