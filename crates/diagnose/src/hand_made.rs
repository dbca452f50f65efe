//! A survey and tables of energy made by hand, for unit tests: no mesh, no paths, no files.

use crate::config::DiagnoseConfig;
use crate::effect::Case;
use crate::extend::rigid_motion::RigidMotion;
use crate::infer::baseline::Baseline;
use crate::likelihood::arrivals::ArrivalData;
use crate::likelihood::decay::EnergyData;
use crate::likelihood::laplace::Prior;
use crate::observe::early_energy::EarlySamples;
use crate::observe::observations::Observations;
use crate::observe::observed_response::Measured;
use crate::observe::stated_parameter::StatedParameter;
use crate::observe::time_bins::Bins;
use crate::simulate::band_state::BandState;
use crate::simulate::simulation::Simulation;
use crate::simulate::table_readings::{TimeAxis, read};
use crate::simulate::tables::Tables as Prepared;
use crate::simulate::traced_pair::Arrival;
use crate::survey::surfaces::{Surface, axes_of};
use crate::survey::{Place, Survey, SurveyedResponse};
use sabine_acoustics::{Air, Bands, Material, ParameterKind, PerBand};
use sabine_scene::{Levels, MaterialPrior, Measurement, TimeZero};
use std::collections::{BTreeMap, BTreeSet};

/// Bins of each band.
const BINS: usize = 14;
/// Stated absorption of each material and octave.
const ABSORPTION: [[f64; 2]; 2] = [[0.3, 0.4], [0.1, 0.12]];

/// Two materials, two octaves, one source, three receivers.
pub(crate) fn survey(levels: Levels, time_zero: TimeZero) -> Survey {
    let air = Air::new(20.0, 50.0, 101.325).expect("ordinary air");
    let place = |id: &str, position_m| Place {
        id: id.to_owned(),
        position_m,
        axis: Some([1.0, 0.0, 0.0]),
        position_sd_m: 0.01,
    };
    let receivers =
        vec![place("r0", [3.0, 1.5, 1.2]), place("r1", [4.0, 3.0, 1.5]), place("r2", [1.5, 3.2, 1.1])];
    let source = place("s0", [1.0, 1.0, 1.4]);
    let responses = (0..3)
        .map(|receiver| {
            let far: f64 = (0..3)
                .map(|k| (receivers[receiver].position_m[k] - source.position_m[k]).powi(2))
                .sum::<f64>()
                .sqrt();
            SurveyedResponse {
                source: 0,
                receiver,
                name: format!("s0-r{receiver}"),
                air,
                duration_s: 0.4,
                direct_s: far / air.speed_of_sound_m_s(),
                sounds_until_s: 0.4,
                recorded_at: None,
            }
        })
        .collect();
    let bands = Bands::octaves(1000.0, 2000.0).expect("two octaves");
    let table = |absorption: [f64; 2]| MaterialPrior {
        absorption: PerBand::new(bands, absorption.to_vec()).ok(),
        absorption_sd: PerBand::uniform(bands, 0.01),
    };
    Survey {
        bands,
        air,
        air_assumed: false,
        measurement: Measurement { time_zero, levels },
        materials: vec!["carpet".to_owned(), "plaster".to_owned()],
        absorption_priors: ABSORPTION.map(table).to_vec(),
        sources: vec![source],
        receivers,
        responses,
        box_m: [[0.0; 3], [5.0, 4.0, 2.5]],
        declared_scattering: 0.1,
        planes: Vec::new(),
        surfaces: surfaces(),
        material_areas_m2: vec![20.0, 65.0],
        diffracted: Vec::new(),
        bands_of_modes: 1,
    }
}

/// Everything that a likelihood needs.
pub(crate) struct Tables {
    pub survey: Survey,
    pub measured: Vec<Measured>,
    pub states: Vec<Vec<BandState>>,
    pub arrivals: Vec<Vec<Arrival>>,
    ends: Vec<Vec<usize>>,
    direct_s: Vec<f64>,
    speed_m_s: Vec<f64>,
    reference: Vec<f64>,
    pub absorption: Vec<Vec<f64>>,
    priors: Vec<Vec<Prior>>,
    dispersion: Vec<f64>,
    level_sd: Vec<f64>,
    drift_sd: Vec<f64>,
}

impl Tables {
    /// All responses late by so much: direct sounds and later peaks.
    pub fn late(mut self, latency_s: f64) -> Self {
        for measured in &mut self.measured {
            measured.direct_s += latency_s;
            measured.peaks_s.iter_mut().for_each(|p| *p += latency_s);
        }
        self
    }

    /// Times as they are if a receiver stands so far from where the survey has it.
    pub fn with_receiver_moved(self, receiver: usize, offset_m: [f64; 3]) -> Self {
        let mut truth = self.survey.clone();
        let place = &mut truth.receivers[receiver].position_m;
        *place = std::array::from_fn(|k| place[k] + offset_m[k]);
        self.measured_at(&truth)
    }

    /// Times as they are if all places stand where a motion brings them.
    pub fn with_places_moved(self, motion: &RigidMotion) -> Self {
        let mut truth = self.survey.clone();
        for place in truth.sources.iter_mut().chain(&mut truth.receivers) {
            place.position_m = motion.moved(place.position_m);
        }
        self.measured_at(&truth)
    }

    /// Times as they are at the places of another survey.
    fn measured_at(mut self, truth: &Survey) -> Self {
        for (pair, response) in truth.responses.iter().enumerate() {
            let found = measured(truth, pair, &self.states[pair], &arrivals(truth, response));
            self.measured[pair] = found;
        }
        self
    }

    /// Decays of 0.4 s with a scatter of a few decibels, one bin of which is far louder than anything predicted.
    pub fn new(levels: Levels, time_zero: TimeZero) -> Self {
        let survey = survey(levels, time_zero);
        let (pairs, bands) = (survey.responses.len(), survey.bands.len());
        let states: Vec<Vec<BandState>> = (0..pairs)
            .map(|pair| {
                let one = |band: usize| {
                    BandState::by_hand(Bins::new(survey.bands, band), BINS, 2, 0.1 * pair as f64)
                };
                (0..bands).map(one).collect()
            })
            .collect();
        let arrivals: Vec<Vec<Arrival>> = survey.responses.iter().map(|r| arrivals(&survey, r)).collect();
        let measured =
            (0..pairs).map(|pair| measured(&survey, pair, &states[pair], &arrivals[pair])).collect();
        let prior = |mean: f64| Prior { mean, sd: 0.1, low: 0.002, high: 0.98 };
        Self {
            ends: vec![vec![BINS; bands]; pairs],
            direct_s: survey.responses.iter().map(|r| r.direct_s).collect(),
            speed_m_s: survey.responses.iter().map(|r| r.air.speed_of_sound_m_s()).collect(),
            reference: vec![0.05; bands],
            absorption: ABSORPTION.map(Vec::from).to_vec(),
            priors: vec![vec![prior(0.3), prior(0.4)], vec![prior(0.1), prior(0.12)]],
            dispersion: vec![1.0, 1.3],
            level_sd: vec![0.16, 0.2],
            drift_sd: vec![0.0, 0.2],
            survey,
            measured,
            states,
            arrivals,
        }
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
            gain_sd_db: 0.4,
            level_sd: &self.level_sd,
            tables: &[],
            dispersion: &self.dispersion,
            drift_sd: &self.drift_sd,
        }
    }

    /// Tables made by hand for cases whose terms prepare some, which get their slots.
    pub fn prepared(&self, cases: &mut [Case]) -> Vec<Prepared> {
        let (pairs, bands) = (self.survey.responses.len(), self.survey.bands.len());
        let mut all = Vec::new();
        for case in cases {
            case.slot = Some(all.len());
            let table = || case.decay_term().and_then(|term| term.by_hand(BINS));
            let of_pair = |_| (0..bands).map(|_| table()).collect::<Option<Vec<_>>>();
            all.push(
                (0..pairs)
                    .map(of_pair)
                    .collect::<Option<_>>()
                    .map_or_else(Prepared::default, Prepared::boxed),
            );
        }
        all
    }

    /// With a table of parameters of each pair in the place of its response: as predicted, and off by some hundredths.
    pub fn with_parameters(mut self) -> Self {
        let kinds = [ParameterKind::Edt, ParameterKind::C50, ParameterKind::C80, ParameterKind::CentreTime];
        let stated = kinds.map(|kind| StatedParameter { kind, ln_sd: 0.05 }).to_vec();
        for (pair, (measured, states)) in self.measured.iter_mut().zip(&mut self.states).enumerate() {
            for (band, (energies, state)) in measured.energies.iter_mut().zip(states).enumerate() {
                let axis = TimeAxis { bins: state.bins, time_s: &state.time_s };
                let predicted = read(&stated, axis, &state.ln_energy);
                let off = |k: usize| 0.03 * (3.0 * k as f64 + 2.0 * pair as f64 + band as f64).sin();
                *energies = Some(predicted.iter().enumerate().map(|(k, ln)| (ln + off(k)).exp()).collect());
                state.find_table_chance(&stated);
            }
            measured.table = Some(vec![stated.clone(); measured.energies.len()]);
        }
        self
    }

    /// A baseline of these tables: what the search, the selection and the model need.
    pub fn baseline(self, config: DiagnoseConfig) -> Baseline {
        let column = |values: &Vec<f64>| PerBand::new(self.survey.bands, values.clone());
        let scattering = PerBand::uniform(self.survey.bands, 0.1);
        let material = |a: &Vec<f64>| Material::new(column(a)?, scattering.clone());
        let materials: Result<Vec<Material>, sabine_acoustics::Error> =
            self.absorption.iter().map(material).collect();
        let materials = materials.expect("absorption between 0 and 1");
        let simulation = Simulation::by_hand(&self.survey, materials, self.states, self.arrivals);
        Baseline {
            observations: Observations::without_files(self.survey, self.measured, Vec::new()),
            simulation: simulation.expect("a box that can be traced"),
            config,
            priors: self.priors,
            dispersion: self.dispersion,
            level_sd: self.level_sd,
            drift_sd: self.drift_sd,
            seconds: BTreeMap::new(),
            stale: BTreeSet::new(),
        }
    }

    pub fn arrival_data(&self) -> ArrivalData<'_> {
        ArrivalData {
            survey: &self.survey,
            measured: &self.measured,
            arrivals: &self.arrivals,
            speed_m_s: &self.speed_m_s,
            displaced: &[],
        }
    }
}

/// The surfaces that the reflections meet: floor, ceiling and two walls.
fn surfaces() -> Vec<Surface> {
    let one = |(axis, at): (usize, f64)| {
        let mut normal = [0.0; 3];
        normal[axis] = if at > 0.0 { 1.0 } else { -1.0 };
        let mut centre_m = [2.5, 2.0, 1.25];
        centre_m[axis] = at;
        Surface {
            axes: axes_of(normal),
            centre_m,
            area_m2: 10.0,
            materials: vec![axis % 2],
            reflections: 3,
            range_m: [-0.5, 0.8],
        }
    };
    [(2, 0.0), (2, 2.5), (0, 0.0), (1, 4.0)].map(one).to_vec()
}

/// The direct sound and the first reflections at floor, ceiling and two walls.
fn arrivals(survey: &Survey, response: &SurveyedResponse) -> Vec<Arrival> {
    let source = survey.sources[response.source].position_m;
    let receiver = survey.receivers[response.receiver].position_m;
    let mut found = Vec::new();
    let walls = [(0, None), (2, Some(0.0)), (2, Some(2.5)), (0, Some(0.0)), (1, Some(4.0))];
    for (number, (axis, wall)) in walls.into_iter().enumerate() {
        let mut image = source;
        if let Some(wall) = wall {
            image[axis] = 2.0 * wall - source[axis];
        }
        let way: [f64; 3] = std::array::from_fn(|k| image[k] - receiver[k]);
        let length_m = way.iter().map(|x| x * x).sum::<f64>().sqrt();
        let arrival = way.map(|x| x / length_m);
        let mut departure = arrival.map(|x| -x);
        if wall.is_some() {
            departure[axis] = -departure[axis];
        }
        let surfaces = number.checked_sub(1).into_iter().collect();
        found.push(Arrival { length_m, departure, arrival, energy: 1.0 / (length_m * length_m), surfaces });
    }
    found.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
    found
}

fn measured(survey: &Survey, pair: usize, states: &[BandState], arrivals: &[Arrival]) -> Measured {
    let speed_m_s = survey.responses[pair].air.speed_of_sound_m_s();
    let off = [1.2, 0.7, 1.0, 1.6, 0.5, 0.9, 1.1];
    let energies = states.iter().enumerate().map(|(band, state)| {
        let one = |(bin, ln): (usize, &f64)| {
            let far = if (pair, band, bin) == (1, 0, 6) { 40.0 } else { 1.0 };
            far * off[(3 * pair + 5 * band + bin) % off.len()] * ln.exp()
        };
        Some(state.ln_energy.iter().enumerate().map(one).collect())
    });
    let later = &arrivals[1..];
    Measured {
        energies: energies.collect(),
        table: None,
        direct_s: arrivals[0].length_m / speed_m_s + 6e-6,
        peaks_s: later
            .iter()
            .zip([3e-5, -4e-5, 2e-5, 9e-5])
            .map(|(a, d)| a.length_m / speed_m_s + d)
            .collect(),
        peaks_db: vec![-6.0; later.len()],
        early: EarlySamples::default(),
        pulse: Vec::new(),
        lead_in: Vec::new(),
        sample_rate_hz: 48_000,
        duration_s: 0.4,
        sounds_until_s: 0.4,
    }
}
