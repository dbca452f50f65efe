//! What a laboratory hides, as changes of the model.

use sabine::acoustics::FilterBank;
use sabine::diagnose::{Dimensions, DisplacedSurface, ModelChange, RigidMotion, ThinPanel};
use sabine_testkit::{End, Fault, Hidden, Laboratory, Truth};
use sabine_validation::AnyError;
use serde::{Deserialize, Serialize};

/// A panel that stands for a hole lies so far before its wall, in metres.
const BEFORE_WALL_M: f64 = 5e-3;

/// How well changes of the model can say what is hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Statement {
    /// They say it.
    Exact,
    /// They say the nearest to it.
    Nearest,
    /// There is no such change.
    NotStated,
}

/// The true model, as far as it can be stated.
pub struct TrueModel {
    pub changes: Vec<ModelChange>,
    /// Absorption by octave of materials that are hidden, by name.
    pub absorption: Vec<(String, Vec<f64>)>,
    pub statement: Statement,
    /// What cannot be said, and why.
    pub left_out: Vec<&'static str>,
}

impl TrueModel {
    /// States what is hidden in a room. Of what single recordings have of their own, the first `fitted` responses alone are told: nothing can
    /// be learnt of the others.
    pub fn of(hidden: &[Hidden], lab: &Laboratory, fitted: usize) -> Result<Self, AnyError> {
        let mut model = Self {
            changes: Vec::new(),
            absorption: Vec::new(),
            statement: Statement::Exact,
            left_out: Vec::new(),
        };
        let nothing_hidden = lab.truth(&[])?;
        for (index, one) in hidden.iter().enumerate() {
            match one {
                Hidden::BackgroundNoise { .. } => {
                    let without: Vec<Hidden> = hidden
                        .iter()
                        .enumerate()
                        .filter(|(i, _)| *i != index)
                        .map(|(_, h)| h.clone())
                        .collect();
                    model.changes.push(ModelChange::Noise(noise_per_s(lab, hidden, &without)?));
                }
                Hidden::SurfaceAbsorption { material, absorption } => {
                    let name = lab.scene().materials()[*material].name.clone();
                    model.absorption.push((name, absorption.clone()));
                }
                Hidden::AbsorptionTables { absorption } => {
                    let names = lab.scene().materials().iter().map(|m| m.name.clone());
                    model.absorption.extend(names.zip(absorption.clone()));
                }
                other => model.add(other, lab, &nothing_hidden, fitted),
            }
        }
        Ok(model)
    }

    fn less(&mut self, statement: Statement, reason: &'static str) {
        self.statement = self.statement.max(statement);
        self.left_out.push(reason);
    }

    fn add(&mut self, hidden: &Hidden, lab: &Laboratory, nothing_hidden: &Truth, fitted: usize) {
        match hidden {
            Hidden::ExtraReflector { .. } => {
                self.less(
                    Statement::Nearest,
                    "a panel of the model lets no sound through, and absorbs the same in all octaves",
                );
            }
            Hidden::CoupledVolume { .. } => {
                self.less(Statement::NotStated, "the level falls with the distance from the aperture");
            }
            Hidden::NonlinearDistortion { .. } => {
                self.less(Statement::NotStated, "no change of the model distorts");
            }
            _ => {}
        }
        self.changes.extend(in_space(hidden, lab));
        self.changes.extend(in_air_and_ends(hidden, lab, nothing_hidden));
        self.changes.extend(in_recording(hidden, lab, fitted));
        if let Hidden::GainDrift { .. }
        | Hidden::Dropouts { .. }
        | Hidden::ForeignChirp { .. }
        | Hidden::GrazingAbsorption { .. }
        | Hidden::SeatDip { .. }
        | Hidden::HelmholtzAbsorber { .. }
        | Hidden::LimpWall { .. }
        | Hidden::Fog { .. }
        | Hidden::TemperatureGradient { .. }
        | Hidden::WarmingLoudspeaker { .. }
        | Hidden::ColumnLoudspeaker { .. } = hidden
        {
            self.less(Statement::NotStated, "outside the catalogue");
        }
    }
}

/// What stands elsewhere, or is not in the mesh.
fn in_space(hidden: &Hidden, lab: &Laboratory) -> Option<ModelChange> {
    let [_, size_m] = lab.scene().bounds_m();
    Some(match hidden {
        // The corner at the origin stays, and the middle moves.
        Hidden::RoomDimensions { scale } => ModelChange::Dimensions(Dimensions::new(
            *scale,
            std::array::from_fn(|k| 0.5 * size_m[k] * (scale[k] - 1.0)),
        )),
        Hidden::SurfaceDisplacement { face, offset_m } => {
            let axis = face / 2;
            let (mut point_m, mut normal) = (size_m.map(|l| 0.5 * l), [0.0; 3]);
            (point_m[axis], normal[axis]) =
                if face.is_multiple_of(2) { (0.0, -1.0) } else { (size_m[axis], 1.0) };
            ModelChange::SurfaceDisplacement(DisplacedSurface::new(point_m, normal, *offset_m, [0.0; 2]))
        }
        Hidden::PositionError { end, index, offset_m } => {
            let (id, stated) = match end {
                End::Source => (&lab.sources()[*index].id, lab.sources()[*index].position_m),
                End::Receiver => (&lab.receivers()[*index].id, lab.receivers()[*index].position_m),
            };
            let position_m = std::array::from_fn(|k| stated[k] + offset_m[k]);
            ModelChange::Position { id: id.clone(), position_m }
        }
        Hidden::CoordinateShift { shift_m, turn_deg } => {
            let sources = lab.sources().iter().map(|s| s.position_m);
            let all: Vec<[f64; 3]> = sources.chain(lab.receivers().iter().map(|r| r.position_m)).collect();
            let mean = |k: usize| all.iter().map(|place| place[k]).sum::<f64>() / all.len() as f64;
            ModelChange::CoordinateShift(RigidMotion::new(*shift_m, *turn_deg, [0, 1, 2].map(mean)))
        }
        Hidden::ExtraReflector { centre_m, normal, size_m, reflectance } => {
            let level = normal[0].hypot(normal[1]);
            let along =
                if level > 1e-6 { [-normal[1] / level, normal[0] / level, 0.0] } else { [1.0, 0.0, 0.0] };
            let across = [
                normal[1] * along[2] - normal[2] * along[1],
                normal[2] * along[0] - normal[0] * along[2],
                normal[0] * along[1] - normal[1] * along[0],
            ];
            let mean = reflectance.iter().sum::<f64>() / reflectance.len() as f64;
            let half_m = size_m.map(|side| 0.5 * side);
            ModelChange::Panel(ThinPanel::rectangle(*centre_m, [along, across], half_m, 1.0 - mean))
        }
        Hidden::OpenPatch { face, centre_m, size_m } => {
            let axis = face / 2;
            let own: Vec<usize> = (0..3).filter(|k| *k != axis).collect();
            let unit = |k: usize| std::array::from_fn(|i| f64::from(u8::from(i == k)));
            let mut before_m = *centre_m;
            before_m[axis] += if face.is_multiple_of(2) { BEFORE_WALL_M } else { -BEFORE_WALL_M };
            let half_m = size_m.map(|side| 0.5 * side);
            ModelChange::Panel(ThinPanel::rectangle(before_m, [unit(own[0]), unit(own[1])], half_m, 1.0))
        }
        _ => return None,
    })
}

/// Air, surfaces, and what radiates and hears.
fn in_air_and_ends(hidden: &Hidden, lab: &Laboratory, truth: &Truth) -> Option<ModelChange> {
    Some(match hidden {
        Hidden::AirAbsorption { relative_humidity_percent } => {
            ModelChange::RelativeHumidity(*relative_humidity_percent)
        }
        Hidden::SoundSpeed { temperature_offset_k } => {
            ModelChange::Temperature(lab.air().temperature_c() + temperature_offset_k)
        }
        Hidden::Scattering { scattering } => {
            let materials = lab.scene().materials().iter();
            ModelChange::Scattering(materials.map(|m| (m.name.clone(), scattering.clone())).collect())
        }
        Hidden::AngleDependentAbsorption { share } => ModelChange::LocalReaction(*share),
        Hidden::TransducerResponse { gains_db } => ModelChange::BandGains(gains_db.clone()),
        Hidden::RoomModes { below_hz } if *below_hz > 0.0 => ModelChange::WaveBelow(*below_hz),
        Hidden::SourceDirectivity { omni_share, axis } => {
            let axes = lab.sources().iter().zip(&truth.sources);
            ModelChange::SourcePattern {
                directed_share: omni_share.iter().map(|q| 1.0 - q).collect(),
                axis: axes.map(|(s, own)| (s.id.clone(), axis.unwrap_or(own.axis))).collect(),
            }
        }
        Hidden::ReceiverDirectivity { omni_share, axis } => {
            let directed: Vec<f64> = omni_share.iter().map(|q| 1.0 - q).collect();
            let axes = lab.receivers().iter().zip(&truth.microphones);
            ModelChange::ReceiverPattern {
                directed_share: lab.receivers().iter().map(|r| (r.id.clone(), directed.clone())).collect(),
                axis: axes.map(|(r, own)| (r.id.clone(), axis.unwrap_or(own.axis))).collect(),
            }
        }
        _ => return None,
    })
}

/// What happens to the recording.
fn in_recording(hidden: &Hidden, lab: &Laboratory, fitted: usize) -> Vec<ModelChange> {
    let name = |response: usize| {
        let receivers = lab.receivers().len();
        format!("{}-{}", lab.sources()[response / receivers].id, lab.receivers()[response % receivers].id)
    };
    match hidden {
        Hidden::Truncation { end_s, fade_s } => vec![ModelChange::Truncation([*end_s, *fade_s])],
        Hidden::SamplingClock { ppm } => vec![ModelChange::Clock(*ppm)],
        Hidden::TimeZero { latency_s } => vec![ModelChange::Latency(*latency_s)],
        Hidden::ChannelFault { fault } => vec![match *fault {
            Fault::Polarity { response } => ModelChange::Inverted(name(response)),
            Fault::Gain { response, gain_db } => {
                ModelChange::ResponseGain { response: name(response), gain_db }
            }
            Fault::Swap { a, b } => ModelChange::Exchanged([name(a), name(b)]),
        }],
        Hidden::ChannelResponse { gains_db } => {
            let one = |(response, gain_db): (usize, &Vec<f64>)| ModelChange::ResponseBandGains {
                response: name(response),
                gain_db: gain_db.clone(),
            };
            gains_db.iter().take(fitted).enumerate().map(one).collect()
        }
        _ => Vec::new(),
    }
}

/// Noise by octave: energy per second relative to that of the direct sound at 1 m, which is a pulse as high as the gain of the recording. It
/// is what responses with noise have and the same without it have not.
fn noise_per_s(lab: &Laboratory, with: &[Hidden], without: &[Hidden]) -> Result<Vec<f64>, AnyError> {
    let (noisy, clean) = (lab.responses(with)?, lab.responses(without)?);
    let (bands, rate_hz) = (lab.config().bands, lab.config().sample_rate_hz);
    let bank = FilterBank::new(bands, rate_hz)?;
    let energies = |samples: &[f32]| -> Vec<f64> {
        let split = bank.analyse(samples);
        split.values().iter().map(|band| band.iter().map(|&s| f64::from(s).powi(2)).sum()).collect()
    };
    let mut pulse = vec![0.0f32; rate_hz as usize];
    pulse[rate_hz as usize / 2] = 1.0;
    let of_pulse = energies(&pulse);
    let (mut sums, mut seconds) = (vec![0.0; bands.len()], 0.0);
    let gains_db = lab.truth(with)?.gains_db;
    for ((noisy, clean), gain_db) in noisy.iter().zip(&clean).zip(gains_db) {
        let gain = 10f64.powf(gain_db / 20.0) as f32;
        let rest = noisy.samples().iter().zip(clean.samples());
        let rest: Vec<f32> = rest.map(|(n, c)| (n - c) / gain).collect();
        seconds += rest.len() as f64 / f64::from(rate_hz);
        sums.iter_mut().zip(energies(&rest)).for_each(|(sum, energy)| *sum += energy);
    }
    Ok(sums.iter().zip(of_pulse).map(|(sum, pulse)| sum / seconds / pulse).collect())
}
