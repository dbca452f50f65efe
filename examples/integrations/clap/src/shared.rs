//! What the threads of the plug-in share.

use crate::parameters::{Parameter, Parameters};
use crate::shelf::Shelf;
use clack_plugin::events::event_types::ParamValueEvent;
use clack_plugin::host::HostSharedHandle;
use clack_plugin::plugin::PluginShared;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Numbers that both the main thread and the audio thread need.
pub struct Shared<'a> {
    host: HostSharedHandle<'a>,
    pub(crate) shelf: Shelf,
    pub(crate) parameters: Parameters,
    /// Length of the response that is heard, or will be after the cross-fade, in samples.
    response_samples: AtomicU32,
    /// The host handed in samples that are no sound; the main thread is to say so.
    bad_input: AtomicBool,
}

impl<'a> PluginShared<'a> for Shared<'a> {}

impl<'a> Shared<'a> {
    pub(crate) fn new(host: HostSharedHandle<'a>) -> Self {
        Self {
            host,
            shelf: Shelf::of_user(),
            parameters: Parameters::default(),
            response_samples: AtomicU32::new(0),
            bad_input: AtomicBool::new(false),
        }
    }

    /// Takes a value from the host; says which parameter has changed by it. The main thread reads another room.
    pub(crate) fn set_by_event(&self, event: &ParamValueEvent) -> Option<Parameter> {
        let parameter = event.param_id().and_then(Parameter::of_id)?;
        let changed = self.parameters.set(parameter, event.value(), self.shelf.values());
        if changed && parameter == Parameter::Room {
            self.host.request_callback();
        }
        changed.then_some(parameter)
    }

    pub(crate) fn set_response_samples(&self, samples: usize) {
        self.response_samples.store(u32::try_from(samples).unwrap_or(u32::MAX), Ordering::Relaxed);
    }

    pub(crate) fn response_samples(&self) -> u32 {
        self.response_samples.load(Ordering::Relaxed)
    }

    pub(crate) fn tell_bad_input(&self) {
        self.bad_input.store(true, Ordering::Relaxed);
        self.host.request_callback();
    }

    pub(crate) fn take_bad_input(&self) -> bool {
        self.bad_input.swap(false, Ordering::Relaxed)
    }
}
