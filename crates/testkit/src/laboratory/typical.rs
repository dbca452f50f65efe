//! Effects as they occur, by strength.

use super::Laboratory;
use super::box_decay::BoxDecay;
use super::hidden::{End, Fault, Gap, Hidden};
use super::missing_surfaces;
use super::modal_field;
use super::random_room::face_areas_m2;
use super::stream::{Purpose, stream};
use super::truth::Truth;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::{Error, OutOfRange};

impl Hidden {
    /// An effect of a strength: 1 is a strong, plain case, 0 leaves the effect out, and what lies between is proportionate (levels:
    /// proportionate in amplitude; faults of polarity and order: there or not there). Signs and details follow from the seed.
    ///
    /// The id is one of [`Hidden::CATALOGUE`] or [`Hidden::OUTSIDE`]; `channel_fault.polarity`, `channel_fault.gain` and
    /// `channel_fault.swap` ask for one kind, `coordinate_shift.shift` for a shift without a turn.
    ///
    /// # Errors
    /// [`Error::UnknownId`]; [`Error::OutOfRange`] for a strength outside 0 to 3; [`Error::Length`] for a swap where there is one
    /// response only.
    pub fn random(id: &str, strength: f64, lab: &Laboratory, seed: u64) -> Result<Self, Error> {
        OutOfRange::check("strength", strength, 0.0, 3.0, "between 0 and 3")?;
        let mut random = stream(seed, Purpose::Effect, 0);
        match id {
            "receiver_directivity" => {
                let share = strength * random.random_range(0.35..0.5);
                let drawn: [f64; 3] = std::array::from_fn(|_| random.sample(StandardNormal));
                let length = drawn.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-9);
                let in_line = random.random::<bool>() && !lab.config().microphone_axes;
                Ok(Self::ReceiverDirectivity {
                    omni_share: vec![(1.0 - share).max(0.0); lab.null().bands_hz.len()],
                    axis: in_line.then(|| drawn.map(|c| c / length)),
                })
            }
            "channel_response" => {
                let truth = lab.null();
                let one = |_| smooth(&mut random, truth.bands_hz.len(), 4.0 * strength);
                Ok(Self::ChannelResponse { gains_db: (0..truth.responses()).map(one).collect() })
            }
            _ => draw(id, strength, lab, seed, &mut random),
        }
    }
}

/// An effect of the catalogue, or one outside it, of a strength.
fn draw(id: &str, strength: f64, lab: &Laboratory, seed: u64, r: &mut Pcg64Mcg) -> Result<Hidden, Error> {
    let truth = lab.null();
    let decay_s = decay_s(truth)?;
    Ok(match id {
        "transducer_response" => {
            Hidden::TransducerResponse { gains_db: smooth(r, truth.bands_hz.len(), 5.0 * strength) }
        }
        "air_absorption" => air_absorption(r, truth, strength),
        "source_directivity" => source_directivity(r, truth, strength),
        "scattering" => scattering(r, truth, strength),
        "surface_absorption" => surface_absorption(r, truth, strength),
        "absorption_tables" => Hidden::AbsorptionTables {
            absorption: truth
                .materials
                .iter()
                .map(|m| of_another_product(r, &m.absorption, strength))
                .collect(),
        },
        "background_noise" => {
            let middle_db = -35.0 + 10.0 * unit(r);
            let slope_db = 2.0 * (2.0 * unit(r) - 1.0);
            Hidden::BackgroundNoise {
                levels_db: tilted(truth, |o| level_db(middle_db, strength) + slope_db * o),
            }
        }
        "coupled_volume" => coupled_volume(r, truth, decay_s, strength),
        "truncation" => truncation(r, truth, decay_s, strength),
        "sound_speed" => Hidden::SoundSpeed { temperature_offset_k: 8.0 * strength * sign(r) },
        "temperature_gradient" => Hidden::TemperatureGradient {
            k_per_m: strength * sign(r) * (2.0 + unit(r)),
            stated_at_m: 1.0 + 0.5 * unit(r),
        },
        "sampling_clock" => Hidden::SamplingClock { ppm: 900.0 * strength * sign(r) },
        "room_dimensions" => {
            let mut axes = [0, 1, 2];
            axes.shuffle(r);
            let mut scale = [1.0; 3];
            // One axis alone would be one displaced face.
            for axis in axes.into_iter().take(r.random_range(2..=3)) {
                scale[axis] = 1.0 + strength * sign(r) * (0.02 + 0.01 * unit(r));
            }
            Hidden::RoomDimensions { scale }
        }
        "surface_displacement" => surface_displacement(r, truth, strength),
        "position_error" => position_error(r, truth, strength),
        "coordinate_shift" | "coordinate_shift.shift" => coordinate_shift(r, truth, strength, id),
        "time_zero" => Hidden::TimeZero { latency_s: 5e-3 * strength },
        "channel_fault" => {
            let kinds = ["channel_fault.polarity", "channel_fault.gain", "channel_fault.swap"];
            let kind = kinds[r.random_range(0..if truth.responses() > 1 { 3 } else { 2 })];
            return Hidden::random(kind, strength, lab, seed);
        }
        "channel_fault.polarity" if strength > 0.0 => {
            let response = r.random_range(0..truth.responses());
            Hidden::ChannelFault { fault: Fault::Polarity { response } }
        }
        // A gain of 0 dB is no fault at all.
        "channel_fault.gain" | "channel_fault.polarity" => {
            let response = r.random_range(0..truth.responses());
            Hidden::ChannelFault { fault: Fault::Gain { response, gain_db: 10.0 * strength * sign(r) } }
        }
        "channel_fault.swap" => swap(r, truth, strength)?,
        "extra_reflector" => missing_surfaces::extra_reflector(r, truth, strength),
        "open_patch" => missing_surfaces::open_patch(r, truth, strength),
        "angle_dependent_absorption" => Hidden::AngleDependentAbsorption { share: strength.min(1.0) },
        "nonlinear_distortion" => nonlinear_distortion(r, strength),
        "room_modes" => {
            Hidden::RoomModes { below_hz: strength * modal_field::typical_below_hz(truth, decay_s) }
        }
        "gain_drift" => Hidden::GainDrift {
            depth_db: 4.0 * strength,
            period_s: 0.15 + 0.15 * unit(r),
            phase_rad: std::f64::consts::TAU * unit(r),
        },
        "dropouts" => dropouts(r, truth, decay_s, strength),
        // The floor, as carpets do, from 1 or 2 kHz up.
        "grazing_absorption" => Hidden::GrazingAbsorption {
            material: truth.faces[4],
            db: strength * (5.0 + 3.0 * unit(r)),
            from_hz: if r.random::<bool>() { 1000.0 } else { 2000.0 },
        },
        // The floor, as rows of seats do, but higher and deeper than most.
        "seat_dip" => Hidden::SeatDip {
            material: truth.faces[4],
            db: strength * (15.0 + 8.0 * unit(r)),
            f0_hz: 500.0 * 2f64.powf(1.5 * unit(r)),
            q: 0.5,
        },
        "foreign_chirp" => foreign_chirp(r, truth, decay_s, strength),
        _ => return Err(Error::UnknownId { id: id.to_owned() }),
    })
}

/// Dry where the room is damp, and damp where it is dry.
fn air_absorption(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let declared = truth.relative_humidity_percent;
    let far = if declared > 35.0 { 12.0 + 6.0 * unit(r) } else { 75.0 + 10.0 * unit(r) };
    // Along the logarithm: attenuation follows it more nearly.
    let humidity = declared * (far / declared).powf(strength);
    Hidden::AirAbsorption { relative_humidity_percent: humidity.clamp(5.0, 95.0) }
}

/// Omnidirectional at the lowest octave, a cardioid at the highest.
fn source_directivity(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let bands = truth.bands_hz.len();
    let highest = 0.5 + 0.1 * (unit(r) - 0.5);
    let rise = 0.7 + 0.6 * unit(r);
    let share = |b: usize| {
        let x = if bands > 1 { b as f64 / (bands - 1) as f64 } else { 1.0 };
        (1.0 - strength * (1.0 - highest) * x.powf(rise)).clamp(0.0, 1.0)
    };
    Hidden::SourceDirectivity { omni_share: (0..bands).map(share).collect(), axis: None }
}

fn scattering(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let (low, high) = (0.25 + 0.15 * unit(r), 0.4 + 0.15 * unit(r));
    let last = (truth.bands_hz.len().max(2) - 1) as f64;
    let value = |b: usize| (strength * (low + (high - low) * b as f64 / last)).min(0.95);
    Hidden::Scattering { scattering: (0..truth.bands_hz.len()).map(value).collect() }
}

/// A material of some area, far from its table in all octaves alike.
fn surface_absorption(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let mut areas = vec![0.0; truth.materials.len()];
    for (area, material) in face_areas_m2(truth.size_m).into_iter().zip(truth.faces) {
        areas[material] += area;
    }
    let total: f64 = areas.iter().sum();
    let mut large: Vec<usize> = (0..areas.len()).filter(|&m| areas[m] > 0.08 * total).collect();
    large.shuffle(r);
    let material = large.first().copied().unwrap_or(0);
    let table = &truth.materials[material].absorption;
    let mean = table.iter().sum::<f64>() / table.len() as f64;
    let shift = strength * if mean < 0.4 { 0.45 } else { -0.35 };
    Hidden::SurfaceAbsorption {
        material,
        absorption: table
            .iter()
            .map(|a| if shift == 0.0 { *a } else { (a + shift).clamp(0.02, 0.95) })
            .collect(),
    }
}

/// Absorption off by a factor of 1.35 to 2 in either direction, and by up to 15 % more or less from octave to octave.
fn of_another_product(r: &mut Pcg64Mcg, table: &[f64], strength: f64) -> Vec<f64> {
    let common = sign(r) * (0.3 + 0.4 * unit(r));
    let mut own = |a: &f64| {
        let off = strength * (common + 0.15 * (2.0 * unit(r) - 1.0));
        if off == 0.0 { *a } else { (a * off.exp()).clamp(0.005, 0.95) }
    };
    table.iter().map(&mut own).collect()
}

/// A decay 1.5 to 3 times as long as the room's at 1 kHz, at most 2.5 s.
fn coupled_volume(r: &mut Pcg64Mcg, truth: &Truth, decay_s: f64, strength: f64) -> Hidden {
    let middle_s = (decay_s * (1.5 + 1.5 * unit(r))).min(2.5);
    let tilt = 0.08 * (unit(r) - 0.8);
    let decay_s = tilted(truth, |octaves| (middle_s * (tilt * octaves).exp()).clamp(0.3, 2.5));
    let wall = r.random_range(0..4);
    let mut aperture_m: [f64; 3] = std::array::from_fn(|k| 0.5 + (truth.size_m[k] - 1.0) * unit(r));
    aperture_m[wall / 2] = if wall % 2 == 0 { 0.0 } else { truth.size_m[wall / 2] };
    Hidden::CoupledVolume {
        level_db: level_db(-30.0 + 10.0 * unit(r), strength),
        decay_s,
        aperture_m,
        critical_distance_m: 1.0 + unit(r),
        rise_s: 5e-3 + 5e-3 * unit(r),
    }
}

/// Strength 1 ends where the decay at 1 kHz is 25 to 30 dB down; strength 0 at the end of the response.
fn truncation(r: &mut Pcg64Mcg, truth: &Truth, decay_s: f64, strength: f64) -> Hidden {
    let from_end = truth.duration_s + latest_s(truth);
    let strong_s = decay_s * (25.0 + 5.0 * unit(r)) / 60.0 + latest_s(truth);
    let end_s = (from_end - strength * (from_end - strong_s)).max(0.03);
    let fade_s = if strength == 0.0 { 0.0 } else { (0.01 + 0.03 * unit(r)).min(0.3 * end_s) };
    // Nothing is left to end after the last sample.
    Hidden::Truncation { end_s: if strength == 0.0 { end_s + 1.0 } else { end_s }, fade_s }
}

/// A face that stands 0.2 to 0.45 m farther out or in at strength 1, and no nearer to any place than 15 cm.
fn surface_displacement(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let face = r.random_range(0..6);
    let (axis, side) = (face / 2, truth.size_m[face / 2]);
    let is_low = face.is_multiple_of(2);
    let before_m = |place: &[f64; 3]| if is_low { place[axis] } else { side - place[axis] };
    let sources = truth.sources.iter().map(|s| before_m(&s.position_m));
    let nearest_m = sources.chain(truth.receivers_m.iter().map(before_m)).fold(f64::INFINITY, f64::min);
    let offset_m = (strength * sign(r) * (0.2 + 0.25 * unit(r))).clamp(0.15 - nearest_m, 1.0);
    Hidden::SurfaceDisplacement { face, offset_m }
}

/// In any direction; at strength 1 no place comes nearer to a wall than 0.3 m.
fn position_error(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Hidden {
    let (sources, receivers) = (truth.sources.len(), truth.receivers_m.len());
    let pick = r.random_range(0..sources + receivers);
    let (end, index) = if pick < sources { (End::Source, pick) } else { (End::Receiver, pick - sources) };
    let way: [f64; 3] = std::array::from_fn(|_| r.sample(StandardNormal));
    let length = way.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-9);
    Hidden::PositionError { end, index, offset_m: way.map(|c| 0.3 * strength * c / length) }
}

/// By 0.3 m in any direction and, but for `coordinate_shift.shift`, by 3 degrees at strength 1, or by as much less as brings no place nearer to a wall than 15 cm.
fn coordinate_shift(r: &mut Pcg64Mcg, truth: &Truth, strength: f64, id: &str) -> Hidden {
    const STEPS: i32 = 20;
    let way: [f64; 3] = std::array::from_fn(|_| r.sample(StandardNormal));
    let length = way.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-9);
    let turn_deg = if id == "coordinate_shift" { 3.0 * sign(r) } else { 0.0 };
    let of = |strength: f64| Hidden::CoordinateShift {
        shift_m: way.map(|c| 0.3 * strength * c / length),
        turn_deg: strength * turn_deg,
    };
    let fits = |hidden: &Hidden| {
        let mut moved = truth.clone();
        let places = |t: &Truth| -> Vec<[f64; 3]> {
            t.sources.iter().map(|s| s.position_m).chain(t.receivers_m.iter().copied()).collect()
        };
        let is_free = |place: &[f64; 3]| (0..3).all(|k| (0.15..=truth.size_m[k] - 0.15).contains(&place[k]));
        hidden.apply(&mut moved).is_ok() && places(&moved).iter().all(is_free)
    };
    (0..STEPS)
        .map(|step| of(strength * f64::from(STEPS - step) / f64::from(STEPS)))
        .find(fits)
        .unwrap_or_else(|| of(0.0))
}

fn swap(r: &mut Pcg64Mcg, truth: &Truth, strength: f64) -> Result<Hidden, Error> {
    let responses = truth.responses();
    if responses < 2 {
        return Err(Error::Length { expected: 2, found: responses });
    }
    let a = r.random_range(0..responses);
    let b = (a + r.random_range(1..responses)) % responses;
    Ok(Hidden::ChannelFault { fault: Fault::Swap { a, b: if strength > 0.0 { b } else { a } } })
}

/// A sweep of 3 to 5 s; harmonics at -28 to -36 and -34 to -42 dB for strength 1.
fn nonlinear_distortion(r: &mut Pcg64Mcg, strength: f64) -> Hidden {
    let (from_hz, to_hz) = (40.0f64, 20_000.0f64);
    let sweep_s = 3.0 + 2.0 * unit(r);
    let growth_s = sweep_s / (to_hz / from_hz).ln();
    let factor = |level_db: f64| (strength * 10f64.powf(level_db / 20.0)).min(1.0);
    Hidden::NonlinearDistortion {
        sweep_s,
        from_hz,
        to_hz,
        quadratic: sign(r) * 2.0 * factor(-32.0 + 8.0 * (unit(r) - 0.5)),
        cubic: -4.0 * factor(-38.0 + 8.0 * (unit(r) - 0.5)),
        // Both harmonics are within the recording, if there are any.
        lead_in_s: if strength > 0.0 { growth_s * 3f64.ln() + 0.1 } else { 0.0 },
    }
}

/// Three gaps in each response, before it has fallen by 25 dB.
fn dropouts(r: &mut Pcg64Mcg, truth: &Truth, decay_s: f64, strength: f64) -> Hidden {
    let mut gaps = Vec::new();
    if strength > 0.0 {
        for response in 0..truth.responses() {
            for _ in 0..3 {
                let start_s = truth.latencies_s[response] + 0.015 + decay_s * 25.0 / 60.0 * unit(r);
                gaps.push(Gap { response, start_s, length_s: strength * (0.015 + 0.025 * unit(r)) });
            }
        }
    }
    Hidden::Dropouts { gaps }
}

/// Over one to three octaves, as loud as the decay where it sounds.
fn foreign_chirp(r: &mut Pcg64Mcg, truth: &Truth, decay_s: f64, strength: f64) -> Hidden {
    let (lowest, highest) = (truth.bands_hz[0], truth.bands_hz[truth.bands_hz.len() - 1]);
    let span = 2f64.powf((1.0 + 2.0 * unit(r)).min((2.0 * highest / lowest).log2()));
    let from_hz = lowest / 2f64.sqrt() * (2.0 * highest / lowest / span).powf(unit(r));
    let falling = r.random::<bool>();
    let (from_hz, to_hz) = if falling { (from_hz * span, from_hz) } else { (from_hz, from_hz * span) };
    Hidden::ForeignChirp {
        start_s: latest_s(truth) + 0.03 + decay_s * (10.0 + 15.0 * unit(r)) / 60.0,
        length_s: 0.05 + 0.1 * unit(r),
        from_hz,
        to_hz,
        level_db: if strength > 0.0 { 3.0 + 20.0 * strength.log10() } else { -300.0 },
    }
}

/// Decay time of the box in the octave nearest to 1 kHz, from its first 30 dB.
fn decay_s(truth: &Truth) -> Result<f64, Error> {
    let medium = truth.medium()?;
    let fallen = BoxDecay::new(truth, &medium, truth.duration_s).fallen_s(&medium, 30.0);
    let octaves = |band: usize| (truth.bands_hz[band] / 1000.0).log2().abs();
    let middle = (0..fallen.len()).min_by(|&a, &b| octaves(a).total_cmp(&octaves(b)));
    Ok(2.0 * middle.map_or(truth.duration_s, |band| fallen[band]))
}

fn latest_s(truth: &Truth) -> f64 {
    truth.latencies_s.iter().copied().fold(0.0, f64::max)
}

/// A level for strength 1, with the amplitude in proportion; -200 dB or less for none.
fn level_db(strong_db: f64, strength: f64) -> f64 {
    (strong_db + 20.0 * strength.max(1e-10).log10()).min(0.0)
}

/// A value for each band by its distance from 1 kHz in octaves.
fn tilted(truth: &Truth, value: impl Fn(f64) -> f64) -> Vec<f64> {
    truth.bands_hz.iter().map(|hz| value((hz / 1000.0).log2())).collect()
}

/// A smooth curve over bands between about plus and minus a depth.
fn smooth(r: &mut Pcg64Mcg, bands: usize, depth: f64) -> Vec<f64> {
    let (phase, waves) = (std::f64::consts::TAU * unit(r), 0.6 + 0.7 * unit(r));
    let last = (bands.max(2) - 1) as f64;
    (0..bands).map(|b| depth * (phase + std::f64::consts::TAU * waves * b as f64 / last).sin()).collect()
}

fn unit(r: &mut Pcg64Mcg) -> f64 {
    r.random()
}

fn sign(r: &mut Pcg64Mcg) -> f64 {
    if r.random() { 1.0 } else { -1.0 }
}
