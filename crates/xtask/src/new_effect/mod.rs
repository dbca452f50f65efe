//! A new effect of the diagnosis: its file, its place in the catalogue, its test, its row in the glossary.

mod template;

use crate::error::Error;
use std::path::{Path, PathBuf};
use template::Names;

/// Options of a new effect.
#[derive(clap::Args)]
pub struct Arguments {
    /// Identifier: lower case, words joined by `_`, as it will stand in diagnosis.json
    name: String,
}

/// Writes the files and says what is left to do.
///
/// # Errors
/// The name is refused; a file is not as expected, or cannot be written. Nothing is written then but what precedes the error.
pub fn run(root: &Path, arguments: &Arguments) -> Result<(), Error> {
    let names = Names::new(&arguments.name).map_err(|reason| Error::Argument { reason })?;
    let effects = root.join("crates/diagnose/src/effects");
    let file = effects.join(format!("{}.rs", names.id));
    if file.exists() || effects.join(&names.id).exists() {
        return Err(Error::Argument { reason: format!("{} exists already", file.display()) });
    }
    let (catalogue, test) = (effects.join("mod.rs"), test_file(root)?);
    let glossary = root.join("docs/glossary.md");
    // All new texts first: what cannot be made leaves every file as it is.
    let texts = [
        (file, template::effect(&names)),
        edited(catalogue, |text| register(text, &names))?,
        edited(test, |text| Ok(format!("{}\n\n{}", text.trim_end(), template::test(&names))))?,
        edited(glossary, |text| add_row(text, &template::row(&names)))?,
    ];
    for (path, text) in texts {
        std::fs::write(&path, text).map_err(Error::io(&path))?;
        println!("written: {}", path.strip_prefix(root).unwrap_or(&path).display());
    }
    print!("\n{}", template::what_is_left(&names));
    Ok(())
}

fn edited(
    path: PathBuf,
    change: impl Fn(&str) -> Result<String, String>,
) -> Result<(PathBuf, String), Error> {
    let text = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
    let text = change(&text).map_err(|reason| Error::content(&path, reason))?;
    Ok((path, text))
}

/// The tests of hidden effects.
fn test_file(root: &Path) -> Result<PathBuf, Error> {
    let tests = root.join("crates/diagnose/tests");
    let places = [tests.join("it/hidden_effects.rs"), tests.join("hidden_effects.rs")];
    let found = places.iter().find(|path| path.exists()).cloned();
    found.ok_or_else(|| Error::content(tests, "there is no hidden_effects.rs"))
}

/// `effects/mod.rs` with the effect among its modules, its exports and its catalogue.
fn register(text: &str, names: &Names) -> Result<String, String> {
    let (id, type_name) = (&names.id, &names.type_name);
    let text = insert_sorted(text, "mod ", &format!("mod {id};"))?;
    let text = insert_sorted(&text, "pub use ", &format!("pub use {id}::{type_name};"))?;
    let last = text.match_indices("        Box::new(").last().ok_or("no effect in its catalogue")?.0;
    let end = last + text[last..].find('\n').ok_or("its catalogue has no end")? + 1;
    Ok(format!("{}        Box::new({type_name}),\n{}", &text[..end], &text[end..]))
}

/// Puts a line among the first block of lines that begin so, in their order.
fn insert_sorted(text: &str, begin: &str, line: &str) -> Result<String, String> {
    let mut lines: Vec<&str> = text.lines().collect();
    let first =
        lines.iter().position(|l| l.starts_with(begin)).ok_or(format!("no line begins with `{begin}`"))?;
    let count = lines[first..].iter().take_while(|l| l.starts_with(begin)).count();
    let place = lines[first..first + count].iter().position(|l| *l > line).unwrap_or(count);
    lines.insert(first + place, line);
    Ok(lines.join("\n") + "\n")
}

/// A page with a row more at the end of its first table.
fn add_row(text: &str, row: &str) -> Result<String, String> {
    let mut lines: Vec<&str> = text.lines().collect();
    let first = lines.iter().position(|l| l.starts_with('|')).ok_or("it has no table")?;
    let count = lines[first..].iter().take_while(|l| l.starts_with('|')).count();
    lines.insert(first + count, row);
    Ok(lines.join("\n") + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::{self, cargo};
    use std::process::Command;

    #[test]
    fn an_effect_is_registered_in_its_three_places_and_in_order() {
        let text = "//! The catalogue.\n\nmod air;\nmod waves;\n\npub use air::Air;\npub use waves::Waves;\n\nfn catalogue() {\n    vec![\n        Box::new(Air),\n        Box::new(Waves),\n    ]\n}\n";
        let found = register(text, &Names::new("lost_channel").unwrap()).unwrap();
        assert!(found.contains("mod air;\nmod lost_channel;\nmod waves;\n"), "{found}");
        assert!(
            found.contains("pub use air::Air;\npub use lost_channel::LostChannel;\npub use waves"),
            "{found}"
        );
        assert!(found.contains("        Box::new(Waves),\n        Box::new(LostChannel),\n    ]"), "{found}");
        assert!(register("fn catalogue() {}\n", &Names::new("a").unwrap()).is_err());
    }

    #[test]
    fn a_row_goes_to_the_end_of_the_first_table() {
        let found = add_row("# Page\n\n| a |\n|---|\n| 1 |\n\nText\n", "| 2 |").unwrap();
        assert_eq!(found, "# Page\n\n| a |\n|---|\n| 1 |\n| 2 |\n\nText\n");
    }

    /// A copy of what the packages need of the repository.
    fn copy_of_the_repository(folder: &Path) {
        let root = workspace::root();
        let listed = Command::new("git").args(["ls-files", "-z"]).current_dir(&root).output().unwrap();
        let listed = String::from_utf8(listed.stdout).unwrap();
        for name in listed.split('\0').filter(|name| !name.is_empty()) {
            let (from, to) = (root.join(name), folder.join(name));
            // What was moved and is not yet committed is listed, too.
            if from.is_file() {
                std::fs::create_dir_all(to.parent().unwrap()).unwrap();
                std::fs::copy(from, to).unwrap();
            }
        }
    }

    #[test]
    fn an_effect_that_exists_is_refused_and_nothing_is_written() {
        let root = workspace::root();
        let arguments = Arguments { name: "air_absorption".into() };
        assert!(run(&root, &arguments).unwrap_err().to_string().contains("exists already"));
    }

    #[test]
    #[ignore = "nightly: compiles sabine-diagnose and its tests in a copy of the repository"]
    fn what_is_generated_compiles_without_a_warning() {
        let folder = tempfile::tempdir().unwrap();
        copy_of_the_repository(folder.path());
        run(folder.path(), &Arguments { name: "lost_channel".into() }).unwrap();
        let target = workspace::root().join("target/xtask_new_effect");
        let run = |arguments: &[&str]| {
            let output = Command::new(cargo())
                .args(arguments)
                .env("CARGO_TARGET_DIR", &target)
                .current_dir(folder.path())
                .output()
                .unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        };
        run(&["fmt", "-p", "sabine-diagnose", "--check"]);
        run(&["clippy", "--offline", "--all-targets", "-p", "sabine-diagnose", "--", "-D", "warnings"]);
        run(&["test", "--offline", "-p", "sabine-diagnose", "--lib", "effects::"]);
    }
}
