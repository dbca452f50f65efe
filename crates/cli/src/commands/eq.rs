//! Designs an equalising filter from octave-band gains and shows what it does.
//!
//! ```text
//! sabine eq --gains-db 3,-2,0,1,0,-4,-9 --sample-rate 48000 --out fir.wav
//! ```
//!
//! Writes `fir.wav` (32-bit float taps, mono) and `fir.svg` (gains wanted and realised), both or neither.

use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use crate::output::OutputFolder;
use clap::Args;
use sabine::acoustics::{Bands, PerBand, SampleFormat, Signal, encode_wav};
use sabine::eqfilter::{AboveBand, EqFilter, EqFilterConfig};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(about = "Designs a linear-phase FIR filter from octave-band gains")]
pub struct Arguments {
    /// Gains in dB, comma-separated, one for each octave from --first-band on.
    #[arg(long, value_delimiter = ',', required = true, allow_negative_numbers = true)]
    gains_db: Vec<f64>,
    /// Nominal centre, in Hz, of the octave of the first gain.
    #[arg(long, default_value_t = 62.5)]
    first_band: f64,
    /// Sample rate in Hz.
    #[arg(long, default_value_t = 48_000)]
    sample_rate: u32,
    /// Delay in seconds: half the length of the filter.
    #[arg(long, default_value_t = 0.032)]
    delay_s: f64,
    /// Gain in dB from the octave above the last one on; without it the last gain goes on.
    #[arg(long, allow_negative_numbers = true)]
    above_db: Option<f64>,
    /// Minimum phase: no delay.
    #[arg(long)]
    minimum_phase: bool,
    /// The filter's WAV file; the plot takes its name with .svg.
    #[arg(long, default_value = "fir.wav")]
    out: PathBuf,
}

/// Deviation of an octave's gain from the one wanted that goes without a warning, in dB: half of what is heard.
const CLOSE_DB: f64 = 0.5;

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let gains_db = gains(arguments)?;
    let above = arguments.above_db.map(|gain_db| AboveBand {
        from_band_hz: 2.0 * gains_db.bands().nominal_hz(gains_db.bands().len() - 1),
        gain_db,
    });
    let config = EqFilterConfig { delay_s: arguments.delay_s, above };
    let mut filter = EqFilter::design(&gains_db, arguments.sample_rate, config)?;
    if arguments.minimum_phase {
        filter = filter.into_minimum_phase();
    }
    println!(
        "{} taps, delay {} samples ({:.1} ms)",
        filter.taps().len(),
        filter.delay_samples(),
        1e3 * filter.delay_s()
    );
    println!("  band Hz   wanted dB   realised dB");
    for ((hz, wanted), realised) in gains_db.iter().zip(filter.realised_db().values()) {
        match realised {
            Some(realised) if (realised - wanted).abs() <= CLOSE_DB => {
                println!("{hz:9} {wanted:11.2} {realised:13.2}");
            }
            // NaN is no gain either.
            Some(realised) => println!("{hz:9} {wanted:11.2} {realised:13.2}   warning: not what is wanted"),
            None => println!("{hz:9} {wanted:11.2}   above half the sample rate"),
        }
    }
    let svg = arguments.out.with_extension("svg");
    let taps = Signal::new(filter.taps().to_vec(), filter.sample_rate_hz())?;
    let folder = arguments.out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut out = OutputFolder::create(folder)?;
    out.write(&name(&arguments.out), &encode_wav(&taps, SampleFormat::Float32)?)?;
    out.write(&name(&svg), plot(&filter).plain_svg()?.as_bytes())?;
    out.finish()?;
    println!("wrote {} and {}", arguments.out.display(), svg.display());
    Ok(())
}

/// The gains with their bands.
fn gains(arguments: &Arguments) -> Result<PerBand<f64>, Failure> {
    let (first_hz, count) = (arguments.first_band, arguments.gains_db.len());
    let to_top = Bands::octaves(first_hz, 16_000.0).map_err(|e| format!("--first-band: {e}"))?;
    if count > to_top.len() {
        return Err(format!(
            "--gains-db: {count} gains from {first_hz} Hz on reach beyond the 16 kHz octave"
        )
        .into());
    }
    let bands = Bands::octaves(first_hz, to_top.nominal_hz(count - 1))?;
    Ok(PerBand::new(bands, arguments.gains_db.clone())?)
}

/// Gain over frequency, with the gains wanted and realised in each octave.
fn plot(filter: &EqFilter) -> Chart {
    let bands = filter.wanted_db().bands();
    let centres: Vec<f64> = bands.iter_hz().collect();
    let (low_hz, high_hz) = (centres[0] / 1.2, centres[centres.len() - 1] * 1.2);
    let curve = (0..=400)
        .map(|i| low_hz * (high_hz / low_hz).powf(f64::from(i) / 400.0))
        .map(|hz| (hz, filter.gain_db(hz).max(-80.0)))
        .collect();
    let wanted = filter.wanted_db().iter().map(|(hz, &db)| (hz, db)).collect();
    let realised = filter.realised_db().iter().map(|(hz, db)| (hz, db.unwrap_or(f64::NAN))).collect();
    Chart {
        x_label: "Frequency (Hz)".into(),
        y_label: "Gain (dB)".into(),
        x: Scale::Octaves(centres),
        y: None,
        series: vec![
            Series::new("response", Look::Line, 0, curve),
            Series::new("octaves wanted", Look::Dashed, 2, wanted),
            Series::new("octaves realised", Look::Dots, 1, realised),
        ],
        small: false,
    }
}
