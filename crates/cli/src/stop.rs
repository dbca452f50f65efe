//! Ctrl-C and requests to terminate, for work that can say how far it came.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Whether somebody asked to stop.
static REQUESTED: AtomicBool = AtomicBool::new(false);
/// Whether signals come here.
static LISTENING: Mutex<bool> = Mutex::new(false);
/// What shells give to a command that Ctrl-C ended.
const INTERRUPTED: i32 = 130;

/// The system does not pass signals on.
#[derive(Debug, thiserror::Error)]
#[error("Ctrl-C cannot be listened for: {0}")]
pub struct NoSignals(#[from] ctrlc::Error);

/// Takes Ctrl-C and requests to terminate for requests to stop at the next step. A second one ends the program at once.
///
/// # Errors
/// [`NoSignals`] where the system passes none on.
pub fn listen() -> Result<(), NoSignals> {
    let mut listening = LISTENING.lock().unwrap_or_else(PoisonError::into_inner);
    if !*listening {
        ctrlc::set_handler(|| {
            if REQUESTED.swap(true, Ordering::Relaxed) {
                std::process::exit(INTERRUPTED);
            }
            eprintln!("stopping after the present step; once more stops at once");
        })?;
        *listening = true;
    }
    Ok(())
}

/// Whether somebody asked to stop.
pub fn is_requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
