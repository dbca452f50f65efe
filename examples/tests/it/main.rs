//! The examples as a user runs them, the pages that quote them, and the links between the documents.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod examples;
mod index;
mod links;
mod own_effect;

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the examples' sources.
fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// What an example says when it runs in a folder: whether it succeeds, standard output, standard error.
///
/// `cargo test` builds the examples beside the tests.
fn run(name: &str, arguments: &[&str], here: &Path) -> (bool, String, String) {
    let tests = std::env::current_exe().unwrap();
    let program: PathBuf = tests.ancestors().nth(2).unwrap().join("examples");
    let program = program.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    assert!(program.exists(), "{} is missing: run `cargo test -p sabine-examples`", program.display());
    let output = Command::new(program).args(arguments).current_dir(here).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.success(), text(output.stdout), text(output.stderr))
}

/// The numbers in a text, in order; what stands within a word or a name is none.
fn numbers(text: &str) -> Vec<f64> {
    let words = text.split(|c: char| c.is_whitespace() || "(),;:[]".contains(c));
    words.filter_map(|word| word.trim_end_matches('.').parse().ok()).collect()
}

/// The numbers of the first line that begins so.
fn row(printed: &str, begins: &str) -> Vec<f64> {
    let line = printed.lines().find(|line| line.trim_start().starts_with(begins));
    let line = line.unwrap_or_else(|| panic!("no line begins with {begins}:\n{printed}"));
    numbers(line.trim_start().strip_prefix(begins).unwrap())
}
