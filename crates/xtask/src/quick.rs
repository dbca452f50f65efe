//! What every commit should pass: minutes once dependencies are built.

use crate::error::Error;
use crate::job::{Job, run_all};
use std::path::Path;

/// Format, spelling, clippy, unit tests of all crates, the import table.
///
/// # Errors
/// [`Error::Failed`] names what does not hold.
pub fn run(root: &Path) -> Result<(), Error> {
    run_all(root, &jobs())
}

fn jobs() -> Vec<Job> {
    vec![
        Job::cargo("format", &["fmt", "--all", "--check"]),
        Job::new("spelling", "typos", &[]).needs(&["typos", "--version"]),
        Job::cargo(
            "clippy",
            &["clippy", "--workspace", "--all-targets", "--all-features", "--", "-D", "warnings"],
        ),
        Job::cargo("unit tests", &["test", "--workspace", "--lib", "--bins", "--quiet"]),
        Job::cargo("import table", &["test", "-p", "sabine-testkit", "--test", "it", "imports::"]),
    ]
}
