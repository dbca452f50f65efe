//! Lines of a table as an editor counts them.

use crate::error::Error;
use std::path::Path;

/// Numbers of the lines on which the records of a table begin. The parser's own are too small after empty lines, and where lines end as
/// they do under Windows: to it, a record begins where the one before it ends.
pub(crate) struct LineNumbers<'t> {
    text: &'t [u8],
    /// Bytes before this one are counted.
    until: usize,
    line: u64,
}

impl<'t> LineNumbers<'t> {
    /// Of the text that is parsed.
    pub fn of(text: &'t str) -> Self {
        Self { text: text.as_bytes(), until: 0, line: 1 }
    }

    /// The line of the record at a place, which lies behind all that were asked for before.
    pub fn at(&mut self, position: Option<&csv::Position>) -> u64 {
        let begin =
            position.map_or(0, |p| usize::try_from(p.byte()).unwrap_or(usize::MAX)).min(self.text.len());
        let blank = self.text[begin..].iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count();
        while self.until < begin + blank {
            let ends_line = match self.text[self.until] {
                b'\n' => true,
                b'\r' => self.text.get(self.until + 1) != Some(&b'\n'),
                _ => false,
            };
            self.line += u64::from(ends_line);
            self.until += 1;
        }
        self.line
    }

    /// What is wrong with a record: too few or too many cells.
    pub fn broken(&mut self, path: &Path, error: &csv::Error) -> Error {
        let line = self.at(error.position());
        let (expected, found) = match error.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => (*expected_len, *len),
            _ => (0, 0),
        };
        let error = Error::Shape { expected: format!("{expected} cells"), found: format!("{found} cells") };
        error.in_file(path, format!("line {line}"))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn lines_are_those_of_an_editor_whatever_ends_them() {
        for (text, expected) in [
            ("a,b\n1,2\n3,4\n", [2, 3]),
            ("a,b\r\n1,2\r\n3,4\r\n", [2, 3]),
            ("a,b\r1,2\r3,4", [2, 3]),
            ("a,b\n\n\n1,2\n\n3,4\n", [4, 6]),
            ("a,b\r\n\r\n1,2\r\n\r\n\r\n3,4", [3, 6]),
            // A cell of two lines.
            ("a,b\n\"1\n1\",2\n3,4\n", [2, 4]),
        ] {
            let mut lines = LineNumbers::of(text);
            let mut reader = csv::Reader::from_reader(text.as_bytes());
            let found: Vec<u64> = reader.records().map(|r| lines.at(r.unwrap().position())).collect();
            assert_eq!(found, expected, "{text:?}");
        }
        let text = "a,b\r\n1,2\r\n\r\n3\r\n";
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let error = reader.records().find_map(Result::err).unwrap();
        let said = LineNumbers::of(text).broken(Path::new("table.csv"), &error).to_string();
        assert!(said.contains("line 4"), "{said}");
    }
}
