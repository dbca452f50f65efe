//! Everything that a diagnosis compares, and fits of any set of causes to it.

use crate::config::DiagnoseConfig;
use crate::effect::Case;
use crate::error::Error;
use crate::extend::model_change::ModelChange;
use crate::infer::candidates::CatalogueCase;
use crate::likelihood::arrivals::{self, ArrivalData};
use crate::likelihood::decay::{self, BinResidual, EnergyData, EnergyModel, WarmStart};
use crate::likelihood::discrepancy::free_discrepancy;
use crate::likelihood::laplace::{LaplaceFit, Prior};
use crate::likelihood::parameters::{ArrivalLayout, DecayLayout};
use crate::observe::observations::Observations;
use crate::observe::observed_response::Measured;
use crate::simulate::scene_tracer::SceneTracer;
use crate::simulate::schroeder::{bands_of_modes, modal_variance};
use crate::simulate::simulation::{ABSORPTION, Simulation};
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_pair::TracedPair;
use crate::simulate::traced_views::TracedRoomView;
use crate::survey::Survey;
use sabine_acoustics::{Observer, report};
use sabine_scene::{MaterialPrior, MeasuredRoom};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::LN_10;
use std::sync::Arc;
use web_time::Instant;

/// Rounds of expansion and fit of the baseline.
const ROUNDS: usize = 4;
/// Change of absorption (share of its prior's standard deviation) below which no further round is needed.
pub(crate) const TOLERANCE: f64 = 0.1;
/// Rounds of drift and dispersion.
const SCATTER_ROUNDS: usize = 4;

/// Observations and simulation with what the fit of the baseline needs: absorption, gains, latencies and places within what is known of
/// them, and no cause.
pub(crate) struct Baseline {
    pub observations: Observations,
    pub simulation: Simulation,
    pub config: DiagnoseConfig,
    /// What is known of the absorption, `[material][band]`.
    pub priors: Vec<Vec<Prior>>,
    /// Factor by which variances exceed what is expected, by band.
    pub dispersion: Vec<f64>,
    /// How far the level of a response in each band may lie from the prediction (standard deviation, as a logarithm of energy): what
    /// microphones and their places do, and what few modes leave to chance.
    pub level_sd: Vec<f64>,
    /// How far single responses drift from the prediction along the decay (standard deviation of the first cosine, as a logarithm of
    /// energy), by band.
    pub drift_sd: Vec<f64>,
    pub seconds: BTreeMap<&'static str, f64>,
    /// Slots whose tables are of an expansion before.
    pub stale: BTreeSet<usize>,
}

impl Baseline {
    /// Reads and traces everything, and fits the baseline to all responses but those of the receivers `held`.
    pub fn new(
        room: &MeasuredRoom,
        held: &[usize],
        config: &DiagnoseConfig,
        tracer: &Arc<dyn SceneTracer>,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let started = Instant::now();
        config.check()?;
        let mut observations = Observations::read(room, held, config.position_sd_m, observer)?;
        if config.wave_solutions {
            observations.survey.bands_of_modes = bands_of_modes(room.scene(), &room.air());
        }
        let simulation = Simulation::trace(room, &observations, tracer, config, observer)?;
        let pairs = &simulation.pairs;
        let in_sight: Vec<bool> = pairs.iter().map(TracedPair::has_direct).collect();
        observations.align(&in_sight, &simulation.direct_s);
        observations.survey.diffracted = (0..pairs.len()).filter(|&p| pairs[p].is_diffracted()).collect();
        let mut baseline = Self {
            priors: room.priors().iter().map(absorption_priors).collect(),
            dispersion: vec![1.0; room.bands().len()],
            level_sd: level_sd(room, config),
            drift_sd: vec![0.0; room.bands().len()],
            config: config.clone(),
            observations,
            simulation,
            seconds: BTreeMap::from([("trace", started.elapsed().as_secs_f64())]),
            stale: BTreeSet::new(),
        };
        baseline.simulation.expand(&baseline.observations, false)?;
        baseline.leave_unreadable()?;
        baseline.simulation.predict_arrivals(&mut baseline.observations)?;
        baseline.fit(observer)?;
        Ok(baseline)
    }

    /// Leaves out values of tables that the prediction does not have.
    fn leave_unreadable(&mut self) -> Result<(), Error> {
        if self.observations.are_tables() {
            let kept = self.simulation.readable(&self.observations.measured);
            self.observations.keep_values(&kept)?;
            self.simulation.find_table_chances(&self.observations.measured);
        }
        Ok(())
    }

    pub fn survey(&self) -> &Survey {
        &self.observations.survey
    }

    /// The traced room at the present absorption, for tables.
    pub fn room_view(&self) -> Result<TracedRoomView<'_>, Error> {
        TracedRoomView::new(&self.observations.survey, &self.simulation, &self.observations.pulses)
    }

    /// Number of pairs, and of responses.
    pub fn pairs(&self) -> usize {
        self.survey().responses.len()
    }

    /// Prepares the tables of all decay terms about the present absorption. Says which cases (a flag for each) refused to be prepared, and
    /// notes why.
    pub fn prepare(&mut self, cases: &[CatalogueCase]) -> Result<Vec<bool>, Error> {
        self.forget_tables(cases);
        self.prepare_those(cases, |_| true)
    }

    /// Prepares those tables that have not been since the last expansion.
    pub fn prepare_rest(&mut self, cases: &[CatalogueCase]) -> Result<(), Error> {
        let stale = self.stale.clone();
        self.prepare_those(cases, |slot| stale.contains(&slot)).map(|_| ())
    }

    /// Makes room for the tables of so many cases more, which wait for [`Baseline::prepare_rest`].
    pub fn add_slots(&mut self, count: usize) {
        let first = self.simulation.tables.len();
        self.simulation.tables.extend(std::iter::repeat_with(Tables::default).take(count));
        self.stale.extend(first..first + count);
    }

    fn forget_tables(&mut self, cases: &[CatalogueCase]) {
        self.stale = cases.iter().filter_map(|c| c.case.slot).collect();
        let slots = self.stale.last().map_or(0, |last| last + 1);
        self.simulation.tables = std::iter::repeat_with(Tables::default).take(slots).collect();
    }

    fn prepare_those(
        &mut self,
        cases: &[CatalogueCase],
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Vec<bool>, Error> {
        let started = Instant::now();
        let mut refused = vec![false; cases.len()];
        let room = self.room_view()?;
        let (mut found, mut reasons, mut fresh) = (Vec::new(), Vec::new(), Vec::new());
        for (own, refused) in cases.iter().zip(&mut refused) {
            let Some(slot) = own.case.slot.filter(|&slot| wanted(slot)) else { continue };
            fresh.push(slot);
            let Some(term) = own.case.decay_term() else { continue };
            match term.prepare(&room) {
                Ok(tables) => found.push((slot, tables)),
                Err(Unprepared::Refused(reason)) => {
                    *refused = true;
                    reasons.push(reason);
                }
                Err(Unprepared::Failed(error)) => return Err(error),
            }
        }
        fresh.iter().for_each(|slot| _ = self.stale.remove(slot));
        found.into_iter().for_each(|(slot, tables)| self.simulation.tables[slot] = tables);
        for reason in reasons {
            if !self.observations.notes.contains(&reason) {
                self.observations.notes.push(reason);
            }
        }
        *self.seconds.entry("tables").or_default() += started.elapsed().as_secs_f64();
        Ok(refused)
    }

    /// Takes a change of the model into the simulation, and expands it again where paths moved. Surfaces that cannot stand where they were
    /// found stay where they are, and a note says so.
    pub fn retrace(
        &mut self,
        change: &ModelChange,
        cases: &[CatalogueCase],
        chosen: &[usize],
    ) -> Result<(), Error> {
        match self.simulation.apply(change, &self.observations.survey) {
            Ok(true) => self.expand(cases, chosen),
            Ok(false) => Ok(()),
            Err(Error::Displacement(reason)) => {
                self.observations.notes.push(format!(
                    "A surface or an object cannot stand where arrival times say that it stands ({reason}): decays are predicted for the room as it was \
                     before."
                ));
                Ok(())
            }
            Err(other) => Err(other),
        }
    }

    /// Predicts energies again from the traced paths, and the tables of some cases (indices); those of all others wait for
    /// [`Baseline::prepare_rest`]: rounds of expansion and fit ask for few of them.
    pub fn expand(&mut self, cases: &[CatalogueCase], chosen: &[usize]) -> Result<(), Error> {
        self.simulation.expand(&self.observations, true)?;
        self.forget_tables(cases);
        let wanted: Vec<usize> = chosen.iter().filter_map(|&c| cases[c].case.slot).collect();
        self.prepare_those(cases, |slot| wanted.contains(&slot)).map(|_| ())
    }

    /// Expands about a share of the way to fitted absorption; says how far it was off, in standard deviations of what is known of it.
    pub fn expand_towards(
        &mut self,
        (values, share): (&[f64], f64),
        cases: &[CatalogueCase],
        chosen: &[usize],
    ) -> Result<f64, Error> {
        let moved = self.move_absorption(values, share);
        self.expand(cases, chosen)?;
        Ok(moved)
    }

    /// Moves the absorption of the expansion a share of the way to that fitted; says how far it was off, in standard deviations of what is
    /// known of it.
    fn move_absorption(&mut self, values: &[f64], share: f64) -> f64 {
        let layout = self.decay_layout();
        let mut off = 0.0f64;
        for (m, material) in self.simulation.absorption.iter_mut().enumerate() {
            for (b, a) in material.iter_mut().enumerate() {
                let by = values[layout.absorption(m, b)] - *a;
                off = off.max(by.abs() / self.priors[m][b].sd.min(0.1));
                *a += share * by;
            }
        }
        off
    }

    /// Fits the baseline, expanding about it anew until it stays.
    fn fit(&mut self, observer: &dyn Observer) -> Result<(), Error> {
        let started = Instant::now();
        let used = self.observations.fitted.clone();
        for round in 0..ROUNDS {
            report(observer, "baseline", round as u64, ROUNDS as u64)?;
            let found = decay::fit_from_elsewhere(&self.energy_data(), &used)?;
            let moved = self.move_absorption(&found.values, 1.0);
            let last = moved < TOLERANCE || round + 1 == ROUNDS;
            self.simulation.expand(&self.observations, last)?;
            if last {
                break;
            }
        }
        if self.simulation.ends.iter().flatten().all(|&e| e == 0) {
            return Err(Error::NothingToCompare { responses: self.pairs() });
        }
        self.seconds.insert("baseline", started.elapsed().as_secs_f64());
        Ok(())
    }

    pub fn decay_layout(&self) -> DecayLayout {
        DecayLayout::of(self.survey())
    }

    pub fn arrival_layout(&self) -> ArrivalLayout {
        ArrivalLayout::of(self.survey())
    }

    pub fn energy_data(&self) -> EnergyData<'_> {
        EnergyData {
            survey: self.survey(),
            measured: &self.observations.measured,
            states: &self.simulation.states,
            ends: &self.simulation.ends,
            direct_s: &self.simulation.direct_s,
            reference: &self.simulation.reference,
            absorption: &self.simulation.absorption,
            priors: &self.priors,
            gain_sd_db: self.config.gain_sd_db,
            level_sd: &self.level_sd,
            tables: &self.simulation.tables,
            dispersion: &self.dispersion,
            drift_sd: &self.drift_sd,
        }
    }

    pub fn arrival_data(&self) -> ArrivalData<'_> {
        ArrivalData {
            survey: self.survey(),
            measured: &self.observations.measured,
            arrivals: &self.simulation.arrivals,
            speed_m_s: &self.simulation.speed_m_s,
            displaced: &self.simulation.displaced,
        }
    }

    /// Fits decays under the causes that bear on them.
    pub fn fit_energy(
        &self,
        cases: &[&Case],
        used: &[bool],
        before: Option<WarmStart<'_>>,
    ) -> Result<(LaplaceFit, Vec<usize>), Error> {
        decay::fit(&self.energy_data(), cases, used, before)
    }

    pub fn fit_arrivals(&self, cases: &[&Case], used: &[bool]) -> Result<(LaplaceFit, Vec<usize>), Error> {
        arrivals::fit(&self.arrival_data(), cases, used)
    }

    /// Evidence of the decays in those octaves alone that lie above the Schroeder frequency; none where no octave does.
    pub fn evidence_above_modes(
        &self,
        cases: &[&Case],
        used: &[bool],
        before: WarmStart<'_>,
    ) -> Result<Option<f64>, Error> {
        let within = |ends: Vec<Vec<usize>>| self.evidence_within(&ends, cases, used, Some(before));
        self.ends_above_modes().map(within).transpose()
    }

    /// First bins that are not compared, `[pair][band]`, if octaves below the Schroeder frequency are left out; none where no other is left.
    pub fn ends_above_modes(&self) -> Option<Vec<Vec<usize>>> {
        let modes = self.survey().bands_of_modes;
        let above = |ends: &Vec<usize>| -> Vec<usize> {
            ends.iter().enumerate().map(|(band, &end)| if band < modes { 0 } else { end }).collect()
        };
        let ends: Vec<Vec<usize>> = self.simulation.ends.iter().map(above).collect();
        ends.iter().flatten().any(|&end| end > 0).then_some(ends)
    }

    /// Evidence of the decays in the bins before `ends`, `[pair][band]`.
    pub fn evidence_within(
        &self,
        ends: &[Vec<usize>],
        cases: &[&Case],
        used: &[bool],
        before: Option<WarmStart<'_>>,
    ) -> Result<f64, Error> {
        let data = EnergyData { ends, ..self.energy_data() };
        Ok(decay::fit(&data, cases, used, before)?.0.log_evidence)
    }

    /// The rival without a name.
    pub fn free_discrepancy(&self) -> Case {
        free_discrepancy(self.survey(), self.simulation.compared_s.clone())
    }

    /// Fits decays to energies other than those measured.
    pub fn fit_energy_to(
        &self,
        measured: &[Measured],
        cases: &[&Case],
        used: &[bool],
        before: Option<WarmStart<'_>>,
    ) -> Result<LaplaceFit, Error> {
        let data = EnergyData { measured, ..self.energy_data() };
        Ok(decay::fit(&data, cases, used, before)?.0)
    }

    /// Bins of the given pairs under fitted values.
    pub fn residuals(&self, cases: &[&Case], values: &[f64], pairs: &[usize]) -> Vec<BinResidual> {
        self.residuals_of(&self.observations.measured, cases, values, pairs)
    }

    /// The same of energies other than those measured.
    pub fn residuals_of(
        &self,
        measured: &[Measured],
        cases: &[&Case],
        values: &[f64],
        pairs: &[usize],
    ) -> Vec<BinResidual> {
        let used = vec![true; self.pairs()];
        let data = EnergyData { measured, ..self.energy_data() };
        EnergyModel::new(&data, cases, &used).residuals(values, pairs.iter().copied())
    }

    /// Sets how bins scatter once anything smooth that all responses share has been taken out: the drift of single responses along the
    /// decay, and the dispersion of each band.
    pub fn calibrate_scatter(&mut self, cases: &[&Case], used: &[bool]) -> Result<(), Error> {
        let free = self.free_discrepancy();
        let mut all = cases.to_vec();
        all.push(&free);
        // A drift that was estimated beside other causes would be found again.
        self.drift_sd.fill(0.0);
        let (found, _) = self.fit_energy(&all, used, None)?;
        let pairs: Vec<usize> = (0..used.len()).filter(|&p| used[p]).collect();
        // Scatter that has not been seen through would pass for drift: what is estimated first is all of it.
        for round in 0..SCATTER_ROUNDS {
            if round > 0 {
                self.drift_sd =
                    EnergyModel::new(&self.energy_data(), &all, used).most_probable_drift(&found.values);
            }
            let residuals = self.residuals(&all, &found.values, &pairs);
            self.dispersion =
                dispersion(&residuals, self.survey().bands.len()).iter().map(|d| d.max(1.0)).collect();
        }
        Ok(())
    }
}

#[cfg(test)]
impl Baseline {
    /// Of a laboratory room with nothing hidden in it: two receivers, few rays.
    pub fn of_laboratory(seed: u64) -> Self {
        use crate::simulate::scene_tracer::Rays;
        use sabine_testkit::{LabConfig, Laboratory};
        let lab = Laboratory::new(LabConfig { seed, receivers: 2, ..LabConfig::default() }).expect("a room");
        let folder = tempfile::tempdir().expect("a folder");
        let room = lab.write(&[], &folder.path().join("room"), None).expect("files");
        let config = DiagnoseConfig { rays: 200, wave_solutions: false, ..DiagnoseConfig::default() };
        let tracer: Arc<dyn SceneTracer> = Arc::new(Rays { config: config.tracer() });
        Self::new(&room, &[], &config, &tracer, &()).expect("a fit")
    }
}

/// Mean squared standardised residual of each band; what a bin measures above the prediction counts up to e^5 times.
pub(crate) fn dispersion(residuals: &[BinResidual], bands: usize) -> Vec<f64> {
    (0..bands)
        .map(|band| {
            let own: Vec<f64> = residuals
                .iter()
                .filter(|r| r.band == band)
                .map(|r| ((r.ln_ratio - r.offset).min(5.0).exp() - 1.0).powi(2) / r.variance)
                .collect();
            if own.is_empty() { 1.0 } else { own.iter().sum::<f64>() / own.len() as f64 }
        })
        .collect()
}

/// How far levels may lie off in each band, as a logarithm of energy: as far as is stated, and what few modes leave to chance.
pub(crate) fn level_sd(room: &MeasuredRoom, config: &DiagnoseConfig) -> Vec<f64> {
    let stated = config.level_sd_db * LN_10 / 10.0;
    let modal = modal_variance(room.scene(), &room.air(), &room.bands());
    modal.iter().map(|variance| (stated * stated + variance).sqrt()).collect()
}

pub(crate) fn absorption_priors(prior: &MaterialPrior) -> Vec<Prior> {
    let bands = prior.absorption_sd.bands();
    (0..bands.len())
        .map(|b| {
            let mean = prior.absorption.as_ref().map(|a| a.values()[b]);
            Prior {
                mean: mean.unwrap_or(MaterialPrior::UNKNOWN_ABSORPTION),
                sd: prior.absorption_sd.values()[b],
                low: ABSORPTION.0,
                high: ABSORPTION.1,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::DecayTerm;
    use crate::hand_made;
    use crate::simulate::views::BandView;
    use sabine_scene::{Levels, TimeZero};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Counts how often its tables are prepared.
    struct Counted(Arc<AtomicUsize>);

    impl DecayTerm for Counted {
        fn prepare(&self, _: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
            self.0.fetch_add(1, Ordering::Relaxed);
            Ok(Tables::of_bins(vec![vec![0u8]]))
        }

        fn apply(&self, _: &[f64], _: &BandView<'_>, _: &mut [f64]) {}
    }

    #[test]
    fn an_expansion_prepares_the_tables_that_are_asked_for_and_the_rest_once_they_are() {
        let counts: Vec<Arc<AtomicUsize>> = (0..3).map(|_| Arc::default()).collect();
        let one = |(effect, count): (usize, &Arc<AtomicUsize>)| {
            let mut case = Case::decay(Vec::new(), Counted(Arc::clone(count)));
            // Slots have gaps: cases that refused to be prepared are gone.
            case.slot = Some(2 * effect + 1);
            CatalogueCase { effect, id: "counted".into(), case, formula: None, inherited_nats: 0.0 }
        };
        let cases: Vec<CatalogueCase> = counts.iter().enumerate().map(one).collect();
        let mut baseline =
            hand_made::Tables::new(Levels::Absolute, TimeZero::Emission).baseline(DiagnoseConfig::default());
        let state = |baseline: &Baseline| -> Vec<(usize, bool)> {
            let known = |slot: usize| baseline.simulation.tables[slot].of(0, 0, false).is_some();
            counts.iter().enumerate().map(|(i, c)| (c.load(Ordering::Relaxed), known(2 * i + 1))).collect()
        };
        baseline.prepare(&cases).expect("tables");
        assert_eq!(state(&baseline), [(1, true), (1, true), (1, true)]);
        baseline.expand(&cases, &[1]).expect("an expansion");
        assert_eq!(state(&baseline), [(1, false), (2, true), (1, false)]);
        for _ in 0..2 {
            baseline.prepare_rest(&cases).expect("tables");
            assert_eq!(state(&baseline), [(2, true), (2, true), (2, true)]);
        }
    }
}
