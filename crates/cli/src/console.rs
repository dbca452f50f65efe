//! Standard output that may go away: `sabine ... | head` and `> /dev/full` are no reason to panic.
//!
//! `println!` of the standard library panics if it cannot write. Those of this crate remember the error; a command does its
//! work to the end, and [`finish`] says whether all of it was printed.

use std::fmt;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

/// The first error of standard output; nothing is written after it.
static LOST: Mutex<Option<io::Error>> = Mutex::new(None);

/// Writes to standard output.
pub fn print(text: fmt::Arguments<'_>) {
    let mut lost = LOST.lock().unwrap_or_else(PoisonError::into_inner);
    if lost.is_none() {
        *lost = io::stdout().write_fmt(text).err();
    }
}

/// Writes to standard error. If that fails, there is nobody left to tell.
pub fn eprint(text: fmt::Arguments<'_>) {
    let _ = io::stderr().write_fmt(text);
}

/// Whether all that was printed arrived. A reader that has left (`| head`) has what it wanted.
///
/// # Errors
/// Any other error of standard output: a full disk, for example.
pub fn finish() -> io::Result<()> {
    let lost = LOST.lock().unwrap_or_else(PoisonError::into_inner).take();
    match lost.map_or_else(|| io::stdout().flush(), Err) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// As the standard library's, without its panic.
macro_rules! println {
    () => { $crate::console::print(format_args!("\n")) };
    ($($text:tt)*) => { $crate::console::print(format_args!("{}\n", format_args!($($text)*))) };
}

/// As the standard library's, without its panic.
macro_rules! print {
    ($($text:tt)*) => { $crate::console::print(format_args!($($text)*)) };
}

/// As the standard library's, without its panic.
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::console::eprint(format_args!("{}\n", format_args!($($text)*))) };
}
