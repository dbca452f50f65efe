//! What differs between two lists of lines.

use std::fmt;

/// A line of the comparison.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    /// In both.
    Same(String),
    /// In the first alone.
    Removed(String),
    /// In the second alone.
    Added(String),
}

impl Line {
    /// Whether it stands in one of the two alone.
    pub fn is_change(&self) -> bool {
        !matches!(self, Self::Same(_))
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Same(text) => write!(f, " {text}"),
            Self::Removed(text) => write!(f, "-{text}"),
            Self::Added(text) => write!(f, "+{text}"),
        }
    }
}

/// Whether two lines say the same: word by word, figures as far as both are given (12.8 and 12.80 are the same, 12.8 and 12.84 too).
pub fn same_figures(a: &str, b: &str) -> bool {
    let (a, b): (Vec<&str>, Vec<&str>) = (words(a), words(b));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a == b || same_number(a, b))
}

fn words(line: &str) -> Vec<&str> {
    line.split(|c: char| c.is_whitespace() || "()[],/".contains(c)).filter(|word| !word.is_empty()).collect()
}

fn same_number(a: &str, b: &str) -> bool {
    let (Ok(x), Ok(y)) = (a.parse::<f64>(), b.parse::<f64>()) else { return false };
    let decimals = |text: &str| text.split_once('.').map_or(0, |(_, digits)| digits.len());
    let common = decimals(a).min(decimals(b));
    // A figure that was cut to fewer digits may lie half a unit of its last one off.
    (x - y).abs() <= 0.5 * 10f64.powi(-(common as i32)) * (1.0 + 1e-9) && decimals(a) != decimals(b)
}

/// The lines of both, by their longest common subsequence; what is the same is shown as the first has it.
pub fn unified(before: &[String], after: &[String]) -> Vec<Line> {
    let same = |i: usize, j: usize| same_figures(&before[i], &after[j]);
    // common[i][j]: length of the longest common subsequence of before[i..] and after[j..].
    let mut common = vec![vec![0usize; after.len() + 1]; before.len() + 1];
    for i in (0..before.len()).rev() {
        for j in (0..after.len()).rev() {
            common[i][j] =
                if same(i, j) { common[i + 1][j + 1] + 1 } else { common[i + 1][j].max(common[i][j + 1]) };
        }
    }
    let (mut i, mut j) = (0, 0);
    let mut lines = Vec::new();
    while i < before.len() || j < after.len() {
        if i < before.len() && j < after.len() && same(i, j) {
            lines.push(Line::Same(before[i].clone()));
            (i, j) = (i + 1, j + 1);
        } else if i < before.len() && (j == after.len() || common[i + 1][j] >= common[i][j + 1]) {
            lines.push(Line::Removed(before[i].clone()));
            i += 1;
        } else {
            lines.push(Line::Added(after[j].clone()));
            j += 1;
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(before: &str, after: &str) -> String {
        let lines = |text: &str| text.chars().map(String::from).collect::<Vec<_>>();
        unified(&lines(before), &lines(after)).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn figures_with_fewer_digits_are_the_same_and_others_are_not() {
        for (a, b) in [("| 12.8 |", "| 12.80 |"), ("| 12.8 |", "| 12.84 |"), ("28 (90 %)", "28 ( 90 % )")] {
            assert!(same_figures(a, b) && same_figures(b, a), "{a} {b}");
        }
        for (a, b) in
            [("12.8", "12.86"), ("12.8", "12.9"), ("-0.1", "0.1"), ("3 of 5", "4 of 5"), ("a 1", "1")]
        {
            assert!(!same_figures(a, b) && !same_figures(b, a), "{a} {b}");
        }
    }

    #[test]
    fn as_many_lines_as_possible_are_kept() {
        assert_eq!(shown("abcd", "abcd"), " a b c d");
        assert_eq!(shown("abcd", "axcd"), " a-b+x c d");
        assert_eq!(shown("", "ab"), "+a+b");
        assert_eq!(shown("ab", ""), "-a-b");
        assert_eq!(shown("bcd", "abce"), "+a b c-d+e");
    }
}
