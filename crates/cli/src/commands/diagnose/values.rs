//! Values of tables of parameters, as measured and as predicted.

use super::findings::Findings;
use super::words::hertz;
use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use crate::page::Page;
use sabine::acoustics::ParameterKind;
use sabine::diagnose::ComparedValue;

/// Values that lie farthest off, listed at most.
const MOST_ROWS: usize = 10;

/// The section on them: a curve of each parameter over the octaves, the mean over pairs, and the values that lie farthest off.
pub fn section(page: &mut Page, findings: &Findings) -> Result<(), Failure> {
    let all = &findings.values;
    if all.is_empty() {
        return Ok(());
    }
    let held = all.iter().any(|value| value.held_out);
    // Without a cause nothing comes after.
    let is_named = !findings.causes.is_empty();
    page.heading(if held { "Values at positions that were predicted" } else { "Values of the tables" });
    page.paragraph(
        "Means over all pairs; above each, how far single values lie off (root mean square) in steps that are just noticeable: 5 % of decay times, 1 dB of C50 and C80, 10 ms of Ts.",
    );
    page.markup("<div class=\"small\">");
    for kind in ParameterKind::ALL {
        let own: Vec<&ComparedValue> = all.iter().filter(|v| v.parameter == kind.symbol()).collect();
        if own.is_empty() {
            continue;
        }
        let chart = curves(kind, &own, (&findings.bands_hz, is_named)).svg()?;
        let off = |of: fn(&ComparedValue) -> f64| root_mean_square(own.iter().map(|v| of(v)));
        let before = off(|v| v.jnd_before);
        let told = if is_named {
            format!("{before:.1} JND off before, {:.1} after", off(|v| v.jnd_after))
        } else {
            format!("{before:.1} JND off")
        };
        page.markup(&format!("<figure><figcaption>{kind}: {told}</figcaption>{chart}</figure>"));
    }
    page.markup("</div>");
    farthest(page, all);
    Ok(())
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

fn curves(kind: ParameterKind, own: &[&ComparedValue], (bands_hz, is_named): (&[f64], bool)) -> Chart {
    let mean = |of: fn(&ComparedValue) -> f64| -> Vec<(f64, f64)> {
        let at = |&hz: &f64| {
            let here: Vec<f64> = own.iter().filter(|v| v.band_hz == hz).map(|v| of(v)).collect();
            (!here.is_empty()).then(|| (hz, here.iter().sum::<f64>() / here.len() as f64))
        };
        bands_hz.iter().filter_map(at).collect()
    };
    let unit = match kind {
        ParameterKind::C50 | ParameterKind::C80 => " (dB)",
        ParameterKind::D50 => "",
        _ => " (s)",
    };
    let simulated = if is_named { "before" } else { "simulated" };
    let mut series = vec![
        Series::new("measured", Look::Dots, 2, mean(|v| v.measured)),
        Series::new(simulated, Look::Dashed, 0, mean(|v| v.before)),
    ];
    if is_named {
        series.push(Series::new("after", Look::Line, 1, mean(|v| v.after)));
    }
    Chart {
        x_label: String::new(),
        y_label: format!("{kind}{unit}"),
        x: Scale::Octaves(bands_hz.to_vec()),
        y: None,
        series,
        small: true,
    }
}

fn farthest(page: &mut Page, all: &[ComparedValue]) {
    let mut sorted: Vec<&ComparedValue> = all.iter().collect();
    sorted.sort_by(|a, b| b.jnd_after.abs().total_cmp(&a.jnd_after.abs()));
    let head = ["Farthest off", "Octave", "", "Measured", "Predicted", "JND"].map(str::to_owned).to_vec();
    let row = |v: &&ComparedValue| {
        let digits = if v.parameter.starts_with('C') { 1 } else { 3 };
        vec![
            v.pair.clone(),
            hertz(v.band_hz),
            v.parameter.clone(),
            format!("{:.digits$}", v.measured),
            format!("{:.digits$}", v.after),
            format!("{:+.1}", v.jnd_after),
        ]
    };
    let rows: Vec<Vec<String>> =
        std::iter::once(head).chain(sorted.iter().take(MOST_ROWS).map(row)).collect();
    page.table(&rows);
}
