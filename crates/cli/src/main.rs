//! The command `sabine`.

use std::process::ExitCode;

fn main() -> ExitCode {
    sabine_cli::run(std::env::args_os())
}
