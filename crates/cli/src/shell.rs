//! What a shell and `man` want to know of the command.

use crate::failure::Failure;
use crate::output::OutputFolder;
use clap::{Args, Command};
use clap_complete::Shell;
use std::path::PathBuf;

/// Print a completion script.
#[derive(Args)]
pub struct CompletionArguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Write manual pages: one for `sabine`, one for each of its commands.
#[derive(Args)]
pub struct ManArguments {
    /// Folder for the pages
    #[arg(long, value_name = "DIR", default_value = "out/man")]
    out: PathBuf,
}

/// Prints a completion script.
///
/// # Errors
/// None today; the signature is that of every command.
pub fn completions(arguments: &CompletionArguments, mut sabine: Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut sabine, "sabine", &mut script);
    print!("{}", String::from_utf8_lossy(&script));
    Ok(())
}

/// Writes manual pages.
///
/// # Errors
/// The folder cannot be written.
pub fn manual(arguments: &ManArguments, sabine: &Command) -> Result<(), Failure> {
    let mut out = OutputFolder::create(&arguments.out)?;
    let mut page = Vec::new();
    clap_mangen::Man::new(sabine.clone()).render(&mut page)?;
    out.write("sabine.1", &page)?;
    for job in sabine.get_subcommands() {
        let name = format!("sabine-{}", job.get_name());
        let mut page = Vec::new();
        clap_mangen::Man::new(job.clone().display_name(&name)).title(&name).render(&mut page)?;
        out.write(&format!("{name}.1"), &page)?;
    }
    out.finish()?;
    println!("man -l {}", arguments.out.join("sabine.1").display());
    Ok(())
}
