//! A host without a window or a sound card: what a music program does with a plug-in, as far as the tests need it.

#![allow(dead_code, clippy::unwrap_used)] // each test program uses a part; a panic is how a test fails

use clack_extensions::latency::PluginLatency;
use clack_extensions::log::{HostLog, HostLogImpl, LogSeverity};
use clack_extensions::params::{
    HostParams, HostParamsImplMainThread, HostParamsImplShared, ParamClearFlags, ParamRescanFlags,
    PluginParams,
};
use clack_extensions::state::PluginState;
use clack_extensions::tail::{HostTail, HostTailImpl, PluginTail, TailLength};
use clack_host::events::event_types::ParamValueEvent;
use clack_host::prelude::*;
use sabine_clap_plugin::{Entry, ID, Parameter};
use std::ffi::CString;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

/// What the plug-in asked of its host.
#[derive(Default)]
pub struct Asked {
    log: Mutex<Vec<(LogSeverity, String)>>,
    pub callbacks: AtomicU32,
    pub rescans: AtomicU32,
    pub tail_changes: AtomicU32,
}

impl Asked {
    /// What was logged since the last time.
    pub fn log(&self) -> Vec<(LogSeverity, String)> {
        std::mem::take(&mut self.log.lock().unwrap())
    }
}

pub struct Shared(Arc<Asked>);
pub struct Main(Arc<Asked>);
pub struct Audio(Arc<Asked>);

impl SharedHandler<'_> for Shared {
    fn request_restart(&self) {}
    fn request_process(&self) {}
    fn request_callback(&self) {
        self.0.callbacks.fetch_add(1, Ordering::Relaxed);
    }
}

impl HostLogImpl for Shared {
    fn log(&self, severity: LogSeverity, message: &str) {
        self.0.log.lock().unwrap().push((severity, message.to_owned()));
    }
}

impl HostParamsImplShared for Shared {
    fn request_flush(&self) {}
}

impl MainThreadHandler<'_> for Main {}

impl HostParamsImplMainThread for Main {
    fn rescan(&self, _flags: ParamRescanFlags) {
        self.0.rescans.fetch_add(1, Ordering::Relaxed);
    }

    fn clear(&self, _param_id: ClapId, _flags: ParamClearFlags) {}
}

impl AudioProcessorHandler<'_> for Audio {}

impl HostTailImpl for Audio {
    fn changed(&mut self) {
        self.0.tail_changes.fetch_add(1, Ordering::Relaxed);
    }
}

pub struct TestHost;

impl HostHandlers for TestHost {
    type Shared<'a> = Shared;
    type MainThread<'a> = Main;
    type AudioProcessor<'a> = Audio;

    fn declare_extensions(builder: &mut HostExtensions<Self>, _shared: &Shared) {
        builder.register::<HostLog>().register::<HostParams>().register::<HostTail>();
    }
}

/// An instance of the plug-in.
pub struct Rack {
    pub instance: PluginInstance<TestHost>,
    pub asked: Arc<Asked>,
}

impl Rack {
    pub fn new() -> Self {
        let entry = PluginEntry::load_from_clack::<Entry>(c"/plugins/sabine.clap").unwrap();
        let info = HostInfo::new("test", "Sabine", "", "1").unwrap();
        let asked = Arc::new(Asked::default());
        let [shared, main] = [Arc::clone(&asked), Arc::clone(&asked)];
        let id = CString::new(ID).unwrap();
        let instance = PluginInstance::new(|()| Shared(shared), |_| Main(main), &entry, &id, &info).unwrap();
        Self { instance, asked }
    }

    /// With this room, and gains in dB.
    pub fn with_room(path: &Path, wet_db: f64, dry_db: f64) -> Self {
        let mut rack = Self::new();
        assert!(rack.load(state(path, wet_db, dry_db).as_bytes()), "{:?}", rack.asked.log());
        rack
    }

    pub fn load(&mut self, mut state: &[u8]) -> bool {
        let plugin = self.instance.plugin_handle();
        let extension: PluginState = plugin.get_extension().unwrap();
        extension.load(&plugin, &mut state).is_ok()
    }

    pub fn save(&mut self) -> String {
        let plugin = self.instance.plugin_handle();
        let extension: PluginState = plugin.get_extension().unwrap();
        let mut state = Vec::new();
        extension.save(&plugin, &mut state).unwrap();
        String::from_utf8(state).unwrap()
    }

    pub fn value(&mut self, parameter: Parameter) -> f64 {
        let plugin = self.instance.plugin_handle();
        let extension: PluginParams = plugin.get_extension().unwrap();
        extension.get_value(&plugin, parameter.id()).unwrap()
    }

    pub fn latency(&mut self) -> usize {
        let plugin = self.instance.plugin_handle();
        let extension: PluginLatency = plugin.get_extension().unwrap();
        extension.get(&plugin) as usize
    }

    /// None if the plug-in refuses the settings.
    pub fn try_start(&mut self, rate_hz: f64, block: u32, inputs: usize) -> Option<Player> {
        let configuration =
            PluginAudioConfiguration { sample_rate: rate_hz, min_frames_count: 1, max_frames_count: block };
        let audio = Audio(Arc::clone(&self.asked));
        let stopped = self.instance.activate(|_, _| audio, configuration).ok()?;
        Some(Player::new(stopped.start_processing().ok()?, inputs, block as usize))
    }

    pub fn start(&mut self, rate_hz: f64, block: u32, inputs: usize) -> Player {
        self.try_start(rate_hz, block, inputs).unwrap_or_else(|| panic!("{:?}", self.asked.log()))
    }

    pub fn stop(&mut self, player: Player) {
        self.instance.deactivate(player.processor.stop_processing());
    }

    /// As a host does soon after the plug-in has asked for it.
    pub fn call_back(&mut self) -> bool {
        let asked = self.asked.callbacks.swap(0, Ordering::Relaxed) > 0;
        if asked {
            self.instance.call_on_main_thread_callback();
        }
        asked
    }
}

/// A state as the plug-in writes it.
pub fn state(path: &Path, wet_db: f64, dry_db: f64) -> String {
    format!("Sabine room 1\nwet_db {wet_db}\ndry_db {dry_db}\nroom {}", path.display())
}

/// A change of a parameter at a sample of the whole input.
pub fn change(at: usize, parameter: Parameter, value: f64) -> ParamValueEvent {
    ParamValueEvent::new(at as u32, parameter.id(), Pckn::match_all(), value)
}

/// An active instance.
pub struct Player {
    pub processor: StartedPluginAudioProcessor<TestHost>,
    input_ports: AudioPorts,
    output_ports: AudioPorts,
    input: Vec<Vec<f32>>,
    output: Vec<Vec<f32>>,
    answers: EventBuffer,
}

impl Player {
    fn new(processor: StartedPluginAudioProcessor<TestHost>, inputs: usize, block: usize) -> Self {
        Self {
            processor,
            input_ports: AudioPorts::with_capacity(inputs, 1),
            output_ports: AudioPorts::with_capacity(2, 1),
            input: vec![vec![0.0; block]; inputs],
            output: vec![vec![0.0; block]; 2],
            answers: EventBuffer::new(),
        }
    }

    /// One call with the frames of `input`, at most a block of them. `around` sees nothing but the call itself.
    pub fn call(
        &mut self,
        input: &[&[f32]],
        events: &[ParamValueEvent],
        around: impl FnOnce(&mut dyn FnMut()),
    ) -> [&[f32]; 2] {
        let frames = input[0].len();
        for (own, given) in self.input.iter_mut().zip(input) {
            own[..frames].copy_from_slice(given);
        }
        // What the plug-in does not write must not pass for its output.
        self.output.iter_mut().for_each(|own| own.fill(f32::NAN));
        let given = self.input.iter_mut().map(|own| InputChannel::variable(&mut own[..frames]));
        let input = self.input_ports.with_input_buffers([AudioPortBuffer {
            latency: 0,
            channels: AudioPortBufferType::f32_input_only(given),
        }]);
        let wanted = self.output.iter_mut().map(|own| &mut own[..frames]);
        let mut output = self.output_ports.with_output_buffers([AudioPortBuffer {
            latency: 0,
            channels: AudioPortBufferType::f32_output_only(wanted),
        }]);
        let events = InputEvents::from_buffer(&events);
        let mut answers = self.answers.as_output();
        let mut status = None;
        around(&mut || {
            status = Some(self.processor.process(&input, &mut output, &events, &mut answers, None, None));
        });
        assert_eq!(status.unwrap().unwrap(), ProcessStatus::Tail);
        [&self.output[0][..frames], &self.output[1][..frames]]
    }

    /// All of the input and as much silence, in blocks of these sizes, again and again.
    pub fn render(
        &mut self,
        input: &[&[f32]],
        events: &[ParamValueEvent],
        blocks: &[usize],
    ) -> [Vec<f32>; 2] {
        let mut heard = [Vec::new(), Vec::new()];
        let mut blocks = blocks.iter().cycle();
        let (mut done, frames) = (0, input[0].len());
        while done < frames {
            let end = frames.min(done + blocks.next().unwrap());
            let now: Vec<ParamValueEvent> = events
                .iter()
                .filter(|event| (done..end).contains(&(event.header().time() as usize)))
                .map(|event| {
                    let mut event = *event;
                    event.set_time(event.header().time() - done as u32);
                    event
                })
                .collect();
            let part: Vec<&[f32]> = input.iter().map(|channel| &channel[done..end]).collect();
            let out = self.call(&part, &now, |call| call());
            heard.iter_mut().zip(out).for_each(|(heard, out)| heard.extend(out));
            done = end;
        }
        heard
    }

    pub fn tail(&mut self) -> TailLength {
        let plugin = self.processor.plugin_handle();
        let extension: PluginTail = plugin.get_extension().unwrap();
        extension.get(&plugin)
    }
}

/// Samples without pattern within `peak`.
pub fn noise(length: usize, seed: u32, peak: f32) -> Vec<f32> {
    let mut state = seed;
    (0..length)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            peak * (2.0 * (state >> 8) as f32 / (1 << 24) as f32 - 1.0)
        })
        .collect()
}

/// Decaying noise: a response whose last sample is a hundredth of its first.
pub fn decay(length: usize, seed: u32) -> Vec<f32> {
    let fall = |n: usize| 0.01_f32.powf(n as f32 / length as f32);
    noise(length, seed, 0.2).into_iter().enumerate().map(|(n, s)| fall(n) * s).collect()
}

/// The plain sum, one sample of the convolution.
pub fn convolved(input: &[f32], response: &[f32], n: usize) -> f64 {
    let taps = response.iter().enumerate();
    taps.filter_map(|(k, &h)| Some(f64::from(h) * f64::from(*input.get(n.checked_sub(k)?)?))).sum()
}
