//! Names of files for responses.

use std::collections::BTreeSet;

/// File names that no other response has.
#[derive(Default)]
pub(super) struct Names(BTreeSet<String>);

impl Names {
    /// The text without what a file name cannot hold, and with a number where it is taken.
    pub(super) fn unique(&mut self, text: &str) -> String {
        let plain = |c: char| if c.is_alphanumeric() || c == '-' || c == '_' { c } else { '_' };
        let stem: String = text.chars().take(80).map(plain).collect();
        // Some file systems do not tell A from a.
        let mut name = stem.clone();
        let mut number = 2;
        while !self.0.insert(name.to_lowercase()) {
            name = format!("{stem}_{number}");
            number += 1;
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_are_plain_and_differ() {
        let mut names = Names::default();
        assert_eq!(
            ["s1_r1", "S1_r1", "../s1 r1", "s1_r1"].map(|t| names.unique(t)),
            ["s1_r1", "S1_r1_2", "___s1_r1", "s1_r1_3"]
        );
    }
}
