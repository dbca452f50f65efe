//! Residuals over time and octave as a picture: orange where the measurement is louder, blue where the simulation is.

use crate::failure::Failure;
use crate::page::escape;
use base64::Engine;
use sabine::diagnose::ResidualCell;
use std::fmt::Write;

/// Colour-blind people tell these apart (Okabe and Ito 2008); between them the page shines through, be it light or dark.
const LOUDER: [u8; 3] = [226, 106, 0];
const QUIETER: [u8; 3] = [30, 125, 205];
/// What was not compared.
const NOTHING: [u8; 4] = [128, 128, 128, 70];
/// Columns of the picture.
const COLUMNS: usize = 160;
/// Where the picture lies in the drawing.
const LEFT: f64 = 52.0;
const WIDTH: f64 = 422.0;
const ROW: f64 = 20.0;

/// The cells of one map and the scale that they share with others.
pub struct ResidualMap<'a> {
    pub cells: Vec<&'a ResidualCell>,
    pub bands_hz: &'a [f64],
    /// Residual of full colour, in dB.
    pub full_db: f64,
    /// End of the time axis, in seconds after the direct sound.
    pub end_s: f64,
    /// Whether the causes are at work.
    pub after: bool,
}

impl ResidualMap<'_> {
    /// The map with its axes, as one `<svg>` element.
    pub fn svg(&self, title: &str) -> Result<String, Failure> {
        let height = ROW * self.bands_hz.len() as f64;
        let png = base64::engine::general_purpose::STANDARD.encode(self.png()?);
        let title = escape(title);
        let mut svg = format!(
            "<svg class=\"map\" role=\"img\" aria-label=\"{title}\" viewBox=\"0 0 480 {}\"><image x=\"{LEFT}\" y=\"2\" width=\"{WIDTH}\" height=\"{height}\" preserveAspectRatio=\"none\" style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{png}\"/><rect x=\"{LEFT}\" y=\"2\" width=\"{WIDTH}\" height=\"{height}\" fill=\"none\" stroke=\"currentColor\" stroke-opacity=\".4\"/>",
            height + 26.0
        );
        for (row, hz) in self.bands_hz.iter().rev().enumerate() {
            let label = if *hz < 1000.0 { format!("{hz}") } else { format!("{}k", hz / 1000.0) };
            let y = 2.0 + ROW * (row as f64 + 0.5) + 5.5;
            let _ = write!(svg, "<text x=\"{}\" y=\"{y}\" text-anchor=\"end\">{label}</text>", LEFT - 6.0);
        }
        let step_s =
            [0.02, 0.05, 0.1, 0.2, 0.5, 1.0].into_iter().find(|s| self.end_s / s <= 6.0).unwrap_or(2.0);
        let mut tick = 0;
        while f64::from(tick) * step_s <= self.end_s + 1e-9 {
            let time_s = f64::from(tick) * step_s;
            let x = LEFT + WIDTH * time_s / self.end_s;
            let anchor = if x > LEFT + WIDTH - 12.0 { "end" } else { "middle" };
            let unit = if tick == 0 { " s" } else { "" };
            let label = format!("{:.*}", usize::from(step_s < 0.1) + 1, time_s);
            let label = if tick == 0 { "0".to_owned() } else { label };
            let _ = write!(
                svg,
                "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"{anchor}\">{label}{unit}</text>",
                height + 20.0
            );
            tick += 1;
        }
        svg.push_str("</svg>");
        Ok(svg)
    }

    /// One pixel for each octave and stretch of time, the highest octave above.
    fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut pixels = Vec::with_capacity(4 * COLUMNS * self.bands_hz.len());
        for &hz in self.bands_hz.iter().rev() {
            let mut row: Vec<&ResidualCell> =
                self.cells.iter().filter(|c| c.band_hz == hz).copied().collect();
            row.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            let width_s = row.windows(2).map(|w| w[1].time_s - w[0].time_s).fold(f64::INFINITY, f64::min);
            for column in 0..COLUMNS {
                let time_s = (column as f64 + 0.5) / COLUMNS as f64 * self.end_s;
                let near =
                    row.iter().min_by(|a, b| (a.time_s - time_s).abs().total_cmp(&(b.time_s - time_s).abs()));
                let here = near.filter(|c| (c.time_s - time_s).abs() <= 0.5 * width_s + 1e-9);
                pixels.extend(here.map_or(NOTHING, |cell| self.colour(cell)));
            }
        }
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, COLUMNS as u32, self.bands_hz.len() as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.write_header()?.write_image_data(&pixels)?;
        Ok(bytes)
    }

    fn colour(&self, cell: &ResidualCell) -> [u8; 4] {
        let residual_db = if self.after { cell.after_db } else { cell.before_db };
        if !residual_db.is_finite() {
            return NOTHING;
        }
        let [r, g, b] = if residual_db > 0.0 { LOUDER } else { QUIETER };
        [r, g, b, (255.0 * (residual_db.abs() / self.full_db).min(1.0)) as u8]
    }
}

/// A round residual for full colour that few cells exceed, and the end of the time axis.
pub fn scale(cells: &[ResidualCell]) -> (f64, f64) {
    let mut sizes: Vec<f64> = cells
        .iter()
        .filter(|c| c.response.is_none())
        .map(|c| c.before_db.abs())
        .filter(|d| d.is_finite())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let most = sizes.get(sizes.len() * 19 / 20).copied().unwrap_or(0.0);
    let full_db = [2.0, 3.0, 6.0, 10.0, 20.0].into_iter().find(|d| *d >= most).unwrap_or(30.0);
    (full_db, cells.iter().map(|c| c.time_s).fold(0.02, f64::max) * 1.02)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_tell_the_sign_and_the_size() {
        let cell: ResidualCell = serde_json::from_str(
            r#"{"response": null, "band_hz": 500, "time_s": 0.05, "before_db": 6, "after_db": -1.5, "expected_sd_db": 1}"#,
        )
        .unwrap();
        let map =
            |after| ResidualMap { cells: vec![&cell], bands_hz: &[500.0], full_db: 3.0, end_s: 0.1, after };
        assert_eq!(map(false).colour(&cell), [226, 106, 0, 255]);
        assert_eq!(map(true).colour(&cell), [30, 125, 205, 127]);
        assert_eq!(scale(std::slice::from_ref(&cell)).0, 6.0);
    }
}
