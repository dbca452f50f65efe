//! The reverberation of a room as a [CLAP](https://cleveraudio.org) plug-in: an audio effect for music and film programs.
//!
//! ```text
//! cargo build --release -p sabine-clap-plugin
//! ```
//!
//! What to do with the result, and what is heard: `docs/how-to/clap.md`. A host sees one plug-in, [`SabineRoom`]: stereo or mono in, stereo
//! out, gains of the reverberation and of the sound as it came in, a choice of rooms, and the room's file in the host's project.
//!
//! # Threads
//! - **Main thread** ([`MainThread`]): reads files, traces rooms, transforms responses. All that takes time or memory happens there.
//! - **Audio thread** ([`Processor`]): asks for no memory, opens no file, waits for nobody. It takes responses over from the main
//!   thread by [`sabine_eqfilter::RoomReverb`], which cross-fades them.
//! - Numbers that both need are atomic ([`Shared`]).
//!
//! # Does not
//! - show a window of its own: hosts draw its parameters.
//! - let a panic cross the border to the host: `clack-plugin` catches it and reports an error.

mod main_thread;
mod parameters;
mod ports;
mod processor;
mod rate;
mod room;
mod shared;
mod shelf;
mod state;

pub use main_thread::MainThread;
pub use parameters::Parameter;
pub use processor::Processor;
pub use shared::Shared;

use clack_extensions::audio_ports::PluginAudioPorts;
use clack_extensions::audio_ports_config::PluginAudioPortsConfig;
use clack_extensions::latency::PluginLatency;
use clack_extensions::params::PluginParams;
use clack_extensions::state::PluginState;
use clack_extensions::tail::PluginTail;
use clack_plugin::plugin::features::{AUDIO_EFFECT, MONO, REVERB, STEREO};
use clack_plugin::prelude::*;

/// Identifier of the plug-in, by which projects find it again.
pub const ID: &str = "org.sabine.room";
/// By so many samples the output is late, at any sample rate and any size of blocks; hosts make up for it.
pub const LATENCY_SAMPLES: u32 = 64;
/// Longest response in seconds.
pub const LONGEST_S: f64 = 10.0;
/// Length of the cross-fade to another room, and of changes of gain, in seconds.
pub const FADE_S: f64 = 0.05;

/// The plug-in: types of its threads, and what it tells hosts of itself.
#[derive(Clone, Copy, Debug)]
pub struct SabineRoom;

/// The way in for hosts, which the library exports as `clap_entry`.
pub type Entry = SinglePluginEntry<SabineRoom>;

clack_export_entry!(SinglePluginEntry<SabineRoom>);

impl Plugin for SabineRoom {
    type AudioProcessor<'a> = Processor<'a>;
    type Shared<'a> = Shared<'a>;
    type MainThread<'a> = MainThread<'a>;

    fn declare_extensions(builder: &mut PluginExtensions<Self>, _shared: Option<&Shared<'_>>) {
        builder
            .register::<PluginAudioPorts>()
            .register::<PluginAudioPortsConfig>()
            .register::<PluginLatency>()
            .register::<PluginParams>()
            .register::<PluginState>()
            .register::<PluginTail>();
    }
}

impl DefaultPluginFactory for SabineRoom {
    fn get_descriptor() -> PluginDescriptor {
        PluginDescriptor::new(ID, "Sabine room")
            .with_vendor("The Sabine developers")
            .with_version(env!("CARGO_PKG_VERSION"))
            .with_description("Reverberation of a measured or traced room")
            .with_features([AUDIO_EFFECT, REVERB, STEREO, MONO])
    }

    fn new_shared(host: HostSharedHandle<'_>) -> Result<Shared<'_>, PluginError> {
        Ok(Shared::new(host))
    }

    fn new_main_thread<'a>(
        host: HostMainThreadHandle<'a>,
        shared: &'a Shared<'a>,
    ) -> Result<MainThread<'a>, PluginError> {
        Ok(MainThread::new(host, shared))
    }
}
