//! A recording that never was: a dry voice in a measured room, with pink noise so many decibels below it.
//!
//! ```text
//! cargo run --example mix_recording [-- SNR_DB]
//! ```
//!
//! It writes `out/mix_recording/mixed.wav` and prints
//! ```text
//! speech 20.0 dB over noise for 5.7 s
//! octave (Hz)   speech over noise (dB)
//!         125                     17.6
//! ...
//!        1000                     18.1
//! ...
//!        8000                      8.8
//! wrote out/mix_recording/mixed.wav, its level changed by -0.8 dB
//! ```
//!
//! In full: `sabine mix --speech V.wav --response R.wav --noise N.wav --snr 20 --out mixed.wav`; many thousands of them, with labels:
//! `sabine augment`. Which level means what: `docs/conventions.md`.

use sabine::acoustics::{
    Bands, Channel, FilterBank, PerBand, SampleFormat, Signal, read_audio, resample, write_wav,
};
use sabine::eqfilter::{EqFilter, EqFilterConfig, convolve};
use std::error::Error;
use std::path::Path;

const RATE_HZ: u32 = 16_000;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let snr_db: f64 = std::env::args().nth(1).map_or(Ok(20.0), |db| db.parse())?;
    let read = |name: &str| -> Result<Signal, Box<dyn Error>> {
        Ok(resample(&read_audio(fixtures.join(name), Channel::Mono)?, RATE_HZ)?)
    };
    let (dry, response) = (read("speech/dry_reader.wav")?, read("room/ir/talker_corner.wav")?);

    // The voice in the room: its end rings on after the last word.
    let wet = convolve(dry.samples(), response.samples());

    // White noise, then 3 dB less per octave.
    let mut state = 1_u32;
    let mut white = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    let noise = Signal::new((0..wet.len()).map(|_| white()).collect(), RATE_HZ)?;
    let slope_db = PerBand::from_fn(Bands::SIMULATION, |octave| -3.0 * octave as f64);
    let noise = EqFilter::design(&slope_db, RATE_HZ, EqFilterConfig::default())?.apply(&noise)?;

    let gain = (power(&wet) / power(noise.samples()) / 10_f64.powf(snr_db / 10.0)).sqrt() as f32;
    let noise: Vec<f32> = noise.samples().iter().map(|n| gain * n).collect();
    let mut mixed: Vec<f32> = wet.iter().zip(&noise).map(|(s, n)| s + n).collect();
    println!(
        "speech {:.1} dB over noise for {:.1} s",
        10.0 * (power(&wet) / power(&noise)).log10(),
        mixed.len() as f64 / f64::from(RATE_HZ)
    );
    println!("octave (Hz)   speech over noise (dB)");
    let bank = FilterBank::new(Bands::T60, RATE_HZ)?;
    let (speech, noise) = (bank.analyse(&wet), bank.analyse(&noise));
    for ((hz, speech), noise) in speech.iter().zip(noise.values()) {
        println!("{hz:>11}{:>25.1}", 10.0 * (power(speech) / power(noise)).log10());
    }

    let scale = 0.5 / mixed.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    mixed.iter_mut().for_each(|s| *s *= scale);
    std::fs::create_dir_all("out/mix_recording")?;
    write_wav("out/mix_recording/mixed.wav", &mixed, RATE_HZ, SampleFormat::Int16)?;
    println!("wrote out/mix_recording/mixed.wav, its level changed by {:+.1} dB", 20.0 * scale.log10());
    Ok(())
}

fn power(samples: &[f32]) -> f64 {
    samples.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>() / samples.len() as f64
}
