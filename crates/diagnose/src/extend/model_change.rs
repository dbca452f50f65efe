//! A change of the model: what a named cause does to the room and to the recording.

use crate::extend::applied_changes::{AppliedChanges, CoupledDecay, Dimensions, GainOverTime, ThinPanel};
use crate::extend::box_object::BoxObject;
use crate::extend::displaced_surface::{DisplacedSurface, put};
use crate::extend::rigid_motion::RigidMotion;
use sabine_paths::laws::Law;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One change of a model, and its form in a file: [`ExtendedModel`](crate::ExtendedModel) holds all of them in order and renders; those that
/// move paths are traced again while the search goes on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum ModelChange {
    /// Gain of loudspeaker and microphone by band, in dB.
    #[serde(rename = "gain_db")]
    BandGains(Vec<f64>),
    /// Relative humidity in percent.
    #[serde(rename = "relative_humidity_percent")]
    RelativeHumidity(f64),
    /// Temperature in degrees Celsius.
    #[serde(rename = "temperature_c")]
    Temperature(f64),
    /// First-order pattern of the sources: directed share by band, 0 to 1, and the axis of each source by name.
    SourcePattern {
        /// Directed share by band.
        directed_share: Vec<f64>,
        /// Axis of each source.
        axis: BTreeMap<String, [f64; 3]>,
    },
    /// First-order pattern of receivers by name: directed share by band, 0 to 1, and axis.
    ReceiverPattern {
        /// Directed share by band.
        directed_share: BTreeMap<String, Vec<f64>>,
        /// Axis.
        axis: BTreeMap<String, [f64; 3]>,
    },
    /// Scattering by material and band.
    Scattering(BTreeMap<String, Vec<f64>>),
    /// Noise by band: energy per second relative to that of the direct sound at 1 m.
    #[serde(rename = "noise_per_s")]
    Noise(Vec<f64>),
    /// The decay of a coupled volume.
    #[serde(rename = "coupled")]
    CoupledVolume(CoupledDecay),
    /// Below this frequency in Hz responses are those of the wave equation.
    #[serde(rename = "wave_below_hz")]
    WaveBelow(f64),
    /// End of the response and length of its fade, in seconds from the first sample.
    #[serde(rename = "truncation_s")]
    Truncation([f64; 2]),
    /// Deviation of the sampling clock in parts per million.
    #[serde(rename = "clock_ppm")]
    Clock(f64),
    /// Size of the room.
    Dimensions(Dimensions),
    /// A surface of the mesh stands elsewhere. Several make a room together, whatever their order; of one surface the last counts.
    #[serde(rename = "surface")]
    SurfaceDisplacement(DisplacedSurface),
    /// A flat surface that the mesh lacks.
    #[serde(rename = "sheet")]
    Panel(ThinPanel),
    /// A box-shaped obstacle that the mesh lacks.
    Object(BoxObject),
    /// Sound is diffracted at the edges of the mesh.
    Diffraction,
    /// Specular reflections add as pressures.
    CoherentReflections,
    /// By which share all walls react locally: absorption by the angle of incidence (0: the same at all angles; 1: that of a real impedance).
    #[serde(rename = "locally_reacting_share")]
    LocalReaction(f64),
    /// Latency of all responses in seconds.
    #[serde(rename = "latency_s")]
    Latency(f64),
    /// All sources and receivers stand elsewhere together, with their axes: from the coordinates of the room file to those of the mesh. It
    /// acts on places that other changes state, too, whatever their order.
    CoordinateShift(RigidMotion),
    /// Position of a source or receiver, by name, in metres, in the coordinates of the room file.
    #[serde(rename = "position")]
    Position {
        /// Its name.
        id: String,
        /// Metres.
        position_m: [f64; 3],
    },
    /// A response (SOURCE-RECEIVER) whose sign is turned.
    Inverted(String),
    /// Gain of one response (SOURCE-RECEIVER) in dB.
    ResponseGain {
        /// The response.
        response: String,
        /// Its gain in dB.
        gain_db: f64,
    },
    /// Gain of one response (SOURCE-RECEIVER) by band, in dB.
    ResponseBandGains {
        /// The response.
        response: String,
        /// Its gains in dB.
        gain_db: Vec<f64>,
    },
    /// Two responses that were exchanged.
    Exchanged([String; 2]),
    /// Gain of all responses over the time of the file.
    GainOverTime(GainOverTime),
    /// A formula that changes what paths carry; of one identifier the last counts.
    Law(Box<Law>),
}

impl ModelChange {
    /// Whether the paths are others with it: the room is traced again.
    pub(crate) fn moves_paths(&self) -> bool {
        matches!(
            self,
            Self::Position { .. }
                | Self::CoordinateShift(_)
                | Self::Temperature(_)
                | Self::Dimensions(_)
                | Self::SurfaceDisplacement(_)
                | Self::Object(_)
        )
    }
}

impl AppliedChanges {
    /// Takes one change more.
    pub(crate) fn apply(&mut self, change: ModelChange) {
        match change {
            ModelChange::BandGains(gain_db) => self.gain_db = gain_db,
            ModelChange::RelativeHumidity(percent) => self.relative_humidity_percent = Some(percent),
            ModelChange::Temperature(celsius) => self.temperature_c = Some(celsius),
            ModelChange::SourcePattern { directed_share, axis } => {
                self.directed_share = directed_share;
                self.axis = axis;
            }
            ModelChange::ReceiverPattern { directed_share, axis } => {
                self.receiver_directed_share.extend(directed_share);
                self.receiver_axis.extend(axis);
            }
            ModelChange::Scattering(scattering) => self.scattering = scattering,
            ModelChange::Noise(energy_per_s) => self.noise_per_s = energy_per_s,
            ModelChange::CoupledVolume(decay) => self.coupled = Some(decay),
            ModelChange::WaveBelow(hz) => self.wave_below_hz = Some(hz),
            ModelChange::Truncation(end_and_fade_s) => self.truncation = Some(end_and_fade_s),
            ModelChange::Clock(ppm) => self.clock_ppm = Some(ppm),
            ModelChange::Dimensions(dimensions) => self.dimensions = Some(dimensions),
            ModelChange::SurfaceDisplacement(surface) => put(&mut self.surfaces, surface),
            ModelChange::Panel(panel) => self.sheets.push(panel),
            ModelChange::Object(object) => self.objects.push(object),
            ModelChange::Diffraction => self.diffraction = true,
            ModelChange::CoherentReflections => self.coherent_reflections = true,
            ModelChange::LocalReaction(share) => self.locally_reacting_share = Some(share),
            ModelChange::Law(law) => {
                self.laws.retain(|known| known.id() != law.id());
                self.laws.push(*law);
            }
            ModelChange::Latency(seconds) => self.latency_s = Some(seconds),
            ModelChange::Position { id, position_m } => {
                self.position_m.insert(id, position_m);
            }
            ModelChange::CoordinateShift(motion) => self.coordinate_shift = Some(motion),
            ModelChange::Inverted(response) => self.inverted.push(response),
            ModelChange::ResponseGain { response, gain_db } => {
                self.response_gain_db.insert(response, gain_db);
            }
            ModelChange::ResponseBandGains { response, gain_db } => {
                self.response_band_gain_db.insert(response, gain_db);
            }
            ModelChange::Exchanged(responses) => self.exchanged.push(responses),
            ModelChange::GainOverTime(gain) => self.gain_over_time = Some(gain),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Effect, FittedCase, Nuisance};
    use crate::effects::{ChannelFault, PositionError, SoundSpeed, TransducerResponse};
    use crate::hand_made;
    use sabine_scene::{Levels, TimeZero};

    #[test]
    fn changes_of_one_kind_that_concern_different_things_add_up() {
        let survey = hand_made::survey(Levels::Common, TimeZero::Emission);
        let mut model = AppliedChanges::default();
        for (response, gain_db) in [(0, 3.0), (2, -4.0)] {
            for case in ChannelFault.cases(&survey) {
                let relaxed = Nuisance::ResponseGain(response);
                if case.relaxes.iter().any(|(nuisance, _)| *nuisance == relaxed) {
                    let mut fitted = FittedCase::of_values(&survey, &[]);
                    fitted.relaxed.push((relaxed, vec![gain_db]));
                    case.model_changes(&fitted).into_iter().for_each(|change| model.apply(change));
                }
            }
        }
        let expected = [("s0-r0".to_owned(), 3.0), ("s0-r2".to_owned(), -4.0)];
        assert_eq!(model.response_gain_db, BTreeMap::from(expected));
        let case = &PositionError.cases(&survey)[1];
        let mut fitted = FittedCase::of_values(&survey, &[]);
        fitted.relaxed.push((Nuisance::ReceiverPosition(0), vec![0.1, -0.2, 0.0]));
        case.model_changes(&fitted).into_iter().for_each(|change| model.apply(change));
        assert_eq!(model.position_m["r0"], [3.1, 1.3, 1.2]);
    }

    #[test]
    fn every_case_of_the_catalogue_that_is_fitted_changes_the_model_or_says_why_not() {
        let survey = hand_made::survey(Levels::Absolute, TimeZero::Emission);
        // Absorption is always part of the model; distortion and delays by height are named and not rendered.
        let silent =
            ["surface_absorption", "absorption_tables", "nonlinear_distortion", "temperature_gradient"];
        for effect in crate::effects::catalogue() {
            for case in effect.cases(&survey) {
                let values: Vec<f64> = case.parameters.iter().map(|p| p.typical).collect();
                let mut fitted = FittedCase::of_values(&survey, &values);
                fitted.relaxed = case.relaxes.iter().map(|(n, _)| (*n, vec![0.1; 3])).collect();
                fitted.level_per_s = vec![1.0; survey.bands().len()];
                fitted.confirmed = (0..survey.responses().len()).collect();
                let changes = case.model_changes(&fitted).len();
                assert_eq!(changes == 0, silent.contains(&&*effect.id()), "{}", effect.id());
            }
        }
        assert_eq!(
            SoundSpeed.cases(&survey)[0].model_changes(&FittedCase::of_values(&survey, &[23.0])),
            [ModelChange::Temperature(23.0)]
        );
        let gains =
            TransducerResponse.cases(&survey)[0].model_changes(&FittedCase::of_values(&survey, &[1.0, 2.0]));
        assert_eq!(gains, [ModelChange::BandGains(vec![1.0, 2.0])]);
    }
}
