//! A table of medians: `docs/validation/bench.csv` and its like.

use super::medians::Median;
use crate::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// Medians, and what they were measured on.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchTable {
    /// Compiler, architecture, threads.
    pub machine: String,
    /// By name.
    pub medians: Vec<Median>,
}

impl BenchTable {
    /// A table of these.
    pub fn new(machine: String, medians: Vec<Median>) -> Self {
        Self { machine, medians }
    }

    /// Reads a table.
    ///
    /// # Errors
    /// It cannot be read, or a line is no median.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        Self::parse(&text).map_err(|reason| Error::content(path, reason))
    }

    fn parse(text: &str) -> Result<Self, String> {
        let machine = text.lines().next().and_then(|line| line.strip_prefix('#')).unwrap_or_default().trim();
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        let medians: Vec<Median> =
            reader.deserialize().collect::<Result<_, _>>().map_err(|error: csv::Error| error.to_string())?;
        let bad = medians.iter().find(|m| !(m.median_ns > 0.0 && m.low_ns <= m.high_ns));
        match bad {
            Some(bad) => {
                Err(format!("{}: a median must be above 0, its interval not turned round", bad.benchmark))
            }
            None => Ok(Self { machine: machine.into(), medians }),
        }
    }

    /// Writes it; its first line says what it was measured on.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let text = self.text().map_err(|reason| Error::content(path, reason))?;
        std::fs::write(path, text).map_err(Error::io(path))
    }

    fn text(&self) -> Result<String, String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for median in &self.medians {
            let round = |ns: f64| (10.0 * ns).round() / 10.0;
            let Median { benchmark, median_ns, low_ns, high_ns } = median.clone();
            let rounded = Median {
                benchmark,
                median_ns: round(median_ns),
                low_ns: round(low_ns),
                high_ns: round(high_ns),
            };
            writer.serialize(rounded).map_err(|error| error.to_string())?;
        }
        let bytes = writer.into_inner().map_err(|error| error.to_string())?;
        Ok(format!("# {}\n{}", self.machine, String::from_utf8_lossy(&bytes)))
    }

    /// This table with what was measured now in place of what it holds.
    #[must_use]
    pub fn updated(mut self, now: &Self) -> Self {
        self.medians.retain(|kept| now.medians.iter().all(|new| new.benchmark != kept.benchmark));
        self.medians.extend(now.medians.iter().cloned());
        self.medians.sort_by(|a, b| a.benchmark.cmp(&b.benchmark));
        self.machine.clone_from(&now.machine);
        self
    }

    fn find(&self, benchmark: &str) -> Option<&Median> {
        self.medians.iter().find(|median| median.benchmark == benchmark)
    }

    /// The medians as a table in Markdown, with the ratio to those of an earlier table. A benchmark is called slower or faster
    /// where the two intervals have nothing in common.
    pub fn ratios(&self, before: &Self) -> String {
        let mut text = String::from("| benchmark | before | now | now / before | |\n|---|---|---|---|---|\n");
        for now in &self.medians {
            let (old, ratio, verdict) = match before.find(&now.benchmark) {
                None => ("-".into(), "-".into(), "new"),
                Some(old) => {
                    (time(old.median_ns), format!("{:.2}", now.median_ns / old.median_ns), verdict(old, now))
                }
            };
            let row =
                [&now.benchmark, &old, &time(now.median_ns), &ratio, verdict].map(str::to_owned).join(" | ");
            // Writing to a String cannot fail.
            let _ = writeln!(text, "| {row} |");
        }
        text
    }
}

fn verdict(before: &Median, now: &Median) -> &'static str {
    if now.low_ns > before.high_ns {
        "slower"
    } else if now.high_ns < before.low_ns {
        "faster"
    } else {
        ""
    }
}

/// A time with three digits in a unit that suits it.
fn time(ns: f64) -> String {
    let (value, unit) = match ns {
        ns if ns < 1e3 => (ns, "ns"),
        ns if ns < 1e6 => (ns / 1e3, "us"),
        ns if ns < 1e9 => (ns / 1e6, "ms"),
        ns => (ns / 1e9, "s"),
    };
    let digits = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn median(benchmark: &str, median_ns: f64) -> Median {
        Median {
            benchmark: benchmark.into(),
            median_ns,
            low_ns: 0.875 * median_ns,
            high_ns: 1.125 * median_ns,
        }
    }

    fn table(medians: &[(&str, f64)]) -> BenchTable {
        BenchTable::new("rustc 1.95.0".into(), medians.iter().map(|(name, ns)| median(name, *ns)).collect())
    }

    #[test]
    fn a_table_comes_back_as_it_was_written() {
        let written = table(&[("trace/12, scattering 0.3", 1e7), ("design", 420.0)]);
        let text = written.text().unwrap();
        assert!(text.starts_with("# rustc 1.95.0\nbenchmark,median_ns,low_ns,high_ns\n"), "{text}");
        assert_eq!(BenchTable::parse(&text).unwrap(), written);
    }

    #[test]
    fn what_is_no_median_is_refused() {
        let head = "# m\nbenchmark,median_ns,low_ns,high_ns\n";
        for line in ["a,0,0,0", "a,1,2,1", "a,x,1,1", "a,1,1"] {
            assert!(BenchTable::parse(&format!("{head}{line}\n")).is_err(), "{line}");
        }
    }

    #[test]
    fn ratios_say_what_is_slower_beyond_both_intervals() {
        let text =
            table(&[("a", 2000.0), ("b", 105.0), ("c", 1.0)]).ratios(&table(&[("a", 1000.0), ("b", 100.0)]));
        let rows: Vec<&str> = text.lines().skip(2).collect();
        assert_eq!(
            rows,
            [
                "| a | 1.00 us | 2.00 us | 2.00 | slower |",
                "| b | 100 ns | 105 ns | 1.05 |  |",
                "| c | - | 1.00 ns | - | new |"
            ]
        );
        let faster = table(&[("a", 500.0)]).ratios(&table(&[("a", 1000.0)]));
        assert!(faster.ends_with("| 0.50 | faster |\n"), "{faster}");
    }

    #[test]
    fn benchmarks_that_were_not_run_stay() {
        let kept = table(&[("a", 1.0), ("b", 2.0)]).updated(&table(&[("c", 4.0), ("a", 3.0)]));
        assert_eq!(kept, table(&[("a", 3.0), ("b", 2.0), ("c", 4.0)]));
    }
}
