//! A voice in a room, live on a sound card: everything that does not need one.
//!
//! The application, `app`, adds the devices by cpal. It is a package outside of the workspace, for on Linux cpal needs the headers of
//! ALSA. Here is what can be tested on any machine: [`Player`] fills the callback of a device of any sample format and number of
//! channels; [`microphone`] carries sound from the callback of one device to that of another; [`Watch`] counts missed deadlines and
//! finds out that a device has vanished; [`read_room`] and [`read_voice`] bring files to the rate of the device.

mod command;
mod error;
mod files;
mod microphone;
mod player;
mod watch;

pub use command::Command;
pub use error::Error;
pub use files::{read_room, read_voice};
pub use microphone::{MicrophoneReader, MicrophoneWriter, microphone};
pub use player::{Input, Player, PlayerConfig};
pub use watch::{Figures, Watch};
