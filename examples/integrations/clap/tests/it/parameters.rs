//! Parameters: what hosts show, type and automate.

use crate::host::{Rack, change, noise, state};
use clack_extensions::params::{ParamInfoBuffer, ParamInfoFlags, PluginParams};
use clack_host::prelude::*;
use sabine_acoustics::{SampleFormat, write_wav};
use sabine_clap_plugin::{FADE_S, LATENCY_SAMPLES, Parameter};
use std::ffi::CString;

const LATE: usize = LATENCY_SAMPLES as usize;

/// An instance whose room adds half of the sound as it is.
fn half() -> Rack {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.wav");
    write_wav(&path, &[0.5], 48_000, SampleFormat::Float32).unwrap();
    Rack::with_room(&path, 0.0, Parameter::LEAST_DB)
}

#[test]
fn hosts_see_ranges_names_and_texts() {
    let mut rack = Rack::new();
    let plugin = rack.instance.plugin_handle();
    let parameters: PluginParams = plugin.get_extension().unwrap();
    assert_eq!(parameters.count(&plugin), 3);
    let mut seen = Vec::new();
    for index in 0..3 {
        let mut buffer = ParamInfoBuffer::new();
        let info = parameters.get_info(&plugin, index, &mut buffer).unwrap();
        assert!(info.flags.contains(ParamInfoFlags::IS_AUTOMATABLE));
        assert_eq!(parameters.get_value(&plugin, info.id), Some(info.default_value));
        for value in [info.min_value, info.default_value, info.max_value] {
            let mut text = [0; 64];
            let text = parameters.value_to_text(&plugin, info.id, value, &mut text).unwrap();
            let text = CString::new(&*text).unwrap();
            let back = parameters.text_to_value(&plugin, info.id, &text);
            assert_eq!(back, Some(value), "{text:?}");
        }
        assert_eq!(parameters.text_to_value(&plugin, info.id, c"loud"), None);
        seen.push((String::from_utf8_lossy(info.name).into_owned(), info.min_value, info.max_value));
    }
    let gain = |name: &str| (name.to_owned(), -60.0, 12.0);
    assert_eq!(seen[..2], [gain("Wet"), gain("Dry")]);
    assert_eq!((&*seen[2].0, seen[2].1), ("Room", 0.0));
    assert!(parameters.get_info(&plugin, 3, &mut ParamInfoBuffer::new()).is_none());
    assert_eq!(parameters.get_value(&plugin, ClapId::new(77)), None);
}

#[test]
fn gains_change_the_level_from_their_sample_on_whatever_the_blocks() {
    let ones = vec![1.0; 12_000];
    let events = [
        change(1000, Parameter::Wet, -20.0),
        change(4000, Parameter::Dry, 0.0),
        change(7007, Parameter::Wet, 12.0),
        change(7007, Parameter::Dry, -60.0),
    ];
    let mut first: Option<[Vec<f32>; 2]> = None;
    for block in [64, 1, 480, 4096] {
        let mut rack = half();
        let mut player = rack.start(48e3, 4096, 2);
        let heard = player.render(&[&ones, &ones], &events, &[block]);
        rack.stop(player);
        let fade = (FADE_S * 48e3) as usize;
        for (from, to, wanted) in [
            (LATE, 1000, 0.5),
            (1000 + fade, 4000, 0.05),
            (4000 + fade, 7007, 1.05),
            (7007 + fade, 12_000, 0.5 * 10_f32.powf(0.6)),
        ] {
            let off = heard.iter().flat_map(|side| &side[from..to]).map(|s| (s - wanted).abs());
            assert!(off.fold(0.0, f32::max) < 1e-5, "{from} to {to}");
        }
        assert!((heard[0][1000 + fade / 2] - 0.275).abs() < 1e-3, "half way");
        match &first {
            Some(first) => assert!(*first == heard, "blocks of {block}: to the last bit"),
            None => first = Some(heard),
        }
    }
}

#[test]
fn values_reach_an_instance_that_does_not_sound() {
    let mut rack = half();
    let parameters: PluginParams = rack.instance.plugin_handle().get_extension().unwrap();
    let mut answers = EventBuffer::new();
    let events = [change(0, Parameter::Wet, -20.0), change(0, Parameter::Dry, f64::NAN)];
    let mut inactive = rack.instance.inactive_plugin_handle().unwrap();
    parameters.flush(&mut inactive, &InputEvents::from_buffer(&events), &mut answers.as_output());
    assert_eq!((rack.value(Parameter::Wet), rack.value(Parameter::Dry)), (-20.0, -60.0));
    let ones = [1.0; 200];
    let mut player = rack.start(48e3, 200, 2);
    assert!((player.render(&[&ones, &ones], &[], &[200])[0][199] - 0.05).abs() < 1e-6);

    // Active, but between two blocks.
    let mut active = player.processor.plugin_handle();
    let events = [change(0, Parameter::Wet, 0.0)];
    parameters.flush_active(&mut active, &InputEvents::from_buffer(&events), &mut answers.as_output());
    let ones = [1.0; 4000];
    let heard = player.render(&[&ones, &ones], &[], &[200]);
    assert!((heard[1][3999] - 0.5).abs() < 1e-6);
    rack.stop(player);
}

#[test]
fn a_state_sets_the_gains_of_a_sounding_instance() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.wav");
    write_wav(&path, &[0.5], 48_000, SampleFormat::Float32).unwrap();
    let mut rack = Rack::with_room(&path, 0.0, Parameter::LEAST_DB);
    let mut player = rack.start(48e3, 200, 2);
    assert!(rack.load(state(&path, -20.0, 0.0).as_bytes()));
    let heard = player.render(&[&[1.0; 8000], &[0.0; 8000]], &[], &[200]);
    assert!((heard[0][7999] - 1.05).abs() < 1e-5 && heard[1][7999] == 0.0);
    rack.stop(player);
}

#[test]
fn noise_stays_finite_under_a_storm_of_events() {
    let mut rack = half();
    let mut player = rack.start(48e3, 512, 2);
    let input = noise(4096, 1, 1.0);
    let events: Vec<_> = (0..4096)
        .map(|n| {
            change(
                n,
                if n % 3 == 0 { Parameter::Dry } else { Parameter::Wet },
                f64::from(n as u32 % 90) - 70.0,
            )
        })
        .collect();
    let heard = player.render(&[&input, &input], &events, &[512]);
    assert!(heard.iter().flatten().all(|s| s.is_finite() && s.abs() <= 6.0));
    rack.stop(player);
}
