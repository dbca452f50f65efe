//! Bad and odd inputs: every command gives a clear error or a right result, never a panic, nothing half-written, in bounded memory.
//!
//! The table of `docs/validation/reliability.md`:
//!
//! ```text
//! cargo test -p sabine-cli --test it bad_inputs:: -- --nocapture
//! ```

mod arguments;
mod imports;
mod outcome;
mod recordings;
mod rooms;

use outcome::{Case, Outcome, run_all};

/// Most memory of any command, in MiB.
const MAX_MEMORY_MIB: u64 = 2048;

/// Runs the cases, prints their table, and holds each against what a user would expect.
fn judge(folder: &std::path::Path, cases: Vec<Case>) {
    let outcomes = run_all(folder, &cases);
    println!("| input | exit | s | MB | first line of the answer |\n|---|---|---|---|---|");
    for (case, outcome) in cases.iter().zip(&outcomes) {
        println!("{}", outcome.row(case));
    }
    let faults: Vec<String> = cases
        .iter()
        .zip(&outcomes)
        .flat_map(|(case, outcome)| Outcome::faults(outcome, case, MAX_MEMORY_MIB))
        .collect();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn recordings_of_all_kinds() {
    let folder = tempfile::tempdir().unwrap();
    recordings::make(folder.path());
    judge(folder.path(), recordings::cases());
}

#[test]
fn rooms_of_all_kinds() {
    let folder = tempfile::tempdir().unwrap();
    recordings::make(folder.path());
    rooms::make(folder.path());
    judge(folder.path(), rooms::cases());
}

#[test]
fn imports_of_all_kinds() {
    let folder = tempfile::tempdir().unwrap();
    recordings::make(folder.path());
    rooms::make(folder.path());
    imports::make(folder.path());
    judge(folder.path(), imports::cases());
}

#[test]
fn arguments_of_all_kinds() {
    let folder = tempfile::tempdir().unwrap();
    recordings::make(folder.path());
    rooms::make(folder.path());
    arguments::make(folder.path());
    judge(folder.path(), arguments::cases());
}
