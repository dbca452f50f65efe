//! Links between the documents lead somewhere.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Markdown without what stands in code, which may hold anything.
fn prose(text: &str) -> String {
    let mut in_code = false;
    let mut kept = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_code = !in_code;
        } else if !in_code {
            for (i, part) in line.split('`').enumerate() {
                // Between two backticks: its place is kept, so that links around code stay links.
                kept.push_str(if i % 2 == 0 { part } else { "code" });
            }
            kept.push('\n');
        }
    }
    kept
}

/// Targets of `[text](target)`.
fn targets(text: &str) -> Vec<String> {
    let prose = prose(text);
    let ends = prose.match_indices("](").map(|(at, _)| &prose[at + 2..]);
    ends.filter_map(|rest| rest.split_once(')')).map(|(target, _)| target.trim().to_owned()).collect()
}

/// Anchors of the headings, as GitHub makes them.
fn anchors(text: &str) -> Vec<String> {
    let mut seen: HashMap<String, usize> = HashMap::new();
    let mut in_code = false;
    let mut found = Vec::new();
    for line in text.lines() {
        in_code ^= line.trim_start().starts_with("```");
        let Some(title) = line.strip_prefix('#').filter(|_| !in_code) else { continue };
        let slug: String = title
            .trim_start_matches('#')
            .trim()
            .to_lowercase()
            .chars()
            .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
            .map(|c| if c == ' ' { '-' } else { c })
            .collect();
        let count = seen.entry(slug.clone()).or_insert(0);
        found.push(if *count == 0 { slug } else { format!("{slug}-{count}") });
        *count += 1;
    }
    found
}

fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let hidden = path.file_name().unwrap().to_string_lossy().starts_with('.');
        if path.is_dir() && !hidden && !path.ends_with("target") {
            documents(&path, found);
        } else if path.extension().is_some_and(|e| e == "md") {
            found.push(path);
        }
    }
}

/// What is wrong with the links of a document.
fn faults(path: &Path, text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    for target in targets(text) {
        if target.contains("://") || target.starts_with("mailto:") {
            continue;
        }
        let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
        let to = if file.is_empty() { path.to_owned() } else { path.parent().unwrap().join(file) };
        if !to.exists() {
            faults.push(format!("{}: {target}: there is no such file", path.display()));
        } else if !anchor.is_empty() {
            let known = std::fs::read_to_string(&to).map(|text| anchors(&text)).unwrap_or_default();
            if !known.contains(&anchor.to_owned()) {
                faults.push(format!("{}: {target}: there is no such heading", path.display()));
            }
        }
    }
    faults
}

#[test]
fn links_and_anchors_of_all_documents_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = vec![root.join("README.md"), root.join("CHANGELOG.md"), root.join("CONTRIBUTING.md")];
    for folder in ["docs", "examples", "crates", "fixtures"] {
        documents(&root.join(folder), &mut found);
    }
    assert!(found.len() > 20, "{found:?}");
    let (mut links, mut wrong) = (0, Vec::new());
    for path in &found {
        let text = std::fs::read_to_string(path).unwrap();
        links += targets(&text).len();
        wrong.extend(faults(path, &text));
    }
    assert!(links > 30, "{links} links: is the reader of links blind?");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_dead_link_and_a_dead_anchor_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let text = "# A title, with *marks*\n## Same\n## Same\n[good](#a-title-with-marks) [good](#same-1)\n\
        ```\n[not a link](nowhere.md)\n# no heading\n```\n[bad](#no-heading) [bad](nowhere.md) [out](https://example.org/x)\n";
    let path = folder.path().join("a.md");
    std::fs::write(&path, text).unwrap();
    let found = faults(&path, text);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].contains("no such heading") && found[1].contains("no such file"));
}
