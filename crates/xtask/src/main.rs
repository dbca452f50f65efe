//! Chores of this repository: `cargo xtask --help` lists them.

mod bench;
mod error;
mod job;
mod new_effect;
mod nightly;
mod packages;
mod quick;
mod validation;
mod workspace;

use clap::{Parser, Subcommand};
use error::Error;
use std::process::ExitCode;

/// Chores of this repository.
#[derive(Parser)]
#[command(name = "cargo xtask", version)]
struct Arguments {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Subcommand)]
enum Chore {
    /// Format, spelling, clippy, unit tests and the import table: minutes, for every commit
    Check,
    /// Everything that must hold before a change lands: `.ci/run`
    Gate,
    /// What the gate has no time for: long tests, features one by one, the least Rust version, packages
    Nightly(nightly::Arguments),
    /// Pack, unpack, build and test every published crate without the repository
    Packages(packages::Arguments),
    /// Write a new effect of the diagnosis and say what is left to do
    NewEffect(new_effect::Arguments),
    /// Run the benches and keep their medians, or compare them with kept ones
    Bench(bench::Arguments),
    /// Run the command of a table of `docs/validation` again and show what differs
    Validation(validation::Arguments),
}

fn run(chore: &Chore) -> Result<(), Error> {
    let root = workspace::root();
    match chore {
        Chore::Check => quick::run(&root),
        Chore::Gate => job::Job::new("the gate", "bash", &[".ci/run"]).run(&root).map(|_| ()),
        Chore::Nightly(arguments) => nightly::run(&root, arguments),
        Chore::Packages(arguments) => packages::run(&root, arguments),
        Chore::NewEffect(arguments) => new_effect::run(&root, arguments),
        Chore::Bench(arguments) => bench::run(&root, arguments),
        Chore::Validation(arguments) => validation::run(&root, arguments),
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse().chore) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
