//! What the uncertainty of a model leaves open in a rendered decay: a band of curves over draws from it.

use crate::bar::Bar;
use crate::chart::{Chart, Look, Scale, Series, chart_sheet};
use crate::failure::Failure;
use sabine::acoustics::{EnergyDecayCurve, FilterBank, ImpulseResponse, report};
use sabine::diagnose::ExtendedModel;
use sabine::paths::Propagator;
use sabine::propagate::{PathTracer, PressureRenderer, TracerConfig};
use sabine::scene::MeasuredRoom;
use serde_json::{Value, json};
use std::fmt::Write;

/// Step of the curves in seconds.
const STEP_S: f64 = 0.01;
/// Lower end of the chart, in dB.
const FLOOR_DB: f64 = -60.0;

/// What is drawn and rendered: a model of a room, one of its pairs (indices), and how. Waves are not joined to the paths.
pub struct Drawing<'a> {
    pub model: &'a ExtendedModel,
    pub room: &'a MeasuredRoom,
    pub pair: (usize, usize),
    pub tracer: TracerConfig,
    pub renderer: &'a PressureRenderer,
    pub seed: u64,
}

/// Decay curves and reverberation times of all draws.
pub struct Draws {
    bands_hz: Vec<f64>,
    /// `[band][draw]`: level in dB at each step.
    levels_db: Vec<Vec<Vec<f64>>>,
    /// `[band]`: T30 of the draws in which it can be read, in seconds, rising.
    t30_s: Vec<Vec<f64>>,
    count: usize,
}

impl Drawing<'_> {
    /// Renders so many draws, each in a room of its own; the rays and the noise are the same in all.
    ///
    /// # Errors
    /// As drawing, tracing and rendering.
    pub fn render(&self, count: usize, bar: &Bar) -> Result<Draws, Failure> {
        let bands = self.room.bands();
        let mut draws = Draws {
            bands_hz: bands.iter_hz().collect(),
            levels_db: vec![Vec::new(); bands.len()],
            t30_s: vec![Vec::new(); bands.len()],
            count,
        };
        for (done, model) in self.model.draws(count, self.seed)?.iter().enumerate() {
            report(bar, "draws", done as u64, count as u64)?;
            let response = self.response(model)?;
            let rate_hz = response.sample_rate_hz();
            let split = FilterBank::new(bands, rate_hz)?.analyse(response.samples());
            for (band, samples) in split.values().iter().enumerate() {
                let energy: Vec<f64> = samples.iter().map(|&s| f64::from(s).powi(2)).collect();
                let curve = EnergyDecayCurve::from_energy(&energy, 1.0 / f64::from(rate_hz));
                draws.t30_s[band].extend(curve.decay_time_s(-5.0, -35.0));
                let step = (STEP_S * f64::from(rate_hz)) as usize;
                draws.levels_db[band].push(curve.level_db().into_iter().step_by(step).collect());
            }
        }
        draws.t30_s.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
        Ok(draws)
    }

    fn response(&self, model: &ExtendedModel) -> Result<ImpulseResponse, Failure> {
        let (from, to) = self.pair;
        let extended = model.room(self.room)?;
        let (source, receiver) = (&extended.sources[from], &extended.receivers[to]);
        let materials: Vec<_> =
            extended.scene.materials().iter().map(|named| named.material.clone()).collect();
        let paths = PathTracer::new(self.tracer.clone())?.trace(
            &extended.scene,
            source,
            receiver,
            &extended.air,
            &(),
        )?;
        let response = self.renderer.render(&paths, &extended.conditions(&materials, from, to))?;
        Ok(extended.finish(&source.id, &receiver.id, response, self.tracer.seed)?)
    }
}

impl Draws {
    /// 5, 50 and 95 % of the curves of a band at each step, as far as all of them go.
    fn band(&self, band: usize) -> Vec<[f64; 3]> {
        let curves = &self.levels_db[band];
        let steps = curves.iter().map(Vec::len).min().unwrap_or(0);
        (0..steps)
            .map(|step| {
                let mut levels: Vec<f64> = curves.iter().map(|curve| curve[step]).collect();
                levels.sort_by(f64::total_cmp);
                quantiles(&levels)
            })
            .collect()
    }

    /// T30 in the octaves where every draw lets it be read.
    pub fn as_json(&self) -> Value {
        let t30 = |times: &Vec<f64>| match times.len() == self.count {
            true => json!(quantiles(times)),
            false => Value::Null,
        };
        json!({ "count": self.count, "t30_s_5_50_95": self.t30_s.iter().map(t30).collect::<Vec<_>>() })
    }

    /// The curves as a table: time, and three columns for each octave.
    pub fn csv(&self) -> String {
        let bands: Vec<Vec<[f64; 3]>> = (0..self.bands_hz.len()).map(|band| self.band(band)).collect();
        let mut text = "time_s".to_owned();
        for hz in &self.bands_hz {
            let _ = write!(text, ",low_db_{hz},median_db_{hz},high_db_{hz}");
        }
        text.push('\n');
        let steps = bands.iter().map(Vec::len).min().unwrap_or(0);
        for step in 0..steps {
            let _ = write!(text, "{:.2}", step as f64 * STEP_S);
            for [low, median, high] in bands.iter().map(|band| band[step]) {
                let _ = write!(text, ",{low:.2},{median:.2},{high:.2}");
            }
            text.push('\n');
        }
        text
    }

    /// The curves as charts, an octave each.
    pub fn svg(&self) -> Result<String, Failure> {
        let one = |(band, hz): (usize, &f64)| {
            let levels = self.band(band);
            let end = levels.iter().position(|l| l[2] < FLOOR_DB).unwrap_or(levels.len());
            let line = |name: &str, look: Look, k: usize| {
                let point = |(i, l): (usize, &[f64; 3])| (i as f64 * STEP_S, l[k].max(FLOOR_DB));
                Series::new(name, look, 0, levels[..end].iter().enumerate().map(point).collect())
            };
            let chart = Chart {
                x_label: "time in s".into(),
                y_label: "decay curve in dB".into(),
                x: Scale::Linear(0.0, end.max(1) as f64 * STEP_S),
                y: Some((FLOOR_DB, 0.0)),
                series: vec![
                    line("median", Look::Line, 1),
                    line("5 % and 95 %", Look::Dashed, 0),
                    Series { in_legend: false, ..line("95 %", Look::Dashed, 2) },
                ],
                small: false,
            };
            (format!("{hz} Hz"), chart)
        };
        let charts: Vec<(String, Chart)> = self.bands_hz.iter().enumerate().map(one).collect();
        chart_sheet(&charts)
    }

    /// T30 of the draws in the octave of 1 kHz or next to it, in one line.
    pub fn line(&self) -> String {
        let distance = |hz: f64| (hz / 1000.0).ln().abs();
        let near = (0..self.bands_hz.len())
            .min_by(|&a, &b| distance(self.bands_hz[a]).total_cmp(&distance(self.bands_hz[b])));
        let told = near.filter(|&band| self.t30_s[band].len() == self.count);
        match told.map(|band| (self.bands_hz[band], quantiles(&self.t30_s[band]))) {
            Some((hz, [low, median, high])) => format!(
                "{} draws from the model: T30 at {hz} Hz {median:.3} s, 90 % from {low:.3} to {high:.3}",
                self.count
            ),
            None => {
                format!("{} draws from the model: T30 near 1 kHz cannot be read in all of them", self.count)
            }
        }
    }
}

/// 5, 50 and 95 % of rising values, the nearest of them.
fn quantiles(rising: &[f64]) -> [f64; 3] {
    [0.05, 0.5, 0.95].map(|share| {
        let last = rising.len().saturating_sub(1) as f64;
        rising.get((share * last).round() as usize).copied().unwrap_or(f64::NAN)
    })
}
