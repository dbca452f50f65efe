//! The command `sabine`: every job of the workspace from a terminal, and the reports and charts that its commands write.
//!
//! Stands on top of `sabine`. Other programs may use its reports: [`reports::match_room`] writes the page of the main job,
//! [`chart`] and [`page`] draw one's own. It does no acoustics: whatever is computed, is computed by the libraries.
//!
//! ```
//! use sabine_cli::chart::{Chart, Look, Scale, Series};
//! let t30 = Series::new("T30", Look::Line, 0, vec![(500.0, 0.62), (1000.0, 0.58)]);
//! let chart = Chart {
//!     x_label: "Octave (Hz)".into(),
//!     y_label: "Reverberation time (s)".into(),
//!     x: Scale::Octaves(vec![500.0, 1000.0]),
//!     y: Some((0.0, 1.0)),
//!     series: vec![t30],
//!     small: true,
//! };
//! assert!(chart.svg()?.starts_with("<svg"));
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! ```

#[macro_use]
mod console;

pub mod bar;
mod channel;
pub mod chart;
mod command;
mod commands;
mod demo;
mod failure;
mod laws;
mod modelled;
mod outline;
pub mod output;
pub mod page;
mod positions;
mod room;
mod shell;
pub mod spectrogram;
pub mod stop;

pub use command::{Sabine, command, run};
pub use failure::Failure;

/// Pages that commands write, for other programs.
pub mod reports {
    pub use crate::commands::match_room::report::html as match_room;
}
