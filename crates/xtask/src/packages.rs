//! The published crates as their users get them: packed, unpacked beside each other, built and tested without the repository.

use crate::error::Error;
use crate::job::{Job, run_all};
use crate::workspace::{Package, Workspace, cargo};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Parts of the names of unit tests and of examples of the documentation that read the repository's fixtures or use its oracles: they
/// run in the workspace only. A test that begins to reach out of its crate fails here until it is named, or moved into `tests`, which
/// is not packed.
const NEED_THE_REPOSITORY: [(&str, &[&str]); 6] = [
    (
        "sabine-scene",
        &[
            "other_model::tests::",
            "materials::tests::",
            "response_check::tests::recorded_speech_is_no_response",
            "src/measured_room/notes.rs",
        ],
    ),
    ("sabine-estimator", &["src/reader.rs"]),
    ("sabine-optimize", &["src/config.rs"]),
    ("sabine-diagnose", &["plan::candidates::tests::", "src/lib.rs"]),
    ("sabine", &["src/guide.rs", "src/lib.rs"]),
    ("sabine-cli", &["demo::tests::the_demo_is_the_fixture"]),
];

/// Options of the chore.
#[derive(clap::Args)]
pub struct Arguments {
    /// Only the package of this name; all are packed
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Check the crates with the oldest direct dependencies that their manifests allow, in place of the tests; needs nightly Rust
    #[arg(long, conflicts_with = "only")]
    minimal_versions: bool,
}

/// Packs all published crates, unpacks them and tests each.
///
/// # Errors
/// A crate cannot be packed or unpacked; [`Error::Failed`] names the packages whose tests fail.
pub fn run(root: &Path, arguments: &Arguments) -> Result<(), Error> {
    let workspace = Workspace::read(root)?;
    let published: Vec<&Package> =
        workspace.packages.iter().filter(|package| package.is_published()).collect();
    if let Some(name) =
        arguments.only.as_ref().filter(|name| published.iter().all(|package| package.name != **name))
    {
        return Err(Error::Argument { reason: format!("--only {name}: no published package has this name") });
    }
    pack(root, &published)?;
    let folder = unpack(root, &workspace, &published)?;
    if arguments.minimal_versions {
        let [choose, check] = minimal_version_jobs();
        // Where they cannot be chosen cargo would check the newest ones, and all would seem well.
        choose.run(&folder)?;
        return run_all(&folder, &[check]);
    }
    let wanted = |package: &&Package| arguments.only.as_ref().is_none_or(|only| package.name == *only);
    let jobs: Vec<Job> = published.into_iter().filter(wanted).map(test_job).collect();
    run_all(&folder, &jobs)
}

/// Writes the packages. They are built afterwards, so that cargo need not.
fn pack(root: &Path, published: &[&Package]) -> Result<(), Error> {
    let mut arguments = vec!["package", "--no-verify", "--allow-dirty", "--quiet"];
    arguments.extend(published.iter().flat_map(|package| ["-p", package.name.as_str()]));
    Job::cargo("pack", &arguments).run(root).map(|_| ())
}

/// Unpacks the packages into a folder of their own, whose workspace replaces the registry for them.
fn unpack(root: &Path, workspace: &Workspace, published: &[&Package]) -> Result<PathBuf, Error> {
    let packed = workspace.target_directory.join("package");
    let folder = workspace.target_directory.join("unpacked");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(Error::io(&folder))?;
    }
    std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    for package in published {
        let file = packed.join(format!("{}.crate", package.name_and_version()));
        let status = Command::new("tar")
            .arg("xzf")
            .arg(&file)
            .current_dir(&folder)
            .status()
            .map_err(|source| Error::Start { program: "tar".into(), source })?;
        if !status.success() {
            return Err(Error::content(file, "tar cannot unpack it"));
        }
    }
    let manifest = root.join("Cargo.toml");
    let text = std::fs::read_to_string(&manifest).map_err(Error::io(&manifest))?;
    write(&folder.join("Cargo.toml"), &workspace_of(published, &profiles(&text)))?;
    let lock = root.join("Cargo.lock");
    write(&folder.join("Cargo.lock"), &std::fs::read_to_string(&lock).map_err(Error::io(&lock))?)?;
    // What third parties made is built once for both workspaces.
    let cargo = folder.join(".cargo");
    std::fs::create_dir_all(&cargo).map_err(Error::io(&cargo))?;
    let target = workspace.target_directory.display();
    write(&cargo.join("config.toml"), &format!("[build]\ntarget-dir = \"{target}\"\n"))?;
    Ok(folder)
}

fn write(path: &Path, text: &str) -> Result<(), Error> {
    std::fs::write(path, text).map_err(Error::io(path))
}

/// The manifest above the unpacked packages: each takes the other ones from here.
fn workspace_of(published: &[&Package], profiles: &str) -> String {
    let mut text =
        "[workspace]\nresolver = \"3\"\nmembers = [\"*-[0-9]*\"]\n\n[patch.crates-io]\n".to_owned();
    for package in published {
        text += &format!("{} = {{ path = \"{}\" }}\n", package.name, package.name_and_version());
    }
    text + "\n" + profiles
}

/// The tables of a manifest that say how things are built: without them the numerics of the tests take minutes.
fn profiles(manifest: &str) -> String {
    let mut text = String::new();
    let mut within = false;
    for line in manifest.lines() {
        if line.starts_with('[') {
            within = line.starts_with("[profile.");
        }
        if within {
            text += line;
            text.push('\n');
        }
    }
    text
}

/// Unit tests and examples of the documentation of an unpacked package.
fn test_job(package: &Package) -> Job {
    let mut arguments = vec!["test", "--all-features", "--no-fail-fast", "-p", &package.name, "--"];
    let skipped = NEED_THE_REPOSITORY.iter().filter(|(name, _)| *name == package.name);
    arguments.extend(skipped.flat_map(|(_, tests)| *tests).flat_map(|test| ["--skip", *test]));
    Job::cargo(format!("{} alone", package.name), &arguments)
}

/// The oldest versions of direct dependencies: a manifest that promises too much does not compile with them.
fn minimal_version_jobs() -> [Job; 2] {
    let oldest = ["run", "nightly", "cargo", "update", "-Z", "direct-minimal-versions"];
    [
        Job::new("the oldest direct dependencies", "rustup", &oldest),
        Job::new("libraries with them", &cargo(), &["check", "--workspace", "--all-features"]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::root;

    #[test]
    fn the_profiles_of_the_workspace_are_taken_over_and_nothing_else() {
        let manifest = "[workspace]\na = 1\n[profile.dev]\nopt-level = 2\n\n[profile.dev.package.\"*\"]\ndebug = false\n[lints]\nb = 2\n";
        assert_eq!(
            profiles(manifest),
            "[profile.dev]\nopt-level = 2\n\n[profile.dev.package.\"*\"]\ndebug = false\n"
        );
    }

    #[test]
    fn the_workspace_of_the_packages_replaces_the_registry_for_each() {
        let workspace = Workspace::read(&root()).unwrap();
        let published: Vec<&Package> = workspace.packages.iter().filter(|p| p.is_published()).collect();
        let text = workspace_of(&published, "");
        for package in ["sabine-acoustics", "sabine-cli", "sabine"] {
            assert!(text.contains(&format!("\n{package} = {{ path = \"{package}-")), "{text}");
        }
        assert!(!text.contains("testkit") && !text.contains("xtask"));
    }

    #[test]
    fn tests_that_need_the_repository_belong_to_published_packages() {
        let workspace = Workspace::read(&root()).unwrap();
        for (name, tests) in NEED_THE_REPOSITORY {
            let package = workspace.packages.iter().find(|package| package.name == name);
            assert!(package.is_some_and(Package::is_published) && !tests.is_empty(), "{name}");
        }
    }
}
