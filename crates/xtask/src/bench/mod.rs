//! Medians of the benches, kept as a table and compared as ratios.
//!
//! Times of two machines, or of one machine under another load, do not compare: a ratio counts where both runs were made on the same
//! quiet machine. The first line of a kept table says what it was made on.

mod medians;
mod table;

use crate::error::Error;
use crate::job::Job;
use crate::workspace::{Package, Workspace};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use table::BenchTable;

/// Options of the benches.
#[derive(clap::Args)]
pub struct Arguments {
    /// Keep the medians in this file, as docs/validation/bench.csv holds them; those of benches that are not run now stay
    #[arg(long, value_name = "F.csv")]
    save: Option<PathBuf>,
    /// Compare with the medians in this file
    #[arg(long, value_name = "F.csv")]
    against: Option<PathBuf>,
    /// Only the benches of these packages
    #[arg(long, short, value_name = "NAME")]
    package: Vec<String>,
    /// Only the benchmarks whose names contain this
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// Fewer repetitions: seconds a bench, medians known less well
    #[arg(long)]
    quick: bool,
}

/// Runs the benches one after the other and keeps or compares their medians.
///
/// # Errors
/// A bench fails; a file cannot be read or written; nothing was measured.
pub fn run(root: &Path, arguments: &Arguments) -> Result<(), Error> {
    // What is compared with is read first: a run takes minutes.
    let against = arguments.against.as_deref().map(BenchTable::read).transpose()?;
    let kept = arguments.save.as_deref().filter(|path| path.exists()).map(BenchTable::read).transpose()?;
    let workspace = Workspace::read(root)?;
    let begin = SystemTime::now();
    let mut run = 0;
    for package in &workspace.packages {
        if !arguments.package.is_empty() && !arguments.package.contains(&package.name) {
            continue;
        }
        for bench in criterion_benches(package)? {
            let mut words = vec!["bench", "-p", &package.name, "--bench", &bench, "--"];
            words.extend(arguments.quick.then_some("--quick"));
            words.extend(arguments.filter.as_deref());
            Job::cargo(format!("bench {bench} of {}", package.name), &words).run(root)?;
            run += 1;
        }
    }
    if run == 0 {
        return Err(Error::Argument { reason: "--package: none of these packages has a bench".into() });
    }
    let found = medians::since(&workspace.target_directory.join("criterion"), begin)?;
    if found.is_empty() {
        return Err(Error::Argument { reason: "--filter: no benchmark has a name like this".into() });
    }
    let measured = BenchTable::new(machine(), found);
    if let Some(before) = &against {
        println!("\nagainst: {}\nnow:     {}\n", before.machine, measured.machine);
        print!("{}", measured.ratios(before));
    }
    if let Some(path) = &arguments.save {
        kept.map_or_else(|| measured.clone(), |kept| kept.updated(&measured)).write(path)?;
        println!("\n{} medians in {}", measured.medians.len(), path.display());
    }
    if against.is_none() && arguments.save.is_none() {
        print!("{}", measured.ratios(&BenchTable::new(String::new(), Vec::new())));
    }
    Ok(())
}

/// Benches that criterion runs; others are programs of the peers' scripts, with arguments and tables of their own.
fn criterion_benches(package: &Package) -> Result<Vec<String>, Error> {
    let mut names = Vec::new();
    for target in package.targets.iter().filter(|target| target.kind == ["bench"]) {
        let source = std::fs::read_to_string(&target.src_path).map_err(Error::io(&target.src_path))?;
        if source.contains("criterion_main!") {
            names.push(target.name.clone());
        }
    }
    Ok(names)
}

/// What the medians are measured on: compiler, architecture, threads.
fn machine() -> String {
    let rustc = std::process::Command::new("rustc").arg("--version").output();
    let rustc =
        rustc.map_or_else(|_| "rustc".into(), |output| String::from_utf8_lossy(&output.stdout).into_owned());
    let rustc = rustc.split(" (").next().unwrap_or_default().trim().to_owned();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{rustc}, {}, {threads} threads", std::env::consts::ARCH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::root;

    #[test]
    fn benches_of_criterion_are_run_and_programs_of_the_peers_are_not() {
        let workspace = Workspace::read(&root()).unwrap();
        let of = |name: &str| {
            criterion_benches(workspace.packages.iter().find(|p| p.name == name).unwrap()).unwrap()
        };
        assert_eq!(of("sabine-features"), ["log_mel"]);
        assert!(!of("sabine-propagate").contains(&"against_peers".to_owned()));
    }
}
