//! Sabine in a browser: files are dropped on a page, and measured, traced and diagnosed there. Nothing leaves the machine.
//!
//! Bytes and JSON come in, JSON and samples go out. The functions here are plain Rust, tested like any other; `bindings` gives them to
//! JavaScript where the target is WebAssembly. `page/` holds the page and the worker in which all of it runs; `build_page.sh` makes one
//! HTML file of them, and `test_page.sh` tests that file in a browser.
//!
//! # Rules of the border
//! - Errors become exceptions of JavaScript with the library's words. What a page may be fed is refused before memory is taken for it
//!   ([`MAX_FILE_BYTES`], [`MAX_RESPONSE_S`]), since memory that cannot be had ends a WebAssembly module.
//! - The same seed gives the same result as on any other machine, but for the last digits of the browser's arithmetic functions.
//!
//! # Does not
//! - estimate from speech: the network would make the page several times as large.
//! - use threads: pages from a file have none.
//!
//! ```
//! use sabine_acoustics::{SampleFormat, Signal, encode_wav};
//! use sabine_wasm::Opened;
//! // Alternating signs under an envelope that falls by 60 dB in 0.5 s.
//! let decay = |i: i32| if i % 2 == 0 { 1.0 } else { -1.0 } * (-6.9078 * i as f32 / 8000.0).exp();
//! let bytes = encode_wav(&Signal::new((0..16_000).map(decay).collect(), 16_000)?, SampleFormat::Float32)?;
//! let opened = Opened::read("decay.wav", bytes)?;
//! assert_eq!(opened.responses()[0].samples.duration_s(), 1.0);
//! let photo = Opened::read("photo.wav", b"\x89PNG\r\n\x1a\n".to_vec()).unwrap_err();
//! assert!(photo.to_string().starts_with("photo.wav: this is PNG"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(target_family = "wasm")]
mod bindings;
mod error;
mod measured;
mod opened;
mod readings;
mod room;
mod survey;
mod traced;

pub use error::Error;
pub use measured::Measured;
pub use opened::{MAX_FILE_BYTES, MAX_RESPONSE_S, Opened, OpenedResponse};
pub use readings::{Cell, Row};
pub use room::{RoomSpec, library_json};
pub use survey::{DiagnoseSpec, Survey};
pub use traced::{TraceSpec, Traced};
