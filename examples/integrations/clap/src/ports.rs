//! Channels in and out: stereo, or mono in and stereo out.

use crate::main_thread::MainThread;
use clack_extensions::audio_ports::{
    AudioPortFlags, AudioPortInfo, AudioPortInfoWriter, AudioPortType, PluginAudioPortsImpl,
};
use clack_extensions::audio_ports_config::{
    AudioPortConfigWriter, AudioPortsConfiguration, MainPortInfo, PluginAudioPortsConfigImpl,
};
use clack_plugin::plugin::PluginError;
use clack_plugin::prelude::ClapId;

/// Choices of channels: identifier, name, channels of the input.
const CONFIGURATIONS: [(ClapId, &[u8], u32); 2] =
    [(ClapId::new(0), b"stereo", 2), (ClapId::new(1), b"mono to stereo", 1)];
const PORT: ClapId = ClapId::new(0);

impl PluginAudioPortsImpl for MainThread<'_> {
    fn count(&self, _is_input: bool) -> u32 {
        1
    }

    fn get(&self, index: u32, is_input: bool, writer: &mut AudioPortInfoWriter) {
        if index == 0 {
            let inputs = self.inputs();
            let channel_count = if is_input { inputs } else { 2 };
            writer.set(&AudioPortInfo {
                id: PORT,
                name: if is_input { b"in" } else { b"out" },
                channel_count,
                flags: AudioPortFlags::IS_MAIN,
                port_type: AudioPortType::from_channel_count(channel_count),
                // Each piece of a block is read before it is written.
                in_place_pair: (inputs == 2).then_some(PORT),
            });
        }
    }
}

impl PluginAudioPortsConfigImpl for MainThread<'_> {
    fn count(&self) -> u32 {
        CONFIGURATIONS.len() as u32
    }

    fn get(&self, index: u32, writer: &mut AudioPortConfigWriter) {
        if let Some(&(id, name, inputs)) = CONFIGURATIONS.get(index as usize) {
            let port = |channel_count| {
                let port_type = AudioPortType::from_channel_count(channel_count);
                Some(MainPortInfo { channel_count, port_type })
            };
            writer.write(&AudioPortsConfiguration {
                id,
                name,
                input_port_count: 1,
                output_port_count: 1,
                main_input: port(inputs),
                main_output: port(2),
            });
        }
    }

    fn select(&self, config_id: ClapId) -> Result<(), PluginError> {
        let found = CONFIGURATIONS.iter().find(|(id, ..)| *id == config_id);
        let (_, _, inputs) = found.ok_or(PluginError::Message("there is no such configuration of ports"))?;
        self.set_inputs(*inputs);
        Ok(())
    }
}
