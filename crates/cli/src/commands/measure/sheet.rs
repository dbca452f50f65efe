//! A sheet in the form of ISO 3382-2: reverberation times of a room on one page, to print.

use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use crate::page::escape;
use clap::Args;
use sabine::acoustics::{PerBand, Reading, RoomParameters, SpatialMean};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Highest volume (m3) and number of lines of remarks that a sheet takes.
const MAX_VOLUME_M3: f64 = 1e7;
const MAX_REMARKS: usize = 8;
/// Most files that the sheet lists by name, and most bands with which it lists them: more would not fit on one page.
const MAX_LISTED: usize = 12;
const MAX_LISTED_BANDS: usize = 10;
/// Bandwidth of an octave and of a third octave as a share of their centre, and the number of decays that an integrated impulse
/// response stands for (ISO 3382-2:2008, 7.1 and 7.2).
const BANDWIDTH: [f64; 2] = [0.71, 0.23];
const DECAYS: f64 = 10.0;

// Colours of print; A4 with margins of 12 mm.
const STYLE: &str = "@page{size:A4;margin:12mm}*{box-sizing:border-box}body{font:10pt/1.35 system-ui,sans-serif;color:#111;background:#fff;margin:0 auto;max-width:186mm;padding:6mm}\
@media print{body{padding:0}}h1{font-size:15pt;margin:0 0 2mm}h2{font-size:10.5pt;margin:3.5mm 0 1mm}table{border-collapse:collapse;font-variant-numeric:tabular-nums;width:100%}\
th,td{border:.2mm solid #888;padding:.6mm 1.2mm;text-align:right}th:first-child,td:first-child{text-align:left}.facts td{border:0;text-align:left;padding:.3mm 2mm .3mm 0}.facts td:first-child{width:46mm;color:#444}\
.both{display:grid;grid-template-columns:88mm 1fr;gap:5mm;align-items:start}svg{width:100%;height:auto}p{margin:1mm 0}.small{font-size:8.5pt;color:#333}";

/// Options of the sheet.
#[derive(Args)]
pub struct SheetArguments {
    /// Write a sheet in the form of ISO 3382-2, which prints on one page
    #[arg(long, value_name = "F.html")]
    pub sheet: Option<PathBuf>,
    /// Name of the room, for the sheet
    #[arg(long, value_name = "TEXT", requires = "sheet")]
    room_name: Option<String>,
    /// Volume of the room in m3, for the sheet
    #[arg(long, value_name = "M3", requires = "sheet")]
    volume: Option<f64>,
    /// Positions of the source, for the sheet
    #[arg(long, value_name = "N", requires = "sheet")]
    source_positions: Option<usize>,
    /// A line of the sheet, as "Measured by: A. Weiss"; repeatable: who, when, equipment, state of the room, temperature, humidity
    #[arg(long, value_name = "NAME: TEXT", requires = "sheet")]
    remark: Vec<String>,
}

impl SheetArguments {
    /// Refuses what no sheet can show, before anything is measured.
    ///
    /// # Errors
    /// A volume out of range, a remark without a name, or too many of them.
    pub fn check(&self) -> Result<(), Failure> {
        if let Some(volume) = self.volume.filter(|volume| !(*volume > 0.0 && *volume <= MAX_VOLUME_M3)) {
            return Err(format!(
                "--volume is {volume}; it must be more than 0 and at most {MAX_VOLUME_M3} m3"
            )
            .into());
        }
        if self.remark.len() > MAX_REMARKS {
            return Err(format!("--remark: {} lines; one page takes {MAX_REMARKS}", self.remark.len()).into());
        }
        match self
            .remark
            .iter()
            .find(|text| text.split_once(':').is_none_or(|(name, _)| name.trim().is_empty()))
        {
            Some(text) => {
                Err(format!("--remark {text}: write NAME: TEXT, as \"Measured by: A. Weiss\"").into())
            }
            None => Ok(()),
        }
    }

    /// The page.
    ///
    /// # Errors
    /// A chart cannot be drawn.
    pub fn html(&self, files: &[PathBuf], rooms: &[RoomParameters]) -> Result<String, Failure> {
        let of = |pick: fn(&RoomParameters) -> &PerBand<Reading>| {
            SpatialMean::over(&rooms.iter().map(|room| pick(room).clone()).collect::<Vec<_>>())
        };
        let (t20, t30) = (of(|room| &room.t20_s)?, of(|room| &room.t30_s)?);
        let title = self.room_name.as_deref().unwrap_or("Room");
        let mut body = format!("<h1>Reverberation time after ISO 3382-2: {}</h1>\n", escape(title));
        body.push_str(&self.facts(rooms.len()));
        let _ = write!(
            body,
            "<h2>Mean over {} positions</h2>\n<div class=\"both\">{}{}</div>\n",
            rooms.len(),
            table(&t20, &t30),
            chart(&t20, &t30)?
        );
        if t20.mean.bands().len() <= MAX_LISTED_BANDS {
            body.push_str(&positions(files, rooms));
        }
        body.push_str(
            "<p class=\"small\">Integrated impulse response method. T20 from -5 to -25 dB, T30 from -5 to -35 dB, least squares; noise subtracted. ± is the standard deviation of the mean over positions; \
             u is what is expected of the signal's own chance (ISO 3382-2, equations 1 and 2, with N positions and n = 10). A dash: the decay does not reach far enough above the noise.</p>\n",
        );
        let head = format!(
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{}</title><style>{STYLE}</style></head><body>\n",
            escape(title)
        );
        Ok(head + &body + "</body></html>\n")
    }

    fn facts(&self, positions: usize) -> String {
        let unstated = || "not stated".to_owned();
        let mut rows = vec![
            ("Volume".to_owned(), self.volume.map_or_else(unstated, |volume| format!("{volume} m³"))),
            ("Source positions".to_owned(), self.source_positions.map_or_else(unstated, |n| n.to_string())),
            ("Measured responses".to_owned(), positions.to_string()),
        ];
        let remarks = self.remark.iter().filter_map(|text| text.split_once(':'));
        rows.extend(remarks.map(|(name, text)| (name.trim().to_owned(), text.trim().to_owned())));
        let row = |(name, text): &(String, String)| {
            format!("<tr><td>{}</td><td>{}</td></tr>", escape(name), escape(text))
        };
        format!("<table class=\"facts\">{}</table>\n", rows.iter().map(row).collect::<String>())
    }
}

/// A row for each band: means, their errors, and the error that chance makes.
fn table(t20: &SpatialMean, t30: &SpatialMean) -> String {
    let mut html = String::from(
        "<table><tr><th>Hz</th><th>T20 (s)</th><th>±</th><th>u</th><th>T30 (s)</th><th>±</th><th>u</th></tr>",
    );
    let bands = t20.mean.bands();
    let octaves = bands.len() < 2 || bands.exact_hz(1) / bands.exact_hz(0) > 1.5;
    let bandwidth = BANDWIDTH[usize::from(!octaves)];
    for (i, hz) in bands.iter_hz().enumerate() {
        let _ = write!(html, "<tr><td>{hz}</td>");
        for (mean, range) in [(t20, (0.88, 1.90)), (t30, (0.55, 1.52))] {
            match &mean.mean.values()[i] {
                Ok(estimate) => {
                    let count = mean.positions.values()[i] as f64;
                    let u = chance(range, estimate.value, bandwidth * hz, count);
                    let _ = write!(
                        html,
                        "<td>{:.2}</td><td>{:.2}</td><td>{u:.2}</td>",
                        estimate.value, estimate.standard_error
                    );
                }
                Err(_) => html.push_str("<td>-</td><td></td><td></td>"),
            }
        }
        html.push_str("</tr>");
    }
    html + "</table>"
}

/// Standard deviation that the excitation's chance leaves in a mean time (ISO 3382-2:2008, equations 1 and 2).
fn chance((factor, decays): (f64, f64), time_s: f64, bandwidth_hz: f64, positions: f64) -> f64 {
    factor * time_s * ((1.0 + decays / DECAYS) / (positions * bandwidth_hz * time_s)).sqrt()
}

fn chart(t20: &SpatialMean, t30: &SpatialMean) -> Result<String, Failure> {
    let points = |mean: &SpatialMean| -> Vec<(f64, f64)> {
        mean.mean.iter().filter_map(|(hz, reading)| reading.as_ref().ok().map(|e| (hz, e.value))).collect()
    };
    let (short, long) = (points(t20), points(t30));
    let most = short.iter().chain(&long).fold(0.0f64, |most, point| most.max(point.1));
    let chart = Chart {
        x_label: "Frequency (Hz)".to_owned(),
        y_label: "Reverberation time (s)".to_owned(),
        x: Scale::Octaves(t20.mean.bands().iter_hz().collect()),
        y: Some((0.0, if most > 0.0 { 1.15 * most } else { 1.0 })),
        series: vec![Series::new("T30", Look::Line, 5, long), Series::new("T20", Look::Dashed, 1, short)],
        small: false,
    };
    chart.plain_svg()
}

/// T20 of each position, so that one that differs is seen; the first ones where there are many.
fn positions(files: &[PathBuf], rooms: &[RoomParameters]) -> String {
    let mut html = String::from("<h2>T20 of each position (s)</h2>\n<table><tr><th>File</th>");
    for hz in rooms.first().into_iter().flat_map(|room| room.bands().iter_hz()) {
        let _ = write!(html, "<th>{hz}</th>");
    }
    html.push_str("</tr>");
    for (path, room) in files.iter().zip(rooms).take(MAX_LISTED) {
        let name = path.file_name().unwrap_or(Path::new("response").as_os_str()).to_string_lossy();
        let name: String = name.chars().take(28).collect();
        let _ = write!(html, "<tr><td>{}</td>", escape(&name));
        for reading in room.t20_s.values() {
            let text = reading.as_ref().map_or_else(|_| "-".to_owned(), |e| format!("{:.2}", e.value));
            let _ = write!(html, "<td>{text}</td>");
        }
        html.push_str("</tr>");
    }
    html.push_str("</table>\n");
    if rooms.len() > MAX_LISTED {
        let _ = writeln!(
            html,
            "<p class=\"small\">and {} more, which count in the means</p>",
            rooms.len() - MAX_LISTED
        );
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chance_is_that_of_the_standard() {
        // 1 s at 100 Hz in a third octave, one position: 0.88 sqrt(1.19 / 23), 0.55 sqrt(1.152 / 23).
        assert!((chance((0.88, 1.90), 1.0, 23.0, 1.0) - 0.20017).abs() < 1e-4);
        assert!((chance((0.55, 1.52), 1.0, 23.0, 1.0) - 0.12309).abs() < 1e-4);
        // Four positions halve it.
        let four = chance((0.88, 1.90), 1.0, 23.0, 4.0);
        assert!((four - 0.10008).abs() < 1e-4);
    }
}
