//! Which line and which key of a TOML text a position belongs to.

/// The number of the line, counted from 1, and its key with the table above it: `sources[1].position_m`. The key is left out
/// where the line has none.
pub(crate) fn line_and_field(text: &str, at: usize) -> (usize, String) {
    // The position may lie within a character.
    let before = text.as_bytes()[..at.min(text.len())].iter().filter(|&&byte| byte == b'\n').count();
    let lines: Vec<&str> = text.lines().take(before + 1).collect();
    let header = lines.iter().rposition(|line| name_of(line).is_some());
    let mut field = String::new();
    if let Some((name, is_list)) = header.and_then(|index| name_of(lines[index])) {
        field.push_str(name);
        if is_list {
            let same = lines.iter().filter(|line| name_of(line) == Some((name, true))).count();
            field.push_str(&format!("[{}]", same.saturating_sub(1)));
        }
    }
    // A value may go on over several lines: its key is on the last line that has one.
    let own = &lines[header.map_or(0, |index| index + 1).min(lines.len())..];
    if let Some(key) = own.iter().rev().find_map(|line| key_of(line)) {
        field = if field.is_empty() { key.to_owned() } else { format!("{field}.{key}") };
    }
    (before + 1, field.chars().take(80).collect())
}

/// The name in `[name]` or `[[name]]`, and whether it is one of a list.
fn name_of(line: &str) -> Option<(&str, bool)> {
    let line = line.trim();
    let list = line.strip_prefix("[[").and_then(|rest| Some((rest.split_once("]]")?.0, true)));
    let (name, is_list) =
        list.or_else(|| line.strip_prefix('[').and_then(|rest| Some((rest.split_once(']')?.0, false))))?;
    // A list of numbers in a value of several lines is no header.
    let header = name.trim().starts_with(|c: char| c.is_alphabetic() || c == '_' || c == '"' || c == '\'');
    header.then(|| (name.trim(), is_list))
}

fn key_of(line: &str) -> Option<&str> {
    let (key, _) = line.split_once('=')?;
    let key = key.trim();
    let plain = |c: char| c.is_alphanumeric() || "_-.\"'".contains(c);
    (!key.is_empty() && key.chars().all(plain)).then_some(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a = 1\n[materials.\"old wall\"]\nabsorption = [\n  1,\n  2]\n\n[[sources]]\nid = 1\n[[sources]]\n# x\nposition_m = 3\n";

    #[test]
    fn positions_have_a_line_and_a_field() {
        for (part, line, field) in [
            ("a = 1", 1, "a"),
            ("[materials", 2, "materials.\"old wall\""),
            ("2]", 5, "materials.\"old wall\".absorption"),
            ("id = 1", 8, "sources[0].id"),
            ("[[sources]]\n#", 9, "sources[1]"),
            ("position_m", 11, "sources[1].position_m"),
        ] {
            let at = TEXT.find(part).unwrap();
            assert_eq!(line_and_field(TEXT, at), (line, field.to_owned()), "{part:?}");
        }
        assert_eq!(line_and_field("", 0), (1, String::new()));
        assert_eq!(line_and_field("é", 1).0, 1);
        assert_eq!(line_and_field(TEXT, 9999).0, 12);
    }
}
