//! The effects that a laboratory can hide.

use serde::{Deserialize, Serialize};

/// A physical effect that is at work in the responses and that the declared room does not tell of. Lists per band begin with the
/// lowest octave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "effect", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Hidden {
    /// Loudspeaker and microphone are not flat.
    TransducerResponse {
        /// Gain of each octave in dB, -40 to 40.
        gains_db: Vec<f64>,
    },
    /// The air is drier or damper than declared.
    AirAbsorption {
        /// True relative humidity, 0 to 100 %.
        relative_humidity_percent: f64,
    },
    /// Sources radiate q + (1 - q) cos(angle to the axis), normalised to constant radiated power (mean square over the sphere 1).
    SourceDirectivity {
        /// Omnidirectional share q of each octave, 0 to 1.
        omni_share: Vec<f64>,
        /// The axis, or `None` for each source's own.
        axis: Option<[f64; 3]>,
    },
    /// All surfaces scatter.
    Scattering {
        /// Scattering coefficient of each octave, 0 to 1.
        scattering: Vec<f64>,
    },
    /// A material is not what its table says.
    SurfaceAbsorption {
        /// Index of the material.
        material: usize,
        /// True absorption of each octave, 0 to 0.99.
        absorption: Vec<f64>,
    },
    /// No material is what its table says.
    AbsorptionTables {
        /// True absorption of each material and octave, 0 to 0.99.
        absorption: Vec<Vec<f64>>,
    },
    /// Stationary noise in the room, the same level everywhere.
    BackgroundNoise {
        /// Mean power of each octave's noise relative to the octave's mean power in its strongest 20 ms (median of the
        /// responses), in dB, at most 0.
        levels_db: Vec<f64>,
    },
    /// A second room behind an aperture: a late decay of its own.
    CoupledVolume {
        /// Level of the late field far from the aperture, carried back to the direct sound, relative to the diffuse field of the room's
        /// volume at the emission (energy 4 pi c / V per second), in dB, at most 0.
        level_db: f64,
        /// Decay time of each octave in seconds, 0.05 to 10.
        decay_s: Vec<f64>,
        /// Centre of the aperture in metres.
        aperture_m: [f64; 3],
        /// Distance from the aperture at which its direct radiation equals the late field, in metres: energy falls as
        /// 1 + (critical / distance)^2.
        critical_distance_m: f64,
        /// Time constant of the build-up in seconds, 0.0001 to 1.
        rise_s: f64,
    },
    /// Recordings end early.
    Truncation {
        /// From here on there is digital silence, in seconds from the first sample.
        end_s: f64,
        /// Duration of the raised-cosine fade before it, in seconds.
        fade_s: f64,
    },
    /// The air is warmer or colder than declared: arrival times, and what temperature does to attenuation.
    SoundSpeed {
        /// True temperature less the declared one, in K.
        temperature_offset_k: f64,
    },
    /// The recorder's clock is off.
    SamplingClock {
        /// Samples taken too many, in parts per million, -20000 to 20000.
        ppm: f64,
    },
    /// The room is larger or smaller than its mesh; the corner at the origin stays.
    RoomDimensions {
        /// True over declared length of each axis, 0.8 to 1.25.
        scale: [f64; 3],
    },
    /// One face of the box stands elsewhere; the other five stay where they are, and so does all that stands in the room.
    SurfaceDisplacement {
        /// Face of the box: x = 0, x = length, y = 0, y = width, floor, ceiling.
        face: usize,
        /// How much farther out it stands, in metres, -1 to 1; no place may come nearer to it than 5 cm.
        offset_m: f64,
    },
    /// One place is not where it is said to be.
    PositionError {
        /// Whether a source or a receiver.
        end: End,
        /// Its index.
        index: usize,
        /// True position less the declared one, in metres.
        offset_m: [f64; 3],
    },
    /// All places were measured in coordinates that are not those of the mesh: they are turned about the vertical through their centre, with
    /// the axes of sources and microphones, and shifted.
    CoordinateShift {
        /// True centre of all places less the declared one, in metres, -2 to 2.
        shift_m: [f64; 3],
        /// Turn from x towards y in degrees, -30 to 30.
        turn_deg: f64,
    },
    /// A latency that the declaration denies (or does not know).
    TimeZero {
        /// Latency of all responses in seconds, -0.1 to 1.
        latency_s: f64,
    },
    /// Something is wrong with single recordings.
    ChannelFault {
        /// What.
        fault: Fault,
    },
    /// A flat panel stands in the room that the mesh does not have.
    ExtraReflector {
        /// Its centre in metres.
        centre_m: [f64; 3],
        /// Its unit normal.
        normal: [f64; 3],
        /// Length of the level side and of the other, in metres.
        size_m: [f64; 2],
        /// Share of energy that each octave reflects on either side, 0 to 1; the rest goes through.
        reflectance: Vec<f64>,
    },
    /// A rectangle of a wall is open: what meets the wall there does not come back.
    OpenPatch {
        /// Face of the box: x = 0, x = length, y = 0, y = width, floor, ceiling.
        face: usize,
        /// Centre in metres.
        centre_m: [f64; 3],
        /// Lengths along the two axes of the face in their order, in metres.
        size_m: [f64; 2],
    },
    /// All walls react locally: what they reflect depends on the angle, by a share (in the logarithm) between the same at all angles and that
    /// of a real impedance with the same random-incidence absorption.
    AngleDependentAbsorption {
        /// The share, 0 to 1.
        share: f64,
    },
    /// The loudspeaker is driven too hard while it plays an exponential sweep at full scale: the harmonics of the sweep come before the
    /// direct sound. To be measured in a room that declares a common latency, for the recording begins before the emission.
    NonlinearDistortion {
        /// Length of the sweep in seconds, 0.1 to 60.
        sweep_s: f64,
        /// Its first frequency in Hz.
        from_hz: f64,
        /// Its last frequency in Hz.
        to_hz: f64,
        /// Factor of the squared signal, -1 to 1: the second harmonic has half of it.
        quadratic: f64,
        /// Factor of the cubed signal, -1 to 1: the third harmonic has a quarter of it.
        cubic: f64,
        /// How long before the emission the recordings begin, in seconds, 0 to 5.
        lead_in_s: f64,
    },
    /// Standing waves: below a frequency the response is the sum of the box's modes.
    RoomModes {
        /// Middle of the crossover to the images in Hz, 0 (none) to 1000.
        below_hz: f64,
    },
    /// Microphones hear q + (1 - q) cos(angle to the axis), normalised to constant sensitivity in a diffuse field.
    ReceiverDirectivity {
        /// Omnidirectional share q of each octave, 0 to 1.
        omni_share: Vec<f64>,
        /// The axis of all, or `None` for each microphone's own.
        axis: Option<[f64; 3]>,
    },
    /// Each channel has a frequency response of its own.
    ChannelResponse {
        /// Gain of each octave in dB, -40 to 40, a list for each response.
        gains_db: Vec<Vec<f64>>,
    },
    /// Outside the catalogue: the gain swells and sinks while each response is recorded, as depth sin(2 pi t / period + phase).
    GainDrift {
        /// Greatest deviation in dB.
        depth_db: f64,
        /// Period in seconds.
        period_s: f64,
        /// Phase at the first sample, in radians.
        phase_rad: f64,
    },
    /// Outside the catalogue: moments without sound.
    Dropouts {
        /// The moments.
        gaps: Vec<Gap>,
    },
    /// Outside the catalogue: a material takes the more of the sound that meets it, the more that grazes: `db (1 - cos)^2` at each meeting, cos
    /// being that of the angle to the normal, in bands from a frequency on.
    GrazingAbsorption {
        /// Index of the material.
        material: usize,
        /// What it takes at grazing incidence in dB, 0 to 40.
        db: f64,
        /// The first nominal octave centre in Hz.
        from_hz: f64,
    },
    /// Outside the catalogue: the seat dip. A material takes `db (1 - cos)^2` at each meeting, cos being that of the angle to the normal, times
    /// what a resonator of this frequency and quality takes.
    SeatDip {
        /// Index of the material.
        material: usize,
        /// What it takes at grazing incidence and resonance in dB, 0 to 40.
        db: f64,
        /// Frequency of the resonance in Hz, 20 to 20000.
        f0_hz: f64,
        /// Its quality, 0.05 to 20.
        q: f64,
    },
    /// Outside the catalogue: resonators on a share of a material's area take sound about a frequency, beside what the material absorbs.
    HelmholtzAbsorber {
        /// Index of the material.
        material: usize,
        /// Share of its area, 0 to 0.99.
        share: f64,
        /// Frequency of the resonance in Hz, 20 to 20000.
        f0_hz: f64,
        /// How the specific reactance rises about it, 0.1 to 20.
        q: f64,
        /// Specific resistance, 0.05 to 20: 1 absorbs all of what meets the resonator squarely at its frequency.
        resistance: f64,
    },
    /// Outside the catalogue: a material is a light wall, which lets low sound out (mass law), beside what it absorbs.
    LimpWall {
        /// Index of the material.
        material: usize,
        /// Mass in kg/m2, 0.1 to 100.
        kg_m2: f64,
    },
    /// Outside the catalogue: droplets in the air.
    Fog {
        /// Water in g/m3 of air, 0 to 20.
        water_g_m3: f64,
        /// Radius of the droplets in micrometres, 0.5 to 100.
        radius_um: f64,
    },
    /// The air is warmer the higher it is. Travel times alone.
    TemperatureGradient {
        /// Rise of the temperature in K/m, -10 to 10.
        k_per_m: f64,
        /// Height in metres at which it is as stated.
        stated_at_m: f64,
    },
    /// Outside the catalogue: the loudspeaker warms up from response to response, and its level falls.
    WarmingLoudspeaker {
        /// By how much in the end, in dB, 0 to 20.
        final_db: f64,
        /// Time constant of the temperature, in responses, 0.1 to 1000.
        time_constant: f64,
    },
    /// Outside the catalogue: the loudspeaker is an upright line, its middle where the source is. Particles that rough walls send do not know.
    ColumnLoudspeaker {
        /// Length of the line in metres, 0.01 to 3.
        length_m: f64,
    },
    /// Outside the catalogue: a sweep that is none of the measurement's, in every response.
    ForeignChirp {
        /// Its beginning in seconds from the first sample.
        start_s: f64,
        /// Its length in seconds.
        length_s: f64,
        /// Frequency at its beginning in Hz.
        from_hz: f64,
        /// Frequency at its end in Hz; it moves exponentially.
        to_hz: f64,
        /// Its energy relative to that of the response, between these frequencies and while it lasts, in dB.
        level_db: f64,
    },
}

/// One end of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// Where sound comes from.
    Source,
    /// Where it is heard.
    Receiver,
}

/// What can be wrong with single recordings; responses are counted source by source.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Fault {
    /// Turned over.
    Polarity {
        /// Index of the response.
        response: usize,
    },
    /// Too loud or too soft.
    Gain {
        /// Index of the response.
        response: usize,
        /// By how much, in dB.
        gain_db: f64,
    },
    /// Exchanged.
    Swap {
        /// Index of one response.
        a: usize,
        /// Index of the other.
        b: usize,
    },
}

/// A moment without sound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Index of the response.
    pub response: usize,
    /// Beginning in seconds from the first sample.
    pub start_s: f64,
    /// Length in seconds.
    pub length_s: f64,
}

impl Hidden {
    /// Identifiers of the catalogue's effects.
    pub const CATALOGUE: [&'static str; 25] = [
        "transducer_response",
        "air_absorption",
        "source_directivity",
        "scattering",
        "surface_absorption",
        "background_noise",
        "coupled_volume",
        "truncation",
        "sound_speed",
        "sampling_clock",
        "room_dimensions",
        "position_error",
        "time_zero",
        "channel_fault",
        "extra_reflector",
        "open_patch",
        "nonlinear_distortion",
        "angle_dependent_absorption",
        "room_modes",
        "receiver_directivity",
        "channel_response",
        "surface_displacement",
        "coordinate_shift",
        "temperature_gradient",
        "absorption_tables",
    ];
    /// Names of the effects that no catalogue holds.
    pub const OUTSIDE: [&'static str; 4] = ["gain_drift", "dropouts", "foreign_chirp", "grazing_absorption"];

    /// Identifier in the catalogue, or `outside`.
    pub fn id(&self) -> &'static str {
        let name = self.name();
        if Self::OUTSIDE.contains(&name) { "outside" } else { name }
    }

    /// Name of the effect, whether a catalogue holds it or not.
    pub fn name(&self) -> &'static str {
        match self {
            Self::TransducerResponse { .. } => "transducer_response",
            Self::AirAbsorption { .. } => "air_absorption",
            Self::SourceDirectivity { .. } => "source_directivity",
            Self::Scattering { .. } => "scattering",
            Self::SurfaceAbsorption { .. } => "surface_absorption",
            Self::AbsorptionTables { .. } => "absorption_tables",
            Self::BackgroundNoise { .. } => "background_noise",
            Self::CoupledVolume { .. } => "coupled_volume",
            Self::Truncation { .. } => "truncation",
            Self::SoundSpeed { .. } => "sound_speed",
            Self::SamplingClock { .. } => "sampling_clock",
            Self::RoomDimensions { .. } => "room_dimensions",
            Self::SurfaceDisplacement { .. } => "surface_displacement",
            Self::PositionError { .. } => "position_error",
            Self::CoordinateShift { .. } => "coordinate_shift",
            Self::TimeZero { .. } => "time_zero",
            Self::ChannelFault { .. } => "channel_fault",
            Self::ExtraReflector { .. } => "extra_reflector",
            Self::OpenPatch { .. } => "open_patch",
            Self::NonlinearDistortion { .. } => "nonlinear_distortion",
            Self::AngleDependentAbsorption { .. } => "angle_dependent_absorption",
            Self::RoomModes { .. } => "room_modes",
            Self::ReceiverDirectivity { .. } => "receiver_directivity",
            Self::ChannelResponse { .. } => "channel_response",
            Self::GainDrift { .. } => "gain_drift",
            Self::Dropouts { .. } => "dropouts",
            Self::ForeignChirp { .. } => "foreign_chirp",
            Self::GrazingAbsorption { .. } => "grazing_absorption",
            Self::SeatDip { .. } => "seat_dip",
            Self::HelmholtzAbsorber { .. } => "helmholtz_absorber",
            Self::LimpWall { .. } => "limp_wall",
            Self::Fog { .. } => "fog",
            Self::TemperatureGradient { .. } => "temperature_gradient",
            Self::WarmingLoudspeaker { .. } => "warming_loudspeaker",
            Self::ColumnLoudspeaker { .. } => "column_loudspeaker",
        }
    }
}
