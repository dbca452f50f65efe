//! What a host learns before anything sounds.

use crate::host::Rack;
use clack_extensions::audio_ports::{AudioPortFlags, AudioPortInfoBuffer, AudioPortType, PluginAudioPorts};
use clack_host::prelude::*;
use sabine_clap_plugin::{Entry, ID, LATENCY_SAMPLES};

#[test]
fn the_entry_names_one_plug_in() {
    let entry = PluginEntry::load_from_clack::<Entry>(c"/plugins/sabine.clap").unwrap();
    let factory = entry.get_plugin_factory().unwrap();
    assert_eq!(factory.plugin_count(), 1);
    let descriptor = factory.plugin_descriptor(0).unwrap();
    let text = |text: Option<&std::ffi::CStr>| text.unwrap().to_str().unwrap().to_owned();
    assert_eq!((text(descriptor.id()), text(descriptor.name())), (ID.to_owned(), "Sabine room".to_owned()));
    assert_eq!(text(descriptor.version()), env!("CARGO_PKG_VERSION"));
    let features: Vec<_> = descriptor.features().map(|f| f.to_str().unwrap().to_owned()).collect();
    assert_eq!(features, ["audio-effect", "reverb", "stereo", "mono"]);
    let info = HostInfo::new("test", "Sabine", "", "1").unwrap();
    assert!(PluginInstance::<()>::new(|()| (), |_| (), &entry, c"org.sabine.other", &info).is_err());
}

/// The file that a host loads: cargo builds it beside the library that these tests link.
#[test]
fn the_library_exports_its_entry() {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    let program = std::env::current_exe().unwrap();
    let library = program.with_file_name(format!("{DLL_PREFIX}sabine_clap_plugin{DLL_SUFFIX}"));
    let bytes = std::fs::read(&library).unwrap_or_else(|e| panic!("{}: {e}", library.display()));
    let name = b"clap_entry\0";
    assert!(bytes.windows(name.len()).any(|window| window == name), "no symbol clap_entry");
}

#[test]
fn one_stereo_port_leads_in_and_one_out() {
    let mut rack = Rack::new();
    assert_eq!(rack.latency(), LATENCY_SAMPLES as usize);
    let plugin = rack.instance.plugin_handle();
    let ports: PluginAudioPorts = plugin.get_extension().unwrap();
    for is_input in [true, false] {
        assert_eq!(ports.count(&plugin, is_input), 1);
        let mut buffer = AudioPortInfoBuffer::new();
        let port = ports.get(&plugin, 0, is_input, &mut buffer).unwrap();
        assert_eq!((port.channel_count, port.port_type), (2, Some(AudioPortType::STEREO)));
        assert_eq!(port.flags, AudioPortFlags::IS_MAIN);
        assert!(port.in_place_pair.is_some());
        assert!(ports.get(&plugin, 1, is_input, &mut AudioPortInfoBuffer::new()).is_none());
    }
}
