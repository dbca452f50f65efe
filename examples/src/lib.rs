//! What the example programs share: one style of plot, one kind of page, one progress bar.

mod bar;
mod chart;
mod output;
mod page;
mod spectrogram;

pub use bar::Bar;
pub use chart::{Chart, Look, Scale, Series, chart_sheet};
pub use output::{OutputError, OutputFolder};
pub use page::{Page, escape};
pub use spectrogram::spectrogram_png;

/// The code in `docs/how-to/` is compiled and run with the tests.
#[cfg(doctest)]
mod how_to {
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
