//! The command line: its subcommands, and what is true of all of them.

use crate::channel;
use crate::commands::{
    augment, deconvolve, diagnose, eq, estimate, evaluate, export, fit, import, listen, live, match_room,
    materials, measure, mix, model, new_room, plan, replace, sweep, trace, train, validate, walk,
};
use crate::console;
use crate::failure::Failure;
use crate::shell;
use clap::builder::ValueParser;
use clap::error::ErrorKind;
use clap::{Arg, Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::any::TypeId;
use std::error::Error;
use std::ffi::OsString;
use std::process::ExitCode;

/// Room acoustics: measure a room, hear it in speech, simulate it, fit the simulation, find what it gets wrong, render sound in it.
///
/// Commands that need a room or a recording run on a built-in demo if they are given none: try `sabine match`.
#[derive(Parser)]
#[command(name = "sabine", version)]
pub struct Sabine {
    #[command(subcommand)]
    job: Job,
}

// Each variant holds the arguments of a command once in a process: their sizes do not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Subcommand)]
enum Job {
    /// Match a simulated room to a recording of speech and render dry sound in it
    Match(match_room::Arguments),
    /// Measure impulse responses: EDT, T20, T30, C50, C80, D50, centre time, DRR, G, J_LF, IACC, STI
    Measure(measure::Arguments),
    /// Write an exponential sweep to measure a room with
    Sweep(sweep::Arguments),
    /// Make impulse responses of a recorded sweep
    Deconvolve(deconvolve::Arguments),
    /// Design a linear-phase FIR filter from octave-band gains
    Eq(eq::Arguments),
    /// Estimate reverberation time and equalisation from recordings of speech
    Estimate(estimate::Arguments),
    /// Simulate the response of a room from a source to a receiver
    Trace(trace::Arguments),
    /// Render a walk through two rooms joined by a doorway, or through a room of your own
    Walk(walk::Arguments),
    /// Fit the absorption of a room's materials to reverberation times or measured responses
    Fit(fit::Arguments),
    /// Find what a simulation of a room gets wrong against measured responses
    Diagnose(diagnose::Arguments),
    /// Show extended models of `diagnose`, fit them anew, join them, take causes out, draw from them
    Model(model::Arguments),
    /// Plan the next measurement of a room: which one decides between causes, and by how much
    Plan(plan::Arguments),
    /// Replace a material of a room and predict what changes
    Replace(replace::Arguments),
    /// Compare simulated with measured room means, in just-noticeable differences
    Validate(validate::Arguments),
    /// Match a simulated room to speech as it comes in
    Live(live::Arguments),
    /// Make a MUSHRA listening test of a matched room, or analyse its ratings
    Listen(listen::Arguments),
    /// Convolve speech with an impulse response and add noise
    Mix(mix::Arguments),
    /// Make a training set: speech x rooms x noise, in shards
    Augment(augment::Arguments),
    /// Train the estimator of reverberation time and equalisation
    Train(train::Arguments),
    /// Print the estimator's errors on a data set
    Evaluate(evaluate::Arguments),
    /// Print the tables of the material library with their sources
    Materials(materials::Arguments),
    /// Make a room folder from a size or a floor plan and names of the material library
    NewRoom(new_room::Arguments),
    /// Make a measured room of files of other programs: SOFA, REW, tables of sound files and positions
    Import(import::Arguments),
    /// Write the responses of a measured room as a SOFA file
    Export(export::Arguments),
    /// Print a completion script for a shell
    Completions(shell::CompletionArguments),
    /// Write manual pages
    Man(shell::ManArguments),
}

/// The command as clap knows it, for completions and manual pages.
pub fn command() -> Command {
    Sabine::command().mut_subcommands(|job| {
        job.mut_args(takes_negative_numbers).mut_subcommands(|task| task.mut_args(takes_negative_numbers))
    })
}

/// `--gains-db -3,0,2` is a value, not an unknown option `-3`.
fn takes_negative_numbers(argument: Arg) -> Arg {
    let parser: &ValueParser = argument.get_value_parser();
    let numbers = [
        TypeId::of::<f64>(),
        TypeId::of::<f32>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
    ];
    if numbers.iter().any(|number| parser.type_id() == *number) {
        argument.allow_hyphen_values(true)
    } else {
        argument
    }
}

/// Runs the command with these arguments, the first of which is the program's name. 0: done; 1: the job failed, and standard error
/// says why; 2: the arguments were not understood.
pub fn run(arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> ExitCode {
    let parsed =
        command().try_get_matches_from(arguments).and_then(|matches| Sabine::from_arg_matches(&matches));
    let sabine = match parsed {
        Ok(sabine) => sabine,
        Err(error) => {
            // Help and version are answers, too, and their reader may have left.
            let _ = error.print();
            let asked = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
            return if asked { ExitCode::SUCCESS } else { ExitCode::from(2) };
        }
    };
    let done = sabine
        .job
        .run()
        .and_then(|()| console::finish().map_err(|error| format!("standard output: {error}").into()));
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}{}", hint(&*error));
            ExitCode::FAILURE
        }
    }
}

/// The option that helps, where an error of a library cannot know it.
fn hint(error: &(dyn Error + 'static)) -> String {
    let mut cause = Some(error);
    while let Some(error) = cause {
        // An error that passes another on in its place is asked for it: its own source lies behind that.
        let own = match error.downcast_ref() {
            Some(sabine::Error::Acoustics(inner)) => Some(inner),
            _ => error.downcast_ref(),
        };
        if matches!(own, Some(sabine::acoustics::Error::ManyChannels { .. })) {
            return format!(" {}", channel::HINT);
        }
        cause = error.source();
    }
    String::new()
}

impl Job {
    fn run(&self) -> Result<(), Failure> {
        match self {
            Self::Match(arguments) => match_room::run(arguments),
            Self::Measure(arguments) => measure::run(arguments),
            Self::Sweep(arguments) => sweep::run(arguments),
            Self::Deconvolve(arguments) => deconvolve::run(arguments),
            Self::Eq(arguments) => eq::run(arguments),
            Self::Estimate(arguments) => estimate::run(arguments),
            Self::Trace(arguments) => trace::run(arguments),
            Self::Walk(arguments) => walk::run(arguments),
            Self::Fit(arguments) => fit::run(arguments),
            Self::Diagnose(arguments) => diagnose::run(arguments),
            Self::Model(arguments) => model::run(arguments),
            Self::Plan(arguments) => plan::run(arguments),
            Self::Replace(arguments) => replace::run(arguments),
            Self::Validate(arguments) => validate::run(arguments),
            Self::Live(arguments) => live::run(arguments),
            Self::Listen(arguments) => listen::run(arguments),
            Self::Mix(arguments) => mix::run(arguments),
            Self::Augment(arguments) => augment::run(arguments),
            Self::Train(arguments) => train::run(arguments),
            Self::Evaluate(arguments) => evaluate::run(arguments),
            Self::Materials(arguments) => materials::run(arguments),
            Self::NewRoom(arguments) => new_room::run(arguments),
            Self::Import(arguments) => import::run(arguments),
            Self::Export(arguments) => export::run(arguments),
            Self::Completions(arguments) => shell::completions(arguments, command()),
            Self::Man(arguments) => shell::manual(arguments, &command()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn numbers_may_be_negative_wherever_numbers_are_read() {
        for arguments in [
            &["sabine", "eq", "--gains-db", "-3,0,-1,2,0,1,-6", "--sample-rate", "48000"][..],
            &[
                "sabine",
                "mix",
                "--speech",
                "a",
                "--response",
                "b",
                "--noise",
                "c",
                "--snr",
                "-5",
                "--out",
                "d",
            ],
        ] {
            assert!(command().try_get_matches_from(arguments).is_ok(), "{arguments:?}");
        }
        // A path is no number: an option that follows it stays an option.
        assert!(command().try_get_matches_from(["sabine", "trace", "--out", "--rays", "5"]).is_err());
    }
}
