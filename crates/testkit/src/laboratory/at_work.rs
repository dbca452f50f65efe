//! What an effect changes of the truth, if it fits the room.

use super::fog;
use super::hidden::{End, Fault, Hidden};
use super::layered_air;
use super::panel::{self, Panel};
use super::patch::Patch;
use super::truth::Truth;
use super::warming;
use sabine_acoustics::{Air, Error, OutOfRange};

impl Hidden {
    /// Changes the truth. What acts on samples only is looked up there by the stages that follow.
    ///
    /// # Errors
    /// For an effect that does not fit the room.
    pub(crate) fn apply(&self, truth: &mut Truth) -> Result<(), Error> {
        check(truth, self)?;
        match self {
            Self::TransducerResponse { gains_db } => {
                let octaves = truth.bands_hz.len();
                check_octaves(octaves, "gain (dB)", gains_db, (-40.0, 40.0), "between -40 and 40 dB")?;
                truth.source_gains_db.iter_mut().zip(gains_db).for_each(|(g, more)| *g += more);
            }
            Self::AirAbsorption { relative_humidity_percent } => {
                truth.relative_humidity_percent = *relative_humidity_percent;
            }
            Self::SourceDirectivity { omni_share, axis } => {
                for source in &mut truth.sources {
                    source.omni_share.clone_from(omni_share);
                    source.axis = axis.unwrap_or(source.axis);
                }
            }
            Self::ReceiverDirectivity { omni_share, axis } => {
                let octaves = truth.bands_hz.len();
                check_octaves(octaves, "omnidirectional share", omni_share, (0.0, 1.0), "between 0 and 1")?;
                let square = axis.map_or(1.0, |a| a.iter().map(|c| c * c).sum());
                OutOfRange::check("squared length of the axis", square, 0.999_999, 1.000_001, "1")?;
                for microphone in &mut truth.microphones {
                    microphone.omni_share.clone_from(omni_share);
                    microphone.axis = axis.unwrap_or(microphone.axis);
                }
            }
            Self::ChannelResponse { gains_db } => {
                let (expected, found) = (truth.responses(), gains_db.len());
                if expected != found {
                    return Err(Error::Length { expected, found });
                }
                for (own, more) in truth.channel_gains_db.iter_mut().zip(gains_db) {
                    let range = "between -40 and 40 dB";
                    check_octaves(own.len(), "gain of a channel (dB)", more, (-40.0, 40.0), range)?;
                    own.iter_mut().zip(more).for_each(|(g, more)| *g += more);
                }
            }
            Self::Scattering { scattering } => {
                truth.materials.iter_mut().for_each(|m| m.scattering.clone_from(scattering));
            }
            Self::SurfaceAbsorption { material, absorption } => {
                truth.materials[*material].absorption.clone_from(absorption);
            }
            Self::AbsorptionTables { absorption } => {
                for (material, own) in truth.materials.iter_mut().zip(absorption) {
                    material.absorption.clone_from(own);
                }
            }
            Self::SoundSpeed { temperature_offset_k } => truth.temperature_c += temperature_offset_k,
            Self::SamplingClock { ppm } => truth.clock_ppm += ppm,
            Self::RoomDimensions { scale } => {
                truth.size_m.iter_mut().zip(scale).for_each(|(l, s)| *l *= s);
            }
            Self::SurfaceDisplacement { face, offset_m } => displace(truth, *face, *offset_m)?,
            Self::PositionError { end, index, offset_m } => {
                let position = match end {
                    End::Source => &mut truth.sources[*index].position_m,
                    End::Receiver => &mut truth.receivers_m[*index],
                };
                position.iter_mut().zip(offset_m).for_each(|(c, o)| *c += o);
            }
            Self::CoordinateShift { shift_m, turn_deg } => shift_places(truth, *shift_m, *turn_deg),
            Self::TimeZero { latency_s } => {
                truth.latencies_s.iter_mut().for_each(|l| *l += latency_s);
            }
            Self::NonlinearDistortion { lead_in_s, .. } => {
                truth.latencies_s.iter_mut().for_each(|l| *l += lead_in_s);
            }
            Self::ChannelFault { fault: Fault::Polarity { response } } => {
                truth.inverted[*response] = !truth.inverted[*response];
            }
            Self::ChannelFault { fault: Fault::Gain { response, gain_db } } => {
                truth.gains_db[*response] += gain_db;
            }
            Self::WarmingLoudspeaker { .. }
            | Self::Fog { .. }
            | Self::TemperatureGradient { .. }
            | Self::HelmholtzAbsorber { .. }
            | Self::LimpWall { .. }
            | Self::ColumnLoudspeaker { .. } => apply_law(truth, self)?,
            Self::ChannelFault { fault: Fault::Swap { .. } }
            | Self::BackgroundNoise { .. }
            | Self::CoupledVolume { .. }
            | Self::Truncation { .. }
            | Self::ExtraReflector { .. }
            | Self::OpenPatch { .. }
            | Self::AngleDependentAbsorption { .. }
            | Self::RoomModes { .. }
            | Self::GainDrift { .. }
            | Self::Dropouts { .. }
            | Self::GrazingAbsorption { .. }
            | Self::SeatDip { .. }
            | Self::ForeignChirp { .. } => {}
        }
        truth.effects.push(self.clone());
        Ok(())
    }
}

/// Moves a face of the box out. The corner at which coordinates begin goes with it, so that places count from elsewhere.
fn displace(truth: &mut Truth, face: usize, offset_m: f64) -> Result<(), Error> {
    const NEAREST_M: f64 = 0.05;
    if face >= 6 {
        return Err(Error::Index { what: "face", index: face, count: 6 });
    }
    OutOfRange::check("offset of a face (m)", offset_m, -1.0, 1.0, "within 1 m")?;
    let axis = face / 2;
    truth.size_m[axis] += offset_m;
    let places = truth.sources.iter_mut().map(|s| &mut s.position_m).chain(&mut truth.receivers_m);
    let (low, side) = (face.is_multiple_of(2), truth.size_m[axis]);
    for place in places {
        if low {
            place[axis] += offset_m;
        }
        let range = "at least 5 cm before it";
        OutOfRange::check(
            "place before a displaced face (m)",
            place[axis],
            NEAREST_M,
            side - NEAREST_M,
            range,
        )?;
    }
    if low {
        truth.origin_m[axis] -= offset_m;
    }
    Ok(())
}

/// Turns all places about the vertical through their mean, with what looks along an axis, and shifts them.
fn shift_places(truth: &mut Truth, shift_m: [f64; 3], turn_deg: f64) {
    let (sin, cos) = turn_deg.to_radians().sin_cos();
    let all: Vec<[f64; 3]> =
        truth.sources.iter().map(|s| s.position_m).chain(truth.receivers_m.iter().copied()).collect();
    let mean = |k: usize| all.iter().map(|place| place[k]).sum::<f64>() / all.len() as f64;
    let (x, y) = (mean(0), mean(1));
    // What a turn adds, so that none adds nothing.
    let more = |east: f64, north: f64| [(cos - 1.0) * east - sin * north, sin * east + (cos - 1.0) * north];
    let places = truth.sources.iter_mut().map(|s| &mut s.position_m).chain(&mut truth.receivers_m);
    for place in places {
        let [east, north] = more(place[0] - x, place[1] - y);
        place
            .iter_mut()
            .zip([east, north, 0.0])
            .zip(shift_m)
            .for_each(|((c, turn), shift)| *c += turn + shift);
    }
    let axes = truth.sources.iter_mut().map(|s| &mut s.axis);
    for axis in axes.chain(truth.microphones.iter_mut().map(|m| &mut m.axis)) {
        let [east, north] = more(axis[0], axis[1]);
        axis[0] += east;
        axis[1] += north;
    }
}

/// Refuses an effect that does not fit the room; those that are not here say so themselves ([`Hidden::apply`]).
fn check(truth: &Truth, effect: &Hidden) -> Result<(), Error> {
    let bands = truth.bands_hz.len();
    let each =
        |field, values: &[f64], low, high, range| check_octaves(bands, field, values, (low, high), range);
    let exists = |what, index: usize, count: usize| {
        if index < count { Ok(()) } else { Err(Error::Index { what, index, count }) }
    };
    let responses = truth.responses();
    match effect {
        Hidden::AirAbsorption { relative_humidity_percent } => Ok(OutOfRange::check(
            "relative humidity (%)",
            *relative_humidity_percent,
            0.0,
            100.0,
            "between 0 and 100 %",
        )?),
        Hidden::SourceDirectivity { omni_share, axis } => {
            each("omnidirectional share", omni_share, 0.0, 1.0, "between 0 and 1")?;
            let square = axis.map_or(1.0, |a| a.iter().map(|c| c * c).sum());
            Ok(OutOfRange::check("squared length of the axis", square, 0.999_999, 1.000_001, "1")?)
        }
        Hidden::Scattering { scattering } => each("scattering", scattering, 0.0, 1.0, "between 0 and 1"),
        Hidden::SurfaceAbsorption { material, absorption } => {
            exists("material", *material, truth.materials.len())?;
            each("absorption", absorption, 0.0, 0.99, "between 0 and 0.99")
        }
        Hidden::AbsorptionTables { absorption } => {
            let (expected, found) = (truth.materials.len(), absorption.len());
            if expected != found {
                return Err(Error::Length { expected, found });
            }
            absorption.iter().try_for_each(|own| each("absorption", own, 0.0, 0.99, "between 0 and 0.99"))
        }
        Hidden::BackgroundNoise { levels_db } => {
            each("noise level (dB)", levels_db, -300.0, 0.0, "between -300 and 0 dB")
        }
        Hidden::CoupledVolume { level_db, decay_s, critical_distance_m, rise_s, aperture_m } => {
            OutOfRange::check(
                "level of the coupled volume (dB)",
                *level_db,
                -300.0,
                0.0,
                "between -300 and 0 dB",
            )?;
            each("decay time of the coupled volume (s)", decay_s, 0.05, 10.0, "between 0.05 and 10 s")?;
            OutOfRange::check(
                "critical distance (m)",
                *critical_distance_m,
                0.0,
                100.0,
                "between 0 and 100 m",
            )?;
            OutOfRange::check("build-up (s)", *rise_s, 1e-4, 1.0, "between 0.0001 and 1 s")?;
            Ok(aperture_m.iter().try_for_each(|&c| {
                OutOfRange::check("position of the aperture (m)", c, -1.0, 100.0, "near the room")
            })?)
        }
        Hidden::Truncation { end_s, fade_s } => {
            OutOfRange::check("end (s)", *end_s, 0.0, 100.0, "between 0 and 100 s")?;
            Ok(OutOfRange::check("fade (s)", *fade_s, 0.0, *end_s, "between 0 and the end")?)
        }
        // The air says for itself what temperatures it takes.
        Hidden::SoundSpeed { temperature_offset_k } => Air::new(
            truth.temperature_c + temperature_offset_k,
            truth.relative_humidity_percent,
            truth.pressure_kpa,
        )
        .map(|_| ()),
        Hidden::SamplingClock { ppm } => {
            Ok(OutOfRange::check("clock error (ppm)", *ppm, -2e4, 2e4, "between -20000 and 20000 ppm")?)
        }
        Hidden::RoomDimensions { scale } => Ok(scale.iter().try_for_each(|&s| {
            OutOfRange::check("scale of the room", s, 0.8, 1.25, "between 0.8 and 1.25")
        })?),
        Hidden::PositionError { end, index, offset_m } => {
            match end {
                End::Source => exists("source", *index, truth.sources.len()),
                End::Receiver => exists("receiver", *index, truth.receivers_m.len()),
            }?;
            Ok(offset_m
                .iter()
                .try_for_each(|&o| OutOfRange::check("offset (m)", o, -10.0, 10.0, "within 10 m"))?)
        }
        Hidden::CoordinateShift { shift_m, turn_deg } => {
            for shift in shift_m {
                OutOfRange::check("shift of all places (m)", *shift, -2.0, 2.0, "within 2 m")?;
            }
            Ok(OutOfRange::check("turn of all places (deg)", *turn_deg, -30.0, 30.0, "within 30 degrees")?)
        }
        Hidden::TimeZero { latency_s } => {
            Ok(OutOfRange::check("latency (s)", *latency_s, -0.1, 1.0, "between -0.1 and 1 s")?)
        }
        Hidden::ChannelFault { fault } => match *fault {
            Fault::Polarity { response } => exists("response", response, responses),
            Fault::Gain { response, gain_db } => {
                exists("response", response, responses)?;
                Ok(OutOfRange::check("gain (dB)", gain_db, -60.0, 60.0, "between -60 and 60 dB")?)
            }
            Fault::Swap { a, b } => {
                exists("response", a, responses).and_then(|()| exists("response", b, responses))
            }
        },
        Hidden::ExtraReflector { centre_m, normal, size_m, reflectance } => {
            each("reflectance", reflectance, 0.0, 1.0, "between 0 and 1")?;
            panel::check(truth, &Panel::new(*centre_m, *normal, *size_m, reflectance.clone()))
        }
        Hidden::OpenPatch { face, centre_m, size_m } => Patch::new(*face, *centre_m, *size_m).check(truth),
        Hidden::AngleDependentAbsorption { share } => {
            Ok(OutOfRange::check("share of local reaction", *share, 0.0, 1.0, "between 0 and 1")?)
        }
        Hidden::NonlinearDistortion { sweep_s, from_hz, to_hz, quadratic, cubic, lead_in_s } => {
            OutOfRange::check("length of the sweep (s)", *sweep_s, 0.1, 60.0, "between 0.1 and 60 s")?;
            OutOfRange::check("first frequency (Hz)", *from_hz, 1.0, 20e3, "between 1 Hz and 20 kHz")?;
            OutOfRange::check(
                "last frequency (Hz)",
                *to_hz,
                2.0 * from_hz,
                96e3,
                "an octave above the first",
            )?;
            for factor in [quadratic, cubic] {
                OutOfRange::check("factor of a power", *factor, -1.0, 1.0, "between -1 and 1")?;
            }
            Ok(OutOfRange::check("lead-in (s)", *lead_in_s, 0.0, 5.0, "between 0 and 5 s")?)
        }
        Hidden::RoomModes { below_hz } => Ok(OutOfRange::check(
            "crossover of the modes (Hz)",
            *below_hz,
            0.0,
            1000.0,
            "between 0 and 1000 Hz",
        )?),
        Hidden::GainDrift { depth_db, period_s, phase_rad } => {
            OutOfRange::check("depth (dB)", *depth_db, -40.0, 40.0, "between -40 and 40 dB")?;
            OutOfRange::check("period (s)", *period_s, 1e-3, 100.0, "between 0.001 and 100 s")?;
            Ok(OutOfRange::check("phase (rad)", *phase_rad, -100.0, 100.0, "between -100 and 100")?)
        }
        Hidden::Dropouts { gaps } => gaps.iter().try_for_each(|gap| {
            exists("response", gap.response, responses)?;
            OutOfRange::check("beginning of a gap (s)", gap.start_s, 0.0, 100.0, "between 0 and 100 s")?;
            Ok(OutOfRange::check("length of a gap (s)", gap.length_s, 0.0, 10.0, "between 0 and 10 s")?)
        }),
        Hidden::GrazingAbsorption { material, db, .. } => {
            exists("material", *material, truth.materials.len())?;
            Ok(OutOfRange::check(
                "absorption at grazing incidence (dB)",
                *db,
                0.0,
                40.0,
                "between 0 and 40 dB",
            )?)
        }
        Hidden::SeatDip { material, db, f0_hz, q } => {
            exists("material", *material, truth.materials.len())?;
            OutOfRange::check("depth of the seat dip (dB)", *db, 0.0, 40.0, "between 0 and 40 dB")?;
            OutOfRange::check(
                "frequency of the seat dip (Hz)",
                *f0_hz,
                20.0,
                2e4,
                "between 20 Hz and 20 kHz",
            )?;
            Ok(OutOfRange::check("quality of the seat dip", *q, 0.05, 20.0, "between 0.05 and 20")?)
        }
        Hidden::ForeignChirp { start_s, length_s, from_hz, to_hz, level_db } => {
            OutOfRange::check("beginning (s)", *start_s, 0.0, 100.0, "between 0 and 100 s")?;
            OutOfRange::check("length (s)", *length_s, 1e-3, 10.0, "between 0.001 and 10 s")?;
            for frequency_hz in [from_hz, to_hz] {
                OutOfRange::check("frequency (Hz)", *frequency_hz, 10.0, 96e3, "between 10 Hz and 96 kHz")?;
            }
            Ok(OutOfRange::check("level (dB)", *level_db, -300.0, 60.0, "between -300 and 60 dB")?)
        }
        _ => Ok(()),
    }
}

/// Refuses a law that does not fit the room, and lowers levels; all else is looked up where sound meets walls, air and loudspeakers.
fn apply_law(truth: &mut Truth, law: &Hidden) -> Result<(), Error> {
    match law {
        Hidden::WarmingLoudspeaker { final_db, time_constant } => {
            warming::apply(truth, *final_db, *time_constant)
        }
        Hidden::Fog { water_g_m3, radius_um } => fog::check(*water_g_m3, *radius_um),
        Hidden::TemperatureGradient { k_per_m, stated_at_m } => {
            layered_air::check(truth, *k_per_m, *stated_at_m)
        }
        wall_or_column => check_wall_or_column(truth, wall_or_column),
    }
}

/// Refuses a wall or a column that there is not.
fn check_wall_or_column(truth: &Truth, effect: &Hidden) -> Result<(), Error> {
    let ranges: &[(&'static str, f64, f64, f64, &'static str)] = match effect {
        Hidden::HelmholtzAbsorber { share, f0_hz, q, resistance, .. } => &[
            ("share of resonators", *share, 0.0, 0.99, "between 0 and 0.99"),
            ("frequency of resonators (Hz)", *f0_hz, 20.0, 2e4, "between 20 Hz and 20 kHz"),
            ("reactance of resonators", *q, 0.1, 20.0, "between 0.1 and 20"),
            ("resistance of resonators", *resistance, 0.05, 20.0, "between 0.05 and 20"),
        ],
        Hidden::LimpWall { kg_m2, .. } => {
            &[("mass of a wall (kg/m2)", *kg_m2, 0.1, 100.0, "between 0.1 and 100 kg/m2")]
        }
        Hidden::ColumnLoudspeaker { length_m } => {
            &[("length of a column (m)", *length_m, 0.01, 3.0, "between 0.01 and 3 m")]
        }
        _ => &[],
    };
    ranges
        .iter()
        .try_for_each(|&(what, value, low, high, range)| OutOfRange::check(what, value, low, high, range))?;
    match *effect {
        Hidden::HelmholtzAbsorber { material, .. } | Hidden::LimpWall { material, .. }
            if material >= truth.materials.len() =>
        {
            Err(Error::Index { what: "material", index: material, count: truth.materials.len() })
        }
        _ => Ok(()),
    }
}

/// Refuses a list that does not have a value within limits for each octave.
fn check_octaves(
    octaves: usize,
    field: &'static str,
    values: &[f64],
    (low, high): (f64, f64),
    range: &'static str,
) -> Result<(), Error> {
    let (expected, found) = (octaves, values.len());
    if expected != found {
        return Err(Error::BandCount { expected, found });
    }
    Ok(values.iter().try_for_each(|&v| OutOfRange::check(field, v, low, high, range))?)
}
