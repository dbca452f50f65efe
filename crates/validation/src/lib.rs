//! The programs behind the tables of `docs/validation`: how often hidden effects are found, how well materials are fitted, what is
//! rendered from speech in real rooms, whether memory stays flat. Not published; run them with `cargo run --release -p sabine-validation --bin NAME`.

use std::fmt::Display;
use std::process::ExitCode;

/// How a program ends; an error is printed.
#[must_use]
pub fn exit_code(ended: Result<(), impl Display>) -> ExitCode {
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
