//! Commands with a name and a time, of which some need a tool that may be absent.

use crate::error::Error;
use crate::workspace::cargo;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A command to run.
#[derive(Clone, Debug)]
pub struct Job {
    /// What it is for.
    pub name: String,
    program: String,
    arguments: Vec<String>,
    /// A command that succeeds where the tool is installed.
    probe: Option<Vec<String>>,
}

/// How a job ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It succeeded.
    Done(Duration),
    /// It ended with an error.
    Failed(Duration),
    /// Its tool is absent.
    Skipped,
}

impl Job {
    /// A job by any program.
    pub fn new(name: impl Into<String>, program: &str, arguments: &[&str]) -> Self {
        Self {
            name: name.into(),
            program: program.into(),
            arguments: arguments.iter().map(ToString::to_string).collect(),
            probe: None,
        }
    }

    /// A job by cargo.
    pub fn cargo(name: impl Into<String>, arguments: &[&str]) -> Self {
        Self::new(name, &cargo(), arguments)
    }

    /// The same, left out where this command does not succeed.
    #[must_use]
    pub fn needs(mut self, probe: &[&str]) -> Self {
        self.probe = Some(probe.iter().map(ToString::to_string).collect());
        self
    }

    /// Runs it to its end, with its output where this program's goes.
    ///
    /// # Errors
    /// The program cannot be started, or ends with an error.
    pub fn run(&self, root: &Path) -> Result<Outcome, Error> {
        match self.outcome(root)? {
            Outcome::Failed(_) => Err(Error::Failed { names: vec![self.name.clone()] }),
            outcome => Ok(outcome),
        }
    }

    fn outcome(&self, root: &Path) -> Result<Outcome, Error> {
        if let Some(probe) = &self.probe
            && !succeeds(probe)
        {
            println!("-- {}: skipped, `{}` does not run here", self.name, probe.join(" "));
            return Ok(Outcome::Skipped);
        }
        println!("== {}: {} {}", self.name, self.program, self.arguments.join(" "));
        let start = Instant::now();
        let status = Command::new(&self.program)
            .args(&self.arguments)
            .current_dir(root)
            .status()
            .map_err(|source| Error::Start { program: self.program.clone(), source })?;
        let took = start.elapsed();
        Ok(if status.success() { Outcome::Done(took) } else { Outcome::Failed(took) })
    }
}

/// Whether a command runs and ends without an error.
fn succeeds(words: &[String]) -> bool {
    let Some((program, arguments)) = words.split_first() else { return false };
    let status = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// Runs all jobs, whatever becomes of the earlier ones, and prints how each ended.
///
/// # Errors
/// A program cannot be started; [`Error::Failed`] names the jobs that ended with an error.
pub fn run_all(root: &Path, jobs: &[Job]) -> Result<(), Error> {
    let mut outcomes = Vec::new();
    for job in jobs {
        outcomes.push(job.outcome(root)?);
    }
    println!();
    let mut failed = Vec::new();
    for (job, outcome) in jobs.iter().zip(&outcomes) {
        let text = match outcome {
            Outcome::Done(took) => format!("{:6.0} s", took.as_secs_f64()),
            Outcome::Failed(_) => "  FAILED".into(),
            Outcome::Skipped => " skipped".into(),
        };
        println!("{text}  {}", job.name);
        if matches!(outcome, Outcome::Failed(_)) {
            failed.push(job.name.clone());
        }
    }
    if failed.is_empty() { Ok(()) } else { Err(Error::Failed { names: failed }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_that_fails_is_named_and_the_next_ones_still_run() {
        let folder = tempfile::tempdir().unwrap();
        let jobs = [
            Job::new("first", "sh", &["-c", "exit 3"]),
            Job::new("second", "sh", &["-c", "echo done > second"]),
        ];
        let error = run_all(folder.path(), &jobs).unwrap_err();
        assert_eq!(error.to_string(), "failed: first");
        assert!(folder.path().join("second").exists());
    }

    #[test]
    fn a_job_whose_tool_is_absent_is_skipped_and_no_failure() {
        let folder = tempfile::tempdir().unwrap();
        let job = Job::new("never", "sh", &["-c", "exit 1"]).needs(&["no-such-tool-here", "--version"]);
        assert_eq!(job.run(folder.path()).unwrap(), Outcome::Skipped);
    }
}
