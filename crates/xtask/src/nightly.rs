//! What the gate has no time for.

use crate::error::Error;
use crate::job::{Job, run_all};
use crate::workspace::{Package, Workspace};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Fuzzes a reader of untrusted files for a minute, from its seeds on, with the limits of the fuzz targets' page: `$0` is its name, `$1`
/// the features that it needs, which are built for no other target.
const FUZZ: &str = "set -e; cd crates/testkit/fuzz; mkdir -p \"corpus/$0\"; [ ! -d /dev/shm ] || export TMPDIR=/dev/shm; \
    rustup run nightly cargo fuzz run --fuzz-dir . --no-default-features --features \"$1\" \"$0\" \"corpus/$0\" \"seeds/$0\" -- \
    -max_total_time=60 -rss_limit_mb=1024 -malloc_limit_mb=256";

/// Installs the command as a user does, and runs it where nothing of the repository is.
const INSTALL: &str = "set -e; root=$PWD/target/nightly_install; \
    cargo install --path crates/cli --root \"$root\" --locked --quiet; \
    empty=$(mktemp -d); cd \"$empty\"; \"$root/bin/sabine\" match; test -s out/match/report.html; rm -r \"$empty\"";

/// Every test, those of the diagnosis among the whole catalogue, and property tests with other cases than the gate's and the night's before.
const EVERY_TEST: &str = "export SABINE_WHOLE_CATALOGUE=1 PROPTEST_RNG_SEED=$(date +%s); \
    echo \"PROPTEST_RNG_SEED=$PROPTEST_RNG_SEED\"; cargo test --workspace --release --no-fail-fast -- --include-ignored";

/// The last release is the newest tag `v*`; before the first one there is nothing to be compatible with.
const COMPATIBLE: &str =
    "cargo semver-checks --workspace --baseline-rev \"$(git describe --tags --match 'v*' --abbrev=0)\"";

/// Options of the nightly run.
#[derive(clap::Args)]
pub struct Arguments {
    /// Only the jobs whose names contain this
    #[arg(long)]
    only: Option<String>,
    /// List the jobs and run none
    #[arg(long)]
    list: bool,
}

/// Runs the jobs.
///
/// # Errors
/// [`Error::Failed`] names the jobs that failed.
pub fn run(root: &Path, arguments: &Arguments) -> Result<(), Error> {
    let workspace = Workspace::read(root)?;
    let mut jobs = jobs(&workspace.packages, &fuzz_targets(root)?);
    jobs.retain(|job| arguments.only.as_ref().is_none_or(|only| job.name.contains(only)));
    if arguments.list {
        for job in &jobs {
            println!("{}", job.name);
        }
        return Ok(());
    }
    if jobs.is_empty() {
        return Err(Error::Argument {
            reason: "--only: no job has a name like this; --list lists them".into(),
        });
    }
    run_all(root, &jobs)
}

/// A program of the fuzz targets' manifest.
struct Target {
    name: String,
    /// Those that it requires, with commas between.
    features: String,
}

fn jobs(packages: &[Package], fuzz_targets: &[Target]) -> Vec<Job> {
    let mut jobs = vec![
        Job::new("every test in release, those that take long too", "bash", &["-c", EVERY_TEST]),
        Job::cargo("main example in release", &["run", "--release", "--example", "match_room"]),
        Job::new("install, and run in an empty folder", "bash", &["-c", INSTALL]),
        Job::new("python wheel", "bash", &["crates/python/test_wheel.sh"]),
    ];
    jobs.extend(packages.iter().flat_map(feature_jobs));
    jobs.extend(least_rust_jobs(packages));
    jobs.extend(publishing_jobs());
    for Target { name, features } in fuzz_targets {
        let job = Job::new(format!("fuzz {name}"), "bash", &["-c", FUZZ, name, features]);
        jobs.push(job.needs(&["rustup", "run", "nightly", "cargo", "fuzz", "--version"]));
    }
    jobs
}

/// A package without its default features, and with each of its features alone.
fn feature_jobs(package: &Package) -> Vec<Job> {
    let check = |name: String, more: &[&str]| {
        let mut arguments = vec!["clippy", "--no-deps", "-p", &package.name, "--no-default-features"];
        arguments.extend(more);
        arguments.extend(["--", "-D", "warnings"]);
        Job::cargo(name, &arguments)
    };
    let alone = package.features.keys().filter(|feature| *feature != "default");
    let mut jobs = vec![check(format!("{} without features", package.name), &[])];
    jobs.extend(alone.map(|feature| {
        check(format!("{} with {feature} alone", package.name), &["--features", feature.as_str()])
    }));
    jobs
}

/// Libraries under the least Rust version that each states.
fn least_rust_jobs(packages: &[Package]) -> Vec<Job> {
    let mut by_version: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in packages.iter().filter(|package| package.is_published()) {
        if let Some(version) = &package.rust_version {
            by_version.entry(version).or_default().insert(&package.name);
        }
    }
    let job = |(version, names): (&str, BTreeSet<&str>)| {
        let mut arguments = vec!["run", version, "cargo", "check", "--lib"];
        arguments.extend(names.iter().flat_map(|name| ["-p", *name]));
        Job::new(format!("least Rust {version}"), "rustup", &arguments).needs(&[
            "rustup",
            "run",
            version,
            "cargo",
            "--version",
        ])
    };
    by_version.into_iter().map(job).collect()
}

/// What the published packages must be: whole, compatible with the last release, content with the oldest dependencies they name.
fn publishing_jobs() -> [Job; 3] {
    [
        Job::cargo("packages, each alone", &["xtask", "packages"]),
        Job::cargo("packages, oldest direct dependencies", &["xtask", "packages", "--minimal-versions"])
            .needs(&["rustup", "run", "nightly", "cargo", "--version"]),
        Job::new("packages, compatible with the last release", "bash", &["-c", COMPATIBLE]).needs(&[
            "bash",
            "-c",
            "cargo semver-checks --version && git describe --tags --match 'v*' --abbrev=0",
        ]),
    ]
}

/// The fuzz targets: the programs of their manifest. Those that require features come last, for these take long to build.
fn fuzz_targets(root: &Path) -> Result<Vec<Target>, Error> {
    let path = root.join("crates/testkit/fuzz/Cargo.toml");
    let manifest = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
    let between = |text: &str, before: &str, after: &str| {
        Some(text.split_once(before)?.1.split_once(after)?.0.to_owned())
    };
    let target = |entry: &str| {
        let features = between(entry, "required-features = [", "]").unwrap_or_default();
        Some(Target { name: between(entry, "name = \"", "\"")?, features: features.replace(['"', ' '], "") })
    };
    let mut targets: Vec<Target> = manifest.split("[[bin]]").skip(1).filter_map(target).collect();
    targets.sort_by_key(|target| !target.features.is_empty());
    Ok(targets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::root;

    #[test]
    fn each_feature_the_packages_and_each_least_version_have_a_job() {
        let workspace = Workspace::read(&root()).unwrap();
        let targets = fuzz_targets(&root()).unwrap();
        let names: Vec<String> = jobs(&workspace.packages, &targets).into_iter().map(|j| j.name).collect();
        for wanted in [
            "sabine-propagate without features",
            "sabine-propagate with sofa alone",
            "packages, each alone",
            "packages, oldest direct dependencies",
            "packages, compatible with the last release",
            "least Rust 1.95",
            "fuzz wav",
            "fuzz room_toml",
        ] {
            assert!(names.iter().any(|name| name == wanted), "{wanted} is not among {names:?}");
        }
        assert!(!names.iter().any(|name| name.ends_with("default alone")));
    }

    #[test]
    fn the_network_is_built_for_the_fuzz_target_that_needs_it_and_last() {
        let targets = fuzz_targets(&root()).unwrap();
        let (last, others) = targets.split_last().unwrap();
        assert_eq!((last.name.as_str(), last.features.as_str()), ("weights", "weights"));
        assert!(others.len() >= 7 && others.iter().all(|target| target.features.is_empty()));
    }
}
