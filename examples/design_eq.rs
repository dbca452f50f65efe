//! Designs an equalising filter from octave-band gains and shows what it does.
//!
//! ```text
//! cargo run --release --example design_eq -- --gains-db 3,-2,0,1,0,-4,-9 --sample-rate 48000 --out fir.wav
//! ```
//!
//! Writes `fir.wav` (32-bit float taps, mono) and `fir.svg` (gains wanted and realised), both or neither.

use clap::Parser;
use plotters::prelude::*;
use sabine_acoustics::{OctaveBands, PerBand};
use sabine_eqfilter::{AboveBand, EqFilter, EqFilterConfig};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Lowest frequency of the plot in Hz.
const PLOT_FROM_HZ: f64 = 31.25;

#[derive(Parser)]
#[command(about = "Designs a linear-phase FIR filter from octave-band gains")]
struct Arguments {
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

#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error("--first-band {first_hz} Hz with {count} gains: {source}")]
    Bands { first_hz: f64, count: usize, source: sabine_acoustics::Error },
    #[error("--gains-db: {0} gains from {1} Hz on reach beyond the 16 kHz octave")]
    TooMany(usize, f64),
    #[error(transparent)]
    Design(#[from] sabine_eqfilter::Error),
    #[error("the taps cannot be put into a WAV file: {0}")]
    Wav(#[from] hound::Error),
    #[error("the plot cannot be drawn: {0}")]
    Plot(Box<dyn std::error::Error>),
    #[error("{}: {source}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("design_eq: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
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
            Some(realised) => println!("{hz:9} {wanted:11.2} {realised:13.2}"),
            None => println!("{hz:9} {wanted:11.2}   above half the sample rate"),
        }
    }
    let plot = plot(&filter)?;
    let wav = wav(&filter)?;
    let svg = arguments.out.with_extension("svg");
    write_all(&[(&arguments.out, &wav), (&svg, plot.as_bytes())])?;
    println!("wrote {} and {}", arguments.out.display(), svg.display());
    Ok(())
}

/// The gains with their bands.
fn gains(arguments: &Arguments) -> Result<PerBand<f64>, Failure> {
    let (first_hz, count) = (arguments.first_band, arguments.gains_db.len());
    let bands_error = |source| Failure::Bands { first_hz, count, source };
    let to_top = OctaveBands::new(first_hz, 16_000.0).map_err(bands_error)?;
    if count > to_top.len() {
        return Err(Failure::TooMany(count, first_hz));
    }
    let bands = OctaveBands::new(first_hz, to_top.nominal_hz(count - 1)).map_err(bands_error)?;
    PerBand::new(bands, arguments.gains_db.clone()).map_err(bands_error)
}

/// The taps as a WAV file of 32-bit floats.
fn wav(filter: &EqFilter) -> Result<Vec<u8>, Failure> {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: filter.sample_rate_hz(),
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec)?;
    for &tap in filter.taps() {
        writer.write_sample(tap)?;
    }
    writer.finalize()?;
    Ok(bytes.into_inner())
}

/// Gain over frequency, with the gains wanted and realised in each octave.
fn plot(filter: &EqFilter) -> Result<String, Failure> {
    let failure = |error: Box<dyn std::error::Error>| Failure::Plot(error);
    let nyquist_hz = f64::from(filter.sample_rate_hz()) / 2.0;
    let curve: Vec<(f64, f64)> = (0..=800)
        .map(|i| PLOT_FROM_HZ * (nyquist_hz / PLOT_FROM_HZ).powf(f64::from(i) / 800.0))
        .map(|hz| (hz, filter.gain_db(hz).max(-80.0)))
        .collect();
    let wanted: Vec<(f64, f64)> = filter.wanted_db().iter().map(|(hz, &db)| (hz, db)).collect();
    let realised: Vec<(f64, f64)> =
        filter.realised_db().iter().filter_map(|(hz, db)| db.map(|db| (hz, db))).collect();
    let levels = || wanted.iter().chain(&realised).map(|p| p.1);
    let top = levels().chain(curve.iter().map(|p| p.1)).fold(f64::NEG_INFINITY, f64::max).ceil() + 3.0;
    let bottom = levels().fold(f64::INFINITY, f64::min).min(top - 24.0).floor() - 6.0;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (860, 460)).into_drawing_area();
        root.fill(&WHITE).map_err(|e| failure(e.into()))?;
        let mut chart = ChartBuilder::on(&root)
            .margin(16)
            .x_label_area_size(44)
            .y_label_area_size(52)
            .build_cartesian_2d((PLOT_FROM_HZ..nyquist_hz).log_scale(), bottom..top)
            .map_err(|e| failure(e.into()))?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc("Frequency in Hz")
            .y_desc("Gain in dB")
            .x_label_formatter(&|hz| format!("{hz:.0}"))
            .draw()
            .map_err(|e| failure(e.into()))?;
        let inside = curve.into_iter().map(|(hz, db)| (hz, db.max(bottom)));
        let (blue, orange) = (RGBColor(0, 90, 160), RGBColor(215, 95, 0));
        chart
            .draw_series(LineSeries::new(inside, blue.stroke_width(2)))
            .map_err(|e| failure(e.into()))?
            .label("response of the filter")
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], blue.stroke_width(2)));
        chart
            .draw_series(wanted.iter().map(|&point| Circle::new(point, 7, BLACK.stroke_width(2))))
            .map_err(|e| failure(e.into()))?
            .label("octave wanted")
            .legend(|(x, y)| Circle::new((x + 9, y), 6, BLACK.stroke_width(2)));
        chart
            .draw_series(realised.iter().map(|&point| Circle::new(point, 4, orange.filled())))
            .map_err(|e| failure(e.into()))?
            .label("octave realised")
            .legend(move |(x, y)| Circle::new((x + 9, y), 4, orange.filled()));
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerLeft)
            .background_style(WHITE.mix(0.9))
            .border_style(RGBColor(180, 180, 180))
            .draw()
            .map_err(|e| failure(e.into()))?;
        root.present().map_err(|e| failure(e.into()))?;
    }
    Ok(svg)
}

/// Writes every file under a temporary name, then gives each its own: a failure leaves none half-written.
fn write_all(files: &[(&Path, &[u8])]) -> Result<(), Failure> {
    let temporary = |path: &Path| {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.tmp", std::process::id()));
        path.with_file_name(name)
    };
    let failed = |path: &Path, source: std::io::Error| {
        for (path, _) in files {
            // What is not there need not be removed.
            let _ = std::fs::remove_file(temporary(path));
        }
        Failure::Write { path: path.to_owned(), source }
    };
    for (path, bytes) in files {
        std::fs::write(temporary(path), bytes).map_err(|source| failed(path, source))?;
    }
    for (path, _) in files {
        std::fs::rename(temporary(path), path).map_err(|source| failed(path, source))?;
    }
    Ok(())
}
