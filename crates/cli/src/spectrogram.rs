//! A picture of a sound: time to the right, frequency upward.

use sabine::acoustics::{Signal, resample};
use sabine::features::Stft;
use std::error::Error;

/// Highest frequency shown is 8 kHz.
const RATE_HZ: u32 = 16_000;
/// Levels from this far below the loudest point are shown, in dB.
const RANGE_DB: f32 = 70.0;
/// Window of 32 ms.
const WINDOW: usize = 512;
/// Widest picture; longer sounds are thinned out.
const WIDEST: usize = 1000;
/// A few points of the colour map viridis (van der Walt and Smith 2015), dark to light: its lightness rises evenly.
const VIRIDIS: [[f32; 3]; 6] = [
    [68.0, 1.0, 84.0],
    [65.0, 68.0, 135.0],
    [42.0, 120.0, 142.0],
    [34.0, 168.0, 132.0],
    [122.0, 209.0, 81.0],
    [253.0, 231.0, 37.0],
];

/// The spectrogram of a sound from 0 to 8 kHz as PNG, 70 dB of range.
///
/// # Errors
/// For a sound shorter than one window, or that cannot be resampled.
pub fn spectrogram_png(sound: &Signal) -> Result<Vec<u8>, Box<dyn Error + Send + Sync>> {
    let sound = resample(sound, RATE_HZ)?;
    let hop = (sound.samples().len() / WIDEST).clamp(WINDOW / 4, WINDOW);
    let spectra = Stft::new(WINDOW, hop)?.forward(sound.samples());
    let level_db = spectra.mapv(|c| 10.0 * (c.norm_sqr() + 1e-12).log10());
    // Beyond half a minute the windows that are shown no longer touch.
    let step = level_db.ncols().div_ceil(WIDEST);
    let (bins, frames) = (level_db.nrows(), level_db.ncols().div_ceil(step));
    let loudest_db = level_db.iter().copied().fold(f32::MIN, f32::max);
    let mut pixels = Vec::with_capacity(3 * bins * frames);
    for bin in (0..bins).rev() {
        for frame in 0..frames {
            let share = (1.0 + (level_db[[bin, frame * step]] - loudest_db) / RANGE_DB).clamp(0.0, 1.0);
            let position = share * (VIRIDIS.len() - 1) as f32;
            let below = (position as usize).min(VIRIDIS.len() - 2);
            let part = position - below as f32;
            let mix = |c: usize| VIRIDIS[below][c] * (1.0 - part) + VIRIDIS[below + 1][c] * part;
            pixels.extend((0..3).map(|c| mix(c) as u8));
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, frames as u32, bins as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(bytes)
}
