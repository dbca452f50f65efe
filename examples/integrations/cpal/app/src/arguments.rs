//! The command line.

use std::error::Error;
use std::path::PathBuf;
use std::str::FromStr;

/// How to call it.
pub const USAGE: &str = "\
usage: sabine-cpal [OPTIONS] [ROOM.wav [VOICE.wav]]

ROOM.wav has 1, 2 or 4 channels, such as out/trace/ambisonics.wav of `sabine trace`. VOICE.wav is repeated until the end.
Without files a voice in a measured room is heard.

  --microphone     the microphone in place of VOICE.wav (headphones!)
  --device NAME    an output as --list names it
  --rate HZ        sample rate; that of the device unless given
  --wet G, --dry G gains as factors of amplitude; 0.5 and 1, with --microphone 0.5 and 0
  --delay S        time from microphone to loudspeaker, 0.05 unless given
  --seconds S      end after so long
  --list           list the outputs

While it plays, type `wet 0.5`, `dry 0.5`, the path of another room, or `end`.";

/// What was asked for.
#[derive(Debug, Default, PartialEq)]
pub struct Arguments {
    pub room: Option<PathBuf>,
    pub voice: Option<PathBuf>,
    pub microphone: bool,
    pub device: Option<String>,
    pub rate_hz: Option<u32>,
    pub wet: Option<f32>,
    pub dry: Option<f32>,
    pub delay_s: Option<f64>,
    pub seconds: Option<f64>,
    pub list: bool,
    pub help: bool,
}

/// Reads the command line.
pub fn parse(words: impl IntoIterator<Item = String>) -> Result<Arguments, Box<dyn Error>> {
    let mut arguments = Arguments::default();
    let mut words = words.into_iter();
    while let Some(word) = words.next() {
        let mut next = || words.next().ok_or_else(|| format!("{word} needs a value"));
        match word.as_str() {
            "--microphone" => arguments.microphone = true,
            "--list" => arguments.list = true,
            "--help" | "-h" => arguments.help = true,
            "--device" => arguments.device = Some(next()?),
            "--rate" => arguments.rate_hz = Some(number(&word, &next()?)?),
            "--wet" => arguments.wet = Some(number(&word, &next()?)?),
            "--dry" => arguments.dry = Some(number(&word, &next()?)?),
            "--delay" => arguments.delay_s = Some(number(&word, &next()?)?),
            "--seconds" => arguments.seconds = Some(number(&word, &next()?)?),
            option if option.starts_with('-') => {
                return Err(format!("unknown option {option}\n{USAGE}").into());
            }
            file if arguments.room.is_none() => arguments.room = Some(file.into()),
            file if arguments.voice.is_none() => arguments.voice = Some(file.into()),
            file => return Err(format!("{file}: there are a room and a voice already").into()),
        }
    }
    if arguments.microphone && arguments.voice.is_some() {
        return Err("a voice and --microphone: give one of them".into());
    }
    Ok(arguments)
}

fn number<T: FromStr>(option: &str, word: &str) -> Result<T, String> {
    word.parse().map_err(|_| format!("{option}: `{word}` is no number that fits"))
}

#[cfg(test)]
mod tests {
    use super::{Arguments, parse};

    fn words(line: &str) -> Vec<String> {
        line.split_whitespace().map(str::to_owned).collect()
    }

    #[test]
    fn the_command_line_is_read_or_refused() {
        let expected = Arguments {
            room: Some("hall.wav".into()),
            microphone: true,
            rate_hz: Some(44_100),
            wet: Some(0.25),
            seconds: Some(2.5),
            ..Arguments::default()
        };
        let line = "hall.wav --microphone --rate 44100 --wet 0.25 --seconds 2.5";
        assert_eq!(parse(words(line)).unwrap(), expected);
        assert_eq!(parse(words("")).unwrap(), Arguments::default());
        for line in ["--rate", "--rate -1", "--wet loud", "--loud", "a b c", "a b --microphone"] {
            assert!(parse(words(line)).is_err(), "{line}");
        }
    }
}
