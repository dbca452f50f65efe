//! The import table of the workspace, held against what the manifests say.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Each package and the packages of this workspace that it may import.
const MAY_IMPORT: [(&str, &[&str]); 24] = [
    ("sabine-acoustics", &[]),
    ("sabine-features", &["sabine-acoustics"]),
    ("sabine-eqfilter", &["sabine-acoustics"]),
    ("sabine-scene", &["sabine-acoustics"]),
    ("sabine-paths", &["sabine-acoustics", "sabine-scene"]),
    ("sabine-propagate", &["sabine-acoustics", "sabine-paths", "sabine-scene"]),
    (
        "sabine-augment",
        &["sabine-acoustics", "sabine-eqfilter", "sabine-features", "sabine-paths", "sabine-scene"],
    ),
    ("sabine-estimator", &["sabine-acoustics", "sabine-features"]),
    ("sabine-optimize", &["sabine-acoustics", "sabine-paths", "sabine-scene"]),
    (
        "sabine-diagnose",
        &["sabine-acoustics", "sabine-optimize", "sabine-paths", "sabine-propagate", "sabine-scene"],
    ),
    (
        "sabine",
        &[
            "sabine-acoustics",
            "sabine-augment",
            "sabine-diagnose",
            "sabine-eqfilter",
            "sabine-estimator",
            "sabine-features",
            "sabine-optimize",
            "sabine-paths",
            "sabine-propagate",
            "sabine-scene",
        ],
    ),
    ("sabine-testkit", &["sabine-acoustics", "sabine-paths", "sabine-scene"]),
    ("sabine-cli", &["sabine"]),
    ("sabine-examples", &["sabine"]),
    ("sabine-python", &["sabine"]),
    ("sabine-validation", &["sabine", "sabine-cli", "sabine-testkit"]),
    // Not the facade: the network would travel with the page.
    (
        "sabine-wasm",
        &["sabine-acoustics", "sabine-diagnose", "sabine-paths", "sabine-propagate", "sabine-scene"],
    ),
    // Not the facade: a plug-in needs no network, and holds the least Rust version of the libraries.
    (
        "sabine-clap-plugin",
        &[
            "sabine-acoustics",
            "sabine-diagnose",
            "sabine-eqfilter",
            "sabine-paths",
            "sabine-propagate",
            "sabine-scene",
        ],
    ),
    (
        "sabine-with-bevy",
        &[
            "sabine-acoustics",
            "sabine-eqfilter",
            "sabine-paths",
            "sabine-propagate",
            "sabine-scene",
            "sabine-with-firewheel",
        ],
    ),
    ("sabine-with-cpal", &["sabine-acoustics", "sabine-eqfilter"]),
    ("sabine-with-firewheel", &["sabine-acoustics", "sabine-eqfilter"]),
    ("sabine-with-kira", &["sabine-acoustics", "sabine-eqfilter"]),
    ("sabine-with-rodio", &["sabine-acoustics", "sabine-eqfilter"]),
    ("xtask", &[]),
];

/// Libraries that live behind one crate alone, so that nobody else's users compile them.
const LIVES_IN: [(&str, &str); 12] = [
    ("parry3d", "sabine-propagate"),
    ("candle-core", "sabine-estimator"),
    ("candle-nn", "sabine-estimator"),
    ("bevy_ecs", "sabine-with-bevy"),
    ("clack-plugin", "sabine-clap-plugin"),
    ("gltf", "sabine-scene"),
    ("hdf5-pure", "sabine-scene"),
    ("hound", "sabine-acoustics"),
    ("kira", "sabine-with-kira"),
    ("pyo3", "sabine-python"),
    ("rodio", "sabine-with-rodio"),
    ("wasm-bindgen", "sabine-wasm"),
];

/// Normal dependencies of every package of the workspace: what its users compile.
fn normal_dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline", "--manifest-path"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.toml"))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = |value: &serde_json::Value| value.as_str().expect("a string").to_owned();
    let normal = |package: &serde_json::Value| {
        let all = package["dependencies"].as_array().expect("a list");
        all.iter().filter(|d| d["kind"].is_null()).map(|d| text(&d["name"])).collect()
    };
    let packages = metadata["packages"].as_array().expect("a list");
    packages.iter().map(|package| (text(&package["name"]), normal(package))).collect()
}

#[test]
fn every_crate_imports_only_what_its_row_allows() {
    let found = normal_dependencies();
    let table: BTreeMap<&str, &[&str]> = MAY_IMPORT.into();
    let known: BTreeSet<&str> = table.keys().copied().collect();
    let names: BTreeSet<&str> = found.keys().map(String::as_str).collect();
    assert_eq!(names, known, "the table and the workspace name different packages");
    for (package, dependencies) in &found {
        let own: Vec<&String> = dependencies.iter().filter(|d| known.contains(d.as_str())).collect();
        for dependency in own {
            assert!(
                table[package.as_str()].contains(&dependency.as_str()),
                "{package} must not import {dependency}"
            );
        }
    }
}

#[test]
fn heavy_libraries_stay_behind_one_crate() {
    for (package, dependencies) in normal_dependencies() {
        for (library, home) in LIVES_IN {
            assert!(
                package == home || !dependencies.contains(library),
                "{library} lives in {home}, not in {package}"
            );
        }
    }
}

/// A user copies the line for `[dependencies]` from the front page.
#[test]
fn front_pages_name_the_version_that_is_current() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let version = manifest.split("\nversion = \"").nth(1).unwrap().split('"').next().unwrap();
    let current = version.rsplit_once('.').unwrap().0;
    let mut named = 0;
    for (package, _) in MAY_IMPORT {
        let folder = root.join("crates").join(package.trim_start_matches("sabine-"));
        for page in ["README.md", "src/lib.rs"] {
            let Ok(text) = std::fs::read_to_string(folder.join(page)) else { continue };
            let begin = format!("{package} = \"");
            for line in text.lines().filter_map(|line| line.trim_start_matches("//! ").strip_prefix(&begin)) {
                assert_eq!(line.trim_end_matches('"'), current, "{package}: {page}");
                named += 1;
            }
        }
    }
    assert!(named >= 14, "only {named} pages have a line for [dependencies]");
}
