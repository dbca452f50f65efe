//! Tables of measured parameters against the simulation: each value, each octave of each pair, and means in just-noticeable differences.

use super::OCTAVES;
use super::summary::mean_of;
use super::verdict::Aim;
use crate::failure::Failure;
use crate::page::Page;
use sabine::acoustics::{ParameterKind, PerBand};
use sabine::optimize::{
    FitConfig, MeasuredParameter, MeasuredTable, OctaveMisfit, ParameterMisfit, TableMisfit,
};
use sabine::paths::Conditions;
use sabine::scene::{MeasuredRoom, ParameterEntry, Receiver, Source};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};
use std::collections::BTreeMap;

/// An octave of a pair stands out where one room in so many shows such a one by chance, all octaves and pairs counted (Bonferroni).
const STANDS_OUT: f64 = 0.01;
/// Most of them that are printed.
const MAX_LINES: usize = 8;
/// Decay times in the order in which one of them is the target of the verdict.
const TARGETS: [ParameterKind; 3] = [ParameterKind::T30, ParameterKind::T20, ParameterKind::Edt];

/// What was measured between one source and one receiver.
pub struct MeasuredPairTable<'a> {
    pub source: usize,
    pub receiver: usize,
    /// In the octaves of the fit.
    pub values: Vec<MeasuredParameter>,
    entries: Vec<&'a ParameterEntry>,
    /// Octaves that the fit does not have, in Hz.
    other_hz: Vec<f64>,
}

impl<'a> MeasuredPairTable<'a> {
    /// One for each pair, in the order of the file.
    pub fn of_room(room: &'a MeasuredRoom) -> Vec<Self> {
        let mut tables: Vec<Self> = Vec::new();
        for entry in room.parameters() {
            let ends = (entry.source, entry.receiver);
            let known = tables.iter().position(|t| (t.source, t.receiver) == ends);
            let at = known.unwrap_or_else(|| {
                let (source, receiver) = ends;
                let (values, entries, other_hz) = (Vec::new(), Vec::new(), Vec::new());
                tables.push(Self { source, receiver, values, entries, other_hz });
                tables.len() - 1
            });
            if OCTAVES.index_of(entry.band_hz).is_some() {
                tables[at].values.push(entry.into());
                tables[at].entries.push(entry);
            } else {
                tables[at].other_hz.push(entry.band_hz);
            }
        }
        tables
    }

    /// What is not fitted, in words.
    pub fn not_used(tables: &[Self]) -> Option<String> {
        let mut other: Vec<f64> = tables.iter().flat_map(|table| table.other_hz.iter().copied()).collect();
        let count = other.len();
        other.sort_by(f64::total_cmp);
        other.dedup();
        let hz: Vec<String> = other.iter().map(|hz| format!("{hz} Hz")).collect();
        (count > 0).then(|| {
            format!(
                "{count} values at {} are not used: materials are fitted at 125 Hz to 8 kHz",
                hz.join(", ")
            )
        })
    }

    /// The longest decay time, in seconds.
    pub fn longest_s(&self) -> f64 {
        let times = self.values.iter().filter(|value| value.kind.is_decay_time());
        times.map(|value| value.value).fold(0.0, f64::max)
    }
}

/// Everything that is said about tables.
#[derive(Serialize)]
pub struct TableReport {
    /// Each value, in the order of the tables.
    values: Vec<ComparedValue>,
    /// Octaves of pairs, worst first.
    octaves: Vec<ComparedOctave>,
    /// Mean |difference| in just-noticeable differences by parameter.
    mean_jnd_fitted: BTreeMap<&'static str, MeanJnd>,
    mean_jnd_held_out: BTreeMap<&'static str, MeanJnd>,
    /// How much farther the fitted values lie from the model than chance and their errors put them, as a variance ratio by octave.
    dispersion: Vec<Option<f64>>,
}

/// A value before and after the fit.
#[derive(Serialize)]
struct ComparedValue {
    source: String,
    receiver: String,
    held_out: bool,
    band_hz: f64,
    #[serde(serialize_with = "symbol")]
    parameter: ParameterKind,
    measured: f64,
    before: Option<f64>,
    after: Option<f64>,
    /// Standard deviation of measured less predicted if the model were right.
    expected_sd: Option<f64>,
    jnd_before: Option<f64>,
    jnd_after: Option<f64>,
    deviations: Option<f64>,
    own_deviations: Option<f64>,
    /// File and line of the value.
    file: String,
    line: u64,
}

/// All values of a pair in an octave.
#[derive(Serialize)]
struct ComparedOctave {
    source: String,
    receiver: String,
    held_out: bool,
    band_hz: f64,
    values: usize,
    chi_squared: f64,
    /// Probability of such a distance, or a larger one, if the pair lay from the model as far as the others do.
    p: f64,
    stands_out: bool,
    sentence: String,
}

#[derive(Serialize)]
struct MeanJnd {
    before: Option<f64>,
    after: Option<f64>,
    values: usize,
}

fn symbol<S: serde::Serializer>(kind: &ParameterKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.symbol())
}

impl TableReport {
    /// An empty one; `dispersion` as the fit has it.
    pub fn new(dispersion: &PerBand<Option<f64>>) -> Self {
        Self {
            values: Vec::new(),
            octaves: Vec::new(),
            mean_jnd_fitted: BTreeMap::new(),
            mean_jnd_held_out: BTreeMap::new(),
            dispersion: dispersion.values().to_vec(),
        }
    }

    /// Compares the table of a pair under conditions before and after.
    pub fn add(
        &mut self,
        ((source, receiver), own, held_out): ((&Source, &Receiver), &MeasuredPairTable<'_>, bool),
        table: MeasuredTable<'_>,
        [before, after]: [Conditions<'_>; 2],
    ) -> Result<(), Failure> {
        let reflection_error = FitConfig::default().reflection_error;
        let before = TableMisfit::under(table, &before, reflection_error)?;
        let after = TableMisfit::under(table, &after, reflection_error)?;
        let finite = |value: f64| Some(value).filter(|v| v.is_finite());
        for ((before, after), entry) in before.values.iter().zip(&after.values).zip(&own.entries) {
            let of = |m: &ParameterMisfit| m.predicted.as_ref().ok().map(|p| p.value);
            self.values.push(ComparedValue {
                source: source.id.clone(),
                receiver: receiver.id.clone(),
                held_out,
                band_hz: entry.band_hz,
                parameter: entry.kind,
                measured: entry.value,
                before: of(before),
                after: of(after),
                expected_sd: of(after).map(|_| after.expected_sd),
                jnd_before: finite(before.jnd()),
                jnd_after: finite(after.jnd()),
                deviations: finite(after.deviations),
                own_deviations: finite(after.own_deviations),
                file: entry.path.display().to_string(),
                line: entry.line,
            });
        }
        for octave in &after.octaves {
            let worst = &after.values[octave.worst];
            let entry = own.entries[octave.worst];
            let pair = format!("{}-{}", source.id, receiver.id);
            self.octaves.push(ComparedOctave {
                source: source.id.clone(),
                receiver: receiver.id.clone(),
                held_out,
                band_hz: octave.band_hz,
                values: octave.count,
                chi_squared: octave.chi_squared,
                p: self.probability(octave, worst),
                stands_out: false,
                sentence: sentence(&pair, octave, worst, entry),
            });
        }
        Ok(())
    }

    /// Probability of an octave's distance, or of its worst value's own deviation, whichever is less likely; the others' dispersion is taken to
    /// be that of the model. The first sees many values that are off, the second one slip among values that are right.
    fn probability(&self, octave: &OctaveMisfit, worst: &ParameterMisfit) -> f64 {
        let dispersion = OCTAVES.index_of(octave.band_hz).and_then(|b| self.dispersion[b]).unwrap_or(1.0);
        let count = octave.count as f64;
        let all = ChiSquared::new(count).map_or(1.0, |chance| chance.sf(octave.chi_squared / dispersion));
        let deviations = worst.own_deviations.abs() / dispersion.sqrt();
        let one = 2.0 * count * Normal::standard().sf(deviations);
        (2.0 * all.min(one)).min(1.0)
    }

    /// With means, and with what stands out.
    pub fn finished(mut self) -> Self {
        let limit = STANDS_OUT / self.octaves.len().max(1) as f64;
        self.octaves.iter_mut().for_each(|octave| octave.stands_out = octave.p < limit);
        self.octaves.sort_by(|a, b| a.p.total_cmp(&b.p).then(b.chi_squared.total_cmp(&a.chi_squared)));
        self.mean_jnd_fitted = self.means(false);
        self.mean_jnd_held_out = self.means(true);
        self
    }

    fn means(&self, held_out: bool) -> BTreeMap<&'static str, MeanJnd> {
        let mut means = BTreeMap::new();
        for kind in ParameterKind::ALL {
            let some = || self.values.iter().filter(|v| v.held_out == held_out && v.parameter == kind);
            // Both are taken of the same values.
            let both = || some().filter_map(|v| Some((v.jnd_before?.abs(), v.jnd_after?.abs())));
            let values = both().count();
            if values > 0 {
                let before = mean_of(both().map(|(before, _)| before));
                let after = mean_of(both().map(|(_, after)| after));
                means.insert(kind.symbol(), MeanJnd { before, after, values });
            }
        }
        means
    }

    /// A decay time of a pair in an octave, the first of T30, T20 and EDT that was measured.
    pub fn decay_time_s(&self, (source, receiver): (&str, &str), band: usize) -> Option<f64> {
        let band_hz = OCTAVES.nominal_hz(band);
        let here = |v: &&ComparedValue| v.source == source && v.receiver == receiver && v.band_hz == band_hz;
        TARGETS
            .into_iter()
            .find_map(|kind| self.values.iter().filter(here).find(|v| v.parameter == kind))
            .map(|v| v.measured)
    }

    /// What the verdict speaks of: the decay time that the fitted tables have, wanted and reached, the mean over pairs by octave.
    pub fn aim(&self) -> (Aim, Vec<Option<f64>>, Vec<Option<f64>>) {
        let fitted = || self.values.iter().filter(|v| !v.held_out);
        let kind = TARGETS.into_iter().find(|kind| fitted().any(|v| v.parameter == *kind));
        let kind = kind.unwrap_or(ParameterKind::T30);
        let both = |b: usize| {
            let here = move |v: &&ComparedValue| v.parameter == kind && v.band_hz == OCTAVES.nominal_hz(b);
            fitted().filter(here).filter_map(|v| Some((v.measured, v.after?)))
        };
        let measured = (0..OCTAVES.len()).map(|b| mean_of(both(b).map(|(m, _)| m))).collect();
        let reached = (0..OCTAVES.len()).map(|b| mean_of(both(b).map(|(_, a)| a))).collect();
        (Aim { quantity: kind.symbol(), of: "the tables" }, measured, reached)
    }

    /// Means in just-noticeable differences: a head, then a row before and one after for fitted and held-out pairs.
    fn rows(&self) -> Vec<Vec<String>> {
        let kinds: Vec<ParameterKind> = ParameterKind::ALL
            .into_iter()
            .filter(|kind| self.values.iter().any(|v| v.parameter == *kind))
            .collect();
        let head = std::iter::once(String::new()).chain(kinds.iter().map(ToString::to_string));
        let mut rows = vec![head.collect()];
        for (name, means) in [("fitted", &self.mean_jnd_fitted), ("held out", &self.mean_jnd_held_out)] {
            if means.is_empty() {
                continue;
            }
            for (when, pick) in [
                ("before", (|m: &MeanJnd| m.before) as fn(&MeanJnd) -> Option<f64>),
                ("after", |m: &MeanJnd| m.after),
            ] {
                let cell = |kind: &ParameterKind| {
                    let mean = means.get(kind.symbol()).and_then(pick);
                    mean.map_or("-".to_owned(), |mean| format!("{mean:.1}"))
                };
                rows.push(std::iter::once(format!("{name}, {when}")).chain(kinds.iter().map(cell)).collect());
            }
        }
        rows
    }

    /// What the pairs say of the model, and which of them stand out, in words.
    fn sentences(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for (name, held_out) in [("fitted", false), ("held-out", true)] {
            let of = || self.octaves.iter().filter(|octave| octave.held_out == held_out);
            let values = of().map(|octave| octave.values).sum::<usize>();
            if values > 0 {
                let factor = (of().map(|octave| octave.chi_squared).sum::<f64>() / values as f64).sqrt();
                lines.push(format!(
                    "{name} values lie {factor:.1} times as far from the model as their errors, interference and rays put them (1.0 or less: it explains them)"
                ));
            }
        }
        let some: Vec<&ComparedOctave> = self.octaves.iter().filter(|octave| octave.stands_out).collect();
        lines.extend(some.iter().take(MAX_LINES).map(|octave| octave.sentence.clone()));
        if some.len() > MAX_LINES {
            lines.push(format!("and {} octaves of pairs more: see parameters.json", some.len() - MAX_LINES));
        }
        lines
    }

    /// Prints them.
    pub fn print(&self) {
        println!("parameters, mean |difference| in just-noticeable differences:");
        for row in self.rows() {
            let cells: String = row[1..].iter().map(|cell| format!("{cell:>6}")).collect();
            println!("  {:16}{cells}", row[0]);
        }
        for line in self.sentences() {
            println!("{line}");
        }
    }

    /// Adds them to a page.
    pub fn add_to(&self, page: &mut Page) {
        page.heading("Parameters: mean |difference| in just-noticeable differences");
        page.table(&self.rows());
        for line in self.sentences() {
            page.paragraph(&line);
        }
    }
}

/// For instance "pair s1-r3 at 1 kHz: C80 is measured 3.2 JND above what the model predicts, ...".
fn sentence(pair: &str, octave: &OctaveMisfit, worst: &ParameterMisfit, entry: &ParameterEntry) -> String {
    let jnd = worst.jnd();
    let side = if jnd > 0.0 { "above" } else { "below" };
    let band_hz = octave.band_hz;
    let band = if band_hz >= 1000.0 { format!("{} kHz", band_hz / 1000.0) } else { format!("{band_hz} Hz") };
    let MeasuredParameter { kind, .. } = worst.measured;
    let file = entry.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    format!(
        "pair {pair} at {band}: {kind} is measured {:.1} JND {side} what the model predicts ({:.1} standard deviations from what the pair's other values say; {file}, line {})",
        jnd.abs(),
        worst.own_deviations.abs(),
        entry.line
    )
}
