//! Long work reports how far it is, and can be stopped.

use crate::error::Error;
use std::ops::ControlFlow;

/// Hears how far long work has come; `Break` stops it with [`Error::Cancelled`].
///
/// Closures are observers, and `()` is the one that does not care. Called from any thread.
pub trait Observer: Sync {
    /// `done` of `total` steps of `stage` are behind us. `total` is zero where it is not known.
    fn progress(&self, stage: &str, done: u64, total: u64) -> ControlFlow<()>;
}

impl Observer for () {
    fn progress(&self, _: &str, _: u64, _: u64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl<F: Fn(&str, u64, u64) -> ControlFlow<()> + Sync> Observer for F {
    fn progress(&self, stage: &str, done: u64, total: u64) -> ControlFlow<()> {
        self(stage, done, total)
    }
}

/// Reports progress and turns a request to stop into an error.
///
/// # Errors
/// [`Error::Cancelled`] if the observer asks to stop.
pub fn report(observer: &dyn Observer, stage: &str, done: u64, total: u64) -> Result<(), Error> {
    match observer.progress(stage, done, total) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Cancelled { stage: stage.to_owned() }),
    }
}
