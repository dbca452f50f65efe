//! What the example programs share: one style of plot, one kind of page, one progress bar.

mod bar;
mod chart;
mod output;
mod page;
mod spectrogram;

pub use bar::Bar;
pub use chart::{Chart, Look, Scale, Series};
pub use output::{OutputError, OutputFolder};
pub use page::{Page, escape};
pub use spectrogram::spectrogram_png;
