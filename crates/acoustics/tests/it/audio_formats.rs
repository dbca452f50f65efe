//! The WAV files that people have: odd chunks, streams, RF64, doubles; and what is no WAV at all. The bytes are put together here.

use sabine_acoustics::{AudioReader, Channel, Error, SampleFormat, WavWriter, probe_audio, read_audio};
use std::path::PathBuf;
use tempfile::TempDir;

const TONE: [f64; 6] = [0.0, 0.5, -0.5, 0.25, -1.0, -0.125];

fn chunk(id: &[u8; 4], body: &[u8]) -> Vec<u8> {
    let padding = vec![0; body.len() % 2];
    [&id[..], &(body.len() as u32).to_le_bytes(), body, &padding].concat()
}

fn fmt(tag: u16, channels: u16, bits: u16, extension: &[u8]) -> Vec<u8> {
    let frame = channels * bits.div_ceil(8);
    let rate = 48_000_u32;
    let mut body = [tag.to_le_bytes(), channels.to_le_bytes()].concat();
    body.extend(rate.to_le_bytes());
    body.extend((rate * u32::from(frame)).to_le_bytes());
    body.extend([frame.to_le_bytes(), bits.to_le_bytes()].concat());
    body.extend(extension);
    chunk(b"fmt ", &body)
}

fn riff(id: &[u8; 4], chunks: &[&[u8]]) -> Vec<u8> {
    let body = [&b"WAVE"[..], &chunks.concat()].concat();
    [&id[..], &(body.len() as u32).to_le_bytes(), &body].concat()
}

/// A `data` chunk whose header says something else.
fn data(size: u32, samples: &[u8]) -> Vec<u8> {
    [b"data", &size.to_le_bytes()[..], samples].concat()
}

fn int16() -> Vec<u8> {
    TONE.iter().flat_map(|s| ((s * 32_768.0) as i16).to_le_bytes()).collect()
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn put(&self, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join("sound.wav");
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn is_the_tone(&self, what: &str, bytes: &[u8], step: f64) {
        let path = self.put(bytes);
        let read = read_audio(&path, Channel::Mono).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!((read.samples().len(), read.sample_rate_hz()), (TONE.len(), 48_000), "{what}");
        for (found, wanted) in read.samples().iter().zip(TONE) {
            assert!((f64::from(*found) - wanted).abs() <= step, "{what}: {found} != {wanted}");
        }
        assert_eq!(probe_audio(&path).unwrap().frames, TONE.len() as u64, "{what}");
    }

    fn says(&self, what: &str, bytes: &[u8], words: &str) {
        let path = self.put(bytes);
        let error = read_audio(&path, Channel::Mono).expect_err(what).to_string();
        assert!(error.starts_with(&path.display().to_string()), "{what}: {error}");
        assert!(error.contains(words), "{what}: {error}");
    }
}

#[test]
fn chunks_of_odd_length_are_stepped_over() {
    let folder = Folder::new();
    let (format, samples) = (fmt(1, 1, 16, b""), chunk(b"data", &int16()));
    for (id, length) in [(b"bext", 603), (b"LIST", 3), (b"LIST", 4), (b"iXML", 1)] {
        let extra = chunk(id, &vec![b'x'; length]);
        folder.is_the_tone("before", &riff(b"RIFF", &[&format, &extra, &samples]), 0.0);
        folder.is_the_tone("first", &riff(b"RIFF", &[&extra, &format, &samples]), 0.0);
        folder.is_the_tone("after", &riff(b"RIFF", &[&format, &samples, &extra]), 0.0);
    }
    // Some programs forget the byte of padding.
    let unpadded = &chunk(b"LIST", b"abc")[..11];
    folder.is_the_tone("unpadded", &riff(b"RIFF", &[&format, unpadded, &samples]), 0.0);
}

#[test]
fn streams_without_a_length_are_read_to_their_end() {
    let folder = Folder::new();
    let format = fmt(1, 1, 16, b"");
    for size in [0xffff_ffff, 0x7fff_f000] {
        let mut stream = riff(b"RIFF", &[&format, &data(size, &int16())]);
        stream[4..8].copy_from_slice(&size.to_le_bytes());
        folder.is_the_tone("stream", &stream, 0.0);
        // Cut within a frame, as a stream may be.
        stream.push(1);
        folder.is_the_tone("cut stream", &stream, 0.0);
    }
    folder.says("too long", &riff(b"RIFF", &[&format, &data(1000, &int16())]), "truncated");
}

#[test]
fn rf64_and_bw64_are_read() {
    let folder = Folder::new();
    let samples = int16();
    let mut sizes = 1000_u64.to_le_bytes().to_vec();
    sizes.extend((samples.len() as u64).to_le_bytes());
    sizes.extend([0; 12]);
    let (ds64, format) = (chunk(b"ds64", &sizes), fmt(1, 1, 16, b""));
    // What follows the samples is not sound: their number comes from `ds64`.
    let after = chunk(b"axml", b"<ebu/>");
    for id in [b"RF64", b"BW64"] {
        let bytes = riff(id, &[&ds64, &format, &data(0xffff_ffff, &samples), &after]);
        folder.is_the_tone("ds64", &bytes, 0.0);
        let stream = riff(id, &[&format, &data(0xffff_ffff, &samples)]);
        folder.is_the_tone("without ds64", &stream, 0.0);
        let plain = riff(id, &[&format, &chunk(b"data", &samples), &after]);
        folder.is_the_tone("sizes in place", &plain, 0.0);
    }
    sizes[8..16].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    let greedy = riff(b"RF64", &[&chunk(b"ds64", &sizes), &format, &data(0xffff_ffff, &samples)]);
    folder.says("greedy", &greedy, "truncated: the header promises 1099511627776 bytes");
}

#[test]
fn every_number_format_is_read() {
    let folder = Folder::new();
    let doubles: Vec<u8> = TONE.iter().flat_map(|s| s.to_le_bytes()).collect();
    let floats: Vec<u8> = TONE.iter().flat_map(|s| (*s as f32).to_le_bytes()).collect();
    let file = |format: &[u8], samples: &[u8]| riff(b"RIFF", &[format, &chunk(b"data", samples)]);
    folder.is_the_tone("doubles", &file(&fmt(3, 1, 64, b""), &doubles), 0.0);
    folder.is_the_tone("floats", &file(&fmt(3, 1, 32, b""), &floats), 0.0);
    // Twelve bits stand at the upper end of two bytes.
    folder.is_the_tone("12 bits", &file(&fmt(1, 1, 12, b""), &int16()), 0.0);
    let eight: Vec<u8> = TONE.iter().map(|s| (s * 128.0 + 128.0) as u8).collect();
    folder.is_the_tone("8 bits", &file(&fmt(1, 1, 8, b""), &eight), 0.0);
    let guid =
        |tag: u8| [&[tag, 0][..], b"\x00\x00\x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71"].concat();
    // 20 valid bits in three bytes.
    let wide: Vec<u8> =
        TONE.iter().flat_map(|s| ((s * 8_388_608.0) as i32).to_le_bytes()[..3].to_vec()).collect();
    let extension = [&b"\x16\x00\x14\x00\x04\x00\x00\x00"[..], &guid(1)].concat();
    folder.is_the_tone("extensible", &file(&fmt(0xfffe, 1, 24, &extension), &wide), 0.0);
    let extension = [&b"\x16\x00\x40\x00\x04\x00\x00\x00"[..], &guid(3)].concat();
    folder.is_the_tone("extensible doubles", &file(&fmt(0xfffe, 1, 64, &extension), &doubles), 0.0);
}

#[test]
fn what_is_not_read_is_named() {
    let folder = Folder::new();
    let file = |format: &[u8]| riff(b"RIFF", &[format, &chunk(b"data", &[0; 16])]);
    for (tag, bits, name) in
        [(6, 8, "A-law WAV"), (7, 8, "mu-law WAV"), (2, 4, "ADPCM WAV"), (0x55, 0, "MPEG in WAV")]
    {
        folder.says(
            name,
            &file(&fmt(tag, 1, bits, b"\0\0")),
            &format!("this is {name}; sound is read from WAV (RF64"),
        );
    }
    folder.says("MP3", b"ID3\x04\0\0\0\0\0\0", "this is MP3; sound is read from");
    folder.says("PNG", b"\x89PNG\r\n\x1a\n\0\0", "this is PNG; sound is read from");
    folder.says("text", b"this is not audio\n", "this is text; sound is read from");
    folder.says("integers of 64 bits", &file(&fmt(1, 1, 64, b"")), "bits per sample is 64");
    folder.says(
        "floats of 16 bits",
        &file(&fmt(3, 1, 16, b"")),
        "frames of 2 bytes for 1 channels of 16 bits",
    );
    folder.says("no channel", &file(&fmt(1, 0, 16, b"")), "0 channels");
    let inconsistent = [&b"fmt \x10\0\0\0\x01\0\x01\0\x80\xbb\0\0\x80\xbb\0\0"[..], &[4, 0, 16, 0]].concat();
    folder.says("a wide container", &file(&inconsistent), "frames of 4 bytes for 1 channels of 16 bits");
    let huge: Vec<u8> = [0.0, 1e30_f32].iter().flat_map(|s| s.to_le_bytes()).collect();
    let huge = riff(b"RIFF", &[&fmt(3, 1, 32, b""), &chunk(b"data", &huge)]);
    folder.says("no sound is so loud", &huge, "within 200 dB of full scale");
    let part = riff(b"RIFF", &[&fmt(1, 1, 16, b""), &chunk(b"data", &[0; 5])]);
    folder.says("half a sample", &part, "no whole number of frames");
    let long = riff(b"RIFF", &[b"junk\xf0\xff\xff\xffabc"]);
    folder.says("a chunk too long", &long, "chunk `junk` of 4294967280 bytes");
}

/// A named pipe nobody writes to would be waited for for ever.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_at_once() {
    let folder = Folder::new();
    let pipe = folder.0.path().join("pipe.wav");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|status| status.success());
    assert!(made, "mkfifo");
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || sender.send(read_audio(pipe, Channel::Mono).unwrap_err().to_string()));
    let error = receiver.recv_timeout(std::time::Duration::from_secs(10)).expect("it waits");
    assert!(error.ends_with("pipe.wav: is a named pipe; a file is needed"), "{error}");
    let error = read_audio("/dev/null", Channel::Mono).unwrap_err();
    assert!(matches!(error, Error::NotAFile { found: "a device", .. }), "{error}");
}

/// Blocks of any length are the file, and the file is what was written in blocks.
#[test]
fn blocks_are_the_whole() {
    let folder = Folder::new();
    let path = folder.0.path().join("blocks.wav");
    let sound: Vec<f32> = (0..200_000).map(|i| ((i % 977) as f32 / 977.0) - 0.5).collect();
    let mut writer = WavWriter::create(&path, 2, 48_000, SampleFormat::Float32).unwrap();
    for block in sound.chunks(7_778) {
        writer.write(block).unwrap();
    }
    writer.finish().unwrap();
    let left: Vec<f32> = sound.iter().step_by(2).copied().collect();
    assert_eq!(read_audio(&path, Channel::Index(0)).unwrap().samples(), left);
    let mut reader = AudioReader::open(&path, Channel::Index(0)).unwrap();
    reader.skip(12_345).unwrap();
    let (mut block, mut rest) = (Vec::new(), Vec::new());
    while reader.read_block(&mut block, 1_001).unwrap() > 0 {
        rest.extend_from_slice(&block);
    }
    assert_eq!(rest, left[12_345..]);
    assert_eq!(reader.position(), left.len() as u64);
}

#[test]
fn an_unfinished_file_is_not_there() {
    let folder = Folder::new();
    let path = folder.0.path().join("out.wav");
    let create = || WavWriter::create(&path, 2, 48_000, SampleFormat::Int16).unwrap();
    let mut writer = create();
    writer.write(&[0.5; 4]).unwrap();
    for wrong in [&[0.5][..], &[f32::NAN, 0.0], &[1.5, 0.0]] {
        let error = writer.write(wrong).unwrap_err();
        assert!(matches!(&error, Error::InFile { path: named, .. } if *named == path), "{error}");
    }
    drop(writer);
    assert!(create().finish().is_err());
    assert_eq!(std::fs::read_dir(folder.0.path()).unwrap().count(), 0);
}
