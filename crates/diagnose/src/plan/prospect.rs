//! Responses that nobody has recorded, predicted: the data of a measurement to come.

use crate::config::DiagnoseConfig;
use crate::error::Error;
use crate::infer::baseline::{Baseline, absorption_priors, level_sd};
use crate::infer::candidates::CatalogueCase;
use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::early_energy::EarlySamples;
use crate::observe::observations::{Observations, survey_of};
use crate::observe::observed_response::Measured;
use crate::observe::time_bins::Bins;
use crate::plan::candidates::Variation;
use crate::simulate::band_state::BandState;
use crate::simulate::scene_tracer::SceneTracer;
use crate::simulate::simulation::Simulation;
use crate::survey::SurveyedResponse;
use sabine_scene::{DiffuseRoom, MeasuredRoom};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Decays are followed for so much longer than a diffuse field would take: few rooms are diffuse.
const LONGER: f64 = 1.6;
/// Shortest and longest decay that is reckoned with, in seconds for 60 dB.
const DECAY_S: (f64, f64) = (0.15, 6.0);

/// What all prospects of a room have in common.
pub(crate) struct Setting<'a> {
    pub room: &'a MeasuredRoom,
    pub config: &'a DiagnoseConfig,
    pub tracer: &'a Arc<dyn SceneTracer>,
    pub rate_hz: u32,
    pulses: Vec<BandPulse>,
    decays_s: Vec<f64>,
    /// What a fit of measured responses has found of materials and scatter.
    fitted: Option<Fitted>,
}

/// Materials, scatter and levels that a fit has found.
#[derive(Clone)]
pub(crate) struct Fitted {
    absorption: Vec<Vec<f64>>,
    dispersion: Vec<f64>,
    drift_sd: Vec<f64>,
    reference: Vec<f64>,
}

impl Fitted {
    pub fn of(baseline: &Baseline) -> Self {
        Self {
            absorption: baseline.simulation.absorption.clone(),
            dispersion: baseline.dispersion.clone(),
            drift_sd: baseline.drift_sd.clone(),
            reference: baseline.simulation.reference.clone(),
        }
    }
}

impl<'a> Setting<'a> {
    /// Responses are recorded at this sample rate.
    pub fn new(
        room: &'a MeasuredRoom,
        config: &'a DiagnoseConfig,
        tracer: &'a Arc<dyn SceneTracer>,
        rate_hz: u32,
    ) -> Result<Self, Error> {
        let bands = room.bands();
        let diffuse = DiffuseRoom::of_scene(room.scene(), &room.air(), bands)?;
        let decay_s = |d: &DiffuseRoom| (LONGER * d.eyring_t60_s()).clamp(DECAY_S.0, DECAY_S.1);
        Ok(Self {
            room,
            config,
            tracer,
            rate_hz,
            pulses: BandPulse::all(bands, rate_hz, CELL_S)?,
            decays_s: diffuse.values().iter().map(decay_s).collect(),
            fitted: None,
        })
    }

    /// The same about materials and scatter that a fit has found.
    pub fn about(self, fitted: Fitted) -> Self {
        Self { fitted: Some(fitted), ..self }
    }

    /// A response as long as its decay, the exponential of a diffuse field.
    fn unmeasured(&self) -> Measured {
        let bands = self.room.bands();
        let longest_s = self.decays_s.iter().copied().fold(0.0, f64::max);
        let energies = |(band, decay_s): (usize, &f64)| {
            let bins = Bins::new(bands, band);
            let energy = |bin: usize| 10f64.powf(-6.0 * bins.centre_s(bin) / decay_s);
            Some((0..bins.count(longest_s).max(1)).map(energy).collect())
        };
        Measured {
            energies: self.decays_s.iter().enumerate().map(energies).collect(),
            table: None,
            direct_s: 0.0,
            peaks_s: Vec::new(),
            peaks_db: Vec::new(),
            early: EarlySamples::new(bands.len(), 0.0, f64::from(self.rate_hz)),
            pulse: Vec::new(),
            lead_in: Vec::new(),
            sample_rate_hz: self.rate_hz,
            duration_s: longest_s,
            sounds_until_s: longest_s,
        }
    }

    /// Traces the responses of a measurement; tables are prepared for these cases, and refusals do not matter.
    pub fn trace(&self, variation: &Variation, cases: &[CatalogueCase]) -> Result<Baseline, Error> {
        let room = self.room.with_model(
            self.room.scene().clone(),
            self.room.air(),
            variation.sources.clone(),
            variation.receivers.clone(),
        )?;
        let measured = vec![self.unmeasured(); variation.responses.len()];
        let mut survey = survey_of(&room, self.config.position_sd_m);
        survey.responses = variation.responses.iter().map(|r| self.response(&room, r)).collect();
        let mut observations = Observations::without_files(survey, measured, self.pulses.clone());
        let mut simulation = Simulation::trace(&room, &observations, self.tracer, self.config, &())?;
        let pairs = &simulation.pairs;
        observations.survey.diffracted = (0..pairs.len()).filter(|&p| pairs[p].is_diffracted()).collect();
        for (response, direct_s) in observations.survey.responses.iter_mut().zip(&simulation.direct_s) {
            response.direct_s = *direct_s;
        }
        if let Some(fitted) = &self.fitted {
            simulation.absorption.clone_from(&fitted.absorption);
        }
        simulation.expand(&observations, false)?;
        simulation.predict_arrivals(&mut observations)?;
        if let Some(fitted) = &self.fitted {
            simulation.reference.clone_from(&fitted.reference);
        }
        // Energies as predicted: which bins there are is all that matters of them.
        for (measured, states) in observations.measured.iter_mut().zip(&simulation.states) {
            let energies = |state: &BandState| Some(state.ln_energy.iter().map(|ln| ln.exp()).collect());
            measured.energies = states.iter().map(energies).collect();
        }
        let bands = room.bands().len();
        let scatter = |of: fn(&Fitted) -> &Vec<f64>, none: f64| {
            self.fitted.as_ref().map_or(vec![none; bands], |fitted| of(fitted).clone())
        };
        let mut baseline = Baseline {
            priors: room.priors().iter().map(absorption_priors).collect(),
            dispersion: scatter(|f| &f.dispersion, 1.0),
            level_sd: level_sd(&room, self.config),
            drift_sd: scatter(|f| &f.drift_sd, 0.0),
            config: self.config.clone(),
            observations,
            simulation,
            seconds: BTreeMap::new(),
            stale: BTreeSet::new(),
        };
        baseline.prepare(cases)?;
        Ok(baseline)
    }

    fn response(
        &self,
        room: &MeasuredRoom,
        (source, receiver, air): &(usize, usize, sabine_acoustics::Air),
    ) -> SurveyedResponse {
        let longest_s = self.decays_s.iter().copied().fold(0.0, f64::max);
        SurveyedResponse {
            source: *source,
            receiver: *receiver,
            name: format!("{}-{}", room.sources()[*source].id, room.receivers()[*receiver].id),
            air: *air,
            duration_s: longest_s,
            direct_s: 0.0,
            sounds_until_s: longest_s,
            // Not before the last that was measured.
            recorded_at: self.room.responses().iter().filter_map(|r| r.recorded_at).max_by(f64::total_cmp),
        }
    }
}
