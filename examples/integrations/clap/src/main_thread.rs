//! The main thread: everything that takes time or memory.

use crate::parameters::{Parameter, read_db, write_db};
use crate::rate::whole_rate_hz;
use crate::room::{Failure, Place, Room};
use crate::shared::Shared;
use crate::state::{LONGEST, State};
use crate::{FADE_S, LATENCY_SAMPLES, LONGEST_S};
use clack_extensions::latency::PluginLatencyImpl;
use clack_extensions::log::{HostLog, LogSeverity};
use clack_extensions::params::{
    HostParams, ParamDisplayWriter, ParamInfo, ParamInfoFlags, ParamInfoWriter, ParamRescanFlags,
    PluginMainThreadParams,
};
use clack_extensions::state::PluginStateImpl;
use clack_plugin::events::event_types::ParamValueEvent;
use clack_plugin::host::HostMainThreadHandle;
use clack_plugin::plugin::{PluginError, PluginMainThread};
use clack_plugin::prelude::{ClapId, InputEvents, OutputEvents};
use clack_plugin::stream::{InputStream, OutputStream};
use clack_plugin::utils::Cookie;
use sabine_acoustics::ImpulseResponse;
use sabine_eqfilter::{RoomReverb, RoomReverbConfig, RoomReverbControl};
use std::cell::{Cell, RefCell};
use std::ffi::{CStr, CString};
use std::fmt::{self, Write as _};
use std::io::{Read, Write};
use std::path::PathBuf;
use std::sync::Arc;

/// What belongs to the main thread.
///
/// A host may call back into the plug-in from any of its own functions, so nothing is borrowed while one is called.
pub struct MainThread<'a> {
    host: HostMainThreadHandle<'a>,
    shared: &'a Shared<'a>,
    log: Option<HostLog>,
    parameters: Option<HostParams>,
    inputs: Cell<u32>,
    /// Room of the project's state, where it is none of the folder's.
    project: RefCell<Option<PathBuf>>,
    /// The room that was read last, and where it was.
    room: RefCell<Option<(Place, Arc<Room>)>>,
    /// Controls the reverb while the instance is active.
    control: RefCell<Option<RoomReverbControl>>,
}

impl<'a> MainThread<'a> {
    pub(crate) fn new(host: HostMainThreadHandle<'a>, shared: &'a Shared<'a>) -> Self {
        Self {
            log: host.get_extension(),
            parameters: host.get_extension(),
            host,
            shared,
            inputs: Cell::new(2),
            project: RefCell::new(None),
            room: RefCell::new(None),
            control: RefCell::new(None),
        }
    }

    /// Channels of the input.
    pub(crate) fn inputs(&self) -> u32 {
        self.inputs.get()
    }

    pub(crate) fn set_inputs(&self, inputs: u32) {
        self.inputs.set(inputs);
    }

    /// Plans the reverb for a sample rate in Hz.
    pub(crate) fn activate(&self, rate_hz: f64) -> Result<RoomReverb, Failure> {
        let sample_rate_hz = whole_rate_hz(rate_hz)?;
        self.say(self.follow());
        let inputs = self.inputs.get() as usize;
        let config = RoomReverbConfig {
            sample_rate_hz,
            inputs,
            outputs: 2,
            block: LATENCY_SAMPLES as usize,
            // Resampling may round up to a sample more.
            longest_s: LONGEST_S + 0.01,
            fade_s: FADE_S,
            wet: self.shared.parameters.factor(Parameter::Wet),
            dry: self.shared.parameters.factor(Parameter::Dry),
        };
        let responses = match self.heard().unwrap_or_else(Room::silent).at_rate(sample_rate_hz, inputs) {
            Ok(responses) => responses,
            Err(error) => {
                self.say(Err(error));
                Room::silent().at_rate(sample_rate_hz, inputs)?
            }
        };
        let reverb = RoomReverb::new(&responses, config)?;
        self.shared.set_response_samples(longest(&responses));
        self.control.replace(Some(reverb.control()));
        Ok(reverb)
    }

    pub(crate) fn deactivate(&self) {
        self.control.replace(None);
    }

    fn place(&self) -> Place {
        let value = self.shared.parameters.get(Parameter::Room);
        self.shared.shelf.place(value, self.project.borrow().as_ref())
    }

    /// The room, if the one that was chosen could be read.
    fn heard(&self) -> Option<Arc<Room>> {
        self.room.borrow().as_ref().map(|(_, room)| Arc::clone(room))
    }

    /// Reads the room that is chosen, unless it is the one that was read last, and hands it to the reverb. If it cannot be read, there is
    /// none, for another room in its place would be taken for it; the next call tries again.
    fn follow(&self) -> Result<(), Failure> {
        let place = self.place();
        if self.room.borrow().as_ref().is_some_and(|(last, _)| *last == place) {
            return Ok(());
        }
        let read = Room::of(&place);
        self.room.replace(read.as_ref().ok().map(|room| (place, Arc::clone(room))));
        let room = read.as_ref().map_or_else(|_| Room::silent(), Arc::clone);
        let handed_over = self.hand_over(&room);
        read.and(handed_over)
    }

    fn hand_over(&self, room: &Room) -> Result<(), Failure> {
        let control = self.control.borrow();
        let Some(control) = control.as_ref() else { return Ok(()) };
        let responses = room.at_rate(control.sample_rate_hz(), self.inputs.get() as usize)?;
        control.exchange(&responses)?;
        self.shared.set_response_samples(longest(&responses));
        Ok(())
    }

    /// Hands the gains to the reverb, if the instance is active.
    fn set_gains(&self) -> Result<(), Failure> {
        let control = self.control.borrow();
        let Some(control) = control.as_ref() else { return Ok(()) };
        control.set_wet(self.shared.parameters.factor(Parameter::Wet))?;
        Ok(control.set_dry(self.shared.parameters.factor(Parameter::Dry))?)
    }

    /// Says what went wrong in the host's log.
    fn say(&self, outcome: Result<(), Failure>) {
        if let Err(error) = outcome {
            self.log(LogSeverity::Error, &error.to_string());
        }
    }

    fn log(&self, severity: LogSeverity, message: &str) {
        let message = CString::new(message.replace('\0', " "));
        if let (Some(log), Ok(message)) = (self.log, message) {
            log.log(&self.host.shared(), severity, &message);
        }
    }

    fn rescan(&self, flags: ParamRescanFlags) {
        if let Some(parameters) = self.parameters {
            parameters.rescan(&self.host, flags);
        }
    }
}

/// Length of the longest response in samples.
fn longest(responses: &[ImpulseResponse]) -> usize {
    responses.iter().map(|response| response.samples().len()).max().unwrap_or(0)
}

impl<'a> PluginMainThread<'a, Shared<'a>> for MainThread<'a> {
    /// The audio thread has asked for this: another room is chosen, or the host handed in what is no sound.
    fn on_main_thread(&self) {
        self.say(self.follow());
        if self.shared.take_bad_input() {
            let message =
                "samples that are not finite, or more than 120 dB beyond full scale, count as silence";
            self.log(LogSeverity::HostMisbehaving, message);
        }
        // Responses that went out of use.
        if let Some(control) = self.control.borrow().as_ref() {
            control.collect();
        }
    }
}

impl PluginLatencyImpl for MainThread<'_> {
    fn get(&self) -> u32 {
        LATENCY_SAMPLES
    }
}

impl PluginStateImpl for MainThread<'_> {
    fn save(&self, output: &mut OutputStream) -> Result<(), PluginError> {
        let values = &self.shared.parameters;
        let (wet_db, dry_db) = (values.get(Parameter::Wet), values.get(Parameter::Dry));
        let state = State { wet_db, dry_db, place: self.place() }.write().map_err(failed)?;
        output.write_all(state.as_bytes())?;
        Ok(())
    }

    /// A state that is not ours changes nothing. That of a room that cannot be read is refused, too, but stays in the project: it may be
    /// the disk that is missing.
    fn load(&self, input: &mut InputStream) -> Result<(), PluginError> {
        let mut bytes = Vec::new();
        input.take(LONGEST).read_to_end(&mut bytes)?;
        let state = State::read(&bytes).map_err(failed)?;
        let (room, project) = self.shared.shelf.value(&state.place);
        self.project.replace(project);
        let values =
            [(Parameter::Wet, state.wet_db), (Parameter::Dry, state.dry_db), (Parameter::Room, room)];
        for (parameter, value) in values {
            self.shared.parameters.set(parameter, value, self.shared.shelf.values());
        }
        let gains_set = self.set_gains();
        let read = self.follow().and(gains_set);
        self.rescan(ParamRescanFlags::VALUES | ParamRescanFlags::TEXT);
        read.map_err(failed)
    }
}

fn failed(error: Failure) -> PluginError {
    PluginError::Error(error)
}

impl PluginMainThreadParams for MainThread<'_> {
    fn count(&self) -> u32 {
        Parameter::ALL.len() as u32
    }

    fn get_info(&self, param_index: u32, info: &mut ParamInfoWriter) {
        let Some(&parameter) = Parameter::ALL.get(param_index as usize) else { return };
        let (min_value, max_value, stepped) = match parameter {
            Parameter::Wet | Parameter::Dry => {
                (Parameter::LEAST_DB, Parameter::MOST_DB, ParamInfoFlags::empty())
            }
            Parameter::Room => (0.0, f64::from(self.shared.shelf.values() - 1), ParamInfoFlags::IS_STEPPED),
        };
        info.set(&ParamInfo {
            id: parameter.id(),
            flags: ParamInfoFlags::IS_AUTOMATABLE | stepped,
            cookie: Cookie::empty(),
            name: parameter.name().as_bytes(),
            module: b"",
            min_value,
            max_value,
            default_value: parameter.default(),
        });
    }

    fn get_value(&self, param_id: ClapId) -> Option<f64> {
        Parameter::of_id(param_id).map(|parameter| self.shared.parameters.get(parameter))
    }

    fn value_to_text(&self, param_id: ClapId, value: f64, writer: &mut ParamDisplayWriter) -> fmt::Result {
        match Parameter::of_id(param_id).ok_or(fmt::Error)? {
            Parameter::Wet | Parameter::Dry => write_db(value, writer),
            Parameter::Room => {
                let value = value.round().clamp(0.0, f64::from(self.shared.shelf.values() - 1));
                let place = self.shared.shelf.place(value, self.project.borrow().as_ref());
                match &place {
                    Place::BuiltIn => write!(writer, "{value}: built-in hall"),
                    Place::Nothing => write!(writer, "{value}: no room"),
                    Place::At(path) => {
                        let name = path.file_name().unwrap_or_default().to_string_lossy();
                        write!(writer, "{value}: {name}")
                    }
                }
            }
        }
    }

    fn text_to_value(&self, param_id: ClapId, text: &CStr) -> Option<f64> {
        let text = text.to_str().ok()?;
        match Parameter::of_id(param_id)? {
            Parameter::Wet | Parameter::Dry => read_db(text),
            Parameter::Room => {
                let number = text.split(':').next().unwrap_or_default().trim();
                let value: u32 = number.parse().ok()?;
                (value < self.shared.shelf.values()).then_some(f64::from(value))
            }
        }
    }

    fn flush(&self, changes: &InputEvents, _answers: &mut OutputEvents) {
        for event in changes.iter().filter_map(|event| event.as_event::<ParamValueEvent>()) {
            self.shared.set_by_event(event);
        }
    }
}
