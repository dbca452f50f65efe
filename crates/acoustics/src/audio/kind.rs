//! What a file is, by its first bytes.

use std::fmt;

/// Bytes that are looked at.
pub(super) const LOOK: usize = 512;

/// What is read, for messages.
#[cfg(feature = "symphonia")]
pub(crate) const READ_FORMATS: &str =
    "WAV (RF64 and BW64 too; PCM of up to 32 bits, floats of 32 or 64 bits), FLAC, Ogg Vorbis and AIFF";
/// What is read, for messages.
#[cfg(not(feature = "symphonia"))]
pub(crate) const READ_FORMATS: &str = "WAV (RF64 and BW64 too; PCM of up to 32 bits, floats of 32 or 64 bits), and FLAC, Ogg Vorbis and AIFF with the feature `symphonia`";

/// What the first bytes of a file say that it is. `Display` names it in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileKind {
    /// WAV, RF64 or BW64 with samples in this format: the tag of the `fmt ` chunk, that of the subformat where there is one.
    Wav {
        /// The tag: 1 for PCM, 3 for floats, 6 for A-law, ...
        tag: u16,
    },
    /// WAV with the most significant byte first.
    Rifx,
    /// FLAC.
    Flac,
    /// Ogg with anything but Opus in it, Vorbis as a rule.
    Ogg,
    /// Ogg Opus.
    Opus,
    /// AIFF or AIFF-C.
    Aiff,
    /// MPEG layer 3.
    Mp3,
    /// AAC as a bare stream.
    Aac,
    /// MPEG-4: M4A, MP4, AAC or ALAC within.
    Mpeg4,
    /// Matroska or WebM.
    Matroska,
    /// A sound format that is known by name only.
    OtherSound(&'static str),
    /// Something that is no sound: a picture, an archive.
    OtherFile(&'static str),
    /// Text.
    Text,
    /// Nothing that is known.
    Unknown,
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Wav { tag } => {
                return match tag {
                    1 => f.write_str("PCM WAV"),
                    3 => f.write_str("WAV of floats"),
                    6 => f.write_str("A-law WAV"),
                    7 => f.write_str("mu-law WAV"),
                    2 | 0x11 => f.write_str("ADPCM WAV"),
                    0x31 => f.write_str("GSM WAV"),
                    0x50 | 0x55 => f.write_str("MPEG in WAV"),
                    other => write!(f, "WAV of format {other:#06x}"),
                };
            }
            Self::Rifx => "big-endian WAV (RIFX)",
            Self::Flac => "FLAC",
            Self::Ogg => "Ogg",
            Self::Opus => "Ogg Opus",
            Self::Aiff => "AIFF",
            Self::Mp3 => "MP3",
            Self::Aac => "AAC",
            Self::Mpeg4 => "MPEG-4 (M4A, AAC)",
            Self::Matroska => "Matroska or WebM",
            Self::OtherSound(name) | Self::OtherFile(name) => name,
            Self::Text => "text",
            Self::Unknown => "of no known format",
        };
        f.write_str(name)
    }
}

/// Signatures at the beginning of a file.
const SIGNATURES: [(&[u8], FileKind); 21] = [
    (b"RIFX", FileKind::Rifx),
    (b"fLaC", FileKind::Flac),
    (b"OggS", FileKind::Ogg),
    (b"ID3", FileKind::Mp3),
    (b"\x1a\x45\xdf\xa3", FileKind::Matroska),
    (b"caff", FileKind::OtherSound("CAF")),
    (b"wvpk", FileKind::OtherSound("WavPack")),
    (b"MAC ", FileKind::OtherSound("Monkey's Audio")),
    (b"riff\x2e\x91", FileKind::OtherSound("Wave64")),
    (b".snd", FileKind::OtherSound("AU")),
    (b"#!AMR", FileKind::OtherSound("AMR")),
    (b"\x30\x26\xb2\x75", FileKind::OtherSound("WMA")),
    (b"\x89PNG", FileKind::OtherFile("PNG")),
    (b"\xff\xd8\xff", FileKind::OtherFile("JPEG")),
    (b"GIF8", FileKind::OtherFile("GIF")),
    (b"%PDF", FileKind::OtherFile("PDF")),
    (b"PK\x03\x04", FileKind::OtherFile("ZIP")),
    (b"\x1f\x8b", FileKind::OtherFile("gzip")),
    (b"\x89HDF", FileKind::OtherFile("HDF5 (SOFA or MATLAB)")),
    (b"MATLAB 5", FileKind::OtherFile("MATLAB")),
    (b"RIFF", FileKind::OtherFile("RIFF without sound")),
];

impl FileKind {
    /// Of the first bytes of a file, up to [`LOOK`]; the tag of a WAV is that of PCM until its header is read.
    pub(super) fn of(start: &[u8]) -> Self {
        let word = |at: usize| start.get(at..at + 4).unwrap_or(b"");
        match (word(0), word(8), word(4)) {
            (b"RIFF" | b"RF64" | b"BW64", b"WAVE", _) => return Self::Wav { tag: 1 },
            (b"RIFF", b"AVI ", _) => return Self::OtherFile("AVI"),
            (b"FORM", b"AIFF" | b"AIFC", _) => return Self::Aiff,
            (_, _, b"ftyp") => return Self::Mpeg4,
            _ => {}
        }
        if start.starts_with(b"OggS") && start.windows(8).any(|bytes| bytes == b"OpusHead") {
            return Self::Opus;
        }
        if let Some((_, kind)) = SIGNATURES.iter().find(|(signature, _)| start.starts_with(signature)) {
            return *kind;
        }
        match start {
            // Frame headers without a tag in front: twelve set bits, then the layer.
            [0xff, 0xf1 | 0xf9, ..] => Self::Aac,
            [0xff, second, ..] if second & 0xe6 == 0xe2 => Self::Mp3,
            _ if is_text(start) => Self::Text,
            _ => Self::Unknown,
        }
    }
}

/// UTF-8 without control characters other than white space; a character cut at the end does not matter.
fn is_text(start: &[u8]) -> bool {
    let whole = match std::str::from_utf8(start) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(&start[..error.valid_up_to()]).unwrap_or("")
        }
        Err(_) => return false,
    };
    !whole.is_empty() && whole.chars().all(|c| !c.is_control() || c.is_ascii_whitespace())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_known_by_their_first_bytes() {
        for (start, name) in [
            (&b"RF64\xff\xff\xff\xffWAVE"[..], "PCM WAV"),
            (b"ID3\x04\0\0", "MP3"),
            (b"\xff\xfb\x90\x64\0\0", "MP3"),
            (b"\xff\xf1\x50\x80", "AAC"),
            (b"\0\0\0\x20ftypM4A ", "MPEG-4 (M4A, AAC)"),
            (b"\x89PNG\r\n\x1a\n", "PNG"),
            (b"RIFF\0\0\0\0AVI ", "AVI"),
            (b"this is no sound\n", "text"),
            ("Räume".as_bytes(), "text"),
            (b"\0\x01\x02\x03", "of no known format"),
            (b"", "of no known format"),
        ] {
            assert_eq!(FileKind::of(start).to_string(), name);
        }
        assert_eq!(FileKind::Wav { tag: 6 }.to_string(), "A-law WAV");
        assert_eq!(FileKind::Wav { tag: 0x1234 }.to_string(), "WAV of format 0x1234");
    }
}
