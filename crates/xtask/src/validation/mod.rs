//! Tables of `docs/validation` that a command prints.
//!
//! Before such a table stands a comment:
//!
//! ```text
//! <!-- table: NAME; ignore: s, MB; command: cargo test -p sabine-cli --test it bad_inputs:: -- --nocapture -->
//! ```
//!
//! `part` after the name says that the page leaves out rows.
//!
//! The command runs in a shell in the repository's root. Of what it prints, the table in Markdown that has the most columns and rows
//! in common with that of the page is compared with it, in the columns that both have and that are not ignored (times, memory).

mod diff;
mod markdown;
mod marker;

use crate::error::Error;
use marker::Marked;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Options of the comparison.
#[derive(clap::Args)]
pub struct Arguments {
    /// Name of the table
    #[arg(required_unless_present = "list")]
    table: Option<String>,
    /// List the tables with their pages and commands
    #[arg(long)]
    list: bool,
    /// Compare with this output, kept from an earlier run, and run nothing
    #[arg(long, value_name = "F", conflicts_with = "list")]
    output: Option<PathBuf>,
}

/// Lists the tables, or runs the command of one and shows what differs.
///
/// # Errors
/// [`Error::Differs`]: the table is not what is printed. A marker is malformed or there is no table of the name; the command fails or
/// prints no such table.
pub fn run(root: &Path, arguments: &Arguments) -> Result<(), Error> {
    let tables = marked_tables(root)?;
    let Some(name) = &arguments.table else {
        for table in &tables {
            println!("{}\n    {}\n    {}", table.name, table.page.display(), table.command);
        }
        return Ok(());
    };
    let Some(table) = tables.iter().find(|table| table.name == *name) else {
        return Err(Error::Argument { reason: format!("there is no table {name}; --list lists them") });
    };
    let printed = match &arguments.output {
        Some(path) => std::fs::read_to_string(path).map_err(Error::io(path))?,
        None => output_of(root, table)?,
    };
    let compared = table.compare(&printed).ok_or_else(|| {
        Error::content(&table.page, format!("`{}` prints no table with these columns", table.command))
    })?;
    for column in &compared.not_printed {
        println!("not printed: column \"{column}\"");
    }
    let lines = compared.lines.iter().filter(|line| line.is_change()).count();
    println!("--- {}, table {name}\n+++ {}", table.page.display(), table.command);
    for line in &compared.lines {
        println!("{line}");
    }
    if lines > 0 { Err(Error::Differs { table: name.clone(), lines }) } else { Ok(()) }
}

/// What a table's command prints, on both streams.
fn output_of(root: &Path, table: &Marked) -> Result<String, Error> {
    println!("== {}", table.command);
    let output = Command::new("sh")
        .args(["-c", &format!("{{ {} ; }} 2>&1", table.command)])
        .current_dir(root)
        .output()
        .map_err(|source| Error::Start { program: "sh".into(), source })?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    if !output.status.success() {
        eprintln!("{text}");
        return Err(Error::Failed { names: vec![table.command.clone()] });
    }
    Ok(text)
}

/// All marked tables, in the order of pages.
fn marked_tables(root: &Path) -> Result<Vec<Marked>, Error> {
    let folder = root.join("docs/validation");
    let entries = std::fs::read_dir(&folder).map_err(Error::io(&folder))?;
    let mut pages: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    pages.retain(|path| path.extension().is_some_and(|e| e == "md"));
    pages.sort();
    let mut tables: Vec<Marked> = Vec::new();
    for path in pages {
        let text = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
        let page = path.strip_prefix(root).unwrap_or(&path);
        for table in marker::tables(page, &text)? {
            if tables.iter().any(|other| other.name == table.name) {
                return Err(Error::content(page, format!("a second table is called {}", table.name)));
            }
            tables.push(table);
        }
    }
    Ok(tables)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::root;

    #[test]
    fn the_markers_of_the_pages_can_be_read() {
        let tables = marked_tables(&root()).unwrap();
        assert!(tables.len() >= 5, "{}", tables.len());
        for table in tables {
            assert!(table.columns() >= 2, "{}", table.name);
        }
    }
}
