//! What an impulse response says about its room, octave by octave: each number with its standard error, or the reason why there is none.
//!
//! ```text
//! cargo run --example measure_response [-- RESPONSE.wav]
//! ```
//!
//! It prints
//! ```text
//! direct sound 13.6 ms after the start of the file
//! octave (Hz)         T30 (s)         T60 (s)   C50 (dB)   DRR (dB)
//!         125    0.739 ± 0.041    0.822 ± 0.015        0.7      -11.9
//! ...
//!        1000    0.765 ± 0.017    0.773 ± 0.006        1.5      -10.7
//! ...
//!        8000               -               -          -          -
//! no T60 at 8000 Hz: the band reaches beyond half the sample rate of 22050 Hz
//! ```
//!
//! In full: `sabine measure RESPONSE.wav --plots out`. How the numbers are read: `docs/explanation/decay.md`.

use sabine::acoustics::{Bands, Channel, ImpulseResponse, Reading, RoomParameters, read_audio};
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let file = std::env::args_os().nth(1).map(PathBuf::from);
    let file = file.unwrap_or_else(|| fixtures.join("room/ir/talker_microphone.wav"));
    let response: ImpulseResponse = read_audio(&file, Channel::Mono)?.into();

    let bands = Bands::T60; // octaves, 125 Hz to 8 kHz
    let room = RoomParameters::measure(&response, bands)?;
    if let Ok(onset) = &room.onset {
        println!("direct sound {:.1} ms after the start of the file", 1e3 * onset.time_s);
    }
    println!("octave (Hz)         T30 (s)         T60 (s)   C50 (dB)   DRR (dB)");
    for (band, hz) in bands.iter_hz().enumerate() {
        let [t30, t60] = [&room.t30_s, &room.t60_s].map(|q| cell(&q.values()[band]));
        // The error of an energy ratio is what the noise adds: hundredths of a decibel here.
        let [c50, drr] = [&room.c50_db, &room.drr_db].map(|q| match &q.values()[band] {
            Ok(ratio) => format!("{:.1}", ratio.value),
            Err(_) => "-".to_owned(),
        });
        println!("{hz:>11}{t30}{t60}{c50:>11}{drr:>11}");
    }
    // A `Reading` is an estimate or a reason: there is no number that looks like one and is none.
    for (hz, t60) in room.t60_s.iter() {
        if let Err(reason) = t60 {
            println!("no T60 at {hz} Hz: {reason}");
        }
    }
    Ok(())
}

fn cell(reading: &Reading) -> String {
    match reading {
        Ok(estimate) => format!("{:>9.3} ± {:.3}", estimate.value, estimate.standard_error),
        Err(_) => format!("{:>16}", "-"),
    }
}
