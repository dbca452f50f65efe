//! Files of laws.

use crate::error::Error;
use sabine_acoustics::{Error as Cause, OutOfRange};
use sabine_paths::laws::Law;
use serde::Deserialize;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Longest file of laws, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// A file of laws: `[[laws]]` and nothing else.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LawFile {
    laws: Vec<Law>,
}

/// Reads the laws of a TOML file, or of all files `*.toml` of a folder by name, in their order. Names of surfaces are checked when they are
/// bound to a room.
///
/// ```no_run
/// let laws = sabine_diagnose::read_laws("laws.toml")?;
/// println!("{} says {}", laws[0].id(), laws[0].printed());
/// # Ok::<(), sabine_diagnose::Error>(())
/// ```
///
/// # Errors
/// [`Error::Model`] naming file, law and column for what is no such file; [`Error::Acoustics`] if it cannot be read, is longer than 1 MiB, if a
/// folder holds no such file, or if two laws have one identifier.
pub fn read_laws(path: impl AsRef<Path>) -> Result<Vec<Law>, Error> {
    let path = path.as_ref();
    let laws = if path.is_dir() {
        files_of(path)?.iter().map(|file| read_file(file)).collect::<Result<Vec<_>, _>>()?.concat()
    } else {
        read_file(path)?
    };
    check_together(laws, path)
}

/// The laws of the text of such a file, which has this path.
///
/// ```
/// let text = r#"
///     [[laws]]
///     id = "haze"
///     target = "path"
///     formula = "-a * length_m"
///     parameters = { a = { value = 0.1, low = 0, high = 1, unit = "dB/m" } }
/// "#;
/// assert_eq!(sabine_diagnose::laws_of_toml(text, "haze.toml".as_ref())?[0].printed(), "-a * length_m");
/// # Ok::<(), sabine_diagnose::Error>(())
/// ```
///
/// # Errors
/// As [`read_laws`], but for those of reading.
pub fn laws_of_toml(text: &str, path: &Path) -> Result<Vec<Law>, Error> {
    check_together(parse(path, text)?, path)
}

/// Laws of one identifier are an error of their file or folder.
fn check_together(laws: Vec<Law>, path: &Path) -> Result<Vec<Law>, Error> {
    Law::check_together(&laws).map_err(|error| Cause::from(error).in_file(path, "laws"))?;
    Ok(laws)
}

/// The files of a folder that may hold laws, by name.
fn files_of(folder: &Path) -> Result<Vec<PathBuf>, Cause> {
    let io = |source| Cause::Io { path: folder.to_owned(), source };
    let entries = std::fs::read_dir(folder).map_err(io)?;
    let mut files: Vec<PathBuf> =
        entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>().map_err(io)?;
    files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    if files.is_empty() {
        return Err(io(std::io::Error::new(ErrorKind::NotFound, "no file *.toml in this folder")));
    }
    Ok(files)
}

fn read_file(path: &Path) -> Result<Vec<Law>, Error> {
    let io = |source| Cause::Io { path: path.to_owned(), source };
    let bytes = std::fs::metadata(path).map_err(io)?.len();
    if bytes > MAX_BYTES {
        let error = OutOfRange { field: "length (bytes)", value: bytes as f64, range: "at most 1 MiB" };
        return Err(Cause::from(error).in_file(path, "laws").into());
    }
    parse(path, &std::fs::read_to_string(path).map_err(io)?)
}

fn parse(path: &Path, text: &str) -> Result<Vec<Law>, Error> {
    let file: LawFile = toml::from_str(text)
        .map_err(|source| Error::Model { path: path.to_owned(), source: Box::new(source) })?;
    Ok(file.laws)
}

/// The files that come with this crate.
const SHIPPED: [(&str, &str); 10] = [
    ("air_absorption.toml", include_str!("../../laws/air_absorption.toml")),
    ("background_noise.toml", include_str!("../../laws/background_noise.toml")),
    ("coupled_volume.toml", include_str!("../../laws/coupled_volume.toml")),
    ("gain_drift.toml", include_str!("../../laws/gain_drift.toml")),
    ("loudspeaker_response.toml", include_str!("../../laws/loudspeaker_response.toml")),
    ("receiver_directivity.toml", include_str!("../../laws/receiver_directivity.toml")),
    ("sampling_clock.toml", include_str!("../../laws/sampling_clock.toml")),
    ("sound_speed.toml", include_str!("../../laws/sound_speed.toml")),
    ("source_directivity.toml", include_str!("../../laws/source_directivity.toml")),
    ("time_zero.toml", include_str!("../../laws/time_zero.toml")),
];

/// The file of a law that needs the name of a material.
const BY_ANGLE: (&str, &str) =
    ("absorption_by_angle.toml", include_str!("../../laws/absorption_by_angle.toml"));

/// The file of a law that needs the name of a receiver.
const OF_CHANNEL: (&str, &str) = ("channel_response.toml", include_str!("../../laws/channel_response.toml"));

/// The law `absorption_by_angle` that comes with this crate, of a material: how much more it takes of sound that grazes it, by octave and angle.
/// It is none of [`shipped_laws`], which fit every room.
///
/// ```
/// let law = sabine_diagnose::absorption_by_angle("floor_by_angle", "floor")?;
/// assert_eq!((law.id(), law.surface()), ("floor_by_angle", Some("floor")));
/// # Ok::<(), sabine_diagnose::Error>(())
/// ```
///
/// # Errors
/// [`Error::Acoustics`] naming the law for an identifier that is none (1 to 64 letters, digits and `_-.`).
pub fn absorption_by_angle(id: &str, material: &str) -> Result<Law, Error> {
    Ok(only_law(BY_ANGLE)?.on_surface(id, material).map_err(Cause::from)?)
}

/// The law `channel_response` that comes with this crate, of a receiver: how its microphone rises or falls over the octaves as others do not. It
/// is none of [`shipped_laws`], which fit every room.
///
/// ```
/// let law = sabine_diagnose::channel_response("left_ear", "left ear")?;
/// assert!(law.printed().starts_with("receiver(left ear) * "));
/// # Ok::<(), sabine_diagnose::Error>(())
/// ```
///
/// # Errors
/// [`Error::Acoustics`] naming the law for an identifier that is none (1 to 64 letters, digits and `_-.`) and for a name that a formula cannot
/// hold (empty, or with brackets).
pub fn channel_response(id: &str, receiver: &str) -> Result<Law, Error> {
    Ok(only_law(OF_CHANNEL)?.of_receiver(id, receiver).map_err(Cause::from)?)
}

/// The law of a file that has one.
fn only_law((name, text): (&str, &str)) -> Result<Law, Error> {
    Ok(parse(Path::new(name), text)?.swap_remove(0))
}

/// The laws that come with this crate, in `laws/*.toml`: what effects of the catalogue do, as formulas to start from. None is weighed unless it
/// is asked for; each file says how it differs from the effect whose name it has.
///
/// ```
/// let laws = sabine_diagnose::shipped_laws()?;
/// let air = laws.iter().find(|law| law.id() == "air_attenuation").unwrap();
/// assert_eq!(air.printed(), "-a * length_m * (frequency_hz / f)^n");
/// # Ok::<(), sabine_diagnose::Error>(())
/// ```
///
/// # Errors
/// [`Error::Model`] naming the file: none of them gives one.
pub fn shipped_laws() -> Result<Vec<Law>, Error> {
    let all = SHIPPED.iter().map(|(name, text)| parse(Path::new(name), text));
    Ok(all.collect::<Result<Vec<_>, _>>()?.concat())
}
