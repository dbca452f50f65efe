//! The page: what the other material changes, to be listened to and looked at.

use super::{Row, Summary};
use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use crate::page::Page;
use sabine::acoustics::{SampleFormat, Signal, encode_wav};

/// 1.645 standard errors either side: a 90 % interval.
const NORMAL_90: f64 = 1.645;

/// The dry voice and what becomes of it.
pub struct Voices<'a> {
    /// The name of the dry recording.
    pub name: &'a str,
    /// As it was recorded.
    pub dry: &'a Signal,
    /// In the room as it is; as loud against `after` as it would be.
    pub before: &'a Signal,
    /// In the room with the other material.
    pub after: &'a Signal,
}

/// The report as one HTML file.
pub fn html(summary: &Summary, room_name: &str, voices: &Voices<'_>) -> Result<String, Failure> {
    let mut page = Page::new(&format!("{} replaced by {}", summary.material, summary.replaced_by));
    page.paragraph(&format!("Room: {room_name}. {}", summary.sentence()));
    page.heading("Listen");
    page.paragraph("Before and after have the same scale: what is softer here, is softer there.");
    page.markup("<div class=\"small\">");
    for (sound, caption) in [
        (voices.dry, format!("The dry voice ({})", voices.name)),
        (voices.before, format!("In the room as it is ({})", summary.material)),
        (voices.after, format!("In the room with {}", summary.replaced_by)),
    ] {
        page.markup("<section>");
        page.player(&encode_wav(sound, SampleFormat::Int16)?, &caption);
        page.markup("</section>");
    }
    page.markup("</div><div class=\"grid\">");
    for row in &summary.rows {
        page.markup("<section>").heading(row.title());
        page.markup(&chart(&summary.bands_hz, row).svg()?).markup("</section>");
    }
    page.markup("</div>").heading("In numbers");
    page.paragraph("Each value with its standard error from the rays.");
    let mut table = vec![vec!["Quantity".to_owned()]];
    table[0].extend(summary.bands_hz.iter().map(|hz| format!("{hz} Hz")));
    for row in &summary.rows {
        for (name, values, errors) in [
            ("before", &row.before, &row.before_se),
            ("after", &row.after, &row.after_se),
            ("difference", &row.difference, &row.difference_se),
        ] {
            let mut cells = vec![format!("{} {name}", row.quantity)];
            cells.extend(values.iter().zip(errors).map(|pair| match pair {
                (Some(value), Some(error)) => format!("{value:.2} ± {error:.2}"),
                _ => "-".to_owned(),
            }));
            table.push(cells);
        }
    }
    page.table(&table);
    Ok(page.html())
}

fn chart(bands_hz: &[f64], row: &Row) -> Chart {
    let series = |name: &str, colour, values: &[Option<f64>], errors: &[Option<f64>]| {
        let points = bands_hz.iter().zip(values).map(|(&hz, v)| (hz, v.unwrap_or(f64::NAN))).collect();
        let mut series = Series::new(name, Look::Dots, colour, points);
        series.half_widths = errors.iter().map(|e| [NORMAL_90 * e.unwrap_or(0.0); 2].into()).collect();
        series
    };
    Chart {
        x_label: "Octave (Hz)".into(),
        y_label: row.axis().into(),
        x: Scale::Octaves(bands_hz.to_vec()),
        y: None,
        series: vec![
            series("before", 0, &row.before, &row.before_se),
            series("after", 1, &row.after, &row.after_se),
        ],
        small: false,
    }
}
