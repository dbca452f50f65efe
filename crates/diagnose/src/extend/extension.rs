//! Turns named causes into a model that renders.

use crate::effect::{Nuisance, Observable};
use crate::effects::{SourceDirectivity, TransducerResponse};
use crate::extend::extended_model::{CoupledDecay, ExtendedModel};
use crate::extend::panels;
use crate::infer::baseline::Baseline;
use crate::infer::search::{Search, State};
use crate::report::found_parameters::{parameters, place_of};
use crate::simulate::traced_pair::scattering_more;

/// Least directed share that is worth a pattern, and the most.
const DIRECTED: (f64, f64) = (0.0, 0.9);

/// The overlay of the named causes over the room file. Effects that do not come with this crate leave it as it is: only their
/// name is kept.
pub(crate) fn extended_model(baseline: &Baseline, search: &Search<'_>, state: &State) -> ExtendedModel {
    let survey = baseline.survey();
    let bands = survey.bands;
    let count = bands.len();
    let per_band = |value: &dyn Fn(usize) -> f64| (0..count).map(value).collect::<Vec<f64>>();
    let mut model = ExtendedModel {
        centres_hz: bands.iter_hz().collect(),
        absorption: survey
            .materials
            .iter()
            .enumerate()
            .map(|(m, name)| {
                (name.clone(), state.energy.values[baseline.decay_layout().material(m)].to_vec())
            })
            .collect(),
        ..ExtendedModel::default()
    };
    for &candidate in &state.chosen {
        let (id, case) = (search.candidates[candidate].id, search.candidates[candidate].case);
        model.causes.push(id.to_owned());
        let values: Vec<f64> = match case.observable() {
            Observable::Channels | Observable::PreArrival => Vec::new(),
            _ => {
                let (maximum, first) = place_of(search, state, candidate);
                maximum.values[first..first + case.parameters(survey).len()].to_vec()
            }
        };
        let octaves = |b: usize| survey.octaves_from_1khz(b);
        match id {
            "transducer_response" => model.gain_db = TransducerResponse::gains_db(&values, survey),
            "air_absorption" => model.relative_humidity_percent = Some(values[0]),
            "source_directivity" => {
                let share = |b: usize| (values[0] + values[1] * octaves(b)).clamp(DIRECTED.0, DIRECTED.1);
                model.directed_share = per_band(&share);
                for (i, source) in survey.sources.iter().enumerate() {
                    model.axis.insert(source.id.clone(), SourceDirectivity::axis(&values, survey, i));
                }
            }
            "scattering" => {
                let scattered = |m: &sabine_acoustics::Material| {
                    per_band(&|b| {
                        let extra = (values[0] + values[1] * octaves(b)).clamp(-1.0, 0.95);
                        scattering_more(m, extra).map_or(0.0, |m| m.scattering().values()[b])
                    })
                };
                model.scattering = survey
                    .materials
                    .iter()
                    .zip(&baseline.simulation.materials)
                    .map(|(name, m)| (name.clone(), scattered(m)))
                    .collect();
            }
            "background_noise" => {
                model.noise_per_s = per_band(&|b| level_per_s(baseline, b) * 10f64.powf(values[b] / 10.0));
            }
            "coupled_volume" => {
                let receivers = survey.receivers.len() as f64;
                model.coupled = Some(CoupledDecay {
                    energy_per_s: per_band(&|b| {
                        level_per_s(baseline, b) * 10f64.powf((values[0] + values[1] * octaves(b)) / 10.0)
                    }),
                    decay_time_s: per_band(&|b| {
                        (values[2] * (values[3] * octaves(b)).exp()).clamp(0.1, 20.0)
                    }),
                    gradient_db_per_m: [values[4], values[5], values[6]],
                    centre_m: std::array::from_fn(|k| {
                        survey.receivers.iter().map(|r| r.position_m[k]).sum::<f64>() / receivers
                    }),
                });
            }
            "room_modes" => {
                model.wave_below_hz = survey.bands_of_modes.checked_sub(1).map(|b| bands.edges_hz(b).1)
            }
            "truncation" => model.truncation = Some([values[0], values[1]]),
            "sound_speed" => model.temperature_c = Some(values[0]),
            "sampling_clock" => model.clock_ppm = Some(values[0]),
            "room_dimensions" => model.dimensions = case.resized(&values),
            "extra_reflector" => model.sheets.extend(panels::panel(search, state, &values)),
            "open_patch" => {
                let inside = survey.sources[survey.responses[0].source].position_m;
                if let Some(plane) = case.plane().and_then(|p| survey.planes.get(p)) {
                    let found = parameters(search, state, candidate);
                    model.sheets.extend(panels::hole(plane, inside, &found));
                }
            }
            "edge_diffraction" => model.diffraction = true,
            "time_zero" => model.latency_s = Some(1e-3 * values[0]),
            "position_error" => {
                let offset: Vec<f64> = parameters(search, state, candidate).iter().map(|p| p.value).collect();
                for (nuisance, _) in case.relaxes() {
                    let place = match nuisance {
                        Nuisance::SourcePosition(i) => &survey.sources[i],
                        Nuisance::ReceiverPosition(i) => &survey.receivers[i],
                        _ => continue,
                    };
                    let moved = std::array::from_fn(|k| place.position_m[k] + offset[k]);
                    model.position_m.insert(place.id.clone(), moved);
                }
            }
            "channel_fault" => {
                if let Some(r) = case.inverted() {
                    model.inverted.push(survey.responses[r].name.clone());
                }
                if let Some((a, b)) = case.exchanged() {
                    model.exchanged.push([a, b].map(|r| survey.responses[r].name.clone()));
                }
                for (nuisance, _) in case.relaxes() {
                    if let Nuisance::ResponseGain(r) = nuisance {
                        let gain_db = state.energy.values[baseline.decay_layout().gain(r)];
                        model.response_gain_db.insert(survey.responses[r].name.clone(), gain_db);
                    }
                }
            }
            _ => {}
        }
    }
    model
}

/// Energy per second to which levels of added sound refer.
fn level_per_s(baseline: &Baseline, band: usize) -> f64 {
    baseline.simulation.reference[band] / baseline.simulation.states[0][band].bins.width_s
}
