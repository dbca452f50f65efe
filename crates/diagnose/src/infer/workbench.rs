//! Everything that a diagnosis compares, and fits of any set of causes to it.

mod retracing;
mod waves;

use crate::config::DiagnoseConfig;
use crate::effect::Case;
use crate::error::Error;
use crate::likelihood::arrivals;
use crate::likelihood::arrivals::ArrivalData;
use crate::likelihood::decay;
use crate::likelihood::decay::{ABSORPTION, BinResidual, EnergyData, EnergyModel, WarmStart};
use crate::likelihood::discrepancy::FreeDiscrepancy;
use crate::likelihood::laplace::{LaplaceFit, Prior};
use crate::likelihood::parameters::{ArrivalLayout, DecayLayout};
use crate::observe::band_pulse::BandPulse;
use crate::observe::observed_response::{Measured, PEAKS_S};
use crate::observe::pre_arrival::PreArrival;
use crate::simulate::edges::Edges;
use crate::simulate::traced_pair::{Arrival, BandState, CELL_S, IsolatedReflection, TracedPair};
use crate::simulate::traced_room::{prepare, trace, traced_s};
use crate::statistics;
use crate::survey::{Place, Survey, SurveyedResponse};
use rayon::prelude::*;
use sabine_acoustics::{
    ImpulseResponse, Material, MaterialPrior, MeasuredRoom, Observer, PerBand, Receiver, Scene, Source,
    TimeZero, report,
};
use sabine_propagate::{PathTracer, PreparedScene};
use std::collections::BTreeMap;

/// Early time over which the reference energy is the mean, in seconds after the direct sound.
const REFERENCE_S: f64 = 0.05;
/// Rounds of expansion and fit of the baseline.
const ROUNDS: usize = 4;
/// Change of absorption (share of its prior's standard deviation) below which no further round is needed.
const TOLERANCE: f64 = 0.1;

pub(crate) struct Workbench {
    pub survey: Survey,
    /// Responses that may be fitted: those of receivers that are not held out.
    pub fitted: Vec<bool>,
    pub config: DiagnoseConfig,
    pub measured: Vec<Measured>,
    pub pre_arrival: PreArrival,
    pub materials: Vec<Material>,
    pub priors: Vec<Vec<Prior>>,
    pub pairs: Vec<TracedPair>,
    pub kernels: Vec<BandPulse>,
    /// Absorption of the expansion, `[material][band]`.
    pub absorption: Vec<Vec<f64>>,
    pub states: Vec<Vec<BandState>>,
    pub ends: Vec<Vec<usize>>,
    /// Early exact paths of each pair, and their energies by band.
    pub isolated_reflections: Vec<(Vec<IsolatedReflection>, Vec<BandState>)>,
    pub direct_s: Vec<f64>,
    pub speed_m_s: Vec<f64>,
    pub arrivals: Vec<Vec<Arrival>>,
    pub reference: Vec<f64>,
    pub dispersion: Vec<f64>,
    pub notes: Vec<String>,
    traced_s: f64,
    /// Kelvin by which the air was found to be warmer than stated.
    warmer_k: f64,
    /// What is traced: the mesh, with scattering spread over the bands.
    scene: Scene,
    /// The same at the size that was found.
    resized: Option<Scene>,
    tracer: PathTracer,
    prepared: PreparedScene,
    edges: Option<Edges>,
    sources: Vec<Source>,
    receivers: Vec<Receiver>,
    pub seconds: BTreeMap<&'static str, f64>,
}

impl Workbench {
    /// Reads and traces everything, and fits the baseline to all responses but those of the receivers `held`.
    pub fn new(
        room: &MeasuredRoom,
        held: &[usize],
        config: &DiagnoseConfig,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let started = std::time::Instant::now();
        config.check()?;
        let total = room.responses().len();
        if total == 0 {
            return Err(Error::NoResponses);
        }
        let bands = room.bands();
        let mut notes = Vec::new();
        let (mut measured, mut responses) = (Vec::new(), Vec::new());
        let mut kernels: BTreeMap<u32, Vec<BandPulse>> = BTreeMap::new();
        let mut samples: Vec<ImpulseResponse> = Vec::new();
        for (i, entry) in room.responses().iter().enumerate() {
            report(observer, "reading responses", i as u64, total as u64)?;
            let response = room.load_response(i)?;
            let rate = response.sample_rate_hz();
            if let std::collections::btree_map::Entry::Vacant(place) = kernels.entry(rate) {
                place.insert(BandPulse::all(bands, rate, CELL_S)?);
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
        let kernels_by_rate = kernels;
        let kernels = kernels_by_rate.values().next_back().cloned().unwrap_or_default();
        let vertices = room.scene().vertices();
        let corner = |fold: fn(f64, f64) -> f64, from: f64| {
            std::array::from_fn(|k| vertices.iter().map(|v| v[k]).fold(from, fold))
        };
        let materials: Vec<Material> = room.scene().materials().iter().map(|m| m.material.clone()).collect();
        let scatterings: Vec<f64> = materials.iter().flat_map(|m| m.scattering().values().to_vec()).collect();
        let (planes, material_areas_m2) = crate::survey::planes::planes(room.scene());
        let mut survey = Survey {
            planes,
            material_areas_m2,
            diffracted: Vec::new(),
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
            bands_of_modes: if config.wave_solutions {
                waves::bands_of_modes(room.scene(), &materials, &room.air())
            } else {
                0
            },
            declared_scattering: scatterings.iter().sum::<f64>() / scatterings.len() as f64,
        };
        let priors: Vec<Vec<Prior>> = room.priors().iter().map(absorption_priors).collect();
        let traced_s = traced_s(&survey, &measured, config.range_db);
        let (scene, tracer, prepared) = prepare(room, &survey, &materials, config, traced_s)?;
        let edges = Edges::find(&scene)?;
        let pairs = trace(room, &survey, &materials, (&tracer, &prepared, edges.as_ref()), observer)?;
        align_shadowed(&mut survey, &mut measured, &pairs, &samples, &kernels_by_rate);
        survey.diffracted = (0..pairs.len()).filter(|&p| pairs[p].is_diffracted()).collect();
        let absorption = materials
            .iter()
            .map(|m| m.absorption().values().iter().map(|a| a.clamp(ABSORPTION.0, ABSORPTION.1)).collect())
            .collect();
        let fitted: Vec<bool> = survey.responses.iter().map(|r| !held.contains(&r.receiver)).collect();
        if !fitted.contains(&true) {
            return Err(Error::NothingToCompare { responses: total });
        }
        let mut bench = Self {
            fitted,
            direct_s: pairs.iter().map(|p| p.direct_s).collect(),
            speed_m_s: pairs.iter().map(|p| p.speed_m_s).collect(),
            dispersion: vec![1.0; bands.len()],
            config: config.clone(),
            survey,
            pre_arrival: PreArrival {
                responses: measured.iter_mut().map(|m| std::mem::take(&mut m.lead_in)).collect(),
            },
            measured,
            materials,
            priors,
            pairs,
            kernels,
            absorption,
            states: Vec::new(),
            isolated_reflections: Vec::new(),
            ends: Vec::new(),
            arrivals: Vec::new(),
            reference: Vec::new(),
            notes,
            traced_s,
            warmer_k: 0.0,
            scene,
            resized: None,
            tracer,
            prepared,
            edges,
            sources: room.sources().to_vec(),
            receivers: room.receivers().to_vec(),
            seconds: BTreeMap::from([("trace", started.elapsed().as_secs_f64())]),
        };
        bench.expand(false)?;
        for pair in &bench.pairs {
            let found = pair.arrivals(&bench.expanded_materials()?, PEAKS_S * 1.2)?;
            bench.arrivals.push(if pair.has_direct() { found } else { Vec::new() });
        }
        bench.fit_baseline(observer)?;
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
            let one = |pair: &TracedPair| pair.isolated_reflections(&materials, PEAKS_S);
            self.isolated_reflections = self.pairs.par_iter().map(one).collect::<Result<_, _>>()?;
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
        if scattering { self.tabulate_waves(&materials) } else { Ok(()) }
    }

    /// Expands about fitted absorption.
    pub fn expand_about(&mut self, values: &[f64]) -> Result<(), Error> {
        let layout = self.decay_layout();
        for (m, material) in self.absorption.iter_mut().enumerate() {
            material.copy_from_slice(&values[layout.material(m)]);
        }
        self.expand(true)
    }

    /// Fits the baseline, expanding about it anew until it stays.
    fn fit_baseline(&mut self, observer: &dyn Observer) -> Result<(), Error> {
        let started = std::time::Instant::now();
        let used = self.fitted.clone();
        for round in 0..ROUNDS {
            report(observer, "baseline", round as u64, ROUNDS as u64)?;
            let found = self.fit_energy(&[], &used, None)?;
            let layout = self.decay_layout();
            let mut moved = 0.0f64;
            for (m, material) in self.absorption.iter_mut().enumerate() {
                for (b, a) in material.iter_mut().enumerate() {
                    let next = found.0.values[layout.absorption(m, b)];
                    moved = moved.max((next - *a).abs() / self.priors[m][b].sd.min(0.1));
                    *a = next;
                }
            }
            let last = moved < TOLERANCE || round + 1 == ROUNDS;
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

    pub fn decay_layout(&self) -> DecayLayout {
        DecayLayout::of(&self.survey)
    }

    pub fn arrival_layout(&self) -> ArrivalLayout {
        ArrivalLayout::of(&self.survey)
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
        before: Option<WarmStart<'_>>,
    ) -> Result<(LaplaceFit, Vec<usize>), Error> {
        decay::fit(&self.energy_data(), cases, used, before)
    }

    pub fn fit_arrivals(
        &self,
        cases: &[&dyn Case],
        used: &[bool],
    ) -> Result<(LaplaceFit, Vec<usize>), Error> {
        arrivals::fit(&self.arrival_data(), cases, used)
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
        before: Option<WarmStart<'_>>,
    ) -> Result<LaplaceFit, Error> {
        let data = EnergyData { measured, ..self.energy_data() };
        Ok(decay::fit(&data, cases, used, before)?.0)
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

/// Where the direct line is blocked, the first sound is weak and easily missed: the time axis of such a response begins when its first path
/// should come, by the times of the direct sounds of others.
fn align_shadowed(
    survey: &mut Survey,
    measured: &mut [Measured],
    pairs: &[TracedPair],
    samples: &[ImpulseResponse],
    kernels: &BTreeMap<u32, Vec<BandPulse>>,
) {
    if survey.measurement.time_zero == TimeZero::PerResponse {
        return;
    }
    let in_sight = (0..pairs.len()).filter(|&p| pairs[p].has_direct());
    let late_s: Vec<f64> = in_sight.map(|p| measured[p].direct_s - pairs[p].direct_s).collect();
    if late_s.is_empty() && survey.measurement.time_zero != TimeZero::Emission {
        return;
    }
    let late_s = statistics::median(late_s);
    for (i, pair) in pairs.iter().enumerate().filter(|(_, pair)| !pair.has_direct()) {
        let begin_s = pair.direct_s + late_s;
        let kernels = &kernels[&samples[i].sample_rate_hz()];
        if let Ok(found) = Measured::read(&samples[i], survey.bands, kernels, begin_s) {
            survey.responses[i].direct_s = begin_s;
            // What comes first has another shape than a direct sound: its sign says nothing.
            measured[i] = Measured { pulse: Vec::new(), ..found };
        }
    }
}

/// Mean squared standardised residual of each band; what a bin measures above the prediction counts up to e^5 times.
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
