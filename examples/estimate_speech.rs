//! What speech tells about the room that it was spoken in, and why an error is large: a long recording against its first second.
//!
//! ```text
//! cargo run --example estimate_speech [-- RECORDING.wav]
//! ```
//!
//! It prints
//! ```text
//! all of it: 8.0 s of speech, 4 windows
//! octave (Hz)         T60 (s)        EQ (dB)
//!         125     0.84 ± 0.20     -2.9 ± 2.9
//! ...
//!        1000     0.74 ± 0.06
//! ...
//!        8000     0.56 ± 0.05
//! the first second of it: 1.0 s of speech, 1 windows
//! ...
//!         125     0.86 ± 0.41     -2.2 ± 2.9
//! ...
//!        1000     0.77 ± 0.24
//! ...
//!        8000     0.57 ± 0.16
//! note: the recording lasts 1.0 s; it was repeated to fill a window of 4.0 s
//! ```
//!
//! Reverberation is known better with every second of speech. Equalisation hardly is: a voice has a colour of its own, and nobody says
//! which part of what is heard is the room's.
//! In full: `sabine estimate RECORDING.wav --json out/estimate.json`. How far it can be trusted: `docs/model_card.md`.

use sabine::acoustics::{Channel, Signal, read_audio, resample};
use sabine::estimator::{DetailedEstimate, Estimator};
use std::error::Error;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures"));
    let file = std::env::args_os().nth(1).map(PathBuf::from);
    let file = file.unwrap_or_else(|| fixtures.join("speech/recording.wav"));

    let estimator = Estimator::pretrained()?;
    let speech = resample(&read_audio(&file, Channel::Mono)?, estimator.sample_rate_hz())?;
    print("all of it", &speech, &estimator.estimate_detailed(&speech)?);

    let second = speech.samples().iter().take(speech.sample_rate_hz() as usize).copied().collect();
    let second = Signal::new(second, speech.sample_rate_hz())?;
    print("the first second of it", &second, &estimator.estimate_detailed(&second)?);
    Ok(())
}

fn print(what: &str, speech: &Signal, heard: &DetailedEstimate) {
    println!("{what}: {:.1} s of speech, {} windows", speech.duration_s(), heard.windows.len());
    println!("octave (Hz)         T60 (s)        EQ (dB)");
    for (hz, t60) in heard.targets.t60_s().iter() {
        let eq = heard.targets.eq_db().at_hz(hz);
        // Relative to 1 kHz: 0 dB there, without an error. The network hears equalisation up to 4 kHz.
        let eq = eq.filter(|e| e.standard_error > 0.0);
        let eq = eq.map_or_else(String::new, |e| format!("{:+.1} ± {:.1}", e.value, e.standard_error));
        println!("{hz:>11}     {:.2} ± {:.2}{eq:>15}", t60.value, t60.standard_error);
    }
    for warning in &heard.warnings {
        println!("note: {warning}");
    }
}
