//! From gains in octaves to a filter, and the proof that the filter has them: a filter bank measures its impulse response.
//!
//! ```text
//! cargo run --example design_eq
//! ```
//!
//! It writes `out/design_eq/equalised.wav`, a voice through the filter, and prints
//! ```text
//! 1413 taps, delay 32.0 ms
//! octave (Hz)   wanted (dB)   measured (dB)
//!        62.5          3.00            3.00
//!         125         -2.00           -2.00
//! ...
//!        4000         -9.00           -9.00
//! wrote out/design_eq/equalised.wav, its level changed by -1.0 dB
//! ```
//!
//! In full: `sabine eq --gains-db 3,-2,0,1,0,-4,-9 --out out/fir.wav`. How the filter is found: `docs/explanation/fir.md`.

use sabine::acoustics::{Bands, Channel, FilterBank, PerBand, SampleFormat, read_audio, write_wav};
use sabine::eqfilter::{EqFilter, EqFilterConfig};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let voice = read_audio(fixtures.join("speech/dry_guest.wav"), Channel::Mono)?;

    let wanted_db = PerBand::new(Bands::EQ, vec![3.0, -2.0, 0.0, 1.0, 0.0, -4.0, -9.0])?;
    let filter = EqFilter::design(&wanted_db, voice.sample_rate_hz(), EqFilterConfig::default())?;
    println!("{} taps, delay {:.1} ms", filter.taps().len(), 1e3 * filter.delay_s());

    // An octave's gain is the energy that it holds after the filter over what it held before: here, of a single impulse.
    let bank = FilterBank::new(Bands::EQ, voice.sample_rate_hz())?;
    let mut impulse = vec![0.0; voice.sample_rate_hz() as usize];
    let middle = impulse.len() / 2;
    impulse[middle] = 1.0;
    let before = energies(&bank, &impulse);
    impulse[middle..][..filter.taps().len()].copy_from_slice(filter.taps());
    let after = energies(&bank, &impulse);

    println!("octave (Hz)   wanted (dB)   measured (dB)");
    for (((hz, wanted), before), after) in wanted_db.iter().zip(&before).zip(&after) {
        println!("{hz:>11}{wanted:>14.2}{:>16.2}", 10.0 * (after / before).log10());
    }

    // `apply` takes the delay out: the voice is as long as it was, and in time.
    let equalised = filter.apply(&voice)?;
    let gain = 0.9 / equalised.peak();
    let scaled: Vec<f32> = equalised.samples().iter().map(|s| s * gain).collect();
    std::fs::create_dir_all("out/design_eq")?;
    write_wav("out/design_eq/equalised.wav", &scaled, equalised.sample_rate_hz(), SampleFormat::Int16)?;
    println!("wrote out/design_eq/equalised.wav, its level changed by {:+.1} dB", 20.0 * gain.log10());
    Ok(())
}

fn energies(bank: &FilterBank, samples: &[f32]) -> Vec<f64> {
    let sum = |band: &Vec<f32>| band.iter().map(|&s| f64::from(s).powi(2)).sum();
    bank.analyse(samples).values().iter().map(sum).collect()
}
