//! An atlas made by several processes, on one machine or on many: one file for each room in a folder of all, and the record of them
//! all once each room is there.
//!
//! What is written depends on the plan alone, not on the number of workers, of threads or of interruptions: the record of a room holds
//! no times. Each file appears whole or not at all.

use crate::task::Task;
use crate::trial::Trial;
use sabine::acoustics::write_atomically;
use sabine_validation::record;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What is in the way of an atlas in a folder.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{}: {source}", path.display())]
    Json { path: PathBuf, source: serde_json::Error },
    #[error("{}: {source}", path.display())]
    Csv { path: PathBuf, source: csv::Error },
    #[error(
        "{}: was begun with other settings or by another build of this program; one atlas has one engine: take another folder",
        path.display()
    )]
    OtherPlan { path: PathBuf },
    #[error("{}: holds an atlas already; --resume goes on with it", path.display())]
    NotEmpty { path: PathBuf },
    #[error("no room is to be diagnosed: --rooms, --effects and --strengths leave none")]
    Nothing,
    #[error(transparent)]
    Write(#[from] sabine::acoustics::Error),
}

/// What all workers must agree on: tasks, and the program that does them.
#[derive(Serialize)]
struct Plan<'a> {
    format: &'static str,
    /// Of the program's own file: figures of two engines are not to be mixed.
    program_sha256: String,
    tasks: &'a [Task],
}

/// The file of a room.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Piece {
    plan_sha256: String,
    record_sha256: String,
    /// The head of the record and the line of the room, as they stand there.
    record: String,
}

/// What a worker did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Built {
    pub made: usize,
    pub kept: usize,
    /// Made again, for the file was damaged or of another plan.
    pub mended: usize,
}

/// An atlas in a folder.
pub struct Shards<'a> {
    folder: &'a Path,
    tasks: &'a [Task],
    plan_sha256: String,
}

impl<'a> Shards<'a> {
    /// Begins an atlas, or goes on with one: `worker` is (I, N), I from 1.
    ///
    /// # Errors
    /// [`Error::Nothing`], [`Error::OtherPlan`], [`Error::NotEmpty`] if a single worker is to begin where there is one, [`Error::Io`].
    pub fn begin(
        folder: &'a Path,
        tasks: &'a [Task],
        worker: (usize, usize),
        resume: bool,
    ) -> Result<Self, Error> {
        if tasks.is_empty() {
            return Err(Error::Nothing);
        }
        std::fs::create_dir_all(folder).map_err(io(folder))?;
        let program = std::env::current_exe().map_err(io(folder))?;
        let program_sha256 = hash(&std::fs::read(&program).map_err(io(&program))?);
        let path = folder.join("plan.json");
        let plan = Plan { format: "sabine effect atlas 1", program_sha256, tasks };
        let text = json(&path, &plan)?;
        match std::fs::read(&path) {
            Ok(_) if !resume && worker.1 == 1 => return Err(Error::NotEmpty { path: folder.to_owned() }),
            Ok(found) if found != text => return Err(Error::OtherPlan { path }),
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => write(&path, &text)?,
            Err(source) => return Err(Error::Io { path, source }),
        }
        Ok(Self { folder, tasks, plan_sha256: hash(&text) })
    }

    /// Does the rooms of a worker that are not there and whole.
    ///
    /// # Errors
    /// Those of `diagnose`, [`Error`].
    pub fn run<E: From<Error>>(
        &self,
        (first, each): (usize, usize),
        mut diagnose: impl FnMut(&Task) -> Result<Trial, E>,
    ) -> Result<Built, E> {
        let mut built = Built::default();
        for (n, task) in self.tasks.iter().enumerate().skip(first - 1).step_by(each) {
            let path = self.path(n);
            let found = path.exists();
            if found && self.record(n).is_some() {
                built.kept += 1;
                continue;
            }
            let trial = Trial { seconds: None, ..diagnose(task)? };
            let record =
                record::text(&[trial]).map_err(|source| Error::Csv { path: path.clone(), source })?;
            let record_sha256 = hash(record.as_bytes());
            let piece = Piece { plan_sha256: self.plan_sha256.clone(), record_sha256, record };
            write(&path, &json(&path, &piece)?)?;
            if found {
                built.mended += 1;
            } else {
                built.made += 1;
            }
        }
        Ok(built)
    }

    /// Writes `record.csv` if all rooms are there; else the number of those that are.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Csv`].
    pub fn finish(&self) -> Result<Result<Vec<Trial>, usize>, Error> {
        let records: Vec<String> = (0..self.tasks.len()).filter_map(|n| self.record(n)).collect();
        if records.len() < self.tasks.len() {
            return Ok(Err(records.len()));
        }
        let path = self.folder.join("record.csv");
        let head = records.first().into_iter().flat_map(|record| record.split_inclusive('\n').take(1));
        let rooms = records.iter().flat_map(|record| record.split_inclusive('\n').skip(1));
        let text: String = head.chain(rooms).collect();
        write(&path, text.as_bytes())?;
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let trials: Result<Vec<Trial>, csv::Error> = reader.deserialize().collect();
        trials.map(Ok).map_err(|source| Error::Csv { path, source })
    }

    fn path(&self, n: usize) -> PathBuf {
        self.folder.join(format!("room-{:05}.json", n + 1))
    }

    /// The record of a room whose file is there, whole and of this plan.
    fn record(&self, n: usize) -> Option<String> {
        let piece: Piece = serde_json::from_slice(&std::fs::read(self.path(n)).ok()?).ok()?;
        let whole =
            piece.plan_sha256 == self.plan_sha256 && hash(piece.record.as_bytes()) == piece.record_sha256;
        whole.then_some(piece.record)
    }
}

fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Error + '_ {
    |source| Error::Io { path: path.to_owned(), source }
}

fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn json(path: &Path, value: &impl Serialize) -> Result<Vec<u8>, Error> {
    let text = serde_json::to_string_pretty(value);
    let text = text.map_err(|source| Error::Json { path: path.to_owned(), source })?;
    Ok((text + "\n").into_bytes())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    Ok(write_atomically(path, |file| file.write_all(bytes))?)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // a panic is how a test fails
mod tests {
    use super::*;
    use crate::{Arguments, tasks};
    use clap::Parser;

    const RECORD: &str = include_str!("../../../../../docs/validation/effect_atlas/frozen_b3306b8.csv");

    /// Five rooms and what was found in them once.
    fn rooms() -> (Vec<Task>, Vec<Trial>) {
        let arguments = Arguments::parse_from([
            "effect_atlas",
            "--effects",
            "none",
            "--rooms",
            "5",
            "--seed",
            "3006294920",
        ]);
        let trials: Result<Vec<Trial>, _> =
            csv::Reader::from_reader(RECORD.as_bytes()).deserialize().collect();
        (tasks(&arguments), trials.unwrap())
    }

    fn looked_up(trials: &[Trial], task: &Task) -> Result<Trial, Error> {
        Ok(trials.iter().find(|trial| task.is_done(std::slice::from_ref(trial))).unwrap().clone())
    }

    fn files(folder: &Path) -> Vec<(std::ffi::OsString, Vec<u8>)> {
        let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
        let mut all: Vec<_> = entries.map(|e| (e.file_name(), std::fs::read(e.path()).unwrap())).collect();
        all.sort();
        all
    }

    #[test]
    fn interrupted_workers_write_what_one_process_writes() {
        let (tasks, trials) = rooms();
        let folder = tempfile::tempdir().unwrap();
        let (alone, shared) = (folder.path().join("alone"), folder.path().join("shared"));
        let whole = Shards::begin(&alone, &tasks, (1, 1), false).unwrap();
        assert_eq!(whole.run((1, 1), |task| looked_up(&trials, task)).unwrap().made, 5);
        assert_eq!(whole.finish().unwrap().unwrap().len(), 5);

        // The first of two workers ends in its second room, the other one does all of its own.
        let first = Shards::begin(&shared, &tasks, (1, 2), true).unwrap();
        let mut count = 0;
        let ended = first.run((1, 2), |task| {
            count += 1;
            if count == 2 { Err(Error::Nothing) } else { looked_up(&trials, task) }
        });
        assert!(ended.is_err());
        let second = Shards::begin(&shared, &tasks, (2, 2), true).unwrap();
        assert_eq!(second.run((2, 2), |task| looked_up(&trials, task)).unwrap().made, 2);
        assert_eq!(second.finish().unwrap().unwrap_err(), 3);
        let again = Shards::begin(&shared, &tasks, (1, 2), true).unwrap();
        let built = again.run((1, 2), |task| looked_up(&trials, task)).unwrap();
        assert_eq!(built, Built { made: 2, kept: 1, mended: 0 });
        assert!(again.finish().unwrap().is_ok());
        assert_eq!(files(&alone), files(&shared));

        // The record is that of the same rooms in the file that they were looked up in, less the times.
        let record = std::fs::read_to_string(alone.join("record.csv")).unwrap();
        let wanted: Vec<Trial> = trials[..5].iter().map(|t| Trial { seconds: None, ..t.clone() }).collect();
        assert_eq!(record, record::text(&wanted).unwrap());
    }

    #[test]
    fn a_damaged_room_is_done_again_and_another_plan_refused() {
        let (tasks, trials) = rooms();
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let shards = Shards::begin(out, &tasks, (1, 1), false).unwrap();
        shards.run((1, 1), |task| looked_up(&trials, task)).unwrap();
        shards.finish().unwrap().unwrap();
        let before = files(out);
        let path = out.join("room-00003.json");
        let text = std::fs::read_to_string(&path).unwrap();
        for damaged in [text.replace("0.0", "0.1"), text[..text.len() / 2].to_owned(), String::new()] {
            assert_ne!(text, damaged);
            std::fs::write(&path, damaged).unwrap();
            let shards = Shards::begin(out, &tasks, (1, 1), true).unwrap();
            assert_eq!(shards.finish().unwrap().unwrap_err(), 4);
            let built = shards.run((1, 1), |task| looked_up(&trials, task)).unwrap();
            assert_eq!(built, Built { made: 0, kept: 4, mended: 1 });
            assert_eq!(files(out), before);
        }
        let refused = |tasks: &[Task], worker, resume| {
            Shards::begin(out, tasks, worker, resume).map(|_| ()).unwrap_err().to_string()
        };
        assert!(refused(&tasks, (1, 1), false).contains("--resume"));
        let other = refused(&tasks[1..], (1, 2), true);
        assert!(other.contains("plan.json: was begun with other settings"), "{other}");
        assert!(refused(&[], (1, 1), true).contains("no room"));
        let file = refused_at(&path, &tasks);
        assert!(file.contains("room-00003.json"), "{file}");
        assert_eq!(files(out), before);
    }

    fn refused_at(path: &Path, tasks: &[Task]) -> String {
        Shards::begin(path, tasks, (1, 1), true).map(|_| ()).unwrap_err().to_string()
    }
}
