//! Line charts as SVG: one style for all, readable in light and dark, with colours that the colour-blind can tell apart.

use crate::page::escape;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::fmt::Write;

/// Size of a chart in SVG units: it scales to its place on the page, and its text stays readable on a phone.
const SIZE: (u32, u32) = (480, 320);
/// Height of letters as plotters counts it, 1.24 times the size of the font: 11 pixels and more where a chart is as wide as a phone of
/// 390 pixels lets it be (352).
const TEXT: u32 = 19;
/// The same for small charts, which are drawn larger there.
const SMALL_TEXT: u32 = 16;
/// Size of one of several small charts side by side.
const SMALL: (u32, u32) = (320, 244);
/// Height of a row of the legend.
const LEGEND_ROW: i32 = 23;
/// Centres of bands that are told along an axis, at most.
const MOST_CENTRES: usize = 10;
/// Text and axes; a dark page turns it light.
const INK: RGBColor = RGBColor(34, 34, 34);
/// Grid lines.
const GRID: RGBColor = RGBColor(208, 208, 208);
/// Okabe and Ito 2008: distinguishable with any kind of colour vision.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
/// Chosen by attribute, so that the file keeps plain colours for viewers that know no style sheets.
const STYLE: &str = "<style>svg.chart text,svg.charts text{font-family:system-ui,sans-serif}\
@media (prefers-color-scheme: dark){svg.chart .paper,svg.charts .paper{fill:#161616}\
svg.chart [fill=\"#222222\"],svg.charts [fill=\"#222222\"]{fill:#e4e4e4}svg.chart [stroke=\"#222222\"]{stroke:#e4e4e4}\
svg.chart [stroke=\"#D0D0D0\"]{stroke:#444}\
svg.chart [fill=\"#0072B2\"]{fill:#4da3dc}svg.chart [stroke=\"#0072B2\"]{stroke:#4da3dc}\
svg.chart [fill=\"#D55E00\"]{fill:#ff8a3c}svg.chart [stroke=\"#D55E00\"]{stroke:#ff8a3c}}</style>";
/// Behind a chart that stands alone: white, or the dark of the pages.
const PAPER: &str = "<rect class=\"paper\" width=\"100%\" height=\"100%\" fill=\"white\"/>";

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// A line.
    Line,
    /// A broken line.
    Dashed,
    /// A line with a dot at each point, and error bars where there are any.
    Dots,
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in data units; NaN breaks the line.
    pub points: Vec<(f64, f64)>,
    /// How far an interval about each point reaches below and above it, or nothing.
    pub half_widths: Vec<(f64, f64)>,
    /// How it is drawn.
    pub look: Look,
    /// Which of the six colours.
    pub colour: usize,
    /// Whether the legend names it.
    pub in_legend: bool,
}

/// What the horizontal axis counts.
#[derive(Clone, Debug)]
pub enum Scale {
    /// A quantity, from and to.
    Linear(f64, f64),
    /// Frequencies in Hz on a logarithmic axis, a tick at each: points are given in Hz.
    Octaves(Vec<f64>),
}

/// A chart, ready to be drawn.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What the horizontal axis shows, with its unit.
    pub x_label: String,
    /// What the vertical axis shows, with its unit.
    pub y_label: String,
    /// Horizontal axis.
    pub x: Scale,
    /// Vertical range; `None` fits the points and zero.
    pub y: Option<(f64, f64)>,
    /// What is drawn, in the order of the legend.
    pub series: Vec<Series>,
    /// Whether it is one of several small charts.
    pub small: bool,
}

impl Series {
    /// A series without intervals.
    pub fn new(name: impl Into<String>, look: Look, colour: usize, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, half_widths: Vec::new(), look, colour, in_legend: true }
    }
}

impl Chart {
    /// The chart as one `<svg>` element without a fixed size, for a page: it follows the page into dark mode.
    ///
    /// # Errors
    /// What plotters reports; drawing into memory does not fail by itself.
    pub fn svg(&self) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
        self.with_opening(STYLE)
    }

    /// The chart on its own paper, for a file of its own: white, dark where the viewer prefers that.
    ///
    /// # Errors
    /// As [`Chart::svg`].
    pub fn plain_svg(&self) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
        self.with_opening(&format!("{STYLE}{PAPER}"))
    }

    fn with_opening(&self, opening: &str) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
        let mut text = String::new();
        let size = if self.small { SMALL } else { SIZE };
        {
            let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
            self.draw(&root).map_err(|e| e.to_string())?;
            root.present().map_err(|e| e.to_string())?;
        }
        let sized = format!("<svg width=\"{}\" height=\"{}\"", size.0, size.1);
        let label = escape(&format!("{} over {}", self.y_label, self.x_label));
        let opened = format!("<svg class=\"chart\" role=\"img\" aria-label=\"{label}\"");
        let text = text.replacen(&sized, &opened, 1);
        Ok(match text.find('>') {
            Some(end) => format!("{}{opening}{}", &text[..=end], &text[end + 1..]),
            None => text,
        })
    }

    fn text(&self) -> u32 {
        if self.small { SMALL_TEXT } else { TEXT }
    }

    fn position(&self, x: f64) -> f64 {
        if matches!(self.x, Scale::Octaves(_)) { x.log2() } else { x }
    }

    fn x_range(&self) -> (f64, f64) {
        match &self.x {
            Scale::Linear(from, to) => (*from, *to),
            Scale::Octaves(centres) => {
                let log = |hz: Option<&f64>| hz.copied().unwrap_or(1000.0).log2();
                (log(centres.first()) - 0.35, log(centres.last()) + 0.35)
            }
        }
    }

    fn y_range(&self) -> (f64, f64) {
        if let Some(range) = self.y {
            return range;
        }
        let (mut low, mut high) = (0.0f64, 0.0f64);
        for series in &self.series {
            for (i, &(_, y)) in series.points.iter().enumerate() {
                let (below, above) = series.half_widths.get(i).copied().unwrap_or_default();
                if (y - below).is_finite() && (y + above).is_finite() {
                    low = low.min(y - below);
                    high = high.max(y + above);
                }
            }
        }
        let margin = 0.05 * (high - low).max(1e-9);
        (if low < 0.0 { low - margin } else { 0.0 }, if high > 0.0 { high + margin } else { 0.0 })
    }

    /// Left edge and row of each entry of the legend, wrapped at the width of the chart.
    fn legend_places(&self, width: i32) -> Vec<(i32, i32)> {
        let start = if self.small { 46 } else { 68 };
        let (mut left, mut row) = (start, 0);
        self.series
            .iter()
            .filter(|s| s.in_legend)
            .map(|series| {
                // Letters are about half as wide as high.
                let needed = 40 + self.text() as i32 * series.name.chars().count() as i32 / 2;
                if left > start && left + needed > width {
                    (left, row) = (start, row + 1);
                }
                left += needed;
                (left - needed, row)
            })
            .collect()
    }

    fn draw<B: DrawingBackend>(
        &self,
        root: &DrawingArea<B, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        let ink = |size: u32| ("sans-serif", size).into_font().color(&INK);
        let entries = self.legend_places(root.dim_in_pixel().0 as i32);
        let rows = entries.last().map_or(0, |&(_, row)| row + 1);
        let legend_height = rows * LEGEND_ROW + 6;
        let (legend, body) = root.split_vertically(legend_height);
        for (series, (left, row)) in self.series.iter().filter(|s| s.in_legend).zip(entries) {
            let colour = COLOURS[series.colour % COLOURS.len()];
            let middle = row * LEGEND_ROW + LEGEND_ROW / 2;
            let dashes: &[(i32, i32)] =
                if series.look == Look::Dashed { &[(0, 7), (11, 18)] } else { &[(0, 18)] };
            for &(from, to) in dashes {
                let stroke = vec![(left + from, middle), (left + to, middle)];
                legend.draw(&PathElement::new(stroke, colour.stroke_width(3)))?;
            }
            legend.draw(&Text::new(
                series.name.clone(),
                (left + 24, middle - self.text() as i32 / 2),
                ink(self.text()),
            ))?;
        }

        let (x0, x1) = self.x_range();
        let (y0, y1) = self.y_range();
        let mut chart = ChartBuilder::on(&body)
            .margin_right(14)
            // plotters places the label by the capitals of one font; in others it rises higher.
            .margin_left(if self.y_label.is_empty() { 0 } else { 6 })
            .x_label_area_size(if self.x_label.is_empty() { 26 } else { 54 })
            .y_label_area_size(if self.y_label.is_empty() { 46 } else { 68 })
            .build_cartesian_2d(x0..x1, y0..y1)?;
        let octaves = matches!(self.x, Scale::Octaves(_));
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .axis_desc_style(ink(self.text()))
            .label_style(ink(self.text()))
            .axis_style(INK)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .y_labels(if self.small { 4 } else { 7 });
        if octaves { mesh.x_labels(0).disable_x_mesh() } else { mesh.x_labels(8) }.draw()?;
        if let Scale::Octaves(centres) = &self.x {
            // plotters places its own ticks on a linear axis; octaves want one at each centre.
            let plot = chart.plotting_area();
            // Third octaves would crowd each other: about one in an octave is told.
            let every = centres.len().div_ceil(MOST_CENTRES) * if self.small { 2 } else { 1 };
            for &hz in centres.iter().step_by(every) {
                let x = hz.log2();
                plot.draw(&PathElement::new(vec![(x, y0), (x, y1)], GRID))?;
                let (pixel, bottom) = plot.map_coordinate(&(x, y0));
                let label = if hz < 1000.0 { format!("{hz}") } else { format!("{}k", hz / 1000.0) };
                let shift = (self.text() * label.len() as u32 / 4) as i32;
                body.draw(&Text::new(label, (pixel - shift, bottom + 5 - legend_height), ink(self.text())))?;
            }
        }
        for series in &self.series {
            let colour = COLOURS[series.colour % COLOURS.len()];
            for run in series.points.split(|(x, y)| !(x.is_finite() && y.is_finite())) {
                let run: Vec<(f64, f64)> =
                    run.iter().map(|&(x, y)| (self.position(x), y.clamp(y0, y1))).collect();
                if series.look == Look::Dashed {
                    chart.draw_series(DashedLineSeries::new(run, 7, 5, colour.stroke_width(2)))?;
                } else {
                    chart.draw_series(LineSeries::new(run, colour.stroke_width(2)))?;
                }
            }
            if series.look != Look::Dots {
                continue;
            }
            for (i, &(x, y)) in series.points.iter().enumerate() {
                if !y.is_finite() {
                    continue;
                }
                let x = self.position(x);
                chart.draw_series([Circle::new((x, y.clamp(y0, y1)), 4, colour.filled())])?;
                let drawn = |h: &&(f64, f64)| (h.0 + h.1).is_finite() && h.0 + h.1 > 0.0;
                if let Some(&(below, above)) = series.half_widths.get(i).filter(drawn) {
                    let ends = [(y - below).clamp(y0, y1), (y + above).clamp(y0, y1)];
                    chart.draw_series([PathElement::new(
                        ends.map(|e| (x, e)).to_vec(),
                        colour.stroke_width(1),
                    )])?;
                }
            }
        }
        Ok(())
    }
}

/// Charts with a title each, side by side in two columns, as one SVG file.
///
/// # Errors
/// As [`Chart::svg`].
pub fn chart_sheet(charts: &[(String, Chart)]) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
    let (cell, title) = ((SIZE.0 + 20, SIZE.1 + 42), 32);
    let rows = (charts.len() as u32).div_ceil(2);
    let mut sheet = format!(
        "<svg class=\"charts\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\">{STYLE}{PAPER}",
        2 * cell.0,
        rows * cell.1
    );
    for (i, (text, chart)) in (0u32..).zip(charts) {
        let (x, y) = (i % 2 * cell.0, i / 2 * cell.1);
        // Wide letters take six tenths of their height: a long title is set smaller rather than cut.
        let size = (f64::from(SIZE.0 - 62) / 0.6 / text.chars().count().max(1) as f64).min(16.0);
        let _ = write!(
            sheet,
            "<text x=\"{}\" y=\"{}\" font-size=\"{size:.1}\" fill=\"#222222\">{}</text>\
             <svg x=\"{x}\" y=\"{}\" width=\"{}\" height=\"{}\">{}</svg>",
            x + 62,
            y + 24,
            escape(text),
            y + title,
            SIZE.0,
            SIZE.1,
            // The style stands once, at the head.
            chart.with_opening("")?
        );
    }
    Ok(sheet + "</svg>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_eleven_pixels_high_on_a_phone() {
        // The page leaves a chart 352 of a phone's 390 pixels; both kinds stand one below the other there.
        for small in [false, true] {
            let chart = Chart {
                x_label: "Octave (Hz)".into(),
                y_label: "T30 (s)".into(),
                x: Scale::Octaves(vec![500.0, 1000.0]),
                y: Some((0.0, 1.0)),
                series: vec![Series::new("T30", Look::Dots, 0, vec![(500.0, 0.6), (1000.0, 0.5)])],
                small,
            };
            let svg = chart.svg().unwrap();
            let width = f64::from(if small { SMALL.0 } else { SIZE.0 });
            let sizes: Vec<f64> = svg
                .split("font-size=\"")
                .skip(1)
                .map(|rest| rest.split('"').next().unwrap().parse().unwrap())
                .collect();
            assert!(sizes.len() > 5, "{svg}");
            assert!(sizes.iter().all(|size| size * 352.0 / width >= 11.0), "{sizes:?}");
        }
    }
}
