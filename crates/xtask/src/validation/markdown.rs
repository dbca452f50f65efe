//! Tables in Markdown.

/// A table: names of columns, and rows of as many cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Names; the second of a name is `name (2)`.
    pub columns: Vec<String>,
    /// Cells, without the signs of bold letters.
    pub rows: Vec<Vec<String>>,
}

/// The cells of a line `| a | b |`; what stands before the first bar (a test's name) is left out.
pub fn cells(line: &str) -> Option<Vec<String>> {
    let line = line.trim();
    let inner = line[line.find('|')?..].strip_prefix('|')?.strip_suffix('|')?;
    Some(inner.split('|').map(|cell| cell.replace("**", "").trim().to_owned()).collect())
}

fn is_rule(cells: &[String]) -> bool {
    cells.iter().all(|cell| !cell.is_empty() && cell.chars().all(|c| matches!(c, '-' | ':')))
}

/// Names that are told apart by their number.
fn numbered(names: Vec<String>) -> Vec<String> {
    let mut columns: Vec<String> = Vec::new();
    for (i, name) in names.iter().enumerate() {
        let before = names[..i].iter().filter(|other| *other == name).count();
        columns.push(if before == 0 { name.clone() } else { format!("{name} ({})", before + 1) });
    }
    columns
}

impl Table {
    /// The table with which these lines begin.
    pub fn first(lines: &[&str]) -> Option<Self> {
        let columns = cells(lines.first()?)?;
        let rule = cells(lines.get(1)?)?;
        if !is_rule(&rule) {
            return None;
        }
        let width = columns.len();
        let rows = lines[2..].iter().map_while(|line| cells(line).filter(|row| row.len() == width)).collect();
        Some(Self { columns: numbered(columns), rows })
    }

    /// All tables in a text. Rows without a head, as many cells wide as these columns, are taken for rows of these columns.
    pub fn find_all(text: &str, columns: &[String]) -> Vec<Self> {
        let lines: Vec<&str> = text.lines().collect();
        let mut found = Vec::new();
        let mut at = 0;
        while at < lines.len() {
            if let Some(table) = Self::first(&lines[at..]) {
                at += 2 + table.rows.len();
                found.push(table);
                continue;
            }
            let rows: Vec<Vec<String>> = lines[at..]
                .iter()
                .map_while(|line| cells(line).filter(|row| row.len() == columns.len() && !is_rule(row)))
                .collect();
            at += rows.len().max(1);
            if !rows.is_empty() {
                found.push(Self { columns: columns.to_vec(), rows });
            }
        }
        found
    }

    /// Its lines in these columns, the head among them.
    pub fn text(&self, columns: &[String]) -> Vec<String> {
        let places: Vec<usize> =
            columns.iter().filter_map(|name| self.columns.iter().position(|own| own == name)).collect();
        let line = |row: &Vec<String>| {
            let cells: Vec<&str> = places.iter().map(|&i| row[i].as_str()).collect();
            format!("| {} |", cells.join(" | "))
        };
        std::iter::once(&self.columns).chain(&self.rows).map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_one_name_are_told_apart() {
        let table =
            Table::first(&["| T20 | off | T60 | off |", "|---|---|---|---|", "| 1 | 2 | 3 | 4 |"]).unwrap();
        assert_eq!(table.columns, ["T20", "off", "T60", "off (2)"]);
        assert_eq!(table.text(&["off (2)".into()]), ["| off (2) |", "| 4 |"]);
    }

    #[test]
    fn a_row_of_another_width_ends_a_table() {
        let table = Table::first(&["| a | b |", "|---|:--|", "| 1 | 2 |", "| 1 | 2 | 3 |"]).unwrap();
        assert_eq!(table.rows, [["1", "2"]]);
        assert!(Table::first(&["| a | b |", "no rule"]).is_none());
        assert!(Table::first(&[]).is_none());
    }

    #[test]
    fn tables_are_found_among_other_lines() {
        let text = "running 1 test\n| a | b |\n|---|---|\n| 1 | 2 |\nok\n| 3 | 4 |\n| 5 | 6 |\n| 7 |\n";
        let found = Table::find_all(text, &["x".into(), "y".into()]);
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].rows, [["1", "2"]]);
        assert_eq!(
            (found[1].columns.as_slice(), found[1].rows.len()),
            (&["x".to_owned(), "y".to_owned()][..], 2)
        );
    }
}
