//! The code on the how-to pages, and the links between documents, under test. The examples stand beside this folder.

/// The code in `docs/how-to/` is compiled and run with the tests.
#[cfg(doctest)]
mod how_to {
    #[doc = include_str!("../../docs/how-to/audio-engines.md")]
    mod audio_engines {}
    #[doc = include_str!("../../docs/how-to/calibrate-a-room.md")]
    mod calibrate_a_room {}
    #[doc = include_str!("../../docs/how-to/live-use.md")]
    mod live_use {}
    #[doc = include_str!("../../docs/how-to/own-effect.md")]
    mod own_effect {}
    #[doc = include_str!("../../docs/how-to/own-estimator.md")]
    mod own_estimator {}
    #[doc = include_str!("../../docs/how-to/own-tracer.md")]
    mod own_tracer {}
    #[doc = include_str!("../../docs/how-to/train-on-my-data.md")]
    mod train_on_my_data {}
}
