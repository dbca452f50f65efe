//! Recordings and responses that are odd, damaged, or no sound at all.

use super::outcome::Case;
use super::outcome::Expected::{Done, Refused};
use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::path::Path;

/// A header's format, channels, rate and bits.
struct Format(u16, u16, u32, u16);

/// What a header says that is not so.
#[derive(Default)]
struct Claims {
    /// Chunks before the samples.
    before: Vec<u8>,
    /// Bytes of samples.
    data: Option<u32>,
    /// Bytes of the file.
    file: Option<u32>,
    /// In place of `RIFF`.
    tag: Option<&'static [u8; 4]>,
}

fn wav(format: &Format, samples: &[u8], claims: &Claims) -> Vec<u8> {
    let Format(code, channels, rate, bits) = *format;
    let frame = u32::from(channels) * u32::from(bits) / 8;
    let mut body = b"WAVEfmt \x10\0\0\0".to_vec();
    body.extend(code.to_le_bytes());
    body.extend(channels.to_le_bytes());
    body.extend(rate.to_le_bytes());
    body.extend(rate.wrapping_mul(frame).to_le_bytes());
    body.extend((frame as u16).to_le_bytes());
    body.extend(bits.to_le_bytes());
    body.extend(&claims.before);
    body.extend(b"data");
    body.extend(claims.data.unwrap_or(samples.len() as u32).to_le_bytes());
    body.extend(samples);
    let mut file = claims.tag.unwrap_or(b"RIFF").to_vec();
    file.extend(claims.file.unwrap_or(body.len() as u32).to_le_bytes());
    file.extend(body);
    file
}

/// White noise between -1 and 1 by a linear congruential generator.
fn noise(count: usize) -> Vec<f64> {
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// One second of a response at 48 kHz: direct sound, then noise that falls by 60 dB in half a second.
fn response() -> Vec<f64> {
    let mut samples: Vec<f64> = noise(48_000)
        .iter()
        .enumerate()
        .map(|(i, n)| 0.1 * n * 10f64.powf(-3.0 * i as f64 / 24_000.0))
        .collect();
    samples[..5].fill(0.0);
    samples[5] = 0.99;
    samples
}

fn int16(samples: &[f64]) -> Vec<u8> {
    samples.iter().flat_map(|s| ((s.clamp(-1.0, 1.0) * 32_767.0) as i16).to_le_bytes()).collect()
}

fn float32(samples: &[f64]) -> Vec<u8> {
    samples.iter().flat_map(|s| (*s as f32).to_le_bytes()).collect()
}

/// Writes all recordings into `wav/`.
pub fn make(folder: &Path) {
    let to = folder.join("wav");
    std::fs::create_dir_all(&to).unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(to.join(name), bytes).unwrap();
    let plain =
        |name: &str, format: Format, samples: &[u8]| write(name, &wav(&format, samples, &Claims::default()));
    let (float, pcm) = (Format(3, 1, 48_000, 32), Format(1, 1, 48_000, 16));
    let x = response();
    let claiming = |name: &str, format: &Format, samples: &[u8], claims: Claims| {
        write(name, &wav(format, samples, &claims))
    };

    plain("good.wav", Format(3, 1, 48_000, 32), &float32(&x));
    plain(
        "u8.wav",
        Format(1, 1, 48_000, 8),
        &x.iter().map(|s| (s * 127.0 + 128.0) as u8).collect::<Vec<u8>>(),
    );
    plain(
        "i24.wav",
        Format(1, 1, 48_000, 24),
        &x.iter().flat_map(|s| ((s * 8_388_607.0) as i32).to_le_bytes()[..3].to_vec()).collect::<Vec<u8>>(),
    );
    plain("f64.wav", Format(3, 1, 48_000, 64), &x.iter().flat_map(|s| s.to_le_bytes()).collect::<Vec<u8>>());
    plain("noext", Format(1, 1, 48_000, 16), &int16(&x));
    plain("wavas.flac", Format(1, 1, 48_000, 16), &int16(&x));
    let odd = b"LIST\x03\0\0\0abc\0".to_vec();
    claiming("oddchunk.wav", &pcm, &int16(&x), Claims { before: odd, ..Claims::default() });
    let mut bext = b"bext\x5b\x02\0\0".to_vec();
    bext.extend(vec![b' '; 0x25b]);
    bext.push(0);
    claiming("bext.wav", &pcm, &int16(&x), Claims { before: bext, ..Claims::default() });
    claiming(
        "stream.wav",
        &pcm,
        &int16(&x),
        Claims { data: Some(u32::MAX), file: Some(u32::MAX), ..Claims::default() },
    );
    let mut ds64 = b"ds64\x1c\0\0\0".to_vec();
    for size in [96_000u64 + 80, 96_000, 48_000] {
        ds64.extend(size.to_le_bytes());
    }
    ds64.extend([0; 4]);
    write("rf64.wav", &rf64(&ds64, &int16(&x)));
    claiming(
        "claims24h.wav",
        &Format(1, 1, 12_000, 16),
        &int16(&x),
        Claims { data: Some(2_073_600_000), ..Claims::default() },
    );
    let huge = b"junk\xf0\xff\xff\xffabc".to_vec();
    claiming("hugechunk.wav", &pcm, &int16(&x), Claims { before: huge, ..Claims::default() });
    plain("halfsample.wav", Format(1, 1, 48_000, 16), &int16(&x)[1..]);

    plain("alaw.wav", Format(6, 1, 48_000, 8), &[0x55; 48_000]);
    plain("adpcm.wav", Format(2, 1, 48_000, 4), &[0; 48_000]);
    plain("bits12.wav", Format(1, 1, 48_000, 12), &int16(&x));
    plain("bits0.wav", Format(1, 1, 48_000, 0), &int16(&x));
    plain(
        "bits64int.wav",
        Format(1, 1, 48_000, 64),
        &x.iter().flat_map(|s| s.to_le_bytes()).collect::<Vec<u8>>(),
    );
    plain("ch0.wav", Format(1, 0, 48_000, 16), &int16(&x));
    plain("ch65535.wav", Format(1, 65_535, 48_000, 16), &int16(&x));
    plain("ch32.wav", Format(1, 32, 48_000, 16), &int16(&x[..32 * 1000]));
    for rate in [0, 1, 7, 10_000_000, u32::MAX] {
        plain(&format!("rate{rate}.wav"), Format(1, 1, rate, 16), &int16(&x));
    }

    write("empty.wav", b"");
    plain("headeronly.wav", Format(1, 1, 48_000, 16), b"");
    plain("one.wav", Format(1, 1, 48_000, 16), &[1, 0]);
    plain("two.wav", Format(1, 1, 48_000, 16), &[1, 0, 2, 0]);
    let with = |value: f64| {
        float32(&x.iter().enumerate().map(|(i, s)| if i == 1000 { value } else { *s }).collect::<Vec<_>>())
    };
    plain("nan.wav", Format(3, 1, 48_000, 32), &with(f64::NAN));
    plain("inf.wav", Format(3, 1, 48_000, 32), &with(f64::INFINITY));
    let scaled = |gain: f64| float32(&x.iter().map(|s| s * gain).collect::<Vec<_>>());
    plain("huge.wav", Format(3, 1, 48_000, 32), &scaled(1e30));
    plain("max.wav", Format(3, 1, 48_000, 32), &scaled(3e38));
    plain("denorm.wav", Format(3, 1, 48_000, 32), &scaled(1e-40));
    plain("zeros.wav", Format(1, 1, 48_000, 16), &[0; 96_000]);
    plain("dc.wav", Format(1, 1, 48_000, 16), &int16(&[0.5; 48_000]));
    let sixteen = |name: &str, samples: &[f64]| plain(name, Format(1, 1, 16_000, 16), &int16(samples));
    sixteen("square.wav", &(0..64_000).map(|i| f64::sin(0.1 * f64::from(i)).signum()).collect::<Vec<_>>());
    sixteen("noise4s.wav", &noise(64_000).iter().map(|n| 0.2 * n).collect::<Vec<_>>());
    sixteen("short09.wav", &noise(14_400));
    plain("directlast.wav", float, &float32(&x.iter().rev().copied().collect::<Vec<_>>()));
    plain("twodirect.wav", Format(3, 1, 48_000, 32), &float32(&[&x[..], &x[..]].concat()));

    write("text.wav", &b"this is not audio\n".repeat(100));
    write("png.wav", &[&b"\x89PNG\r\n\x1a\n"[..], &[0; 100]].concat());
    write("x.mp3", &[&b"ID3\x03\0\0\0\0\0\0\xff\xfb\x90\0"[..], &[0; 1000]].concat());
    write("trunc.flac", &[&b"fLaC\0\0\0\x22"[..], &[0; 20]].concat());
    write("trunc.ogg", &[&b"OggS"[..], &[0; 100]].concat());
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    std::fs::copy(fixtures.join("speech/recording.wav"), to.join("speech.wav")).unwrap();
    std::fs::copy(fixtures.join("speech/recording.wav"), to.join("sp äö <b>x&.wav")).unwrap();
    std::fs::copy(fixtures.join("speech/dry_guest.wav"), to.join("dry.wav")).unwrap();
    std::fs::copy(to.join("good.wav"), to.join(OsString::from_vec(b"nonutf\xff.wav".to_vec()))).unwrap();
    std::fs::create_dir_all(to.join("dir.wav")).unwrap();
    std::os::unix::fs::symlink("loop.wav", to.join("loop.wav")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(to.join("fifo.wav")).status().unwrap().success());
}

/// `RF64` with its sizes in a `ds64` chunk (EBU Tech 3306), the first in the file.
fn rf64(ds64: &[u8], samples: &[u8]) -> Vec<u8> {
    let sized = wav(
        &Format(1, 1, 48_000, 16),
        samples,
        &Claims { data: Some(u32::MAX), file: Some(u32::MAX), tag: Some(b"RF64"), ..Claims::default() },
    );
    [&sized[..12], ds64, &sized[12..]].concat()
}

/// What `measure`, `match`, `estimate` and `mix` make of them.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (file, expected) in [
        ("good.wav", Done(&["t30_s"])),
        ("u8.wav", Done(&["t30_s"])),
        ("i24.wav", Done(&["t30_s"])),
        ("f64.wav", Done(&["t30_s"])),
        ("noext", Done(&["t30_s"])),
        ("wavas.flac", Done(&["t30_s"])),
        ("oddchunk.wav", Done(&["t30_s"])),
        ("bext.wav", Done(&["t30_s"])),
        ("stream.wav", Done(&["t30_s"])),
        ("rf64.wav", Done(&["t30_s"])),
        ("max.wav", Refused(&["max.wav", "200 dB"])),
        ("huge.wav", Refused(&["huge.wav", "200 dB"])),
        ("claims24h.wav", Refused(&["claims24h.wav", "truncated"])),
        ("hugechunk.wav", Refused(&["hugechunk.wav"])),
        ("halfsample.wav", Refused(&["halfsample.wav"])),
        ("adpcm.wav", Refused(&["adpcm.wav", "ADPCM"])),
        ("bits12.wav", Refused(&["bits12.wav", "12"])),
        ("bits0.wav", Refused(&["bits0.wav"])),
        ("bits64int.wav", Refused(&["bits64int.wav", "64"])),
        ("ch0.wav", Refused(&["ch0.wav", "channel"])),
        ("ch65535.wav", Refused(&["ch65535.wav"])),
        ("ch32.wav", Refused(&["ch32.wav", "32 channels", "--channel"])),
        ("rate0.wav", Refused(&["rate0.wav", "sample rate"])),
        ("rate1.wav", Refused(&["rate1.wav", "sample rate"])),
        ("rate7.wav", Refused(&["rate7.wav", "sample rate"])),
        ("rate10000000.wav", Refused(&["rate10000000.wav", "sample rate"])),
        ("rate4294967295.wav", Refused(&["rate4294967295.wav"])),
        ("empty.wav", Refused(&["empty.wav", "empty"])),
        ("headeronly.wav", Refused(&["headeronly.wav", "empty"])),
        ("nan.wav", Refused(&["nan.wav", "not finite"])),
        ("inf.wav", Refused(&["inf.wav", "not finite"])),
        ("text.wav", Refused(&["text.wav", "this is text", "WAV"])),
        ("alaw.wav", Refused(&["alaw.wav", "A-law WAV"])),
        ("png.wav", Refused(&["png.wav", "PNG"])),
        ("x.mp3", Refused(&["x.mp3", "MP3"])),
        ("trunc.flac", Refused(&["trunc.flac"])),
        ("trunc.ogg", Refused(&["trunc.ogg"])),
        ("dir.wav", Refused(&["dir.wav", "directory"])),
        ("loop.wav", Refused(&["loop.wav", "symbolic links"])),
        ("fifo.wav", Refused(&["fifo.wav", "named pipe"])),
        ("absent.wav", Refused(&["absent.wav", "No such file"])),
        ("speech.wav", Refused(&["speech.wav", "sabine estimate"])),
        // No response, but nothing that says so: the reasons stand where the numbers would.
        ("twodirect.wav", Done(&["sound sets in 2 times", "1.0"])),
        ("one.wav", Done(&["-"])),
        ("two.wav", Done(&["-"])),
        ("zeros.wav", Done(&["no onset"])),
        ("dc.wav", Done(&["-"])),
        ("denorm.wav", Done(&["t30_s"])),
        ("directlast.wav", Done(&["-"])),
        ("short09.wav", Done(&["-"])),
    ] {
        cases.push(
            Case::new(format!("measure {file}"), "measure", expected).with(&[format!("wav/{file}").into()]),
        );
    }
    let odd_name = OsString::from_vec(b"wav/nonutf\xff.wav".to_vec());
    cases.push(Case::new("measure a name that is no Unicode", "measure", Done(&["t30_s"])).with(&[odd_name]));
    for (file, expected) in [
        ("empty.wav", Refused(&["empty.wav", "empty"])),
        ("one.wav", Refused(&["one.wav", "0.00 s"])),
        ("zeros.wav", Refused(&["zeros.wav", "silent"])),
        ("square.wav", Refused(&["square.wav", "clipped"])),
        ("short09.wav", Refused(&["short09.wav", "0.90 s"])),
        ("nan.wav", Refused(&["nan.wav", "not finite"])),
        ("dc.wav", Refused(&["dc.wav"])),
        ("ch32.wav", Refused(&["ch32.wav", "32 channels", "--channel"])),
        ("denorm.wav", Refused(&["denorm.wav", "silent"])),
        ("huge.wav", Refused(&["huge.wav", "200 dB"])),
        ("max.wav", Refused(&["max.wav"])),
        ("fifo.wav", Refused(&["fifo.wav", "named pipe"])),
        ("noise4s.wav", Done(&["note"])),
    ] {
        let arguments = format!("match --rays 300 --speech wav/{file} --out OUT");
        cases.push(Case::new(format!("match --speech {file}"), &arguments, expected));
    }
    for (file, expected) in [
        ("empty.wav", Refused(&["empty.wav", "empty"])),
        ("one.wav", Refused(&["one.wav", "silent"])),
        ("zeros.wav", Refused(&["zeros.wav", "silent"])),
        ("nan.wav", Refused(&["nan.wav", "not finite"])),
        ("ch32.wav", Refused(&["ch32.wav", "32 channels", "--channel"])),
        ("denorm.wav", Refused(&["denorm.wav", "silent"])),
        ("rate1.wav", Refused(&["rate1.wav", "sample rate"])),
        ("fifo.wav", Refused(&["fifo.wav", "named pipe"])),
    ] {
        let arguments = format!("match --rays 300 --dry wav/{file} --out OUT");
        cases.push(Case::new(format!("match --dry {file}"), &arguments, expected));
    }
    let odd = Case::new(
        "match --speech `sp äö <b>x&.wav`",
        "match --rays 300 --out OUT --speech",
        Done(&["report.html"]),
    );
    cases.push(odd.with(&["wav/sp äö <b>x&.wav".into()]));
    for (arguments, expected) in [
        ("estimate wav/speech.wav wav/absent.wav", Refused(&["absent.wav", "No such file"])),
        ("estimate wav/speech.wav --channel 5", Refused(&["speech.wav", "channel 5"])),
        ("estimate wav/speech.wav --weights wav/good.wav", Refused(&["good.wav", "safetensors"])),
        (
            "mix --speech wav/dry.wav --response wav/good.wav --noise wav/nan.wav --snr 20 --out OUT",
            Refused(&["nan.wav", "not finite"]),
        ),
        ("mix --speech wav/zeros.wav --response wav/good.wav --out OUT", Refused(&["zeros.wav", "silent"])),
        ("mix --speech wav/dry.wav --response wav/zeros.wav --out OUT", Refused(&["zeros.wav", "silent"])),
        (
            "mix --speech wav/dry.wav --response wav/good.wav --noise wav/noise4s.wav --snr -5 --out OUT",
            Done(&[]),
        ),
    ] {
        cases.push(Case::new(arguments, arguments, expected));
    }
    cases
}
