//! Tables and plots of the sweep.

use crate::{AnyError, Method, Point};
use sabine_cli::chart::{Chart, Look, Scale, Series};
use std::fmt::Write;

const METHODS: [(Method, &str); 4] = [
    (Method::Edc, "decay curve, verified"),
    (Method::EdcOnce, "decay curve, first rays"),
    (Method::Paper, "the paper's"),
    (Method::Li2018, "Li 2018"),
];

/// Errors in percent of the target, sorted; reachable targets only, and how many could not be read.
fn sorted_errors<'a>(
    points: impl Iterator<Item = &'a Point>,
    read: fn(&Point) -> Option<f64>,
) -> (Vec<f64>, usize) {
    let (mut errors, mut unread) = (Vec::new(), 0);
    for point in points.filter(|p| p.reachable) {
        match read(point) {
            Some(t) => errors.push(100.0 * (t / point.target_s - 1.0).abs()),
            None => unread += 1,
        }
    }
    errors.sort_by(f64::total_cmp);
    (errors, unread)
}

/// The value below which a share of the sorted values lies (nearest rank).
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or(f64::NAN)
}

/// Median, 95th percentile and maximum of the error of each method.
pub fn tables(points: &[Point]) -> String {
    let mut text = String::from(
        "| objective | read from | reachable | not read | median % | 95th percentile % | largest % |\n|---|---|---|---|---|---|---|\n",
    );
    type Reading = fn(&Point) -> Option<f64>;
    let readings: [(&str, Reading); 3] = [
        ("mean of responses", |p| p.mean_rendered_s),
        ("one response", |p| p.rendered_s),
        ("energy of other rays", |p| p.energy_s),
    ];
    let sure = (Method::Edc, "decay curve, where the fit has no doubt", true);
    for (method, name, sure) in METHODS.map(|(m, name)| (m, name, false)).into_iter().chain([sure]) {
        for (what, read) in readings {
            let mine = || points.iter().filter(move |p| p.method == method && !(sure && p.doubted));
            let (errors, unread) = sorted_errors(mine(), read);
            let percent = |value: f64| if value.is_nan() { "-".to_owned() } else { format!("{value:.2}") };
            let _ = writeln!(
                text,
                "| {name} | {what} | {} of {} | {unread} | {} | {} | {} |",
                mine().filter(|p| p.reachable).count(),
                mine().count(),
                percent(quantile(&errors, 0.5)),
                percent(quantile(&errors, 0.95)),
                percent(quantile(&errors, 1.0)),
            );
        }
    }
    text.push_str("\n| T60 wanted, s | median % | 95th percentile % | largest % |\n|---|---|---|---|\n");
    for target in targets(points) {
        let mine = points.iter().filter(|p| p.method == Method::Edc && p.target_s == target);
        let (errors, _) = sorted_errors(mine, |p| p.mean_rendered_s);
        let _ = writeln!(
            text,
            "| {target:.2} | {:.2} | {:.2} | {:.1} |",
            quantile(&errors, 0.5),
            quantile(&errors, 0.95),
            errors.last().copied().unwrap_or(f64::NAN)
        );
    }
    text
}

fn targets(points: &[Point]) -> Vec<f64> {
    let mut targets: Vec<f64> = points.iter().map(|p| p.target_s).collect();
    targets.sort_by(f64::total_cmp);
    targets.dedup();
    targets
}

/// T30 read against T60 wanted, the median of all rooms and octaves.
pub fn reached(points: &[Point]) -> Result<String, AnyError> {
    let targets = targets(points);
    let longest = targets.last().copied().unwrap_or(1.0);
    let mut series = vec![Series::new("wanted", Look::Dashed, 3, vec![(0.0, 0.0), (longest, longest)])];
    for (colour, (method, name)) in METHODS.into_iter().enumerate().filter(|(i, _)| *i != 1) {
        let of = |target: f64| {
            let mine = points.iter().filter(|p| p.method == method && p.target_s == target && p.reachable);
            let mut read: Vec<f64> = mine.filter_map(|p| p.mean_rendered_s).collect();
            read.sort_by(f64::total_cmp);
            (target, quantile(&read, 0.5))
        };
        series.push(Series::new(name, Look::Dots, colour, targets.iter().map(|&t| of(t)).collect()));
    }
    let chart = Chart {
        x_label: "T60 wanted (s)".to_owned(),
        y_label: "Median T30 read (s)".to_owned(),
        x: Scale::Linear(0.0, 1.05 * longest),
        y: Some((0.0, 1.4 * longest)),
        series,
        small: false,
    };
    chart.plain_svg()
}

/// 95th percentile of the error of each method against the target.
pub fn errors(points: &[Point]) -> Result<String, AnyError> {
    let targets = targets(points);
    let mut series = Vec::new();
    for (colour, (method, name)) in METHODS.into_iter().enumerate() {
        for (share, look, in_legend) in [(0.5, Look::Dots, true), (0.95, Look::Dashed, false)] {
            let of = |target: f64| {
                let mine = points.iter().filter(|p| p.method == method && p.target_s == target);
                (target, quantile(&sorted_errors(mine, |p| p.mean_rendered_s).0, share))
            };
            let points = targets.iter().map(|&t| of(t)).collect();
            series.push(Series { in_legend, ..Series::new(name, look, colour, points) });
        }
    }
    let chart = Chart {
        x_label: "T60 wanted (s)".to_owned(),
        y_label: "Error (%); dashed: 95th pct.".to_owned(),
        x: Scale::Linear(0.0, 1.05 * targets.last().copied().unwrap_or(1.0)),
        y: Some((0.0, 50.0)),
        series,
        small: false,
    };
    chart.plain_svg()
}
