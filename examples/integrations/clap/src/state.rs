//! What a host keeps of an instance in its project: a few lines of text.

use crate::parameters::Parameter;
use crate::room::{Failure, Place};
use std::fmt::Write;
use std::path::PathBuf;

/// First line: whose state this is, and of which form.
const HEAD: &str = "Sabine room 1";
/// No state of ours is longer, in bytes: systems take no longer paths.
pub const LONGEST: u64 = 1 << 16;

/// Gains in dB and the room.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub wet_db: f64,
    pub dry_db: f64,
    pub place: Place,
}

impl State {
    /// The lines.
    ///
    /// # Errors
    /// A path that is no Unicode: nobody could read it back on another system.
    pub fn write(&self) -> Result<String, Failure> {
        let mut text = format!("{HEAD}\nwet_db {}\ndry_db {}\n", self.wet_db, self.dry_db);
        match &self.place {
            Place::BuiltIn => {}
            Place::Nothing => text.push_str("room\n"),
            Place::At(path) => {
                let path = path
                    .to_str()
                    .ok_or_else(|| format!("the path of the room is no Unicode: {}", path.display()))?;
                // The last line, to the end: a path may hold line breaks.
                write!(text, "room {path}")?;
            }
        }
        Ok(text)
    }

    /// Reads what [`State::write`] wrote.
    ///
    /// # Errors
    /// Bytes that are no state of ours, a gain out of range.
    pub fn read(bytes: &[u8]) -> Result<Self, Failure> {
        let foreign = || format!("the state is not one of this plug-in: it does not begin with {HEAD:?}");
        let text = std::str::from_utf8(bytes).map_err(|_| foreign())?;
        let rest = text.strip_prefix(HEAD).and_then(|rest| rest.strip_prefix('\n')).ok_or_else(foreign)?;
        let (wet_db, rest) = gain(rest, "wet_db")?;
        let (dry_db, rest) = gain(rest, "dry_db")?;
        let place = match rest {
            "" => Place::BuiltIn,
            "room\n" => Place::Nothing,
            _ => {
                let path = rest.strip_prefix("room ").ok_or("the state has no line \"room\"")?;
                Place::At(PathBuf::from(path))
            }
        };
        Ok(Self { wet_db, dry_db, place })
    }
}

/// The number of the line `name NUMBER`, and the lines after it.
fn gain<'a>(text: &'a str, name: &str) -> Result<(f64, &'a str), Failure> {
    let missing = || format!("the state has no line {name:?} in its place");
    let line = text.strip_prefix(name).and_then(|rest| rest.strip_prefix(' ')).ok_or_else(missing)?;
    let (number, rest) = line.split_once('\n').ok_or_else(missing)?;
    let gain_db: f64 = number.parse().map_err(|_| format!("{name} is {number:?}, which is no number"))?;
    if !(Parameter::LEAST_DB..=Parameter::MOST_DB).contains(&gain_db) {
        return Err(format!(
            "{name} is {gain_db}; it must be between {} and {} dB",
            Parameter::LEAST_DB,
            Parameter::MOST_DB
        )
        .into());
    }
    Ok((gain_db, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_read_as_it_was_written() {
        let root = std::env::temp_dir();
        let places = [
            Place::BuiltIn,
            Place::Nothing,
            Place::At(root.join("a hall.wav")),
            Place::At(root.join("b\nroom c")),
        ];
        for place in places {
            let state = State { wet_db: -12.345_678_901, dry_db: -60.0, place };
            assert_eq!(State::read(state.write().unwrap().as_bytes()).unwrap(), state);
        }
    }

    #[test]
    fn what_is_no_state_is_refused_and_says_why() {
        for (bytes, why) in [
            (&b""[..], "not one of this plug-in"),
            (b"\xff\xfe\0\x01", "not one of this plug-in"),
            (b"Sabine room 2\nwet_db 0\ndry_db 0\n", "not one of this plug-in"),
            (b"Sabine room 1\n", "no line \"wet_db\""),
            (b"Sabine room 1\nwet_db 0", "no line \"wet_db\""),
            (b"Sabine room 1\nwet_db 0\n", "no line \"dry_db\""),
            (b"Sabine room 1\nwet_db loud\ndry_db 0\n", "wet_db is \"loud\""),
            (b"Sabine room 1\nwet_db 0\ndry_db NaN\n", "dry_db is NaN"),
            (b"Sabine room 1\nwet_db 99\ndry_db 0\n", "wet_db is 99"),
            (b"Sabine room 1\nwet_db 0\ndry_db 0\nhall /a.wav", "no line \"room\""),
        ] {
            let found = State::read(bytes).unwrap_err().to_string();
            assert!(found.contains(why), "{found}");
        }
    }
}
