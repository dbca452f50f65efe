//! One room: hidden, diagnosed, carried on, and held against the truth.

use crate::trial::{Trial, judged};
use crate::true_model::TrueModel;
use sabine::diagnose::{DiagnoseConfig, Diagnoser, Diagnosis, ExtendedModel, ModelCause, ModelChange};
use sabine::scene::{MeasuredRoom, TimeZero};
use sabine_testkit::{End, Fault, Hidden, LabConfig, Laboratory};
use sabine_validation::comparison::{Gain, compare};
use sabine_validation::heard::{measured, rendered};
use sabine_validation::models::{as_stated, with_absorption};
use sabine_validation::room_tasks::RoomTask;
use sabine_validation::{AnyError, hiding};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Positions that models are found at.
pub const FITTED: usize = 8;
/// Positions that no fit sees.
const FRESH: usize = 12;
/// An effect that is no [`Hidden`] of the laboratory but a setting of the room: reflections keep their sign.
pub const COHERENT: &str = "coherent_reflections";
/// Effects that a measured room can state and that bear on its decays: air, surfaces, and where things are. A panel or a hole is no such: in
/// the laboratory it takes part in early reflections alone.
const IN_ROOM: [&str; 7] = [
    "air_absorption",
    "scattering",
    "sound_speed",
    "room_dimensions",
    "surface_displacement",
    "position_error",
    "coordinate_shift",
];
/// Seeds that are tried until an effect of single positions concerns one that is fitted: each misses with a probability of 0.6 or less.
const TRIES: u64 = 200;
/// Steps between these seeds.
const TRY_STEP: u64 = 104_729;

/// What is to be done.
#[derive(Clone, Debug)]
pub struct Task {
    pub hidden: Vec<String>,
    pub strength: f64,
    pub seed: u64,
    pub rays: usize,
}

impl RoomTask for Task {
    type Trial = Trial;

    fn name(&self) -> String {
        format!("{} seed {}", hiding::name(&self.hidden), self.seed)
    }

    fn is_done(&self, trials: &[Trial]) -> bool {
        let name = hiding::name(&self.hidden);
        let is_it = |t: &Trial| {
            t.hidden == name && (t.strength, t.seed, t.rays) == (self.strength, self.seed, self.rays)
        };
        trials.iter().any(is_it)
    }

    fn run(&self, folder: &Path) -> Result<Trial, AnyError> {
        let started = Instant::now();
        let time_zero = hiding::time_zero(&self.hidden);
        let lab = Laboratory::new(LabConfig {
            seed: self.seed,
            receivers: FITTED + FRESH,
            time_zero,
            positive_reflections: self.hidden.iter().any(|id| id == COHERENT),
            ..LabConfig::default()
        })?;
        let hidden = self.hide(&lab)?;
        std::fs::create_dir_all(folder)?;
        let room = lab.write(&hidden, &folder.join("room"), None)?;
        let fitted = room.with_responses(|response| response.receiver < FITTED);
        let found = self.diagnoser()?.diagnose(&fitted, &[], &())?;
        let right = self.is_right(&found);

        let path = folder.join("extended_model.toml");
        found.model.write(&path)?;
        let model = ExtendedModel::read(&path)?;
        let truth = TrueModel::of(&hidden, &lab, FITTED)?;
        let true_model = self.true_model(&truth, &fitted, (&found, &model))?;
        let stated = as_stated(&found);

        let heard = measured(&room)?;
        let as_modelled = |model: &ExtendedModel| rendered(model, &room, self.rays, self.seed);
        let (as_stated, as_found) = (as_modelled(&stated)?, as_modelled(&model)?);
        let as_is = as_modelled(&true_model)?;
        let models = [&as_stated[..], &as_found[..], &as_is[..]];
        let predictions = compare(&heard, &models, FITTED, time_zero != TimeZero::Emission);
        let [stated_at, found_at, true_at] = &predictions[..] else {
            return Err("three models have three predictions".into());
        };
        let decays =
            [found_at, true_at].map(|p| Gain::of(&p.decay_nats, &stated_at.decay_nats, &stated_at.levels));
        let arrivals =
            [found_at, true_at].map(|p| Gain::of(&p.arrival_nats, &stated_at.arrival_nats, &[1; FRESH]));
        let captured = captured(&truth.changes, &model, &room);
        let (judged_by, passed) = judged(truth.statement, decays, arrivals, captured);
        let micro = |seconds: f64| 1e6 * seconds;
        Ok(Trial {
            hidden: hiding::name(&self.hidden),
            strength: self.strength,
            seed: self.seed,
            rays: self.rays,
            answer: hiding::answer(&found),
            right,
            statement: truth.statement,
            left_out: truth.left_out.join("; "),
            levels: stated_at.levels.iter().sum(),
            decay_nats_found: decays[0].nats,
            decay_nats_true: decays[1].nats,
            decay_nats_found_error: decays[0].standard_error,
            decay_nats_true_error: decays[1].standard_error,
            arrival_nats_found: arrivals[0].nats,
            arrival_nats_true: arrivals[1].nats,
            arrival_nats_found_error: arrivals[0].standard_error,
            arrival_nats_true_error: arrivals[1].standard_error,
            curve_db_stated: stated_at.curve_db,
            curve_db_found: found_at.curve_db,
            curve_db_true: true_at.curve_db,
            arrival_us_stated: micro(stated_at.arrival_s),
            arrival_us_found: micro(found_at.arrival_s),
            arrival_us_true: micro(true_at.arrival_s),
            captured,
            judged_by,
            passed,
            seconds: started.elapsed().as_secs_f64(),
        })
    }
}

impl Task {
    fn diagnoser(&self) -> Result<Diagnoser, AnyError> {
        let config = DiagnoseConfig { rays: self.rays, seed: self.seed, ..DiagnoseConfig::default() };
        Ok(Diagnoser::new(config)?)
    }

    /// The effects, drawn again until those of single positions concern positions that are fitted.
    fn hide(&self, lab: &Laboratory) -> Result<Vec<Hidden>, AnyError> {
        let ids: Vec<String> = self.hidden.iter().filter(|id| *id != COHERENT).cloned().collect();
        for number in 0..TRIES {
            let hidden = hiding::hide(&ids, self.strength, lab, self.seed + TRY_STEP * number)?;
            if hidden.iter().all(concerns_fitted) {
                return Ok(hidden);
            }
        }
        Err(format!("no effect that concerns the first {FITTED} positions in {TRIES} draws").into())
    }

    /// Identifiers of the hidden effects in the catalogue.
    fn ids(&self) -> impl Iterator<Item = &str> {
        self.hidden.iter().map(|id| id.split('.').next().unwrap_or(id))
    }

    fn is_right(&self, found: &Diagnosis) -> bool {
        let mut wanted: Vec<&str> = self.ids().collect();
        wanted.sort_unstable();
        hiding::named(found) == wanted
    }

    /// The true model, absorption fitted at the same positions: with what is true of the room in the place of what is stated, and beside the
    /// other hidden effects, whether or not these data need them.
    fn true_model(
        &self,
        truth: &TrueModel,
        fitted: &MeasuredRoom,
        (found, model): (&Diagnosis, &ExtendedModel),
    ) -> Result<ExtendedModel, AnyError> {
        let mut changes = truth.changes.clone();
        changes.extend(
            self.hidden.iter().filter(|id| *id == COHERENT).map(|_| ModelChange::CoherentReflections),
        );
        let mut true_model = with_absorption(model, BTreeMap::new());
        true_model.causes = vec![ModelCause::new("truth", changes)];
        let mut in_room = true_model.clone();
        in_room.causes[0].changes.retain(|change| !matches!(change, ModelChange::Panel(_)));
        let as_is = in_room.room(fitted)?.measured_room(fitted)?;

        let mut others = with_absorption(model, BTreeMap::new());
        others.causes =
            self.ids().filter(|id| !IN_ROOM.contains(id)).map(|id| best_case(id, found)).collect();
        let known = self.diagnoser()?.with_effects(Vec::new()).starting_from(&others)?.refit(&as_is, &())?;
        let mut absorption = known.absorption;
        absorption.extend(truth.absorption.iter().cloned());
        Ok(with_absorption(&true_model, absorption))
    }
}

/// The case of an effect for which most speaks.
fn best_case(id: &str, found: &Diagnosis) -> ModelCause {
    let cause = ModelCause::new(id, Vec::new());
    match found.candidates.iter().find(|c| c.effect == id).and_then(|c| c.subject.as_ref()) {
        Some(subject) => cause.about(subject),
        None => cause,
    }
}

/// Whether positions that are fitted can tell of an effect.
fn concerns_fitted(hidden: &Hidden) -> bool {
    match hidden {
        Hidden::PositionError { end: End::Receiver, index, .. } => *index < FITTED,
        // There is one source: responses are counted by receivers.
        Hidden::ChannelFault { fault } => match *fault {
            Fault::Polarity { response } | Fault::Gain { response, .. } => response < FITTED,
            Fault::Swap { a, b } => a < FITTED && b < FITTED,
        },
        _ => true,
    }
}

/// One less the distance of a model's changes from the true ones over the distance of none (root of the mean square over changes); `None` where
/// no number can be compared.
fn captured(truth: &[ModelChange], model: &ExtendedModel, room: &MeasuredRoom) -> Option<f64> {
    let known: BTreeMap<String, Vec<f64>> =
        model.causes.iter().flat_map(|cause| &cause.changes).filter_map(|c| numbers(c, room)).collect();
    // Relative to its own size, for each has a unit of its own.
    let off = |(name, values): (String, Vec<f64>)| {
        let found = known.get(&name);
        let found = |i: usize| found.and_then(|f| f.get(i)).copied().unwrap_or(0.0);
        let off: f64 = values.iter().enumerate().map(|(i, value)| (found(i) - value).powi(2)).sum();
        let all: f64 = values.iter().map(|value| value.powi(2)).sum();
        (all > 0.0).then(|| off / all)
    };
    let shares: Vec<f64> = truth.iter().filter_map(|change| numbers(change, room)).filter_map(off).collect();
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    (!shares.is_empty()).then(|| 1.0 - mean.sqrt())
}

/// A change as a name and numbers that are zero in the room as stated; `None` for changes whose numbers can be others in the same room.
fn numbers(change: &ModelChange, room: &MeasuredRoom) -> Option<(String, Vec<f64>)> {
    let places = || {
        let sources = room.sources().iter().map(|s| (&s.id, s.position_m));
        sources.chain(room.receivers().iter().map(|r| (&r.id, r.position_m)))
    };
    let named = |name: &str, numbers: Vec<f64>| Some((name.to_owned(), numbers));
    match change {
        ModelChange::Temperature(celsius) => named("temperature", vec![celsius - room.air().temperature_c()]),
        ModelChange::RelativeHumidity(percent) => {
            named("humidity", vec![(percent / room.air().relative_humidity_percent()).ln()])
        }
        ModelChange::Latency(seconds) => named("latency", vec![*seconds]),
        ModelChange::Clock(ppm) => named("clock", vec![*ppm]),
        ModelChange::Inverted(response) => named(&format!("{response} inverted"), vec![1.0]),
        ModelChange::ResponseGain { response, gain_db } => named(response, vec![*gain_db]),
        ModelChange::ResponseBandGains { response, gain_db } => {
            named(&format!("{response} by octave"), gain_db.clone())
        }
        ModelChange::Exchanged([a, b]) => {
            let (first, second) = if a < b { (a, b) } else { (b, a) };
            named(&format!("{first} {second}"), vec![1.0])
        }
        ModelChange::BandGains(gain_db) => {
            // The level of all is open.
            let mean = gain_db.iter().sum::<f64>() / gain_db.len() as f64;
            named("gains", gain_db.iter().map(|g| g - mean).collect())
        }
        ModelChange::SourcePattern { directed_share, .. } => named("directed share", directed_share.clone()),
        ModelChange::Scattering(scattering) => {
            named("scattering", scattering.values().flatten().copied().collect())
        }
        ModelChange::Dimensions(change) => named("dimensions", change.scale.map(|s| s - 1.0).to_vec()),
        ModelChange::Position { id, position_m } => {
            let (_, stated) = places().find(|(own, _)| *own == id)?;
            named(id, (0..3).map(|k| position_m[k] - stated[k]).collect())
        }
        ModelChange::CoordinateShift(motion) => {
            let moved = |(_, place): (&String, [f64; 3])| {
                let there = motion.moved(place);
                (0..3).map(move |k| there[k] - place[k])
            };
            named("coordinates", places().flat_map(moved).collect())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn what_is_captured_is_what_is_left_of_the_distance() {
        let lab = Laboratory::new(LabConfig { seed: 3, receivers: 2, ..LabConfig::default() }).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let room = lab.write(&[], &folder.path().join("room"), None).unwrap();
        let mut model = ExtendedModel::default();
        let truth = [ModelChange::Latency(4e-3)];
        assert_eq!(captured(&truth, &model, &room), Some(0.0));
        model.causes.push(ModelCause::new("time_zero", vec![ModelChange::Latency(3e-3)]));
        assert!((captured(&truth, &model, &room).unwrap() - 0.75).abs() < 1e-12);
        let of_surfaces = [ModelChange::CoherentReflections];
        assert_eq!(captured(&of_surfaces, &model, &room), None);
    }
}
