//! The work of the page without a browser, timed: the other column of the table in `docs/validation/browser.md`.
//!
//! ```sh
//! cargo run --release -p sabine-wasm --example native
//! ```

use sabine_acoustics::{SampleFormat, Signal, encode_wav};
use sabine_wasm::{Measured, Opened, TraceSpec, Traced};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut state = 1u32;
    let mut noise = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state) / f64::from(1u32 << 31) - 1.0
    };
    let samples =
        (0..240_000).map(|i| (0.9 * noise() * (-6.9078 * f64::from(i) / 48_000.0 / 1.2).exp()) as f32);
    let bytes = encode_wav(&Signal::new(samples.collect(), 48_000)?, SampleFormat::Int16)?;
    let started = Instant::now();
    Measured::read(&Opened::read("decay.wav", bytes)?.responses()[0].samples)?;
    println!("measured 5 s at 48 kHz in {:.2} s", started.elapsed().as_secs_f64());

    let spec: TraceSpec = serde_json::from_str(
        r#"{"room": {"size_m": [6, 5, 3], "surfaces": {"floor": "parquet_on_concrete", "ceiling": "plasterboard_ceiling",
            "walls": "rendered_brick"}}, "source_m": [1.5, 2, 1.5], "receiver_m": [4.2, 3.1, 1.2], "rays": 5000}"#,
    )?;
    let started = Instant::now();
    let traced = Traced::new(&spec, &())?;
    println!("traced {} paths in {:.2} s", traced.paths, started.elapsed().as_secs_f64());
    Ok(())
}
