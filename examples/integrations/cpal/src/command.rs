//! What is typed while it plays.

use std::path::PathBuf;
use std::str::FromStr;

/// A line of the keyboard.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// `wet G`: gain of the reverberation, as a factor of amplitude.
    Wet(f32),
    /// `dry G`: gain of the sound as it came in.
    Dry(f32),
    /// `end`.
    End,
    /// The path of another room.
    Room(PathBuf),
}

impl FromStr for Command {
    type Err = String;

    fn from_str(line: &str) -> Result<Self, String> {
        let line = line.trim();
        let gain = |text: &str| match text.trim().parse::<f32>() {
            Ok(gain) if gain.is_finite() => Ok(gain),
            _ => Err(format!("`{}` is no gain: give a factor of amplitude, such as 0.5", text.trim())),
        };
        match (line.strip_prefix("wet "), line.strip_prefix("dry "), line) {
            (Some(text), ..) => gain(text).map(Self::Wet),
            (_, Some(text), _) => gain(text).map(Self::Dry),
            (.., "") => Err("type `wet 0.5`, `dry 0.5`, the path of another room, or `end`".into()),
            (.., "end") => Ok(Self::End),
            (.., path) => Ok(Self::Room(path.into())),
        }
    }
}
