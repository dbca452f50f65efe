//! Everything that a diagnosis compares, and fits of any set of causes to it.

use crate::arrival_model::{self, ArrivalData};
use crate::discrepancy::FreeDiscrepancy;
use crate::effect::{Case, Nuisance};
use crate::energy_model::{self, ABSORPTION, Before, BinResidual, EnergyData, EnergyModel};
use crate::gauss_newton::{Maximum, Prior};
use crate::kernel::BandKernel;
use crate::measured::{Measured, PEAKS_S};
use crate::survey::{Place, Survey, SurveyedResponse};
use crate::traced_pair::{Arrival, BandState, CELL_S, Single, TracedPair, scattering_more};
use crate::{DiagnoseConfig, Error};
use rayon::prelude::*;
use sabine_acoustics::{
    Air, ImpulseResponse, Material, MaterialPrior, MeasuredRoom, Observer, PerBand, Receiver, Scene, Source,
    report,
};
use sabine_propagate::{PathTracer, PreparedScene};
use std::collections::BTreeMap;

/// Extra scattering of the bands of the traced scene, in turn: its paths then serve any scattering.
const TRACED_SCATTERING: [f64; 4] = [0.0, 0.12, 0.4, 0.85];
/// Share of the stated absorption at which images are chosen.
const CAUTION: f64 = 0.7;
/// Longest time that is traced after the direct sound, in seconds.
const LONGEST_S: f64 = 2.5;
/// Shortest.
const SHORTEST_S: f64 = 0.2;
/// Decay beyond the compared range that is still traced, in dB.
const MARGIN_DB: f64 = 12.0;
/// Early time over which the reference energy is the mean, in seconds after the direct sound.
const REFERENCE_S: f64 = 0.05;
/// Rounds of expansion and fit of the baseline.
const ROUNDS: usize = 4;
/// Change of absorption (share of its prior's standard deviation) below which no further round is needed.
const SETTLED: f64 = 0.1;
/// Likeness of direct pulses about its typical value: one standard deviation.
const LIKENESS_SD: f64 = 0.2;
/// Share of pulses whose likeness says nothing.
const ODD_PULSE_SHARE: f64 = 1e-6;

pub(crate) struct Workbench {
    pub survey: Survey,
    pub config: DiagnoseConfig,
    pub measured: Vec<Measured>,
    pub materials: Vec<Material>,
    pub priors: Vec<Vec<Prior>>,
    pub pairs: Vec<TracedPair>,
    pub kernels: Vec<BandKernel>,
    /// Absorption of the expansion, `[material][band]`.
    pub absorption: Vec<Vec<f64>>,
    pub states: Vec<Vec<BandState>>,
    pub ends: Vec<Vec<usize>>,
    /// Early exact paths of each pair, and their energies by band.
    pub singles: Vec<(Vec<Single>, Vec<BandState>)>,
    pub direct_s: Vec<f64>,
    pub speed_m_s: Vec<f64>,
    pub arrivals: Vec<Vec<Arrival>>,
    pub reference: Vec<f64>,
    pub dispersion: Vec<f64>,
    pub notes: Vec<String>,
    traced_s: f64,
    tracer: PathTracer,
    prepared: PreparedScene,
    sources: Vec<Source>,
    receivers: Vec<Receiver>,
    pub seconds: BTreeMap<&'static str, f64>,
}

impl Workbench {
    pub fn new(room: &MeasuredRoom, config: &DiagnoseConfig, observer: &dyn Observer) -> Result<Self, Error> {
        let started = std::time::Instant::now();
        config.check()?;
        let total = room.responses().len();
        if total == 0 {
            return Err(Error::NoResponses);
        }
        let bands = room.bands();
        let mut notes = Vec::new();
        let (mut measured, mut responses) = (Vec::new(), Vec::new());
        let mut kernels: BTreeMap<u32, Vec<BandKernel>> = BTreeMap::new();
        let mut samples: Vec<ImpulseResponse> = Vec::new();
        for (i, entry) in room.responses().iter().enumerate() {
            report(observer, "reading responses", i as u64, total as u64)?;
            let response = room.load_response(i)?;
            let rate = response.sample_rate_hz();
            if let std::collections::btree_map::Entry::Vacant(place) = kernels.entry(rate) {
                place.insert(BandKernel::all(bands, rate, CELL_S)?);
            }
            let (source, receiver) = (&room.sources()[entry.source], &room.receivers()[entry.receiver]);
            let name = format!("{}-{}", source.id, receiver.id);
            if let Some(twin) = samples.iter().position(|other| *other == response) {
                let other: &SurveyedResponse = &responses[twin];
                notes.push(format!(
                    "The response {name} is a copy of {}: they count as two measurements, but are one.",
                    other.name
                ));
            }
            match Measured::new(&response, bands, &kernels[&rate]) {
                Ok(found) => {
                    responses.push(SurveyedResponse {
                        source: entry.source,
                        receiver: entry.receiver,
                        name,
                        air: entry.air,
                        duration_s: found.duration_s,
                        direct_s: found.direct_s,
                    });
                    measured.push(found);
                    samples.push(response);
                }
                Err(reason) => notes.push(format!("The response {name} is left out: {reason}.")),
            }
        }
        if measured.is_empty() {
            return Err(Error::NothingToCompare { responses: total });
        }
        // Any rate does for what a filter does over time, as long as it holds the highest band.
        let kernels = kernels.into_iter().next_back().map(|(_, k)| k).unwrap_or_default();
        let vertices = room.scene().vertices();
        let corner = |fold: fn(f64, f64) -> f64, from: f64| {
            std::array::from_fn(|k| vertices.iter().map(|v| v[k]).fold(from, fold))
        };
        let materials: Vec<Material> = room.scene().materials().iter().map(|m| m.material.clone()).collect();
        let scatterings: Vec<f64> = materials.iter().flat_map(|m| m.scattering().values().to_vec()).collect();
        let (planes, material_areas_m2) = crate::planes::planes(room.scene());
        let survey = Survey {
            planes,
            material_areas_m2,
            bands,
            air: room.air(),
            air_assumed: room.air_assumed(),
            measurement: room.measurement(),
            materials: room.scene().materials().iter().map(|m| m.name.clone()).collect(),
            sources: room
                .sources()
                .iter()
                .map(|s| Place { id: s.id.clone(), position_m: s.position_m, axis: s.axis })
                .collect(),
            receivers: room
                .receivers()
                .iter()
                .map(|r| Place { id: r.id.clone(), position_m: r.position_m, axis: r.axis })
                .collect(),
            responses,
            box_m: [corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY)],
            declared_scattering: scatterings.iter().sum::<f64>() / scatterings.len() as f64,
        };
        let priors: Vec<Vec<Prior>> = room.priors().iter().map(absorption_priors).collect();
        let traced_s = traced_s(&survey, &measured, config.range_db);
        let (tracer, prepared) = prepare(room, &survey, &materials, config, traced_s)?;
        let pairs = trace(room, &survey, &materials, (&tracer, &prepared), observer)?;
        let absorption = materials
            .iter()
            .map(|m| m.absorption().values().iter().map(|a| a.clamp(ABSORPTION.0, ABSORPTION.1)).collect())
            .collect();
        let mut bench = Self {
            direct_s: pairs.iter().map(|p| p.direct_s).collect(),
            speed_m_s: pairs.iter().map(|p| p.speed_m_s).collect(),
            dispersion: vec![1.0; bands.len()],
            config: config.clone(),
            survey,
            measured,
            materials,
            priors,
            pairs,
            kernels,
            absorption,
            states: Vec::new(),
            singles: Vec::new(),
            ends: Vec::new(),
            arrivals: Vec::new(),
            reference: Vec::new(),
            notes,
            traced_s,
            tracer,
            prepared,
            sources: room.sources().to_vec(),
            receivers: room.receivers().to_vec(),
            seconds: BTreeMap::from([("trace", started.elapsed().as_secs_f64())]),
        };
        bench.expand(false)?;
        for pair in &bench.pairs {
            let found = pair.arrivals(&bench.expanded_materials()?, PEAKS_S * 1.2)?;
            bench.arrivals.push(if pair.has_direct() { found } else { Vec::new() });
        }
        bench.settle(observer)?;
        Ok(bench)
    }

    /// Materials of the expansion.
    pub fn expanded_materials(&self) -> Result<Vec<Material>, Error> {
        let bands = self.survey.bands;
        let one = |(m, a): (&Material, &Vec<f64>)| m.with_absorption(PerBand::from_fn(bands, |b| a[b]));
        Ok(self.materials.iter().zip(&self.absorption).map(one).collect::<Result<_, _>>()?)
    }

    fn expand(&mut self, scattering: bool) -> Result<(), Error> {
        let materials = self.expanded_materials()?;
        let one = |pair: &TracedPair| pair.expand(&materials, &self.kernels, self.traced_s, scattering);
        self.states = self.pairs.par_iter().map(one).collect::<Result<_, _>>()?;
        if scattering {
            let one = |pair: &TracedPair| pair.singles(&materials, PEAKS_S);
            self.singles = self.pairs.par_iter().map(one).collect::<Result<_, _>>()?;
        }
        let bands = self.survey.bands.len();
        self.ends = self
            .states
            .iter()
            .map(|s| s.iter().map(|b| range_end(b, self.config.range_db)).collect())
            .collect();
        self.reference = (0..bands)
            .map(|band| {
                let early: Vec<f64> = self
                    .states
                    .iter()
                    .flat_map(|s| {
                        let count = s[band].bins.count(REFERENCE_S).clamp(1, s[band].ln_energy.len().max(1));
                        s[band].ln_energy.iter().take(count).map(|l| l.exp())
                    })
                    .collect();
                (early.iter().sum::<f64>() / early.len().max(1) as f64).max(1e-30)
            })
            .collect();
        Ok(())
    }

    /// Expands about fitted absorption.
    pub fn expand_about(&mut self, values: &[f64]) -> Result<(), Error> {
        let bands = self.survey.bands.len();
        for (m, material) in self.absorption.iter_mut().enumerate() {
            material.copy_from_slice(&values[m * bands..(m + 1) * bands]);
        }
        self.expand(true)
    }

    /// Fits the baseline, expanding about it anew until it stays.
    fn settle(&mut self, observer: &dyn Observer) -> Result<(), Error> {
        let started = std::time::Instant::now();
        let used = vec![true; self.pairs.len()];
        for round in 0..ROUNDS {
            report(observer, "baseline", round as u64, ROUNDS as u64)?;
            let found = self.fit_energy(&[], &used, None)?;
            let bands = self.survey.bands.len();
            let mut moved = 0.0f64;
            for (m, material) in self.absorption.iter_mut().enumerate() {
                for (b, a) in material.iter_mut().enumerate() {
                    let next = found.0.values[m * bands + b];
                    moved = moved.max((next - *a).abs() / self.priors[m][b].sd.min(0.1));
                    *a = next;
                }
            }
            let last = moved < SETTLED || round + 1 == ROUNDS;
            self.expand(last)?;
            if last {
                break;
            }
        }
        if self.ends.iter().flatten().all(|&e| e == 0) {
            return Err(Error::NothingToCompare { responses: self.measured.len() });
        }
        self.seconds.insert("baseline", started.elapsed().as_secs_f64());
        Ok(())
    }

    pub fn energy_data(&self) -> EnergyData<'_> {
        EnergyData {
            survey: &self.survey,
            measured: &self.measured,
            states: &self.states,
            ends: &self.ends,
            direct_s: &self.direct_s,
            reference: &self.reference,
            absorption: &self.absorption,
            priors: &self.priors,
            gain_sd_db: self.config.gain_sd_db,
            dispersion: &self.dispersion,
        }
    }

    pub fn arrival_data(&self) -> ArrivalData<'_> {
        ArrivalData {
            survey: &self.survey,
            measured: &self.measured,
            arrivals: &self.arrivals,
            speed_m_s: &self.speed_m_s,
            position_sd_m: self.config.position_sd_m,
        }
    }

    /// Fits decays under the causes that bear on them.
    pub fn fit_energy(
        &self,
        cases: &[&dyn Case],
        used: &[bool],
        before: Option<Before<'_>>,
    ) -> Result<(Maximum, Vec<usize>), Error> {
        energy_model::fit(&self.energy_data(), cases, used, before)
    }

    pub fn fit_arrivals(&self, cases: &[&dyn Case], used: &[bool]) -> Result<(Maximum, Vec<usize>), Error> {
        arrival_model::fit(&self.arrival_data(), cases, used)
    }

    /// Log-likelihood of the signs of the direct sounds.
    pub fn polarity(&self, cases: &[&dyn Case], used: &[bool]) -> f64 {
        let likeness = self.signs();
        let typical = median(likeness.iter().flatten().map(|x| x.abs()).collect());
        likeness
            .iter()
            .enumerate()
            .filter(|(i, _)| used[*i])
            .filter_map(|(i, x)| {
                let turned = cases.iter().filter(|c| c.inverted() == Some(i)).count() % 2 == 1;
                let off = (if turned { -x.as_ref()? } else { *x.as_ref()? }) - typical;
                let density =
                    (-0.5 * (off / LIKENESS_SD).powi(2)).exp() / (LIKENESS_SD * std::f64::consts::TAU.sqrt());
                Some(((1.0 - ODD_PULSE_SHARE) * density + ODD_PULSE_SHARE * 0.5).ln())
            })
            .sum()
    }

    /// Likeness of each direct pulse to the others, positive for the sign of the majority.
    fn signs(&self) -> Vec<Option<f64>> {
        let n = self.measured.len();
        if n < 3 {
            return vec![None; n];
        }
        let likeness: Vec<Vec<f64>> = self
            .measured
            .iter()
            .map(|a| self.measured.iter().map(|b| a.pulse_likeness(b).unwrap_or(0.0)).collect())
            .collect();
        // Signs that agree best: the leading eigenvector by repeated multiplication, from the one most like all others.
        let first = (0..n)
            .max_by(|&a, &b| {
                let sum = |i: usize| likeness[i].iter().map(|x| x.abs()).sum::<f64>();
                sum(a).total_cmp(&sum(b))
            })
            .unwrap_or(0);
        let mut signs: Vec<f64> = likeness[first].clone();
        for _ in 0..50 {
            let next: Vec<f64> =
                likeness.iter().map(|row| row.iter().zip(&signs).map(|(a, b)| a * b).sum()).collect();
            let norm = next.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
            signs = next.into_iter().map(|x| x / norm).collect();
        }
        let positive = signs.iter().filter(|s| **s > 0.0).count();
        let majority = if 2 * positive >= n { 1.0 } else { -1.0 };
        (0..n)
            .map(|i| {
                let others: Vec<f64> = (0..n)
                    .filter(|&j| j != i && likeness[i][j] != 0.0)
                    .map(|j| likeness[i][j] * (majority * signs[j]).signum())
                    .collect();
                (!others.is_empty()).then(|| median(others))
            })
            .collect()
    }

    pub fn free_discrepancy(&self) -> FreeDiscrepancy {
        let end_s = (0..self.survey.bands.len())
            .map(|band| {
                (0..self.pairs.len())
                    .map(|p| self.states[p][band].bins.edge_s(self.ends[p][band]))
                    .fold(0.02, f64::max)
            })
            .collect();
        FreeDiscrepancy { end_s }
    }

    /// Fits decays to energies other than those measured.
    pub fn fit_energy_to(
        &self,
        measured: &[Measured],
        cases: &[&dyn Case],
        used: &[bool],
        before: Option<Before<'_>>,
    ) -> Result<Maximum, Error> {
        let data = EnergyData { measured, ..self.energy_data() };
        Ok(energy_model::fit(&data, cases, used, before)?.0)
    }

    /// Which response holds which pair.
    pub fn assignment(&self, cases: &[&dyn Case]) -> Vec<usize> {
        let mut assignment: Vec<usize> = (0..self.pairs.len()).collect();
        for (a, b) in cases.iter().filter_map(|c| c.exchanged()) {
            assignment.swap(a, b);
        }
        assignment
    }

    /// Bins of the given pairs under fitted values.
    pub fn residuals(&self, cases: &[&dyn Case], values: &[f64], pairs: &[usize]) -> Vec<BinResidual> {
        let used = vec![true; self.pairs.len()];
        let data = self.energy_data();
        EnergyModel::new(&data, cases, &used).residuals(values, pairs.iter().copied())
    }

    /// Traces the pairs of a source or receiver anew from where it was found to stand: levels of early reflections change with it.
    /// Arrival times stay relative to the stated place.
    pub fn move_place(&mut self, place: Nuisance, offset_m: [f64; 3]) -> Result<(), Error> {
        let moved = |position: [f64; 3]| std::array::from_fn(|k| position[k] + offset_m[k]);
        match place {
            Nuisance::SourcePosition(i) => {
                self.sources[i].position_m = moved(self.survey.sources[i].position_m)
            }
            Nuisance::ReceiverPosition(i) => {
                self.receivers[i].position_m = moved(self.survey.receivers[i].position_m);
            }
            Nuisance::Absorption(_) | Nuisance::ResponseGain(_) => return Ok(()),
        }
        for (pair, response) in self.survey.responses.iter().enumerate() {
            let concerned = place == Nuisance::SourcePosition(response.source)
                || place == Nuisance::ReceiverPosition(response.receiver);
            let ends = (&self.sources[response.source], &self.receivers[response.receiver]);
            if concerned {
                // A place outside the room is none: the stated one is as good.
                if let Ok(paths) =
                    self.tracer.trace_prepared(&self.prepared, ends.0, ends.1, &response.air, &())
                {
                    self.pairs[pair] = TracedPair::new(paths, response.air, &self.materials)?;
                    self.direct_s[pair] = self.pairs[pair].direct_s;
                }
            }
        }
        self.expand(true)
    }

    /// Takes all paths at another temperature. Arrival times stay relative to the stated one.
    pub fn warm(&mut self, kelvin: f64) -> Result<(), Error> {
        for (pair, traced) in self.pairs.iter_mut().enumerate() {
            let stated = self.survey.responses[pair].air;
            let temperature_c = (stated.temperature_c() + kelvin).clamp(-40.0, 60.0);
            let air = Air::new(temperature_c, stated.relative_humidity_percent(), stated.pressure_kpa())?;
            traced.set_air(air);
            self.direct_s[pair] = traced.direct_s;
        }
        self.expand(true)
    }

    /// Sets the dispersion of each band to what the bins still scatter once anything smooth has been taken out.
    pub fn calibrate_dispersion(&mut self, cases: &[&dyn Case], used: &[bool]) -> Result<(), Error> {
        let free = self.free_discrepancy();
        let mut all = cases.to_vec();
        all.push(&free);
        let (found, _) = self.fit_energy(&all, used, None)?;
        let pairs: Vec<usize> = (0..used.len()).filter(|&p| used[p]).collect();
        let residuals = self.residuals(&all, &found.values, &pairs);
        self.dispersion =
            dispersion(&residuals, self.survey.bands.len()).iter().map(|d| d.max(1.0)).collect();
        Ok(())
    }
}

/// Mean squared standardised residual of each band, large ones trimmed: a single odd bin must not stand for all.
pub(crate) fn dispersion(residuals: &[BinResidual], bands: usize) -> Vec<f64> {
    (0..bands)
        .map(|band| {
            let own: Vec<f64> = residuals
                .iter()
                .filter(|r| r.band == band)
                .map(|r| (r.ln_ratio.min(5.0).exp() - 1.0).powi(2) / r.variance)
                .collect();
            if own.is_empty() { 1.0 } else { own.iter().sum::<f64>() / own.len() as f64 }
        })
        .collect()
}

pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

fn absorption_priors(prior: &MaterialPrior) -> Vec<Prior> {
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

/// First bin that the compared range leaves out.
fn range_end(state: &BandState, range_db: f64) -> usize {
    let energies: Vec<f64> = state.ln_energy.iter().map(|l| l.exp()).collect();
    let total: f64 = energies.iter().sum();
    let floor = total * 10f64.powf(-range_db / 10.0);
    let mut left = total;
    for (bin, e) in energies.iter().enumerate() {
        if left < floor {
            return bin;
        }
        left -= e;
    }
    energies.len()
}

/// How long paths must be followed after the direct sound: until the slowest measured decay is through.
fn traced_s(survey: &Survey, measured: &[Measured], range_db: f64) -> f64 {
    let mut longest = SHORTEST_S;
    for m in measured {
        for (band, energies) in m.energies.iter().enumerate() {
            let Some(energies) = energies else { continue };
            let bins = crate::bins::Bins::new(survey.bands, band);
            let total: f64 = energies.iter().sum();
            let floor = total * 10f64.powf(-(range_db + MARGIN_DB) / 10.0);
            let mut left = total;
            let end = energies.iter().position(|e| {
                left -= e;
                left < floor
            });
            longest = longest.max(bins.edge_s(end.unwrap_or(energies.len())));
        }
    }
    longest.min(LONGEST_S)
}

/// The tracer, and the scene with scattering spread over the bands.
fn prepare(
    room: &MeasuredRoom,
    survey: &Survey,
    materials: &[Material],
    config: &DiagnoseConfig,
    traced_s: f64,
) -> Result<(PathTracer, PreparedScene), Error> {
    let bands = survey.bands;
    let spread: Vec<Material> = materials
        .iter()
        .map(|m| {
            let columns: Vec<Material> =
                TRACED_SCATTERING.iter().map(|&extra| scattering_more(m, extra)).collect::<Result<_, _>>()?;
            let scattering = PerBand::from_fn(bands, |b| columns[b % columns.len()].scattering().values()[b]);
            // Absorption only says which images of a cuboid matter: less than stated, for it may be fitted so.
            let absorption = PerBand::from_fn(bands, |b| CAUTION * m.absorption().values()[b]);
            Material::new(absorption, scattering)
        })
        .collect::<Result<_, sabine_acoustics::Error>>()?;
    let scene: Scene = room.scene().with_materials(spread)?;
    // The pairs differ in length by metres: the longest direct path sets the duration.
    let slowest = survey.responses.iter().map(|r| r.air.speed_of_sound_m_s()).fold(f64::INFINITY, f64::min);
    let diagonal: f64 = (0..3).map(|k| (survey.box_m[1][k] - survey.box_m[0][k]).powi(2)).sum::<f64>().sqrt();
    let tracer = PathTracer::new(config.tracer(traced_s + diagonal / slowest + 0.05))?;
    let prepared = tracer.prepare(&scene)?;
    if !config.allow_leaks {
        prepared.check_leaks(&scene, room.sources()[survey.responses[0].source].position_m)?;
    }
    Ok((tracer, prepared))
}

fn trace(
    room: &MeasuredRoom,
    survey: &Survey,
    materials: &[Material],
    (tracer, prepared): (&PathTracer, &PreparedScene),
    observer: &dyn Observer,
) -> Result<Vec<TracedPair>, Error> {
    let mut found: Vec<TracedPair> = Vec::new();
    for (i, response) in survey.responses.iter().enumerate() {
        report(observer, "tracing", i as u64, survey.responses.len() as u64)?;
        let (source, receiver) = (&room.sources()[response.source], &room.receivers()[response.receiver]);
        let paths = tracer.trace_prepared(prepared, source, receiver, &response.air, &())?;
        found.push(TracedPair::new(paths, response.air, materials)?);
    }
    Ok(found)
}
