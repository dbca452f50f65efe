//! Long work that Ctrl-C stops.

use crate::failure::Failure;
use pyo3::prelude::*;
use sabine::acoustics::Observer;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Time between two looks at whether somebody has pressed Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Does work on a thread of its own and without Python's lock, so that other threads of Python go on. This thread, the only one on which
/// Python hands out signals if it is the main one, looks for them meanwhile; the work is stopped at its next step.
///
/// # Errors
/// Those of the work; `KeyboardInterrupt`, or what else a signal handler raises.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&dyn Observer) -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    let stopped = AtomicBool::new(false);
    let observer = |_: &str, _: u64, _: u64| match stopped.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let (observer, stopped) = (&observer, &stopped);
    py.detach(|| {
        std::thread::scope(|scope| {
            // The worker drops its end when it is done, even by a panic.
            let (working, done) = channel::<()>();
            let worker = scope.spawn(move || {
                let _working = working;
                work(observer)
            });
            let mut raised = None;
            while done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none() {
                    raised = Python::attach(|py| py.check_signals()).err();
                    stopped.store(raised.is_some(), Ordering::Relaxed);
                }
            }
            let result = worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            raised.map_or(result, |exception| Err(exception.into()))
        })
    })
}
