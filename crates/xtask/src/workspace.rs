//! The packages of this workspace, from `cargo metadata`.

use crate::error::Error;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The root of the repository from which cargo runs this program.
pub fn root() -> PathBuf {
    let here = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    let here = PathBuf::from(here);
    here.ancestors().nth(2).unwrap_or(&here).to_owned()
}

/// What `cargo metadata` says of the workspace.
#[derive(Debug, Deserialize)]
pub struct Workspace {
    /// Its packages.
    pub packages: Vec<Package>,
    /// Folder of what is built.
    pub target_directory: PathBuf,
}

/// A package.
#[derive(Debug, Deserialize)]
pub struct Package {
    /// Its name.
    pub name: String,
    version: String,
    /// Least Rust version, `1.89`.
    pub rust_version: Option<String>,
    /// Features, and what each turns on.
    pub features: BTreeMap<String, Vec<String>>,
    /// Registries it may be published to: none means any, an empty list means nowhere.
    publish: Option<Vec<String>>,
    /// What is built of it.
    pub targets: Vec<Target>,
}

/// A library, program, test or bench.
#[derive(Debug, Deserialize)]
pub struct Target {
    /// Its name.
    pub name: String,
    /// `lib`, `bin`, `bench`, ...
    pub kind: Vec<String>,
    /// Its first source file.
    pub src_path: PathBuf,
}

impl Package {
    /// Whether users get it from a registry.
    pub fn is_published(&self) -> bool {
        self.publish.is_none()
    }

    /// `sabine-scene-0.1.0`: what its package is called.
    pub fn name_and_version(&self) -> String {
        format!("{}-{}", self.name, self.version)
    }
}

impl Workspace {
    /// Asks cargo.
    ///
    /// # Errors
    /// Cargo cannot be started or its answer cannot be read.
    pub fn read(root: &Path) -> Result<Self, Error> {
        let output = Command::new(cargo())
            .args(["metadata", "--format-version", "1", "--no-deps"])
            .current_dir(root)
            .output()
            .map_err(|source| Error::Start { program: cargo(), source })?;
        if !output.status.success() {
            return Err(Error::content(
                root.join("Cargo.toml"),
                String::from_utf8_lossy(&output.stderr).trim(),
            ));
        }
        serde_json::from_slice(&output.stdout)
            .map_err(|error| Error::content(root.join("Cargo.toml"), error.to_string()))
    }
}

/// The cargo that runs this program.
pub fn cargo() -> String {
    std::env::var("CARGO").unwrap_or_else(|_| "cargo".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_workspace_has_this_package_and_says_which_ones_are_published() {
        let workspace = Workspace::read(&root()).unwrap();
        let find = |name: &str| workspace.packages.iter().find(|p| p.name == name).unwrap();
        assert!(!find("xtask").is_published());
        assert!(find("sabine-acoustics").is_published());
        assert!(find("sabine-features").targets.iter().any(|t| t.kind == ["bench"]));
    }
}
