//! Every example is short, has an entry in Cargo.toml, and stands in the index and says so itself what it is.

use crate::folder;
use std::collections::BTreeSet;

/// Longer ones are programs, not examples.
const MAX_LINES: usize = 100;

/// Names of the sources beside Cargo.toml.
pub fn names() -> BTreeSet<String> {
    let files = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    let sources = files.filter(|path| path.extension().is_some_and(|e| e == "rs"));
    sources.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
}

fn source(name: &str) -> String {
    std::fs::read_to_string(folder().join(format!("{name}.rs"))).unwrap()
}

#[test]
fn every_source_is_an_example_of_the_manifest_and_stands_in_the_index_once() {
    let manifest = std::fs::read_to_string(folder().join("Cargo.toml")).unwrap();
    let index = std::fs::read_to_string(folder().join("README.md")).unwrap();
    let names = names();
    assert!(names.len() >= 15, "{names:?}");
    for name in &names {
        let entry = format!("[[example]]\nname = \"{name}\"\npath = \"{name}.rs\"\n");
        assert!(manifest.contains(&entry), "{name}: no entry in Cargo.toml");
        assert_eq!(
            index.matches(&format!("[{name}]({name}.rs)")).count(),
            1,
            "{name}: not once in README.md"
        );
        assert_eq!(
            index.matches(&format!("--example {name}`")).count(),
            1,
            "{name}: no command in README.md"
        );
    }
    assert_eq!(manifest.matches("[[example]]").count(), names.len(), "an entry without a file");
}

#[test]
fn every_example_is_short_and_says_how_to_run_it_what_it_prints_and_where_to_go_on() {
    for name in names() {
        let source = source(&name);
        let lines = source.lines().count();
        assert!(lines <= MAX_LINES, "{name}.rs has {lines} lines");
        let header: Vec<&str> = source.lines().take_while(|line| line.starts_with("//!")).collect();
        let header = header.join("\n");
        assert!(header.contains(&format!("cargo run --example {name}")), "{name}: no command");
        assert_eq!(header.matches("```").count(), 4, "{name}: a command and what it prints");
        assert!(header.contains("`sabine "), "{name}: which command does it in full?");
        assert!(!source.contains("clap"), "{name}: an example takes one argument at most");
    }
}

#[test]
fn pages_that_examples_point_to_exist() {
    let root = folder().join("..");
    for name in names() {
        let source = source(&name);
        let pages = source.split('`').filter(|text| text.starts_with("docs/") && text.ends_with(".md"));
        for page in pages {
            assert!(root.join(page).exists(), "{name}: there is no {page}");
        }
    }
}

/// What an example shows of its output is what it prints: every line of the second block, dots for what is left out, is there.
pub fn shown(name: &str) -> Vec<String> {
    let source = source(name);
    let block = source.split("```").nth(3).unwrap().strip_prefix("text").unwrap().to_owned();
    let lines = block.lines().map(|line| line.trim_start_matches("//!").trim().to_owned());
    lines.filter(|line| !line.is_empty() && line != "...").collect()
}
