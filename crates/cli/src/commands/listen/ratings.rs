//! The ratings that webMUSHRA wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Columns that may name the assessor, the most certain first.
const ASSESSOR_COLUMNS: [&str; 3] = ["session_uuid", "assessor", "email"];
const ITEM: &str = "trial_id";
const STIMULUS: &str = "rating_stimulus";
const SCORE: &str = "rating_score";

/// A file of ratings that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RatingsError {
    /// Not to be opened.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// Not CSV.
    #[error("{}: line {line}: {source}", path.display())]
    Csv { path: PathBuf, line: u64, source: csv::Error },
    /// A column that is not there.
    #[error("{}: line 1: no column {column}", path.display())]
    Column { path: PathBuf, column: String },
    /// No column that names the assessors.
    #[error(
        "{}: line 1: no column names the assessor ({}): give its name with --assessor", path.display(),
        ASSESSOR_COLUMNS.join(", ")
    )]
    NoAssessor { path: PathBuf },
    /// A field without a value.
    #[error("{}: line {line}: {column}: empty", path.display())]
    Empty { path: PathBuf, line: u64, column: String },
    /// A rating outside the scale, or no number.
    #[error("{}: line {line}: {column}: `{found}` is not a number from 0 to 100", path.display())]
    Score { path: PathBuf, line: u64, column: &'static str, found: String },
    /// Two ratings of one stimulus.
    #[error(
        "{}: line {line}: {STIMULUS}: {assessor} rated {stimulus} of {item} in line {before} already: is the column that names the assessor the right one?",
        path.display()
    )]
    Twice { path: PathBuf, line: u64, before: u64, assessor: String, item: String, stimulus: String },
    /// A stimulus that somebody did not rate.
    #[error("{}: {STIMULUS}: {assessor} did not rate {stimulus} of {item}", path.display())]
    Missing { path: PathBuf, assessor: String, item: String, stimulus: String },
    /// No ratings at all.
    #[error("{}: no ratings", path.display())]
    NoRatings { path: PathBuf },
}

/// Ratings of all stimuli of an item by one assessor, by stimulus.
pub type Trial = BTreeMap<String, f64>;

/// Complete trials: whoever rated an item rated all its stimuli.
pub struct Ratings {
    /// The file.
    pub path: PathBuf,
    /// Trials of each assessor, by item.
    pub assessors: BTreeMap<String, BTreeMap<String, Trial>>,
    /// Names of the stimuli.
    pub stimuli: BTreeSet<String>,
}

struct Columns {
    assessor: (usize, String),
    item: usize,
    stimulus: usize,
    score: usize,
}

impl Ratings {
    /// Reads the CSV file; `assessor` is the column that names the assessor.
    ///
    /// # Errors
    /// Each names the file, the line and the column.
    pub fn read(path: &Path, assessor: Option<&str>) -> Result<Self, RatingsError> {
        let file =
            std::fs::File::open(path).map_err(|source| RatingsError::Io { path: path.to_owned(), source })?;
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
        let columns = Columns::find(path, reader.headers().map_err(|e| not_csv(path, e))?, assessor)?;
        let mut assessors: BTreeMap<String, BTreeMap<String, Trial>> = BTreeMap::new();
        let mut lines: BTreeMap<[String; 3], u64> = BTreeMap::new();
        let mut stimuli = BTreeSet::new();
        for record in reader.records() {
            let record = record.map_err(|error| not_csv(path, error))?;
            let line = record.position().map_or(0, csv::Position::line);
            let text = |index: usize, column: &str| match record.get(index) {
                Some(text) if !text.is_empty() => Ok(text.to_owned()),
                _ => Err(RatingsError::Empty { path: path.to_owned(), line, column: column.to_owned() }),
            };
            let key = [
                text(columns.assessor.0, &columns.assessor.1)?,
                text(columns.item, ITEM)?,
                text(columns.stimulus, STIMULUS)?,
            ];
            let found = text(columns.score, SCORE)?;
            let score = found.parse().ok().filter(|score| (0.0..=100.0).contains(score));
            let score: f64 = score.ok_or_else(|| RatingsError::Score {
                path: path.to_owned(),
                line,
                column: SCORE,
                found,
            })?;
            if let Some(before) = lines.insert(key.clone(), line) {
                let [assessor, item, stimulus] = key;
                let path = path.to_owned();
                return Err(RatingsError::Twice { path, line, before, assessor, item, stimulus });
            }
            let [assessor, item, stimulus] = key;
            stimuli.insert(stimulus.clone());
            assessors.entry(assessor).or_default().entry(item).or_default().insert(stimulus, score);
        }
        if assessors.is_empty() {
            return Err(RatingsError::NoRatings { path: path.to_owned() });
        }
        let ratings = Self { path: path.to_owned(), assessors, stimuli };
        ratings.check_complete()?;
        Ok(ratings)
    }

    fn check_complete(&self) -> Result<(), RatingsError> {
        for (assessor, items) in &self.assessors {
            for (item, trial) in items {
                if let Some(stimulus) = self.stimuli.iter().find(|name| !trial.contains_key(*name)) {
                    return Err(RatingsError::Missing {
                        path: self.path.clone(),
                        assessor: assessor.clone(),
                        item: item.clone(),
                        stimulus: stimulus.clone(),
                    });
                }
            }
        }
        Ok(())
    }
}

impl Columns {
    fn find(path: &Path, headers: &csv::StringRecord, assessor: Option<&str>) -> Result<Self, RatingsError> {
        let place = |name: &str| headers.iter().position(|header| header == name);
        let column = |name: &str| {
            place(name).ok_or_else(|| RatingsError::Column { path: path.to_owned(), column: name.to_owned() })
        };
        let assessor = match assessor {
            Some(name) => (column(name)?, name.to_owned()),
            None => ASSESSOR_COLUMNS
                .iter()
                .find_map(|name| Some((place(name)?, (*name).to_owned())))
                .ok_or_else(|| RatingsError::NoAssessor { path: path.to_owned() })?,
        };
        Ok(Self { assessor, item: column(ITEM)?, stimulus: column(STIMULUS)?, score: column(SCORE)? })
    }
}

fn not_csv(path: &Path, source: csv::Error) -> RatingsError {
    let line = source.position().map_or(1, csv::Position::line);
    RatingsError::Csv { path: path.to_owned(), line, source }
}
