//! The comments that say which command prints a table.

use super::diff::{Line, unified};
use super::markdown::{Table, cells};
use crate::error::Error;
use std::path::{Path, PathBuf};

const BEGIN: &str = "<!-- table:";
const END: &str = "-->";

/// A table with the command that prints it.
#[derive(Clone, Debug, PartialEq)]
pub struct Marked {
    /// Its name, unique in all pages.
    pub name: String,
    /// The page on which it stands.
    pub page: PathBuf,
    /// The command, for a shell.
    pub command: String,
    ignored: Vec<String>,
    /// Whether the page leaves out rows of what is printed.
    is_part: bool,
    table: Table,
}

/// A table held against what its command prints.
pub struct Compared {
    /// Rows in the columns that both have, removed and added ones marked.
    pub lines: Vec<Line>,
    /// Columns of the page that the command does not print.
    pub not_printed: Vec<String>,
}

impl Marked {
    /// Number of columns on the page.
    pub fn columns(&self) -> usize {
        self.table.columns.len()
    }

    /// Holds it against the table that fits best of those printed; `None` where none has two of its columns, or its only one.
    pub fn compare(&self, printed: &str) -> Option<Compared> {
        let all = Table::find_all(printed, &self.table.columns);
        let likeness = |table: &Table| {
            let columns = self.common(table).len();
            let rows = self.table.rows.iter().filter(|row| table.rows.iter().any(|other| row[0] == other[0]));
            (columns, rows.count())
        };
        let best = all.iter().max_by_key(|table| likeness(table))?;
        let common = self.common(best);
        if common.len() < self.columns().min(2) {
            return None;
        }
        let not_printed = self.kept().filter(|name| !best.columns.contains(name)).cloned().collect();
        let mut lines = unified(&self.table.text(&common), &best.text(&common));
        if self.is_part {
            let labels: Vec<&String> = self.table.rows.iter().map(|row| &row[0]).collect();
            lines.retain(|line| match line {
                Line::Added(text) => cells(text).is_some_and(|row| labels.contains(&&row[0])),
                _ => true,
            });
        }
        Some(Compared { lines, not_printed })
    }

    /// Columns that count.
    fn kept(&self) -> impl Iterator<Item = &String> {
        self.table.columns.iter().filter(|name| !self.ignored.contains(name))
    }

    fn common(&self, table: &Table) -> Vec<String> {
        self.kept().filter(|name| table.columns.contains(name)).cloned().collect()
    }
}

/// The marked tables of a page.
///
/// # Errors
/// A marker without a name, a command or a table after it.
pub fn tables(page: &Path, text: &str) -> Result<Vec<Marked>, Error> {
    let mut found = Vec::new();
    let lines: Vec<&str> = text.lines().collect();
    let mut in_code = false;
    for (number, line) in lines.iter().enumerate() {
        in_code ^= line.trim_start().starts_with("```");
        let Some(marker) = line.trim().strip_prefix(BEGIN).filter(|_| !in_code) else { continue };
        let fault = |what: &str| Error::content(page, format!("line {}: marker {what}", number + 1));
        let marker = marker.strip_suffix(END).ok_or_else(|| fault("does not end on its line"))?;
        let (head, command) = marker.split_once("; command:").ok_or_else(|| fault("without a command"))?;
        let (head, ignored) = head.split_once("; ignore:").unwrap_or((head, ""));
        let (name, is_part) = head.strip_suffix("; part").map_or((head, false), |name| (name, true));
        let (name, command) = (name.trim(), command.trim());
        if name.is_empty() || command.is_empty() {
            return Err(fault("without a name or a command"));
        }
        let rest: Vec<&str> =
            lines[number + 1..].iter().skip_while(|l| l.trim().is_empty()).copied().collect();
        let table = Table::first(&rest).ok_or_else(|| fault("without a table after it"))?;
        let ignored: Vec<String> =
            ignored.split(',').map(|name| name.trim().to_owned()).filter(|name| !name.is_empty()).collect();
        if let Some(unknown) = ignored.iter().find(|name| !table.columns.contains(name)) {
            return Err(fault(&format!("ignores a column that is not there: {unknown}")));
        }
        found.push(Marked {
            name: name.to_owned(),
            page: page.to_owned(),
            command: command.to_owned(),
            ignored,
            is_part,
            table,
        });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "# Page

<!-- table: decays; ignore: s; command: make decays | cat -->

| octave | T20 | s |
|---|---|---|
| 125 | **1.50** | 3 |
| 250 | 1.20 | 4 |
";

    fn marked() -> Marked {
        tables(Path::new("page.md"), PAGE).unwrap().remove(0)
    }

    fn compared(printed: &str) -> Vec<String> {
        marked().compare(printed).unwrap().lines.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_marker_gives_name_command_and_what_is_ignored() {
        let table = marked();
        assert_eq!((table.name.as_str(), table.command.as_str()), ("decays", "make decays | cat"));
        assert_eq!((table.columns(), table.table.rows.len()), (3, 2));
        assert_eq!(table.ignored, ["s"]);
    }

    #[test]
    fn the_same_figures_are_no_change_though_times_and_bold_letters_differ() {
        let lines = compared(
            "test x ... | octave | T20 | s |\n|---|---|---|\n| 125 | 1.50 | 9 |\n| 250 | 1.20 | 9 |\nok",
        );
        assert_eq!(lines, [" | octave | T20 |", " | 125 | 1.50 |", " | 250 | 1.20 |"]);
    }

    #[test]
    fn another_figure_and_a_row_too_many_are_shown() {
        let lines = compared("| octave | T20 |\n|---|---|\n| 125 | 1.51 |\n| 250 | 1.20 |\n| 500 | 1.00 |\n");
        assert_eq!(
            lines,
            [" | octave | T20 |", "-| 125 | 1.50 |", "+| 125 | 1.51 |", " | 250 | 1.20 |", "+| 500 | 1.00 |"]
        );
    }

    #[test]
    fn rows_that_a_part_leaves_out_are_no_change_and_others_are() {
        let page = PAGE.replace("table: decays", "table: decays; part");
        let marked = tables(Path::new("page.md"), &page).unwrap().remove(0);
        assert_eq!(marked.name, "decays");
        let changes = |printed: &str| {
            marked.compare(printed).unwrap().lines.iter().filter(|line| line.is_change()).count()
        };
        let head = "| octave | T20 |\n|---|---|\n";
        assert_eq!(changes(&format!("{head}| 63 | 2 |\n| 125 | 1.50 |\n| 250 | 1.20 |\n")), 0);
        assert_eq!(changes(&format!("{head}| 63 | 2 |\n| 125 | 1.60 |\n| 250 | 1.20 |\n")), 2);
    }

    #[test]
    fn of_several_tables_the_one_with_its_rows_is_taken_and_rows_without_a_head_count() {
        let other = "| octave | T20 |\n|---|---|\n| 1000 | 7 |\n\n| 125 | 1.50 | 2 |\n| 250 | 1.20 | 2 |\n";
        assert!(marked().compare(other).unwrap().lines.iter().all(|line| !line.is_change()));
        assert!(marked().compare("nothing of the kind").is_none());
        assert!(marked().compare("| name | value |\n|---|---|\n| a | b |\n").is_none());
    }

    #[test]
    fn a_column_that_is_not_printed_is_named() {
        let page = PAGE.replace("; ignore: s", "");
        let marked = tables(Path::new("page.md"), &page).unwrap().remove(0);
        let compared =
            marked.compare("| octave | T20 |\n|---|---|\n| 125 | 1.50 |\n| 250 | 1.20 |\n").unwrap();
        assert_eq!(compared.not_printed, ["s"]);
        assert!(compared.lines.iter().all(|line| !line.is_change()));
    }

    #[test]
    fn malformed_markers_are_refused_with_their_line() {
        let refused = |text: &str| tables(Path::new("page.md"), text).unwrap_err().to_string();
        assert_eq!(
            refused("\n<!-- table: a; command: b -->\ntext"),
            "page.md: line 2: marker without a table after it"
        );
        assert!(refused("<!-- table: a -->\n| x |\n|---|\n").contains("without a command"));
        assert!(refused("<!-- table: a; command: b\n").contains("does not end"));
        assert!(refused(&PAGE.replace("ignore: s", "ignore: t")).contains("not there: t"));
        // What stands in a block of code is an example.
        assert!(tables(Path::new("page.md"), "```\n<!-- table: a -->\n```\n").unwrap().is_empty());
    }
}
