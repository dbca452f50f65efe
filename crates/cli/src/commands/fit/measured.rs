//! The fit to what was measured: responses, tables of parameters, or both.

use super::summary::{Compared, Seconds, mean_of};
use super::tables::{MeasuredPairTable, TableReport};
use super::verdict::Aim;
use super::{
    AcousticsError, DURATION_FACTOR, DURATION_S, DecayMisfit, FitProblem, OCTAVES, Outcome, Room,
    response_curves, values, wanted_curves,
};
use crate::bar::Bar;
use crate::failure::Failure;
use crate::modelled::PairModel;
use sabine::acoustics::Material;
use sabine::optimize::{MeasuredDecay, MeasuredPair, MeasuredTable};
use sabine::paths::{Conditions, PathSet};
use sabine::scene::{MeasuredRoom, Receiver, Source};
use std::time::Instant;

/// What was measured, and between which places.
struct Measured<'a> {
    responses: Vec<MeasuredDecay>,
    tables: Vec<MeasuredPairTable<'a>>,
    /// Of the responses, then of the tables.
    places: Vec<(&'a Source, &'a Receiver)>,
    held_out: Vec<bool>,
    warnings: Vec<String>,
}

impl<'a> Room<'a> {
    pub(super) fn fit_measured(&self, bar: &Bar) -> Result<Outcome<'a>, Failure> {
        let measured = self.measured()?;
        let fitter = self.fitter()?;
        let duration_s = (DURATION_FACTOR * measured.longest_s()).clamp(DURATION_S.0, DURATION_S.1);
        let seed = self.arguments.seed;
        let Measured { places, held_out, .. } = &measured;
        let trace = |seed| -> Result<Vec<PathSet>, AcousticsError> {
            places.iter().map(|p| self.trace(*p, duration_s, seed, 1.0)).collect()
        };
        let start = Instant::now();
        let paths = trace(seed)?;
        let traced_s = start.elapsed().as_secs_f64();
        let models = places.iter().map(|place| self.model_between(*place)).collect::<Result<Vec<_>, _>>()?;
        let under: Vec<Conditions<'_>> =
            models.iter().map(|own| own.conditions(&self.materials, &self.air)).collect();
        let of_fitted: Vec<Conditions<'_>> =
            under.iter().zip(held_out).filter(|(_, held)| !**held).map(|(own, _)| *own).collect();
        let (responses, tables) = (measured.pairs(&paths), measured.tables(&paths));
        let start = Instant::now();
        let done = fitter.fit_measured(
            (&fitted(&responses, held_out), self.file.measurement()),
            &fitted(&tables, &held_out[responses.len()..]),
            &FitProblem::new(&self.materials, &self.priors, &self.air)
                .under(if models.iter().all(PairModel::is_plain) { &[] } else { &of_fitted }),
            bar,
        )?;
        let fit_s = start.elapsed().as_secs_f64();

        // Held against rays that the fit has not seen.
        let other = trace(seed.wrapping_add(1))?;
        let materials = &done.of_responses.fit.materials;
        let (compared, curves) = self.compared(&measured, &other, &under, materials)?;
        let report = measured.report(self, &other, &under, &done)?;
        let curves = if curves.is_empty() {
            self.curves_of_tables(&measured, (&other, &models), materials, report.as_ref())?
        } else {
            curves
        };
        let mut warnings = measured.warnings.clone();
        let left_out = done.of_responses.left_out.iter();
        warnings.extend(left_out.map(|(i, hz, why)| format!("response {i} at {hz} Hz is left out: {why}")));
        let mean = |of: &dyn Fn(&Compared) -> &Vec<Option<f64>>| -> Vec<Option<f64>> {
            let used = || compared.iter().filter(|c| !c.held_out);
            (0..OCTAVES.len()).map(|b| mean_of(used().filter_map(|c| of(c)[b]))).collect()
        };
        let some_responses = held_out[..measured.responses.len()].iter().filter(|held| !**held).count();
        let (aim, target_s, reached_s) = match &report {
            Some(report) if some_responses == 0 => report.aim(),
            _ => {
                let of = if some_responses == 1 { "the response" } else { "the responses" };
                let aim = Aim { quantity: "T30", of };
                (aim, mean(&|c| &c.measured_t30_s), mean(&|c| &c.t30_after_s))
            }
        };
        Ok(Outcome {
            aim,
            target_s,
            reached_s,
            independent: other.into_iter().next().ok_or("no paths")?,
            place: *places.first().ok_or("no paths")?,
            fit: done.of_responses.fit,
            compared,
            tables: report,
            warnings,
            seconds: Seconds { trace: traced_s, fit: fit_s },
            curves,
        })
    }

    /// What there is to fit to, and what of it is held out.
    fn measured(&self) -> Result<Measured<'a>, Failure> {
        let entries = if self.arguments.tables { &[] } else { self.file.responses() };
        let mut places: Vec<(&Source, &Receiver)> =
            entries.iter().map(|e| ends(self.file, (e.source, e.receiver))).collect();
        let mut warnings = Vec::new();
        let tables =
            if self.arguments.responses { Vec::new() } else { MeasuredPairTable::of_room(self.file) };
        let (tables, double): (Vec<_>, Vec<_>) = tables
            .into_iter()
            .partition(|t| !entries.iter().any(|e| (e.source, e.receiver) == (t.source, t.receiver)));
        for table in double {
            let (source, receiver) = ends(self.file, (table.source, table.receiver));
            let pair = format!("{}-{}", source.id, receiver.id);
            warnings.push(format!("the table of {pair} is not used: the pair has a response"));
        }
        warnings.extend(MeasuredPairTable::not_used(&tables));
        places.extend(tables.iter().map(|table| ends(self.file, (table.source, table.receiver))));
        if places.is_empty() {
            let what = match (self.arguments.responses, self.arguments.tables) {
                (true, _) => "responses",
                (_, true) => "tables of parameters",
                _ => "responses and tables of parameters",
            };
            return Err(format!("room.toml: {what}: there are none to fit to").into());
        }
        let unknown =
            |id: &&String| !places.iter().any(|(s, r)| **id == r.id || **id == format!("{}/{}", s.id, r.id));
        if let Some(id) = self.arguments.hold_out.iter().find(unknown) {
            return Err(format!("--hold-out {id}: nothing was measured there").into());
        }
        let held_out: Vec<bool> = places.iter().map(|(s, r)| self.is_held_out(s, r)).collect();
        if held_out.iter().all(|h| *h) {
            return Err("room.toml: responses and parameters: none is left to fit to".into());
        }
        let responses = (0..entries.len())
            .map(|i| Ok(MeasuredDecay::new(&self.file.load_response(i)?, OCTAVES)?))
            .collect::<Result<Vec<_>, Failure>>()?;
        Ok(Measured { responses, tables, places, held_out, warnings })
    }

    fn is_held_out(&self, source: &Source, receiver: &Receiver) -> bool {
        let pair = format!("{}/{}", source.id, receiver.id);
        self.arguments.hold_out.iter().any(|id| *id == receiver.id || *id == pair)
    }

    /// Responses before and after, and the decay curves of one of them.
    fn compared(
        &self,
        measured: &Measured<'_>,
        paths: &[PathSet],
        under: &[Conditions<'_>],
        materials: &[Material],
    ) -> Result<(Vec<Compared>, Vec<Vec<super::Curve>>), Failure> {
        let time_zero = self.file.measurement().time_zero;
        let held_out = &measured.held_out[..measured.responses.len()];
        let (mut compared, mut curves) = (Vec::new(), Vec::new());
        for (i, pair) in measured.pairs(paths).into_iter().enumerate() {
            let misfit = |materials: &[Material]| {
                DecayMisfit::under(pair, time_zero, &under[i].with_materials(materials))
            };
            let (before, after) = (misfit(&self.materials)?, misfit(materials)?);
            if curves.is_empty() && (held_out[i] || !held_out.contains(&true)) {
                curves = (0..OCTAVES.len()).map(|b| response_curves(&before, &after, b)).collect();
            }
            let levels = |m: &DecayMisfit| m.rmse_db.values().iter().map(|r| r.clone().ok()).collect();
            compared.push(Compared {
                source: measured.places[i].0.id.clone(),
                receiver: measured.places[i].1.id.clone(),
                held_out: held_out[i],
                measured_t30_s: values(&before.measured_t30_s),
                t30_before_s: values(&before.simulated_t30_s),
                t30_after_s: values(&after.simulated_t30_s),
                decay_rmse_before_db: levels(&before),
                decay_rmse_after_db: levels(&after),
            });
        }
        Ok((compared, curves))
    }

    /// Where there are no responses to draw: the decay of one pair, and the straight one that its table tells of.
    fn curves_of_tables(
        &self,
        measured: &Measured<'_>,
        (paths, models): (&[PathSet], &[PairModel]),
        materials: &[Material],
        report: Option<&TableReport>,
    ) -> Result<Vec<Vec<super::Curve>>, Failure> {
        let pair = measured.held_out.iter().position(|held| *held).unwrap_or(0);
        let before = self.decay(&paths[pair], &self.materials, &models[pair])?;
        let after = self.decay(&paths[pair], materials, &models[pair])?;
        let (source, receiver) = measured.places[pair];
        let wanted_s = |b: usize| report.and_then(|r| r.decay_time_s((&source.id, &receiver.id), b));
        Ok((0..OCTAVES.len()).map(|b| wanted_curves(&before, &after, b, wanted_s(b))).collect())
    }
}

impl Measured<'_> {
    /// The longest decay time that was measured, in seconds.
    fn longest_s(&self) -> f64 {
        let t30 =
            |m: &MeasuredDecay| m.t30_s().values().iter().flatten().map(|t| t.value).fold(0.0, f64::max);
        let responses = self.responses.iter().map(t30);
        responses.chain(self.tables.iter().map(MeasuredPairTable::longest_s)).fold(0.0, f64::max)
    }

    fn pairs<'m>(&'m self, paths: &'m [PathSet]) -> Vec<MeasuredPair<'m>> {
        let both = self.responses.iter().zip(paths);
        both.map(|(measured, paths)| MeasuredPair { measured, paths }).collect()
    }

    fn tables<'m>(&'m self, paths: &'m [PathSet]) -> Vec<MeasuredTable<'m>> {
        let both = self.tables.iter().zip(&paths[self.responses.len()..]);
        both.map(|(table, paths)| MeasuredTable { values: &table.values, paths }).collect()
    }

    /// The tables before and after, if there are any.
    fn report(
        &self,
        room: &Room<'_>,
        paths: &[PathSet],
        under: &[Conditions<'_>],
        fit: &sabine::optimize::TableFit,
    ) -> Result<Option<TableReport>, Failure> {
        if self.tables.is_empty() {
            return Ok(None);
        }
        let from = self.responses.len();
        let mut report = TableReport::new(&fit.dispersion);
        for (i, table) in self.tables(paths).into_iter().enumerate() {
            let own = under[from + i];
            report.add(
                (self.places[from + i], &self.tables[i], self.held_out[from + i]),
                table,
                [own.with_materials(&room.materials), own.with_materials(&fit.of_responses.fit.materials)],
            )?;
        }
        Ok(Some(report.finished()))
    }
}

fn ends(file: &MeasuredRoom, (source, receiver): (usize, usize)) -> (&Source, &Receiver) {
    (&file.sources()[source], &file.receivers()[receiver])
}

/// Those that are not held out.
fn fitted<T: Copy>(all: &[T], held_out: &[bool]) -> Vec<T> {
    all.iter().zip(held_out).filter(|(_, held)| !**held).map(|(one, _)| *one).collect()
}
