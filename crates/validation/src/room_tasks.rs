//! Rooms done one after the other, and a record that holds what was done.

use crate::{AnyError, record};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::path::Path;

/// A room to be done.
pub trait RoomTask {
    /// What comes of it: a line of the record.
    type Trial: Serialize + DeserializeOwned + Display;

    /// Its name, for messages.
    fn name(&self) -> String;

    /// Whether a record holds it.
    fn is_done(&self, trials: &[Self::Trial]) -> bool;

    /// Does it; `folder` is for files that nobody needs afterwards.
    ///
    /// # Errors
    /// Whatever stands in the way.
    fn run(&self, folder: &Path) -> Result<Self::Trial, AnyError>;
}

/// Does the rooms that a record lacks and writes each to it at once; prints the tables of all that it then holds. `program` names the folder
/// for files that nobody needs afterwards.
///
/// # Errors
/// For a record that cannot be read or written; at the end, for rooms that could not be done: one does not keep the others from it.
pub fn do_all<T: RoomTask>(
    program: &str,
    record: Option<&Path>,
    tasks: impl IntoIterator<Item = T>,
    print: impl FnOnce(&[T::Trial]),
) -> Result<(), AnyError> {
    let mut trials: Vec<T::Trial> = match record {
        Some(path) if path.exists() => record::read(path)?,
        _ => Vec::new(),
    };
    let scratch = std::env::temp_dir().join(format!("sabine_{program}_{}", std::process::id()));
    let mut failures = Vec::new();
    for task in tasks {
        if task.is_done(&trials) {
            continue;
        }
        let trial = task.run(&scratch);
        // The error that counts is the task's.
        let _ = std::fs::remove_dir_all(&scratch);
        match trial {
            Ok(trial) => {
                eprintln!("{trial}");
                trials.push(trial);
                if let Some(path) = record {
                    record::write(path, &trials)?;
                }
            }
            Err(error) => {
                let failure = format!("{}: {error}", task.name());
                eprintln!("{failure}");
                failures.push(failure);
            }
        }
    }
    print(&trials);
    if failures.is_empty() { Ok(()) } else { Err(failures.join("; ").into()) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use serde::Deserialize;
    use std::fmt;

    #[derive(Serialize, Deserialize)]
    struct Line {
        seed: u64,
    }

    impl Display for Line {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "seed {}", self.seed)
        }
    }

    /// Fails where its seed is odd.
    struct Room(u64);

    impl RoomTask for Room {
        type Trial = Line;

        fn name(&self) -> String {
            format!("room {}", self.0)
        }

        fn is_done(&self, trials: &[Line]) -> bool {
            trials.iter().any(|line| line.seed == self.0)
        }

        fn run(&self, _: &Path) -> Result<Line, AnyError> {
            if self.0.is_multiple_of(2) { Ok(Line { seed: self.0 }) } else { Err("odd".into()) }
        }
    }

    #[test]
    fn what_a_record_holds_is_not_done_again_and_a_failure_stops_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record.csv");
        let mut printed = 0;
        let done = |seeds: [u64; 3], printed: &mut usize| {
            do_all("test", Some(&path), seeds.map(Room), |trials| *printed = trials.len())
        };
        let error = done([2, 3, 4], &mut printed).unwrap_err().to_string();
        assert_eq!((error.as_str(), printed), ("room 3: odd", 2));
        done([4, 2, 6], &mut printed).unwrap();
        let seeds: Vec<u64> = record::read::<Line>(&path).unwrap().iter().map(|line| line.seed).collect();
        assert_eq!((seeds, printed), (vec![2, 4, 6], 3));
    }
}
