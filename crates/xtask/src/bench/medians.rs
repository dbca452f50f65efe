//! What criterion leaves below `target/criterion`.

use crate::error::Error;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The median of a benchmark.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Median {
    /// Its name: `group/function/parameter`.
    pub benchmark: String,
    /// Median time of one iteration, in nanoseconds.
    pub median_ns: f64,
    /// Lower end of its 95 % interval, in nanoseconds.
    pub low_ns: f64,
    /// Upper end, in nanoseconds.
    pub high_ns: f64,
}

#[derive(Deserialize)]
struct Estimates {
    median: Statistic,
}

#[derive(Deserialize)]
struct Statistic {
    point_estimate: f64,
    confidence_interval: Interval,
}

#[derive(Deserialize)]
struct Interval {
    lower_bound: f64,
    upper_bound: f64,
}

#[derive(Deserialize)]
struct Benchmark {
    full_id: String,
}

/// All medians that were written since a moment, by name.
///
/// # Errors
/// A file of criterion's cannot be read.
pub fn since(folder: &Path, begin: SystemTime) -> Result<Vec<Median>, Error> {
    let mut found = Vec::new();
    collect(folder, begin, &mut found)?;
    found.sort_by(|a, b| a.benchmark.cmp(&b.benchmark));
    Ok(found)
}

fn collect(folder: &Path, begin: SystemTime, found: &mut Vec<Median>) -> Result<(), Error> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for entry in entries {
        let path = entry.map_err(Error::io(folder))?.path();
        if !path.is_dir() {
            continue;
        }
        let estimates = path.join("estimates.json");
        // `base` holds the run before.
        if path.ends_with("new") && estimates.is_file() {
            let written = estimates.metadata().and_then(|m| m.modified()).map_err(Error::io(&estimates))?;
            if written >= begin {
                found.push(median(&path.join("benchmark.json"), &estimates)?);
            }
        } else {
            collect(&path, begin, found)?;
        }
    }
    Ok(())
}

fn median(benchmark: &PathBuf, estimates: &PathBuf) -> Result<Median, Error> {
    let Benchmark { full_id } = json(benchmark)?;
    let Estimates { median } = json(estimates)?;
    Ok(Median {
        benchmark: full_id,
        median_ns: median.point_estimate,
        low_ns: median.confidence_interval.lower_bound,
        high_ns: median.confidence_interval.upper_bound,
    })
}

fn json<T: serde::de::DeserializeOwned>(path: &PathBuf) -> Result<T, Error> {
    let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
    serde_json::from_str(&text).map_err(|error| Error::content(path, error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn medians_are_read_where_criterion_puts_them_and_old_ones_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("trace/12 triangles/new");
        std::fs::create_dir_all(&new).unwrap();
        std::fs::write(new.join("benchmark.json"), r#"{"group_id":"trace","full_id":"trace/12 triangles"}"#)
            .unwrap();
        let interval = r#"{"confidence_level":0.95,"lower_bound":9.5,"upper_bound":10.5}"#;
        let statistic =
            format!(r#"{{"confidence_interval":{interval},"point_estimate":10.0,"standard_error":0.2}}"#);
        let estimates = format!(r#"{{"mean":{statistic},"median":{statistic},"slope":null}}"#);
        std::fs::write(new.join("estimates.json"), estimates).unwrap();
        let begin = SystemTime::now() - Duration::from_secs(60);
        let expected =
            Median { benchmark: "trace/12 triangles".into(), median_ns: 10.0, low_ns: 9.5, high_ns: 10.5 };
        assert_eq!(since(folder.path(), begin).unwrap(), [expected]);
        assert_eq!(since(folder.path(), SystemTime::now() + Duration::from_secs(60)).unwrap(), []);
        assert_eq!(since(&folder.path().join("absent"), begin).unwrap(), []);
    }
}
